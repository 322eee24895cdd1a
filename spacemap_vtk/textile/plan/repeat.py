"""Repeats of a draft with its colours, and the threads that balance it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from spacemap_vtk.ndarrays import Bools, Bytes, Floats
from spacemap_vtk.textile.drafts.drawdown import period

#: In longer repeats no threads are sought that balance them.
_LONGEST = 2000
#: Repeats of so few threads need no balance: nobody sees where they end.
_SHORT = 2


@dataclass(frozen=True)
class Repeat:
    """The repeat of a draft along its warp or weft."""

    #: Number of threads of a repeat, colours included.
    size: int
    #: Number of threads that are added once, so that both sides of the cloth look alike.
    extra: int = 0

    def nearest(self, count: float) -> int:
        """Return the number of threads, of whole repeats and the balance, nearest to a number."""
        return self.size * max(round((count - self.extra) / self.size), 1) + self.extra

    def describe(self, count: int) -> str:
        """Describe a number of threads: "30 repeats of 8 + 1"."""
        repeats, rest = divmod(count, self.size)
        if self.size == 1 or not repeats:
            return ""
        text = f"{repeats} repeat{'s' * (repeats != 1)} of {self.size}"
        return f"{text} + {rest}" if rest else text


def find_repeat(lines: Bools, colors: Bytes, yarns: Floats) -> Repeat:
    """Find the repeat of a draft along its warp or weft, colours and yarns included."""
    # `lines` has a row of the drawdown for each pick, or a column for each end; `yarns` has what
    # distinguishes the yarns of a colour. The balance is what
    # the draft has beyond whole repeats. A draft that ends with a repeat is balanced by the fewest
    # threads, less than half a repeat, that make it symmetrical.
    packed = np.packbits(lines, axis=1)
    words: list[Hashable] = [
        (line.tobytes(), color.tobytes(), yarn.tobytes())
        for line, color, yarn in zip(packed, colors, yarns, strict=True)
    ]
    size = period(words)
    extra = len(words) % size
    if not extra and _SHORT < size <= _LONGEST:
        extra = _symmetric_extra(words[:size])
    return Repeat(size, extra)


def _symmetric_extra(unit: Sequence[Hashable]) -> int:
    """Return the fewest threads after which two repeats read the same from both sides; or 0."""
    for extra in range((len(unit) + 1) // 2):
        whole = [*unit, *unit, *unit[:extra]]
        if whole == whole[::-1]:
            return extra
    return 0
