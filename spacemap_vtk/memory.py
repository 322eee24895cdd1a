"""Sizes, estimated before memory is taken, and memory that is used again once nobody holds it.

A time step that writes its result into fresh memory pays for it twice: the operating system must
clear every page first. For 90 MB that is 5 ms, a quarter of the whole step.
"""

from __future__ import annotations

import os
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from spacemap_vtk.errors import SizeError

#: What takes less [bytes] is not refused: a machine that lacks it runs no program at all, and to
#: ask takes 1 ms beside another thread, a tenth of a frame while a slider is dragged.
SMALL = 2**24
#: Bytes of a line of the processor's cache, and of its widest vectors.
_LINE = 64
#: Results of so many bytes do not stay in a cache until somebody reads them.
_STREAMED = 2**25

#: Names of a control group's files, of version 2 and of version 1: the limit, what is used, and in
#: memory.stat what of that is of files, which the kernel takes back first.
_GROUP_FILES = (
    ("memory.max", "memory.current", ("inactive_file", "active_file")),
    (
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        ("total_inactive_file", "total_active_file"),
    ),
)


def available() -> int | None:
    """Return how much memory can still be taken."""
    free = _left_in_machine(), left_in_group(), _left_in_process()
    return min((left for left in free if left is not None), default=None)


def _left_in_process() -> int | None:
    """Return what "ulimit -v" leaves to this process; None without a limit."""
    try:
        import resource  # not on Windows

        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (ImportError, OSError, ValueError):
        return None
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if most == resource.RLIM_INFINITY else max(most - used, 0)


def _left_in_machine() -> int | None:
    try:
        for row in Path("/proc/meminfo").read_text().splitlines():
            if row.startswith("MemAvailable:"):  # as psutil says, which takes long to import
                return 1024 * int(row.split()[1])
    except OSError:
        pass
    try:
        import psutil  # not in ParaView's own Python
    except ImportError:
        try:
            return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        except (AttributeError, OSError, ValueError):
            return None
    return int(psutil.virtual_memory().available)


def left_in_group(
    processes: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")
) -> int | None:
    """Return what the limits of the control groups that this process is in leave to it."""
    # Who passes such a limit is killed, without a word: a machine's free memory does not tell.
    try:
        lines = processes.read_text().splitlines()
    except OSError:
        return None
    left: list[int] = []
    for line in lines:
        _, controllers, name = line.split(":", 2)
        if controllers in ("", "memory"):
            mount = root / controllers
            group = mount / name.lstrip("/")
            # A container may see its own group as the root, and yet be told the host's name of it.
            for folder in (group, *group.parents):
                left += _left_in(folder)
                if folder == mount:
                    break
    return min(left, default=None)


def _left_in(folder: Path) -> Iterator[int]:
    for limit, usage, reclaimable in _GROUP_FILES:
        try:
            most, used = int((folder / limit).read_text()), int((folder / usage).read_text())
            rows = (row.split() for row in (folder / "memory.stat").read_text().splitlines())
            files = sum(int(row[1]) for row in rows if row[0] in reclaimable)
        except (OSError, ValueError):  # not this version; or "max", which is none
            continue
        yield max(most - used + files, 0)


def fits(size: int) -> bool:
    """Return whether so many bytes can be taken."""
    free = available() if size > SMALL else None
    return free is None or size <= free


def require(
    size: int,
    what: str,
    *,
    key: str | None = None,
    value: object = None,
    cure: str | Callable[[int], str] | None = None,
) -> None:
    """Refuse what would not fit into memory."""
    free = available() if size > SMALL else None
    if free is not None and size > free:
        raise SizeError(
            f"{what} would need about {size / 2**30:.3g} GiB of memory",
            key=key,
            value=value,
            allowed=f"up to the {free / 2**30:.3g} GiB now free",
            cure=cure(free) if callable(cure) else cure,
        )


def is_streamed(*arrays: NDArray[Any]) -> bool:
    """Return whether compiled loops write some results past the cache: large, aligned ones."""
    large = sum(array.nbytes for array in arrays) >= _STREAMED
    return large and all(array.ctypes.data % _LINE == 0 for array in arrays)


def aligned(count: int, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Return an uninitialised array that begins at a border of 64 bytes: a line of the cache."""
    kind = np.dtype(dtype)
    memory = np.empty(count * kind.itemsize + _LINE, np.uint8)
    begin = -memory.__array_interface__["data"][0] % _LINE
    return memory[begin : begin + count * kind.itemsize].view(kind)


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
        self.free: list[memoryview] = []
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
        owner = np.frombuffer(memory, kind)
        watch = weakref.ref(owner, self._left.append)
        self._lent[id(watch)] = watch, memory
        return owner.reshape(shape)

    def _take(self, size: int) -> memoryview:
        self._collect()
        try:
            while (block := self.free.pop()).nbytes != size:
                pass  # blocks of another size will hardly be asked for again
        except IndexError:
            # np.empty asks for huge pages where the system grants them; bytearray would clear it
            return aligned(size, np.uint8).data
        return block

    def _collect(self) -> None:
        """Take back what nobody holds any more."""
        while self._left:
            try:
                watch = self._left.popleft()
            except IndexError:  # another thread was quicker
                return
            block = self._lent.pop(id(watch))[1]
            if len(self.free) < self._keep:
                self.free.append(block)
