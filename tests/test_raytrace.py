"""Ray-traced pictures, if Mitsuba is installed."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.scenes.scene import Scene

pytest.importorskip("mitsuba")
raytrace = pytest.importorskip("spacemap_vtk.draw.raytrace")


def test_fibres_have_yarn_colours_and_gaps_are_dark() -> None:
    # seen flat, cloth of blue ends and red picks with gaps between them
    weave = {"ends": 4, "picks": 4, "warp_color": "#3060c0", "weft_color": "#c04030"}
    weave["warp_diameter"] = [2.4e-4, 2.6e-4]
    view = {"camera": "front", "zoom": 1.6, "background": "#ffffff", "background_top": "#ffffff"}
    steps: list[tuple[int, int]] = []
    scene = Scene({"weave": weave, "view": {**view, "triad": True}})
    image = raytrace.raytrace(scene, 0.0, (64, 48), 4, lambda *at: steps.append(at))
    assert scene.warnings[-1].endswith("ray tracing ignores view.triad")
    assert image.shape == (48, 64, 3)
    assert steps[0] == (0, 9)
    assert steps[-1] == (9, 9)
    red, _, blue = np.moveaxis(image.astype(float), 2, 0)
    clear = image.min(axis=2) > 250
    assert 0.1 < clear.mean() < 0.5  # a plain weave of yarns half as thick as apart lets a quarter
    # families lie on top of each other as often
    for ours, others in ((red, blue), (blue, red)):
        assert 0.25 < (ours > 1.2 * others)[~clear].mean() < 0.75
    assert np.percentile(image[~clear].mean(axis=1), 10) < 0.6 * image[~clear].mean(axis=1).max()


def test_a_lens_blurs_what_is_out_of_focus() -> None:
    weave = {"ends": 3, "picks": 3, "warp_color": "#000000", "weft_color": "#000000"}
    view = {"camera": "front", "background": "#ffffff", "background_top": "#ffffff"}
    images = []
    for lens in ({}, {"aperture": 0.3}, {"aperture": 0.3, "focus": [0.0, 0.0, 3e-3]}):
        scene = Scene({"weave": weave, "view": {**view, **lens}})
        images.append(raytrace.raytrace(scene, 0.0, (64, 48), 16, lambda *_: None).astype(float))
    # Yarns are about as near as the plane of focus, or 3 mm farther away.
    sharp, near, far = (
        np.abs(np.diff(image[..., 1], axis=1)).max(axis=1).mean() for image in images
    )
    assert near == pytest.approx(sharp, rel=0.25)
    assert far < 0.5 * sharp
