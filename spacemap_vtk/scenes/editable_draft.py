"""A weave's draft on the screen, and the scene values that result from editing it."""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.io import registry
from spacemap_vtk.io.drafts.wif import MAX_CROSSINGS
from spacemap_vtk.ndarrays import Bools, Bytes, Ints
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.drawdown import to_rows
from spacemap_vtk.textile.drafts.loom import Loom, from_marks, to_marks

Colors = Bytes
#: Values of a weave by key, as in a scene file; None removes the key.
Changes = dict[str, Any]
#: Writes a draft to a file, and returns the path.
StoreDraft = Callable[[Draft], str]
#: The warp and the weft.
FAMILIES = ("warp", "weft")
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
        if panel == "drawdown":
            return self.drawdown
        if panel == "threading":
            return to_marks(loom.threading, loom.shafts).T
        if panel == "treadling":
            return to_marks(self.treadling, self.columns)
        return to_marks((*loom.tieup, *((),) * (loom.treadles - len(loom.tieup))), loom.shafts).T

    def with_marks(self, panel: str, marks: Bools) -> EditableDraft:
        """Return a copy with other marks of a grid; of a loom, with the cloth that it weaves."""
        if panel == "drawdown":
            return replace(self, drawdown=marks)
        if panel == "threading":
            return self.with_loom(replace(self.loom, threading=from_marks(marks.T)))
        if panel == "tieup":
            return self.with_loom(replace(self.loom, tieup=from_marks(marks.T)))
        if self.loom.liftplan is None:
            return self.with_loom(replace(self.loom, treadling=from_marks(marks)))
        return self.with_loom(replace(self.loom, liftplan=from_marks(marks)))

    def yarn_colors(self, family: str) -> Colors:
        """Return the colours of the warp or the weft."""
        return self.warp if family == "warp" else self.weft

    def with_colors(self, family: str, colors: Colors) -> EditableDraft:
        """Return a copy with other colours of the warp or the weft."""
        return replace(self, warp=colors) if family == "warp" else replace(self, weft=colors)

    def with_loom(self, loom: Loom) -> EditableDraft:
        """Return a copy with another loom and the cloth that it weaves."""
        return replace(self, loom=loom, drawdown=loom.drawdown(), is_pattern=False)

    def arrange(self, ends: Ints | None = None, picks: Ints | None = None) -> EditableDraft:
        """Return a copy with the ends and picks in another order: indices of the present ones."""
        order = [
            np.arange(count) if given is None else given
            for count, given in zip(self.size, (ends, picks), strict=True)
        ]
        if order[0].size * order[1].size > MAX_CROSSINGS or not (order[0].size and order[1].size):
            raise SizeError(
                f"a draft of {order[0].size} ends and {order[1].size} picks is not possible",
                allowed=f"1 to {MAX_CROSSINGS} crossings",
            )
        across, along = (list(indices) for indices in order)
        loom, drawdown = self.loom, self.drawdown[np.ix_(along, across)]
        lifted = loom.liftplan
        loom = replace(
            loom,
            threading=tuple(loom.threading[end] for end in across),
            treadling=tuple(loom.treadling[pick] for pick in along if lifted is None),
            liftplan=None if lifted is None else tuple(lifted[pick] for pick in along),
        )
        source = self.source
        if source.loom is not None:
            count = self.size
            source = replace(
                source,
                drawdown=drawdown,
                loom=loom,
                warp=source.warp.repeat(count[0]).crop(order[0]),
                weft=source.weft.repeat(count[1]).crop(order[1]),
            )
        return replace(
            self,
            loom=loom,
            drawdown=drawdown,
            warp=self.warp[across],
            weft=self.weft[along],
            source=source,
        )


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


def scene_changes(
    before: EditableDraft, shown: EditableDraft, given: Container[str], store: StoreDraft
) -> Changes:
    """Return the scene values of an edit; `given` holds the keys that the scene already sets."""
    changes: Changes = {}
    arranged = shown.source is not before.source or shown.size != before.size
    if shown.is_pattern:
        if shown.drawdown is not before.drawdown:
            changes = pattern_values(shown)
    elif before.is_pattern or arranged or shown.loom != before.loom:
        changes = {"draft": store(to_draft(shown)), "pattern": None}
        if arranged:
            changes |= {"ends": None, "picks": None}
    for family in FAMILIES:
        colors = shown.yarn_colors(family)
        if not arranged:
            differs = not np.array_equal(colors, before.yarn_colors(family))
        elif shown.source.loom is None or f"{family}_color" in given:
            differs = True
        else:
            stored = getattr(shown.source, family).colors
            differs = stored is None or not np.array_equal(stored, colors)
        if differs:
            changes |= color_values(family, colors)
    return changes


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
