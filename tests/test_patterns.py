"""Patterns by name, by file and by picture; drawdowns written by hand."""

from __future__ import annotations

import builtins
import doctest
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from spacemap_vtk import WeaveSource
from spacemap_vtk.errors import InputError, MissingLibraryError, SizeError
from spacemap_vtk.io.drafts import draft_file
from spacemap_vtk.io.drafts.draft_file import parse_rows, read_draft
from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.textile.drafts import drawdown, patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.drafts.patterns import build_pattern, normalise_name

REAL = Path(__file__).parents[1] / "scenes" / "32-shaft_twill.wif"


@pytest.mark.parametrize("module", [patterns, drawdown, draft_file])
def test_examples(module: Any) -> None:
    assert doctest.testmod(module).failed == 0


#: Written by hand, the first pick first: the pictures of weavers' books upside down.
BY_HAND = {
    "plain": "10 01",
    "twill 2/1": "110 011 101",
    "twill 2/1 left": "110 101 011",
    "twill 2/2": "1100 0110 0011 1001",
    "twill 3/1/1/2": "1110100 0111010 0011101 1001110 0100111 1010011 1101001",
    "satin 5/2": "01111 11011 11110 10111 11101",
    "satin 5/3": "01111 11101 10111 11110 11011",
    "satin 5/2 weft": "10000 00100 00001 01000 00010",
    "satin 8/3": "01111111 11101111 11111101 10111111 11110111 11111110 11011111 11111011",
    "basket 2": "1100 1100 0011 0011",
    "rib 2/1": "10 10 01",
    "rib 2/1 weft": "110 001",
    "rib 2": "10 10 01 01",
}


@pytest.mark.parametrize("name", BY_HAND)
def test_drawdowns_by_hand(name: str) -> None:
    assert drawdown.to_rows(build_pattern(name)) == BY_HAND[name].split()
    assert normalise_name(name) == name
    source = WeaveSource(pattern=name, ends=20, picks=20)
    repeat = drawdown.from_matrix(BY_HAND[name].split())
    np.testing.assert_array_equal(source.cloth.drawdown, tile_drawdown(repeat, 20, 20))


@pytest.mark.parametrize(
    ("name", "same"),
    [
        ("Plain weave", "plain"),
        ("tabby", "plain"),
        ("2/2 Twill", "twill 2/2"),
        ("2-2 twill, Z", "twill 2/2"),
        ("LEFT TWILL 2 / 1", "twill 2/1 left"),
        ("sateen 5/2", "satin 5/2 weft"),
        ("Satin 5/2 weft-faced", "satin 5/2 weft"),
        ("hopsack 3", "basket 3"),
        ("weft rib 2/1", "rib 2/1 weft"),
    ],
)
def test_names_are_normalised(name: str, same: str) -> None:
    assert normalise_name(name) == same
    source = WeaveSource(pattern=same)
    changed = source.GetMTime()
    source.pattern = name
    assert source.GetMTime() == changed


@pytest.mark.parametrize(
    ("name", "stated"),
    [
        ("", "must name exactly one weave"),
        ("twill 2/2 plain", "must name exactly one weave"),
        ("twil 2/2", r'unknown word "twil"; allowed: "plain".*mean "twill"\?'),
        ("twill 3", 'for example, "twill 2/1 left"'),
        ("twill 0/2", "the number of yarns must be a whole number: over 0"),
        ("twill 2/2 warp", 'a twill has no side "warp"; allowed: right or left'),
        ("twill 2/2 left right", "has no side"),
        ("satin 8/2", "satin of 8 shafts.*step 2, allowed: 3, 5.*no common divisor"),
        ("satin 6", "satin of 6 shafts.*none: use 5 shafts, or 7 or more"),
        ("satin 8/3/2", "wrong numbers for a satin"),
        ("basket", "wrong numbers for a basket"),
        ("plain left", "allowed: none"),
        ("twill 999999999999999999/1", "more than 1000 yarns"),
        ("twill 2/2.5", "unknown word"),
    ],
)
def test_unknown_weaves_are_refused_with_the_allowed_ones(name: str, stated: str) -> None:
    with pytest.raises(InputError, match=stated) as caught:
        WeaveSource(pattern=name)
    assert "satin 8/3" in str(caught.value)


@given(st.text(max_size=30))
def test_any_text_is_a_weave_or_an_input_error(text: str) -> None:
    try:
        name = normalise_name(text)
    except InputError:
        return
    assert normalise_name(name) == name
    np.testing.assert_array_equal(build_pattern(name), build_pattern(text))


@pytest.mark.parametrize(("over", "under"), [(2, 1), (1, 3), (4, 2)])
@pytest.mark.parametrize("family", ["warp", "weft"])
def test_rib(over: int, under: int, family: str) -> None:
    weave = patterns.rib(over, under, family)
    longest = max(over, under)
    assert drawdown.longest_floats(weave) == ((longest, 1) if family == "warp" else (1, longest))
    assert drawdown.repeat_size(weave) == (
        (2, over + under) if family == "warp" else (over + under, 2)
    )


# --- files ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["110\n011\n", "##.\r\n.##", "\ufeff1,1,0\n0,1,1\n\n", " X X - \n\n-xX", "1;1;0\n0\t1\t1"],
)
def test_a_text_of_rows(text: str, tmp_path: Path) -> None:
    file = tmp_path / "weave.txt"
    file.write_text(text, encoding="utf-8", newline="")
    assert drawdown.to_rows(read_draft(file).drawdown) == ["110", "011"]
    source = WeaveSource(draft=file)
    assert drawdown.to_rows(source.cloth.drawdown) == ["110", "011"]
    source.update()


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("", "the file is empty"),
        ("10\n\n011", "line 3 has 3 ends, but line 1 has 2"),
        ("10\n0é", "line 2: .* is not a crossing; allowed: 1, # or X"),
    ],
)
def test_a_bad_text_is_refused_with_file_and_line(text: str, stated: str, tmp_path: Path) -> None:
    file = tmp_path / "weave.txt"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=stated) as caught:
        read_draft(file)
    assert str(caught.value).startswith(str(file))


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "RGBA"])
@pytest.mark.parametrize("ending", [".png", ".tif", ".gif"])
def test_a_picture(mode: str, ending: str, tmp_path: Path) -> None:
    # as seen: the first pick, all of whose ends but the first lie under it, is at the bottom
    seen = np.array([[255, 0, 0], [0, 255, 255]], dtype=np.uint8)
    file = tmp_path / f"weave{ending}"
    Image.fromarray(seen).convert(mode).save(file)
    found = read_draft(file)
    assert drawdown.to_rows(found.drawdown) == ["100", "011"]
    assert found.warnings == ()
    assert found.title == "weave"


def test_a_gray_or_transparent_picture(tmp_path: Path) -> None:
    file = tmp_path / "gray.png"
    Image.fromarray(np.array([[100, 255], [0, 200]], dtype=np.uint8)).save(file)
    found = read_draft(file)
    assert drawdown.to_rows(found.drawdown) == ["10", "10"]
    assert "2 of 4 pixels are neither black nor white" in found.warnings[0]
    Image.fromarray(np.array([[[0, 0, 0, 0], [0, 0, 0, 255]]], dtype=np.uint8)).save(file)
    assert drawdown.to_rows(read_draft(file).drawdown) == ["01"]


def test_files_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for ending in (".png", ".txt", ".wif"):
        with pytest.raises(InputError, match=f"none{ending}: the draft cannot be read"):
            read_draft(tmp_path / f"none{ending}")
    file = tmp_path / "text.png"
    file.write_text("10\n01\n")
    with pytest.raises(InputError, match="not a picture, or damaged"):
        read_draft(file)
    Image.new("1", (5000, 5000)).save(file)
    with pytest.raises(SizeError, match="5000 x 5000"):
        read_draft(file)
    with pytest.raises(SizeError, match="crossings"):
        parse_rows("\n".join(["1" * 5000] * 5000))
    real_import = builtins.__import__

    def no_pillow(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("PIL"):
            raise ImportError(name)
        return real_import(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", no_pillow)
    with pytest.raises(MissingLibraryError, match="pip install pillow"):
        read_draft(file)


def test_a_wif_by_any_name(tmp_path: Path) -> None:
    expected = read_draft(REAL)
    for name in ("copy.txt", "copy.wifw", "copy"):
        (tmp_path / name).write_bytes(REAL.read_bytes())
        np.testing.assert_array_equal(read_draft(tmp_path / name).drawdown, expected.drawdown)


@pytest.mark.parametrize(
    "text", ["1,3\n2,4\n0\n3\n", "1: 1 3\n\n2: 2 4\n3: -\n4: 3", "1+3\n2+4\n-\n3"]
)
def test_a_liftplan_as_text(tmp_path: Path, text: str) -> None:
    file = tmp_path / "dobby.txt"
    file.write_text(text)
    found = read_draft(file)
    assert found.loom is not None
    assert found.loom.liftplan == ((1, 3), (2, 4), (), (3,))
    assert drawdown.to_rows(found.drawdown) == ["1010", "0101", "0000", "0010"]
    assert found.warnings[0].endswith("a straight draw over its 4 shafts is assumed")
    assert found.title == "dobby"


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("1: 1,3\n3: 2\n", "line 2: pick 3 comes after pick 1"),
        ("12\n23\n", "23 may mean shaft 23, or shafts 2, 3"),
        ("1,99\n", "shafts 9, 9"),
        ("1,2 x\n", '"2" is not a crossing'),
    ],
)
def test_invalid_liftplans_are_refused(tmp_path: Path, text: str, stated: str) -> None:
    file = tmp_path / "dobby.txt"
    file.write_text(text)
    with pytest.raises(InputError, match=stated):
        read_draft(file)


def test_a_text_draft_has_a_loom(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1100\n0110\n")
    found = read_draft(tmp_path / "a.txt")
    np.testing.assert_array_equal(found.loom.drawdown(), found.drawdown)
    assert b"Title=a" in format_wif(found)


def test_a_pattern_together_with_a_draft_is_refused(tmp_path: Path) -> None:
    source = WeaveSource(draft=REAL, pattern="twill 2/2")
    with pytest.raises(InputError, match=r"weave\.pattern.*pattern and draft cannot"):
        source.update()
    source.pattern = "plain"
    assert source.cloth.drawdown.shape == (62, 62)
