"""Weaves of several layers of picks, given by the way of each end through them.

The picks of a column lie above each other. An end's way is the number of picks below it at each
column, the lift: 0 is below all of them. Ends of one place across lie above each other, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import lcm
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.crossed import straight_yarn
from spacemap_vtk.textile.rods.guess import Guess, make_taut
from spacemap_vtk.textile.rods.yarns import Yarn

#: Control points of a pick between two ends, and of an end in each diameter of its way.
_POINTS, _DENSITY = 4, 2.0
#: Share of the way between two columns on which an end stays at the height of a lift.
_LEVEL = 0.3
#: Largest number of layers, and of lifts in a repeat.
MOST_LAYERS, _MOST = 9, 400
#: What `parse_lifts` accepts.
GRAMMAR = (
    "a text for each place across, of the ends that lie there above each other, the lowest first: "
    'a digit for each column of picks, how many of its picks are below the end, as ["1 2", "30", '
    '"1 2", "03"]'
)


class LiftPlan(NamedTuple):
    """Ways of all ends of a repeat."""

    places: list[list[tuple[int, ...]]]
    """For each place across, the ends from the lowest up; each with a lift for each column."""
    layers: int
    """Number of picks in each column."""

    @property
    def columns(self) -> int:
        """Number of columns of picks in a repeat."""
        return len(self.places[0][0])

    @property
    def ends(self) -> list[tuple[int, ...]]:
        """The lifts of all ends."""
        return [end for place in self.places for end in place]

    @property
    def binds(self) -> list[bool]:
        """Whether each end changes its lift: it binds layers; others are stuffers."""
        return [len(set(end)) > 1 for end in self.ends]

    @property
    def unbound(self) -> list[tuple[int, int]]:
        """The picks (column, layer) that have no end above them, or none below."""
        return [
            (column, layer)
            for column in range(self.columns)
            for layer in range(self.layers)
            if not any(end[column] > layer for end in self.ends)
            or not any(end[column] <= layer for end in self.ends)
        ]

    @property
    def cloths(self) -> int:
        """Number of separate cloths; yarns of one cloth hold each other from above and below."""
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import connected_components

        ends = self.ends
        lifts = np.array(ends)[:, :, None]
        is_above = (lifts > np.arange(self.layers)).reshape(len(ends), -1)
        count = is_above.shape[1]
        graph = np.zeros((len(ends) + count,) * 2, dtype=np.int8)
        graph[: len(ends), len(ends) :] = is_above
        graph[len(ends) :, : len(ends)] = ~is_above.T
        for first in _firsts(self.places):
            # Ends of one place rest on each other.
            for lower, upper in first:
                graph[upper, lower] = 1
        return int(connected_components(csr_matrix(graph), connection="strong")[0])


def _firsts(places: Sequence[Sequence[object]]) -> list[list[tuple[int, int]]]:
    """List the pairs of numbers of ends that lie next to each other in each place."""
    found, start = [], 0
    for place in places:
        found.append([(start + k, start + k + 1) for k in range(len(place) - 1)])
        start += len(place)
    return found


def build_plan(structure: str, layers: int) -> LiftPlan:
    """Build a usual weave of several layers.

    Parameters
    ----------
    structure : str
        orthogonal: straight stuffers between the layers, and binders through all of them;
        through thickness: ends that go to and fro between both faces in steps of a layer;
        layer to layer: ends that bind two neighbouring layers each;
        double: two plain cloths, of which some ends of the upper one bind the lower one.
    layers : int
        Number of layers of picks, 2 to 9; a double weave has 2.

    Returns
    -------
    LiftPlan
        A repeat.
    """
    top = str(layers)
    if structure == "orthogonal":
        stuffers = " ".join(str(k) for k in range(1, layers))
        return parse_lifts([stuffers, f"{top}0", stuffers, f"0{top}"])
    if structure == "through thickness":
        way = [*range(layers + 1), *range(layers - 1, 0, -1)]
        return parse_lifts(
            ["".join(str(k) for k in np.roll(way, shift)) for shift in _spread(len(way))]
        )
    if structure == "layer to layer":
        ways = []
        for shift in _spread(4):
            bottom = np.roll([0, 1, 2, 1], shift)
            ways.append(" ".join("".join(str(k + v) for v in bottom) for k in range(0, layers - 1)))
        return parse_lifts(ways)
    # The upper end goes down to the lower cloth where the next lower end covers its pick.
    return parse_lifts(["01010101", "12121212", "10101010", "21212101"], 2)


def _spread(count: int) -> list[int]:
    """Order the shifts of neighbouring ends so that they are far from each other."""
    half = count // 2
    return [k // 2 + (half if k % 2 else 0) for k in range(2 * half)]


def parse_lifts(value: object, layers: int | None = None) -> LiftPlan:
    """Convert texts of lifts to a plan; shorter ways are repeated.

    Parameters
    ----------
    value : object
        A text for each place across, see `GRAMMAR`.
    layers : int, optional
        Number of layers; by default the largest lift.

    Returns
    -------
    LiftPlan
        The plan.

    Raises
    ------
    InputError
        If it is no plan, or ends of one place would change their order.

    Examples
    --------
    >>> parse_lifts(["1", "20", "1", "02"]).ends
    [(1, 1), (2, 0), (1, 1), (0, 2)]
    """
    if isinstance(value, str):
        value = value.split(",")
    if not isinstance(value, Iterable):
        raise InputError("must be the lifts of ends")
    texts = [str(place).split() for place in value]
    if not texts or not all(texts) or not all(end.isdigit() for place in texts for end in place):
        raise InputError("each place needs one end or more, each of digits")
    columns = lcm(*(len(end) for place in texts for end in place))
    if columns * sum(map(len, texts)) > _MOST:
        raise InputError(f"a repeat has at most {_MOST} lifts")
    places = [
        [tuple(int(digit) for digit in end * (columns // len(end))) for end in place]
        for place in texts
    ]
    for place in places:
        for lower, upper in pairwise(place):
            if any(low > high for low, high in zip(lower, upper, strict=True)):
                raise InputError("an end would change places with another one of the same place")
    highest = max(lift for place in places for end in place for lift in end)
    return LiftPlan(places, max(1, highest) if layers is None else layers)


def draw_layers(plan: LiftPlan, spacings: ArrayLike, diameters: Sequence[float]) -> Guess:
    """Draw a weave of several layers, its picks straight.

    Parameters
    ----------
    plan : LiftPlan
        Ways of the ends.
    spacings : array_like of float, shape (2,)
        Spacing of the places across, and of the columns of picks [m].
    diameters : sequence of float
        Diameters of stuffers, binders and picks [m].

    Returns
    -------
    Guess
        The ends, place by place, and the picks, column by column from the lowest up.
    """
    across, along = np.asarray(spacings, dtype=np.float64)
    stuffer, binder, pick = diameters
    own = iter([binder if binds else stuffer for binds in plan.binds])
    sizes = [[next(own) for _ in place] for place in plan.places]
    cell = np.array([[across * len(plan.places), 0, 0], [0, along * plan.columns, 0]], dtype=float)
    # Room between two layers, for the most ends that lie there in one place.
    room = max(
        sum(size for size, end in zip(sizes[k], place, strict=True) if end[column] == lift)
        for k, place in enumerate(plan.places)
        for column in range(plan.columns)
        for lift in range(plan.layers + 1)
    )
    height = pick + room
    yarns = []
    for number, place in enumerate(plan.places):
        for order, end in enumerate(place):
            level = np.zeros(plan.columns)
            for column, lift in enumerate(end):
                shared = [k for k, other in enumerate(place) if other[column] == lift]
                beside = np.cumsum([sizes[number][k] for k in shared])
                middle = beside - np.array([sizes[number][k] for k in shared]) / 2
                offset = middle[shared.index(order)] - beside[-1] / 2
                level[column] = (lift - 0.5) * height + offset
            size = sizes[number][order]
            points = _draw_end((number + 0.5) * across, level, along, size)
            yarns.append(Yarn(points, (0, 1), size))
    count = _POINTS * len(plan.places)
    for column in range(plan.columns):
        for layer in range(plan.layers):
            start = np.array([0.0, (column + 0.5) * along, layer * height])
            yarns.append(straight_yarn(0, start, cell[0, 0], max(count, 6), pick))
    return Guess(yarns, cell, make_taut(yarns, cell))


def _draw_end(x: float, level: Floats, along: float, diameter: float) -> Floats:
    """Draw an end that is at the given levels at the columns, with a point for each step."""
    columns = len(level)
    fine = np.linspace(0.0, columns, 200 * columns, endpoint=False)
    column, share = np.divmod(fine, 1.0)
    t = np.clip((share - _LEVEL) / (1 - 2 * _LEVEL), 0.0, 1.0)
    t = t * t * (3 - 2 * t)
    column = column.astype(int)
    z = (1 - t) * level[column] + t * level[(column + 1) % columns]
    y = (fine + 0.5) * along
    steps = np.hypot(np.diff(y, append=y[0] + columns * along), np.diff(z, append=z[0]))
    run = np.concatenate([[0.0], np.cumsum(steps)])
    count = max(6 * columns, round(_DENSITY * run[-1] / diameter))
    at = np.linspace(0.0, run[-1], count, endpoint=False)
    points = np.empty((count, 3))
    points[:, 0] = x
    points[:, 1] = np.interp(at, run, np.append(y, y[0] + columns * along))
    points[:, 2] = np.interp(at, run, np.append(z, z[0]))
    return points
