"""What is to go goes, whichever way a real process is ended."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from spacemap_vtk.temporary_files import (
    END_SIGNALS,
    delay_signals,
    remove_abandoned,
    temporary_folder,
    temporary_path,
)

_BEGIN = """
import os, signal, sys, time
from pathlib import Path
from vtkmodules.vtkCommonCore import vtkObject
from spacemap_vtk.temporary_files import temporary_folder
def ask(caller, event):
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(1)
with temporary_folder(Path(sys.argv[1])) as folder:
    for number in range(2000):
        (folder / f"{number}").touch()
    print("here", flush=True)
"""
#: Not in one go: Python 3.14 does not look for a signal between the print and a call that follows.
_WAIT = _BEGIN + "    for _ in range(600): time.sleep(0.1)"
#: VTK prints what Python code raises that it calls, and exits at once where that is an exit.
_IN_VTK = _BEGIN + "    thing = vtkObject(); thing.AddObserver('UserEvent', ask)\n"
_IN_VTK += "    thing.InvokeEvent('UserEvent')\n    time.sleep(60)"
_FAILS = _BEGIN + "    raise RuntimeError"

unix = pytest.mark.skipif(sys.platform == "win32", reason="no process there hears a signal")


@unix
@pytest.mark.parametrize(
    ("program", "signals", "status"),
    [
        *(
            pytest.param(
                *(_WAIT, [number], [128 + number]),
                marks=() if number == signal.SIGTERM else pytest.mark.nightly,
            )
            for number in END_SIGNALS
        ),
        # one that comes when all is done ends the process by itself
        pytest.param(
            _WAIT, [signal.SIGTERM] * 4, [143, -signal.SIGTERM], marks=pytest.mark.nightly
        ),
        pytest.param(_WAIT, [signal.SIGINT], [-signal.SIGINT], marks=pytest.mark.nightly),
        pytest.param(_IN_VTK, [], [143], marks=pytest.mark.nightly),
        pytest.param(_FAILS, [], [1], marks=pytest.mark.nightly),
    ],
    ids=[*(number.name for number in END_SIGNALS), "impatient", "SIGINT", "in VTK", "error"],
)
def test_folder_is_removed_however_the_process_ends(
    program: str, signals: list[signal.Signals], status: list[int], tmp_path: Path
) -> None:
    command = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"here\n"
        for number in signals:
            process.send_signal(number)
            time.sleep(0.01)  # or they would be one
        assert process.wait(300) in status
    assert list(tmp_path.iterdir()) == []


def test_signal_handlers_are_restored(tmp_path: Path) -> None:
    def own(*_: object) -> None: ...

    before = signal.getsignal(signal.SIGTERM)
    with temporary_folder(tmp_path), temporary_path(tmp_path / "file"):
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before
    signal.signal(signal.SIGTERM, own)
    try:
        with temporary_folder(tmp_path), delay_signals():
            pass
        with temporary_folder(tmp_path):
            assert signal.getsignal(signal.SIGTERM) == own  # whoever answers it goes on to
    finally:
        signal.signal(signal.SIGTERM, before)


def test_other_threads_can_have_temporary_folders(tmp_path: Path) -> None:
    seen = []

    def work() -> None:
        with temporary_folder(tmp_path) as folder:
            seen.append(folder.is_dir())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [True]
    assert list(tmp_path.iterdir()) == []


def test_signals_are_delayed() -> None:
    before, done = signal.getsignal(signal.SIGINT), []

    def work() -> None:
        with delay_signals():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGTERM)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):  # heard, but not before it is done
        work()
    assert done == [True]
    assert signal.getsignal(signal.SIGINT) == before


def test_only_folders_of_ended_processes_are_removed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _WAIT, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline().split() == [b"here"]
        (folder,) = filter(Path.is_dir, tmp_path.iterdir())
        links = [tmp_path / ".spacemap-link"] if sys.platform != "win32" else []
        for link in links:
            link.symlink_to(Path(__file__).parent)
        remove_abandoned(tmp_path)
        assert len(list(folder.iterdir())) == 2000
        process.kill()
    with temporary_folder(tmp_path) as own:
        remove_abandoned(tmp_path)
        assert sorted(filter(Path.is_dir, tmp_path.iterdir())) == sorted([own, *links])
    assert list(tmp_path.iterdir()) == links


def test_folder_is_removed_while_others_write_into_it(tmp_path: Path) -> None:
    script = "import sys, time\nend = time.time() + 0.3\nwhile time.time() < end:\n"
    script += "    try: open(sys.argv[1] + '/' + str(time.time()), 'w')\n    except OSError: pass\n"
    with temporary_folder(tmp_path) as folder:
        writer = subprocess.Popen([sys.executable, "-S", "-c", script, str(folder)])
        while not any(folder.iterdir()):
            time.sleep(0.01)
    writer.wait()
    assert list(tmp_path.iterdir()) == []
