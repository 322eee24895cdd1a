"""Drafts of Fiberworks, WeavePoint and TempoWeave, compared with another reader."""

import dataclasses
import io
import zipfile
from pathlib import Path
from typing import Any

import dtx_to_wif
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.io.drafts.dtx import UNIT, format_dtx, losses
from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom

REAL = Path(__file__).parent.parent / "scenes" / "32-shaft_twill.wif"


def compare(found: Draft, other: Any) -> None:
    """Assert that another program reads the same loom and colours."""
    loom = found.loom
    assert loom is not None
    assert other.is_rising_shed == loom.rising
    assert (other.warp.threads, other.weft.threads) == found.size

    def rows(numbers: dict[int, set[int]], count: int) -> tuple[tuple[int, ...], ...]:
        return tuple(tuple(sorted(numbers.get(k, set()) - {0})) for k in range(1, count + 1))

    ends, picks = found.size
    assert rows(other.threading, ends) == loom.threading
    if loom.liftplan is None:
        assert rows(other.treadling, picks) == loom.treadling
        assert rows(other.tieup, len(loom.tieup)) == loom.tieup
    else:
        assert rows(other.liftplan, picks) == loom.liftplan
    for own, threads, colors, count in (
        (found.warp, other.warp, other.warp_colors, ends),
        (found.weft, other.weft, other.weft_colors, picks),
    ):
        chosen = [other.color_table[colors.get(k, threads.color)] for k in range(1, count + 1)]
        np.testing.assert_array_equal(own.colors, chosen)


def spacings(other: Any, family: str, count: int) -> NDArray[np.float64]:
    """Return the spacings in m that another program has read in cm."""
    threads, own = getattr(other, family), getattr(other, f"{family}_spacing")
    assert threads.units == "centimeters"
    return np.array([own.get(k, threads.spacing) for k in range(1, count + 1)]) * 0.01


LOOMS = st.builds(
    lambda threading, tieup, treadling, lifts, rising: Loom(
        threading=tuple((shaft,) if shaft else () for shaft in [1, *threading]),
        tieup=() if lifts else ((1,), *map(tuple, map(sorted, tieup))),
        treadling=() if lifts else ((1,), *map(tuple, map(sorted, treadling))),
        liftplan=((2,), *map(tuple, map(sorted, lifts))) if lifts else None,
        rising=rising,
        shafts=9,
        treadles=0 if lifts else 9,
    ),
    st.lists(st.integers(0, 9), max_size=30),
    st.lists(st.sets(st.integers(1, 9)), max_size=8),
    st.lists(st.sets(st.integers(1, 4)), max_size=30),
    st.none() | st.lists(st.sets(st.integers(1, 9)), min_size=1, max_size=30),
    st.booleans(),
)


@given(LOOMS, st.data())
def test_another_program_reads_a_dtx(loom: Loom, data: st.DataObject) -> None:
    drawdown = loom.drawdown()
    families = []
    for count in drawdown.shape[::-1]:
        units = data.draw(st.lists(st.integers(1, 20), min_size=count, max_size=count))
        shades = data.draw(st.lists(st.integers(0, 3), min_size=count, max_size=count))
        colors = np.array([(80 * shade, 7, 255) for shade in shades], np.uint8)
        families.append(DraftThreads(spacing=UNIT * np.array(units), colors=colors))
    draft = Draft(drawdown, loom, *families, "Huck lace")
    written = format_dtx(draft).decode()
    try:
        other = dtx_to_wif.read_dtx(io.StringIO(written))
    except RuntimeError as error:  # it takes no treadle beyond the tied ones
        assert "more treadles in treadling" in str(error)  # noqa: PT017
        return
    compare(draft, other)
    assert other.name == "Huck lace"
    for family, own, count in zip(("warp", "weft"), families, draft.size, strict=True):
        np.testing.assert_allclose(spacings(other, family, count), own.spacing, rtol=1e-12)


@given(LOOMS)
def test_a_dtx_is_read_as_it_was_written(loom: Loom) -> None:
    ends, picks = loom.drawdown().shape[::-1]
    colors = [np.arange(3 * n, dtype=np.uint8).reshape(n, 3) for n in (ends, picks)]
    warp, weft = (DraftThreads(spacing=3 * UNIT, colors=own) for own in colors)
    draft = Draft(loom.drawdown(), loom, warp, weft, "Huck lace")
    file = io.BytesIO(format_dtx(draft))
    found = read(file.getvalue(), ".dtx")
    assert losses(draft) == []
    assert found.title == draft.title
    # without what no treadle is tied to, which says nothing
    filled = dataclasses.replace(
        loom, tieup=(*loom.tieup, *[()] * (loom.treadles - len(loom.tieup)))
    )
    assert found.loom == filled
    np.testing.assert_array_equal(found.drawdown, draft.drawdown)
    for one, other in ((found.warp, warp), (found.weft, weft)):
        assert one.spacing == pytest.approx(other.spacing, rel=1e-14)
        np.testing.assert_array_equal(one.colors, other.colors)


@pytest.fixture(scope="module", autouse=True)
def _folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    global FOLDER
    FOLDER = tmp_path_factory.mktemp("drafts")


FOLDER: Path


def read(content: bytes, ending: str, trim: bool = False) -> Draft:
    file = FOLDER / f"draft{ending}"
    file.write_bytes(content)
    return read_draft(file, trim)


#: A file with all sections of the format.
DTX = """@@StartDTX
%%version 1
@@Description
Rosepath
@@Contents
Imprint
@@Imprint
PCW 4.2.0 Silver
@@Info
%%shafts 4
%%treadles 5
%%ends 6
%%picks 4
@@Threading
1 2 3
4 0 2
@@Tieup
%%%%sinking
11000
01100
00110
10011
@@Treadling
%%compound
1, 5 2
3,4 1
@@Color Palet
255,255,255
200,0,0
0,0,200
@@Warp Colors
0 1 2 0 1 2
@@Weft Colors
2 2 1 0
@@Warp Spacing
4 4 2 1 4 4
@@EndDTX
"""


def test_a_dtx_with_all_sections_is_read() -> None:
    found = read(DTX.encode(), ".dtx")
    compare(found, dtx_to_wif.read_dtx(io.StringIO(DTX)))
    assert found.title == "Rosepath"
    assert found.loom is not None
    assert found.loom.treadling == ((1, 5), (2,), (3, 4), (1,))
    assert found.loom.tieup[0] == (1, 4)  # the lowest row is the first shaft
    assert found.warp.spacing == pytest.approx(
        1e-3 * np.array([2.12, 2.12, 1.06, 0.53, 2.12, 2.12])
    )
    assert found.weft.spacing == pytest.approx(2.12e-3)
    assert found.warnings == (
        "line 14: end 5 floats across the cloth, over every pick: it is in no heddle",
    )


@pytest.mark.parametrize(
    ("change", "printed"),
    [
        (("@@StartDTX", "@@Start"), "does not begin with @@StartDTX"),
        (("1 2 3\n", "1 x 3\n"), 'Threading = "x": line 15 cannot be read'),
        (("11000", "1100?"), "a row of 0 and 1"),
        (("200,0,0", "300,0,0"), "three numbers from 0 to 255"),
        (("@@Treadling", "@@Notes"), "neither Tieup with Treadling nor Liftplan"),
        (("%%ends 6", "%%ends 99999999"), "whole numbers up to 100000"),
    ],
)
def test_an_invalid_dtx_is_refused(change: tuple[str, str], printed: str) -> None:
    with pytest.raises(InputError) as reported:
        read(DTX.replace(*change).encode(), ".dtx")
    assert printed in str(reported.value)


def test_empty_drafts_are_refused() -> None:
    with pytest.raises(InputError, match="the draft has 0 ends and 1 picks"):
        read(b"@@StartDTX\n@@Threading\n@@Liftplan\n1\n@@EndDTX\n", ".dtx")
    with pytest.raises(InputError, match="the draft has 0 ends and 2 picks"):
        read(b"1: 0\n2: -\n", ".txt")


@given(st.sampled_from([".dtx", ".wpo", ".txt"]), st.data())
def test_damaged_drafts_are_read_or_refused(ending: str, data: st.DataObject) -> None:
    whole = {".dtx": DTX.encode(), ".wpo": wpo(102, 17, 12), ".txt": b"1: 1,3\n2: 2,4\n3: -\n"}[
        ending
    ]
    content = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content)))
        content[place : place + data.draw(st.integers(0, 9))] = data.draw(
            st.binary(max_size=3) | st.sampled_from([b"0", b"9", b"\n", b"-", b",", b"@@", b"%%"])
        )
    try:
        found = read(bytes(content), ending, data.draw(st.booleans()))
    except InputError:
        return
    assert found.loom is not None
    np.testing.assert_array_equal(found.loom.drawdown(), found.drawdown)


def test_losses_of_a_dtx_are_reported() -> None:
    loom = Loom(threading=((1, 2), (2,)), tieup=((1,), (2,)), treadling=((1,), (2,)))
    warp = DraftThreads(spacing=1e-3, thickness=0.5e-3)
    draft = Draft(loom.drawdown(), loom, warp)
    reported = losses(draft)
    assert [text.split(":")[0] for text in reported[:1]] == ["a .dtx stores one shaft for each end"]
    assert "the spacing of the warp is rounded to units of 0.53 mm" in reported
    assert "a .dtx cannot store a thickness: that of the warp is lost" in reported
    assert "a .dtx stores a spacing for each thread; the weft gets 2.12 mm" in reported
    np.testing.assert_array_equal(read(format_dtx(draft), ".dtx").drawdown, draft.drawdown)
    vast = Draft(loom.drawdown(), loom, DraftThreads(spacing=1e6))
    assert "rounded" in " ".join(losses(vast))
    assert read(format_dtx(vast), ".dtx").size == vast.size


def wpo(kind: int, shafts: int, treadles: int, version: int = 7, metric: bool = True) -> bytes:
    """Return a file in the layout of WeavePoint: a cloth of 5 x 4 in a canvas of 40 x 30."""

    def two(number: int) -> bytes:
        return number.to_bytes(2, "big")

    def mask(numbers: tuple[int, ...], bits: int) -> bytes:
        return sum(1 << k - 1 for k in set(numbers)).to_bytes(-(-bits // 8), "little")

    head = [123, version, kind, 10, shafts, treadles, 0, 1, 1, 10, 8, 1, 134, 0, 40, 0, 30]
    parts = [bytes([*head, int(metric), 3, 6, 7, 7, 0, 0])]
    for numbers in ([1, shafts, 3, 0, 2], [0, 1, 2] * 13 + [0], [1, 2] * 15):
        parts += [two(len(numbers)), bytes(numbers)]
    if kind == 100:
        lifts = [(1, shafts), (2,), (), (3, 9)]
        parts += [two(4), *(mask(lift, shafts) for lift in lifts)]
    else:
        parts += [mask((k % shafts + 1, shafts), shafts) for k in range(treadles)]
        parts.append(two(4))
        if kind == 101:
            parts.append(bytes([1, 3, treadles, 2]))
        else:
            parts += [mask(pressed, treadles) for pressed in [(1, treadles), (2,), (3,), (1, 2)]]
    colors = [255, 255, 255, 200, 100, 50, 0, 0, 63] if version > 3 else [63] * 3 + [0] * 6
    return b"".join([*parts, bytes(66), bytes([3]), bytes(colors), b"notes"])


@pytest.mark.parametrize("kind", [100, 101, 102])
@pytest.mark.parametrize("shafts", [9, 17])
def test_another_program_reads_the_same_wpo(kind: int, shafts: int) -> None:
    data = wpo(kind, shafts, 12)
    found = read(data, ".wpo")
    other = dtx_to_wif.read_pattern_file(FOLDER / "draft.wpo")
    # the other program keeps the canvas of 40 x 30, of which 5 x 4 are woven
    assert (other.warp.threads, other.weft.threads) == (40, 30)
    assert found.size == (5, 4)
    other.warp.threads, other.weft.threads = found.size
    compare(found, other)
    # the one number that it takes for inches always: 10 and 8 a centimetre
    assert (found.warp.spacing, found.weft.spacing) == pytest.approx((1e-3, 1.25e-3))
    inches = read(wpo(kind, shafts, 12, metric=False), ".wpo")
    assert inches.warp.spacing == pytest.approx(other.warp.spacing * 0.0254)
    assert [text[:12] for text in found.warnings][:1] == ["end 4 floats"]
    assert not any("trim" in text for text in found.warnings)


@pytest.mark.parametrize("ending", [".wpo", ".dtx"])
def test_a_draft_is_the_same_after_a_second_round_trip(ending: str) -> None:
    """Treadles that are tied to nothing keep their lines in the tie-up."""
    data = bytearray(wpo(101, 10, 11))
    if ending == ".wpo":
        # the masks of the last five treadles, of two bytes each
        at = 24 + 3 * 2 + 5 + 40 + 30 + 2 * 6
        data[at : at + 10] = bytes(10)
        first = format_wif(read(bytes(data), ending))
    else:
        tie = "@@Tieup\r\n100\r\n010\r\n@@Treadling\r\n1 2\r\n"
        first = format_wif(
            read(
                f"@@StartDTX\r\n@@Info\r\n%%shafts 2\r\n%%treadles 3\r\n%%ends 2\r\n"
                f"%%picks 2\r\n@@Threading\r\n1 2\r\n{tie}@@EndDTX\r\n".encode(),
                ending,
            )
        )
    last = b"11=0" if ending == ".wpo" else b"3=0"
    assert last in first.splitlines()
    assert format_wif(read(first, ".wif")) == first


def test_a_colour_outside_the_palette_of_a_dtx_is_reported() -> None:
    text = (
        "@@StartDTX\n@@Info\n%%shafts 2\n%%treadles 2\n%%ends 3\n%%picks 2\n@@Threading\n1 2 1\n"
        "@@Tieup\n01\n10\n@@Treadling\n1 2\n@@Color Palet\n9,8,7\n1,2,3\n"
        "@@Warp Colors\n1 -1 5\n@@EndDTX\n"
    )
    found = read(text.encode(), ".dtx")
    np.testing.assert_array_equal(found.warp.colors, [[1, 2, 3], [9, 8, 7], [9, 8, 7]])
    (reported,) = found.warnings
    assert "Warp Colors has colours outside the palette's 0 to 1" in reported
    with pytest.raises(InputError, match="cannot be read"):
        read(text.replace("-1", "-x").encode(), ".dtx")


def test_colours_of_an_old_wpo_are_scaled() -> None:
    found = read(wpo(101, 9, 12, version=3), ".wpo")
    np.testing.assert_array_equal(found.warp.colors[0], [255, 255, 255])  # type: ignore[index]


def test_an_invalid_wpo_is_refused() -> None:
    data = wpo(101, 9, 12)
    for length in range(1, len(data) - 5):
        with pytest.raises(InputError, match="truncated"):
            read(data[:length], ".wpo")
    with pytest.raises(InputError, match="does not begin like a WeavePoint draft"):
        read(b"[WIF]", ".wpo")
    with pytest.raises(InputError, match="unknown kind of treadling"):
        read(data[:2] + b"\0" + data[3:], ".wpo")


def test_a_twa_is_read_as_a_wif_in_an_archive() -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(REAL, "twamain.waf")
    found = read(packed.getvalue(), ".twa")
    compare(found, dtx_to_wif.read_pattern_file(FOLDER / "draft.twa"))
    with pytest.raises(InputError, match=r"has no twamain\.waf"):
        read(b"PK no archive", ".twa")


def test_another_program_reads_a_converted_wif() -> None:
    real = read_draft(REAL)
    compare(real, dtx_to_wif.read_dtx(io.StringIO(format_dtx(real).decode())))
    compare(real, dtx_to_wif.read_wif(io.StringIO(format_wif(real).decode())))


def test_a_trimmed_draft_keeps_what_is_woven() -> None:
    loom = Loom(
        threading=((), (1,), (), (2,), (), ()),
        tieup=((1,), (2,)),
        treadling=((), (1,), (2,), (1,), ()),
    )
    colors = np.arange(18, dtype=np.uint8).reshape(6, 3)
    warp = DraftThreads(spacing=np.arange(1.0, 7.0), colors=colors)
    draft = Draft(loom.drawdown(), loom, warp, DraftThreads(spacing=1e-3))
    cut = draft.trim()
    assert cut.loom is not None
    assert cut.loom.threading == ((1,), (), (2,))
    assert cut.loom.treadling == ((1,), (2,), (1,))
    np.testing.assert_array_equal(cut.drawdown, draft.drawdown[1:4, 1:4])
    np.testing.assert_array_equal(cut.drawdown, cut.loom.drawdown())
    np.testing.assert_array_equal(cut.warp.spacing, [2.0, 3.0, 4.0])
    np.testing.assert_array_equal(cut.warp.colors, colors[1:4])
    assert cut.weft.spacing == 1e-3
    assert cut.trim() is cut
