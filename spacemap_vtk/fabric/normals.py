"""Normals of single places on Bézier patches, degenerate ones too."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric.bezier import bernstein, bernstein_derivative

# How far inside, in parameter, the normal is taken where it is undefined. The area element grows
# in proportion to the distance from a collapsed edge, so this is also about the share of the
# area element that counts as none.
_INSIDE = 1e-3
# Rounding of an area element, next to the square of the patch's size.
_NOTHING = 1e-12
# Places that take as long to prepare as to evaluate, which happens again at each step of a motion.
_FEW = 1000


def robust_normals(
    nets: NDArray[Any],
    degree: tuple[int, int],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    weights: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return unit normals, never NaN for finite control points."""
    # Places last, so that every operation runs over contiguous memory.
    local = np.ascontiguousarray(np.moveaxis(nets, 0, 2), dtype=np.float64)
    local = local - local[:1]
    size = np.abs(local).max(axis=(0, 1))
    local /= np.where(size > 0, size, 1.0)
    if weights is not None:
        weights = np.ascontiguousarray(weights.T)

    du, dv = _slopes(local, degree, u, v, weights)
    here = _cross(du, dv)
    inside = _cross(*_slopes(local, degree, _inwards(u), _inwards(v), weights))
    length, within = _length(here), _length(inside)
    clear = length > np.maximum(_NOTHING, _INSIDE * within)
    if (within > _NOTHING).all():  # as at the poles of caps
        return (np.where(clear, here, inside) / np.where(clear, length, within)).T
    # across the longest direction: what has no area may still be a line
    along = np.where(_length(du) >= _length(dv), du, dv)
    across = _cross(along, np.eye(3)[:, np.abs(along).argmin(axis=0)])
    result = np.zeros_like(here)
    result[2] = 1.0
    usable = _length(across) > 0
    result[:, usable] = across[:, usable]
    half = np.full_like(u, 0.5)
    middle = _cross(*_slopes(local, degree, half, half, weights))
    for usable, other in (
        (_length(middle) > _NOTHING, middle),
        (within > _NOTHING, inside),
        (clear, here),
    ):
        result[:, usable] = other[:, usable]
    broken = ~np.isfinite(local).all(axis=(0, 1))
    result[:, broken] = np.nan
    return (result / _length(result)).T


def _inwards(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(t <= 0.5, t + _INSIDE, t - _INSIDE)


def _length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = np.sqrt(np.einsum("kn,kn->n", vectors, vectors))
    return result


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.array(rows)


def _slopes(
    nets: NDArray[np.float64],
    degree: tuple[int, int],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ``du`` and ``dv``, (3, n), of nets (size, 3, n)."""
    few = len(u) <= _FEW  # which are the same places at each step of a motion
    bases = _kept_bases(degree, u.tobytes(), v.tobytes()) if few else _bases(degree, u, v)
    if weights is None:
        du, dv = (np.einsum("mn,mkn->kn", basis, nets) for basis in bases[1:])
        return du, dv
    bases = bases * weights
    value, du, dv = np.einsum("bmn,mkn->bkn", bases, nets)
    weight, along_u, along_v = bases.sum(axis=1)
    point = value / weight
    return (du - point * along_u) / weight, (dv - point * along_v) / weight


@lru_cache(maxsize=16)
def _kept_bases(degree: tuple[int, int], u: bytes, v: bytes) -> NDArray[np.float64]:
    return _bases(degree, np.frombuffer(u), np.frombuffer(v))


def _bases(
    degree: tuple[int, int], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return what each control point counts in the value, in du and in dv, (3, size, n)."""
    (here, along_u), (there, along_v) = (_basis(p, t) for p, t in zip(degree, (u, v), strict=True))
    terms = (there, here), (there, along_u), (along_v, here)
    return np.array([(b[:, None] * a[None]).reshape(-1, len(u)) for b, a in terms])


def _basis(degree: int, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Bernstein polynomials and their derivatives, each (degree + 1, n)."""
    # The places stand at a few parameters, where they are on a regular grid.
    few, which = np.unique(t, return_inverse=True)
    return bernstein(degree, few).T[:, which], bernstein_derivative(degree, few).T[:, which]
