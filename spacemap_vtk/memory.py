"""Estimate sizes before memory is allocated, and reuse memory that nothing refers to any more.

Reuse saves time: the operating system clears each page of new memory before the program may
write to it. For 90 MB that takes 5 ms, a quarter of a time step.
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

#: Smaller requests [bytes] are never refused. A machine without this much memory runs no program
#: at all, and asking takes 1 ms while another thread works: a tenth of a frame during a drag.
NEVER_REFUSED = 2**24
#: Bytes of a cache line, which is also the width of the widest vector registers.
_LINE = 64
#: Results of this many bytes leave the cache before they are read again.
_STREAMED = 2**25

#: Names of a control group's files, of version 2 and of version 1: the limit, the usage, and the
#: rows of memory.stat that count cached files, which the kernel reclaims first.
_GROUP_FILES = (
    ("memory.max", "memory.current", ("inactive_file", "active_file")),
    (
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        ("total_inactive_file", "total_active_file"),
    ),
)


def available_bytes() -> int | None:
    """Return the bytes that can still be allocated; None if unknown."""
    free = _available_in_machine(), available_in_cgroups(), _available_in_process()
    return min((left for left in free if left is not None), default=None)


def _available_in_process() -> int | None:
    """Return the bytes that "ulimit -v" leaves to this process; None without a limit."""
    try:
        import resource  # not on Windows

        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (ImportError, OSError, ValueError):
        return None
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if most == resource.RLIM_INFINITY else max(most - used, 0)


def _available_in_machine() -> int | None:
    try:
        for row in Path("/proc/meminfo").read_text().splitlines():
            # The same figure as psutil's, which takes long to import.
            if row.startswith("MemAvailable:"):
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


def available_in_cgroups(
    processes: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")
) -> int | None:
    """Return the bytes that this process's control groups leave to it; None without a limit."""
    # A process that exceeds such a limit is killed without a message, although the machine may
    # have free memory.
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
            # A container may see its control group as the root, but under the host's name for it.
            for folder in (group, *group.parents):
                left += _available_in_cgroup(folder)
                if folder == mount:
                    break
    return min(left, default=None)


def _available_in_cgroup(folder: Path) -> Iterator[int]:
    for limit, usage, reclaimable in _GROUP_FILES:
        try:
            most, used = int((folder / limit).read_text()), int((folder / usage).read_text())
            rows = (row.split() for row in (folder / "memory.stat").read_text().splitlines())
            files = sum(int(row[1]) for row in rows if row[0] in reclaimable)
        except (OSError, ValueError):  # files of the other version, or "max", which means no limit
            continue
        yield max(most - used + files, 0)


def fits_in_memory(size: int) -> bool:
    """Return whether this many bytes can be allocated."""
    free = available_bytes() if size > NEVER_REFUSED else None
    return free is None or size <= free


def require_memory(
    size: int,
    what: str,
    *,
    key: str | None = None,
    value: object = None,
    cure: str | Callable[[int], str] | None = None,
) -> None:
    """Raise SizeError if a request would not fit into memory."""
    free = available_bytes() if size > NEVER_REFUSED else None
    if free is not None and size > free:
        raise SizeError(
            f"{what} would need about {size / 2**30:.3g} GiB of memory",
            key=key,
            value=value,
            allowed=f"up to the {free / 2**30:.3g} GiB now free",
            cure=cure(free) if callable(cure) else cure,
        )


def is_streamed(*arrays: NDArray[Any]) -> bool:
    """Return whether compiled loops write results past the cache: large and aligned arrays."""
    large = sum(array.nbytes for array in arrays) >= _STREAMED
    return large and all(array.ctypes.data % _LINE == 0 for array in arrays)


def allocate_aligned(count: int, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Allocate an uninitialised array that begins at a cache line (64 bytes)."""
    kind = np.dtype(dtype)
    memory = np.empty(count * kind.itemsize + _LINE, np.uint8)
    begin = -memory.__array_interface__["data"][0] % _LINE
    return memory[begin : begin + count * kind.itemsize].view(kind)


class ArrayPool:
    """Pool of uninitialised arrays that reuse the memory of earlier ones."""

    # A returned array, or any view of it, may be kept for ever: its memory returns to the pool only
    # when the last view has been deleted. This holds because every view keeps a reference to the
    # array that owns the memory or, as here, to the outermost array over a foreign buffer: NumPy
    # shortens chains of bases only through arrays. A weak reference watches that outermost array.
    # The pool never holds it, and never looks at reference counts.
    # The weak reference's callback must be a single C call (deque.append). An array may be deleted
    # within VTK's garbage collector, which holds a lock of all threads. A line of Python there may
    # release the interpreter's lock to a thread that then waits for VTK's: a deadlock.

    def __init__(self, keep: int = 2) -> None:
        self._keep = keep
        self.free: list[memoryview] = []
        #: Memory in use, by the identity of the weak reference that watches it.
        self._in_use: dict[int, tuple[weakref.ref[NDArray[Any]], memoryview]] = {}
        #: The weak references whose arrays have been deleted.
        self._deleted: deque[weakref.ref[NDArray[Any]]] = deque()

    def empty(self, shape: Sequence[int], dtype: DTypeLike) -> NDArray[Any]:
        """Return an uninitialised, C-contiguous array."""
        kind = np.dtype(dtype)
        size = prod(shape) * kind.itemsize
        if not size:
            return np.empty(tuple(shape), kind)
        memory = self._acquire(size)
        owner = np.frombuffer(memory, kind)
        watch = weakref.ref(owner, self._deleted.append)
        self._in_use[id(watch)] = watch, memory
        return owner.reshape(shape)

    def _acquire(self, size: int) -> memoryview:
        self._collect()
        try:
            while (block := self.free.pop()).nbytes != size:
                pass  # a block of another size will hardly be requested again
        except IndexError:
            # np.empty requests huge pages where the system has them; bytearray would clear memory.
            return allocate_aligned(size, np.uint8).data
        return block

    def _collect(self) -> None:
        """Return memory to the pool that nothing refers to any more."""
        while self._deleted:
            try:
                watch = self._deleted.popleft()
            except IndexError:  # another thread was faster
                return
            block = self._in_use.pop(id(watch))[1]
            if len(self.free) < self._keep:
                self.free.append(block)
