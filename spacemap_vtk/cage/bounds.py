"""The box that a cage fills."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: Thickness given to a flat object's box, as a share of its largest side.
FLAT_SHARE = 0.05


def padded_bounds(bounds: Sequence[float], padding: float) -> tuple[float, ...]:
    """Return a bounding box with room on each side, and with a volume.

    Parameters
    ----------
    bounds : sequence of 6 float
        xmin, xmax, ymin, ymax, zmin, zmax in m.
    padding : float
        Room on each side as a share of that side's length.

    Returns
    -------
    tuple of 6 float
        The larger box. A side without length, as of a planar mesh, gets `FLAT_SHARE` of the
        largest one, since tetrahedra need a volume.
    """
    low, high = np.reshape(bounds, (3, 2)).astype(np.float64).T
    extent = high - low
    room = padding * extent
    flat = extent < 1e-9 * extent.max()
    room[flat] = FLAT_SHARE / 2 * extent.max()
    return tuple(float(v) for v in np.column_stack([low - room, high + room]).ravel())
