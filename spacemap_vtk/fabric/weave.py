"""Geometry of a woven cloth: yarns of any section along their axes, as bicubic Bézier patches.

Ends (warp yarns) run along y and are spread along x, picks (weft yarns) run along x and are
spread along y, z is the cloth normal, and the cloth is centred on the origin. The axes are those of
`spacemap_vtk.fabric.axes`.

Invariants that everything below relies on:

- Every part of an axis (arc or straight) has as many patches round the yarn as the section has
  cubics, and three rings of control points; its fourth ring is the first of the next part, or the
  yarn's final ring. So part q of a family, on yarn y, starts at ring 3 q + y and at station q + y.
- An arc is a surface of revolution: each control point turns about the arc's axis at its own
  distance rho, with a handle of 4/3 tan(angle/4) rho. A handle of the same length for all of them
  would break the tangent plane where an arc meets a straight.
- rho is affine in the point's place on the yarn's cross-section, so a whole ring is
  ``axis + normal E + lateral B`` with two vectors per ring: that is why no loop is needed.
- Rational weights are products of one along the yarn and one round it, and 1 at every corner of
  every patch: so neighbours agree on the points they share.
- The tubes of warp and weft come first, the caps of all their cut ends after them.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.fabric.arcs import FLAT, LONGEST_ARC
from spacemap_vtk.fabric.axes import ALL, Share, axes, axis_points
from spacemap_vtk.fabric.axis import Axes
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.figures import fabric_figures
from spacemap_vtk.fabric.peirce import Crimp
from spacemap_vtk.fabric.section import Cap, Section, cap, cubic_error, section, tube_table
from spacemap_vtk.fabric.spline import offset_error

__all__ = [
    "LONGEST_ARC",
    "RING",
    "Cloth",
    "Counts",
    "Tubes",
    "Weave",
    "axis_points",
    "build",
    "count",
    "estimate_bytes",
    "estimate_counts",
    "fabric_figures",
]

#: Control points in a ring of a round yarn: four cubic quarter arcs that share their ends.
RING = 12
#: Working memory of `build`, per part and per gap of all yarns, measured and rounded up.
_PART_BYTES, _SPLINE_PART_BYTES, _GAP_BYTES = 150, 300, 250
#: Crossings whose parts are counted in one go: some ten megabytes.
_CROSSINGS = 20_000


class Tubes(NamedTuple):
    """Where the tubes of a family stand among the control points, to find their axes again."""

    first: int
    """First control point."""
    ring: int
    """Control points in a ring."""
    parts: NDArray[np.int64]
    """(yarns,) Parts of each yarn; yarn y has 3 parts + 1 rings."""
    aspect: float
    """Width of the section over its height."""


@dataclass(frozen=True, eq=False)
class Weave:
    """A cloth as bicubic Bézier patches."""

    #: (N, 3) Control points in metres, 12 a ring (racetracks 18); shared inside a yarn, not
    #: between yarns.
    points: NDArray[np.float64]
    #: (P, 16) Control points of each patch in the order of ``VTK_BEZIER_QUADRILATERAL``, degree 3
    #: x 3. On tubes u runs along the yarn and v round it, du x dv points outwards, everywhere.
    #: Tubes yarn by yarn, part by part, round the yarn; then caps, yarn by yarn. int64 is
    #: vtkIdType, which VTK takes over without a copy.
    patches: NDArray[np.int64]
    #: (N,) Rational weights of the control points (VTK's RationalWeights); None where all are 1.
    weights: NDArray[np.float64] | None
    #: (P,) Yarn of each patch: the ends first, then the picks.
    yarn: NDArray[np.int32]
    #: (P,) 0 warp, 1 weft.
    family: NDArray[np.uint8]
    #: Number of patches that are no caps.
    tube_patches: int
    #: (Tubes, Tubes) Where the rings of warp and weft stand in `points`.
    tubes: tuple[Tubes, Tubes]
    #: Peirce's figures of each family, where a yarn changes side, for mean measures.
    warp: Crimp
    weft: Crimp
    #: Bound of the surface's distance from the true tube, over the yarn's half height: the cubics'
    #: error round the yarn and along its arcs together; 0 for exact cloth. For splines the largest
    #: deviation found along the yarn takes the place of the bound. Of the yarns that were built.
    radial_error: float


def build(drawdown: ArrayLike, cloth: Cloth, share: Share = ALL) -> Weave:
    """Return the patches of a cloth.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        First pick and first end first; True: the end lies over the pick.
    cloth : Cloth
        Diameters, spacings, sections, crimp height and overhang.
    share : Share
        The yarns to be built, where they lie in the whole cloth; see
        `spacemap_vtk.fabric.partition.share_of`.

    Returns
    -------
    Weave
        Control points and patches.

    Raises
    ------
    InputError
        The drawdown is no matrix, a yarn has no length (one crossing and no overhang), or the
        cloth has measures for another number of yarns.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> weave = build([[1, 0], [0, 1]], cloth)
    >>> weave.points.shape, weave.patches.shape
    ((848, 3), (96, 16))
    """
    families = axes(drawdown, cloth, share)
    over = np.shape(drawdown)
    yarns = cloth.yarns("warp", over[1]), cloth.yarns("weft", over[0])
    sections = [section(y.section, y.aspect, cloth.exact) for y in yarns]
    caps = [
        cap(shape.size) if cloth.caps and len(path.parts) else None
        for path, shape in zip(families, sections, strict=True)
    ]
    numbers = (
        np.arange(over[1], dtype=np.int32)[share.ends],
        np.arange(over[1], sum(over), dtype=np.int32)[share.picks],
    )
    plans, first_point, first_patch = [], 0, 0
    for path, shape, own in zip(families, sections, yarns, strict=True):
        plans.append(
            _Plan(path, shape, Tubes(first_point, shape.size, path.parts, own.aspect), first_patch)
        )
        first_point += plans[-1].rings * shape.size
        first_patch += len(path.length) * (shape.size // 3)
    tube_points, tube_patches = first_point, first_patch
    for plan, closing in zip(plans, caps, strict=True):
        if closing is not None:
            first_point += 2 * len(plan.path.parts) * closing.new_points
            first_patch += 2 * len(plan.path.parts) * len(closing.table)

    points = np.empty((first_point, 3))
    weights = np.ones(first_point) if cloth.exact else None
    patches = np.empty((first_patch, 16), dtype=np.int64)
    yarn = np.empty(first_patch, dtype=np.int32)
    family = np.empty(first_patch, dtype=np.uint8)
    next_point, next_patch = tube_points, tube_patches
    for number, (plan, closing) in enumerate(zip(plans, caps, strict=True)):
        _fill_points(plan, number, points[plan.points])
        if weights is not None:
            _fill_weights(plan, weights[plan.points])
        here = plan.patches
        owner = plan.path.owner
        first_ring = plan.tubes.first + plan.shape.size * (3 * np.arange(len(owner)) + owner)
        table = tube_table(plan.shape.size)
        np.add(first_ring[:, None, None], table, out=patches[here].reshape(-1, *table.shape))
        yarn[here].reshape(-1, len(table))[:] = numbers[number][owner][:, None]
        family[here] = number
        if closing is not None:
            count = 2 * len(plan.path.parts)
            new = slice(next_point, next_point + count * closing.new_points)
            here = slice(next_patch, next_patch + count * len(closing.table))
            _fill_caps(plan, closing, points, weights, new, patches[here])
            yarn[here] = np.repeat(numbers[number], 2 * len(closing.table))
            family[here] = number
            next_point, next_patch = new.stop, here.stop
    return Weave(
        points,
        patches,
        weights,
        yarn,
        family,
        tube_patches,
        (plans[0].tubes, plans[1].tubes),
        warp=cloth.families[0].crimp,
        weft=cloth.families[1].crimp,
        radial_error=max(_radial_error(p.path, p.shape.error, cloth.exact) for p in plans),
    )


class Counts(NamedTuple):
    """How large the patches of a cloth are."""

    points: int
    """Control points."""
    patches: int
    parts: int
    """Of the axes of all yarns."""

    def bytes(self, exact: bool = False) -> int:
        """Return what the patches take once they are built, as `filters.WeaveSource` holds them.

        Parameters
        ----------
        exact : bool
            Whether there are rational weights.

        Returns
        -------
        int
            Of points, connectivity with offsets, yarn, family and colour.
        """
        return self.points * (4 if exact else 3) * 8 + self.patches * (16 * 8 + 8 + 4 + 4 + 3)


def estimate_counts(
    ends: int,
    picks: int,
    parts_per_gap: int = 5,
    *,
    cloth: Cloth | None = None,
    drawdown: ArrayLike | None = None,
) -> Counts:
    """Return upper bounds of the numbers of control points, patches and parts of a cloth.

    Parameters
    ----------
    ends, picks : int
        Size of the cloth.
    parts_per_gap : int
        Parts of an axis between neighbouring crossings: at most 5 for round yarns (arcs of more
        than 60 degrees are split), 3 for other cloth, 1 in a float.
    cloth : Cloth, optional
        Tells the parts, the sections and the rest; without it yarns are round, and closed.
    drawdown : (picks, ends) array_like of bool, optional
        Tells where yarns float; without it they change side between all crossings.

    Returns
    -------
    Counts
        What `build` makes, where all yarns of a family are alike and the drawdown is given, and
        but for parts of no length, which it leaves out.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> made = build([[1, 0], [0, 1]], cloth)
    >>> estimate_counts(2, 2, cloth=cloth, drawdown=[[1, 0], [0, 1]])[:2]
    (848, 96)
    >>> len(made.points), len(made.patches)
    (848, 96)
    """
    over = None if drawdown is None else np.asarray(drawdown, dtype=bool)
    parts = []
    for number, (yarns, crossings) in enumerate(((ends, picks), (picks, ends))):
        if cloth is None:
            parts.append(yarns * (parts_per_gap * (crossings - 1) + 4))
        elif cloth.axis == "spline":
            parts.append(yarns * cloth.parts_per_gap * (crossings + 1))
        else:
            flat = (cloth.weft_aspect, cloth.warp_aspect)[number] > 1.0
            changes = yarns * (crossings - 1)
            # Over yarns of unequal diameters a float bends, too.
            if over is not None and not np.ndim((cloth.weft_diameter, cloth.warp_diameter)[number]):
                changes = int(np.count_nonzero(np.diff(over, axis=number)))
            parts.append(
                yarns * (crossings + 1 + flat * crossings) + 2 * _arcs(cloth, number) * changes
            )
    return _counts((ends, picks), parts, cloth)


def count(drawdown: ArrayLike, cloth: Cloth) -> tuple[Counts, float]:
    """Return what `build` makes of a cloth, some yarns at a time and without their patches.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        As for `build`.
    cloth : Cloth
        As for `build`.

    Returns
    -------
    counts : Counts
        Of all yarns.
    radial_error : float
        As in `Weave`: the largest of the yarns'.

    Raises
    ------
    InputError
        As for `build`.

    Examples
    --------
    >>> cloth = Cloth(warp_diameter=0.1, weft_diameter=0.1, warp_spacing=0.2, weft_spacing=0.2)
    >>> count([[1, 0], [0, 1]], cloth)[0]
    Counts(points=848, patches=96, parts=20)
    """
    over = np.asarray(drawdown, dtype=bool)
    sizes = over.shape[1], over.shape[0]
    none, parts, worst = slice(0, 0), [0, 0], 0.0
    for number, (family, yarns) in enumerate(zip(("warp", "weft"), sizes, strict=True)):
        own = cloth.yarns(family, yarns)
        error = section(own.section, own.aspect, cloth.exact).error
        step = max(1, _CROSSINGS // sizes[1 - number])
        for first in range(0, yarns, step):
            some = slice(first, first + step)
            path = axes(over, cloth, Share(none, some) if number else Share(some, none))[number]
            parts[number] += len(path.length)
            worst = max(worst, _radial_error(path, error, cloth.exact))
    return _counts(sizes, parts, cloth), worst


def _counts(yarns: Sequence[int], parts: Sequence[int], cloth: Cloth | None) -> Counts:
    """Return the numbers for so many yarns and parts of both families."""
    points = patches = 0
    for number, family in enumerate(("warp", "weft")):
        kind, aspect = "circular", 1.0
        if cloth is not None:
            kind, aspect = getattr(cloth, f"{family}_section"), getattr(cloth, f"{family}_aspect")
        ring = 18 if kind == "racetrack" and aspect > 1.0 else RING
        points += (3 * parts[number] + yarns[number]) * ring
        patches += parts[number] * (ring // 3)
        if cloth is None or cloth.caps:
            closing = cap(ring)
            points += 2 * yarns[number] * closing.new_points
            patches += 2 * yarns[number] * len(closing.table)
    return Counts(points, patches, sum(parts))


def _arcs(cloth: Cloth, number: int) -> int:
    """Return into how many cubics an arc of a family is cut."""
    measures = (
        cloth.warp_diameter,
        cloth.weft_diameter,
        (cloth.weft_spacing, cloth.warp_spacing)[number],
    )
    if any(np.ndim(values) for values in measures):
        return 1 if cloth.exact or max(cloth.share, 1.0 - cloth.share) <= 0.5 + 1e-9 else 2
    theta = float(cloth.families[number].crimp.theta)
    if theta < FLAT:
        return 0
    return ceil(theta / (2.0 * LONGEST_ARC if cloth.exact else LONGEST_ARC) - 1e-9)


def estimate_bytes(
    ends: int,
    picks: int,
    parts_per_gap: int = 5,
    *,
    cloth: Cloth | None = None,
    drawdown: ArrayLike | None = None,
) -> int:
    """Return an upper bound of the memory that `build` needs, before any is taken.

    Parameters
    ----------
    ends, picks, parts_per_gap, cloth, drawdown : object
        As for `estimate_counts`.

    Returns
    -------
    int
        Bytes at the peak: the result, and the temporary arrays of one family.

    Examples
    --------
    >>> estimate_bytes(1000, 1000, parts_per_gap=3) < 12e9
    True
    """
    counts = estimate_counts(ends, picks, parts_per_gap, cloth=cloth, drawdown=drawdown)
    spline = cloth is not None and cloth.axis == "spline"
    return (
        counts.bytes(cloth is not None and cloth.exact)
        + (_SPLINE_PART_BYTES if spline else _PART_BYTES) * counts.parts
        + _GAP_BYTES * 2 * (ends + 1) * (picks + 1)
    )


class _Plan(NamedTuple):
    """A family on its way to patches."""

    path: Axes
    shape: Section
    tubes: Tubes
    first_patch: int

    @property
    def rings(self) -> int:
        return 3 * len(self.path.length) + len(self.path.parts)

    @property
    def points(self) -> slice:
        return slice(self.tubes.first, self.tubes.first + self.rings * self.shape.size)

    @property
    def patches(self) -> slice:
        count = len(self.path.length) * (self.shape.size // 3)
        return slice(self.first_patch, self.first_patch + count)


def _fill_points(plan: _Plan, number: int, flat_points: NDArray[np.float64]) -> None:
    """Write the control points of a family's tubes."""
    # Rings 1 and 2 of a part are rings 0 and 3 moved along the tangents there by ``reach (1 -
    # curvature n)`` for points n above the axis: so a point of an arc turns about the arc's axis.
    path, shape = plan.path, plan.shape
    points = flat_points.reshape(-1, shape.size, 3)
    owner, last = path.owner, path.last
    start = np.arange(len(owner)) + owner
    rings = 3 * np.arange(len(owner)) + owner
    final = 3 * np.cumsum(path.parts) + np.arange(len(last))
    count = 3 * path.parts + 1
    # v runs so that du x dv points outwards: the other way for yarns along y
    side = -1.0 if number == 0 else 1.0
    np.multiply(
        np.repeat(side * path.radius, count)[:, None], shape.lateral, out=points[:, :, number]
    )
    points[:, :, number] += np.repeat(path.lateral, count)[:, None]

    axis, spread = np.empty(len(points)), np.empty(len(points))
    tangent = np.cos(path.angle), np.sin(path.angle)
    normal = -tangent[1], tangent[0]
    r = path.radius[owner]
    for direction, place, component in ((0, path.along, 1 - number), (1, path.height, 2)):
        t, n = tangent[direction], normal[direction]
        axis[rings], axis[final] = place[start], place[last]
        spread[rings], spread[final] = r * n[start], path.radius * n[last]
        for ring, station, handle, bend in (
            (rings + 1, start, path.reach[0], path.curvature[0]),
            (rings + 2, start + 1, -path.reach[1], path.curvature[1]),
        ):
            step = handle * t[station]
            axis[ring] = place[station] + step
            spread[ring] = r * (n[station] - bend * step)
        np.multiply(spread[:, None], shape.normal, out=points[:, :, component])
        points[:, :, component] += axis[:, None]


def _fill_weights(plan: _Plan, weights: NDArray[np.float64]) -> None:
    path = plan.path
    along = np.ones(plan.rings)
    rings = 3 * np.arange(len(path.length)) + path.owner
    along[rings + 1] = along[rings + 2] = path.weight
    np.multiply(along[:, None], plan.shape.weight, out=weights.reshape(-1, plan.shape.size))


def _fill_caps(
    plan: _Plan,
    closing: Cap,
    points: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
    new: slice,
    patches: NDArray[np.int64],
) -> None:
    """Close both ends of every yarn of a family, first end and last in turn."""
    parts, size = plan.path.parts, plan.shape.size
    last = 3 * np.cumsum(parts) + np.arange(len(parts))
    rings = plan.tubes.first + size * np.stack([last - 3 * parts, last], axis=1).ravel()
    # the first end looks back: there the cap is turned over, lower for upper
    turned = np.arange(len(rings))[:, None] % 2 == 0
    lower = rings[:, None] + np.where(turned, closing.upper, closing.lower)
    upper = rings[:, None] + np.where(turned, closing.lower, closing.upper)
    own = points[new].reshape(len(rings), 2, -1, 3)
    own[:, 0] = (2.0 * points[lower] + points[upper]) / 3.0
    own[:, 1] = (points[lower] + 2.0 * points[upper]) / 3.0
    if weights is not None:
        weights[new].reshape(len(rings), 2, -1)[:] = weights[lower][:, None]
    # the table of a turned cap is that of the ring upside down
    mirrored = np.arange(size)
    mirrored[closing.lower], mirrored[closing.upper] = closing.upper, closing.lower
    made = np.arange(closing.new_points)
    lookup = np.empty((2, size + len(made)), dtype=np.int64)
    lookup[:, size:] = made
    lookup[0, :size], lookup[1, :size] = mirrored, np.arange(size)
    index = lookup[np.arange(len(rings)) % 2][:, closing.table]
    base = np.where(
        closing.table < size,
        rings[:, None, None],
        new.start + closing.new_points * np.arange(len(rings))[:, None, None],
    )
    np.add(index, base, out=patches.reshape(index.shape))


def _radial_error(path: Axes, error: float, exact: bool) -> float:
    """Return the largest error of tubes along these axes, whose sections have that error."""
    if not len(path.parts):
        return 0.0
    if path.cubic:
        return error + offset_error(path)
    turn = np.abs(path.curvature[0])
    if not exact and turn.any():
        # along an arc the distance to the arc's axis is off, which is at most its radius + r
        reach = 1.0 / turn[turn > 0.0].min() + path.radius.max()
        error += cubic_error(float((turn * path.length).max())) * reach / path.radius.min()
    return float(error)
