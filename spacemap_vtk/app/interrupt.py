"""Ending a run in another thread that does not look up by itself.

A stage looks up whenever it reports progress. One that does not is ended where it stands, between
two steps of Python; only a single call into a library, such as the factorisation of one matrix, is
waited for, an import, as a module that was half imported could not be imported again, and Numba's
compiler, as one that was ended while it waits for its lock would hold it for ever, and a new thread
until it runs. What such a stage has kept is whole all the same: stages keep results by one
assignment at their end.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import TypeVar

from spacemap_vtk.filters.algorithm import Cancelled

T = TypeVar("T")

#: Seconds that a stage has for ending by itself, and between one blow and the next: a blow that
#: falls into one of VTK's callbacks is printed there, and lost.
GRACE = 0.3

#: Part of the names of Numba's own files.
_COMPILER = f"{os.sep}numba{os.sep}"


class Interrupted(Cancelled):
    """A run was ended where it stood."""

    def __init__(self) -> None:
        super().__init__("the run was stopped")


class Interrupt:
    """Lets one thread work, and others end that work."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread: int | None = None
        self._run = 0

    def guard(self, work: Callable[[], T]) -> T:
        """Do some work that can be ended."""
        try:
            try:
                with self._lock:
                    self._run += 1
                    self._thread = threading.get_ident()
                return work()
            finally:
                self._close()
        finally:
            # A blow just before the first call would leave the door open for the next.
            self._close()

    def end(self) -> None:
        """End the work that goes on now, if any does; returns at once."""
        with self._lock:
            run, going = self._run, self._thread is not None
        if going:
            threading.Thread(target=self._insist, args=(run,), daemon=True).start()

    def _insist(self, run: int) -> None:
        while True:
            time.sleep(GRACE)
            with self._lock:
                if self._thread is None or self._run != run:
                    return
                if not _spared(self._thread):
                    _set(self._thread, Interrupted)

    def _close(self) -> None:
        # A blow may fall while this very method runs: then it begins again.
        while True:
            try:
                with self._lock:
                    thread, self._thread = self._thread, None
                    if thread is not None:
                        _set(thread, None)
                return
            except Interrupted:
                continue


def _spared(thread: int) -> bool:
    """Return whether a thread imports, compiles or starts another: it must not be ended there."""
    frame = sys._current_frames().get(thread)
    while frame is not None:
        file = frame.f_code.co_filename
        if file.startswith("<frozen importlib") or _COMPILER in file:
            return True
        # Until it runs, a new thread has the number of who starts it, and would get the blow; then
        # whoever waits for it would wait for ever.
        if file == threading.__file__ and frame.f_code.co_name == "start":
            return True
        frame = frame.f_back
    return False


def _set(thread: int, error: type[BaseException] | None) -> None:
    raised = None if error is None else ctypes.py_object(error)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), raised)
