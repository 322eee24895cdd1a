"""Processes that share work: each task is answered, whatever becomes of a process."""

from __future__ import annotations

import os
import signal
import sys
import time

import pytest

from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.workers import import_function, run_in_processes

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no signal kills there")


def answer(task: str) -> tuple[str, int]:
    print("what a library prints")
    if task == "refused":
        raise InputError("out of range", key="ends", value=-1, cure="Take more.")
    if task == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if task == "slow":
        time.sleep(60)
    return task, os.getpid()


def test_every_task_has_a_result_and_processes_are_reused() -> None:
    tasks = ["a", "refused", "killed", "b", "c"]
    found = dict(run_in_processes(f"{__name__}:answer", tasks, 1))
    assert str(found[1]) == "ends = -1: out of range. Take more."
    assert isinstance(found[1], InputError)
    assert "signal SIGKILL, possibly out of memory" in str(found[2])
    assert isinstance(found[2], SpacemapError)
    assert [found[k][0] for k in (0, 3, 4)] == ["a", "b", "c"]
    # One process until it is killed, and one from then on.
    assert found[0][1] != found[3][1] == found[4][1]


def test_leaving_the_loop_early_ends_all_processes() -> None:
    assert import_function("os.path:basename")("a/b") == "b"
    found = run_in_processes(f"{__name__}:answer", ["a", "slow", "slow"], 2)
    _, (task, process) = next(found)
    assert task == "a"
    found.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
