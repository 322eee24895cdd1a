"""Axes of yarns by arcs and straights, which hold every yarn at touching distance.

Where a yarn changes side between two crossings its axis runs arc - straight - arc; where it
floats over yarns of one diameter, and past its last crossing, it is straight and horizontal. Over
yarns of unequal diameters a float too runs arc - straight - arc, between unequal heights.

Why yarns touch at every crossing and overlap nowhere:

- With arcs of radius R = (d + d_i)/2 about the yarn crossed, warp and weft axes are R apart at each
  crossing and nowhere nearer: with x, y, f, g measured from it, ``y**2 + (R - f)**2 >= R**2`` and
  ``x**2 + (R - g)**2 >= R**2`` give ``x**2 + y**2 + (R - f - g)**2 >= R**2 + 2 f g``. (Where one
  yarn moves away, f < 0, the other alone keeps the distance, for g > R only where x > R.)
- A racetrack is all circles with centres on its flat. Distances to it are those to the circles with
  x and y shortened by half the flat: so the same holds where axes stay straight on the flats.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45.
"""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.fabric.axis import Axes, crossing_heights
from spacemap_vtk.fabric.bezier import rational_handles
from spacemap_vtk.fabric.peirce import solve
from spacemap_vtk.fabric.threads import Yarns

#: Longer arcs are split: one cubic misses the radius by 2.4e-5 at this angle, 2.7e-4 at 90 degrees.
LONGEST_ARC = pi / 3
#: Below this angle (rad) an arc is left out. Its patches would be slivers, and the straight cubic
#: that takes their place is off by less than this times the height.
FLAT = 1e-7


def arc_axes(
    upper: NDArray[np.bool_],
    own: Yarns,
    crossed: Yarns,
    share: float,
    overhang: float,
    exact: bool,
) -> Axes:
    """Lay axes that run arc - straight - arc between crossings."""
    arc, height = crossing_heights(upper, own, crossed, share)
    position, room = crossed.position, crossed.spacing
    half = 0.5 * crossed.flat
    ends = position[0] - overhang, position[-1] + overhang
    if crossed.aspect > 1.0:
        # straight over each flat; a yarn may be cut on the first and on the last
        flat = crossed.flat.copy()
        flat[[0, -1]] -= np.maximum(half[[0, -1]] - overhang, 0.0) * (1 + (len(flat) == 1))
        position = np.stack([position - half, position + half], axis=1).ravel()
        position[[0, -1]] = np.maximum(position[0], ends[0]), np.minimum(position[-1], ends[1])
        inner = np.empty(len(position) - 1)
        inner[::2], inner[1::2] = flat, room - half[1:] - half[:-1]
        height, arc = np.repeat(height, 2, axis=1), np.repeat(arc, 2, axis=1)
    else:
        inner = room
    past = np.maximum(overhang - half[[0, -1]], 0.0)
    return lay(
        radius=0.5 * own.diameter,
        lateral=own.position,
        bounds=np.concatenate([ends[:1], position, ends[1:]]),
        spacing=np.concatenate([past[:1], inner, past[1:]]),
        height=np.pad(height, ((0, 0), (1, 1)), mode="edge"),
        arc=np.pad(arc, ((0, 0), (1, 1)), mode="edge"),
        exact=exact,
    )


def lay(
    radius: NDArray[np.float64],
    lateral: NDArray[np.float64],
    bounds: NDArray[np.float64],
    spacing: NDArray[np.float64],
    height: NDArray[np.float64],
    arc: NDArray[np.float64],
    exact: bool = False,
) -> Axes:
    """Cut axes into parts, from what is known at the bounds of their gaps."""
    # A gap is what lies between neighbouring crossings, or past the last one, or on a flat.
    # Peirce's formulas hold in each with the sum of the radii of its two arcs for D.
    rise = np.diff(height, axis=1)
    crimp = solve(spacing, np.abs(rise), arc[:, :-1] + arc[:, 1:])
    flat = crimp.theta < FLAT
    # one rounding above 60 degrees is 60 degrees: jammed square cloth
    longest = 2.0 * LONGEST_ARC if exact else LONGEST_ARC
    pieces = np.where(flat, 0, np.ceil(crimp.theta / longest - 1e-9).astype(np.int64))
    straight = np.where(flat, spacing, crimp.straight)
    has_straight = (straight > 0.0).astype(np.int64)
    count = (2 * pieces + has_straight).ravel()

    gap = np.repeat(np.arange(count.size), count)
    step = np.arange(gap.size) - (np.cumsum(count) - count)[gap]
    row, column = np.divmod(gap, rise.shape[1])
    m, total = pieces.ravel()[gap], count[gap]
    second = step >= total - m
    is_straight = ~second & (step >= m)
    # slope at the start of each part: it grows over the first arc and falls over the second
    theta = crimp.theta.ravel()[gap]
    tilt = theta * np.where(second, total - step, step) / np.maximum(m, 1)
    sign = np.sign(rise).ravel()[gap]

    # each arc is measured from the crossing that it belongs to, seen inwards from it
    inwards = np.where(second, -1.0, 1.0)
    owner = column + second
    bend = arc[row, owner]
    along = bounds[owner] + inwards * bend * np.sin(tilt)
    z = height[row, owner] + inwards * sign * bend * 2.0 * np.sin(0.5 * tilt) ** 2
    turn = np.where(is_straight, 0.0, theta / np.maximum(m, 1))
    length = np.where(is_straight, straight.ravel()[gap], bend * turn)
    curvature = np.where(is_straight, 0.0, inwards * sign / bend)
    if exact:
        handle, weight = rational_handles(turn)
    else:
        handle, weight = 4.0 / 3.0 * np.tan(0.25 * turn), np.ones(1)
    reach = np.where(is_straight, length / 3.0, handle * bend)

    parts = count.reshape(rise.shape).sum(axis=1)
    last = np.cumsum(parts) + np.arange(len(parts))
    start = np.arange(len(row)) + row

    def with_last(of_parts: NDArray[np.float64], at_ends: ArrayLike) -> NDArray[np.float64]:
        full = np.empty(len(start) + len(last))
        full[start], full[last] = of_parts, at_ends
        return full

    return Axes(
        radius,
        lateral,
        parts,
        along=with_last(along, bounds[-1]),
        height=with_last(z, height[:, -1]),
        angle=with_last(sign * tilt, 0.0),
        length=length,
        curvature=np.broadcast_to(curvature, (2, len(curvature))),
        reach=np.broadcast_to(reach, (2, len(reach))),
        weight=weight,
        cubic=False,
    )
