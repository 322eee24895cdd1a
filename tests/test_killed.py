"""Commands killed at random moments, and two at one output: see killed.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.nightly
@pytest.mark.parametrize("words", [("300", "21"), ("both",)], ids=["killed", "two at once"])
def test_nothing_is_lost(words: tuple[str, ...]) -> None:
    pytest.importorskip("pxr")
    command = [sys.executable, str(Path(__file__).with_name("killed.py")), *words]
    done = subprocess.run(command, capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
