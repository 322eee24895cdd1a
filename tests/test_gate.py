"""The gate ends what hangs, and says where it hung."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).parents[1]
HANGS = """import subprocess, sys, threading, time

def wait_for_ever():
    time.sleep(600)

def test_it(tmp_path):
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    print("child", child.pid, file=open({told!r}, "w"), flush=True)
    threading.Thread(target=wait_for_ever).start()
    child.wait()
"""


@pytest.mark.skipif(shutil.which("timeout") is None, reason="needs the command timeout")
def test_a_hanging_test_is_ended_with_its_children_and_shows_its_threads(tmp_path: Path) -> None:
    words = re.search(r"^guard=\((.*)\)$", (ROOT / ".ci" / "run").read_text(), re.M)
    assert words is not None
    guard = words.group(1).replace("25m", "10s").split()
    assert "10s" in guard
    told, script = tmp_path / "told", tmp_path / "test_hang.py"
    script.write_text(HANGS.format(told=str(told)))
    python = [sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), str(script)]
    done = subprocess.run(
        # As xvfb-run does: the guard sends its own child the signal twice.
        [*guard, "sh", "-c", '"$@"; exit $?', "sh", *python, "-p", "no:cacheprovider"],
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert done.returncode != 0
    for function in ("wait_for_ever", "test_it"):
        assert re.search(rf'test_hang.py", line \d+ in {function}', done.stderr), done.stderr
    child = int(told.read_text().split()[1])
    assert not psutil.pid_exists(child) or psutil.Process(child).status() == "zombie"


def test_a_slow_test_shows_its_threads_and_passes(tmp_path: Path) -> None:
    script = tmp_path / "test_slow.py"
    script.write_text("import time\n\ndef test_it():\n    time.sleep(2)\n")
    configured = re.search(
        r"^faulthandler_timeout = (\d+)$", (ROOT / "pyproject.toml").read_text(), re.M
    )
    assert configured is not None
    shorter = (
        (ROOT / "pyproject.toml")
        .read_text()
        .replace(configured.group(0), "faulthandler_timeout = 1")
    )
    (tmp_path / "pyproject.toml").write_text(shorter)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", str(script)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        timeout=100,
    )
    assert done.returncode == 0, done.stdout
    assert 'test_slow.py", line 4 in test_it' in done.stderr
