"""Yarns that are drawn in several pieces give the picture of the whole."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.detail.clearance_tiles import measure_tile
from spacemap_vtk.draw.detail.part_stages import PartStages
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 12, "picks": 12, "pattern": "twill 2/2", "warp_color": "#2850a0"},
    "cage": {"divisions": [4, 4, 1]},
    "modal": {"elements": "sheet"},
    "response": {"gravity": [0.5, -9.8, 2.0]},
}

TENSION = {"color": "yarn_tension"}


def picture_of(
    place: Viewpoint | None = None, show: str = "fabric", **sections: Any
) -> tuple[NDArray[np.int64], Picture]:
    picture = Picture(Scene({**VALUES, **sections}), [0.02], (200, 160), [show], place)
    image = picture.draw(0.02).astype(np.int64)
    picture.close()
    return image, picture


def force_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    monkeypatch.setattr(level_of_detail, "PIECE_PATCHES", 500)


@pytest.mark.parametrize(
    ("show", "sections"),
    [
        ("fabric", {}),
        pytest.param("both", {"view": {"loads": True}}, marks=pytest.mark.nightly),
        pytest.param("fabric", {"view": {"color": "displacement"}}, marks=pytest.mark.nightly),
        pytest.param(
            "fabric", {"view": {"clip_normal": [1.0, 0.0, 0.0]}}, marks=pytest.mark.nightly
        ),
        pytest.param("fabric", {"view": {"color": "clearance"}}, marks=pytest.mark.nightly),
        pytest.param("fabric", {"yarns": {}}, marks=pytest.mark.nightly),
        pytest.param(
            "fabric", {"yarns": {}, "view": {"color": "crimp"}}, marks=pytest.mark.nightly
        ),
        pytest.param(
            "fabric",
            {"yarns": {"modulus": "300 cN/tex", "inextensible": False}, "view": TENSION},
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_pieces_give_the_same_picture_as_the_whole(
    show: str, sections: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The same camera: what it is aimed at is the sheet's outline, or the yarns'.
    near = Viewpoint((0.004, 0.002, 0.016), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    whole, picture = picture_of(near, show, **sections)
    assert picture.pieces is None
    force_pieces(monkeypatch)
    parts, picture = picture_of(near, show, **sections)
    assert picture.pieces is not None
    assert picture.level.pieces > 4
    apart = np.abs(parts - whole).max(axis=2)
    # A scale's ends are those of the sheet; edges of lines stand in half shadows.
    assert np.mean(apart > 4) < (0.03 if show == "both" or "view" in sections else 0.01)
    assert np.abs(parts.mean(axis=(0, 1)) - whole.mean(axis=(0, 1))).max() < 0.3


def arrays_of(stage: Stage | None) -> list[NDArray[np.float64]]:
    assert isinstance(stage, CrimpInterchange)
    cells = stage.output.GetCellData()
    return [vtk_to_numpy(cells.GetArray(name)) for name in ("yarn", "crimp")]


@pytest.mark.nightly
def test_crossings_of_pieces_agree_with_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    # Yarns are as long as their crossings say from selvedge to selvedge: no part of them knows it.
    weave = {**VALUES["weave"], "warp_diameter": [2.5e-4, 2e-4, 3e-4]}
    sections = {"weave": weave, "yarns": {}, "view": {"color": "crimp"}}
    corner = Viewpoint((0.0025, 0.0025, 0.004), (0.0025, 0.0025, 0.0), (0.0, 1.0, 0.0))
    _, picture = picture_of(corner, **sections)
    yarns, crimp = arrays_of(picture.scene.stage("crimp"))
    assert len(np.unique(crimp)) > 100
    span = picture._span
    force_pieces(monkeypatch)
    _, picture = picture_of(corner, **sections)
    assert picture._span == span
    assert picture.sheet is not None
    assert picture.sheet.crossings is not None
    assert np.array_equal(np.unique(picture.sheet.crossings), np.unique(crimp))
    assert picture.pieces is not None
    own, found = arrays_of(picture.pieces._stages.all[1])
    assert 100 < len(found) < 500
    for yarn in np.unique(own):
        assert np.isin(found[own == yarn], crimp[yarns == yarn]).all()


@pytest.mark.parametrize("moves", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_clearances_of_tiles_agree_with_the_whole(moves: bool) -> None:
    weave = {"ends": 15, "picks": 13, "pattern": "twill 2/1", "weft_diameter": [2.5e-4, 2e-4]}
    scene = Scene(
        {
            "weave": weave,
            "surface": {"subdivisions": 2},
            **({"cage": VALUES["cage"], "response": VALUES["response"]} if moves else {}),
        }
    )
    scene.update(0.02)
    stages = PartStages(scene)
    stages.surface.set_detail(2)
    if moves:
        stages.set_cage(scene.deformed_cage)
    whole = rows_of(scene.polygons, color_values(scene.polygons, "clearance"))
    found = []
    for ends in (slice(0, 5), slice(5, 11), slice(11, 15)):
        for picks in (slice(0, 7), slice(7, 13)):
            tile = measure_tile(stages, ends, picks, 0.02, None)
            assert tile is not None
            found.append(rows_of(tile.trimmed_surface, tile.clearance))
    parts = np.concatenate(found)
    assert parts.shape == whole.shape  # each facet once
    parts, whole = (rows[np.lexsort(np.rint(rows[:, :4] / 1e-7).T)] for rows in (parts, whole))
    np.testing.assert_allclose(parts, whole, atol=2e-9)


def rows_of(surface: vtkPolyData, numbers: NDArray[np.float32] | None) -> NDArray[np.float64]:
    """Of each facet its yarn, middle, and the numbers of its points."""
    assert numbers is not None
    quads = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    yarn = 1e-3 * vtk_to_numpy(surface.GetCellData().GetArray("yarn"))
    middle = points_of(surface)[quads].astype(float).mean(axis=1)
    return np.column_stack([middle, yarn, numbers[quads]])


def test_invisible_yarns_are_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    corner = Viewpoint((0.0025, 0.0025, 0.004), (0.0025, 0.0025, 0.0), (0.0, 1.0, 0.0))
    whole, _ = picture_of(corner)
    force_pieces(monkeypatch)
    parts, picture = picture_of(corner)
    assert picture.pieces is not None
    made = picture.pieces._stages.source.executions
    assert 0 < made < 0.7 * picture.level.pieces
    # Nor are yarns longer than what is seen of them, and some crossings beside.
    low, high = np.array(picture.pieces._stages.source.output.GetBounds()).reshape(3, 2).T
    assert 0.0025 < high.max() < 0.0035
    assert -0.0025 < low.min() < 0.0005
    assert np.mean(np.abs(parts - whole).max(axis=2) > 4) < 0.01


def test_requested_subdivisions_are_drawn_in_pieces(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole, picture = picture_of(surface={"subdivisions": 3})
    assert picture.pieces is None
    monkeypatch.setattr(level_of_detail, "PIECE_PATCHES", 500)
    monkeypatch.setattr(level_of_detail, "fits_in_memory", lambda _: False)
    parts, picture = picture_of(surface={"subdivisions": 3})
    assert picture.pieces is not None
    made = picture.pieces._stages
    assert made.surface.output.GetNumberOfCells() == 9 * made.source.output.GetNumberOfCells()
    assert np.abs(parts.mean(axis=(0, 1)) - whole.mean(axis=(0, 1))).max() < 2
