"""Commands under a memory limit such as "ulimit -v": an abort in VTK's C++ code is reported."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

resource = pytest.importorskip("resource")

_LIMITED = """
import resource, sys, os, signal, time
resource.setrlimit(resource.RLIMIT_AS, (2**30, resource.getrlimit(resource.RLIMIT_AS)[1]))
from spacemap_vtk.cli.main import survive_memory_limit
from spacemap_vtk.memory import available_bytes
survive_memory_limit()
"""
_ARRAY = (
    "from vtkmodules.vtkCommonCore import vtkUnsignedCharArray as A; A().SetNumberOfTuples(2**32)"
)


def limited(code: str) -> subprocess.Popen[str]:
    words = [sys.executable, "-c", _LIMITED + code]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_an_abort_of_vtk_is_reported_as_lack_of_memory() -> None:
    process = limited(_ARRAY)
    _, printed = process.communicate()
    assert process.returncode == 1
    assert printed.splitlines()[-1] == (
        "spacemap: out of memory: this shell limits a process to 1 GiB (ended by SIGABRT). "
        'Raise the limit with "ulimit -v unlimited".'
    )


def test_other_exit_codes_are_passed_on() -> None:
    process = limited("print(available_bytes() <= 2**30); sys.exit(2)")
    assert process.communicate() == ("True\n", "")
    assert process.returncode == 2


def test_a_signal_is_passed_on_to_the_command() -> None:
    process = limited("print('begun', flush=True); time.sleep(60)")
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == -signal.SIGTERM


def test_without_a_memory_limit_no_process_is_forked() -> None:
    code = """
import os
from spacemap_vtk.cli.main import survive_memory_limit

before = os.getpid()
survive_memory_limit()
assert os.getpid() == before
"""
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == 0
