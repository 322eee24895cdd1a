"""Files and folders that go, however the program is ended: by an error, Ctrl-C or a signal.

A signal is answered by Python in between two of its instructions, not while VTK or ffmpeg works:
so what takes long inside a library should be done before there is anything to be removed.

A process that is killed leaves its folders. The next one that makes such a folder there removes
them: the system tells which of them nobody holds any more.
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

#: By which a program is asked to end; SIGHUP by a terminal that is closed.
ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
#: Seconds in which what goes must have gone.
_PATIENCE = 10.0
#: With which hidden folders begin.
_NAME = ".spacemap-"


@contextmanager
def vanishing(path: Path) -> Iterator[Path]:
    """Remove a file or folder when the block ends, however it ends."""
    # Meanwhile SIGTERM and SIGHUP, where nobody else answers them, end the program by
    # ``SystemExit`` with the status that a shell gives it, 128 and the signal's number.
    # Where Python code that VTK calls is interrupted, VTK exits: no "finally" is reached then.
    last = partial(_remove, path)
    atexit.register(last)
    with ended_by_exceptions():
        try:
            yield path
        finally:
            with undisturbed():
                _remove(path)
                atexit.unregister(last)


def hidden(place: Path) -> Path:
    """Return a name in a folder that nobody has."""
    return place / f"{_NAME}{os.urandom(6).hex()}"


@contextmanager
def vanishing_folder(place: Path | None = None, look: bool = True) -> Iterator[Path]:
    """Yield a new folder that goes, with all in it, when the block ends, however it ends."""
    place = Path(tempfile.gettempdir()) if place is None else place
    if look:
        clear(place)
    # held until it has gone
    with ExitStack() as held, vanishing(hidden(place)) as folder:
        hold(folder, held)
        yield folder


def hold(folder: Path, held: ExitStack) -> None:
    """Make a folder that is in use for as long as this process lives, or until it is let go."""
    while True:
        folder.mkdir(mode=0o700, exist_ok=True)
        try:
            if taken(folder, held):
                return
        except (BlockingIOError, FileNotFoundError):
            pass  # another has just taken it for a dead one's
        except OSError:
            return  # a disk that knows no locks: there nobody clears anything


if sys.platform == "win32":

    def taken(folder: Path, held: ExitStack) -> bool:
        """Lock a folder, unless another process has; return whether it is there still."""
        # By a file beside it, open to nobody else, that goes when it is closed, at the latest as
        # this process ends: a folder that is open itself can be neither moved nor removed.
        delete, to_others, make, hidden_and_going = 0x00010000, 0, 4, 0x04000002
        name = f"{folder}.held"
        try:
            handle = _winapi.CreateFile(name, delete, to_others, 0, make, hidden_and_going, 0)
        except OSError as error:
            if error.winerror == 32:  # another has it open
                raise BlockingIOError from error
            raise
        held.callback(_winapi.CloseHandle, handle)
        return folder.is_dir()

else:

    def taken(folder: Path, held: ExitStack) -> bool:
        """Lock a folder, unless another process has; return whether it is there still."""
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        with ExitStack() as closed:
            closed.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            held.push(closed.pop_all())
        return os.path.samestat(os.fstat(handle), folder.stat())


def clear(place: Path) -> None:
    """Remove the folders of processes that were killed."""
    with suppress(OSError):
        for name in os.listdir(place):
            with suppress(OSError), ExitStack() as held:
                if not name.startswith(_NAME):
                    continue
                folder = place / name
                known = folder.lstat()
                # Another user could let files appear here in this one's name.
                own = sys.platform == "win32" or known.st_uid == os.getuid()
                if own and stat.S_ISDIR(known.st_mode):
                    taken(folder, held)
                    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let no signal cut off what takes a moment; one that comes meanwhile is heard afterwards."""
    handlers, heard = {}, []
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, *ENDING):
            if signal.getsignal(number) is not None:  # set by Python, which can set it again
                handlers[number] = signal.signal(number, lambda number, _: heard.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in heard[:1]:
            signal.raise_signal(number)


@contextmanager
def ended_by_exceptions() -> Iterator[None]:
    """Let a signal that ends the program do so by an exception."""
    answered = []
    if threading.current_thread() is threading.main_thread():
        answered = [each for each in ENDING if signal.getsignal(each) == signal.SIG_DFL]
    for number in answered:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in answered:
            signal.signal(number, signal.SIG_DFL)


def _end(number: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


def _remove(path: Path) -> None:
    end = time.monotonic() + _PATIENCE
    while True:
        shutil.rmtree(path, ignore_errors=True)
        with suppress(OSError):
            path.unlink()
        if not os.path.lexists(path) or time.monotonic() > end:
            return
        time.sleep(0.05)  # a process that has been ended may write into it until it is
