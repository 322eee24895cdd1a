"""Control points of a cloth whose crossings change their heights, in a space that is stretched.

Every ring of a tube has a foot: the projection of its centre on the plane between warp and weft.
Feet are those of the cloth at rest and do not change. What is recomputed is the vector from each
moved foot to its control points: along the yarn, along the surface's normal, and sideways. So
sections turn with the surface and are not squeezed by it. At crossings, yarns have the given
distance along the common normal. Where it is less than at rest, yarns are thinner there in the same
ratio, so that they touch and do not overlap.

Invariant: cells are those of `spacemap_vtk.textile.geometry.weave.build_weave` at all heights.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from spacemap_vtk.memory import ArrayPool
from spacemap_vtk.ndarrays import AnyFloats, Bools, Floats, Ints
from spacemap_vtk.parallel import BLAS_SERIAL, for_each
from spacemap_vtk.textile.geometry.arcs import PartPlan, build_axes, build_gaps, plan_parts
from spacemap_vtk.textile.geometry.axis_parts import Axes
from spacemap_vtk.textile.geometry.cloth_axes import (
    ALL_YARNS,
    YarnSelection,
    swelling_floats,
    woven_gaps,
)
from spacemap_vtk.textile.geometry.section import Cap, Section, build_cap, build_section
from spacemap_vtk.textile.geometry.sweep import Tubes, fill_cap_points, swell_section
from spacemap_vtk.textile.geometry.swelling import float_growth, float_widening, ring_shares
from spacemap_vtk.textile.weave.cloth import Cloth


class CrimpGeometry:
    """Control points of a cloth, or of some of its yarns, while its crossings move.

    Parameters
    ----------
    cloth : Cloth
        At rest, with axes by arcs.
    selection : YarnSelection
        Yarns to include, as for `spacemap_vtk.textile.geometry.weave.build_weave`.

    Raises
    ------
    GeometryError
        There is no room for the yarns.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> from spacemap_vtk.textile.geometry.weave import build_weave
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> yarns = CrimpGeometry(cloth)
    >>> woven = yarns.repeat_rings(yarns.feet) + yarns.rest_offsets
    >>> yarns.feet.shape, bool(np.allclose(woven, build_weave(cloth).points, atol=1e-15))
    ((64, 3), True)
    """

    def __init__(self, cloth: Cloth, selection: YarnSelection = ALL_YARNS) -> None:
        cloth.check()
        self.cloth, self.share, self._recycler = cloth, selection, ArrayPool()
        self._families: list[_Family] = []
        rings = points = 0
        for number in range(2):
            family = self._prepare_family(number, rings, points)
            self._families.append(family)
            count = len(family.radius)
            rings, points = rings + count, points + count * family.shape.size
        #: (rings, 3) Feet of the rings [m], the warp's first.
        self.feet: Floats = np.zeros((rings, 3))
        for number, family in enumerate(self._families):
            here = family.rings
            self.feet[here, 1 - number] = family.rest.along
            self.feet[here, number] = np.repeat(family.lateral, 3 * family.tubes.parts + 1)
        #: (patches,) Nearest crossing of each patch: index of (2, picks, ends), the warp's first.
        self.crossing: Ints = np.concatenate(
            [np.repeat(f.crossing, f.shape.size // 3) for f in self._families]
            + [np.repeat(f.ends, len(f.cap.table)) for f in self._families if f.cap]
        )

    @property
    def rest_offsets(self) -> AnyFloats:
        """(N, 3) Vectors from feet to control points at rest [m]."""
        still = np.ones((2, *self.cloth.drawdown.shape))
        along = np.zeros_like(self.feet)
        for number, family in enumerate(self._families):
            along[family.rings, 1 - number] = 1.0
        up = np.broadcast_to([0.0, 0.0, 1.0], along.shape)
        return self.offsets(self.cloth.rest_heights, still, along, up)

    @property
    def warp_rings(self) -> int:
        """Number of the warp's rings."""
        return len(self._families[0].radius)

    def axes(self, number: int, height: Floats, stretch: Floats) -> Axes:
        """Compute the axes of warp (0) or weft (1).

        Parameters
        ----------
        number : {0, 1}
            The family.
        height : ndarray of float64, shape (2, picks, ends)
            Distances of warp and weft from the plane between them at each crossing [m].
        stretch : ndarray of float64, shape (2, picks, ends)
            Stretches of space along warp and weft.

        Returns
        -------
        Axes
            ``along`` is as in the cloth at rest; lengths, angles and curvatures are stretched.
        """
        return self._build_axes(number, height, stretch)[0]

    def offsets(
        self,
        height: Floats,
        stretch: Floats,
        along: Floats,
        normal: Floats,
        precision: DTypeLike = np.float64,
    ) -> AnyFloats:
        """Compute the vectors from the moved feet to the control points.

        Parameters
        ----------
        height : ndarray of float64, shape (2, picks, ends)
            Distances of warp and weft from the plane between them at each crossing [m].
        stretch : ndarray of float64, shape (2, picks, ends)
            Stretches of space along warp and weft.
        along : ndarray of float64, shape (rings, 3)
            Deformed image of a unit vector along each ring's yarn.
        normal : ndarray of float64, shape (rings, 3)
            Unit normal of the surface that warp and weft span there.
        precision : dtype
            Type of the result.

        Returns
        -------
        ndarray, shape (N, 3)
            [m]
        """
        new = sum(len(f.radius) * f.shape.size for f in self._families)
        size = new + sum(f.cap_points for f in self._families)
        result = self._recycler.empty((size, 3), precision)
        thinner = height.sum(axis=0) / self._distance
        pressed = bool((abs(thinner - 1.0) > 1e-12).any())
        for number, family in enumerate(self._families):
            path, of_part = self._build_axes(number, height, stretch)
            rings = _compute_rings(path, of_part)
            flat = (
                family.interpolate_to_rings(_yarn_rows(thinner, number, self.share))
                if pressed
                else None
            )
            _write_tube_points(
                family, rings, (along[family.rings], normal[family.rings]), flat, result
            )
        for family in self._families:
            if family.cap:
                here = result[new : new + family.cap_points]
                fill_cap_points(family.tubes, family.cap, result, here)
                new += len(here)
        return result

    def repeat_rings(self, of_rings: Floats) -> Floats:
        """Repeat values of rings for their control points.

        Parameters
        ----------
        of_rings : ndarray of float64, shape (rings, ...)
            Values of any kind.

        Returns
        -------
        ndarray of float64, shape (N, ...)
            Value of each control point's ring.
        """
        parts = [np.repeat(of_rings[f.rings], f.shape.size, axis=0) for f in self._families]
        for family in self._families:
            if family.cap:
                ends = of_rings[family.rings][family.tubes.ends]
                parts.append(np.repeat(ends, family.cap.new_points, axis=0))
        return np.concatenate(parts)

    def weights(self, height: Floats, stretch: Floats) -> Floats | None:
        """Compute the rational weights of the control points.

        Parameters
        ----------
        height, stretch : ndarray of float64, shape (2, picks, ends)
            As for `vectors`.

        Returns
        -------
        ndarray of float64, shape (N,), or None
            None if the cloth is not exact; then all weights are 1.
        """
        if not self.cloth.exact:
            return None
        result = np.ones(len(self.feet))
        for number, family in enumerate(self._families):
            path = self._build_axes(number, height, stretch)[0]
            owner = path.owner
            ring = family.first + 3 * np.arange(len(owner)) + owner
            result[ring + 1] = result[ring + 2] = path.weight
        weights = self.repeat_rings(result)
        begin = 0
        for family in self._families:
            here = weights[begin : begin + len(family.radius) * family.shape.size]
            here.reshape(-1, family.shape.size)[:] *= family.shape.weight
            begin += len(here)
        for family in self._families:
            if family.cap:
                here = weights[begin : begin + family.cap_points]
                here.reshape(len(family.ends), 2, -1)[:] = family.shape.weight[family.cap.lower]
                begin += len(here)
        return weights

    @property
    def _distance(self) -> Floats:
        """(picks, ends) Distance of the axes at each crossing, at rest."""
        warp, weft = self.cloth.yarns
        return 0.5 * (weft.diameter[:, None] + warp.diameter)

    def _build_axes(self, number: int, height: Floats, stretch: Floats) -> tuple[Axes, Floats]:
        """Compute the axes of a family, and the stretch along each part."""
        family, crossed = self._families[number], self.cloth.yarns[1 - number]
        rows = _yarn_rows(height[number], number, self.share)
        gaps = build_gaps(
            crossed,
            _yarn_rows(height.sum(axis=0) * self.cloth.arc_ratios[number], number, self.share),
            np.where(family.upper, rows, -rows),
            self.cloth.families[number].overhang,
            _yarn_rows(stretch[number], number, self.share),
        )
        own = self.cloth.yarns[number]
        radius = 0.5 * own.diameter[self.share[number]]
        path = build_axes(radius, family.lateral, gaps, self.cloth.exact, family.plan)
        return path, gaps.stretch.ravel()[family.gap]

    def _prepare_family(self, number: int, first: int, point: int) -> _Family:
        cloth, some = self.cloth, self.share[number]
        own, crossed = cloth.yarns[number].select(some), cloth.yarns[1 - number]
        upper = cloth.is_over(number, some)
        gaps = woven_gaps(cloth, number, some)
        plan = plan_parts(gaps, cloth.exact)
        floats = swelling_floats(cloth, number, some)
        growth = float_growth(cloth, number)
        path = build_axes(0.5 * own.diameter, own.position, gaps, cloth.exact, plan, floats, growth)
        count = (2 * plan.pieces + plan.straight).ravel()
        station = np.arange(len(path.length)) + path.owner
        middle = 0.5 * (path.along[station] + path.along[station + 1])
        place, threads = crossed.position, cloth.threads[number]
        widening, widest = float_widening(cloth, number)
        shape = build_section(threads.shape, threads.aspect, cloth.exact, widest)
        numbers = np.arange(cloth.size[number])[some]
        ends = cloth.size[0]
        step, across = (ends, 1) if number == 0 else (1, ends)
        base = number * cloth.drawdown.size + across * numbers
        nearest = np.searchsorted(0.5 * (place[1:] + place[:-1]), middle)
        basis = np.stack([np.ones(shape.size), shape.normal, shape.lateral])
        sections = swell_section(shape, ring_shares(path, widening[some]))
        return _Family(
            upper=upper,
            radius=np.repeat(path.radius, 3 * path.parts + 1),
            lateral=own.position,
            plan=plan,
            rest=_compute_rings(path, np.ones(len(path.length))),
            tubes=Tubes(point, shape.size, path.parts, shape.aspect, shape.lens_aspect, sections),
            shape=shape,
            cap=build_cap(shape.size) if cloth.caps and len(path.parts) else None,
            spread=np.kron(basis, np.eye(3)).astype(np.float64),
            first=first,
            gap=np.repeat(np.arange(count.size), count),
            crossing=base[path.owner] + step * nearest,
            ends=(base[:, None] + step * np.array([0, len(place) - 1])).ravel(),
            place=place,
        )


class _Rings(NamedTuple):
    """Rings of a family, each in the plane of its yarn."""

    along: Floats
    """(rings,) Positions of the centres along the yarn, before space was stretched."""
    height: Floats
    """(rings,) Heights of the centres."""
    up: Floats
    """(2, rings) Vector from the centre to the section's top: along the yarn, and in z."""


class _Family(NamedTuple):
    """Values of a family that do not change."""

    upper: Bools
    radius: Floats
    """(rings,) Half the height of the section."""
    lateral: Floats
    """(yarns,) Position of each yarn's plane."""
    plan: PartPlan
    """Numbers of parts of its yarns."""
    rest: _Rings
    tubes: Tubes
    shape: Section
    cap: Cap | None
    """Caps at both ends of its yarns."""
    spread: Floats
    """(9, 3 points) Maps a ring's centre, top and side to its control points."""
    first: int
    """Its first ring among the rings of both families."""
    gap: Ints
    """(parts,) The gap of each part."""
    crossing: Ints
    """(parts,) The nearest crossing."""
    ends: Ints
    """(2 yarns,) First and last crossing of each yarn."""
    place: Floats
    """(crossings,) Positions along the yarns."""

    @property
    def cap_points(self) -> int:
        return len(self.ends) * self.cap.new_points if self.cap else 0

    @property
    def rings(self) -> slice:
        return slice(self.first, self.first + len(self.radius))

    def interpolate_to_rings(self, at_crossings: Floats) -> Floats:
        """Interpolate from crossings (yarns, crossings) to rings, with zero slope at crossings."""
        row = np.repeat(np.arange(len(self.lateral)), 3 * self.tubes.parts + 1)
        last = len(self.place) - 1
        left = np.clip(np.searchsorted(self.place, self.rest.along) - 1, 0, max(last - 1, 0))
        right = np.minimum(left + 1, last)
        width = np.where(right > left, self.place[right] - self.place[left], 1.0)
        t = np.clip((self.rest.along - self.place[left]) / width, 0.0, 1.0)
        share = t * t * (3.0 - 2.0 * t)
        return (1.0 - share) * at_crossings[row, left] + share * at_crossings[row, right]


def _write_tube_points(
    family: _Family,
    rings: _Rings,
    frame: tuple[Floats, Floats],
    flat: Floats | None,
    out: AnyFloats,
) -> None:
    """Write the control points of a family's tubes, relative to their moved feet."""
    size, first = family.shape.size, family.tubes.first
    shift = rings.along - family.rest.along
    # Each block is one product that fits the cache and is too small for BLAS to start threads.
    spread = family.spread.astype(out.dtype)
    block = max(1, BLAS_SERIAL // spread.size)

    def write_block(begin: int) -> None:
        here = slice(begin, begin + block)
        e, n = frame[0][here], frame[1][here]
        t = e / np.sqrt(np.einsum("rc,rc->r", e, e))[:, None]
        made = np.empty((len(e), 3, 3), out.dtype)
        made[:, 0] = shift[here, None] * e
        made[:, 0] += rings.height[here, None] * n
        made[:, 1] = rings.up[0, here, None] * t + rings.up[1, here, None] * n
        for axis in range(3):
            one, other = (axis + 1) % 3, (axis + 2) % 3
            made[:, 2, axis] = n[:, one] * t[:, other] - n[:, other] * t[:, one]
        made[:, 2] *= family.radius[here, None]
        if flat is not None:  # thinner all round: then the arcs of other yarns still touch it
            made[:, 1:] *= flat[here, None, None]
        points = out[first + begin * size : first + (begin + len(e)) * size]
        if family.tubes.swelling is None:
            np.matmul(made.reshape(-1, 9), spread, out=points.reshape(len(e), 3 * size))
            return
        lateral, normal = (one[here, :, None] for one in family.tubes.swelling)
        swollen = points.reshape(len(e), size, 3)
        np.multiply(normal, made[:, 1, None], out=swollen)
        swollen += lateral * made[:, 2, None]
        swollen += made[:, 0, None]

    for_each(range(0, len(shift), block), lambda: write_block)


def _yarn_rows(table: Floats, number: int, share: YarnSelection) -> Floats:
    """Arrange values (picks, ends) in a row for each yarn of a share."""
    return table[share[1]] if number else table.T[share[0]]


def _compute_rings(path: Axes, stretch: Floats) -> _Rings:
    """Compute the rings of tubes around axes, as in `spacemap_vtk.textile.geometry.sweep`."""
    owner = path.owner
    start = np.arange(len(owner)) + owner
    cos, sin = np.cos(path.angle), np.sin(path.angle)
    radius = np.repeat(path.radius, path.parts + 1)
    at_stations = np.stack([path.along, path.height, -radius * sin, radius * cos])
    # Write three rings of each part column by column, then insert the last ring of each yarn.
    made = np.empty((4, len(owner), 3))
    made[:, :, 0] = at_stations[:, start]
    for column, stations, handle, bend in (
        (1, start, path.reach[0], path.curvature[0]),
        (2, start + 1, -path.reach[1], path.curvature[1]),
    ):
        values, turn = at_stations[:, stations], bend * radius[stations]
        reached = handle * cos[stations], handle * sin[stations]
        made[0, :, column] = values[0] + reached[0] / stretch
        made[1, :, column] = values[1] + reached[1]
        made[2, :, column] = values[2] - turn * reached[0]
        made[3, :, column] = values[3] - turn * reached[1]
    full = np.empty((4, 3 * len(owner) + len(path.parts)))
    final = 3 * np.cumsum(path.parts) + np.arange(len(path.parts))
    inner = np.ones(full.shape[1], np.bool_)
    inner[final] = False
    full[:, inner], full[:, final] = made.reshape(4, -1), at_stations[:, path.last]
    return _Rings(full[0], full[1], full[2:])
