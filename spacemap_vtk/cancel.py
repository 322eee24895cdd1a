"""Cancel long work from another thread.

The caller makes a `CancelToken` and runs the work while the token is active. The work calls `check`
between blocks and stops there once the token is cancelled. A single call into a library is not
interrupted.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from spacemap_vtk.errors import SpacemapError


class Cancelled(SpacemapError, RuntimeError):
    """The work was cancelled before it finished."""


class CancelToken:
    """Request to stop one run. It cannot be withdrawn."""

    def __init__(self) -> None:
        self.cancelled = False

    def cancel(self) -> None:
        """Stop the work at its next check. Any thread may call this."""
        self.cancelled = True

    def check(self) -> None:
        """Raise Cancelled if the token is cancelled."""
        if self.cancelled:
            raise Cancelled("the run was cancelled")

    @contextmanager
    def active(self) -> Iterator[None]:
        """Make this token the one that `check` tests in this thread, until the block ends."""
        before = _active.set(self)
        try:
            yield
        finally:
            _active.reset(before)


#: Default token, for work that nobody can cancel.
_NEVER = CancelToken()
_active: ContextVar[CancelToken] = ContextVar("cancel_token", default=_NEVER)


def active_token() -> CancelToken:
    """Return this thread's token, to pass it to threads that share the work."""
    return _active.get()


def check() -> None:
    """Raise Cancelled if this thread's work is to stop. Long work calls this between blocks."""
    _active.get().check()
