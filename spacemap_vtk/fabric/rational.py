"""Rational Bézier patches: positions and normals from homogeneous coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.tessellation import Tessellation

#: A normal shorter than this share of the patch's longest one is the rounding of a zero.
_DEGENERATE = 1e-9


def evaluate_rational(
    tessellation: Tessellation, control_points: ArrayLike, weights: ArrayLike
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the surface points and unit normals of rational patches.

    With h = Σ B w p and w = Σ B w, a point is h / w and its derivative along u is parallel to
    h_u w - h w_u (Piegl and Tiller, "The NURBS Book", 4.3).

    Parameters
    ----------
    tessellation : Tessellation
        Of the patches' connectivity.
    control_points : (N, 3) array_like
        In m.
    weights : (N,) array_like
        Positive weights of the control points.

    Returns
    -------
    positions : (P (n + 1)**2, 3) float32
        In m.
    normals : (P (n + 1)**2, 3) float32
        Unit vectors. Where both derivatives are parallel, as at the corners of a disc, the normal
        of the middle of the patch.

    Raises
    ------
    InputError
        If a weight is not positive.
    """
    points, weight = np.asarray(control_points, np.float64), np.asarray(weights, np.float64)
    if not (weight > 0.0).all():
        raise InputError("rational weights must be positive", value=float(weight.min()))
    # Far from the origin the products h_u w and h w_u would cancel.
    middle = points.mean(axis=0)
    homogeneous = np.column_stack([(points - middle) * weight[:, None], weight])
    h, hu, hv = (tessellation.interpolate(homogeneous, along=along) for along in ("", "u", "v"))
    positions = h[:, :3] / h[:, 3:]
    du, dv = (d[:, :3] * h[:, 3:] - h[:, :3] * d[:, 3:] for d in (hu, hv))
    normals = np.cross(du, dv)
    length = np.linalg.norm(normals, axis=1)
    _replace_degenerate(tessellation, normals, length)
    normals /= np.where(length > 0.0, length, 1.0)[:, None]
    return (positions + middle).astype(np.float32), normals.astype(np.float32)


def _replace_degenerate(
    tessellation: Tessellation, normals: NDArray[np.float64], length: NDArray[np.float64]
) -> None:
    bad = length <= _DEGENERATE * length.max(initial=0.0)
    if not bad.any():
        return
    # The polygons of a patch tell which points are its own.
    quads = tessellation.quads
    patch = np.empty(len(normals), dtype=np.int64)
    patch[quads] = tessellation.patch_of_cell[:, None]
    total = np.stack(
        [np.bincount(patch, normals[:, axis], tessellation.patch_count) for axis in range(3)],
        axis=1,
    )
    normals[bad] = total[patch[bad]]
    length[bad] = np.linalg.norm(normals[bad], axis=1)
