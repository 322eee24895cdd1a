"""Any fabric written as a WIF and woven again from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import dtx_to_wif
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spacemap_vtk import WeaveSource
from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.wif import parse_wif, read_wif
from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.weave.resolve import resolve

#: Nothing, but what is so without a word.
ASKED = replace(WeaveSource().request, ends=None, picks=None)
REAL = Path(__file__).parents[1] / "scenes" / "32-shaft_twill.wif"


def same(first: Draft, second: Draft) -> None:
    np.testing.assert_array_equal(first.drawdown, second.drawdown)
    assert first.loom is not None
    assert second.loom is not None
    np.testing.assert_array_equal(first.loom.drawdown(), second.loom.drawdown())
    assert first.title == second.title
    for one, other in ((first.warp, second.warp), (first.weft, second.weft)):
        for name in ("colors", "spacing", "thickness"):
            a, b = getattr(one, name), getattr(other, name)
            assert np.shape(a) == np.shape(b)
            np.testing.assert_array_equal(a, b)


def test_an_unchanged_wif_is_exported_unchanged() -> None:
    original = read_wif(REAL)
    found = WeaveSource(draft=REAL).make_draft()
    same(found, original)
    assert found.loom == original.loom
    same(parse_wif(format_wif(found)), original)


def test_changed_parameters_are_exported() -> None:
    source = WeaveSource(draft=REAL, ends=70, warp_sett="20 /cm", weft_color="#ff0000")
    found = parse_wif(format_wif(source.make_draft()))
    original = read_wif(REAL)
    assert found.drawdown.shape == (62, 70)
    assert found.warp.spacing == pytest.approx(0.5e-3)
    assert found.weft.spacing == original.weft.spacing
    assert found.warp.thickness == original.warp.thickness
    assert found.weft.colors is not None
    assert (found.weft.colors == [255, 0, 0]).all()
    assert original.warp.colors is not None
    np.testing.assert_array_equal(found.warp.colors, np.resize(original.warp.colors, (70, 3)))


@given(
    st.sampled_from(["plain", "twill 3/1 left", "satin 5/2", "rib 2/1", ["110", "011"]]),
    st.integers(1, 9),
    st.integers(1, 9),
    st.lists(st.floats(0.1e-3, 0.4e-3), min_size=1, max_size=4),
    st.lists(st.floats(0.95e-3, 1.05e-3), min_size=1, max_size=4),
    st.sampled_from([None, ["#102030", "#405060", "#ffffff"]]),
)
def test_any_fabric_is_woven_again(
    pattern: Any, ends: int, picks: int, diameters: list[float], spacings: list[float], color: Any
) -> None:
    source = WeaveSource(
        pattern=pattern,
        ends=ends,
        picks=picks,
        warp_diameter=diameters,
        weft_spacing=spacings,
        weft_color=color,
        warp_spacing="1 mm",
        weft_diameter="0.2 mm",
    )
    found = parse_wif(format_wif(source.make_draft()))
    # a cloth cut out of a repeat may have picks without a binding point
    assert all("across the cloth" in text for text in found.warnings)
    same(found, source.make_draft())
    cloth, again = source.cloth, resolve(found, ASKED)
    np.testing.assert_array_equal(again.drawdown, cloth.drawdown)
    np.testing.assert_array_equal(again.warp.colors, cloth.warp.colors)
    np.testing.assert_array_equal(again.weft.colors, cloth.weft.colors)
    if min(ends, picks) > 1:
        for one, other in zip(again.threads, cloth.threads, strict=True):
            for a, b in ((one.diameter, other.diameter), (one.spacing, other.spacing)):
                np.testing.assert_allclose(a * np.ones(1), b * np.ones(1), rtol=1e-12)


def test_distances_that_a_wif_cannot_store_are_refused() -> None:
    source = WeaveSource(
        ends=4, warp_spacing=["0.3 mm", "2 mm", "0.3 mm"], warp_diameter=1e-4, weft_diameter=1e-4
    )
    source.update()
    with pytest.raises(InputError, match="cannot store these distances between the warp yarns"):
        source.make_draft()


def woven_by_another(file: Path) -> tuple[Any, NDArray[np.bool_]]:
    """Return what another program reads of a WIF, and the drawdown that this gives."""
    with file.open() as stream:
        pattern = dtx_to_wif.read_wif(stream)
    lifts = dtx_to_wif.make_liftplan(pattern)
    assert pattern.is_rising_shed
    ends, picks = range(1, pattern.warp.threads + 1), range(1, pattern.weft.threads + 1)
    up = [[bool(pattern.threading.get(end, set()) & lifts.get(pick, set())) for end in ends]
          for pick in picks]  # fmt: skip
    return pattern, np.array(up)


@pytest.mark.parametrize("colors", [(), ("warp",), ("weft",), ("warp", "weft")])
def test_another_program_reads_a_draft_that_had_no_colors(
    colors: tuple[str, ...], tmp_path: Path
) -> None:
    nine = DraftThreads(colors=np.full((2, 3), 9, np.uint8))
    original = Draft(np.eye(2, dtype=bool), **dict.fromkeys(colors, nine))
    file = tmp_path / "plain.wif"
    file.write_bytes(format_wif(original))
    pattern, up = woven_by_another(file)
    np.testing.assert_array_equal(up, np.eye(2, dtype=bool))
    woven = resolve(original, ASKED)
    for family, threads in ((pattern.warp, woven.warp), (pattern.weft, woven.weft)):
        np.testing.assert_array_equal([pattern.color_table[family.color]] * 2, threads.colors)


@pytest.mark.parametrize("name", [*library.names(), str(REAL)])
def test_every_woven_scene_is_exported_as_a_draft(name: str, tmp_path: Path) -> None:
    file = tmp_path / "draft.wif"
    with pytest.raises(SystemExit) as done:
        main(["export", name, "-o", str(file), "-q"])
    if not Scene.read(name).woven:
        assert done.value.code == 2
        assert not file.exists()
        return
    assert done.value.code == 0
    found = read_wif(file)
    assert found.warnings == ()
    np.testing.assert_array_equal(found.drawdown, Scene.read(name).woven.cloth.drawdown)
