"""Drafts from public collections, against a second reader written from the text of WIF 1.1."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.ndarrays import Bools, Ints
from spacemap_vtk.scenes import library
from spacemap_vtk.textile.drafts.pattern_weft import find_pattern_weft

FOLDER = library.folder()
DRAFTS = [*sorted(FOLDER.glob("*.wif")), *sorted((FOLDER / "drafts").glob("*.wif"))]
Entries = dict[str, dict[str, str]]


def entries(path: Path) -> Entries:
    """Return the lines of each section by their keys, in capitals."""
    found: Entries = {}
    for line in path.read_text("latin-1").splitlines():
        text = line.partition(";")[0].strip()
        if text.startswith("["):
            found[name := text.strip("[]").upper()] = {}
        elif text:
            key, _, value = text.partition("=")
            found[name][key.strip().upper()] = value.strip()
    return found


def lists(wif: Entries, section: str) -> dict[int, set[int]]:
    rows = wif.get(section, {}).items()
    return {int(key): set(map(int, re.findall("[0-9]+", value))) - {0} for key, value in rows}


def drawdown(wif: Entries) -> Bools:
    """Weave the draft crossing by crossing."""
    threading, tieup, treadling = (lists(wif, s) for s in ("THREADING", "TIEUP", "TREADLING"))
    lifted = lists(wif, "LIFTPLAN")
    if not lifted:
        lifted = {p: set().union(*(tieup[t] for t in pressed)) for p, pressed in treadling.items()}
    ends, picks = (int(wif[family]["THREADS"]) for family in ("WARP", "WEFT"))
    rising = wif["WEAVING"]["RISING SHED"].lower() in ("true", "on", "yes", "1")
    moved = [
        [bool(threading.get(end, set()) & lifted.get(pick, set())) for end in range(1, ends + 1)]
        for pick in range(1, picks + 1)
    ]
    return np.array(moved) == rising


def colors(wif: Entries, family: str) -> Ints:
    """Return the colour of each thread, scaled to 255."""
    low, high = (int(v) for v in wif["COLOR PALETTE"]["RANGE"].split(","))
    table = {int(k): [int(v) for v in line.split(",")] for k, line in wif["COLOR TABLE"].items()}
    own = wif.get(f"{family} COLORS", {})
    usual = wif[family].get("COLOR", "")
    count = int(wif[family]["THREADS"])
    index = [int(own.get(str(n), usual).split(",")[0]) for n in range(1, count + 1)]
    return np.rint([[255 * (v - low) / (high - low) for v in table[n]] for n in index]).astype(int)


@pytest.mark.parametrize("path", DRAFTS, ids=lambda path: path.stem)
def test_drawdown_and_colours_are_those_of_a_second_reader(path: Path) -> None:
    wif, draft = entries(path), read_draft(path)
    np.testing.assert_array_equal(draft.drawdown, drawdown(wif))
    if "COLOR TABLE" not in wif:  # this file gives its colours in the wrong section
        assert draft.warp.colors is None
        assert any("COLOR TABLE" in str(warning) for warning in draft.warnings)
        return
    for family, threads in (("WARP", draft.warp), ("WEFT", draft.weft)):
        np.testing.assert_array_equal(threads.colors, colors(wif, family))


def test_only_three_of_the_drafts_have_a_pattern_weft() -> None:
    found = {
        path.stem: find_pattern_weft(draft.drawdown, draft.weft.thickness)
        for path in [*DRAFTS, *(FOLDER / "drafts").glob("*.wpo")]
        for draft in [read_draft(path)]
    }
    with_pattern = {name: picks for name, picks in found.items() if picks is not None}
    assert with_pattern.keys() == {"overshot", "summer_and_winter", "monks_belt"}
    for picks in with_pattern.values():
        assert picks.pattern.tolist() == [True, False] * (len(picks.pattern) // 2)
        assert (picks.tabby == ~picks.pattern).all()


def test_each_draft_is_in_the_table_of_origins() -> None:
    text = (FOLDER / "drafts" / "ORIGIN.md").read_text("utf-8")
    files = [path.name for path in (FOLDER / "drafts").glob("*.w*")]
    assert len(files) == 23
    for name in files:
        draft = read_draft(FOLDER / "drafts" / name)
        assert f"| `{name}` | {draft.size[0]} × {draft.size[1]} |" in text


def test_the_drafts_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert library.find("drafts/overshot.wif") == FOLDER / "drafts" / "overshot.wif"
    with pytest.raises(InputError, match="no such file"):
        library.find("drafts/none.wif")
