"""Correct the heights of yarns where their crossings differ, so that yarns keep their lengths.

Each crossing is solved as if it were repeated. Between crossings of unequal heights, spacings or
diameters, the length of an axis differs from the mean of the two solutions by the square of their
difference. So the heights of each yarn are scaled in one proportion until its total length is
right, and D follows, between its least value and its value at rest. Where the other yarn is slack,
D stays, and the other yarn gives way. A yarn that is slack somewhere, or jams, keeps its heights.
All corrections are continuous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk import cancel
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import Gap, solve_gaps

#: Slack, or stretch past a jam, from which a yarn is not corrected; below, it is corrected in part.
_SLACK_LIMIT = 1e-3
#: Largest relative change of heights in one step.
_MOST_CHANGE = 0.05
#: Relative tolerance of a yarn's length.
_TOLERANCE = 1e-11
#: Largest number of steps to reach it.
_STEPS = 12


class CrossingResults(NamedTuple):
    """Results of separate crossings; arrays are (2, picks, ends)."""

    lengthening: Floats
    """Length of a gap's axis less that at rest, in metres."""
    stretch: Floats
    """Stretch that the crossings reach."""
    slack: Floats
    """Excess length of the yarn over its room, plus the stretch past a jam, over lengths."""


class _FamilyGaps(NamedTuple):
    """The gaps between crossings of warp or weft: (yarns, gaps)."""

    changes: Bools
    spacing: Floats
    flat: Floats
    length: Floats
    """(yarns,) From first to last crossing at rest, without the flats."""


class LengthCorrection:
    """The yarns of a cloth between their crossings; `loose` marks those that never change side."""

    def __init__(self, cloth: Cloth, loose: Floats) -> None:
        warp, weft = cloth.yarns
        self._full = 0.5 * np.add.outer(weft.diameter, warp.diameter)
        self._arcs = cloth.arc_ratios
        self._loose = loose
        self._families: list[_FamilyGaps] = []
        rest = cloth.rest_heights
        for number, crossed in enumerate((weft, warp)):
            upper = cloth.is_over(number)
            flat = 0.5 * (crossed.flat[1:] + crossed.flat[:-1])
            changes = upper[:, 1:] != upper[:, :-1]
            self._families.append(_FamilyGaps(changes, crossed.spacing, flat, np.zeros(len(upper))))
            length = self._solve_gaps(number, rest, crossed.spacing - flat).length.sum(axis=1)
            self._families[number] = self._families[number]._replace(length=length)

    def correct_heights(self, height: Floats, floor: Floats, results: CrossingResults) -> Floats:
        """Correct heights so that yarns have the given lengths; `floor` is their least sum."""
        height = height.copy()
        taut = np.where(self._loose, 0.0, np.clip(1.0 - results.slack / _SLACK_LIMIT, 0.0, 1.0))
        # A yarn is as taut as its slackest crossing.
        taut[0], taut[1] = taut[0].min(axis=0), taut[1].min(axis=1)[:, None]
        gives = 1.1 - taut
        gives /= gives.sum(axis=0)
        rooms: list[Floats] = []
        goals: list[Floats] = []
        for number, family in enumerate(self._families):
            wider = family.spacing * (
                _average_neighbours(_yarn_rows(results.stretch, number)) - 1.0
            )
            grown = np.where(
                family.changes, _average_neighbours(_yarn_rows(results.lengthening, number)), wider
            )
            goals.append(family.length + grown.sum(axis=1))
            rooms.append(
                family.spacing * _average_neighbours(_yarn_rows(results.stretch, number))
                - family.flat
            )
        moved = [np.zeros_like(goal) for goal in goals]
        for _ in range(_STEPS):
            cancel.check()
            found = True
            for number, family in enumerate(self._families):
                gap, part = (
                    self._solve_gaps(number, height, rooms[number]),
                    _yarn_rows(taut, number)[:, 0],
                )
                own = _yarn_rows(height, number)
                wide = own * _yarn_rows(taut[::-1] * self._arcs, number)
                wider = _average_neighbours(wide)
                rise = np.where(
                    family.changes, 2.0 * _average_neighbours(own), np.abs(np.diff(own, axis=1))
                )
                by = (gap.sin * rise + 2.0 * (gap.theta - gap.sin) * wider).sum(axis=1)
                # Share the missing length as springs would: a yarn that is almost slack hardly
                # moves.
                missing = part * (goals[number] - gap.length.sum(axis=1))
                missing -= (1.0 - part) * by * moved[number]
                live = (np.abs(missing) > _TOLERANCE * family.length) & (by > 1e-9 * family.length)
                if not live.any():
                    continue
                found, other = False, 1 - number
                step = np.where(live, missing / np.where(live, by, 1.0), 0.0).clip(
                    -_MOST_CHANGE, _MOST_CHANGE
                )
                moved[number] += step
                move = step[:, None] * own
                move = move if number else move.T
                height[number] += move
                height[other] -= (1.0 - taut[other]) * move
                # What exceeds D is taken from slack yarns.
                total = height.sum(axis=0)
                height += gives * (np.clip(total, floor, self._full) - total)
                np.maximum(height, 0.0, out=height)
            if found:
                break
        return height

    def _solve_gaps(self, number: int, height: Floats, room: Floats) -> Gap:
        """Compute the gaps of warp or weft as drawn, without the flats."""
        family, rows = self._families[number], _yarn_rows(height, number)
        wide = _average_neighbours(_yarn_rows(2.0 * height.sum(axis=0) * self._arcs, number))
        rise = np.where(
            family.changes, 2.0 * _average_neighbours(rows), np.abs(np.diff(rows, axis=1))
        )
        return solve_gaps(np.maximum(room, 1e-9 * wide), rise, wide)


def _yarn_rows(table: Floats, number: int) -> Floats:
    """Arrange values (2, picks, ends) in a row for each yarn of a family."""
    return table[1] if number else table[0].T


def _average_neighbours(rows: Floats) -> Floats:
    """Average neighbours in each row."""
    return 0.5 * (rows[:, 1:] + rows[:, :-1])
