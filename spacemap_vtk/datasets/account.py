"""Whether several processes on one machine give more than they cost: the first says it at the end.

What they give is what their shares of the work, done side by side, save. What they cost is that
each starts, with ParaView and all libraries: a second and some hundred megabytes. What the first
alone does, or all do alike (the cage), counts on neither side. All is measured in the run itself,
drawing apart, which is ParaView's: there so many seconds a polygon are taken as were measured.
"""

from __future__ import annotations

import atexit
import socket
import sys
from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import cores

#: Seconds of a processor for ParaView 5.11 to prepare and draw a polygon, in software.
DRAWN = 6e-6
#: More than this share of what processes cost must be given: what is not clear is not said.
_CLEAR = 0.5
#: Processors that are told apart, and bytes of a machine's name.
_PROCESSORS, _NAME = 1024, 64
#: What it took to start, until this is imported: the libraries that solve come on top.
_START = process_time()


class WorkShared:
    """What the processes of this run have done of what they share, by rank."""

    def __init__(self, rank: int, gather: Callable[[NDArray[Any]], NDArray[Any]]) -> None:
        self._gather = gather
        own = np.zeros(_PROCESSORS + _NAME, np.uint8)
        own[np.array(cores()) % _PROCESSORS] = 1
        name = socket.gethostname().encode()[:_NAME]
        own[_PROCESSORS : _PROCESSORS + len(name)] = list(name)
        told = gather(own).reshape(-1, len(own))
        self._seconds = np.zeros(len(told))
        self._cores = int(told[:, :_PROCESSORS].any(axis=0).sum())
        if rank == 0 and (told[:, _PROCESSORS:] == told[0, _PROCESSORS:]).all():
            atexit.register(self._say)  # several machines give their memory, too

    def add(self, seconds: float, polygons: int) -> None:
        """Add what each process has just done of a stage's work, and will draw of it."""
        self._seconds += self._gather(np.array([seconds + DRAWN * polygons]))

    def _say(self) -> None:
        if said := verdict(self._seconds, self._cores, _START):
            sys.stderr.write(f"spacemap: {said}\n")


def verdict(seconds: Floats, cores: int, start: float) -> str | None:
    """Return what is to be said of processes on one machine, from their shares of the work."""
    count, total = len(seconds), float(seconds.sum())
    saved = total - max(float(seconds.max()), total / min(count, cores))
    if saved < _CLEAR * (count - 1) * start:
        return (
            f"{count} processes on this machine cost more than they give: sharing the yarns saved "
            f"{saved:.2g} s of {total:.2g} s, and each process more took {start:.2g} s to start; "
            "one would do"
        )
    if count > cores:
        return (
            f"{count} processes on this machine have {cores} cores: no more than {cores} give "
            "anything"
        )
    return None
