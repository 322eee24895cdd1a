"""What is kept for as long as someone else holds it."""

from __future__ import annotations

import weakref
from typing import Generic, TypeVar

V = TypeVar("V")


class WeakValues(Generic[V]):
    """A `weakref.WeakValueDictionary` that runs no Python when a value dies."""

    # A value may die with its stage within VTK's collector, which holds a lock of all threads.
    # There any line of Python may hand Python's own lock to a thread that then waits for VTK's, and
    # both stand for ever. So the dead are dropped when the next value comes.

    def __init__(self) -> None:
        self._kept: dict[str, weakref.ref[V]] = {}

    def get(self, key: str) -> V | None:
        """Return a value, or None where there is none any more."""
        kept = self._kept.get(key)
        return None if kept is None else kept()

    def __contains__(self, key: str) -> bool:
        return self.get(key) is not None

    def __setitem__(self, key: str, value: V) -> None:
        alive = {k: kept for k, kept in list(self._kept.items()) if kept() is not None}
        self._kept = alive | {key: weakref.ref(value)}
