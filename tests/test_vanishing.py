"""What is to go goes, whichever way a real process is ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from spacemap_vtk.vanishing import (
    ENDING,
    clear,
    move_out,
    undisturbed,
    vanishing,
    vanishing_folder,
)

_BEGIN = """
import os, signal, sys, time
from pathlib import Path
from vtkmodules.vtkCommonCore import vtkObject
from spacemap_vtk.vanishing import vanishing_folder
def ask(caller, event):
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(1)
with vanishing_folder(Path(sys.argv[1])) as folder:
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
        *((_WAIT, [number], [128 + number]) for number in ENDING),
        # one that comes when all is done ends the process by itself
        (_WAIT, [signal.SIGTERM] * 4, [143, -signal.SIGTERM]),
        (_WAIT, [signal.SIGINT], [-signal.SIGINT]),
        (_IN_VTK, [], [143]),
        (_FAILS, [], [1]),
    ],
    ids=[*(number.name for number in ENDING), "impatient", "SIGINT", "in VTK", "error"],
)
def test_a_folder_goes_however_the_process_ends(
    program: str, signals: list[signal.Signals], status: list[int], tmp_path: Path
) -> None:
    command = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"here\n"
        for number in signals:
            process.send_signal(number)
            time.sleep(0.01)  # or they would be one
        assert process.wait(20) in status
    assert list(tmp_path.iterdir()) == []


def test_signals_are_answered_as_before_afterwards(tmp_path: Path) -> None:
    def own(*_: object) -> None: ...

    before = signal.getsignal(signal.SIGTERM)
    with vanishing_folder(tmp_path), vanishing(tmp_path / "file"):
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before
    signal.signal(signal.SIGTERM, own)
    try:
        with vanishing_folder(tmp_path), undisturbed():
            pass
        with vanishing_folder(tmp_path):
            assert signal.getsignal(signal.SIGTERM) == own  # whoever answers it goes on to
    finally:
        signal.signal(signal.SIGTERM, before)


def test_another_thread_has_its_folders_too(tmp_path: Path) -> None:
    seen = []

    def work() -> None:
        with vanishing_folder(tmp_path) as folder:
            seen.append(folder.is_dir())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [True]
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_interrupted_meanwhile() -> None:
    before, done = signal.getsignal(signal.SIGINT), []

    def work() -> None:
        with undisturbed():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGTERM)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):  # heard, but not before it is done
        work()
    assert done == [True]
    assert signal.getsignal(signal.SIGINT) == before


def test_what_a_killed_process_left_goes_and_what_a_live_one_has_stays(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _WAIT, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline().split() == [b"here"]
        (folder,) = filter(Path.is_dir, tmp_path.iterdir())
        links = [tmp_path / ".spacemap-link"] if sys.platform != "win32" else []
        for link in links:
            link.symlink_to(Path(__file__).parent)
        clear(tmp_path)
        assert len(list(folder.iterdir())) == 2000
        process.kill()
    with vanishing_folder(tmp_path) as own:
        clear(tmp_path)
        assert sorted(filter(Path.is_dir, tmp_path.iterdir())) == sorted([own, *links])
    assert list(tmp_path.iterdir()) == links


def killed_at(event: int, work: Callable[[], object]) -> bool:
    """Carry out work in a process that is killed before so many names of files are changed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which do not matter here
        child = os.fork()
    if not child:
        left = [event]

        def audit(name: str, _arguments: object) -> None:
            if name in ("os.rename", "os.link", "os.mkdir", "os.rmdir", "os.remove"):
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(audit)
        try:
            work()
        finally:
            os._exit(0)
    return bool(os.waitpid(child, 0)[1])


@unix
def test_of_several_files_killed_on_their_way_none_is_lost(tmp_path: Path) -> None:
    # At every step in turn: before one of them appears all are old, from then on all get to be new.
    old, new = [
        {f"{name}/b": age + name, f"{name}.c": age} for name, age in (("x", "old"), ("x", "new"))
    ]
    old["x/gone"] = "old"

    def there() -> dict[str, str]:
        files = [
            path for path in place.rglob("[!.]*") if path.is_file() and ".spacemap" not in str(path)
        ]
        return {str(path.relative_to(place)): path.read_text() for path in files}

    def make(files: dict[str, str], folder: Path) -> None:
        (folder / "x").mkdir(parents=True)
        for name, text in files.items():
            (folder / name).write_text(text)

    def work() -> None:
        with vanishing_folder(place) as folder:
            make(new, folder)
            move_out(folder)

    seen = []
    for event in range(40):
        place = tmp_path / str(event)
        make(old, place)
        killed = killed_at(event, work)
        now = there()
        assert now["x.c"] in ("old", "new")
        clear(place)
        seen.append(there() == new)
        assert there() in (old, new)
        assert list(place.glob(".spacemap-*")) == []
        if not killed:
            break
    assert not killed
    assert seen == sorted(seen)
    assert seen.count(True) > 5


def test_what_was_made_since_is_not_written_over(tmp_path: Path) -> None:
    left = tmp_path / ".spacemap-0"
    (left / "older").mkdir(parents=True)
    for name in ("a", "b"):
        (left / name).write_text("new")
    (tmp_path / "a").write_text("newer")
    os.utime(left / "older", (1, 1))
    clear(tmp_path)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "a": "newer",
        "b": "new",
    }


def test_what_others_still_write_goes(tmp_path: Path) -> None:
    script = "import sys, time\nend = time.time() + 0.3\nwhile time.time() < end:\n"
    script += "    try: open(sys.argv[1] + '/' + str(time.time()), 'w')\n    except OSError: pass\n"
    with vanishing_folder(tmp_path) as folder:
        writer = subprocess.Popen([sys.executable, "-S", "-c", script, str(folder)])
        while not any(folder.iterdir()):
            time.sleep(0.01)
    writer.wait()
    assert list(tmp_path.iterdir()) == []
