"""Styles: each is another look, and each of its promises is seen in pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.styles import LIGHTS, STYLES

WEAVE = {"ends": 4, "picks": 4, "warp_color": "#2850a0", "weft_color": "#f0c820"}


def drawn(style: str, side: int = 160, **weave: Any) -> NDArray[np.uint8]:
    view = {"style": style, "camera": "front"}
    scene = Scene({"weave": {**WEAVE, **weave}, "surface": {"subdivisions": 3}, "view": view})
    picture = Picture(scene, [0.0], (side, side))
    image = picture.draw(0.0).copy()
    picture.close()
    return image


def share(image: NDArray[np.uint8], color: Any) -> float:
    return float((np.abs(image.astype(int) - color).max(axis=2) <= 1).mean())


def test_each_style_gives_a_different_picture_and_background() -> None:
    images = {name: drawn(name) for name in STYLES}
    for name, image in images.items():
        below, above = STYLES[name].bottom_color, STYLES[name].top_color
        assert np.abs(image[-1, 0].astype(int) - below).max() <= 2
        assert np.abs(image[0, 0].astype(int) - above).max() <= 2
    names = list(images)
    for k, name in enumerate(names):
        for other in names[k + 1 :]:
            assert np.abs(images[name].astype(int) - images[other]).mean() > 4


def test_schematic_has_flat_colours_and_lines() -> None:
    image = drawn("schematic")
    # Most of what is drawn is of one of the two colours, all but the lines, which are black.
    cloth = 1.0 - share(image, (255, 255, 255))
    assert share(image, (0x28, 0x50, 0xA0)) + share(image, (0xF0, 0xC8, 0x20)) > 0.75 * cloth
    assert 0.005 < share(image, (0, 0, 0)) < 0.1


@pytest.mark.nightly
def test_sheet_seen_from_afar_has_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    many = {"ends": 32, "picks": 32, "warp_diameter": 2.8e-4, "weft_diameter": 2.8e-4}
    fine = drawn("blueprint", 320, **many)[80:240, 80:240].mean(axis=(0, 1))
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    scene = Scene({"weave": {**WEAVE, **many}, "view": {"style": "blueprint", "camera": "front"}})
    picture = Picture(scene, [0.0], (48, 48))
    afar = picture.draw(0.0)[12:36, 12:36].mean(axis=(0, 1))
    picture.close()
    assert picture.sheet is not None
    assert np.abs(afar - fine).max() < 8


def test_ground_has_a_soft_shadow_in_styles_with_light() -> None:
    for style in ("studio", "paper", "schematic"):
        white = {"background": "#ffffff", "background_top": "#ffffff", "camera": "lying"}
        view = {**white, "style": style, "ground": True}
        scene = Scene({"weave": WEAVE, "surface": {"subdivisions": 2}, "view": view})
        picture = Picture(scene, [0.0], (160, 120))
        image = picture.draw(0.0).astype(int)
        assert bool(picture.panels[0].scene_view.ground.GetVisibility()) == (style != "schematic")
        picture.close()
        # The yarns are blue and yellow, the shadow is grey, and fades before the picture ends.
        grey = (np.ptp(image, axis=2) <= 1) & (image[..., 0] > 150) & (image[..., 0] < 250)
        assert (grey.mean() > 0.03) == (style != "schematic")
        assert np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]]).min() >= 250


def test_unknown_style_is_refused_with_the_list() -> None:
    with pytest.raises(InputError) as refused:
        Scene({"weave": {}, "view": {"style": "stuido"}})
    for word in ("view.style", "stuido", *STYLES):
        assert word in str(refused.value)


def lit(light: str | None, side: int, **weave: Any) -> NDArray[np.float64]:
    view = {"camera": "front", "irregularity": 0.0, **({"light": light} if light else {})}
    scene = Scene({"weave": {**WEAVE, **weave}, "view": view})
    picture = Picture(scene, [0.0], (side, side))
    image = picture.draw(0.0).astype(float)
    picture.close()
    return image


def test_each_light_gives_a_different_picture() -> None:
    images = [lit(name, 120) for name in LIGHTS]
    for k, image in enumerate(images):
        for other in images[k + 1 :]:
            assert np.abs(image - other).mean() > 3


def test_flat_light_shows_the_colours_of_the_yarns() -> None:
    image = lit("flat", 160).reshape(-1, 3)
    for color in (WEAVE["warp_color"], WEAVE["weft_color"]):
        own = np.array([*bytes.fromhex(str(color)[1:])], float)
        # Pixels of this hue; between fibres it is darker by a tenth.
        along = image @ own / (own @ own)
        of_yarn = np.abs(image - along[:, None] * own).max(axis=1) < 6
        assert np.median(along[of_yarn & (along > 0.5)]) == pytest.approx(0.93, abs=0.07)


@pytest.mark.nightly
@pytest.mark.parametrize("light", [None, *LIGHTS])
def test_far_cloth_is_as_bright_as_its_yarns(
    light: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = {"ends": 32, "picks": 32, "warp_diameter": 2.8e-4, "weft_diameter": 2.8e-4}
    near = np.sqrt(np.square(lit(light, 480, **many)[160:320, 160:320]).mean(axis=(0, 1)))
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    far = np.sqrt(np.square(lit(light, 48, **many)[16:32, 16:32]).mean(axis=(0, 1)))
    assert np.abs(far / near - 1.0).max() < 0.08
