"""Long work in short slices, so that the engine can compute frames between them.

The work runs in a thread of its own, but never at the same time as the engine: the engine gives it
a turn and waits until it hands the turn back, at a check of its cancel token.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from typing import TypeVar

from spacemap_vtk.cancel import CancelToken
from spacemap_vtk.ndarrays import Progress

Result = TypeVar("Result")

#: Length of a slice in s, after which the next check ends it.
_SLICE = 0.04


def in_slices(work: Callable[[Progress], Result]) -> Generator[float | None, None, Result]:
    """Do some work in slices; a generator that is closed cancels it at its next check."""
    # Yields the share that the work has reported, or None.
    token, results, failures = _SliceToken(), list[Result](), list[BaseException]()
    shares: list[float | None] = [None]

    def run() -> None:
        token.wait_for_turn()
        try:
            with token.active():
                results.append(work(shares.append))
        except BaseException as error:  # raised again in the caller's thread
            failures.append(error)
        finally:
            token.end()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        while token.give_turn():
            del shares[:-1]
            yield shares[0]
    finally:
        token.cancel()
        while token.give_turn():
            pass
        thread.join()
    if failures:
        raise failures[0]
    return results[0]


class _SliceToken(CancelToken):
    """A cancel token whose checks also end slices of the work."""

    def __init__(self) -> None:
        super().__init__()
        self._turn, self._pause = threading.Semaphore(0), threading.Semaphore(0)
        self._thread: int | None = None
        self._started = 0.0
        self._is_done = False

    def check(self) -> None:
        """End the slice if its time is over, and raise Cancelled if the work is cancelled."""
        # Threads that help with the work also check its token.
        is_own = threading.get_ident() == self._thread
        if is_own and time.perf_counter() - self._started > _SLICE:
            self._pause.release()
            self.wait_for_turn()
        super().check()

    def wait_for_turn(self) -> None:
        """Wait for the next slice; called by the thread of the work."""
        self._turn.acquire()
        self._thread = threading.get_ident()
        self._started = time.perf_counter()

    def give_turn(self) -> bool:
        """Run the work for one slice, and return whether it is unfinished."""
        if not self._is_done:
            self._turn.release()
            self._pause.acquire()
        return not self._is_done

    def end(self) -> None:
        """Report the end of the work; called by its thread."""
        self._is_done = True
        self._pause.release()
