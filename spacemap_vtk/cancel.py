"""Stopping long work from another thread.

Whoever starts the work makes a `CancelToken` and runs the work while that is active. The work
calls `check` between two blocks, and stops there once the token is cancelled. A single call into a
library is waited for.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from spacemap_vtk.errors import SpacemapError


class Cancelled(SpacemapError, RuntimeError):
    """The work was stopped before its end."""


class CancelToken:
    """Tells one run whether it is to stop; cancelled once, it stays so."""

    def __init__(self) -> None:
        self.cancelled = False

    def cancel(self) -> None:
        """Stop the work at its next check; called from any thread."""
        self.cancelled = True

    def check(self) -> None:
        """Raise Cancelled if the work is to stop."""
        if self.cancelled:
            raise Cancelled("the run was stopped")

    @contextmanager
    def active(self) -> Iterator[None]:
        """Make `check` look at this token, in this thread, until the block ends."""
        before = _active.set(self)
        try:
            yield
        finally:
            _active.reset(before)


#: In force where nobody can stop the work.
_NEVER = CancelToken()
_active: ContextVar[CancelToken] = ContextVar("cancel_token", default=_NEVER)


def active_token() -> CancelToken:
    """Return the token of this thread's work, to be handed to threads that share it."""
    return _active.get()


def check() -> None:
    """Raise Cancelled if this thread's work is to stop; called between blocks of long work."""
    _active.get().check()
