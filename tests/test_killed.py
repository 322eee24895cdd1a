"""Commands killed at random moments, and two writing one output; see killed.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(("2", "21", "a.vtu"), marks=pytest.mark.nightly),
        pytest.param(("300", "21"), marks=pytest.mark.nightly),
        pytest.param(("both",), marks=pytest.mark.nightly),
    ],
    ids=["some killed", "many killed", "two at once"],
)
def test_killed_processes_lose_no_file(words: tuple[str, ...]) -> None:
    pytest.importorskip("pxr")
    command = [sys.executable, str(Path(__file__).with_name("killed.py")), *words]
    done = subprocess.run(command, capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
