"""Exposure of a cloth's surface to light from all sides, for contact shadows.

Where yarns touch, less light arrives. A place is darkened in proportion to its depth below the mean
height of the cloth around it, for two radii of the surroundings ("Image enhancement by unsharp
masking the depth buffer", T. Luft, C. Colditz, O. Deussen, ACM Trans. Graph. 25, 2006), but here
the heights are those of the cloth at rest instead of the depths of a picture. So the result is the
same from everywhere, at every resolution and in motion, for pieces as for the whole, and nothing
gets a halo from what lies far before it.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from spacemap_vtk.ndarrays import AnyFloats, Floats, Singles
from spacemap_vtk.textile.geometry.axis_parts import sample_places
from spacemap_vtk.textile.geometry.cloth_axes import family_axes
from spacemap_vtk.textile.weave.cloth import Cloth

#: For each radius of the surroundings, in mean heights of yarns: darkening at a depth of that
#: radius, and the largest darkening.
SCALES = ((0.4, 0.75, 0.8), (1.1, 0.6, 0.65))
#: Largest number of samples of the heights between the axes of neighbouring yarns.
_SAMPLES = 12
#: Largest number of samples of the whole cloth.
_MOST_SAMPLES = 3_000_000
#: Share of a step by which samples are off round places.
_OFF_EDGES = 0.37
#: Height by which crowns between the widest facets are raised, as a share of the half height: the
#: mean exposure is then close to that of fine facets.
_BULGE = 1.1
#: Samples on each part of an axis.
_OF_PART = 4


class ClothExposure:
    """Mean heights of a cloth's two faces, from which the exposure of any place follows.

    Parameters
    ----------
    cloth : Cloth
        At rest; there must be room for its yarns.
    """

    def __init__(self, cloth: Cloth) -> None:
        count = int(min(_SAMPLES, max(2, sqrt(_MOST_SAMPLES / cloth.drawdown.size))))
        self._lines, height = [], 0.5 * cloth.diameter_sum
        for yarns, family in zip(cloth.yarns, cloth.families, strict=True):
            ends, margin = yarns.position[[0, -1]], max(family.width, 2.5 * height)
            # A crop of the cloth has the same samples as the whole; none is exactly at an edge.
            step = family.spacing / count
            first, last = np.floor((ends[0] - margin) / step), np.ceil((ends[1] + margin) / step)
            self._lines.append(step * (np.arange(first, last + 1.0) + _OFF_EDGES))
        top, bottom = _face_heights(cloth, self._lines)
        # Holes do not count.
        covered = np.isfinite(top)
        faces = [np.where(covered, face, np.float32(0.0)) for face in (top, -bottom)]
        self._half_height = 0.5 * height
        steps = [line[1] - line[0] for line in self._lines]
        self._scales, self._means = [], []
        for radius, slope, most in SCALES:
            sigma = [radius * height / step for step in steps]
            self._scales.append((slope / (radius * height), 1.0 - most))
            weight = _blur(covered.astype(np.float32), sigma)
            np.maximum(weight, np.float32(1e-3), out=weight)
            self._means.append([_blur(face, sigma) / weight for face in faces])

    def evaluate(self, places: AnyFloats, face: AnyFloats, facet: AnyFloats) -> Singles:
        """Compute the exposure of places on yarns.

        Parameters
        ----------
        places : ndarray of float, shape (N, 3)
            In the cloth at rest, in m.
        face : ndarray of float, shape (N,)
            1 on the top of a yarn, 0 on its sides, -1 below; NaN on its cut ends, which are free.
        facet : ndarray of float, shape (N,)
            Width of the facets between which values are interpolated, as a share of a quarter of
            the yarn's outline.

        Returns
        -------
        ndarray of float32, shape (N,)
            Near 0 in deep gaps, and 1 or more on free crowns: to be limited to 1 after it is
            interpolated. So the mean over wide facets is that over narrow ones.
        """
        index = np.stack(
            [
                (places[:, axis] - line[0]) / (line[1] - line[0])
                for axis, line in enumerate(self._lines)
            ]
        )
        cut = np.isnan(face)
        face = np.where(cut, 0.0, face)
        upper = np.clip(0.5 + face, 0.0, 1.0)
        # Between places on a round yarn, linear interpolation is below the yarn.
        height = places[:, 2] + _BULGE * self._half_height * facet**3 * face
        exposure = np.ones(len(places))
        interpolate = _bilinear_interpolator(self._means[0][0].shape, index)
        for (slope, least), means in zip(self._scales, self._means, strict=True):
            above, below = (interpolate(mean) for mean in means)
            depth = upper * (above - height) + (1.0 - upper) * (below + height)
            exposure *= np.maximum(1.0 - slope * depth, least)
        exposure[cut] = 1.0
        return exposure.astype(np.float32)


def _blur(image: Singles, sigmas: list[float]) -> Singles:
    """Blur an image with zeros around it by a Gaussian that is cut off at 2.5 sigma."""
    for sigma in sigmas:  # one axis after the other: the image is transposed twice
        radius = max(1, int(2.5 * sigma + 0.5))
        weights = np.exp(-0.5 / sigma**2 * np.arange(-radius, radius + 1) ** 2)
        weights /= weights.sum()
        wide = np.pad(image, ((radius, radius), (0, 0)))
        total = np.zeros_like(image)
        for first, weight in enumerate(weights):
            total += np.float32(weight) * wide[first : first + len(image)]
        image = np.ascontiguousarray(total.T)
    return image


def _bilinear_interpolator(shape: tuple[int, int], index: Floats) -> Callable[[Singles], Floats]:
    """Return a function that interpolates images of one shape at (2, N) positions in them."""
    last = np.array(shape)[:, None] - 1
    index = np.clip(index, 0.0, last)
    low = np.minimum(index.astype(np.int64), last - 1)
    right, up = index - low
    left, down = 1.0 - right, 1.0 - up
    first = low[0] * shape[1] + low[1]
    corners = [first + step for step in (0, 1, shape[1], shape[1] + 1)]

    def interpolate(image: Singles) -> Floats:
        one, two, three, four = (image.ravel()[corner] for corner in corners)
        return left * (down * one + up * two) + right * (down * three + up * four)

    return interpolate


def _face_heights(cloth: Cloth, lines: list[Floats]) -> tuple[Singles, Singles]:
    """Compute the heights of top and bottom face on a grid, infinite where there is no yarn."""
    shape = len(lines[0]), len(lines[1])
    top, bottom = np.full(shape, -np.inf, np.float32), np.full(shape, np.inf, np.float32)
    for number in (0, 1):
        yarns, (_, which) = cloth.yarns[number], cloth.yarn_groups[number]
        across, along = lines[number], lines[1 - number]
        position, radius = yarns.position, 0.5 * yarns.diameter
        nearest = np.searchsorted(0.5 * (position[1:] + position[:-1]), across)
        own = radius[nearest]
        beside = np.abs(across - position[nearest]) / (own * yarns.aspect)
        beside = np.clip(beside, 0.0, 1.0)
        if yarns.section == "racetrack":
            beside = np.maximum(yarns.aspect * beside - (yarns.aspect - 1.0), 0.0)
        profile = 1.0 - beside**2
        half = own * (profile if yarns.section == "lenticular" else np.sqrt(profile))
        covered = half > 0.0
        axes = _axis_heights(cloth, number, along)[which[nearest]]
        for face, sign, choose in ((top, 1.0, np.maximum), (bottom, -1.0, np.minimum)):
            mine = axes + (sign * half)[:, None]
            mine[~covered] = -sign * np.inf
            choose(face, mine if number == 0 else mine.T, out=face, casting="same_kind")
    return top, bottom


def _axis_heights(cloth: Cloth, number: int, along: Floats) -> Singles:
    """Compute the heights of one yarn of each group of equal yarns, (groups, places)."""
    chosen, _ = cloth.yarn_groups[number]
    found = np.empty((len(chosen), len(along)), np.float32)
    for block in cloth.yarn_blocks(number, len(chosen)):
        axes = family_axes(cloth, number, chosen[block])
        part, station, fraction = sample_places(axes, _OF_PART)
        place, height, _ = axes.evaluate(part, station, fraction)
        count = np.bincount(station - part, minlength=len(axes.parts))
        begin = np.cumsum(count) - count
        for row, (first, size) in enumerate(zip(begin, count, strict=True)):
            some = slice(first, first + size)
            found[block.start + row] = np.interp(along, place[some], height[some])
    return found
