"""A weave's draft on the screen, and the scene values that result from editing it."""

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
from spacemap_vtk.textile.drafts.drawdown import to_rows
from spacemap_vtk.textile.drafts.loom import Loom

Colors = Bytes
#: Values of a weave by key, as in a scene file; None removes the key.
Changes = dict[str, Any]
#: In longer lists of colours no repeat is searched for.
_LONGEST = 2000


@dataclass(frozen=True, eq=False)
class EditableDraft:
    """A draft on the screen."""

    #: The draft's loom; for a weave without one, the smallest that weaves it.
    loom: Loom
    #: (picks, ends), True where the end lies over the pick.
    drawdown: Bools
    #: (ends, 3), colour of each end.
    warp: Colors
    #: (picks, 3), colour of each pick.
    weft: Colors
    #: Whether the weave is a pattern, rows or a picture, which have no loom: then its drawdown can
    #: be edited.
    is_pattern: bool
    #: The draft from which it was made.
    source: Draft

    @property
    def size(self) -> tuple[int, int]:
        """Number of ends and of picks."""
        return self.drawdown.shape[1], self.drawdown.shape[0]

    @property
    def columns(self) -> int:
        """Number of columns of the treadling: treadles, or shafts of a liftplan."""
        return self.loom.treadles if self.loom.liftplan is None else self.loom.shafts

    @property
    def treadling(self) -> tuple[tuple[int, ...], ...]:
        """Treadles that are pressed at each pick, or shafts that are lifted in a liftplan."""
        return self.loom.treadling if self.loom.liftplan is None else self.loom.liftplan

    def marks(self, panel: str) -> Bools:
        """Return the marks of a grid, (rows, columns); the first is shaft or treadle 1."""
        loom = self.loom
        if panel == "threading":
            return _mark_grid(loom.threading, loom.shafts).T
        if panel == "treadling":
            return _mark_grid(self.treadling, self.columns)
        return _mark_grid((*loom.tieup, *((),) * (loom.treadles - len(loom.tieup))), loom.shafts).T

    def yarn_colors(self, family: str) -> Colors:
        """Return the colours of the warp or the weft."""
        return self.warp if family == "warp" else self.weft

    def with_colors(self, family: str, colors: Colors) -> EditableDraft:
        """Return a copy with other colours of the warp or the weft."""
        return replace(self, warp=colors) if family == "warp" else replace(self, weft=colors)

    def with_loom(self, loom: Loom) -> EditableDraft:
        """Return a copy with another loom and the cloth that it weaves."""
        return replace(self, loom=loom, drawdown=loom.drawdown(), is_pattern=False)


def _mark_grid(rows: Sequence[Sequence[int]], columns: int) -> Bools:
    row = np.repeat(np.arange(len(rows)), [len(numbers) for numbers in rows])
    number = np.fromiter(chain.from_iterable(rows), np.intp)
    marks = np.zeros((len(rows), columns), bool)
    marks[row[number <= columns], number[number <= columns] - 1] = True
    return marks


def make_editable_draft(woven: Woven) -> EditableDraft:
    """Return a textile's draft for the screen; builds nothing."""
    source, cloth, file = woven.source, woven.cloth, woven.draft_file
    if cloth.drawdown.size > MAX_CROSSINGS:
        raise SizeError(
            "a draft of {} x {} yarns is too large to display".format(*cloth.size),
            allowed=f"up to {MAX_CROSSINGS} crossings",
        )
    # Rows and pictures contain no loom.
    reader = None if file is None else registry.reader(file, "draft")
    return EditableDraft(
        source.find_loom(cloth.drawdown),
        cloth.drawdown,
        cloth.warp.colors,
        cloth.weft.colors,
        reader is None or reader.general,
        source,
    )


def to_draft(shown: EditableDraft) -> Draft:
    """Return the draft of an edited loom, with the other data of its source for all threads."""
    source = shown.source
    if source.loom is None:
        return Draft(shown.drawdown, shown.loom)
    ends, picks = shown.size
    return Draft(
        shown.drawdown,
        shown.loom,
        source.warp.repeat(ends),
        source.weft.repeat(picks),
        title=source.title,
        other_sections=source.other_sections,
    )


def pattern_values(shown: EditableDraft) -> Changes:
    """Return the scene values of an edited drawdown."""
    ends, picks = shown.size
    return {"draft": None, "pattern": to_rows(shown.drawdown), "ends": ends, "picks": picks}


def color_values(family: str, colors: Colors) -> Changes:
    """Return the scene value of edited colours."""
    return {f"{family}_color": format_colors(colors)}


def format_colors(colors: Colors) -> str | list[str]:
    """Return colours as in a scene file, which repeats them over the yarns."""
    count = len(colors)
    length = 1 if count <= _LONGEST else count
    while length < count and (colors[length:] != colors[:-length]).any():
        length += 1
    words = ["#{:02x}{:02x}{:02x}".format(*color) for color in colors[:length].tolist()]
    return words[0] if len(words) == 1 else words
