"""A sheet looks and moves like the yarns that it replaces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.actors.surface_actor import color_bar_share, natural_span
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES, sides_for_pixels
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.scene import Scene

YARNS = 64
#: Blue and yellow in a satin that shows the warp; white and red in a twill; a plain weave.
WEAVES = {
    "satin": {"pattern": "satin 8/3", "warp_color": "#2850a0", "weft_color": "#f0c820"},
    "twill": {"pattern": "twill 2/2", "warp_color": "#f4f4f0", "weft_color": "#b02020"},
    "plain": {"pattern": "plain", "warp_color": "#c03a2b", "weft_color": "#f0e6d2"},
}
MOVING: dict[str, Any] = {"cage": {"divisions": [8, 8, 1]}, "response": {"gravity": [2.0, -9.8, 4]}}


def draw(
    weave: dict[str, Any], side: int, time: float = 0.0, **sections: Any
) -> tuple[NDArray[np.uint8], Picture]:
    sizes = {"ends": YARNS, "picks": YARNS, "warp_diameter": 2.8e-4, "weft_diameter": 2.8e-4}
    scene = Scene({"weave": {**sizes, **weave}, **sections})
    picture = Picture(scene, [time], (side, side), ["fabric"])
    image = picture.draw(time)
    picture.close()
    return image, picture


def rest(scene: Scene) -> NDArray[np.float64]:
    """How far the points of a scene's surface have moved."""
    array = scene.polygons.GetPointData().GetArray("displacement")
    return np.zeros(3) if array is None else vtk_to_numpy(array).astype(float)


def reduced(image: NDArray[np.uint8], side: int) -> NDArray[np.float64]:
    """Return the mean colours of regions, averaged in linear light."""
    block, share = len(image) // side, image / 255
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    mean = light.reshape(side, block, side, block, 3).mean(axis=(1, 3))
    return 255 * np.where(mean <= 0.0031308, 12.92 * mean, 1.055 * mean ** (1 / 2.4) - 0.055)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("weave", "camera"),
    [
        ("satin", "front"),
        ("twill", "three-quarter"),
        ("plain", "three-quarter"),
    ],
)
def test_a_sheet_has_the_mean_colours_of_its_yarns(
    weave: str, camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    view = {"camera": camera}
    afar, picture = draw(WEAVES[weave], 96, view=view)
    assert picture.sheet is not None
    assert [stage.executions for stage in picture.scene.stages] == [1, 0]
    # Ten times as large, yarn by yarn: 13 pixels each.
    fine, picture = draw(WEAVES[weave], 960, view=view, surface={"subdivisions": 2})
    assert picture.sheet is None
    seen, wanted = (reduced(image, 12)[3:9, 4:8] for image in (afar, fine))
    # Of 255, in each of 24 regions, and over all of them.
    assert np.abs(seen - wanted).max() < 15
    assert np.abs((seen - wanted).mean(axis=(0, 1))).max() < 9


def test_a_sheet_moves_with_its_cage(monkeypatch: pytest.MonkeyPatch) -> None:
    few = {**WEAVES["twill"], "ends": 48, "picks": 48}
    fine, picture = draw(few, 180, 0.05, **MOVING, surface={"subdivisions": 1})
    points = picture.scene.polygons.GetBounds()
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    afar, picture = draw(few, 72, 0.05, **MOVING)
    sheet = picture.sheet
    assert sheet is not None
    thickness = 2.8e-4 * 2
    assert np.allclose(sheet.update(0.05).GetBounds(), points, atol=thickness)
    there = np.abs(reduced(fine, 18) - reduced(afar, 18))
    assert np.median(there) < 8
    assert there.mean() < 8
    # The scene is as it was: asked for all, it makes all.
    picture.scene.update(0.05)
    assert picture.scene.polygons.GetNumberOfCells() > 30_000


def test_a_sheet_shows_interpolated_arrays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    _, picture = draw({}, 90, 0.02, **MOVING, view={"color": "displacement"})
    assert picture._span is not None
    assert picture._span[1] > 0.0
    assert picture.sheet is not None
    assert picture.pieces is None


@pytest.mark.parametrize("moves", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_a_sheet_has_the_mean_clearances_of_its_yarns(moves: bool) -> None:
    scene = Scene(
        {
            "weave": {"ends": 9, "picks": 8, "pattern": "twill 2/1"},
            "view": {"color": "clearance"},
            **(MOVING if moves else {}),
        }
    )
    sheet = ClothSheet(scene)
    sheet.update(0.05)
    scene.update(0.05)
    numbers = color_values(scene.polygons, "clearance")
    assert numbers is not None
    # The scale is that of all yarns.
    assert sheet.extremes is not None
    assert natural_span(sheet.extremes) == pytest.approx(natural_span(numbers), rel=0.01)
    # Seen from above, the half of the yarn on top: its facets by what they cover.
    assert sheet.crossings is not None
    top = np.where(sheet.cloth.drawdown, *sheet.crossings)
    quads = vtk_to_numpy(scene.polygons.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    corners = (points_of(scene.polygons).astype(float) - rest(scene))[quads]
    one, two = (corners[:, k + 2] - corners[:, k] for k in (0, 1))
    area = np.maximum(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0], 0.0)
    yarn = vtk_to_numpy(scene.polygons.GetCellData().GetArray("yarn"))
    x, y, _ = corners.mean(axis=1).T
    ends, picks = (each.position for each in sheet.cloth.yarns)
    end, pick = (np.abs(at[:, None] - each).argmin(axis=1) for at, each in ((x, ends), (y, picks)))
    own = np.where(sheet.cloth.drawdown[pick, end], end, 9 + pick) == yarn
    cell, weight = (pick * 9 + end)[own], area[own]
    mean = np.bincount(cell, weight * numbers[quads].mean(axis=1)[own]) / np.bincount(cell, weight)
    there = mean.reshape(8, 9)
    assert np.abs(top - there).max() < 0.05 * np.ptp(numbers)
    assert abs(float((top - there).mean())) < 0.005 * np.ptp(numbers)


@pytest.mark.nightly
def test_a_sheet_shows_the_values_of_each_crossing(monkeypatch: pytest.MonkeyPatch) -> None:
    # A satin of ends that hardly bend: they lie on top, of picks with all the crimp.
    sizes = {"ends": 16, "picks": 16, "warp_diameter": 2.2e-4, "weft_diameter": 2.4e-4}
    values: dict[str, Any] = {
        "weave": {**sizes, "pattern": "satin 8/3", "warp_crimp": 0.02},
        "cage": {"divisions": [2, 2, 1]},
        "response": {"gravity": [0.0, -9.8, 0.0]},
        "yarns": {},
        "view": {"color": "crimp"},
    }

    def middle(side: int, z: float) -> tuple[NDArray[np.float64], Picture]:
        place = Viewpoint((0.0, 0.0, z), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        picture = Picture(Scene(values), [0.01], (side, side), ["fabric"], place)
        image = picture.draw(0.01).astype(np.float64)
        picture.close()
        column = round(side * (1 - color_bar_share((side, side))) / 2)
        wide = side // 6
        image = image[side // 3 : -side // 3, column - wide : column + wide]
        return reduced(image, 1)[0, 0], picture

    fine = [middle(480, z) for z in (0.036, -0.036)]
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    afar = [middle(48, z) for z in (0.036, -0.036)]
    for (wanted, whole), (seen, picture) in zip(fine, afar, strict=True):
        assert whole.sheet is None
        assert picture.sheet is not None
        assert picture.pieces is None
        # The scale is that of all crossings, whose colours are seen.
        assert picture._span == whole._span
        assert np.abs(seen - wanted).max() < 8
    assert np.abs(fine[0][0] - fine[1][0]).max() > 12  # the faces differ


@pytest.mark.nightly
def test_a_sheet_moves_with_a_carved_cage(monkeypatch: pytest.MonkeyPatch) -> None:
    # Such an open net that none of the sheet's corners is in a hexahedron with a yarn in it.
    apart = {"warp_spacing": 3e-3, "weft_spacing": 3e-3, "warp_diameter": 3e-4}
    values: dict[str, Any] = {
        "weave": {"ends": 5, "picks": 5, **apart, "weft_diameter": 3e-4},
        "cage": {"method": "carved", "divisions": [20, 20, 1], "fill": False},
        "modal": {"modes": 4, "youngs_modulus": "1 MPa"},
        "response": {"gravity": [2.0, -9.8, 4.0]},
        "warp": {"outside": "error"},
    }
    scene = Scene(values)
    scene.update(0.05)
    bounds = scene.polygons.GetBounds()
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    scene = Scene(values)
    sheet = ClothSheet.make_if_needed(scene)
    assert sheet is not None
    assert np.allclose(sheet.update(0.05).GetBounds(), bounds, atol=4e-4)
    assert (
        len(points_of(scene.source.output))
        < len(points_of(Scene(values).source.update().output)) / 5
    )


@pytest.mark.nightly
def test_visible_yarns_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    _, near = draw({"ends": 32, "picks": 32}, 200)
    assert near.pieces is not None
    _, given = draw({"ends": 8, "picks": 8}, 90, surface={"subdivisions": 1})
    assert given.sheet is None  # who says how many facets gets them


@pytest.mark.nightly
def test_clearances_on_few_facets_cause_a_warning() -> None:
    view = {"color": "clearance"}
    _, few = draw({"ends": 9, "picks": 9}, 90, view=view)
    assert "yarns have only 8 facets around" in "".join(few.scene.warnings)
    _, many = draw({"ends": 9, "picks": 9}, 90, view=view, surface={"subdivisions": 4})
    assert "approximate" not in "".join(many.scene.warnings)


@pytest.mark.nightly
def test_a_cloth_larger_than_the_memory_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    weave = {"ends": 300, "picks": 300}
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 300_000_000)
    image, picture = draw(weave, 120, 0.02, **MOVING)
    assert picture.sheet is not None
    assert np.ptp(image[60]) > 100
    with pytest.raises(SizeError):
        picture.scene.update(0.02)


def test_the_number_of_facets_follows_the_picture() -> None:
    for pixels in (0.1, 1.0, 8.0, 30.0, 64.0):
        sides = sides_for_pixels(pixels)
        for count, fits in ((sides, True), (sides - 1, False)):
            if count:
                bulge = 0.5 * pixels * (1.0 - math.cos(math.pi / 4 / count))
                assert (bulge <= 0.19) is fits, (pixels, count)
    assert sides_for_pixels(1e6) == 12


def test_automatic_subdivisions_are_chosen_by_the_picture() -> None:
    _, small = draw({"ends": 8, "picks": 8}, 40)
    _, large = draw({"ends": 8, "picks": 8}, 600)
    assert small.scene.surface.sides < large.scene.surface.sides
    scene = Scene({"weave": {"ends": 2, "picks": 2}})
    scene.update()
    patches = scene.source.output.GetNumberOfCells()
    assert scene.polygons.GetNumberOfCells() == AUTOMATIC_SIDES**2 * patches


def test_a_sheet_is_flat_after_its_scene_stops_moving() -> None:
    values = {"weave": {"ends": 6, "picks": 6}, "response": {"gravity": [0, 0, -9.8]}}
    scene = Scene(values)
    sheet = ClothSheet(scene)
    flat = sheet.deform_at(0.0).GetBounds()
    assert sheet.deform_at(0.3).GetBounds() != flat
    scene.apply_settings({}, {"weave"})  # as the window switches the motion off
    assert not scene.moves
    assert sheet.deform_at(0.3).GetBounds() == flat
    assert sheet.deform(None).GetBounds() == flat
