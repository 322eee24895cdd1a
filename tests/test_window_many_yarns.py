"""Cloth of many yarns in the window: a sheet while it moves, at rest its yarns, if not too many."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, scene_of, settled, wait_until

require_display()

from spacemap_vtk.app import pipeline  # noqa: E402
from spacemap_vtk.app.job import Job  # noqa: E402
from spacemap_vtk.draw import form  # noqa: E402
from spacemap_vtk.draw.frame import Frame  # noqa: E402

SCENE = """
[weave]
ends = {yarns}
picks = {yarns}
warp_color = "#c03a2b"
weft_color = "#f0e6d2"
[cage]
divisions = [6, 6, 1]
[modal]
elements = "sheet"
modes = 6
[response]
gravity = [0, 0, "0.2 g"]
"""


@pytest.fixture
def opened(open_window: Any, tmp_path: Path) -> Any:
    def show(yarns: int) -> Any:
        file = tmp_path / "many.toml"
        file.write_text(SCENE.format(yarns=yarns))
        return open_window(str(file))

    return show


def test_eight_hundred_yarns_follow_the_time(opened: Any) -> None:
    window = opened(800)
    frame = window.view.frame
    assert frame.cloth is not None
    assert not frame.coarse
    assert any("shows a sheet" in text for text in frame.warnings)
    image = window.view.image()
    assert np.ptp(image[image.shape[0] // 2].astype(int), axis=0).max() > 60
    begun = time.perf_counter()
    window.times.go(0.1)
    wait_until(lambda: settled(window) and abs(window.view.frame.time - 0.1) < 1e-9)
    assert time.perf_counter() - begun < 10.0
    assert np.ptp(np.array(window.view.frame.surface.GetBounds())[4:]) > 1e-3
    assert scene_of(window).warp.executions == 0


def test_at_rest_yarns_are_drawn_while_they_are_few(
    opened: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(form, "_MANY_PATCHES", 100)
    window = opened(10)
    assert window.view.frame.cloth is None
    director, run = window.director, pipeline.Pipeline.run
    # Where cores are busy the smooth frame may be there before the coarse one is drawn.
    made: list[Frame] = []

    def noted(self: pipeline.Pipeline, job: Job) -> Frame:
        made.append(run(self, job))
        return made[-1]

    monkeypatch.setattr(pipeline.Pipeline, "run", noted)
    director.ask(coarse=True)
    wait_until(lambda: len(made) > 1 and settled(window))
    assert made[0].coarse
    assert made[0].cloth is not None
    assert window.view.frame.cloth is None
    assert scene_of(window).modal.executions == 1
    monkeypatch.setattr(pipeline, "FINE_PATCHES", 100)
    director.ask()
    wait_until(lambda: window.view.frame.cloth is not None and settled(window))
    assert not window.view.frame.coarse
