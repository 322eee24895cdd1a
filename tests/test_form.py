"""Forms in which a cloth is drawn: facets by what is seen of a yarn, and a sheet from afar."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spacemap_vtk.draw import form
from spacemap_vtk.draw.form import Sheet, sides_seen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES
from spacemap_vtk.scenes.scene import Scene

YARNS = 64
#: Blue and yellow in a satin that shows the warp; white and red in a twill; a plain weave.
WEAVES = {
    "satin": {"pattern": "satin 8/3", "warp_color": "#2850a0", "weft_color": "#f0c820"},
    "twill": {"pattern": "twill 2/2", "warp_color": "#f4f4f0", "weft_color": "#b02020"},
    "plain": {"pattern": "plain", "warp_color": "#c03a2b", "weft_color": "#f0e6d2"},
}
MOVING: dict[str, Any] = {"cage": {"divisions": [8, 8, 1]}, "response": {"gravity": [2.0, -9.8, 4]}}


def drawn(
    weave: dict[str, Any], side: int, time: float = 0.0, **sections: Any
) -> tuple[NDArray[np.uint8], Picture]:
    sizes = {"ends": YARNS, "picks": YARNS, "warp_diameter": 2.8e-4, "weft_diameter": 2.8e-4}
    scene = Scene({"weave": {**sizes, **weave}, **sections})
    picture = Picture(scene, [time], (side, side), ["fabric"])
    image = picture.draw(time)
    picture.close()
    return image, picture


def reduced(image: NDArray[np.uint8], side: int) -> NDArray[np.float64]:
    block = len(image) // side
    return image.reshape(side, block, side, block, 3).mean(axis=(1, 3))


@pytest.mark.parametrize(
    ("weave", "camera"),
    [("satin", "front"), ("twill", "three-quarter"), ("plain", "three-quarter")],
)
def test_a_sheet_has_the_mean_colours_of_its_yarns(
    weave: str, camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(form, "_MANY_PATCHES", 0)
    view = {"camera": camera}
    afar, picture = drawn(WEAVES[weave], 96, view=view)
    assert picture.sheet is not None
    assert [stage.executions for stage in picture.scene.stages] == [1, 0]
    # Ten times as large, yarn by yarn: 13 pixels each.
    fine, picture = drawn(WEAVES[weave], 960, view=view, surface={"subdivisions": 2})
    assert picture.sheet is None
    seen, wanted = (reduced(image, 12)[3:9, 4:8] for image in (afar, fine))
    # Of 255, in each of 24 regions, and over all of them.
    assert np.abs(seen - wanted).max() < 15
    assert np.abs((seen - wanted).mean(axis=(0, 1))).max() < 9


def test_a_sheet_moves_with_its_cage(monkeypatch: pytest.MonkeyPatch) -> None:
    fine, picture = drawn(WEAVES["twill"], 480, 0.05, **MOVING, surface={"subdivisions": 1})
    points = picture.scene.polygons.GetBounds()
    monkeypatch.setattr(form, "_MANY_PATCHES", 0)
    afar, picture = drawn(WEAVES["twill"], 96, 0.05, **MOVING)
    sheet = picture.sheet
    assert sheet is not None
    thickness = 2.8e-4 * 2
    assert np.allclose(sheet.update(0.05).GetBounds(), points, atol=thickness)
    there = np.abs(reduced(fine, 24) - reduced(afar, 24))
    assert np.median(there) < 8
    assert there.mean() < 8
    # The scene is as it was: asked for all, it makes all.
    picture.scene.update(0.05)
    assert picture.scene.polygons.GetNumberOfCells() > 60_000


def test_a_sheet_shows_what_rides_along(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(form, "_MANY_PATCHES", 0)
    _, picture = drawn({}, 90, 0.02, **MOVING, view={"color": "displacement"})
    assert picture._span is not None
    assert picture._span[1] > 0.0
    assert picture.scene.warnings[-1].startswith("drawn as a sheet: a yarn is 1.")
    assert picture.scene.warnings[-1].endswith(" pixels")
    # What yarns are to one another, a sheet does not have.
    scene = Scene({"weave": {}, **MOVING, "view": {"color": "clearance"}})
    assert Sheet.of(scene) is None


def test_yarns_that_are_seen_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(form, "_MANY_PATCHES", 0)
    _, near = drawn({}, 200)
    assert near.pieces is not None
    _, told = drawn({}, 90, surface={"subdivisions": 1})
    assert told.sheet is None  # who says how many facets gets them
    scene = Scene({"weave": {}, "cage": {"method": "carved"}, "response": {}})
    assert Sheet.of(scene) is None


def test_a_cloth_that_memory_does_not_hold_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    weave = {"ends": 300, "picks": 300}
    monkeypatch.setattr("spacemap_vtk.memory.available", lambda: 300_000_000)
    image, picture = drawn(weave, 120, 0.02, **MOVING)
    assert picture.sheet is not None
    assert np.ptp(image[60]) > 100
    with pytest.raises(SizeError):
        picture.scene.update(0.02)


def test_facets_are_as_many_as_can_be_seen() -> None:
    for pixels in (0.1, 1.0, 8.0, 30.0, 64.0):
        sides = sides_seen([1.0], pixels)
        for count, fits in ((sides, True), (sides - 1, False)):
            if count:
                bulge = 0.5 * pixels * (1.0 - math.cos(math.pi / 4 / count))
                assert (bulge <= 0.3) is fits, (pixels, count)
    assert sides_seen([1.0], 1e6) == 12


def test_automatic_subdivisions_are_chosen_by_the_picture() -> None:
    _, small = drawn({"ends": 8, "picks": 8}, 40)
    _, large = drawn({"ends": 8, "picks": 8}, 600)
    assert small.scene.surface.sides < large.scene.surface.sides
    scene = Scene({"weave": {"ends": 2, "picks": 2}})
    scene.update()
    patches = scene.weave.output.GetNumberOfCells()
    assert scene.polygons.GetNumberOfCells() == AUTOMATIC_SIDES**2 * patches
