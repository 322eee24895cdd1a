"""Points, tangents and areas of sections on the Bézier patches of yarns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats, Ints
from spacemap_vtk.textile.patches.bezier import (
    bernstein,
    bernstein_derivative,
    quadrilateral_order,
)

#: Facets of each patch around a yarn and along it.
_AROUND, _ALONG = 32, 12


class YarnSurfaces(NamedTuple):
    """Points on the tubes of yarns; the second axis runs around a yarn, the third along it."""

    points: Floats
    """(patches, m, n, 3) [m]."""
    tangents: Floats
    """(patches, m, n, 3) Along the yarn, of any length."""
    area: Floats
    """(patches, m, n) Area of the section over the mean of the yarn."""
    yarn: Ints
    """(patches,)"""


def sample_surfaces(
    points: AnyFloats,
    patches: AnyInts,
    weights: Floats | None,
    yarn: AnyInts,
    low: Floats,
    high: Floats,
) -> YarnSurfaces:
    """Sample the tubes of yarns at the corners of their facets; caps are left out.

    Parameters
    ----------
    points : ndarray, shape (N, 3)
        Control points [m].
    patches : ndarray of int, shape (P, 16)
        Control points of each patch in VTK's order. On tubes u runs along the yarn and v around
        it, and the patches around a part follow each other.
    weights : ndarray, shape (N,), optional
        Rational weights.
    yarn : ndarray of int, shape (P,)
        Yarn of each patch.
    low, high : ndarray, shape (2,)
        Corners of a box along x and y [m]; parts outside it are left out.

    Returns
    -------
    YarnSurfaces
        Points, tangents and areas of sections.
    """
    net: Ints = np.asarray(patches, np.int64)[:, quadrilateral_order(3, 3)].reshape(-1, 4, 4)
    starts, counts = _find_rings(net)
    corners = points[net.reshape(len(net), -1), :2]
    near = (corners.max(axis=1) >= low).all(axis=1) & (corners.min(axis=1) <= high).all(axis=1)
    seen = np.append(0, np.cumsum(near))
    used = seen[starts + counts] > seen[starts]
    starts, counts = starts[used], counts[used]
    tube = np.repeat(starts, counts) + np.concatenate([np.arange(n) for n in counts])
    net, owner = net[tube], np.asarray(yarn, np.int64)[tube]
    ring = np.cumsum(counts) - counts
    v, u = np.linspace(0, 1, _AROUND + 1), np.linspace(0, 1, _ALONG + 1)
    bases = bernstein(3, v), bernstein(3, u), bernstein_derivative(3, u)
    weight = np.ones(net.shape) if weights is None else weights[net]
    control = points[net].astype(np.float64) * weight[..., None]

    def evaluate(values: Floats, along: Floats) -> Floats:
        made: Floats = np.einsum("pjic,vj,ui->pvuc", values, bases[0], along, optimize=True)
        return made

    position, slope = (evaluate(control, basis) for basis in bases[1:])
    if weights is not None:
        size, change = (evaluate(weight[..., None], basis) for basis in bases[1:])
        position = position / size
        slope = (slope - position * change) / size
    # Twice the vector area of each section, along the mean tangent.
    double = np.add.reduceat(np.cross(position[:, :-1], position[:, 1:]).sum(axis=1), ring)
    mean = np.add.reduceat(slope.mean(axis=1), ring)
    mean /= np.linalg.norm(mean, axis=-1, keepdims=True)
    area = abs(np.einsum("qnc,qnc->qn", double, mean)) / 2
    number = owner[ring]
    totals = np.bincount(number, area.mean(axis=1)) / np.maximum(np.bincount(number), 1)
    share = np.repeat(area / totals[number][:, None], counts, axis=0)
    share = np.repeat(share[:, None], _AROUND + 1, axis=1)
    return YarnSurfaces(position, slope, share, owner)


def _find_rings(net: Ints) -> tuple[Ints, Ints]:
    """Find the patches around each part of a tube: the first one, and their number."""
    first, last = net[:, 0], net[:, 3]
    joined = (last[:-1] == first[1:]).all(axis=1)
    starts = np.flatnonzero(np.concatenate([[True], ~joined]))
    counts = np.diff(np.append(starts, len(net)))
    closed = (last[starts + counts - 1] == first[starts]).all(axis=1)
    return starts[closed], counts[closed]
