"""Cloth cut along a yarn: published figures, and curves that touch and never overlap."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path

from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.geometry.cross_section import cut_cloth
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads


def test_published_figures_are_found_again_on_the_curves() -> None:
    jammed = Threads(diameter=0.5, spacing=np.sqrt(0.75))
    cut = cut_cloth(
        Cloth(drawdown=tile_drawdown([[1, 0], [0, 1]], 5, 5), warp=jammed, weft=jammed), 0
    )
    assert len(cut.bends) == 4
    for bend in cut.bends:
        assert np.degrees(bend.angle) == pytest.approx(60.0, abs=1e-4)
        assert (bend.length, bend.height) == pytest.approx((1.0472, 0.5), abs=1e-5)
        assert bend.crimp == pytest.approx(0.2092, abs=1e-4)


@pytest.mark.parametrize("name", ["plain", "flattened", "satin_8_3", "double_weave"])
def test_yarns_touch_and_never_overlap(name: str) -> None:
    if name in ("plain", "flattened"):
        more = {"section": "racetrack", "aspect": 1.5} if name == "flattened" else {}
        threads = Threads(diameter=0.2e-3, spacing=0.5e-3, **more)
        cloth = Cloth(drawdown=tile_drawdown([[1, 0], [0, 1]], 7, 7), warp=threads, weft=threads)
    else:
        cloth = Scene.read(name).woven.cloth
    for family in (0, 1):
        cut = cut_cloth(cloth, family)
        assert cut.bends
        for number, section in enumerate(cut.sections):
            smaller = cut.centres[number] + (1 - 5e-3) * (section - cut.centres[number])
            assert not Path(cut.outline).contains_points(smaller).any()
            away = np.linalg.norm(section[::4, None] - cut.outline[None, ::4], axis=2).min()
            assert (away < 0.02 * cut.diameter) == cut.touching[number]
