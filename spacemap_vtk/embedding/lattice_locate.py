"""Locate points in a lattice of hexahedra of five tetrahedra each by arithmetic.

This is the "efficient calculation" of Furukawa, Kitagawa and Shimizu. The quotient of coordinate
and edge length gives the hexahedron, the signs of four sums give the tetrahedron in it, and the
sums are the barycentric coordinates. The mesh is not read, so the time for a point does not depend
on the number of tetrahedra.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import SPLIT, TETRAHEDRA_PER_CELL
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints

# Tolerance of the inside test, in edges of a hexahedron, as in spacemap_vtk.embedding.frames.
_TOLERANCE = 1e-9
# Further tolerance of the inside test, in units of the rounding of the coordinates.
_ROUNDINGS = 4.0
# Largest distance of a vertex from its lattice position, in roundings of the coordinates.
_VERTEX_ROUNDINGS = 8.0
# The table of the hexahedra of the box has at most this many times the hexahedra of the mesh.
_SPARSEST = 64
# A table up to this size is accepted in any case.
_SMALL = 2**20


@dataclass(frozen=True)
class LatticePattern:
    """A mesh that is a lattice, or the part of a lattice that a carved cage keeps."""

    #: (3,) Lowest corner of the box in m.
    origin: Floats
    #: (3,) Edge lengths of a hexahedron in m.
    spacing: Floats
    #: (3,) Number of hexahedra of the box along x, y and z.
    divisions: Ints
    #: 1 if the hexahedron at the origin is an odd one.
    parity: int
    #: (cells,) Number in the mesh of each hexahedron of the box, x fastest; -1 where it is carved
    #: away. None if all are present.
    slots: NDArray[np.int32] | None
    #: Largest absolute coordinate in m.
    rounding: float

    def find(
        self, points: Floats, epsilon: float, tetrahedron: NDArray[np.int32], weights: Floats
    ) -> None:
        """Write the tetrahedron of each point, and the weights of its corners."""
        distance = _ROUNDINGS * epsilon * self.rounding
        number: Any = 0
        odd: Any = self.parity
        there: Any = True
        local = []
        stride = 1
        for axis in range(3):
            count = int(self.divisions[axis])
            tolerance = _TOLERANCE + distance / self.spacing[axis]
            x = points[:, axis] - self.origin[axis]
            x *= 1.0 / self.spacing[axis]
            if x.size and (x.min() < -tolerance or x.max() > count + tolerance):
                there = there & (x >= -tolerance) & (x <= count + tolerance)
            # As in a search, a point on a face between two hexahedra belongs to the lower one.
            cell = np.ceil(x - tolerance)
            cell -= 1.0
            np.clip(cell, 0.0, count - 1.0, out=cell)
            x -= cell
            local.append(x)
            index = cell.astype(np.int32)
            odd = odd + index
            number = number + (index if stride == 1 else index * np.int32(stride))
            stride *= count
        odd = odd & 1
        # Odd hexahedra are mirror images of even ones.
        x, y, z = local
        mirror = odd.astype(np.float64)
        x *= 1.0 - 2.0 * mirror
        x += mirror
        # Coordinates in the middle tetrahedron; at most one of them is negative.
        half = 0.5 * (x + y + z)
        inner = [1.0 - half, half - y, half - z, half - x]
        edge = _TOLERANCE + distance / self.spacing.min()
        kind: Any = 0
        total: Any = 0.0
        below = []
        for k, coordinate in enumerate(inner):
            beyond = coordinate < -edge
            kind = kind + beyond.view(np.int8) * np.int8(k + 1)
            negative = coordinate * beyond
            total = total + negative
            below.append(negative)
        for coordinate, negative in zip(inner, below, strict=True):
            # In the tetrahedron behind a face, the corner beyond the face replaces that of the
            # middle tetrahedron opposite the face.
            negative *= -4.0
            coordinate += total
            coordinate += negative
        swapped = (kind > 0) ^ (odd > 0)
        weights[:, 1] = inner[1]
        weights[:, 2] = np.where(swapped, inner[3], inner[2])
        weights[:, 3] = np.where(swapped, inner[2], inner[3])
        weights[:, 0] = 1.0 - (inner[1] + inner[2] + inner[3])
        if self.slots is not None:
            number = self.slots[number]
            there = there & (number >= 0)
        number *= TETRAHEDRA_PER_CELL
        number += kind
        tetrahedron[:] = number if there is True else np.where(there, number, -1)


def recognise_lattice(vertices: Floats, tetrahedra: AnyInts) -> LatticePattern | None:
    """Recognise a lattice from its mesh; return None for other meshes."""
    # Only the mesh itself decides: every vertex of every tetrahedron must be at its position up to
    # rounding. So a lattice that was moved, refined or renumbered is not recognised.
    if len(tetrahedra) == 0 or len(tetrahedra) % TETRAHEDRA_PER_CELL:
        return None
    groups = np.asarray(tetrahedra).reshape(-1, TETRAHEDRA_PER_CELL, 4)
    # The middle tetrahedron spans its hexahedron, so the first one gives the size of all.
    step = np.ptp(vertices[groups[0, 0]], axis=0)
    used = vertices[groups[:, 0].ravel()]
    low, high = used.min(axis=0), used.max(axis=0)
    if not (step > 0).all():
        return None
    divisions = np.rint((high - low) / step).astype(np.int64)
    cells = int(np.prod(divisions.astype(object)))
    if cells < len(groups) or cells > max(_SMALL, _SPARSEST * len(groups)) or cells >= 2**28:
        return None
    spacing = (high - low) / divisions
    middles = vertices[groups[:, 0]].mean(axis=1)
    place = np.floor((middles - low) / spacing).astype(np.int64)
    number = place @ np.array([1, divisions[0], divisions[0] * divisions[1]])
    if (number[1:] <= number[:-1]).any() or number[0] < 0 or number[-1] >= cells:
        return None
    rounding = max(float(np.abs(low).max()), float(np.abs(high).max()))
    slack = _VERTEX_ROUNDINGS * np.finfo(np.float64).eps * rounding
    corners = SPLIT[..., None] >> np.arange(3) & 1  # (2, 5, 4, 3)
    for parity in (0, 1):
        odd = (place.sum(axis=1) + parity) & 1
        expected = low + spacing * (place[:, None, None] + corners[odd])
        if (np.abs(expected[0] - vertices[groups[0]]) <= slack).all():
            break
    if not (np.abs(expected - vertices[groups]) <= slack).all():
        return None
    slots = None
    if cells != len(groups):
        slots = np.full(cells, -1, dtype=np.int32)
        slots[number] = np.arange(len(groups), dtype=np.int32)
    return LatticePattern(low, spacing, divisions, parity, slots, rounding)
