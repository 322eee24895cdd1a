"""Temporary files and folders, removed however the program ends: by an error, Ctrl-C or a signal.

Python handles a signal only between two of its instructions, not while VTK or ffmpeg works. So do
long work inside a library before there is anything to remove.

A killed process leaves its folders. The next process that makes such a folder in the same place
removes them: a lock shows which folders are in use.
"""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NoReturn

if sys.platform == "win32":
    import _winapi
else:
    import fcntl

#: Signals that ask a program to end. A terminal that is closed sends SIGHUP.
END_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
#: Longest time for removing a file or folder [s].
_PATIENCE = 10.0
#: Prefix of the names of hidden folders.
_PREFIX = ".spacemap-"


@contextmanager
def temporary_path(path: Path) -> Iterator[Path]:
    """Remove a file or folder when the block ends, however it ends."""
    # Until then SIGTERM and SIGHUP, if nothing else handles them, raise ``SystemExit`` with the
    # status that a shell would give: 128 plus the signal's number. atexit is needed, too: if Python
    # code that VTK calls is interrupted, VTK exits and no "finally" block runs.
    last = partial(_remove, path)
    atexit.register(last)
    with raise_on_signals():
        try:
            yield path
        finally:
            with delay_signals():
                _remove(path)
                atexit.unregister(last)


def hidden_path(parent: Path) -> Path:
    """Return an unused path for a hidden file or folder in a folder."""
    return parent / f"{_PREFIX}{os.urandom(6).hex()}"


@contextmanager
def temporary_folder(parent: Path | None = None, clean: bool = True) -> Iterator[Path]:
    """Yield a new folder that is removed with its contents when the block ends, however it ends."""
    parent = Path(tempfile.gettempdir()) if parent is None else parent
    if clean:
        remove_abandoned(parent)
    # The lock is released only after the folder has been removed.
    with ExitStack() as held, temporary_path(hidden_path(parent)) as folder:
        lock_folder(folder, held)
        yield folder


def lock_folder(folder: Path, held: ExitStack) -> None:
    """Make a folder and lock it until `held` is closed or this process ends."""
    while True:
        folder.mkdir(mode=0o700, exist_ok=True)
        try:
            if try_lock(folder, held):
                return
        except (BlockingIOError, FileNotFoundError):
            pass  # another process has just removed it, because it was not locked yet
        except OSError:
            return  # a disk without locks; no process clears folders there


if sys.platform == "win32":

    def try_lock(folder: Path, held: ExitStack) -> bool:
        """Lock a folder, unless another process has; return whether it still exists."""
        # The lock is a file next to the folder that no other process can open. Windows deletes it
        # when it is closed, at the latest when this process ends. An open handle on the folder
        # would prevent moving and removing it.
        delete, to_others, make, hidden_and_going = 0x00010000, 0, 4, 0x04000002
        name = f"{folder}.held"
        try:
            handle = _winapi.CreateFile(name, delete, to_others, 0, make, hidden_and_going, 0)
        except OSError as error:
            # Error 32, sharing violation: another process has it open.
            if error.winerror == 32:
                raise BlockingIOError from error
            raise
        held.callback(_winapi.CloseHandle, handle)
        return folder.is_dir()

else:

    def try_lock(folder: Path, held: ExitStack) -> bool:
        """Lock a folder, unless another process has; return whether it still exists."""
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        with ExitStack() as closed:
            closed.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            held.push(closed.pop_all())
        return os.path.samestat(os.fstat(handle), folder.stat())


def remove_abandoned(parent: Path) -> None:
    """Remove the folders that killed processes have left."""
    with suppress(OSError):
        for name in os.listdir(parent):
            with suppress(OSError), ExitStack() as held:
                if not name.startswith(_PREFIX):
                    continue
                folder = parent / name
                known = folder.lstat()
                # In a shared folder another user may use such a name: leave those folders alone.
                own = sys.platform == "win32" or known.st_uid == os.getuid()
                if own and stat.S_ISDIR(known.st_mode):
                    try_lock(folder, held)
                    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def delay_signals() -> Iterator[None]:
    """Delay signals while a short block runs, and deliver the first of them afterwards."""
    handlers, received = {}, []
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, *END_SIGNALS):
            # Only a handler that Python has set can be restored.
            if signal.getsignal(number) is not None:
                handlers[number] = signal.signal(number, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in received[:1]:
            signal.raise_signal(number)


@contextmanager
def raise_on_signals() -> Iterator[None]:
    """Let the signals that end the program raise SystemExit during the block."""
    handled = []
    if threading.current_thread() is threading.main_thread():
        handled = [each for each in END_SIGNALS if signal.getsignal(each) == signal.SIG_DFL]
    for number in handled:
        signal.signal(number, _raise_exit)
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_DFL)


def _raise_exit(number: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


def _remove(path: Path) -> None:
    end = time.monotonic() + _PATIENCE
    while True:
        shutil.rmtree(path, ignore_errors=True)
        with suppress(OSError):
            path.unlink()
        if not os.path.lexists(path) or time.monotonic() > end:
            return
        time.sleep(0.05)  # a process that was told to end may still write into it
