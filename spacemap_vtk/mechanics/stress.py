"""Stress of tetrahedra, in the axes of the fabric (x weft, y warp, z normal)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def von_mises(stress: FloatArray) -> FloatArray:
    """Return the von Mises stress.

    Parameters
    ----------
    stress : ndarray of float64, shape (T, 6)
        Components xx, yy, zz, yz, zx, xy [Pa].

    Returns
    -------
    ndarray of float64, shape (T,)
        In Pa.
    """
    x, y, z, yz, zx, xy = stress.T
    normal = (x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2
    return np.asarray(np.sqrt(0.5 * normal + 3.0 * (yz**2 + zx**2 + xy**2)))


def symmetric_tensors(components: FloatArray, *, engineering: bool) -> FloatArray:
    """Return strains or stresses in VTK's order of a symmetric tensor.

    Parameters
    ----------
    components : ndarray of float64, shape (T, 6)
        As xx, yy, zz, yz, zx, xy.
    engineering : bool
        Whether shears are in engineering measure, and to be halved.

    Returns
    -------
    ndarray of float64, shape (T, 6)
        As xx, yy, zz, xy, yz, xz, of a tensor.
    """
    result = components[:, [0, 1, 2, 5, 3, 4]]
    if engineering:
        result[:, 3:] *= 0.5
    return result
