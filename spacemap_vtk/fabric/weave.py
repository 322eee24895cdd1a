"""Geometry of a woven cloth: round yarns along Peirce's axes, as bicubic Bézier patches.

Ends (warp yarns) run along y and are spread along x, picks (weft yarns) run along x and are
spread along y, z is the cloth normal, and the cloth is centred on the origin. Where a yarn
changes side between two crossings its axis runs arc - straight - arc; where it floats, and past
its last crossing, it is straight and horizontal.

Invariants that everything below relies on:

- Every part of an axis (arc or straight) is four patches round the yarn, and has three rings of
  12 control points; its fourth ring is the first of the next part, or the yarn's final ring. So
  part q of a family, on yarn y, starts at ring 3 q + y and at station q + y.
- An arc is a surface of revolution: each control point turns about the arc's axis at its own
  distance rho, with a handle of 4/3 tan(angle/4) rho. A handle of the same length for all of them
  would break the tangent plane where an arc meets a straight.
- rho is affine in the point's place on the yarn's cross-section, so a whole ring is
  ``axis + cos E + sin B`` with two vectors per ring: that is why no loop is needed.
- With arcs of radius D/2 about the yarn crossed, warp and weft axes are D/2 apart at each crossing
  and nowhere nearer: with x, y, f, g measured from it, ``y**2 + (R - f)**2 >= R**2`` and
  ``x**2 + (R - g)**2 >= R**2`` give ``x**2 + y**2 + (R - f - g)**2 >= R**2 + 2 f g``.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.bezier import arc_handle, quadrilateral_order
from spacemap_vtk.fabric.peirce import Cloth, Crimp, Family, solve

#: Control points in a ring: four cubic quarter arcs that share their ends.
RING = 12
#: Longer arcs are split: one cubic misses the radius by 2.4e-5 at this angle, 2.7e-4 at 90 degrees.
LONGEST_ARC = pi / 3
#: Below this angle (rad) an arc is left out. Its patches would be slivers, and the straight cubic
#: that takes their place is off by less than this times the height.
_FLAT = 1e-7


@dataclass(frozen=True, eq=False)
class Weave:
    """A cloth as bicubic Bézier patches.

    Attributes
    ----------
    points : (N, 3) float64
        Control points in metres, 12 a ring; shared inside a yarn, not between yarns.
    patches : (P, 16) int64
        Control points of each patch in the order of ``VTK_BEZIER_QUADRILATERAL``, degree 3 x 3:
        u along the yarn, v round it, du x dv outwards. Yarn by yarn, part by part, four round.
    yarn : (P,) int32
        Yarn of each patch: the ends first, then the picks.
    family : (P,) uint8
        0 warp, 1 weft.
    warp, weft : Crimp
        Peirce's figures of each family, where a yarn changes side.
    radial_error : float
        Bound of the surface's distance from the true tube, over the yarn's radius: the cubics'
        error round the yarn and along its arcs together.
    """

    points: NDArray[np.float64]
    patches: NDArray[np.int64]
    yarn: NDArray[np.int32]
    family: NDArray[np.uint8]
    warp: Crimp
    weft: Crimp
    radial_error: float


def build(drawdown: ArrayLike, cloth: Cloth) -> Weave:
    """Return the patches of a cloth.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        First pick and first end first; True: the end lies over the pick.
    cloth : Cloth
        Diameters, spacings, crimp height and overhang.

    Returns
    -------
    Weave
        Control points and patches.

    Raises
    ------
    InputError
        The drawdown is no matrix, or a yarn has no length (one crossing and no overhang).

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> weave = build([[1, 0], [0, 1]], cloth)
    >>> weave.points.shape, weave.patches.shape
    ((768, 3), (80, 16))
    """
    paths = _paths(drawdown, cloth)
    parts = [int(path.parts.sum()) for path in paths]
    yarns = [len(path.parts) for path in paths]
    rings = [3 * p + y for p, y in zip(parts, yarns, strict=True)]
    points = np.empty((sum(rings), RING, 3))
    patches = np.empty((sum(parts), 4, 16), dtype=np.int64)
    yarn = np.empty((sum(parts), 4), dtype=np.int32)
    family = np.empty((sum(parts), 4), dtype=np.uint8)
    ring = part = first_yarn = 0
    for number, path in enumerate(paths):
        here = slice(part, part + parts[number])
        _fill_points(path, number, points[ring : ring + rings[number]])
        owner = np.repeat(np.arange(yarns[number]), path.parts)
        first_ring = ring + 3 * np.arange(parts[number]) + owner
        np.add(RING * first_ring[:, None, None], _patch_table(), out=patches[here])
        yarn[here] = (first_yarn + owner)[:, None]
        family[here] = number
        ring, part, first_yarn = ring + rings[number], here.stop, first_yarn + yarns[number]
    return Weave(
        points.reshape(-1, 3),
        patches.reshape(-1, 16),
        yarn.ravel(),
        family.ravel(),
        warp=cloth.families[0].crimp,
        weft=cloth.families[1].crimp,
        radial_error=max(_radial_error(path) for path in paths),
    )


def axis_points(
    drawdown: ArrayLike, cloth: Cloth, samples: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return points on the exact axes of the yarns, which the patches approximate.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        As for `build`.
    cloth : Cloth
        As for `build`.
    samples : int
        Points on each part of an axis (arc or straight), its end not counted; at least 1. The
        crossings are always among them.

    Returns
    -------
    points : (n, 3) float64
        In metres, in order along each yarn.
    yarn : (n,) int32
        Yarn of each point, as in `Weave.yarn`.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> points, yarn = axis_points([[1]], cloth, samples=1)
    >>> points[yarn == 0].round(9).tolist()
    [[0.0, -0.1, 0.05], [0.0, 0.0, 0.05], [0.0, 0.1, 0.05]]
    """
    result, owners, first_yarn = [], [], 0
    for number, path in enumerate(_paths(drawdown, cloth)):
        start, last, owner = _stations(path)
        count = np.full(path.along.size, samples)
        count[last] = 1
        station = np.repeat(np.arange(path.along.size), count)
        step = np.arange(station.size) - (np.cumsum(count) - count)[station]
        # a yarn's last station starts no part: it stays where it is
        length, curvature = np.zeros((2, path.along.size))
        length[start], curvature[start] = path.length, path.curvature
        s, k, a = length[station] * step / samples, curvature[station], path.angle[station]
        # chord of an arc of angle k s: 2 sin(k s / 2) / k long, in the direction of its middle
        chord = s * np.sinc(0.5 * k * s / pi)
        points = np.empty((station.size, 3))
        of_station = np.empty(path.along.size, dtype=np.int32)
        of_station[start], of_station[last] = owner, np.arange(len(last))
        points[:, 1 - number] = path.along[station] + chord * np.cos(a + 0.5 * k * s)
        points[:, number] = path.lateral[of_station[station]]
        points[:, 2] = path.height[station] + chord * np.sin(a + 0.5 * k * s)
        result.append(points)
        owners.append(of_station[station] + np.int32(first_yarn))
        first_yarn += len(last)
    return np.concatenate(result), np.concatenate(owners)


def estimate_bytes(ends: int, picks: int, parts_per_gap: int = 5) -> int:
    """Return an upper bound of the memory that `build` needs, before any is taken.

    Parameters
    ----------
    ends, picks : int
        Size of the cloth.
    parts_per_gap : int
        Parts of an axis between neighbouring crossings: at most 5 (arcs of more than 60 degrees
        are split), 3 for other cloth, 1 in a float.

    Returns
    -------
    int
        Bytes at the peak: the result, and the temporary arrays of one family.

    Examples
    --------
    >>> estimate_bytes(1000, 1000, parts_per_gap=3) < 12e9
    True
    """
    parts = [
        yarns * (parts_per_gap * (crossings - 1) + 2)
        for yarns, crossings in ((ends, picks), (picks, ends))
    ]
    rings = 3 * sum(parts) + ends + picks
    result = rings * RING * 3 * 8 + sum(parts) * 4 * (16 * 8 + 4 + 1)
    return result + _PART_BYTES * sum(parts) + _GAP_BYTES * 2 * (ends + 1) * (picks + 1)


def fabric_figures(
    drawdown: ArrayLike, cloth: Cloth, density: float | None = None
) -> dict[str, Any]:
    """Return the figures by which a cloth is judged.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        As for `build`.
    cloth : Cloth
        As for `build`.
    density : float, optional
        Density of the yarns, the air between their fibres included, in kg/m3.

    Returns
    -------
    dict
        ``ends`` and ``picks``; under ``warp`` and ``weft``

        - ``theta_deg``, ``length`` (m), ``crimp``, ``height`` (m): Peirce's figures where a yarn
          changes side;
        - ``mean_crimp``: floats included, the crimp times the share of the gaps between crossings
          in which the yarn changes side;
        - ``cover``: K = d / p;
        - ``yarn_length``: all yarns of the family as built, overhang included (m);

        and of the cloth, away from its edges

        - ``thickness``: max(h1 + d1, h2 + d2) (m);
        - ``cover``: K1 + K2 - K1 K2, the share of the plane that the yarns cover;
        - ``volume_fraction``: V / thickness, with the volume of yarn per area
          V = pi/4 (d1**2 (1 + c1) / p1 + d2**2 (1 + c2) / p2) and the mean crimps;
        - ``areal_mass``: density V (kg/m2), None without a density.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> figures = fabric_figures([[1, 0], [0, 1]], cloth)
    >>> figures["thickness"], figures["cover"]
    (0.2, 0.75)
    """
    over = _checked(drawdown, cloth)
    result: dict[str, Any] = {"ends": over.shape[1], "picks": over.shape[0]}
    volume = 0.0
    for name, family, side in zip(("warp", "weft"), cloth.families, (over.T, over), strict=True):
        yarns, gaps = len(side), side.size - len(side)
        changes = int(np.count_nonzero(side[:, 1:] != side[:, :-1]))
        crimp = float(family.crimp.crimp)
        mean = crimp * changes / max(gaps, 1)
        result[name] = {
            "theta_deg": float(np.degrees(family.crimp.theta)),
            "length": float(family.crimp.length),
            "crimp": crimp,
            "height": family.height,
            "mean_crimp": mean,
            "cover": family.diameter / family.spacing,
            "yarn_length": 2 * yarns * family.overhang + gaps * family.crossed * (1.0 + mean),
        }
        volume += 0.25 * pi * family.diameter**2 * (1.0 + mean) / family.spacing
    thickness = max(family.height + family.diameter for family in cloth.families)
    k1, k2 = result["warp"]["cover"], result["weft"]["cover"]
    result["thickness"] = thickness
    result["cover"] = k1 + k2 - k1 * k2
    result["volume_fraction"] = volume / thickness
    result["areal_mass"] = None if density is None else density * volume
    return result


#: Working memory of `build`, per part and per gap of all yarns, measured and rounded up.
_PART_BYTES, _GAP_BYTES = 200, 200


class _Path(NamedTuple):
    """The axes of one family, cut into parts; stations are the parts' ends."""

    radius: NDArray[np.float64]
    """(yarns,) Radius of each yarn."""
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
    """(parts,) 0 in a straight part, above 0 where the axis turns upwards."""


def _checked(drawdown: ArrayLike, cloth: Cloth) -> NDArray[np.bool_]:
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


def _paths(drawdown: ArrayLike, cloth: Cloth) -> tuple[_Path, _Path]:
    over = _checked(drawdown, cloth)
    warp, weft = cloth.families
    arc = 0.5 * cloth.diameter_sum
    return _family_path(over.T, warp, arc), _family_path(~over, weft, arc)


def _family_path(upper: NDArray[np.bool_], family: Family, arc: float) -> _Path:
    """Lay the axes of the yarns whose side at each crossing is given as (yarns, crossings)."""
    yarns, crossings = upper.shape
    position = family.crossed * (np.arange(crossings) - 0.5 * (crossings - 1))
    height = np.where(upper, 0.5 * family.height, -0.5 * family.height)
    spacing = np.full(crossings + 1, family.crossed)
    spacing[[0, -1]] = family.overhang
    return _lay(
        radius=np.full(yarns, 0.5 * family.diameter),
        lateral=family.spacing * (np.arange(yarns) - 0.5 * (yarns - 1)),
        bounds=np.concatenate(
            [[position[0] - family.overhang], position, [position[-1] + family.overhang]]
        ),
        spacing=spacing,
        height=np.pad(height, ((0, 0), (1, 1)), mode="edge"),
        arc=np.full((1, crossings + 2), arc),
    )


def _lay(
    radius: NDArray[np.float64],
    lateral: NDArray[np.float64],
    bounds: NDArray[np.float64],
    spacing: NDArray[np.float64],
    height: NDArray[np.float64],
    arc: NDArray[np.float64],
) -> _Path:
    """Cut axes into parts, from what is known at the bounds of their gaps.

    A gap is what lies between neighbouring crossings, or past the last one. Peirce's formulas hold
    in each with the sum of the radii of its two arcs for D, so `height` and `arc`, of shape (yarns
    or 1, bounds), may differ from crossing to crossing.
    """
    rise = np.diff(height, axis=1)
    crimp = solve(spacing, np.abs(rise), arc[:, :-1] + arc[:, 1:])
    flat = crimp.theta < _FLAT
    # one rounding above 60 degrees is 60 degrees: jammed square cloth
    pieces = np.where(flat, 0, np.ceil(crimp.theta / LONGEST_ARC - 1e-9).astype(np.int64))
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
    bend = np.broadcast_to(arc, height.shape)[row, owner]
    along = bounds[owner] + inwards * bend * np.sin(tilt)
    z = height[row, owner] + inwards * sign * bend * 2.0 * np.sin(0.5 * tilt) ** 2
    path = _Path(
        radius,
        lateral,
        parts=count.reshape(rise.shape).sum(axis=1),
        along=along,
        height=z,
        angle=sign * tilt,
        length=np.where(is_straight, straight.ravel()[gap], bend * theta / np.maximum(m, 1)),
        curvature=np.where(is_straight, 0.0, inwards * sign / bend),
    )
    return path._replace(
        along=_with_last(path, along, bounds[-1]),
        height=_with_last(path, z, height[:, -1]),
        angle=_with_last(path, path.angle, 0.0),
    )


def _with_last(path: _Path, of_parts: NDArray[np.float64], at_ends: ArrayLike) -> NDArray:
    start, last, _ = _stations(path)
    full = np.empty(len(start) + len(last))
    full[start], full[last] = of_parts, at_ends
    return full


def _stations(
    path: _Path,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the station at which each part starts, the last of each yarn, and each part's yarn."""
    owner = np.repeat(np.arange(len(path.parts)), path.parts)
    last = np.cumsum(path.parts) + np.arange(len(path.parts))
    return np.arange(len(owner)) + owner, last, owner


def _fill_points(path: _Path, number: int, points: NDArray[np.float64]) -> None:
    """Write the control points of a family, (rings, 12, 3).

    Rings 1 and 2 of a part are rings 0 and 3 moved along the tangents there by
    ``4/3 tan(angle/4) rho`` with ``rho = 1/|curvature| -+ r cos``, that is ``a (1 - curvature r
    cos)`` with ``a = 4/3 tan(angle/4) / |curvature|``, or a third of the length of a straight.
    """
    start, last, owner = _stations(path)
    turn = np.abs(path.curvature)
    reach = np.divide(
        4.0 / 3.0 * np.tan(0.25 * turn * path.length), turn, out=path.length / 3.0, where=turn > 0.0
    )
    cos, sin = _circle()
    rings = 3 * np.arange(len(owner)) + owner
    lateral = np.empty(len(points))
    radius = np.empty(len(points))
    lateral[rings + 1] = lateral[rings + 2] = lateral[rings] = path.lateral[owner]
    radius[rings + 1] = radius[rings + 2] = radius[rings] = path.radius[owner]
    final = 3 * np.cumsum(path.parts) + np.arange(len(last))
    lateral[final], radius[final] = path.lateral, path.radius
    # v runs so that du x dv points outwards: the other way for yarns along y
    side = -1.0 if number == 0 else 1.0
    np.multiply(side * radius[:, None], sin, out=points[:, :, number])
    points[:, :, number] += lateral[:, None]

    axis, spread = np.empty(len(points)), np.empty(len(points))
    tangent = np.cos(path.angle), np.sin(path.angle)
    normal = -tangent[1], tangent[0]
    stretch = reach * path.curvature * path.radius[owner]
    for direction, place, component in ((0, path.along, 1 - number), (1, path.height, 2)):
        t, n = tangent[direction], normal[direction]
        axis[rings], axis[final] = place[start], place[last]
        axis[rings + 1] = place[start] + reach * t[start]
        axis[rings + 2] = place[start + 1] - reach * t[start + 1]
        r = path.radius[owner]
        spread[rings], spread[final] = r * n[start], path.radius * n[last]
        spread[rings + 1] = r * n[start] - stretch * t[start]
        spread[rings + 2] = r * n[start + 1] + stretch * t[start + 1]
        np.multiply(spread[:, None], cos, out=points[:, :, component])
        points[:, :, component] += axis[:, None]


def _circle() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the 12 control points of a unit circle of four cubic quarter arcs."""
    k = arc_handle(0.5 * pi)
    cos = np.array([1.0, 1.0, k, 0.0, -k, -1.0, -1.0, -1.0, -k, 0.0, k, 1.0])
    return cos, np.roll(cos, 3)


def _patch_table() -> NDArray[np.int64]:
    """Return the control points of the four patches of the part at ring 0, (4, 16) in VTK order."""
    quarter, j, i = np.ogrid[:4, :4, :4]
    tensor = (RING * i + (3 * quarter + j) % RING).reshape(4, 16)
    table = np.empty_like(tensor)
    table[:, quadrilateral_order(3, 3)] = tensor
    return table


def _radial_error(path: _Path) -> float:
    turn = np.abs(path.curvature)
    error = _cubic_error(0.5 * pi)
    if turn.any():
        # along an arc the distance to the arc's axis is off, which is at most its radius + r
        reach = 1.0 / turn[turn > 0.0].min() + path.radius.max()
        error += _cubic_error((turn * path.length).max()) * reach / path.radius.min()
    return float(error)


def _cubic_error(angle: float) -> float:
    """Return the largest radial error of one cubic for an arc: its square is off by 4/27 s6/c2."""
    s, c = np.sin(0.25 * angle), np.cos(0.25 * angle)
    return float(np.sqrt(1.0 + 4.0 / 27.0 * s**6 / c**2) - 1.0)
