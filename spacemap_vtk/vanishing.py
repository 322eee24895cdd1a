"""Files and folders that go, however the program is ended: by an error, Ctrl-C or a signal.

A signal is answered by Python in between two of its instructions, not while VTK or ffmpeg works:
so what takes long inside a library should be done before there is anything to be removed.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NoReturn

#: By which a program is asked to end; SIGHUP by a terminal that is closed.
ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
#: Seconds in which what goes must have gone.
_PATIENCE = 10.0


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


@contextmanager
def vanishing_folder(place: Path) -> Iterator[Path]:
    """Yield a new folder that goes, with all in it, when the block ends, however it ends."""
    with vanishing(place / f".spacemap-{os.urandom(6).hex()}") as folder:
        folder.mkdir(mode=0o700)
        yield folder


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let no signal cut off what takes a moment; those that come meanwhile are lost."""
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, *ENDING):
            if signal.getsignal(number) is not None:  # set by Python, which can set it again
                handlers[number] = signal.signal(number, signal.SIG_IGN)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


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
        with contextlib.suppress(OSError):
            path.unlink()
        if not os.path.lexists(path) or time.monotonic() > end:
            return
        time.sleep(0.05)  # a process that has been ended may write into it until it is
