"""Whole lives of the window in processes of their own: many, and one on a dense screen."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from window import require_display

require_display()


def run(script: str, *arguments: str, **variables: str) -> dict[str, Any]:
    """Run a script of this folder, and return what it tells."""
    here = Path(__file__).parent
    # A screen of its own where there is Xvfb: twice the pixels need twice the room.
    screen = ["xvfb-run", "-a", "-s", "-screen 0 2560x1440x24"] if shutil.which("xvfb-run") else []
    done = subprocess.run(
        [*screen, sys.executable, "-W", "error", str(here / script), *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(here.parent), *sys.path])} | variables,
    )
    assert done.returncode == 0, done.stderr
    assert "rror" not in done.stderr, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("rounds", [20, pytest.param(100, marks=pytest.mark.nightly)])
def test_many_windows_leave_no_memory_or_objects_behind(rounds: int) -> None:
    told = run("window_rounds.py", str(rounds))
    assert len(told["memory"]) == rounds
    assert (told["windows"], told["widgets"]) == (0, 0)
    warm = rounds // 2  # until then caches fill
    assert told["threads"][-1] == told["threads"][warm]
    assert told["files"] < 60
    # Python's objects: matplotlib's caches of fonts fill, nothing else does.
    late = told["objects"][warm:]
    assert max(late) - min(late) < 2 * warm, told["grown"]
    # A window takes some 20 MB, of which nothing may stay.
    assert told["memory"][-1] - told["memory"][warm] < 10, told["memory"]


def test_high_resolution_screen_shows_the_same_in_finer_pixels(tmp_path: Path) -> None:
    once, twice = (
        run("window_dense.py", str(tmp_path / f"{scale}.png"), QT_SCALE_FACTOR=str(scale))
        for scale in (1, 2)
    )
    assert (once["ratio"], twice["ratio"]) == (1, 2)
    # At first the window is no larger than the screen, which has room for 1280 by 720 of Qt's.
    assert once["fits"]
    assert twice["fits"]
    # VTK draws every pixel there is.
    assert once["drawn"] == once["view"]
    assert twice["drawn"] == [2 * side for side in twice["view"]]
    assert np.abs(np.subtract(twice["view"], once["view"])).max() <= 6
    # A click hits the cell it is aimed at, and a pick the yarn.
    assert once["threading"] == twice["threading"]
    assert once["threading"][2] == [2]
    assert sum(found is not None for found in once["picked"]) > 3
    yarns = [[found and found[0] for found in told["picked"]] for told in (once, twice)]
    assert sum(a != b for a, b in zip(*yarns, strict=True)) <= 2
    small = Image.open(tmp_path / "1.png").convert("RGB")
    large = Image.open(tmp_path / "2.png").convert("RGB")
    assert np.abs(np.subtract(large.size, np.multiply(small.size, 2))).max() <= 4
    # The same picture, but for the sharpness of its letters.
    again = np.asarray(large.resize(small.size, Image.Resampling.BOX), dtype=float)
    difference = np.abs(again - np.asarray(small, dtype=float))
    assert difference.mean() < 12
    # Dots, lines and letters are as wide.
    for name, count in once["pixels"].items():
        assert twice["pixels"][name] / count == pytest.approx(4.0, rel=0.25), name
    # It is finer: what is gone after halving and doubling was there.
    coarse = np.asarray(large.resize(small.size, Image.Resampling.BOX).resize(large.size), float)
    assert np.abs(coarse - np.asarray(large, dtype=float)).mean() > 1
