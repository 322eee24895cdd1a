"""Output memory that is used again once nobody holds it.

A time step that writes its result into fresh memory pays for it twice: the operating system must
clear every page first. For 90 MB that is 5 ms, a quarter of the whole step.
"""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Recycler:
    """Uninitialised arrays from memory that earlier ones have left."""

    # It is safe to keep a returned array, or any view of it, for ever: memory comes back only when
    # the last of them has died. This works because every view of an array keeps a reference to the
    # array that owns the memory, or, as here, to the outermost one over a foreign buffer: NumPy
    # shortens the chain of bases only through arrays. That outermost array is watched by a weak
    # reference, the pool never holds it, and reference counts are never looked at.
    # What happens when it dies is one call into C. An array may die within VTK's collector, which
    # holds a lock of all threads: any line of Python may hand Python's own lock to a thread that
    # then waits for VTK's, and both stand for ever.

    def __init__(self, keep: int = 2) -> None:
        self._keep = keep
        self._free: list[memoryview] = []
        #: What is in use, by the identity of the reference that watches it.
        self._lent: dict[int, tuple[weakref.ref[NDArray[Any]], memoryview]] = {}
        #: The references whose arrays have died.
        self._left: deque[weakref.ref[NDArray[Any]]] = deque()

    def empty(self, shape: Sequence[int], dtype: DTypeLike) -> NDArray[Any]:
        """Return an uninitialised, C-contiguous array."""
        kind = np.dtype(dtype)
        size = prod(shape) * kind.itemsize
        if not size:
            return np.empty(tuple(shape), kind)
        memory = self._take(size)
        owner = np.frombuffer(memory, dtype=np.uint8)
        watch = weakref.ref(owner, self._left.append)
        self._lent[id(watch)] = watch, memory
        return owner.view(kind).reshape(tuple(shape))

    def _take(self, size: int) -> memoryview:
        self._collect()
        # blocks of another size will hardly be asked for again
        self._free = [block for block in self._free if block.nbytes == size][: self._keep]
        try:
            return self._free.pop()
        except IndexError:  # another thread may just have taken the last
            # np.empty asks for huge pages where the system grants them; bytearray would clear it
            return np.empty(size, np.uint8).data

    def _collect(self) -> None:
        """Take back what nobody holds any more."""
        while self._left:
            try:
                watch = self._left.popleft()
            except IndexError:  # another thread was quicker
                return
            self._free.append(self._lent.pop(id(watch))[1])
