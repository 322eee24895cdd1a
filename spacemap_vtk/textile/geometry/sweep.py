"""Tubes: sections swept along centre lines with frames, as bicubic Bézier patches.

The module does not depend on what the lines are: yarns of a weave, loops of a knit, or wires.

Invariants on which other modules rely:

- Every part of a line has as many patches around the tube as the section has cubics, and three
  rings of control points. Its fourth ring is the first of the next part, or the final ring of the
  line. So part q of a bundle, on line y, starts at ring 3 q + y and at station q + y.
- Where a line is an arc, the tube is a surface of revolution: each control point turns about the
  arc's axis at its distance rho, with a handle of 4/3 tan(angle/4) rho. Handles of one length for
  all points would break the tangent plane where an arc meets a straight part.
- rho is affine in the point's position on the section. So a whole ring is ``place + normal E +
  lateral F`` with two vectors per ring, and no loop is needed.
- Rational weights are products of one weight along the line and one around it, and they are 1 at
  every corner of every patch. So neighbours agree on the points that they share.
- The tubes of all bundles come first, then the caps of all cut ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats, Ints
from spacemap_vtk.textile.geometry.section import Cap, Section, build_cap, number_tube_points

#: x, y and z of a vector at each station, (stations,); a number if it is equal at all stations.
Vectors = tuple[Floats | float, Floats | float, Floats | float]


class CentreLines(NamedTuple):
    """Centre lines of a bundle of tubes, cut into parts; stations are the ends of the parts."""

    # Part q of the bundle, on its line y, runs from station q + y to station q + y + 1.

    numbers: Ints
    """(lines,) Number by which each line is known."""
    radius: Floats
    """(lines,) Half the height of each section."""
    parts: Ints
    """(lines,) Number of parts."""
    place: Vectors
    """Positions of the stations, in metres."""
    tangent: Vectors
    """Unit vectors of frames that do not twist about the line."""
    normal: Vectors
    """Direction of the section's top: tangent x lateral."""
    lateral: Vectors
    curvature: Floats
    """(2, parts) Curvature at start and end of each part, positive towards the normal."""
    reach: Floats
    """(2, parts) Handle lengths of the cubic that approximates each part, at start and end."""
    weight: Floats
    """(parts,) Rational weight of the two inner control points; (1,) where all are 1."""
    sideways: Floats | None = None
    """(2, parts) Curvature towards the lateral; None if there is none."""
    swelling: Floats | None = None
    """(rings, k) Shares of the section's changes; None if all rings have the same section."""

    @property
    def owner(self) -> Ints:
        """(parts,) Line of each part."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @property
    def rings(self) -> int:
        """Number of rings of control points."""
        return 3 * int(self.parts.sum()) + len(self.parts)


class Tubes(NamedTuple):
    """Positions of a bundle's tubes among the control points, from which axes can be recovered."""

    first: int
    """First control point."""
    ring: int
    """Number of control points in a ring."""
    parts: Ints
    """(lines,) Number of parts of each line; line y has 3 parts + 1 rings."""
    aspect: float
    """Width of the section over its height."""
    lens_aspect: float = 1.0
    """The same for a lens; 1 for other sections."""
    swelling: tuple[Floats, Floats] | None = None
    """Lateral and normal positions on the section of each ring, (rings, ring) each, over half its
    height; None if all rings have the same section."""

    @property
    def ends(self) -> Ints:
        """(2 lines,) First and last ring of each line."""
        last = 3 * np.cumsum(self.parts) + np.arange(len(self.parts))
        return np.stack([last - 3 * self.parts, last], axis=1).ravel()

    def ring_centres(self, points: NDArray[Any]) -> NDArray[Any]:
        """Compute the centres of all rings: control points of cubic Bézier curves.

        Parameters
        ----------
        points : ndarray of float, shape (N, 3)
            Control points of all tubes [m].

        Returns
        -------
        ndarray of float, shape (rings, 3)
            Centres [m].
        """
        rings = 3 * int(self.parts.sum()) + len(self.parts)
        there = points[self.first : self.first + rings * self.ring].reshape(rings, self.ring, 3)
        return there.mean(axis=1) if self.swelling is None else self.lens_frames(there)[0]

    def lens_frames(self, rings: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Compute frames of lenses before swelling.

        Parameters
        ----------
        rings : ndarray of float, shape (rings, ring, 3)
            Control points of each ring [m].

        Returns
        -------
        tuple of ndarray of float, shape (rings, 3)
            Centres, and vectors to the top and to the edge [m].
        """
        bottom, top, left, right = (rings[:, place] for place in (6, 0, 9, 3))
        lateral, normal = (
            (np.array([[self.aspect]]), np.array([[1.0, -1.0]]))
            if self.swelling is None
            else (self.swelling[0][:, 3:4], self.swelling[1][:, [0, 6]])
        )
        up = (top - bottom) / (normal[:, :1] - normal[:, 1:])
        return bottom - normal[:, 1:] * up, up, self.aspect * (right - left) / (2.0 * lateral)


class SweptTubes(NamedTuple):
    """Tubes as patches."""

    points: AnyFloats
    """(N, 3) Control points in metres; shared inside a line, not between lines."""
    patches: AnyInts
    """(P, 16) Control points of each patch in the order of ``VTK_BEZIER_QUADRILATERAL``, degree 3
    x 3. On tubes u runs along the line and v around it; du x dv points outwards everywhere. Tubes
    come line by line, part by part, around the line; then caps, line by line. int32 if the numbers
    fit: they are read at every step, and VTK uses either type without a copy."""
    weights: Floats | None
    """(N,) Rational weights of the control points (VTK's RationalWeights); None where all are 1."""
    line: NDArray[np.int32]
    """(P,) Number of each patch's line."""
    bundle: NDArray[np.uint8]
    """(P,) Number of each patch's bundle."""
    tube_patches: int
    """Number of patches that are not caps."""
    tubes: tuple[Tubes, ...]
    """Positions of each bundle's rings in `points`."""


def sweep(
    bundles: Sequence[tuple[CentreLines, Section]],
    caps: bool,
    exact: bool,
    kind: DTypeLike = np.float64,
) -> SweptTubes:
    """Sweep sections along centre lines; the lines of a bundle share a section."""
    plans, first_point, first_patch = [], 0, 0
    for lines, shape in bundles:
        sections = swell_section(shape, lines.swelling)
        tubes = Tubes(
            first_point, shape.size, lines.parts, shape.aspect, shape.lens_aspect, sections
        )
        plans.append(_BundlePlan(lines, shape, tubes, first_patch))
        first_point, first_patch = plans[-1].points.stop, plans[-1].patches.stop
    closings = [
        build_cap(shape.size) if caps and len(lines.parts) else None for lines, shape in bundles
    ]
    next_point, next_patch = first_point, first_patch
    for plan, closing in zip(plans, closings, strict=True):
        if closing is not None:
            first_point += 2 * len(plan.lines.parts) * closing.new_points
            first_patch += 2 * len(plan.lines.parts) * len(closing.table)

    points = np.empty((first_point, 3), kind)
    weights = np.ones(first_point) if exact else None
    patches = np.empty((first_patch, 16), np.int32 if first_point < 2**31 else np.int64)
    line = np.empty(first_patch, dtype=np.int32)
    bundle = np.empty(first_patch, dtype=np.uint8)
    tube_patches = next_patch
    for number, (plan, closing) in enumerate(zip(plans, closings, strict=True)):
        _fill_points(plan, points[plan.points])
        if weights is not None:
            _fill_weights(plan, weights[plan.points])
        here, owner, names = plan.patches, plan.lines.owner, plan.lines.numbers
        first_ring = plan.tubes.first + plan.shape.size * (3 * np.arange(len(owner)) + owner)
        table = number_tube_points(plan.shape.size)
        np.add(first_ring[:, None, None], table, out=patches[here].reshape(-1, *table.shape))
        line[here].reshape(-1, len(table))[:] = names[owner][:, None]
        bundle[here] = number
        if closing is not None:
            count = 2 * len(plan.lines.parts)
            new = slice(next_point, next_point + count * closing.new_points)
            here = slice(next_patch, next_patch + count * len(closing.table))
            _fill_caps(plan, closing, points, weights, new, patches[here])
            line[here] = np.repeat(names, 2 * len(closing.table))
            bundle[here] = number
            next_point, next_patch = new.stop, here.stop
    tubes_of_all = tuple(plan.tubes for plan in plans)
    return SweptTubes(points, patches, weights, line, bundle, tube_patches, tubes_of_all)


class _BundlePlan(NamedTuple):
    """A bundle with the numbers of its first point and patch."""

    lines: CentreLines
    shape: Section
    tubes: Tubes
    first_patch: int

    @property
    def points(self) -> slice:
        return slice(self.tubes.first, self.tubes.first + self.lines.rings * self.shape.size)

    @property
    def patches(self) -> slice:
        count = int(self.lines.parts.sum()) * (self.shape.size // 3)
        return slice(self.first_patch, self.first_patch + count)


def _fill_points(plan: _BundlePlan, flat_points: AnyFloats) -> None:
    """Write the control points of a bundle's tubes."""
    # Rings 1 and 2 of a part are rings 0 and 3, moved along their tangents by ``reach (1 -
    # curvature n)`` for points n above the line. So a point of an arc turns about the arc's axis.
    lines, shape = plan.lines, plan.shape
    points = flat_points.reshape(-1, shape.size, 3)
    owner = lines.owner
    start = np.arange(len(owner)) + owner
    rings = 3 * np.arange(len(owner)) + owner
    last = np.cumsum(lines.parts) + np.arange(len(lines.parts))
    final = 3 * np.cumsum(lines.parts) + np.arange(len(lines.parts))
    r = lines.radius[owner]
    inner = (
        (rings + 1, start, lines.reach[0], 0),
        (rings + 2, start + 1, -lines.reach[1], 1),
    )

    def spread(direction: Floats | float, along: Floats | float, bend: Floats | None) -> Floats:
        """Compute one component of a frame vector, times the radius, for all rings."""
        if isinstance(direction, float) and (bend is None or isinstance(along, float)):
            return np.repeat(direction * lines.radius, 3 * lines.parts + 1)
        values = np.empty(len(points))
        values[rings] = r * _values_at(direction, start)
        values[final] = lines.radius * _values_at(direction, last)
        for ring, station, handle, end in inner:
            here = _values_at(direction, station)
            if bend is not None:
                here = here - bend[end] * (handle * _values_at(along, station))
            values[ring] = r * here
        return values

    for component, (place, along, up, aside) in enumerate(
        zip(lines.place, lines.tangent, lines.normal, lines.lateral, strict=True)
    ):
        out, started = points[:, :, component], False
        if out.dtype != np.float64:
            out = np.empty(out.shape)  # so that rounding happens once, at the end
        lateral, normal = plan.tubes.swelling or (shape.lateral, shape.normal)
        for direction, bend, reaches in (
            (up, lines.curvature, normal),
            (aside, lines.sideways, lateral),
        ):
            # Directions that are zero in all frames are skipped, which saves most of the time.
            if _is_zero(direction) and (bend is None or _is_zero(along)):
                continue
            if started:
                out += spread(direction, along, bend)[:, None] * reaches
            else:
                np.multiply(spread(direction, along, bend)[:, None], reaches, out=out)
            started = True
        axis = np.empty(len(points))
        axis[rings], axis[final] = _values_at(place, start), _values_at(place, last)
        for ring, station, handle, _ in inner:
            axis[ring] = _values_at(place, station)
            if not _is_zero(along):
                axis[ring] += handle * _values_at(along, station)
        if started:
            out += axis[:, None]
        else:
            out[:] = axis[:, None]
        if out.dtype != points.dtype:
            points[:, :, component] = out


def swell_section(shape: Section, shares: Floats | None) -> tuple[Floats, Floats] | None:
    """Compute lateral and normal positions, (rings, ring) each, of swollen sections."""
    if shares is None or shape.changes is None:
        return None
    lateral, normal = shape.changes
    return shape.lateral + shares @ lateral, shape.normal + shares @ normal


def _values_at(values: Floats | float, index: Ints) -> Floats | float:
    return values if isinstance(values, float) else values[index]


def _is_zero(values: Floats | float) -> bool:
    return isinstance(values, float) and values == 0.0


def _fill_weights(plan: _BundlePlan, weights: Floats) -> None:
    lines = plan.lines
    along, owner = np.ones(lines.rings), lines.owner
    rings = 3 * np.arange(len(owner)) + owner
    along[rings + 1] = along[rings + 2] = lines.weight
    np.multiply(along[:, None], plan.shape.weight, out=weights.reshape(-1, plan.shape.size))


def fill_cap_points(tubes: Tubes, closing: Cap, points: AnyFloats, new: AnyFloats) -> Ints:
    """Write the inner points of a bundle's caps; return the points at which they start."""
    rings = tubes.first + tubes.ring * tubes.ends
    # The first end faces backwards, so its cap is turned over: lower and upper are exchanged.
    turned = np.arange(len(rings))[:, None] % 2 == 0
    lower = rings[:, None] + np.where(turned, closing.upper, closing.lower)
    upper = rings[:, None] + np.where(turned, closing.lower, closing.upper)
    own = new.reshape(len(rings), 2, -1, 3)
    own[:, 0] = (2.0 * points[lower] + points[upper]) / 3.0
    own[:, 1] = (points[lower] + 2.0 * points[upper]) / 3.0
    return lower


def _fill_caps(
    plan: _BundlePlan,
    closing: Cap,
    points: AnyFloats,
    weights: Floats | None,
    new: slice,
    patches: AnyInts,
) -> None:
    """Close both ends of every line of a bundle, first and last end alternately."""
    size = plan.shape.size
    rings = plan.tubes.first + size * plan.tubes.ends
    lower = fill_cap_points(plan.tubes, closing, points, points[new])
    if weights is not None:
        weights[new].reshape(len(rings), 2, -1)[:] = weights[lower][:, None]
    # The table of a turned cap is that of the ring upside down.
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
