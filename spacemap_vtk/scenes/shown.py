"""What there is to see of a weave as a draft, and the scene values that an edit of it becomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.io import registry
from spacemap_vtk.io.drafts.wif import MAX_CROSSINGS
from spacemap_vtk.ndarrays import Bools, Bytes
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.drawdown import rows
from spacemap_vtk.textile.drafts.loom import Loom

Colors = Bytes
#: Values of a weave by key, as a scene file has them; None: the key goes.
Changes = dict[str, Any]
#: Longer lists of colours are written whole, without a look for their repeat.
_LONGEST = 2000


@dataclass(frozen=True, eq=False)
class Shown:
    """A draft on the screen."""

    #: The draft's own; for a weave without one the smallest that weaves it.
    loom: Loom
    #: (picks, ends) True where the end lies over the pick.
    drawdown: Bools
    #: (ends, 3) Colour of each end.
    warp: Colors
    #: (picks, 3) Colour of each pick.
    weft: Colors
    #: Whether the weave is a pattern, rows or a picture, without a loom of its own: its drawdown
    #: can be edited.
    bare: bool
    #: What it was made from.
    source: Draft

    @property
    def size(self) -> tuple[int, int]:
        """Ends and picks."""
        return self.drawdown.shape[1], self.drawdown.shape[0]

    @property
    def columns(self) -> int:
        """Columns of the treadling: treadles, or of a liftplan shafts."""
        return self.loom.treadles if self.loom.liftplan is None else self.loom.shafts

    @property
    def lifted(self) -> tuple[tuple[int, ...], ...]:
        """What is pressed at each pick: treadles, or in a liftplan shafts."""
        return self.loom.treadling if self.loom.liftplan is None else self.loom.liftplan

    def marks(self, panel: str) -> Bools:
        """Return what is marked in a grid, numbers from 1 up along its columns: (rows, columns)."""
        loom = self.loom
        if panel == "threading":
            return _marks(loom.threading, loom.shafts).T
        if panel == "treadling":
            return _marks(self.lifted, self.columns)
        return _marks((*loom.tieup, *((),) * (loom.treadles - len(loom.tieup))), loom.shafts).T

    def strip(self, family: str) -> Colors:
        """Return the colours of the warp or the weft."""
        return self.warp if family == "warp" else self.weft

    def painted(self, family: str, colors: Colors) -> Shown:
        """Return the same with other colours of the warp or the weft."""
        return replace(self, warp=colors) if family == "warp" else replace(self, weft=colors)

    def with_loom(self, loom: Loom) -> Shown:
        """Return the same on another loom, which weaves its own cloth."""
        return replace(self, loom=loom, drawdown=loom.drawdown(), bare=False)


def _marks(rows: Sequence[Sequence[int]], columns: int) -> Bools:
    row = np.repeat(np.arange(len(rows)), [len(numbers) for numbers in rows])
    number = np.fromiter(chain.from_iterable(rows), np.intp)
    marks = np.zeros((len(rows), columns), bool)
    marks[row[number <= columns], number[number <= columns] - 1] = True
    return marks


def shown_of(woven: Woven) -> Shown:
    """Return what there is to see of a textile's draft; builds nothing."""
    source, cloth, file = woven.source, woven.cloth, woven.draft_file
    if cloth.drawdown.size > MAX_CROSSINGS:
        raise SizeError(
            "a draft of {} x {} yarns is too large to be shown".format(*cloth.size),
            allowed=f"up to {MAX_CROSSINGS} crossings",
        )
    # Rows and pictures say nothing of a loom.
    reader = None if file is None else registry.reader(file, "draft")
    return Shown(
        source.loom_for(cloth.drawdown),
        cloth.drawdown,
        cloth.warp.colors,
        cloth.weft.colors,
        reader is None or reader.general,
        source,
    )


def as_draft(shown: Shown) -> Draft:
    """Return the draft of an edited loom: what the source says besides, over all of its threads."""
    source = shown.source
    if source.loom is None:
        return Draft(shown.drawdown, shown.loom)
    ends, picks = shown.size
    return Draft(
        shown.drawdown,
        shown.loom,
        source.warp.repeated(ends),
        source.weft.repeated(picks),
        title=source.title,
        besides=source.besides,
    )


def as_pattern(shown: Shown) -> Changes:
    """Return the scene values of an edited drawdown."""
    ends, picks = shown.size
    return {"draft": None, "pattern": rows(shown.drawdown), "ends": ends, "picks": picks}


def as_colors(family: str, colors: Colors) -> Changes:
    """Return the scene value of edited colours."""
    return {f"{family}_color": as_series(colors)}


def as_series(colors: Colors) -> str | list[str]:
    """Return colours as a scene file has them, repeated over the yarns."""
    count = len(colors)
    length = 1 if count <= _LONGEST else count
    while length < count and (colors[length:] != colors[:-length]).any():
        length += 1
    words = ["#{:02x}{:02x}{:02x}".format(*color) for color in colors[:length].tolist()]
    return words[0] if len(words) == 1 else words
