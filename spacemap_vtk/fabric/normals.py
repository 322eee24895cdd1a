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

    here, along = _area_element(local, degree, u, v, weights)
    inside, _ = _area_element(local, degree, _inwards(u), _inwards(v), weights)
    # across the longest direction: what has no area may still be a line
    axis = np.eye(3)[:, np.abs(along).argmin(axis=0)]
    across = np.cross(along, axis, axis=0)
    result = np.zeros_like(here)
    result[2] = 1.0
    usable = _length(across) > 0
    result[:, usable] = across[:, usable]
    usable = _length(inside) > _NOTHING
    if not usable.all():
        half = np.full_like(u, 0.5)
        middle, _ = _area_element(local, degree, half, half, weights)
        better = _length(middle) > _NOTHING
        result[:, better] = middle[:, better]
    result[:, usable] = inside[:, usable]
    usable = _length(here) > np.maximum(_NOTHING, _INSIDE * _length(inside))
    result[:, usable] = here[:, usable]
    broken = ~np.isfinite(local).all(axis=(0, 1))
    result[:, broken] = np.nan
    return (result / _length(result)).T


def _inwards(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(t <= 0.5, t + _INSIDE, t - _INSIDE)


def _length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = np.sqrt((vectors**2).sum(axis=0))
    return result


def _area_element(
    nets: NDArray[np.float64],
    degree: tuple[int, int],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ``du x dv`` and the longer of ``du`` and ``dv``, (3, n), of nets (size, 3, n)."""
    p, q = degree
    (here, along_u), (there, along_v) = _basis(p, u), _basis(q, v)
    du = _evaluated(nets, there, along_u, weights)
    dv = _evaluated(nets, along_v, here, weights)
    if weights is not None:
        value = _evaluated(nets, there, here, weights)
        point = value[:3] / value[3]
        du, dv = ((d[:3] - point * d[3]) / value[3] for d in (du, dv))
    longer = np.where(_length(du) >= _length(dv), du, dv)
    return np.cross(du, dv, axis=0), longer


def _basis(degree: int, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Bernstein polynomials and their derivatives, each (degree + 1, n)."""
    if len(t) > _FEW:
        return _made_basis(degree, t)
    return _kept_basis(degree, t.tobytes())


@lru_cache(maxsize=32)
def _kept_basis(degree: int, t: bytes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return _made_basis(degree, np.frombuffer(t))  # the same places at each step of a motion


def _made_basis(
    degree: int, t: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # The places stand at a few parameters, where they are on a regular grid.
    few, which = np.unique(t, return_inverse=True)
    return bernstein(degree, few).T[:, which], bernstein_derivative(degree, few).T[:, which]


def _evaluated(
    nets: NDArray[np.float64],
    along_v: NDArray[np.float64],
    along_u: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """Return the sum over each net, weighted by a function of v times one of u; with its weight."""
    basis = (along_v[:, None] * along_u[None]).reshape(len(nets), -1)
    if weights is None:
        result: NDArray[np.float64] = np.einsum("mn,mkn->kn", basis, nets)
        return result
    basis *= weights
    return np.concatenate((np.einsum("mn,mkn->kn", basis, nets), basis.sum(axis=0)[None]))
