"""The plugin inside the real ParaView: each script of tests/paraview runs in pvpython."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.paraview import environment

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "tests" / "paraview"

pytestmark = pytest.mark.skipif(
    shutil.which("pvpython") is None or shutil.which("xvfb-run") is None,
    reason="needs pvpython and xvfb-run: apt-get install paraview python3-paraview xvfb xauth",
)
XVFB = ["xvfb-run", "-a", "-s", "-screen 0 1280x1024x24 -noreset"]


def run(script: Path, *arguments: object, program: str = "pvpython") -> str:
    """Run a script with the plugin, and fail on anything that is printed as an error."""
    done = subprocess.run(
        [*XVFB, program, str(script), *map(str, arguments)],
        env={**environment.process_environment(), "LIBGL_ALWAYS_SOFTWARE": "1"},
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    return done.stdout


def test_every_declared_parameter_is_a_property() -> None:
    assert run(SCRIPTS / "declarations.py") == "10 proxies\n"


def test_time_demand_windows_and_no_leaks() -> None:
    assert run(SCRIPTS / "behaviour.py") == "time, demand, windows, no leaks\n"


def test_mistakes_are_told_and_the_last_good_state_stays() -> None:
    assert run(SCRIPTS / "mistakes.py") == "mistakes are told and do no harm\n"


def test_state_files(tmp_path: Path) -> None:
    assert "both state files load\n" in run(SCRIPTS / "state.py", tmp_path)


def test_scenes_drafts_and_other_readers(tmp_path: Path) -> None:
    out = run(SCRIPTS / "readers.py", ROOT / "scenes", tmp_path)
    assert out == "scenes, drafts and other readers\n"


@pytest.mark.parametrize("program", ["pvpython", "pvbatch"])
@pytest.mark.parametrize(
    "script", sorted((ROOT / "pipelines" / "paraview").glob("*.py")), ids=lambda p: p.stem
)
def test_pipeline_script(script: Path, program: str, tmp_path: Path) -> None:
    picture = tmp_path / "cloth.png"
    assert run(script, picture, program=program)
    red, _, blue = np.asarray(Image.open(picture).convert("RGB")).astype(int).reshape(-1, 3).T
    assert np.mean(red - blue > 40) > 0.05  # the weft's sand
    assert np.mean((blue - red > 30) & (red < 50)) > 0.05  # the warp's blue


def test_the_real_window_shows_fabric_and_panel(tmp_path: Path) -> None:
    picture = tmp_path / "window.png"
    done = subprocess.run(
        [*XVFB, sys.executable, str(SCRIPTS / "photograph.py"), str(picture)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    view, panel = pixels[200:800, 310:], pixels[520:800, :270]
    assert np.mean(view[..., 0] - view[..., 2] > 40) > 0.03  # the weft's sand
    assert np.mean(panel.min(axis=2) > 250) > 0.2  # fields to write in


def test_a_vtk_script_runs_in_paraviews_python_as_it_is() -> None:
    script = ROOT / "pipelines" / "with_vtk.py"
    done = subprocess.run(
        ["pvpython", str(script)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("sag ")


def test_the_filters_without_the_plugin() -> None:
    assert "1 passed" in run(ROOT / "tests" / "paraview_pipeline.py")


def test_check_reports_the_versions() -> None:
    report = environment.check()
    assert report.startswith("ParaView ")
    assert report.endswith("SceneReader work")


def test_the_printed_lines_start_paraview_with_the_plugin() -> None:
    done = subprocess.run(
        ["sh", "-c", 'eval "$(python -m spacemap_vtk paraview)"; pvpython -c "$CODE"'],
        env={
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "CODE": "from paraview.simple import *; print(PatchTessellator.__name__)",
        },
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("PatchTessellator\n", ""), done
