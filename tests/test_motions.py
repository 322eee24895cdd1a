"""One scene moved by modes, by modes whose turning is rebuilt, and by steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import array_of
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.motions import MOTIONS, require_loads, set_motion
from spacemap_vtk.scenes.scene import Scene

CAGE = {
    "weave": {"ends": 3, "picks": 7},
    "cage": {"divisions": [1, 4, 1]},
    "modal": {"elements": "sheet", "youngs_modulus": 2e4, "density": 300, "fixed": "+y"},
}
SHARED = {
    "damping_pairs": [[10, 0.05], [300, 0.2]],
    "gravity": [0.0, -9.8, 0.0],
    "initial_velocity": [0.0, 0.0, 0.02],
    "loads": [{"pressure": 0.5, "on": "-z", "time": "pulse", "length": "5 ms"}],
}


def moved(scene: Scene, time: float = 0.012) -> Any:
    scene.update(time)
    return array_of(scene.deformed_cage.GetPointData(), "displacement", "a test").copy()


@pytest.mark.nightly
@pytest.mark.parametrize("begin", ["response", "transient"])
def test_motion_equals_that_of_a_scene_file(begin: str) -> None:
    scene = Scene({**CAGE, begin: SHARED})
    given = require_loads(scene)
    for name, (sections, _) in [*MOTIONS.items(), *reversed(MOTIONS.items())]:
        set_motion(scene, name, given)
        written = Scene({**CAGE, sections[0]: SHARED, **{key: {} for key in sections[1:]}})
        assert [stage.section for stage in scene.stages] == [s.section for s in written.stages]
        np.testing.assert_array_equal(moved(scene), moved(written))
    assert scene.modal.executions == 1


def test_damping_ratios_are_transferred() -> None:
    scene = Scene({**CAGE, "response": {"damping_ratio": [0.04, 0.1]}})
    set_motion(scene, "transient", require_loads(scene))
    scene.update(time=0.001)
    modes = report.report_modes(scene)["modes"]
    assert modes[0]["damping_ratio"] == pytest.approx(0.04)
    assert modes[-1]["damping_ratio"] == pytest.approx(0.1)


def test_lost_settings_are_reported() -> None:
    scene = Scene({**CAGE, "transient": {"held": "-y"}})
    set_motion(scene, "response", require_loads(scene))
    assert any("as [transient] does" in text for text in scene.warnings)


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return int(ended.value.code or 0)


@pytest.mark.nightly
def test_storyboard_has_a_row_for_each_motion(tmp_path: Path) -> None:
    file = tmp_path / "board.png"
    board = ["storyboard", "swing", "--times", "0,0.3,1", "--size", "300x240", "-q"]
    board += ["-o", str(file)]
    for value in ("transient.tolerance=0.1", "cage.divisions=[6,1,1]"):
        board += ["--set", value]
    assert run(*board, "--motions", "response,rotation,transient") == 0
    pixels = np.asarray(Image.open(file)).astype(int)
    rows = pixels[:240, -300:].reshape(3, 80, 3, 100, 3).swapaxes(1, 2)
    strange = np.ptp(rows, axis=-1) > 40  # the background is pale
    drawn = strange.mean(axis=(2, 3))
    assert drawn.min() > 0.005
    # At first all are alike; stretched, what moves by modes covers more.
    assert abs(rows[:, 0] - rows[0, 0]).max() < 30
    assert drawn[0, 1] > 1.5 * drawn[1:, 1].max()
    # Late in the second swing modes are ahead of steps, rebuilt or not.
    assert abs(strange[1, 2] ^ strange[2, 2]).sum() > strange[2, 2].sum()


@pytest.mark.parametrize(
    ("scene", "motions", "reported"),
    [
        ("swing", "response,jumps", ["--motions", "jumps", "response, rotation, transient"]),
        ("calculix_fabric", "response", ["[response] or [transient]"]),
    ],
)
def test_unknown_motions_are_refused(
    scene: str,
    motions: str,
    reported: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "board.png"
    assert run("storyboard", scene, "-o", str(file), "-q", "--motions", motions) == 2
    message = capsys.readouterr().err
    for word in reported:
        assert word in message
    assert not file.exists()
