"""Normals of single places on Bézier patches, degenerate ones too."""

from __future__ import annotations

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


def robust_normals(
    nets: NDArray[Any],
    degree: tuple[int, int],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    weights: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return unit normals, never NaN for finite control points.

    Parameters
    ----------
    nets : (n, (p + 1)(q + 1), 3) float
        Control points of the patch that each place is on, u fastest.
    degree : (int, int)
        Degrees p and q.
    u, v : (n,) float64
        Parameters of each place.
    weights : (n, (p + 1)(q + 1)) float64, optional
        Those of rational patches; all 1 by default.

    Returns
    -------
    (n, 3) float64
        ``du x dv`` normalised. Where that vanishes, next to what it is slightly inside the patch,
        the normal there; failing that the one in the middle of the patch; for a patch without
        area a vector across it, or z.
    """
    local = nets.astype(np.float64)
    local -= local[:, :1].copy()
    size = np.abs(local).max(axis=(1, 2), keepdims=True)
    local /= np.where(size > 0, size, 1.0)

    here, along = _area_element(local, degree, u, v, weights)
    inside, _ = _area_element(local, degree, _inwards(u), _inwards(v), weights)
    # across the longest direction: what has no area may still be a line
    axis = np.eye(3)[np.abs(along).argmin(axis=1)]
    across = np.cross(along, axis)
    result = np.broadcast_to(np.array([0.0, 0.0, 1.0]), here.shape).copy()
    usable = _length(across) > 0
    result[usable] = across[usable]
    usable = _length(inside) > _NOTHING
    if not usable.all():
        half = np.full_like(u, 0.5)
        middle, _ = _area_element(local, degree, half, half, weights)
        better = _length(middle) > _NOTHING
        result[better] = middle[better]
    result[usable] = inside[usable]
    usable = _length(here) > np.maximum(_NOTHING, _INSIDE * _length(inside))
    result[usable] = here[usable]
    broken = ~np.isfinite(local).all(axis=(1, 2))
    result[broken] = np.nan
    return result / _length(result)[:, None]


def _inwards(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(t <= 0.5, t + _INSIDE, t - _INSIDE)


def _length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = np.sqrt((vectors**2).sum(axis=1))
    return result


def _area_element(
    nets: NDArray[np.float64],
    degree: tuple[int, int],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ``du x dv`` and the longer of ``du`` and ``dv``."""
    p, q = degree
    if weights is not None:
        nets = np.concatenate([nets * weights[..., None], weights[..., None]], axis=2)
    grid = nets.reshape(len(nets), q + 1, p + 1, -1)
    here, along_u = bernstein(p, u), bernstein_derivative(p, u)
    there, along_v = bernstein(q, v), bernstein_derivative(q, v)
    du = np.einsum("nj,ni,njik->nk", there, along_u, grid, optimize=False)
    dv = np.einsum("nj,ni,njik->nk", along_v, here, grid, optimize=False)
    if weights is not None:
        value = np.einsum("nj,ni,njik->nk", there, here, grid, optimize=False)
        point = value[:, :3] / value[:, 3:]
        du, dv = ((d[:, :3] - point * d[:, 3:]) / value[:, 3:] for d in (du, dv))
    longer = np.where((_length(du) >= _length(dv))[:, None], du, dv)
    return np.cross(du, dv), longer
