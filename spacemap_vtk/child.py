"""Another process that is waited for, and that goes when whoever waits is stopped."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

#: Seconds between looks: in between them the waiting thread can be stopped.
_LOOK = 0.05


def run_child(command: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a program to its end."""
    # ``subprocess.run`` waits inside one call of the system's, where no exception that another
    # thread raises in this one arrives.
    # Files, not pipes: a pipe that nobody reads stops the program when it is full.
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as told:
        process = subprocess.Popen(command, cwd=folder, stdout=out, stderr=told)
        try:
            while process.poll() is None:
                time.sleep(_LOOK)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        texts = []
        for file in (out, told):
            file.seek(0)
            texts.append(file.read().decode(errors="replace"))
        return subprocess.CompletedProcess(command, process.returncode, *texts)
