"""Normals at single points of Bézier patches, including degenerate ones."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative
from spacemap_vtk.textile.patches.patch_chunks import Chunk, multiply

# Distance, in the patch parameter, at which the normal is evaluated where it is undefined. The area
# element grows in proportion to the distance from a collapsed edge, so this is also roughly the
# share of the area element that counts as zero.
_INSIDE = 1e-3
# Rounding error of an area element, relative to the square of the patch's size.
_LEAST_AREA = 1e-12


class RobustNormals:
    """Normals of selected samples of a chunk's patches, the same ones at each step of a motion."""

    # The samples lie at few places of the grid, and several patches share a place, as at the pole
    # of a cap. So one product evaluates each place on each patch.

    def __init__(
        self, chunk: Chunk, found: NDArray[np.intp], degree: tuple[int, int], subdivisions: int
    ) -> None:
        #: Indices of the samples in the chunk.
        self.samples = found
        sample, patch = np.divmod(found, chunk.patch_count)
        samples, self._row = np.unique(sample, return_inverse=True)
        patches, self._column = np.unique(patch, return_inverse=True)
        self._nets = np.ascontiguousarray(chunk.net(patches).T)
        v, u = np.array(np.divmod(samples, subdivisions + 1)) / subdivisions
        self._bases = _bases(
            degree, np.concatenate([u, _move_inwards(u)]), np.concatenate([v, _move_inwards(v)])
        )
        self._places = np.concatenate([self._row, self._row + len(u)]) * len(patches)
        self._places += np.concatenate([self._column, self._column])
        self._middle = _bases(degree, *np.full((2, 1), 0.5))

    def compute(
        self,
        points: NDArray[Any],
        weights: NDArray[Any] | None = None,
        loops: ModuleType | None = None,
    ) -> Floats:
        """Compute unit normals, (n, 3); never NaN for finite control points."""
        if loops is not None and weights is None:
            made = np.empty((len(self.samples), 3))
            places = self._nets, self._row, self._column
            if loops.robust_normals(points, *places, self._bases, _INSIDE, _LEAST_AREA, made):
                return made
        # The index of the place is last, so that every operation runs over contiguous memory.
        local = points.take(self._nets, axis=0).transpose(2, 0, 1).astype(np.float64, order="C")
        local -= local[:, :1].copy()
        size = np.abs(local).max(axis=(0, 1))
        local /= np.where(size > 0, size, 1.0)
        if weights is not None:
            weights = weights[self._nets].astype(np.float64)
        du, dv = _tangents(self._bases, local, weights, self._places)
        both = _cross(du, dv)
        lengths, count = _length(both), len(self.samples)
        here, length = both[:, :count], lengths[:count]
        inside, within = both[:, count:], lengths[count:]
        clear = length > np.maximum(_LEAST_AREA, _INSIDE * within)
        if (within > _LEAST_AREA).all():  # as at the poles of caps
            return (np.where(clear, here, inside) / np.where(clear, length, within)).T
        # Use a normal to the longest direction: a patch without area may still be a line.
        du, dv = du[:, :count], dv[:, :count]
        along = np.where(_length(du) >= _length(dv), du, dv)
        across = _cross(along, np.eye(3)[:, np.abs(along).argmin(axis=0)])
        result = np.zeros_like(here)
        result[2] = 1.0
        usable = _length(across) > 0
        result[:, usable] = across[:, usable]
        middle = _cross(*_tangents(self._middle, local, weights, self._column))
        for usable, other in (
            (_length(middle) > _LEAST_AREA, middle),
            (within > _LEAST_AREA, inside),
            (clear, here),
        ):
            result[:, usable] = other[:, usable]
        finite = np.isfinite(local[..., self._column]).all(axis=(0, 1))
        result[:, ~finite] = np.nan
        return (result / _length(result)).T


def _move_inwards(t: Floats) -> Floats:
    return np.where(t <= 0.5, t + _INSIDE, t - _INSIDE)


def _length(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("kn,kn->n", vectors, vectors))


def _cross(a: Floats, b: Floats) -> Floats:
    rows = [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.array(rows)


def _tangents(
    bases: Floats, local: Floats, weights: Floats | None, places: NDArray[np.intp]
) -> Floats:
    """Compute ``du`` and ``dv``, (2, 3, n), of nets (3, size, patches) at selected places."""
    used = bases if weights is not None else bases[1:]
    matrix = used.reshape(-1, bases.shape[2])

    def at_places(nets: Floats) -> Floats:
        values = np.empty((len(nets), len(matrix), nets.shape[2]))
        multiply(matrix, nets, values)
        return values.reshape(len(nets) * len(used), -1).take(places, axis=1)

    if weights is None:
        return at_places(local).reshape(3, 2, -1).swapaxes(0, 1)
    value, du, dv = at_places(local * weights).reshape(3, 3, -1).swapaxes(0, 1)
    weight, along_u, along_v = at_places(weights[None])
    point = value / weight
    slopes = np.stack([du - point * along_u, dv - point * along_v])
    return slopes / weight


def _bases(degree: tuple[int, int], u: Floats, v: Floats) -> Floats:
    """Compute weights of control points for the value, for du and for dv, (3, n, size)."""
    (here, along_u), (there, along_v) = (
        (bernstein(p, t), bernstein_derivative(p, t)) for p, t in zip(degree, (u, v), strict=True)
    )
    terms = (there, here), (there, along_u), (along_v, here)
    return np.array([(b[:, :, None] * a[:, None]).reshape(len(u), -1) for b, a in terms])
