"""Axes of yarns by arcs and straight parts, with yarns that touch at every crossing.

Between two crossings where a yarn changes side, its axis runs arc - straight - arc. Where the yarn
floats over yarns of one diameter, and past its last crossing, the axis is straight and horizontal.
Over yarns of unequal diameters a float also runs arc - straight - arc, between unequal heights.

Yarns touch at every crossing and overlap nowhere:

- Arcs have the radius R = (d + d_i)/2 about the crossed yarn. Warp and weft axes are R apart at
  each crossing and nowhere closer: with x, y, f, g measured from the crossing,
  ``y**2 + (R - f)**2 >= R**2`` and ``x**2 + (R - g)**2 >= R**2`` give
  ``x**2 + y**2 + (R - f - g)**2 >= R**2 + 2 f g``. (Where one yarn moves away, f < 0, the other
  one alone keeps the distance, because g > R only where x > R.)
- Over a lens the arc has the radius R_j + d/2, and the proof holds for the centre lines of the
  arcs on which yarns touch (`spacemap_vtk.textile.weave.lens`).
- A racetrack is the union of circles with centres on its flat. Distances to it are distances to the
  circles, with x and y shortened by half the flat. The same result holds if axes stay straight on
  the flats.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.geometry.axis_parts import Axes
from spacemap_vtk.textile.geometry.swelling import (
    USUAL_GROWTH,
    Growth,
    measure_float_ends,
    share_along_floats,
)
from spacemap_vtk.textile.patches.bezier import rational_handles
from spacemap_vtk.textile.weave.peirce import Crimp, solve
from spacemap_vtk.textile.weave.threads import Yarns

#: Longest arc of one part, in rad. Longer arcs are split: one cubic misses the radius by 2.4e-5 at
#: this angle, and by 2.7e-4 at 90 degrees.
LONGEST_ARC = pi / 3
#: Below this angle (rad) an arc is left out, because its patches would be slivers. The straight
#: cubic that replaces it is off by less than this angle times the height.
FLAT = 1e-7


class Gaps(NamedTuple):
    """Gaps of some yarns: between crossings, on flats, and past the first and last crossing."""

    # Arrays have one row if all yarns agree; where space is stretched, each yarn has a row.

    bounds: Floats
    """(yarns or 1, gaps + 1) Positions along the yarn where gaps meet, in unstretched space."""
    spacing: Floats
    """(yarns or 1, gaps) Lengths of the gaps along the yarn, in stretched space."""
    height: Floats
    """(yarns, gaps + 1) Heights of the axes at the bounds."""
    arc: Floats
    """(yarns, gaps + 1) Radii of the arcs at the bounds."""
    stretch: Floats
    """(yarns or 1, gaps) Stretch of space along the yarn."""


class PartPlan(NamedTuple):
    """Numbers of parts of the gaps; they stay the same when heights change."""

    pieces: Ints
    """(yarns, gaps) Number of parts of each of the two arcs."""
    straight: Bools
    """(yarns, gaps) Whether there is a straight part between the arcs."""


def build_gaps(
    crossed: Yarns,
    arc: Floats,
    height: Floats,
    overhang: float,
    stretch: Floats | None = None,
    bends: Bools | None = None,
) -> Gaps:
    """Build the gaps of yarns from values at their crossings, (yarns, crossings)."""
    # Flats, and yarns past their last crossing, keep their length when space is stretched.
    size = np.ones((1, len(crossed.position))) if stretch is None else stretch
    between = 0.5 * (size[:, 1:] + size[:, :-1])
    position = np.broadcast_to(crossed.position, size.shape)
    inner = crossed.spacing * between
    half = 0.5 * crossed.flat
    first, last = (
        position[:, :1] - overhang / size[:, :1],
        position[:, -1:] + overhang / size[:, -1:],
    )
    if half.any():
        # Yarns are straight over each flat. A yarn may end on the first or last flat.
        flat = crossed.flat.copy()
        flat[[0, -1]] -= np.maximum(half[[0, -1]] - overhang, 0.0) * (1 + (len(flat) == 1))
        room = np.maximum(inner - half[1:] - half[:-1], 0.0)
        step = half / size
        position = np.stack([position - step, position + step], axis=2).reshape(
            len(size), 2 * len(half)
        )
        position[:, :1] = np.maximum(position[:, :1], first)
        position[:, -1:] = np.minimum(position[:, -1:], last)
        inner, both = np.empty((2, len(size), position.shape[1] - 1))
        inner[:, ::2], inner[:, 1::2] = flat, room
        both[:, ::2], both[:, 1::2] = size, between
        height, arc, between = np.repeat(height, 2, axis=1), np.repeat(arc, 2, axis=1), both
    past = np.broadcast_to(np.maximum(overhang - half[[0, -1]], 0.0), (len(size), 2))
    gaps = Gaps(
        bounds=np.concatenate([first, position, last], axis=1),
        spacing=np.concatenate([past[:, :1], inner, past[:, 1:]], axis=1),
        height=np.pad(height, ((0, 0), (1, 1)), mode="edge"),
        arc=np.pad(arc, ((0, 0), (1, 1)), mode="edge"),
        stretch=np.concatenate([size[:, :1], between, size[:, -1:]], axis=1),
    )
    if bends is None:
        return gaps
    flats = height.shape[1] // bends.shape[1]
    return _remove_bounds(gaps, np.repeat(bends, flats, axis=1))


def _remove_bounds(gaps: Gaps, bends: Bools) -> Gaps:
    """Remove the bounds that are not kept; shorter rows end in gaps of zero length."""
    bends = np.pad(bends, ((0, 0), (1, 1)), constant_values=True)
    count = bends.sum(axis=1, keepdims=True)
    column = np.arange(count.max(initial=2))
    order = np.argsort(~bends, axis=1, kind="stable")[:, : len(column)]
    order = np.where(column < count, order, bends.shape[1] - 1)
    # Past its first and last crossing a yarn keeps the height that it has there.
    level = np.take_along_axis(order, np.clip(column, 1, count - 2), axis=1)
    bounds = gaps.bounds[0][order]
    return Gaps(
        bounds=bounds,
        spacing=np.diff(bounds, axis=1),
        height=np.take_along_axis(gaps.height, level, axis=1),
        arc=np.take_along_axis(gaps.arc, level, axis=1),
        stretch=np.ones((1, len(column) - 1)),
    )


def plan_parts(gaps: Gaps, exact: bool) -> PartPlan:
    """Choose the numbers of parts of the gaps."""
    return _count_parts(_solve_gaps(gaps), gaps.spacing, exact)


def _solve_gaps(gaps: Gaps) -> Crimp:
    # Peirce's formulas hold in each gap if D is the sum of the radii of its two arcs.
    rise = np.abs(np.diff(gaps.height, axis=1))
    return solve(gaps.spacing, rise, gaps.arc[:, :-1] + gaps.arc[:, 1:])


def _count_parts(crimp: Crimp, spacing: Floats, exact: bool) -> PartPlan:
    flat = crimp.theta < FLAT
    # Jammed square cloth has arcs of 60 degrees; rounding must not split them.
    longest = 2.0 * LONGEST_ARC if exact else LONGEST_ARC
    pieces = np.where(flat, 0, np.ceil(crimp.theta / longest - 1e-9).astype(np.int64))
    return PartPlan(pieces, np.where(flat, spacing, crimp.straight) > 0.0)


def _radius_factors(gaps: Gaps, plan: PartPlan) -> Floats:
    """Compute the factors that fit the arc radii of a plan into gaps without room for them."""
    # Two arcs alone fit where (D - h)^2 + p^2 = D^2. In a plan without a straight part the arcs
    # must fill the gap, so there the factor may also exceed 1.
    p, h = gaps.spacing, np.abs(np.diff(gaps.height, axis=1))
    both = 2.0 * h * (gaps.arc[:, :-1] + gaps.arc[:, 1:])
    fit = np.divide(p * p + h * h, both, out=np.full(h.shape, np.inf), where=both > 0.0)
    longest = np.where(plan.straight | (plan.pieces == 0), 1.0, np.inf)
    return np.where(np.isfinite(fit), np.minimum(fit, longest), 1.0)


def build_axes(
    radius: Floats,
    lateral: Floats,
    gaps: Gaps,
    exact: bool = False,
    plan: PartPlan | None = None,
    floats: Bools | None = None,
    growth: Growth = USUAL_GROWTH,
) -> Axes:
    """Cut axes into parts; with a plan the number of parts does not depend on the heights."""
    # `floats`: whether yarns lie over those that they cross, (yarns, crossings), if floats swell.
    height, rise = gaps.height, np.diff(gaps.height, axis=1)
    bounds = np.broadcast_to(gaps.bounds, height.shape)
    spacing, stretch = (np.broadcast_to(x, rise.shape) for x in (gaps.spacing, gaps.stretch))
    begin, end = gaps.arc[:, :-1], gaps.arc[:, 1:]
    if plan is None:
        crimp = _solve_gaps(gaps)
        plan = _count_parts(crimp, spacing, exact)
    else:
        fit = _radius_factors(gaps, plan)
        begin, end = fit * begin, fit * end
        crimp = solve(spacing, np.abs(rise), begin + end)
    pieces, alone = plan.pieces, plan.pieces == 0
    straight = np.where(alone, spacing, crimp.straight)
    lengths = np.where(alone, crimp.length, crimp.straight)
    count = (2 * pieces + plan.straight).ravel()

    gap = np.repeat(np.arange(count.size), count)
    step = np.arange(gap.size) - (np.cumsum(count) - count)[gap]
    row, column = np.divmod(gap, rise.shape[1])
    m, total = pieces.ravel()[gap], count[gap]
    second = step >= total - m
    is_straight = ~second & (step >= m)
    # Slope at the start of each part: it grows over the first arc and falls over the second.
    theta = crimp.theta.ravel()[gap]
    tilt = theta * np.where(second, total - step, step) / np.maximum(m, 1)
    sign = np.sign(rise).ravel()[gap]

    # Each arc is measured inwards from the crossing at its end of the gap.
    inwards = np.where(second, -1.0, 1.0)
    owner = column + second
    bend = np.where(second, end.ravel()[gap], begin.ravel()[gap])
    along = bounds[row, owner] + inwards * bend * np.sin(tilt) / stretch.ravel()[gap]
    z = height[row, owner] + inwards * sign * bend * 2.0 * np.sin(0.5 * tilt) ** 2
    turn = np.where(is_straight, 0.0, theta / np.maximum(m, 1))
    length = np.where(is_straight, lengths.ravel()[gap], bend * turn)
    curvature = np.where(is_straight, 0.0, inwards * sign / bend)
    if exact:
        handle, weight = rational_handles(turn)
    else:
        handle, weight = 4.0 / 3.0 * np.tan(0.25 * turn), np.ones(1)
    reach = np.where(is_straight, straight.ravel()[gap] / 3.0, handle * bend)

    parts = count.reshape(rise.shape).sum(axis=1)
    last = np.cumsum(parts) + np.arange(len(parts))
    start = np.arange(len(row)) + row

    def with_last(of_parts: Floats, at_ends: ArrayLike) -> Floats:
        full = np.empty(len(start) + len(last))
        full[start], full[last] = of_parts, at_ends
        return full

    swelling = None
    if floats is not None:
        swelling = np.zeros((2, len(start) + len(last)))
        inner = np.s_[:, 1:-1]
        one, other = begin[inner], end[inner]
        shape = straight[inner], crimp.theta[inner], 2.0 * radius[:, None], growth.rise
        before = measure_float_ends(one, other, *shape)
        after = measure_float_ends(other, one, *shape)
        share = share_along_floats(floats, spacing[inner], before, after, growth.short)
        at_bounds = np.stack(
            [np.pad(share[0], ((0, 0), (1, 1)), mode="edge"), np.pad(share[1], ((0, 0), (1, 1)))]
        )
        swelling[:, start] = np.where(step == 0, at_bounds[:, row, column], 0.0)
        swelling[:, last] = at_bounds[:, :, -1]
        # Over yarns of unequal diameters a float has arcs: there the share runs between its ends.
        same = np.pad(floats[:, 1:] == floats[:, :-1], ((0, 0), (1, 1)), constant_values=True)
        within = np.flatnonzero(same[row, column] & (step > 0))
        if len(within):
            r, c = row[within], column[within]
            t = (along[within] - bounds[r, c]) / (bounds[r, c + 1] - bounds[r, c])
            mixed = at_bounds[:, r, c] * (1.0 - t) + at_bounds[:, r, c + 1] * t
            swelling[0, start[within]] = mixed[0]
            swelling[1, start[within]] = mixed[1]
    return Axes(
        radius,
        lateral,
        parts,
        along=with_last(along, bounds[:, -1]),
        height=with_last(z, height[:, -1]),
        angle=with_last(sign * tilt, 0.0),
        length=length,
        curvature=np.broadcast_to(curvature, (2, len(curvature))),
        reach=np.broadcast_to(reach, (2, len(reach))),
        weight=weight,
        cubic=False,
        swelling=swelling,
    )
