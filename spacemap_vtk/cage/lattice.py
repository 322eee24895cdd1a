"""A box cut into hexahedra of five tetrahedra each: the paper's cage.

Source: T. Furukawa, S. Kitagawa, Y. Shimizu, "Deformation of Flexible Objects Based on Space
Mapping". The paper leaves open how neighbouring hexahedra are split; here the split is mirrored
from one to the next (checkerboard), because otherwise the diagonals of a shared face cross and the
mesh falls apart along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import Floats, Ints

TETRAHEDRA_PER_CELL = 5

# Corners of a hexahedron are numbered x + 2y + 4z. One tetrahedron joins four corners of which no
# two are neighbours; the other four cut off one corner each: in tetrahedron 1 + k corner k of the
# first one is replaced by the one diagonally opposite, and two more are swapped to keep the
# orientation. spacemap_vtk.embedding.lattice_locate relies on this order.
_EVEN = np.array([[0, 5, 3, 6], [7, 5, 6, 3], [0, 2, 6, 3], [0, 5, 6, 4], [0, 5, 1, 3]])
# Mirrored in x (bit 0), and two corners swapped to keep the orientation.
_ODD = (_EVEN ^ 1)[:, [0, 1, 3, 2]]
#: The five tetrahedra of an even hexahedron, and of an odd one.
SPLIT = np.stack((_EVEN, _ODD))

# A box thinner than this, relative to its longest side, counts as flat; so does one cut into steps
# of fewer units in the last place than this. Barycentric coordinates in it would be noise.
_FLAT = 1e-12
_LEAST_ULPS = 16
#: Thickness given to a flat object's box, as a share of its largest side.
_FLAT_SHARE = 0.05


def lattice(bounds: Sequence[float], divisions: Sequence[int]) -> tuple[Floats, Ints]:
    """Cut a box into ``nx * ny * nz`` hexahedra of five tetrahedra each, conforming.

    Parameters
    ----------
    bounds : sequence of 6 floats
        ``xmin, xmax, ymin, ymax, zmin, zmax`` in m.
    divisions : sequence of 3 ints
        Hexahedra along x, y and z, each at least 1.

    Returns
    -------
    points : (V, 3) float64
        Vertices in m, x running fastest, then y, then z; ``V = (nx+1)(ny+1)(nz+1)``.
    tetrahedra : (5 nx ny nz, 4) int64
        Vertices of each tetrahedron, positively oriented (``det(b-a, c-a, d-a) > 0``); the five of
        one hexahedron follow each other, hexahedra in the order of their first vertex.

    Raises
    ------
    InputError
        A division is not a whole number of at least 1, or there are not three.
    GeometryError
        The bounds are not finite, or the box is empty or flat.

    Examples
    --------
    >>> points, tetrahedra = lattice((0, 1, 0, 1, 0, 0.1), (5, 5, 1))
    >>> len(points), len(tetrahedra)
    (72, 125)
    """
    nx, ny, nz = _checked_divisions(divisions)
    axes = _axes(bounds, (nx, ny, nz))
    points = np.empty((nz + 1, ny + 1, nx + 1, 3))
    points[..., 0] = axes[0]
    points[..., 1] = axes[1][:, None]
    points[..., 2] = axes[2][:, None, None]

    corner = np.arange(8)
    step = (corner & 1) + (nx + 1) * ((corner >> 1 & 1) + (ny + 1) * (corner >> 2))
    split = step[SPLIT].astype(np.int64)
    i, j, k = np.ogrid[:nx, :ny, :nz]
    parity = (i + j + k).transpose(2, 1, 0).ravel() & 1
    first = (i + (nx + 1) * (j + (ny + 1) * k)).transpose(2, 1, 0).ravel()
    tetrahedra = split[parity]
    tetrahedra += first[:, None, None]
    return points.reshape(-1, 3), tetrahedra.reshape(-1, 4)


def estimate_bytes(divisions: Sequence[int]) -> int:
    """Return the most memory that `lattice` holds for these divisions.

    Parameters
    ----------
    divisions : sequence of 3 ints
        Hexahedra along x, y and z.

    Returns
    -------
    int
        Bytes: the points, the tetrahedra and the scratch that is alive with them.

    Raises
    ------
    InputError
        A division is not a whole number of at least 1, or there are not three.

    Examples
    --------
    >>> estimate_bytes((1000, 1000, 1000)) // 10**9
    208
    """
    counts = _checked_divisions(divisions)
    cells = prod(counts)
    vertices = prod(count + 1 for count in counts)
    # 3 float64 a vertex; 5 x 4 int64 a cell; scratch: parity, first vertex, one sum on its way
    return 8 * (3 * vertices + 4 * TETRAHEDRA_PER_CELL * cells + 3 * cells)


def _checked_divisions(divisions: Sequence[int]) -> tuple[int, int, int]:
    values = tuple(divisions)
    if len(values) != 3 or not all(
        isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= 1
        for value in values
    ):
        raise InputError(
            "the cage cannot be divided so",
            key="divisions",
            value=values,
            allowed="three whole numbers, each at least 1",
        )
    return int(values[0]), int(values[1]), int(values[2])


def _axes(bounds: Sequence[float], divisions: tuple[int, int, int]) -> list[Floats]:
    box = np.asarray(bounds, dtype=np.float64)
    if box.shape != (6,) or not np.isfinite(box).all():
        raise GeometryError(
            "these are not the bounds of a box",
            key="bounds",
            value=bounds,
            allowed="six finite numbers xmin, xmax, ymin, ymax, zmin, zmax",
        )
    low, high = box[0::2], box[1::2]
    size = high - low
    axes = [
        np.linspace(start, stop, count + 1)
        for start, stop, count in zip(low, high, divisions, strict=True)
    ]
    for name, extent, axis in zip("xyz", size, axes, strict=True):
        step = extent / (len(axis) - 1)
        if extent <= _FLAT * size.max() or step < _LEAST_ULPS * np.spacing(np.abs(axis).max()):
            raise GeometryError(
                f"the box is {'empty' if extent < 0 else 'flat'} along {name}",
                key="bounds",
                value=tuple(box.tolist()),
                allowed=f"{name}min clearly below {name}max",
                cure="Give the cage padding, or an object that has thickness",
            )
    return axes


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
        The larger box. A side without length, as of a planar mesh, gets a twentieth of the
        largest one, since tetrahedra need a volume.
    """
    low, high = np.reshape(bounds, (3, 2)).astype(np.float64).T
    extent = high - low
    room = padding * extent
    flat = extent < 1e-9 * extent.max()
    room[flat] = _FLAT_SHARE / 2 * extent.max()
    return tuple(float(v) for v in np.column_stack([low - room, high + room]).ravel())
