"""Axes of yarns, cut into parts: arcs and straights that hold every yarn at touching distance.

Where a yarn changes side between two crossings its axis runs arc - straight - arc; where it
floats over yarns of one diameter, and past its last crossing, it is straight and horizontal. Over
yarns of unequal diameters a float too runs arc - straight - arc, between unequal heights.

Invariants that everything above relies on:

- Part q of a family, on its yarn y, runs from station q + y to station q + y + 1.
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
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.bezier import bernstein, rational_handles
from spacemap_vtk.fabric.cloth import Cloth, Yarns
from spacemap_vtk.fabric.peirce import solve

#: Longer arcs are split: one cubic misses the radius by 2.4e-5 at this angle, 2.7e-4 at 90 degrees.
LONGEST_ARC = pi / 3
#: Below this angle (rad) an arc is left out. Its patches would be slivers, and the straight cubic
#: that takes their place is off by less than this times the height.
_FLAT = 1e-7


class Axes(NamedTuple):
    """The axes of one family, cut into parts; stations are the parts' ends."""

    radius: NDArray[np.float64]
    """(yarns,) Half the height of each yarn's section."""
    lateral: NDArray[np.float64]
    """(yarns,) Position of the plane in which each yarn runs."""
    parts: NDArray[np.int64]
    """(yarns,) Number of parts."""
    along: NDArray[np.float64]
    """(stations,) Position along the yarn."""
    height: NDArray[np.float64]
    """(stations,) Position in z."""
    angle: NDArray[np.float64]
    """(stations,) Slope of the axis, in radians."""
    length: NDArray[np.float64]
    """(parts,)"""
    curvature: NDArray[np.float64]
    """(2, parts) At start and end of each part, above 0 where the axis turns upwards."""
    reach: NDArray[np.float64]
    """(2, parts) Handles of the cubic that stands for each part, at its start and end."""
    weight: NDArray[np.float64]
    """(parts,) Rational weight of the two inner control points; (1,) where all are 1."""
    cubic: bool
    """Whether parts are these cubics, and not arcs and straights."""

    @property
    def owner(self) -> NDArray[np.int64]:
        """(parts,) Yarn of each part."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @property
    def last(self) -> NDArray[np.int64]:
        """(yarns,) Last station of each yarn."""
        return np.cumsum(self.parts) + np.arange(len(self.parts))

    def at(
        self, part: NDArray[np.int64], station: NDArray[np.int64], fraction: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return places on the axes.

        Parameters
        ----------
        part, station : (n,) int64
            Part of each place, and the station at which that starts.
        fraction : (n,) float64
            How far along the part, from 0 to 1.

        Returns
        -------
        along, height, angle : (n,) float64
            In m, m and radians.
        """
        place, slope = (self.along, self.height), self.angle
        if self.cubic:
            weights = bernstein(3, fraction).T
            hodograph = bernstein(2, fraction).T
            found, speed = [], []
            for values, direction in zip(place, (np.cos, np.sin), strict=True):
                a, d = values[station], values[station + 1]
                b = a + self.reach[0, part] * direction(slope[station])
                c = d - self.reach[1, part] * direction(slope[station + 1])
                found.append(sum(w * v for w, v in zip(weights, (a, b, c, d), strict=True)))
                speed.append(
                    sum(w * v for w, v in zip(hodograph, (b - a, c - b, d - c), strict=True))
                )
            return found[0], found[1], np.arctan2(speed[1], speed[0])
        s, k, a = self.length[part] * fraction, self.curvature[0, part], slope[station]
        # chord of an arc of angle k s: 2 sin(k s / 2) / k long, in the direction of its middle
        chord, middle = s * np.sinc(0.5 * k * s / pi), a + 0.5 * k * s
        straight = k == 0.0
        along, height = (
            np.where(
                straight,
                (1.0 - fraction) * values[station] + fraction * values[station + 1],
                values[station] + chord * direction(middle),
            )
            for values, direction in zip(place, (np.cos, np.sin), strict=True)
        )
        return along, height, a + k * s


def checked(drawdown: ArrayLike, cloth: Cloth) -> NDArray[np.bool_]:
    """Return a drawdown as a matrix, and refuse one that is none.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        First pick and first end first; True: the end lies over the pick.
    cloth : Cloth
        What will be woven.

    Returns
    -------
    (picks, ends) bool
        The same.

    Raises
    ------
    InputError
        The drawdown is no matrix, or a yarn has no length (one crossing and no overhang).
    """
    over = np.asarray(drawdown, dtype=bool)
    if over.ndim != 2 or over.size == 0:
        raise InputError(
            f"a drawdown is a matrix of at least one pick and one end, not one of {over.shape}",
            key="drawdown",
            cure="Give a row for each pick and a column for each end",
        )
    if cloth.overhang == 0.0 and min(over.shape) == 1:
        raise InputError(
            "a yarn with one crossing needs an overhang",
            key="overhang",
            value=0.0,
            allowed="more than 0 m",
        )
    return over


def axes(drawdown: ArrayLike, cloth: Cloth) -> tuple[Axes, Axes]:
    """Return the axes of warp and weft.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        First pick and first end first; True: the end lies over the pick.
    cloth : Cloth
        Its measures.

    Returns
    -------
    warp, weft : Axes
        Ends and picks, first first.

    Raises
    ------
    InputError
        See `checked`; or the cloth has measures for another number of yarns.
    """
    over = checked(drawdown, cloth)
    warp, weft = cloth.yarns("warp", over.shape[1]), cloth.yarns("weft", over.shape[0])
    past = [family.overhang for family in cloth.families]
    share = cloth.share
    if cloth.axis == "spline":
        from spacemap_vtk.fabric.spline import spline_axes

        return (
            spline_axes(over.T, warp, weft, share, past[0]),
            spline_axes(~over, weft, warp, 1.0 - share, past[1]),
        )
    return (
        _family_axes(over.T, warp, weft, share, past[0], cloth.exact),
        _family_axes(~over, weft, warp, 1.0 - share, past[1], cloth.exact),
    )


def crossing_heights(
    upper: NDArray[np.bool_], own: Yarns, crossed: Yarns, share: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far apart axes are at each crossing, and where the family's own are.

    Parameters
    ----------
    upper : (yarns, crossings) bool
        Whether the yarn lies above the one that it crosses.
    own, crossed : Yarns
        The family, and the one that it crosses.
    share : float
        Share of the distance that the family takes.

    Returns
    -------
    arc, height : (yarns, crossings) float64
        Distance of the axes, and height of the family's own, in m.
    """
    arc = 0.5 * (own.diameter[:, None] + crossed.diameter)
    return arc, np.where(upper, share, -share) * arc


def _family_axes(
    upper: NDArray[np.bool_],
    own: Yarns,
    crossed: Yarns,
    share: float,
    overhang: float,
    exact: bool,
) -> Axes:
    """Lay the axes of the yarns whose side at each crossing is given as (yarns, crossings)."""
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
    """Cut axes into parts, from what is known at the bounds of their gaps.

    A gap is what lies between neighbouring crossings, or past the last one, or on a flat. Peirce's
    formulas hold in each with the sum of the radii of its two arcs for D.

    Parameters
    ----------
    radius, lateral : (yarns,) float64
        As in `Axes`.
    bounds : (n,) float64
        Where gaps begin and end along the yarns, in m.
    spacing : (n - 1,) float64
        The differences of `bounds`, given so that they keep all their digits.
    height, arc : (yarns, n) float64
        Height of the axes there, and radius of the arcs, in m.
    exact : bool
        Whether arcs become rational cubics, which need not be split.

    Returns
    -------
    Axes
        Parts of no length are left out.
    """
    rise = np.diff(height, axis=1)
    crimp = solve(spacing, np.abs(rise), arc[:, :-1] + arc[:, 1:])
    flat = crimp.theta < _FLAT
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


def axis_points(
    drawdown: ArrayLike, cloth: Cloth, samples: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return points on the exact axes of the yarns, which the patches approximate.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        As for `axes`.
    cloth : Cloth
        As for `axes`.
    samples : int
        Points on each part of an axis (arc or straight), its end not counted; at least 1, even for
        flattened yarns. Crossings are always among them.

    Returns
    -------
    points : (n, 3) float64
        In metres, in order along each yarn.
    yarn : (n,) int32
        Yarn of each point, the ends first, then the picks.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> points, yarn = axis_points([[1]], cloth, samples=1)
    >>> points[yarn == 0].round(9).tolist()
    [[0.0, -0.1, 0.05], [0.0, 0.0, 0.05], [0.0, 0.1, 0.05]]
    """
    result, owners, first_yarn = [], [], 0
    for number, family in enumerate(axes(drawdown, cloth)):
        part, station, fraction = sampled(family, samples)
        points = np.empty((len(part), 3))
        points[:, 1 - number], points[:, 2], _ = family.at(part, station, fraction)
        yarn = station - part
        points[:, number] = family.lateral[yarn]
        result.append(points)
        owners.append((first_yarn + yarn).astype(np.int32))
        first_yarn += len(family.parts)
    return np.concatenate(result), np.concatenate(owners)


def sampled(
    family: Axes, samples: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return places all along the axes of a family, yarn by yarn.

    Parameters
    ----------
    family : Axes
        Warp or weft.
    samples : int
        Places on each part, its end not counted.

    Returns
    -------
    part, station : (n,) int64
        Part of each place, and the station at which that starts; their difference is the yarn.
    fraction : (n,) float64
        How far along the part; 1 at the end of a yarn, else less.
    """
    count = np.full(len(family.length), samples)
    count[np.cumsum(family.parts) - 1] += 1
    part = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(part)) - (np.cumsum(count) - count)[part]
    return part, (np.arange(len(count)) + family.owner)[part], step / samples
