"""Twist and plies of yarns: how fibres wind around a yarn, and the grooves between its plies.

They affect appearance only; mechanics, mass and contact use the section that contains all plies.
Fibres are helices, as in the idealised yarn of J. W. S. Hearle, P. Grosberg and S. Backer (1969,
chapter 2): at the surface of a yarn of diameter d with T turns per length they are inclined by
``tan(angle) = pi d T``. Z twist is a right-handed screw, and T is positive for it (ISO 2:1973).
Tubes of `spacemap_vtk.textile.geometry.sweep` count phi, the turns around the yarn, against that
screw. So ``phi + T s``, with s along the yarn, is constant on a line that winds with the twist.

Plies touch the circle that is the yarn's section, are pressed into each other, and turn with the
twist. Their outline is drawn between the section's centre and its rim, so flattened sections have
flattened plies. (L. R. G. Treloar, "The Geometry of Multi-ply Yarns", J. Textile Inst. 47 (1956)
T348, has plies as circles about a common axis.)
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from functools import lru_cache
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats, Ints
from spacemap_vtk.textile.geometry.irregularity import (
    Irregularity,
    YarnPlaces,
    lateral_changes,
    relative_brightness,
)
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative, quadrilateral_order
from spacemap_vtk.textile.weave.cloth import Cloth

#: Distance of the centres of plies, over that of circles that touch: plies flatten each other.
_FLATTENING = 0.8
#: Sharpness of the grooves. At 1 the circles would meet in an edge, between samples of a surface.
_SHARPNESS = 0.985
#: Turns from the start of a yarn to that of the next; no number of yarns adds up to whole turns.
PHASE_STEP = 0.6180339887498949
#: Least number of samples around a yarn for each ply; with fewer, plies are only shaded.
_LEAST_SAMPLES = 4
_ORDER = quadrilateral_order(3, 3)


def ply_distance(plies: AnyFloats) -> AnyFloats:
    """Compute the distance of the plies' centres from the yarn's axis, as a share of its radius."""
    return _FLATTENING / (1.0 + np.sin(pi / plies))


def ply_outline(phase: AnyFloats, plies: AnyFloats) -> tuple[AnyFloats, AnyFloats]:
    """Compute radius (1 on crowns) and slope of the plies' outline by the phase in turns."""
    middle = ply_distance(plies)
    wave, rise = np.sin(pi * plies * phase), np.cos(pi * plies * phase)
    turn = 2.0 / plies * np.arcsin(_SHARPNESS * wave)
    by_phase = 2.0 * pi * _SHARPNESS * rise / np.sqrt(1.0 - (_SHARPNESS * wave) ** 2)
    sin, cos = np.sin(turn), np.cos(turn)
    root = np.sqrt((1.0 - middle) ** 2 - (middle * sin) ** 2)
    reach = middle * cos + root
    return reach, -middle * sin * (1.0 + middle * cos / root) * by_phase


@lru_cache
def outline_curvature(plies: int) -> float:
    """Compute the largest curvature of an outline of plies over that of the circle around them.

    Parameters
    ----------
    plies : int
        Number of plies.

    Returns
    -------
    float
        1 for a single yarn.
    """
    if plies == 1:
        return 1.0
    step = 1e-4
    phase = np.arange(0.0, 1.0 / plies + 3 * step, step)
    angle, (reach, _) = 2.0 * pi * phase, ply_outline(phase, np.full(len(phase), float(plies)))
    curve = np.stack([reach * np.cos(angle), reach * np.sin(angle)])
    return float(np.linalg.norm(np.diff(curve, 2), axis=0).max() / (2.0 * pi * step) ** 2)


def ring_frames(rings: AnyFloats) -> tuple[AnyFloats, AnyFloats, AnyFloats]:
    """Compute the centres of rings, (..., size, 3), and the vectors to their top and their side."""
    middle = rings.mean(axis=-2)
    top = 0.5 * (rings[..., 0, :] + rings[..., -3 if rings.shape[-2] > 12 else 0, :])
    return middle, top - middle, rings[..., 3, :] - middle


class Strands:
    """Fibres and plies on the patches of a cloth, wherever the patches are moved.

    Parameters
    ----------
    patches : ndarray of int, shape (P, 16)
        Patches of a cloth, or of a piece of it, as made by
        `spacemap_vtk.textile.geometry.weave.build_weave`.
    cloth : Cloth
        The cloth of the patches.
    places : ndarray of float, shape (parts, 4)
        `Weave.places` of the patches.
    sides : int
        Number of quadrilaterals along each side of a patch.

    Raises
    ------
    GeometryError
        The patches do not match the places.
    """

    def __init__(self, patches: AnyInts, cloth: Cloth, places: AnyFloats, sides: int) -> None:
        yarn = places[:, 2].astype(np.int64)
        own = (yarn >= cloth.size[0]).astype(int)
        shapes = [build_section(t.shape, t.aspect, cloth.exact) for t in cloth.threads]
        around = np.array([shape.size // 3 for shape in shapes])[own]
        line = np.flatnonzero(np.diff(yarn, prepend=-1))
        ends = np.stack([line, np.append(line[1:], len(yarn)) - 1], axis=1)
        closing = np.repeat(around[line] // 2, 2) * cloth.caps
        if around.sum() + closing.sum() != len(patches):
            raise GeometryError(
                f"{len(patches)} patches do not match the {len(yarn)} parts of the cloth's yarns",
                allowed=f"{around.sum() + closing.sum()} patches",
            )
        self._net = patches[:, _ORDER].reshape(-1, 4, 4)
        self._around, self._first = around, np.cumsum(around) - around
        self.tube_count = int(around.sum())
        #: Part of a yarn for each patch; for patches that close a yarn, also the last ring.
        self._part = np.concatenate(
            [np.repeat(np.arange(len(yarn)), around), np.repeat(ends.ravel(), closing)]
        )
        self._ring = np.repeat(np.tile([0, 3], len(line)), closing)
        half = np.array([s.aspect - 1.0 if s.size > 12 else 0.0 for s in shapes])[own]
        self._half = half
        # Phi runs from the end of the top over the side; a racetrack has flats between quarters.
        quarter, length = 0.5 * pi, 2.0 * pi + 4.0 * half
        part = self._part[: self.tube_count]
        step, flattened = np.arange(self.tube_count) - self._first[part], around[part] > 4
        flats, flat = flattened & (step > 2), flattened & (step % 3 == 2)
        begun = quarter * (step - flats) + 2.0 * half[part] * flats
        long = np.where(flat, 2.0 * half[part], quarter)
        self._phi = np.stack([begun, long]) / length[part]
        turns, plies, diameter = (values[yarn] for values in cloth.strands)
        self._plies, self._diameter = plies, diameter
        self._along = places[:, 0], places[:, 1] - places[:, 0]
        self._number = places[:, 3].astype(np.int64)
        #: Spacing of each part's family, and of the crossing one.
        families = [(family.spacing, family.crossed) for family in cloth.families]
        self._lengths = np.array(families)[own].T
        # Looms do not align bobbins, so plies of neighbouring yarns begin at different phases.
        begin = turns * places[:, 0] + PHASE_STEP * places[:, 3]
        self._turned = begin - np.floor(begin), turns * self._along[1]
        self._most = int(plies.max(initial=1))
        self._winds = float(np.abs((plies > 1) * plies * self._turned[1]).max(initial=0.0))
        self._sample(sides)

    def _sample(self, sides: int) -> None:
        t = np.linspace(0.0, 1.0, sides + 1)
        self._u, self._v = np.tile(t, sides + 1), np.repeat(t, sides + 1)
        curve, slope = bernstein(3, t), bernstein_derivative(3, t)
        self._curve = np.stack([curve, slope])
        self._basis = np.concatenate(
            [np.kron(curve, curve), np.kron(curve, slope), np.kron(slope, curve)]
        )
        #: Whether plies get a shape; with too few samples they are only shaded.
        self.has_plies = self.can_shape_plies(sides)

    def can_shape_plies(self, sides: int) -> bool:
        """Check whether plies get a shape and not only shading.

        Parameters
        ----------
        sides : int
            Number of quadrilaterals along each side of a patch.

        Returns
        -------
        bool
            False if there are too few samples.
        """
        most, winds = self._most, self._winds
        return most > 1 and 4 * sides >= _LEAST_SAMPLES * most and sides >= 2.0 * winds

    def with_sides(self, sides: int) -> Strands:
        """Copy the strands for another number of facets.

        Parameters
        ----------
        sides : int
            Number of quadrilaterals along each side of a patch.

        Returns
        -------
        Strands
            Strands with the new samples.
        """
        other = copy(self)
        other._sample(sides)
        return other

    def coordinates(self, which: Ints) -> AnyFloats:
        """Compute the coordinates that shading needs at the samples of some patches.

        Parameters
        ----------
        which : ndarray of int
            Numbers of patches, in ascending order.

        Returns
        -------
        ndarray of float32, shape (samples, patches, 3)
            Coordinate that is constant along a fibre, in turns of the yarn; phase of the plies, in
            plies from a crown, if they are only shaded; position along the yarn, in diameters. All
            are 0 on patches that close tubes.
        """
        part = self._part[which]
        found = np.zeros((len(self._u), len(part), 3), np.float32)
        tubes = int(np.searchsorted(which, self.tube_count))
        part = part[:tubes]
        phi, turned, along = self._winding(which[:tubes], part)
        plied = self._plies[part] > 1
        # Fibres of plies run about along the yarn, because plies are twisted against their singles.
        found[:, :tubes, 0] = phi + np.where(plied, 0.0, turned)
        if not self.has_plies:
            found[:, :tubes, 1] = np.where(plied, self._plies[part] * (phi + turned), 0.0)
        found[:, :tubes, 2] = along / self._diameter[part]
        return found

    def _winding(self, which: Ints, part: Ints) -> tuple[AnyFloats, AnyFloats, AnyFloats]:
        """Compute turns around the yarn, twist and position along it at samples on tubes."""
        begin, span = self._phi[:, which]
        turned, more = (each[part] for each in self._turned)
        along, further = (each[part] for each in self._along)
        u, v = self._u[:, None], self._v[:, None]
        return begin + v * span, turned + u * more, along + u * further

    def face(self, which: Ints, around: Floats | None = None) -> Floats:
        """Compute on which face of the cloth the samples of some patches lie.

        Parameters
        ----------
        which : ndarray of int
            Numbers of patches, in ascending order.
        around : ndarray of float, optional
            Places of samples around each patch, 0 to 1; by default those of the subdivisions.

        Returns
        -------
        ndarray of float, shape (samples, patches)
            1 on the top of a yarn, -1 below, 0 on its sides; NaN on patches that close it.
        """
        v = self._v if around is None else around
        found = np.full((len(v), len(which)), np.nan)
        tubes = int(np.searchsorted(which, self.tube_count))
        begin, span = self._phi[:, which[:tubes]]
        found[:, :tubes] = np.cos(2.0 * pi * (begin + v[:, None] * span))
        return found

    def relative_brightness(self, which: Ints, irregularity: Irregularity) -> Floats:
        """Compute the brightness of irregular yarns at the samples of some patches, about 1.

        Parameters
        ----------
        which : ndarray of int
            Numbers of patches, in ascending order.
        irregularity : Irregularity
            Amount and seed.

        Returns
        -------
        ndarray of float, shape (samples, patches)
            1 for regular yarns.
        """
        parts, of_part = np.unique(self._part[which], return_inverse=True)
        line = self._u[: len(self._curve[0])]
        made = relative_brightness(irregularity, self._places(parts, line))
        found = made.T[np.arange(len(self._u)) % len(line)][:, of_part]
        ends = which >= self.tube_count
        if ends.any():  # all of a cap has the brightness of its end
            last = self._ring[which[ends] - self.tube_count] > 0
            found[:, ends] = np.where(last, *(made.T[k, of_part[ends]] for k in (-1, 0)))
        return found

    def make_irregular(self, points: NDArray[Any], irregularity: Irregularity) -> NDArray[Any]:
        """Move control points so that the yarns are irregular in position and width.

        Parameters
        ----------
        points : ndarray of float, shape (N, 3)
            Control points, wherever they have been moved.
        irregularity : Irregularity
            Amount and seed.

        Returns
        -------
        ndarray of float, shape (N, 3)
            Moved along the sides of the sections, so that yarns keep their heights and contacts.
        """
        moved = np.array(points)
        shift, widening = lateral_changes(
            irregularity, self._places(np.arange(len(self._number)), np.arange(4) / 3.0)
        )
        frames = np.empty((2, len(self._number), 4, 3))
        for count in set(self._around.tolist()):  # np.unique would import numpy.ma
            some = np.flatnonzero(self._around == count)
            rings = self._rings(some, int(count))
            there = points[rings].astype(np.float64)
            # From edge to edge: the middle of a swollen section is above them.
            middle = there.mean(axis=-2)
            side = there[..., 3, :] - there[..., 3 + rings.shape[-1] // 2, :]
            side /= np.linalg.norm(side, axis=-1, keepdims=True)
            frames[:, some] = middle, side
            across = ((there - middle[..., None, :]) * side[..., None, :]).sum(axis=-1)
            # Wider yarns at most touch their neighbours.
            room = 0.5 * self._lengths[0][some, None] / np.abs(across).max(axis=-1) - 1.0
            widening[some] = np.minimum(widening[some], np.maximum(room, 0.0))
            change = shift[some][..., None] + widening[some][..., None] * across
            moved[rings] = there + change[..., None] * side[..., None, :]
        closing = self._net[self.tube_count :].reshape(-1, 16)
        if len(closing):
            part = self._part[self.tube_count :], self._ring
            new = closing > self._net[: self.tube_count].max()
            middle, side = (each[part][:, None] for each in frames)
            there = points[closing].astype(np.float64)
            across = ((there - middle) * side).sum(axis=-1)
            change = shift[part][:, None] + widening[part][:, None] * across
            moved[closing[new]] = (there + change[..., None] * side)[new]
        return moved

    def _places(self, parts: Ints, fractions: AnyFloats) -> YarnPlaces:
        """Return the places at fractions of parts, (parts, fractions)."""
        begin, length = (each[parts, None] for each in self._along)
        along = begin + length * fractions
        columns = self._number[parts], *(each[parts] for each in self._lengths)
        yarn, *lengths = (np.broadcast_to(each[:, None], along.shape) for each in columns)
        return YarnPlaces(yarn, along, *lengths)

    def _rings(self, parts: Ints, count: int) -> Ints:
        """Return the control points of the four rings of parts, (parts, 4, points of a ring)."""
        ring = self._net[self._first[parts, None] + np.arange(count)][:, :, :3]
        return np.moveaxis(ring, 3, 1).reshape(len(parts), 4, -1)

    def shape_plies(
        self,
        points: NDArray[Any],
        weights: NDArray[Any] | None,
        views: Iterable[tuple[Ints, AnyFloats, AnyFloats]],
    ) -> None:
        """Move a surface in to its plies.

        Parameters
        ----------
        points : ndarray of float, shape (N, 3)
            Control points, wherever they have been moved.
        weights : ndarray of float, shape (N,), optional
            Weights of rational patches.
        views : iterable of tuple
            For runs of patches: their numbers, positions and normals, (samples, patches, 3); the
            last two are changed. See
            `spacemap_vtk.textile.patches.tessellation.Tessellation.views`.
        """
        middle, top, side = np.empty((3, len(self._around), 4, 3))
        for count in set(self._around.tolist()):  # np.unique would import numpy.ma
            some = np.flatnonzero(self._around == count)
            rings = points[self._rings(some, int(count))].astype(np.float64)
            middle[some], top[some], side[some] = ring_frames(rings)
        for which, surface, across in views:
            stop = int(np.searchsorted(which, self.tube_count))
            plied = self._plies[self._part[which]] > 1
            on = np.flatnonzero(plied[:stop])
            if len(on):
                made = self._shape_tubes(which[on], points, weights, middle)
                surface[:, on], across[:, on] = made
            closing = np.flatnonzero(plied[stop:]) + stop
            if len(closing):
                patch = which[closing]
                part, ring = self._part[patch], self._ring[patch - self.tube_count]
                axes = (each[part, ring] for each in (middle, top, side))
                surface[:, closing] = self._shape_caps(surface[:, closing], part, ring, *axes)

    def _shape_tubes(
        self, patch: Ints, points: NDArray[Any], weights: NDArray[Any] | None, middle: AnyFloats
    ) -> tuple[AnyFloats, AnyFloats]:
        """Compute positions and normals, (samples, patches, 3), on tubes."""
        part, net = self._part[patch], self._net[patch].reshape(-1, 16)
        size, first = len(self._u), middle[part, :1]
        nets, axis = points[net] - first, middle[part] - first
        if weights is None:
            place, by_u, by_v = np.split(self._basis @ nets, 3, axis=1)
            centre, pace = (matrix @ axis for matrix in self._curve)
        else:
            own, along = weights[net][..., None], weights[net[:, :4]][..., None]
            total = self._basis @ own
            place, by_u, by_v = np.split(self._basis @ (own * nets), 3, axis=1)
            place, (_, in_u, in_v) = place / total[:, :size], np.split(total, 3, axis=1)
            by_u = (by_u - place * in_u) / total[:, :size]
            by_v = (by_v - place * in_v) / total[:, :size]
            (centre, pace), (whole, change) = (
                [matrix @ values for matrix in self._curve] for values in (along * axis, along)
            )
            centre = centre / whole
            pace = (pace - centre * change) / whole
        at = np.arange(size) % len(self._curve[0])
        centre, pace = centre[:, at], pace[:, at]
        begin, span = self._phi[:, patch]
        turned, more = (each[part] for each in self._turned)
        phase = begin + turned + self._v[:, None] * span + self._u[:, None] * more
        reach, slope = (x.T[..., None] for x in ply_outline(phase, self._plies[part]))
        arm = place - centre
        along_ = reach * by_u + (1.0 - reach) * pace + slope * more[:, None, None] * arm
        round_ = reach * by_v + slope * span[:, None, None] * arm
        normal = np.cross(along_, round_)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        return (first + centre + reach * arm).swapaxes(0, 1), normal.swapaxes(0, 1)

    def _shape_caps(
        self,
        place: AnyFloats,
        part: Ints,
        ring: Ints,
        middle: AnyFloats,
        top: AnyFloats,
        side: AnyFloats,
    ) -> AnyFloats:
        """Compute positions on closed ends."""
        arm, half = place - middle, self._half[part]
        up, right = (
            np.einsum("snk,nk->sn", arm, axis) / np.square(axis).sum(axis=1) for axis in (top, side)
        )
        right = right * (1.0 + half)
        turn, length = np.arctan2(np.abs(right) - half, up), 2.0 * pi + 4.0 * half
        way = np.where(right >= half, turn, length - 2.0 * half - turn)
        flat = np.where(up < 0.0, pi + half - right, length - half + right)
        way = np.where(np.abs(right) < half, flat, way)
        turned = self._turned[0][part] + np.where(ring > 0, self._turned[1][part], 0.0)
        reach, _ = ply_outline(way / length + turned, self._plies[part])
        return middle + reach[..., None] * arm
