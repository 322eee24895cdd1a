"""How yarns are drawn is decided in one place, from numbers alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.level_of_detail import (
    LEAST_SIDES,
    DrawingMethod,
    DrawnCloth,
    LevelOfDetail,
    choose_level,
    choose_method,
    choose_near,
    quads_in_view,
)
from spacemap_vtk.scenes.scene import Scene

SIZE = 640, 480
#: 400 by 400 yarns, half a millimetre apart.
CLOTH = DrawnCloth(400, 400, 3_840_000, spacing=5e-4, height=2.5e-4, width=4e-4)
FEW = replace(CLOTH, ends=7, picks=7, patches=1176)


@pytest.mark.parametrize(
    ("cloth", "stated", "form"),
    [
        (FEW, {}, DrawingMethod.WHOLE),
        (FEW, {"fit": False}, DrawingMethod.SHEET),
        (CLOTH, {}, DrawingMethod.SHEET),
        # The window draws fewer together.
        (replace(CLOTH, patches=60_000), {"window": True}, DrawingMethod.WHOLE),
        (replace(CLOTH, patches=60_001), {"window": True}, DrawingMethod.SHEET),
        (replace(CLOTH, patches=60_001), {}, DrawingMethod.WHOLE),
        # The face of a still cloth: yarns too thin to be seen, of some pixels, and wider.
        (FEW, {"face": 1.9}, DrawingMethod.SHEET),
        (FEW, {"face": 1.9, "opengl": False}, DrawingMethod.WHOLE),
        (FEW, {"face": 4.0}, DrawingMethod.WHOLE),
        (CLOTH, {"face": 1.9}, DrawingMethod.SHEET),
        (CLOTH, {"face": 8.0}, DrawingMethod.SHEET),
        # Whoever asks for so many quadrilaterals gets them: in pieces, or refused.
        (replace(CLOTH, subdivisions=2), {}, DrawingMethod.WHOLE),
        (replace(CLOTH, subdivisions=2), {"fit": False}, DrawingMethod.SHEET),
        (replace(CLOTH, subdivisions=64), {"fit": False}, DrawingMethod.WHOLE),
        (replace(FEW, subdivisions=1), {"face": 1.9}, DrawingMethod.WHOLE),
    ],
)
def test_drawing_method_follows_from_counts(
    cloth: DrawnCloth, stated: dict[str, bool], form: DrawingMethod
) -> None:
    assert choose_method(cloth, **stated) is form


@pytest.mark.parametrize(
    ("cloth", "pixels", "form"),
    [
        (CLOTH, 1.9, DrawingMethod.SHEET),
        (CLOTH, 2.0, DrawingMethod.PIECES),
        (replace(CLOTH, least_pixels=5.0), 4.9, DrawingMethod.SHEET),
        (replace(CLOTH, subdivisions=2), 1.9, DrawingMethod.PIECES),
        (replace(CLOTH, clearance=True), 5.0, DrawingMethod.TILES),
    ],
)
def test_visible_yarns_replace_the_sheet(
    cloth: DrawnCloth, pixels: float, form: DrawingMethod
) -> None:
    level = LevelOfDetail(DrawingMethod.SHEET).at_scale(cloth, pixels / cloth.spacing, SIZE)
    assert level.method is form
    assert level.is_sampled is (pixels < 4.0)
    if form is not DrawingMethod.SHEET:
        # No piece has more patches or quadrilaterals than are drawn in some hundred megabytes.
        assert cloth.patches / level.pieces <= 300_000
        assert cloth.patches * (cloth.subdivisions or level.sides) ** 2 / level.pieces <= 800_000
    whole = LevelOfDetail(DrawingMethod.WHOLE)
    assert whole.at_scale(cloth, 1e4, SIZE).method is DrawingMethod.WHOLE


def test_facets_depend_on_the_width_of_a_yarn() -> None:
    plied = replace(FEW, plies=3)
    far, near, nearest = (
        LevelOfDetail().at_scale(plied, pixels / plied.width, SIZE) for pixels in (8, 18, 1000)
    )
    assert (far.plies, far.fibres, far.near_quads) == (1, False, 0)
    assert (near.plies, near.fibres, near.near_quads) == (3, True, 0)
    assert 1 <= far.sides < near.sides
    # So near, only what is in view has more.
    assert (nearest.sides, nearest.near_quads) == (LEAST_SIDES, quads_in_view(SIZE))
    for fixed in (replace(plied, clearance=True), replace(plied, subdivisions=3)):
        assert LevelOfDetail().at_scale(fixed, 1000 / plied.width, SIZE).near_quads == 0


def test_window_builds_yarns_in_view_unless_too_thin_or_too_many() -> None:
    scale = 10 / CLOTH.spacing
    assert choose_near(CLOTH, scale, 10_000, SIZE).method is DrawingMethod.NEAR
    assert choose_near(CLOTH, 2.9 / CLOTH.spacing, 10_000, SIZE).method is DrawingMethod.SHEET
    assert choose_near(CLOTH, scale, 2_000_000, SIZE).method is DrawingMethod.SHEET
    many, few = (choose_near(CLOTH, 10 * scale, n, SIZE) for n in (1_000_000, 10_000))
    assert 1_000_000 * many.sides**2 <= 2_000_000
    assert few.sides > many.sides


def test_objects_are_drawn_whole() -> None:
    scene = Scene.read(library.find("tube_bundle"))
    assert not scene.woven
    assert DrawnCloth.from_scene(scene) is None
    assert choose_level(scene).method is DrawingMethod.WHOLE
    # Yarns without room: the stage says so when it runs.
    jammed = Scene({"weave": {"warp_diameter": 1e-3, "weft_diameter": 1e-3}})
    assert DrawnCloth.from_scene(jammed) is None
    assert choose_level(jammed).method is DrawingMethod.WHOLE


def test_tiles_replace_yarns_below_five_pixels_except_lines_and_numbers() -> None:
    weave = {"ends": 1, "picks": 1}
    for view, pixels in (({}, 5.0), ({"style": "paper"}, 2.0), ({"color": "clearance"}, 2.0)):
        cloth = DrawnCloth.from_scene(Scene({"weave": weave, "view": view}))
        assert cloth is not None
        assert cloth.least_pixels == pixels
