"""What a printed draft says: the draft, the part of it that is printed, and what is derived."""

from __future__ import annotations

import string
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spacemap_vtk.draw.draft_print.groups import Groups
from spacemap_vtk.ndarrays import Bools, Bytes, Ints
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.floats import FloatLimits, YarnFloats, find_floats
from spacemap_vtk.textile.drafts.loom import Loom
from spacemap_vtk.textile.drafts.repeats import find_repeats

#: Colours of families for which the draft gives none.
_PLAIN_COLORS = np.array([[70, 84, 102], [250, 250, 247]], np.uint8)
#: Most room for shafts above a drawdown, and for treadles or a liftplan beside it, in mm.
_LOOM_ROOM = 80.0
#: Names of the families' threads.
THREADS = ("end", "pick")


@dataclass(frozen=True, eq=False)
class DraftContent:
    """A draft and what is derived from it for printing."""

    #: The printed part of the draft.
    draft: Draft
    #: Least side of a cell, in mm.
    least_cell: float
    #: Floats over more crossings than these are marked: those of ends, those of picks.
    float_limits: FloatLimits
    #: Number of the first printed end and pick.
    first: tuple[int, int] = (1, 1)
    #: Numbers of ends and picks of the whole draft, if only a part is printed.
    whole: tuple[int, int] | None = None
    #: Whether the loom was only derived from the drawdown.
    is_loom_derived: bool = False

    @property
    def loom(self) -> Loom:
        """The loom; drafts that are printed have one."""
        assert self.draft.loom is not None
        return self.draft.loom

    @property
    def size(self) -> tuple[int, int]:
        """Numbers of printed ends and picks."""
        return self.draft.size

    @property
    def has_treadles(self) -> bool:
        """Whether there are treadles and a tie-up; otherwise there is a liftplan."""
        return self.loom.liftplan is None

    @property
    def columns(self) -> int:
        """Columns of the treadling: treadles, or shafts of a liftplan."""
        return self.loom.treadles if self.has_treadles else self.loom.shafts

    @property
    def treadling(self) -> tuple[tuple[int, ...], ...]:
        """Treadles that are pressed at each pick, or shafts of a liftplan."""
        return self.loom.treadling if self.loom.liftplan is None else self.loom.liftplan

    @property
    def shows_loom(self) -> bool:
        """Whether threading and treadling fit beside a drawdown as grids."""
        return max(self.loom.shafts, self.columns) * self.least_cell <= _LOOM_ROOM

    @property
    def lists_loom(self) -> bool:
        """Whether threading and treadling are listed by groups; as columns of a jacquard not."""
        return self.shows_loom or not self.is_loom_derived

    @cached_property
    def color_table(self) -> Bytes:
        """(colours, 3), each yarn colour once, in the order of ends and then picks."""
        both = np.concatenate(self.thread_colors)
        _, first = np.unique(both, axis=0, return_index=True)
        return both[np.sort(first)]

    @cached_property
    def thread_colors(self) -> tuple[Bytes, Bytes]:
        """RGB colour of each end and of each pick."""
        warp, weft = (
            np.tile(plain, (count, 1)) if threads.colors is None else threads.colors
            for threads, count, plain in zip(self.threads, self.size, _PLAIN_COLORS, strict=True)
        )
        return warp, weft

    @cached_property
    def color_numbers(self) -> tuple[Ints, Ints]:
        """Number in `color_table` of each end and of each pick."""
        number = {tuple(color): k for k, color in enumerate(self.color_table.tolist())}
        ends, picks = (
            np.array([number[tuple(color)] for color in colors.tolist()])
            for colors in self.thread_colors
        )
        return ends, picks

    @property
    def threads(self) -> tuple[DraftThreads, DraftThreads]:
        """Warp and weft of the draft."""
        return self.draft.warp, self.draft.weft

    def on_face(self, face: bool) -> Bools:
        """Return where the end is on top, on the face or on the reverse, not yet turned."""
        return self.draft.drawdown if face else ~self.draft.drawdown

    def floats(self, family: int, face: bool) -> YarnFloats:
        """Return all floats of the warp or the weft on one face."""
        return find_floats(self.draft.drawdown, family, face)

    @cached_property
    def _long_floats(self) -> dict[tuple[int, bool], YarnFloats]:
        return {
            (family, face): self.floats(family, face).longer_than(self.float_limits[family])
            for family in (0, 1)
            for face in (True, False)
        }

    def long_floats(self, family: int, face: bool) -> YarnFloats:
        """Return the floats that are marked."""
        return self._long_floats[family, face]

    @cached_property
    def threading_groups(self) -> Groups:
        """The threading by groups."""
        return Groups(self.loom.threading, lambda row, before: write_row(row), self.first[0])

    @cached_property
    def treadling_groups(self) -> Groups:
        """The treadling or liftplan by groups; with colours if the weft has several."""
        numbers = self.color_numbers[1].tolist()
        if len(set(numbers)) == 1:
            return Groups(self.treadling, lambda row, before: write_row(row), self.first[1])

        def write(token: Any, before: Any) -> str:
            row, color = token
            same = before is not None and before[1] == color
            return write_row(row) + ("" if same else color_letter(color))

        return Groups(list(zip(self.treadling, numbers, strict=True)), write, self.first[1])

    def value_groups(self, family: int, values: Sequence[Any], write: Any) -> Groups:
        """Return values of single threads by groups."""
        return Groups(values, lambda value, before: write(value), self.first[family])

    @cached_property
    def borders(self) -> tuple[Any, Any]:
        """The smallest descriptions of the threading and of the treadling."""
        return find_repeats(self.loom.threading), find_repeats(self.treadling)


def write_row(row: tuple[int, ...]) -> str:
    """Write the shafts of an end, or the treadles of a pick."""
    return "+".join(map(str, row)) if row else "–"


def color_letter(number: int) -> str:
    """Return the letter of a yarn colour: a to z, then A to Z, then two letters."""
    letters = string.ascii_letters
    if number < len(letters):
        return letters[number]
    return letters[number // len(letters) - 1] + letters[number % len(letters)]
