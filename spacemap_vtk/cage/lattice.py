"""Lattice cage: a box of hexahedra, each split into five tetrahedra, as in the paper.

Source: T. Furukawa, S. Kitagawa, Y. Shimizu, "Deformation of Flexible Objects Based on Space
Mapping". The paper does not say how neighbouring hexahedra are split. Here the split is mirrored
from one hexahedron to the next (checkerboard parity); otherwise the diagonals of a shared face
would cross and the mesh would not conform.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import Floats, Ints

TETRAHEDRA_PER_CELL = 5

# Corners of a hexahedron are numbered x + 2y + 4z. The first tetrahedron joins four corners of
# which no two are neighbours. Each of the other four cuts off one corner: in tetrahedron 1 + k,
# corner k of the first one is replaced by the diagonally opposite corner, and two more are swapped
# to keep the orientation. spacemap_vtk.embedding.lattice_locate relies on this order.
_EVEN = np.array([[0, 5, 3, 6], [7, 5, 6, 3], [0, 2, 6, 3], [0, 5, 6, 4], [0, 5, 1, 3]])
# Mirrored in x (bit 0), with two corners swapped to keep the orientation.
_ODD = (_EVEN ^ 1)[:, [0, 1, 3, 2]]
#: The five tetrahedra of an even and of an odd hexahedron.
SPLIT = np.stack((_EVEN, _ODD))

#: A box is flat if it is thinner than this share of its longest side.
_FLAT = 1e-12
#: A box is also flat if its cells are smaller than this many units in the last place: barycentric
#: coordinates in them would be noise.
_LEAST_ULPS = 16
#: How much worse a ratio of cells that is not 2 is than different ones of two axes.
_FAR = 0.3
#: Rounding of a number of cells.
_ROUNDING = 1e-6
#: Thickness given to the box of a flat object, as a share of its largest side.
_FLAT_SHARE = 0.05


def build_lattice(bounds: Sequence[float], divisions: Sequence[int]) -> tuple[Floats, Ints]:
    """Split a box into ``nx * ny * nz`` hexahedra of five conforming tetrahedra each.

    Parameters
    ----------
    bounds : sequence of 6 floats
        ``xmin, xmax, ymin, ymax, zmin, zmax`` in m.
    divisions : sequence of 3 ints
        Number of hexahedra along x, y and z, each at least 1.

    Returns
    -------
    points : (V, 3) float64
        Vertices in m, x running fastest, then y, then z; ``V = (nx+1)(ny+1)(nz+1)``.
    tetrahedra : (5 nx ny nz, 4) int64
        Vertices of each tetrahedron, positively oriented (``det(b-a, c-a, d-a) > 0``); the five of
        one hexahedron are consecutive, hexahedra in the order of their first vertex.

    Raises
    ------
    InputError
        A division is not a whole number of at least 1, or there are not three.
    GeometryError
        The bounds are not finite, or the box is empty or flat.

    Examples
    --------
    >>> points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 0.1), (5, 5, 1))
    >>> len(points), len(tetrahedra)
    (72, 125)
    """
    nx, ny, nz = _check_divisions(divisions)
    axes = _vertex_coordinates(bounds, (nx, ny, nz))
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


def coarsen_divisions(
    divisions: Sequence[int], edges: Sequence[Sequence[float]] = ((), (), ())
) -> tuple[list[int], float]:
    """Choose about half as many cells along each axis, in about the same proportion.

    Parameters
    ----------
    divisions : sequence of 3 ints
        Number of cells along each axis, not all 1.
    edges : sequence of 3 sequences of float, optional
        Edges of what holds vertices, along each axis: shares of the extent on the held side.

    Returns
    -------
    fewer : list of 3 ints
        Numbers of wider cells.
    ratio : float
        Mean ratio of their widths.

    Notes
    -----
    If cells grow alike along all axes, and edges lie at the same place within a cell, the errors of
    both solutions have the same causes, and their difference tells more.

    Examples
    --------
    >>> coarsen_divisions((52, 64, 1))
    ([26, 32, 1], 2.0)
    >>> coarsen_divisions((9, 3, 3))
    ([6, 2, 2], 1.5)
    >>> coarsen_divisions((18, 1, 1), edges=([0.4], [], []))  # 7.2 cells are held, and 3.2
    ([8, 1, 1], 2.25)
    """
    most = max(divisions)
    choices = []
    for count in range(1, most):
        fewer = [max(round(each * count / most), 1) for each in divisions]
        pairs = list(zip(divisions, fewer, strict=True))
        ratios = [math.log(each / new) for each, new in pairs if each > 1]
        mean = sum(ratios) / len(ratios)
        unlike = max(ratios) - min(ratios)
        shifts = [
            abs(_inside_cell(share * each) - _inside_cell(share * new))
            for (each, new), shares in zip(pairs, edges, strict=True)
            for share in shares
            if each > 1
        ]
        score = unlike + _FAR * abs(mean - math.log(2)) + max(shifts, default=0.0)
        choices.append((score, fewer, math.exp(mean)))
    _, fewer, ratio = min(choices)
    return fewer, ratio


def _inside_cell(place: float) -> float:
    """Return where within a cell a place lies, 0 to 1; 0 also for one that rounding moves."""
    return max(place - math.floor(place + _ROUNDING), 0.0)


def estimate_bytes(divisions: Sequence[int]) -> int:
    """Estimate the peak memory of `build_lattice`.

    Parameters
    ----------
    divisions : sequence of 3 ints
        Number of hexahedra along x, y and z.

    Returns
    -------
    int
        Bytes of points, tetrahedra and temporary arrays.

    Raises
    ------
    InputError
        A division is not a whole number of at least 1, or there are not three.

    Examples
    --------
    >>> estimate_bytes((1000, 1000, 1000)) // 10**9
    208
    """
    counts = _check_divisions(divisions)
    cells = math.prod(counts)
    vertices = math.prod(count + 1 for count in counts)
    # Per vertex 3 float64; per cell 5 x 4 int64, and 3 temporary int64.
    return 8 * (3 * vertices + 4 * TETRAHEDRA_PER_CELL * cells + 3 * cells)


def _check_divisions(divisions: Sequence[int]) -> tuple[int, int, int]:
    values = tuple(divisions)
    if len(values) != 3 or not all(
        isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= 1
        for value in values
    ):
        raise InputError(
            "invalid divisions of the cage",
            key="divisions",
            value=values,
            allowed="three whole numbers, each at least 1",
        )
    return int(values[0]), int(values[1]), int(values[2])


def _vertex_coordinates(bounds: Sequence[float], divisions: tuple[int, int, int]) -> list[Floats]:
    box = np.asarray(bounds, dtype=np.float64)
    if box.shape != (6,) or not np.isfinite(box).all():
        raise GeometryError(
            "invalid bounds of a box",
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
                cure="Give the cage padding, or use an object with a thickness",
            )
    return axes


def pad_bounds(bounds: Sequence[float], padding: float) -> tuple[float, ...]:
    """Enlarge a bounding box, and give a flat one a volume.

    Parameters
    ----------
    bounds : sequence of 6 float
        xmin, xmax, ymin, ymax, zmin, zmax in m.
    padding : float
        Share of a side's length that is added at each of its ends.

    Returns
    -------
    tuple of 6 float
        The enlarged box. A side of no length (a planar mesh) becomes a twentieth of the largest
        one, because tetrahedra need a volume.
    """
    low, high = np.reshape(bounds, (3, 2)).astype(np.float64).T
    extent = high - low
    room = padding * extent
    flat = extent < 1e-9 * extent.max()
    room[flat] = _FLAT_SHARE / 2 * extent.max()
    return tuple(float(v) for v in np.column_stack([low - room, high + room]).ravel())
