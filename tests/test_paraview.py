"""The plugin in ParaView: each script of tests/paraview runs in pvpython."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import FILTERS, ModalSolver, TetraCage, WeaveSource, connect
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.paraview import environment
from spacemap_vtk.scenes.scene import Scene

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "tests" / "paraview"
PIPELINES = ROOT / "pipelines" / "paraview"

pytestmark = pytest.mark.skipif(
    shutil.which("pvpython") is None or shutil.which("xvfb-run") is None,
    reason="needs pvpython and xvfb-run: apt-get install paraview python3-paraview xvfb xauth",
)
#: Pipelines that take longest, and one that is run with MPI.
SLOW = {"film", "on_a_result"}
PARALLEL = {"cloth_over_ranks"}
#: Environment of a shell that finds this Python and this package.
SHELL = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
XVFB = ["xvfb-run", "-a", "-s", "-screen 0 1280x1024x24 -noreset"]


def run(script: Path, *arguments: object, program: str = "pvpython") -> str:
    """Run a script with the plugin; fail if it prints any error."""
    done = subprocess.run(
        [*XVFB, program, str(script), *map(str, arguments)],
        env={**environment.process_environment(), "LIBGL_ALWAYS_SOFTWARE": "1"},
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    return done.stdout


def hang(file: Path) -> None:
    """Write the figures that Python computes for the sheet of hung.py."""
    solver = ModalSolver(
        elements="sheet",
        fixed="-x",
        modes=6,
        gravity=(0, 0, -9.80665),
        tensile_rigidity="200 N/m",
        bending_rigidity=["0.1 uN.m", "0.05 uN.m"],
        areal_mass="150 g/m2",
    )
    connect(WeaveSource(ends=20, picks=8), TetraCage(divisions=(10, 4, 1)), solver)
    output = solver.update().output
    found = {"equilibrium": output.GetPointData()}
    found |= dict.fromkeys(("frequencies", "bending_length"), output.GetFieldData())
    np.savez(file, **{k: vtk_to_numpy(data.GetArray(k)) for k, data in found.items()})


def run_in_one_session(scripts: dict[str, tuple[list[Path], str]], folder: Path) -> None:
    """Run scripts with their arguments, each of which prints what it says."""
    words = [f"{name}={','.join(map(str, arguments))}" for name, (arguments, _) in scripts.items()]
    run(SCRIPTS / "session.py", folder / "reported.json", *words)
    reported = json.loads((folder / "reported.json").read_text())
    wrong = {
        name: reported[name]
        for name, (_, says) in scripts.items()
        if says not in reported[name] or "Traceback" in reported[name] or not reported[name]
    }
    assert not wrong, "\n".join(f"{name}: {text}" for name, text in wrong.items())


def test_scripts_in_one_session(tmp_path: Path) -> None:
    """The scripts share one session, because starting ParaView takes longer than each of them."""
    proxies = len(FILTERS) + 3  # and two readers, and what shows obstacles
    hang(tmp_path / "hung.npz")
    scripts = {
        "obstacles": ([], "obstacles, shown where they are\n"),
        "hung": ([tmp_path / "hung.npz"], "hung as in Python\n"),
        "behaviour": ([], "time, demand, windows, no leaks\n"),
        "declarations": ([], f"{proxies} proxies\n"),
        "mistakes": ([], "mistakes are reported and do no harm\n"),
        "state": ([tmp_path], "a state file brings back its pipeline\n"),
        "colours": ([tmp_path], "yarns in their own colours\n"),
        "readers": ([ROOT / "scenes", tmp_path], "scenes, drafts and other readers\n"),
    }
    # Scripts of plain VTK, as they are: ParaView's Python has an older VTK and no PyVista.
    scripts |= {f"../../pipelines/{name}": ([], "") for name in ("with_vtk", "on_a_result")}
    scripts["../paraview_pipeline"] = [], "1 passed"
    # It comes first and sets the shape of the view: one that its picture fills.
    woven = {"../../pipelines/paraview/plain_weave": ([tmp_path / "woven.png"], "sag")}
    run_in_one_session(woven | scripts, tmp_path)
    in_the_yarns_colours(tmp_path / "woven.png")
    pictures = [
        np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB")).astype(int)
        for name in ("shown", "again", "displacement", "map")
    ]
    red, _, blue = pictures[0].reshape(-1, 3).T
    assert np.mean(red - blue > 40) > 0.03  # the weft's sand
    assert np.abs(pictures[1] - pictures[0]).max() <= 1
    for picture in pictures[2:]:
        assert np.mean(np.abs(picture - pictures[0]).max(axis=2) > 30) > 0.1


@pytest.mark.nightly
def test_series_and_cuts_in_one_session(tmp_path: Path) -> None:
    cloth = {"ends": 2, "picks": 2}
    scene = Scene({"weave": cloth, "cage": {}, "modal": {"modes": 3}, "response": {}})
    for name in ("cloth.pvd", "cloth_%d.vtp"):
        make_data_job(tmp_path / name, times=[0.0, 0.1 / 3]).run(scene)
    make_data_job(tmp_path / "in_pieces.pvtp", times=[0.1 / 3], pieces=3).run(scene)
    scripts = {
        "series": ([tmp_path], "every step is offered, and any time between\n"),
        "cuts": ([], "cut yarns keep their numbers and colours\n"),
    }
    run_in_one_session(scripts, tmp_path)


@pytest.mark.nightly
def test_state_files_bring_back_every_proxy(tmp_path: Path) -> None:
    printed = run(SCRIPTS / "state_of_all.py", ROOT / "scenes", tmp_path)
    assert printed == f"{len(FILTERS) + 3} proxies come back from both state files\n"


@pytest.fixture(
    params=[
        "server's environment",
        *(
            pytest.param(name, marks=pytest.mark.nightly)
            for name in ("both environments", "loaded by the client")
        ),
    ]
)
def server(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[int, str]]:
    """Start pvserver in a shell with the printed lines; return its port and the plugin's path."""
    has_plugin = "environment" in request.param
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    lines = 'eval "$(python -m spacemap_vtk paraview)"; '
    if not has_plugin:
        lines += "unset PV_PLUGIN_CONFIG_FILE; "
    lines += f"exec pvserver --server-port={port}"
    log = tmp_path / "server.log"
    with log.open("w") as out:
        process = subprocess.Popen(
            [*XVFB, "sh", "-c", lines],
            env={**SHELL, "LIBGL_ALWAYS_SOFTWARE": "1"},
            stdout=out,
            stderr=out,
            cwd=ROOT,
            start_new_session=True,
        )
    try:
        deadline = time.monotonic() + 300
        while "Accepting connection" not in log.read_text():
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.1)
        yield port, request.param
        process.wait(timeout=300)  # the server ends with its only client
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.mark.nightly
def test_client_and_server_work(server: tuple[int, str], tmp_path: Path) -> None:
    port, plugin = server
    picture = tmp_path / "remote.png"
    arguments = [port, ROOT / "scenes" / "32-shaft_twill.wif", picture]
    if plugin == "loaded by the client":
        arguments.append(environment.PLUGIN)
    both = plugin == "both environments"
    client = environment.process_environment() if both else dict(os.environ)
    client["LIBGL_ALWAYS_SOFTWARE"] = "1"
    done = subprocess.run(
        [*XVFB, "pvpython", str(SCRIPTS / "remote.py"), *map(str, arguments)],
        env=client,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    # The server's messages reach the client: the two mistakes, each in one line, and nothing else.
    messages = [line for line in done.stderr.splitlines() if "|" in line]
    assert len(messages) == 2, done.stderr
    assert "ModalResponse: duration = -1.0: out of range" in messages[0]
    assert "Make warp_diameter smaller" in messages[1]
    assert "over the wire" in done.stdout
    red, _, blue = np.asarray(Image.open(picture).convert("RGB")).astype(int).reshape(-1, 3).T
    assert np.mean(red - blue > 40) > 0.03  # the weft's sand
    assert np.mean((blue - red > 30) & (red < 50)) > 0.03  # the warp's blue


#: The first one also runs in a batch below, the last one in the tests of MPI.
ALONE = [
    pytest.param("plain_weave", "pvpython", 0.05, marks=pytest.mark.nightly),
    pytest.param("cloth_over_ranks", "pvbatch", 0.03, marks=pytest.mark.nightly),
]


def in_the_yarns_colours(picture: Path, least: float = 0.03) -> None:
    """Check the number of pixels of each colour; the script sets no colours."""
    red, _, blue = np.asarray(Image.open(picture).convert("RGB")).astype(int).reshape(-1, 3).T
    assert np.mean(red - blue > 40) > least  # the weft's sand
    assert np.mean((blue - red > 30) & (red < 50)) > least  # the warp's blue


@pytest.mark.parametrize(("name", "program", "least"), ALONE)
def test_the_pipeline_script_runs(name: str, program: str, least: float, tmp_path: Path) -> None:
    """The printed lines start ParaView with the plugin, as the script's first lines say."""
    lines = 'eval "$(python -m spacemap_vtk paraview)"; exec "$0" "$@"'
    picture = tmp_path / "cloth.png"
    done = subprocess.run(
        [*XVFB, "sh", "-c", lines, program, str(PIPELINES / f"{name}.py"), str(picture)],
        env={**SHELL, "LIBGL_ALWAYS_SOFTWARE": "1"},
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done
    assert done.stdout
    in_the_yarns_colours(picture, least)


@pytest.mark.nightly
@pytest.mark.parametrize("slow", [False, True])
def test_pipeline_scripts_in_one_batch(slow: bool, tmp_path: Path) -> None:
    names = SLOW if slow else {path.stem for path in PIPELINES.glob("*.py")} - SLOW - PARALLEL
    # The first one sets the shape of the view: one that fills its picture.
    ordered = sorted(names, key=lambda name: (name not in ("plain_weave", "film"), name))
    files = {os.path.relpath(PIPELINES / name, SCRIPTS): tmp_path / name for name in ordered}
    words = [f"{script}={file}.png" for script, file in files.items()]
    run(SCRIPTS / "session.py", tmp_path / "reported.json", *words, program="pvbatch")
    for script, text in json.loads((tmp_path / "reported.json").read_text()).items():
        assert text, script
        assert "Traceback" not in text, text
    for name in names:
        pictures = sorted(tmp_path.glob(f"{name}*.png"))
        assert len(pictures) == (12 if name == "film" else 1)
        for picture in {pictures[0], pictures[-1]}:
            in_the_yarns_colours(picture)


@pytest.mark.nightly
def test_paraviews_window_shows_fabric_and_panel(tmp_path: Path) -> None:
    picture = tmp_path / "window.png"
    done = subprocess.run(
        [*XVFB, sys.executable, str(SCRIPTS / "photograph.py"), str(picture)],
        env={**os.environ, "SPACEMAP_YARNS": "20"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    view, panel = pixels[200:800, 310:1190], pixels[560:860, :270]
    assert np.mean(view[..., 0] - view[..., 2] > 40) > 0.1  # the red yarns
    assert np.mean(panel.min(axis=2) > 250) > 0.2  # fields to write in


@pytest.mark.nightly
def test_check_reports_the_versions() -> None:
    code, report, error = check_with(os.environ["PATH"])
    assert (code, error) == (0, "")
    assert report.startswith("ParaView ")
    assert report.endswith("SceneReader work\n")


def check_with(path: str) -> tuple[int, str, str]:
    """Run ``spacemap paraview --check`` with a PATH."""
    done = subprocess.run(
        [sys.executable, "-m", "spacemap_vtk", "paraview", "--check"],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def test_check_reports_a_missing_paraview(tmp_path: Path) -> None:
    code, out, error = check_with(str(tmp_path))
    assert (code, out) == (1, "")
    assert error.startswith("spacemap: pvpython is not on the PATH. ")
    assert "apt-get install paraview python3-paraview" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("does", "says"),
    [
        # A ParaView whose Python does not start, one that only prints its error, one that silently
        # lacks what the plugin needs, and one that crashes.
        ("echo no module named site >&2; exit 3", "no module named site"),
        ("echo all work; echo vtkPlugin: not loaded >&2", "vtkPlugin: not loaded"),
        ("echo there is no Python here; exit 1", "there is no Python here"),
        ("kill -SEGV $$", "it ended with"),
        pytest.param(
            'unset PV_PLUGIN_CONFIG_FILE; exec "$REAL" "$@"',
            "ParaView has not loaded the plugin",
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_check_reports_why_the_plugin_fails(does: str, says: str, tmp_path: Path) -> None:
    program = tmp_path / "pvpython"
    program.write_text(f"#!/bin/sh\nREAL={shutil.which('pvpython')}\n{does}\n")
    program.chmod(0o755)
    code, out, error = check_with(f"{tmp_path}:{os.environ['PATH']}")
    assert (code, out) == (1, "")
    assert error.startswith(f"spacemap: {program} cannot use {environment.PLUGIN}: ")
    assert says in error
    assert "Traceback" not in error
    assert error.count("\n") == 1
