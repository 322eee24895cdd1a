"""Progress of long work on the command line, and how the work is ended there."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource, connect

#: A handkerchief held by its middle: some seconds of an equilibrium.
DRAPE = """
[weave]
ends = 20
picks = 20
[cage]
divisions = [50, 50, 1]
[modal]
elements = "sheet"
modes = 4
fixed = "sphere(0, 0, 0, 1.5 mm)"
gravity = [0, 0, -9.80665]
tensile_rigidity = "100 N/m"
bending_rigidity = "2e-3 uN.m"
areal_mass = "0.15 kg/m2"
"""


def test_hanging_and_modes_report_separate_progress() -> None:
    solver = ModalSolver(elements="sheet", gravity=(0, 0, -9.8), modes=5)
    reported: list[tuple[str, float]] = []
    solver.AddObserver(
        "ProgressEvent",
        lambda caller, _: reported.append((caller.GetProgressText() or "", caller.GetProgress())),
    )
    connect(WeaveSource(), TetraCage(), solver)
    before = solver.GetMTime()
    solver.update()
    assert solver.GetMTime() == before
    steps = [step for step, _ in reported]
    assert list(dict.fromkeys(steps)) == ["", "hanging", "modes"]
    assert steps == sorted(steps)  # none of them comes back
    for step in ("hanging", "modes"):
        shares = [share for text, share in reported if text == step]
        assert shares == sorted(shares)
        assert len(shares) > 2
        assert shares[-1] == 1.0
    # What does not hang has no such step.
    reported.clear()
    solver.hang = False
    assert solver.update().output.GetPointData().GetArray("equilibrium") is None
    assert {step for step, _ in reported} == {"", "modes"}


@pytest.mark.skipif(sys.platform == "win32", reason="needs a terminal that a program can read")
def test_equilibrium_reports_progress_and_can_be_interrupted(tmp_path: Path) -> None:
    import pty

    scene, picture = tmp_path / "drape.toml", tmp_path / "drape.png"
    scene.write_text(DRAPE)
    master, terminal = pty.openpty()
    command = [sys.executable, "-m", "spacemap_vtk", "render", str(scene), "-o", str(picture)]
    process = subprocess.Popen(
        command, stderr=terminal, env={**os.environ, "COLUMNS": "120", "TERM": "xterm"}
    )
    os.close(terminal)
    stated = ""
    try:
        end = time.monotonic() + 300
        while "ModalSolver hanging" not in stated:
            assert time.monotonic() < end, stated
            if select.select([master], [], [], 1.0)[0]:
                stated += os.read(master, 65536).decode(errors="replace")
        process.send_signal(signal.SIGINT)
        while True:
            try:
                stated += os.read(master, 65536).decode(errors="replace")
            except OSError:  # nobody writes there any more
                break
        assert process.wait(300) == 1
    finally:
        process.kill()
        os.close(master)
    assert stated.rstrip().endswith("spacemap: stopped")
    assert "Traceback" not in stated
    assert "modes" not in stated
    assert list(tmp_path.iterdir()) == [scene]


INTERRUPT = """
import os, signal, sys
import rich.progress
from spacemap_vtk.cli.main import main

shown = rich.progress.Progress.update

def update(self, *given, **values):
    shown(self, *given, **values)
    if "hanging" in values.get("stage", ""):
        os.kill(os.getpid(), signal.SIGINT)

rich.progress.Progress.update = update
sys.stderr.isatty = lambda: True
main()
"""


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform == "win32", reason="its Ctrl-C is another")
def test_interrupt_while_progress_is_shown_stops_like_any_other(tmp_path: Path) -> None:
    """VTK itself ends a program whose observer is interrupted, without a word of what was done."""
    scene = tmp_path / "drape.toml"
    scene.write_text(DRAPE)
    command = [sys.executable, "-c", INTERRUPT, "render", str(scene), "-o", str(tmp_path / "a.png")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert done.stderr.rstrip().endswith("spacemap: stopped")
