"""Printed drafts, read back from their pages and compared with the drafts."""

from __future__ import annotations

import re
import zlib
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.draft_print.chart import interlacing_edges, merge_cells
from spacemap_vtk.draw.draft_print.groups import Groups
from spacemap_vtk.draw.draft_print.paper import word_width, wrap_words
from spacemap_vtk.draw.draft_print.settings import PrintSettings, local_paper
from spacemap_vtk.draw.draft_print.sheet import MOST_PAGES, DraftSheet
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.io.formats.pictures import write_figure
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom

POINT = 25.4 / 72
#: Two blocks of four shafts, threaded and treadled alike.
BLOCKS = ([1, 2, 3, 4] * 6 + [5, 6, 7, 8] * 3) * 4 + [1]
TIEUP = tuple((k, (k + 1) % 4 + 1, 5 + k % 4) for k in range(1, 5)) + tuple(
    (k, 5 + k % 4, (k + 1) % 4 + 1) for k in range(5, 9)
)


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as done:
        main([str(each) for each in arguments])
    return int(done.value.code or 0)


def block_draft(ends: int, picks: int, **more: object) -> Draft:
    loom = Loom(
        tuple((shaft,) for shaft in np.resize(BLOCKS, ends).tolist()),
        TIEUP,
        tuple((treadle,) for treadle in np.resize(BLOCKS, picks).tolist()),
    )
    return Draft(loom.drawdown(), loom, **more)  # type: ignore[arg-type]


def write(draft: Draft, folder: Path, name: str = "draft") -> Path:
    file = folder / f"{name}.wif"
    file.write_bytes(format_wif(draft))
    return file


class SvgPage:
    """A page as an SVG: its texts, and the shapes with a name."""

    def __init__(self, file: Path) -> None:
        self.root = ElementTree.parse(file).getroot()
        self.texts = ["".join(e.itertext()) for e in self.root.iter() if e.tag[-4:] == "text"]

    def find(self, pattern: str) -> re.Match[str]:
        found = [match for text in self.texts if (match := re.fullmatch(pattern, text))]
        assert len(found) == 1, (pattern, self.texts[:8])
        return found[0]

    def shape(self, name: str) -> np.ndarray:
        """Return the corners of the polygons of a shape (n, points, 2), in points."""
        path = next((e for e in self.root.iter() if e.get("id") == name), None)
        data = "" if path is None else path[0].get("d") or ""
        numbers = [
            np.array(re.findall(r"[-\d.]+", part), float).reshape(-1, 2)
            for part in data.split("M")[1:]
        ]
        return np.array(numbers)


def pdf_texts(file: Path) -> list[str]:
    """Return the texts of each page of a PDF: letters of fonts with two bytes for each."""
    content, pages = file.read_bytes(), []
    for data in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.S):
        try:
            drawn = zlib.decompress(data)
        except zlib.error:
            continue
        if b"TJ" in drawn:
            words = re.findall(rb"\[([^]]*)\]\s+TJ", drawn)
            letters = [
                b"".join(re.findall(rb"\(((?:\\.|[^\\)])*)\)", word, re.S)) for word in words
            ]
            pages.append("\n".join(each.replace(b"\0", b"").decode("latin-1") for each in letters))
    return pages


@pytest.fixture(scope="module")
def chart_pages(tmp_path_factory: pytest.TempPathFactory) -> tuple[Draft, list[SvgPage]]:
    """Return a draft of several pages, and the pages of its face."""
    folder = tmp_path_factory.mktemp("pages")
    draft = block_draft(145, 120)
    assert run("print", write(draft, folder), "-o", folder / "p-%02d.svg", "--faces=face") == 0
    pages = [SvgPage(file) for file in sorted(folder.glob("p-*.svg"))]
    assert pages[0].find(r"page 1 of (\d+)")[1] == str(len(pages))
    return draft, [page for page in pages if any(t.startswith("Face: ends") for t in page.texts)]


def test_every_crossing_is_on_exactly_one_page(
    chart_pages: tuple[Draft, list[SvgPage]],
) -> None:
    _, pages = chart_pages
    assert len(pages) > 3
    count = np.zeros((120, 145), int)
    for page in pages:
        a, b, c, d = map(int, page.find(r"Face: ends (\d+)–(\d+), picks (\d+)–(\d+)").groups())
        count[c - 1 : d, a - 1 : b] += 1
    assert (count == 1).all()


def test_cells_are_squares_of_at_least_two_millimetres(
    chart_pages: tuple[Draft, list[SvgPage]],
) -> None:
    for page in chart_pages[1]:
        for name in ("threading", "treadling"):
            sides = np.ptp(page.shape(name), axis=1) * POINT
            assert sides.min() >= 1.99
            assert sides.max() - sides.min() < 0.02


def test_marks_of_a_page_are_those_of_the_loom(chart_pages: tuple[Draft, list[SvgPage]]) -> None:
    """Places of the marks give the shafts of the ends, with two ends beyond each cut."""
    draft, pages = chart_pages
    assert draft.loom is not None
    for page in pages:
        a, b, c, d = map(int, page.find(r"Face: ends (\d+)–(\d+), picks (\d+)–(\d+)").groups())
        for name, rows, first, last, axis in (
            ("threading", draft.loom.threading, a, b, 0),
            ("treadling", draft.loom.treadling, c, d, 1),
        ):
            boxes = page.shape(name)
            side = np.ptp(boxes[0, :, 0])
            # Picks rise and shafts rise: y of an SVG falls.
            corners = boxes.min(axis=1) * [1.0, -1.0]
            places = np.round((corners - corners.min(axis=0)) / side).astype(int)
            order = np.argsort(places[:, axis], kind="stable")
            shown = range(max(first - 2, 1), min(last + 2, len(rows)) + 1)
            expected = np.array([rows[number - 1][0] for number in shown])
            np.testing.assert_array_equal(places[order, axis], np.arange(len(shown)))
            np.testing.assert_array_equal(
                places[order, 1 - axis], expected - expected.min(), err_msg=name
            )


def test_pages_name_their_neighbours(chart_pages: tuple[Draft, list[SvgPage]]) -> None:
    neighbours = {}
    for page in chart_pages[1]:
        number = int(page.find(r"page (\d+) of \d+")[1])
        texts = [re.fullmatch(r"page (\d+)", text) for text in page.texts]
        neighbours[number] = {int(match[1]) for match in texts if match}
    assert all(number in neighbours[other] for number in neighbours for other in neighbours[number])
    assert min(map(len, neighbours.values())) >= 1


def test_pages_are_cut_between_groups(chart_pages: tuple[Draft, list[SvgPage]]) -> None:
    begins = {int(page.find(r"Face: ends (\d+)–.*")[1]) for page in chart_pages[1]}
    # A block begins after each 24 and 12 ends.
    assert begins - {1}
    assert all((begin - 1) % 36 in (0, 24) for begin in begins)


def decode_drawdown(page: SvgPage, ends: int, picks: int) -> np.ndarray:
    """Return the black cells of a drawdown that is on one page, the first row at the bottom."""
    boxes = page.shape("drawdown")
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    corner, far = low.min(axis=0), high.max(axis=0)
    cell = (far - corner) / [ends, picks]
    cells = np.zeros((picks, ends), bool)
    for (x, y), (right, bottom) in zip(
        np.round((low - corner) / cell).astype(int),
        np.round((high - corner) / cell).astype(int),
        strict=True,
    ):
        cells[y:bottom, x:right] = True
    return cells[::-1]


def count_long(lines: np.ndarray, most: int) -> int:
    return sum(
        bool(value) and len(list(run)) > most
        for line in lines
        for value, run in groupby(line.tolist())
    )


@pytest.mark.parametrize("face", ["face", "reverse"])
def test_a_face_shows_its_cells_and_marks_as_many_floats_as_are_counted(
    tmp_path: Path, face: str
) -> None:
    rng = np.random.default_rng(5)
    lifts = tuple(tuple((np.flatnonzero(rng.random(6) < 0.6) + 1).tolist()) for _ in range(30))
    threading = tuple((shaft,) for shaft in rng.integers(1, 7, 40).tolist())
    loom = Loom(threading, liftplan=lifts)
    draft = Draft(cloth := loom.drawdown(), loom)
    file = tmp_path / "a.svg"
    words = ["--faces", face, "--floats", "3", "--mono", "--pages", "1", "-q"]
    assert run("print", write(draft, tmp_path), "-o", file, *words) == 0
    page = SvgPage(file)
    seen = cloth if face == "face" else ~cloth[:, ::-1]
    np.testing.assert_array_equal(decode_drawdown(page, 40, 30), seen)
    assert len(page.shape("floats-warp")) == count_long(seen.T, 3)
    assert len(page.shape("floats-weft")) == count_long(~seen, 3)


def test_a_document_has_the_pages_that_it_counts_and_text_that_can_be_read(
    tmp_path: Path,
) -> None:
    draft = block_draft(
        90,
        70,
        title="Two blocks",
        warp=DraftThreads(spacing=0.001),
        weft=DraftThreads(spacing=0.002),
        other_sections={"TEXT": ("Author=A. Weaver",), "NOTES": ("1=Sley two in a dent.",)},
    )
    file = tmp_path / "a.pdf"
    assert run("print", write(draft, tmp_path), "-o", file, "--paper", "letter", "-q") == 0
    assert b"/MediaBox [ 0 0 612 792 ]" in file.read_bytes()
    pages = pdf_texts(file)
    for number, text in enumerate(pages, start=1):
        assert f"page {number} of {len(pages)}" in text
    for words in ("Two blocks", "Author: A. Weaver", "Sley two in a dent.", "tied shafts rise"):
        assert words in pages[0]
    assert "10 per cm, 25.4 per inch" in pages[0]
    assert "5 per cm, 12.7 per inch" in pages[0]
    counts = np.bincount(np.resize(BLOCKS, 90), minlength=9)[1:]
    heddles = " ".join(f"{shaft}: {count};" for shaft, count in enumerate(counts, start=1))
    assert heddles in " ".join(pages[1].split("\n"))
    again = tmp_path / "b.pdf"
    assert run("again", file, "-o", again, "-q") == 0
    assert again.read_bytes() == file.read_bytes()


@pytest.mark.nightly
def test_a_single_page_repeats_itself(tmp_path: Path) -> None:
    source = write(block_draft(90, 70), tmp_path)
    assert run("print", source, "-o", tmp_path / "p%d.png", "--pages", "2-3", "-q") == 0
    assert sorted(file.name for file in tmp_path.glob("*.png")) == ["p2.png", "p3.png"]
    assert run("again", tmp_path / "p3.png", "--check") == 0
    assert run("print", source, "-o", tmp_path / "p.png") == 2


@st.composite
def sequences(draw: st.DrawFn) -> list[tuple[int, ...]]:
    rows = st.lists(st.integers(1, 4), max_size=2, unique=True).map(tuple)
    parts = draw(st.lists(st.lists(rows, min_size=1, max_size=5), min_size=1, max_size=4))
    return [row for part in parts for row in part * draw(st.integers(1, 5))]


@given(sequences())
def test_each_thread_is_on_one_line_of_the_groups(sequence: list[tuple[int, ...]]) -> None:
    groups = Groups(sequence, lambda row, before: "+".join(map(str, row)) or "–", first=11)
    expanded: list[tuple[int, ...]] = []
    for line in groups.lines():
        assert line.begin == len(expanded)
        expanded += line.tokens * line.count
        assert line.end == len(expanded)
    assert expanded == sequence


def test_groups_are_written_as_weavers_do() -> None:
    straight = [(shaft,) for shaft in range(1, 9)]
    groups = Groups(straight * 3 + straight[:2], lambda row, before: str(row[0]))
    assert " ".join(groups.write_phrase()) == "3 × (1 2 3 4 5 6 7 8) 1 2"
    lines = groups.lines()
    assert [groups.write_range(line) for line in lines] == ["1–24", "25–26"]
    assert " ".join(groups.write_line(lines[0])) == "3 × (1 2 3 4 5 6 7 8)"


def test_a_huge_draft_is_refused_with_the_number_of_pages_and_a_cure() -> None:
    draft = block_draft(2000, 2000)
    with pytest.raises(InputError, match=r"2000 x 2000 threads has \d{3,} pages") as caught:
        DraftSheet(draft, PrintSettings())
    assert caught.value.allowed == f"up to {MOST_PAGES} pages"
    assert "--ends 1-200" in str(caught.value.cure)
    sheet = DraftSheet(draft, PrintSettings(ends="101-300", picks="1-120", faces="face"))
    assert sheet.content.size == (200, 120)
    assert sheet.content.first == (101, 1)
    assert sheet.content.loom.threading == draft.loom.threading[100:300]  # type: ignore[union-attr]


def test_floats_are_limited_by_a_number_or_a_length() -> None:
    threads = {"warp": DraftThreads(spacing=0.001), "weft": DraftThreads(spacing=0.002)}
    draft = block_draft(20, 20, **threads)
    assert PrintSettings(floats="5").limits(draft) == (5, 5)
    # Ends float over picks, which are 2 mm apart.
    assert PrintSettings(floats="10mm").limits(draft) == (5, 10)
    with pytest.raises(InputError, match="no sett"):
        PrintSettings(floats="10mm").limits(block_draft(20, 20))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("floats", "long"),
        ("floats", "0"),
        ("cell", "1mm"),
        ("cell", "wide"),
        ("paper", "a3"),
        ("faces", "none"),
        ("orientation", "diagonal"),
        ("pages", "-3"),
        ("start", "middle"),
    ],
)
def test_settings_that_make_no_sense_are_refused(key: str, value: str) -> None:
    with pytest.raises(InputError) as caught:
        PrintSettings(**{key: value})  # type: ignore[arg-type]
    assert (caught.value.key, caught.value.value) == (key, value)
    assert caught.value.allowed


@pytest.mark.parametrize("text", ["0-3", "5-2", "1-21", "21", "x", "3-"])
def test_ranges_outside_of_the_draft_are_refused(text: str) -> None:
    with pytest.raises(InputError) as caught:
        PrintSettings(ends=text).select(block_draft(20, 20))
    assert (caught.value.key, caught.value.value) == ("ends", text)
    assert caught.value.allowed


def test_the_paper_is_that_of_the_country(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LC_ALL", "LC_PAPER"):
        monkeypatch.delenv(name, raising=False)
    for language, paper in (("en_US.UTF-8", "letter"), ("de_DE", "a4"), ("C", "a4")):
        monkeypatch.setenv("LANG", language)
        assert local_paper() == paper
    monkeypatch.setenv("LC_PAPER", "en_GB.UTF-8")
    monkeypatch.setenv("LANG", "en_US.UTF-8")
    assert local_paper() == "a4"


def liftplan_draft() -> Draft:
    loom = block_draft(50, 40).loom
    assert loom is not None
    lifted = loom.with_liftplan
    spacing = np.where(np.arange(50) % 10 < 2, 0.002, 0.001)
    return Draft(lifted.drawdown(), lifted, DraftThreads(spacing=spacing, thickness=spacing))


def jacquard_draft() -> Draft:
    cloth = np.random.default_rng(2).random((50, 60)) < 0.5
    return Draft(cloth, Loom.from_drawdown(cloth))


def colored_draft() -> Draft:
    rng = np.random.default_rng(3)
    colors = [rng.integers(0, 256, (count, 3)).astype(np.uint8) for count in (60, 50)]
    return block_draft(
        60, 50, warp=DraftThreads(colors=colors[0]), weft=DraftThreads(colors=colors[1])
    )


@pytest.mark.parametrize(
    ("draft", "words"),
    [
        (liftplan_draft(), ["Liftplan, picks 1–40", "Spacing of the warp, in mm"]),
        (jacquard_draft(), ["With 60 shafts and 50 treadles"]),
        (colored_draft(), ["Colours of the warp", "and 96 more colours"]),
        (Draft([[True]]), ["1 × 1 (the whole draft)"]),
        (block_draft(400, 1), ["Threading, ends 1–400"]),
    ],
    ids=["liftplan", "jacquard", "colours", "one crossing", "one pick"],
)
def test_every_kind_of_draft_is_printed(draft: Draft, words: list[str], tmp_path: Path) -> None:
    file = tmp_path / "a.svg"
    found = ""
    if draft.loom is None:
        draft = Draft(draft.drawdown, Loom.from_drawdown(draft.drawdown))
    sheet = DraftSheet(draft, PrintSettings(mono=len(words) == 1))
    for number, figure in sheet.pages():
        write_figure(file, figure)
        page = SvgPage(file)
        assert page.find(rf"page {number} of {sheet.count}")
        found += " ".join(page.texts)
    for word in words:
        assert word in found


@given(st.lists(st.text("abiWM界", min_size=1, max_size=60), min_size=1, max_size=6))
def test_text_is_wrapped_without_loss(words: list[str]) -> None:
    lines = wrap_words(words, 30.0)
    assert "".join(lines).replace(" ", "") == "".join(words)
    assert all(word_width(line) <= 30.5 for line in lines)


def test_scenes_that_are_not_woven_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("print", "tube_bundle", "-o", tmp_path / "a.pdf") == 2
    assert "is not woven" in capsys.readouterr().err


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**31))
def test_rectangles_and_edges_cover_what_they_stand_for(columns: int, rows: int, seed: int) -> None:
    mask = np.random.default_rng(seed).random((rows, columns)) < 0.5
    covered = np.zeros((rows, columns), int)
    for x, y, width, height in merge_cells(mask).astype(int):
        covered[y : y + height, x : x + width] += 1
    np.testing.assert_array_equal(covered, mask)
    # Each cell has two sides of the yarn on top; a side between two cells is drawn once.
    lengths = np.abs(np.diff(interlacing_edges(mask), axis=1)).sum()
    shared = (mask[:, 1:] & mask[:, :-1]).sum() + (~mask[1:] & ~mask[:-1]).sum()
    assert lengths == 2 * mask.size - shared
