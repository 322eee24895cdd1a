"""Sizes, estimated before memory is taken."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from spacemap_vtk.errors import SizeError

#: What takes less [bytes] is not refused: a machine that lacks it runs no program at all, and to
#: ask takes 1 ms beside another thread, a tenth of a frame while a slider is dragged.
SMALL = 2**24


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
    free = _left_in_machine()
    known = [left for left in (free, left_in_group()) if left is not None]
    return min(known, default=None)


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
