"""Twist and plies of yarns: how fibres wind about them, and the grooves between their plies.

Appearance alone: mechanics, mass and contact know the section that holds all plies. Fibres lie on
helices, as in the idealised yarn of J. W. S. Hearle, P. Grosberg and S. Backer (1969, chapter 2):
at the surface of a yarn of diameter d and T turns in a length they lean by ``tan(angle) = pi d T``.
Z twist is a right-handed screw, and T above 0 (ISO 2:1973). Tubes of `spacemap_vtk.fabric.sweep`
count their way round, phi in turns, against that screw: what winds with the twist keeps
``phi + T s``, s along the yarn.

The plies of a yarn touch the circle that its section is, are pressed into each other, and turn with
the twist: an outline that is drawn between the section's middle and its rim, so that flattened
sections have flattened plies (L. R. G. Treloar, "The Geometry of Multi-ply Yarns", J. Textile Inst.
47 (1956) T348, has plies as circles about a common axis).
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
from spacemap_vtk.fabric.bezier import bernstein, bernstein_derivative, quadrilateral_order
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.section import section
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Ints

#: Middles of plies, nearer to the yarn's than of circles that touch: they flatten each other.
_PRESSED = 0.8
#: How sharp the grooves are: at 1 circles would meet in an edge, between samples of a surface.
_SHARP = 0.985
#: In turns, from the beginning of a yarn to that of the next: no number of yarns comes round to it.
APART = 0.6180339887498949
#: Samples round a yarn that each ply needs to be made, and not only shaded.
_LEAST_SAMPLES = 4
_ORDER = quadrilateral_order(3, 3)


def middle_of_plies(plies: AnyFloats) -> AnyFloats:
    """Return how far the middles of plies are from the yarn's, as a share of its radius."""
    return _PRESSED / (1.0 + np.sin(pi / plies))


def outline(phase: AnyFloats, plies: AnyFloats) -> tuple[AnyFloats, AnyFloats]:
    """Return how far plies reach, 1 on crowns, and its slope by the phase: turns from a crown."""
    middle = middle_of_plies(plies)
    wave, rise = np.sin(pi * plies * phase), np.cos(pi * plies * phase)
    turn = 2.0 / plies * np.arcsin(_SHARP * wave)
    by_phase = 2.0 * pi * _SHARP * rise / np.sqrt(1.0 - (_SHARP * wave) ** 2)
    sin, cos = np.sin(turn), np.cos(turn)
    root = np.sqrt((1.0 - middle) ** 2 - (middle * sin) ** 2)
    reach = middle * cos + root
    return reach, -middle * sin * (1.0 + middle * cos / root) * by_phase


@lru_cache
def sharpness(plies: int) -> float:
    """Return how many times as curved an outline of plies is as the circle that is about them.

    Parameters
    ----------
    plies : int
        Number of plies.

    Returns
    -------
    float
        1 for singles.
    """
    if plies == 1:
        return 1.0
    step = 1e-4
    phase = np.arange(0.0, 1.0 / plies + 3 * step, step)
    angle, (reach, _) = 2.0 * pi * phase, outline(phase, np.full(len(phase), float(plies)))
    curve = np.stack([reach * np.cos(angle), reach * np.sin(angle)])
    return float(np.linalg.norm(np.diff(curve, 2), axis=0).max() / (2.0 * pi * step) ** 2)


def frames(rings: AnyFloats) -> tuple[AnyFloats, AnyFloats, AnyFloats]:
    """Return the middles of rings, (..., size, 3), and the vectors to their top and their side."""
    middle = rings.mean(axis=-2)
    top = 0.5 * (rings[..., 0, :] + rings[..., -3 if rings.shape[-2] > 12 else 0, :])
    return middle, top - middle, rings[..., 3, :] - middle


class Strands:
    """Where fibres and plies run on the patches of a cloth, whatever these are moved to.

    Parameters
    ----------
    patches : ndarray of int, shape (P, 16)
        Of a cloth, or of a piece of it, as `spacemap_vtk.fabric.weave.build` makes them.
    cloth : Cloth
        Theirs.
    places : ndarray of float, shape (parts, 4)
        Their `Weave.places`.
    sides : int
        Quadrilaterals along each side of a patch.

    Raises
    ------
    GeometryError
        The patches are not those of the places.
    """

    def __init__(self, patches: AnyInts, cloth: Cloth, places: AnyFloats, sides: int) -> None:
        yarn = places[:, 2].astype(np.int64)
        own = (yarn >= cloth.size[0]).astype(int)
        shapes = [section(t.shape, t.aspect, cloth.exact) for t in cloth.threads]
        around = np.array([shape.size // 3 for shape in shapes])[own]
        line = np.flatnonzero(np.diff(yarn, prepend=-1))
        ends = np.stack([line, np.append(line[1:], len(yarn)) - 1], axis=1)
        closing = np.repeat(around[line] // 2, 2) * cloth.caps
        if around.sum() + closing.sum() != len(patches):
            raise GeometryError(
                f"{len(patches)} patches are not those of a cloth's {len(yarn)} parts of yarns",
                allowed=f"{around.sum() + closing.sum()} patches",
            )
        self._net = patches[:, _ORDER].reshape(-1, 4, 4)
        self._around, self._first = around, np.cumsum(around) - around
        self.tubes = int(around.sum())
        #: Of each patch its part of a yarn; of those that close it, the last ring, too.
        self._part = np.concatenate(
            [np.repeat(np.arange(len(yarn)), around), np.repeat(ends.ravel(), closing)]
        )
        self._ring = np.repeat(np.tile([0, 3], len(line)), closing)
        half = np.array([s.aspect - 1.0 if s.size > 12 else 0.0 for s in shapes])[own]
        self._half = half
        # from the top's end over the side; a racetrack has flats between its quarters
        quarter, length = 0.5 * pi, 2.0 * pi + 4.0 * half
        part = self._part[: self.tubes]
        step, flattened = np.arange(self.tubes) - self._first[part], around[part] > 4
        flats, flat = flattened & (step > 2), flattened & (step % 3 == 2)
        begun = quarter * (step - flats) + 2.0 * half[part] * flats
        long = np.where(flat, 2.0 * half[part], quarter)
        self._phi = np.stack([begun, long]) / length[part]
        turns, plies, diameter = (values[yarn] for values in cloth.strands)
        self._plies, self._diameter = plies, diameter
        self._along = places[:, 0], places[:, 1] - places[:, 0]
        # looms do not turn bobbins alike: plies beside each other begin anywhere
        begin = turns * places[:, 0] + APART * places[:, 3]
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
        #: Whether plies are made; where there are too few samples they can only be shaded.
        self.made = self.makes_plies(sides)

    def makes_plies(self, sides: int) -> bool:
        """Return whether plies are made, and not only shaded.

        Parameters
        ----------
        sides : int
            Quadrilaterals along each side of a patch.

        Returns
        -------
        bool
            False where there are too few samples.
        """
        most, winds = self._most, self._winds
        return most > 1 and 4 * sides >= _LEAST_SAMPLES * most and sides >= 2.0 * winds

    def with_sides(self, sides: int) -> Strands:
        """Return the same strands on other facets.

        Parameters
        ----------
        sides : int
            Quadrilaterals along each side of a patch.

        Returns
        -------
        Strands
            Sampled so.
        """
        other = copy(self)
        other._sample(sides)
        return other

    def coordinates(self, which: Ints) -> AnyFloats:
        """Return what shading needs at the samples of some patches.

        Parameters
        ----------
        which : ndarray of int
            Numbers of patches, in ascending order.

        Returns
        -------
        ndarray of float32, shape (samples, patches, 3)
            What stays along a fibre, in turns of the yarn; phase of the plies, in plies from a
            crown, where they are to be shaded and are not made; place along the yarn in diameters.
            0 on what closes tubes.
        """
        part = self._part[which]
        found = np.zeros((len(self._u), len(part), 3), np.float32)
        tubes = int(np.searchsorted(which, self.tubes))
        part = part[:tubes]
        phi, turned, along = self._ways(which[:tubes], part)
        plied = self._plies[part] > 1
        # of plies the fibres run about along the yarn: they are twisted against their singles
        found[:, :tubes, 0] = phi + np.where(plied, 0.0, turned)
        if not self.made:
            found[:, :tubes, 1] = np.where(plied, self._plies[part] * (phi + turned), 0.0)
        found[:, :tubes, 2] = along / self._diameter[part]
        return found

    def _ways(self, which: Ints, part: Ints) -> tuple[AnyFloats, AnyFloats, AnyFloats]:
        """Return the way round, turns and the way along at the samples of patches on tubes."""
        begin, span = self._phi[:, which]
        turned, more = (each[part] for each in self._turned)
        along, further = (each[part] for each in self._along)
        u, v = self._u[:, None], self._v[:, None]
        return begin + v * span, turned + u * more, along + u * further

    def make(
        self,
        points: NDArray[Any],
        weights: NDArray[Any] | None,
        views: Iterable[tuple[Ints, AnyFloats, AnyFloats]],
    ) -> None:
        """Draw a surface in to its plies.

        Parameters
        ----------
        points : ndarray of float, shape (N, 3)
            Control points, wherever they have been moved to.
        weights : ndarray of float, shape (N,), optional
            Of rational patches.
        views : iterable of tuple
            Of runs of patches their numbers, and positions and normals, (samples, patches, 3); both
            are changed. See `spacemap_vtk.fabric.tessellation.Tessellation.views`.
        """
        middle, top, side = np.empty((3, len(self._around), 4, 3))
        for count in np.unique(self._around):
            some = np.flatnonzero(self._around == count)
            ring = self._net[self._first[some, None] + np.arange(count)][:, :, :3]
            ring = np.moveaxis(ring, 3, 1).reshape(len(some), 4, -1)
            middle[some], top[some], side[some] = frames(points[ring].astype(np.float64))
        for which, surface, across in views:
            stop = int(np.searchsorted(which, self.tubes))
            plied = self._plies[self._part[which]] > 1
            on = np.flatnonzero(plied[:stop])
            if len(on):
                made = self._tube(which[on], points, weights, middle)
                surface[:, on], across[:, on] = made
            closing = np.flatnonzero(plied[stop:]) + stop
            if len(closing):
                patch = which[closing]
                part, ring = self._part[patch], self._ring[patch - self.tubes]
                axes = (each[part, ring] for each in (middle, top, side))
                surface[:, closing] = self._cap(surface[:, closing], part, ring, *axes)

    def _tube(
        self, patch: Ints, points: NDArray[Any], weights: NDArray[Any] | None, middle: AnyFloats
    ) -> tuple[AnyFloats, AnyFloats]:
        """Return positions and normals, (samples, patches, 3)."""
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
        reach, slope = (x.T[..., None] for x in outline(phase, self._plies[part]))
        arm = place - centre
        along_ = reach * by_u + (1.0 - reach) * pace + slope * more[:, None, None] * arm
        round_ = reach * by_v + slope * span[:, None, None] * arm
        normal = np.cross(along_, round_)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        return (first + centre + reach * arm).swapaxes(0, 1), normal.swapaxes(0, 1)

    def _cap(
        self,
        place: AnyFloats,
        part: Ints,
        ring: Ints,
        middle: AnyFloats,
        top: AnyFloats,
        side: AnyFloats,
    ) -> AnyFloats:
        """Return positions on closed ends."""
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
        reach, _ = outline(way / length + turned, self._plies[part])
        return middle + reach[..., None] * arm
