"""Windows in separate processes: many in sequence, and one on a high-resolution screen."""

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
    """Run a script of this folder, and return the JSON that it prints."""
    folder = Path(__file__).parent
    # A separate screen if Xvfb exists, because twice the pixels need twice the space.
    screen = ["xvfb-run", "-a", "-s", "-screen 0 2560x1440x24"] if shutil.which("xvfb-run") else []
    done = subprocess.run(
        [*screen, sys.executable, "-W", "error", str(folder / script), *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
        env=os.environ
        | {"PYTHONPATH": os.pathsep.join([str(folder.parent), *sys.path])}
        | variables,
    )
    assert done.returncode == 0, done.stderr
    assert "rror" not in done.stderr, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.nightly
def test_many_windows_leave_no_memory_or_objects_behind() -> None:
    rounds = 100
    result = run("window_rounds.py", str(rounds))
    assert len(result["memory"]) == rounds
    assert (result["windows"], result["widgets"]) == (0, 0)
    warm = rounds // 2  # caches fill until then
    assert result["threads"][-1] == result["threads"][warm]
    assert result["files"] < 60
    # Python objects: only matplotlib's font caches grow.
    late = result["objects"][warm:]
    assert max(late) - min(late) < 2 * (len(late) - 1), result["grown"]
    # A window takes about 20 MB, which must be freed.
    assert result["memory"][-1] - result["memory"][warm] < 10, result["memory"]


@pytest.mark.nightly
def test_high_resolution_screen_shows_the_same_in_finer_pixels(tmp_path: Path) -> None:
    once, twice = (
        run("window_dense.py", str(tmp_path / f"{scale}.png"), QT_SCALE_FACTOR=str(scale))
        for scale in (1, 2)
    )
    assert (once["ratio"], twice["ratio"]) == (1, 2)
    # The first window is not larger than the screen of 1280 by 720 Qt pixels.
    assert once["fits"]
    assert twice["fits"]
    # VTK draws every device pixel.
    assert once["drawn"] == once["view"]
    assert twice["drawn"] == [2 * side for side in twice["view"]]
    assert np.abs(np.subtract(twice["view"], once["view"])).max() <= 6
    # A click hits the intended cell, and a pick the intended yarn.
    assert once["threading"] == twice["threading"]
    assert once["threading"][2] == [2]
    assert sum(found is not None for found in once["picked"]) > 3
    yarns = [[found and found[0] for found in result["picked"]] for result in (once, twice)]
    assert sum(a != b for a, b in zip(*yarns, strict=True)) <= 2
    small = Image.open(tmp_path / "1.png").convert("RGB")
    large = Image.open(tmp_path / "2.png").convert("RGB")
    assert np.abs(np.subtract(large.size, np.multiply(small.size, 2))).max() <= 4
    # The same picture except for the sharpness of letters.
    again = np.asarray(large.resize(small.size, Image.Resampling.BOX), dtype=float)
    difference = np.abs(again - np.asarray(small, dtype=float))
    assert difference.mean() < 12
    # Dots, lines and letters have the same size.
    for name, count in once["pixels"].items():
        assert twice["pixels"][name] / count == pytest.approx(4.0, rel=0.25), name
    # It is finer: halving and doubling the pixels loses detail.
    coarse = np.asarray(large.resize(small.size, Image.Resampling.BOX).resize(large.size), float)
    assert np.abs(coarse - np.asarray(large, dtype=float)).mean() > 1
