"""Sizes, estimated before memory is taken."""

from __future__ import annotations

import os

from spacemap_vtk.errors import SizeError

#: What takes less [bytes] is not refused: a machine that lacks it runs no program at all, and to
#: ask takes 1 ms beside another thread, a tenth of a frame while a slider is dragged.
SMALL = 2**24


def available() -> int | None:
    """Return how much memory can still be taken.

    Returns
    -------
    int or None
        Bytes; None where the system does not tell.
    """
    try:
        import psutil  # not in ParaView's own Python
    except ImportError:
        try:
            return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        except (AttributeError, OSError, ValueError):
            return None
    return int(psutil.virtual_memory().available)


def require(
    size: int, what: str, *, key: str | None = None, value: object = None, cure: str | None = None
) -> None:
    """Refuse what would not fit into memory.

    Parameters
    ----------
    size : int
        Estimate of the bytes needed.
    what : str
        What needs them, for the message.
    key, value, cure : object, optional
        As for `spacemap_vtk.errors.SpacemapError`.

    Raises
    ------
    SizeError
        If less than `size` bytes are available.
    """
    free = available() if size > SMALL else None
    if free is not None and size > free:
        raise SizeError(
            f"{what} would need about {size / 2**30:.3g} GiB of memory",
            key=key,
            value=value,
            allowed=f"up to the {free / 2**30:.3g} GiB now free",
            cure=cure,
        )
