"""Points in a lattice of hexahedra of five tetrahedra each, found by arithmetic alone.

The "efficient calculation" of Furukawa, Kitagawa and Shimizu: the quotient of a coordinate and the
edge length names the hexahedron, signs of four sums name the tetrahedron in it, and the sums are
the barycentric coordinates. No table of the mesh is looked at, so the cost of a point does not
depend on the number of tetrahedra.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.cage.lattice import SPLIT, TETRAHEDRA_PER_CELL
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints

# What counts as inside, in units of a hexahedron's edges, as in spacemap_vtk.embedding.frames ...
_TOLERANCE = 1e-9
# ... and in units of the rounding of the coordinates.
_ROUNDINGS = 4.0
# How far a vertex may be from its place, in roundings of the coordinates.
_VERTEX_ROUNDINGS = 8.0
# A table of all hexahedra of the box may be this much larger than the mesh itself.
_SPARSEST, _SMALL = 64, 2**20


@dataclass(frozen=True)
class LatticePattern:
    """A mesh known to be a lattice, or the part of one that a carved cage keeps."""

    #: (3,) Lowest corner of the box in m.
    origin: Floats
    #: (3,) Edges of a hexahedron in m.
    spacing: Floats
    #: (3,) Hexahedra along x, y and z of the box.
    divisions: Ints
    #: 1 where the hexahedron at the origin is an odd one.
    parity: int
    #: (cells,) For each hexahedron of the box, x fastest, its number in the mesh, -1 where it is
    #: carved away; None where all are there.
    slots: NDArray[np.int32] | None
    #: Size of the largest coordinate in m.
    rounding: float

    def find(
        self, points: Floats, epsilon: float, tetrahedron: NDArray[np.int32], weights: Floats
    ) -> None:
        """Fill in the tetrahedron of each point, and the weights of its corners."""
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
            # A point on a face between two hexahedra belongs to the lower one, as in a search.
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
        # Odd hexahedra are even ones seen in a mirror.
        x, y, z = local
        mirror = odd.astype(np.float64)
        x *= 1.0 - 2.0 * mirror
        x += mirror
        # Coordinates in the middle tetrahedron, of which at most one is negative.
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
            # In the tetrahedron that the face cuts off, the corner beyond it takes the place.
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


def recognise(vertices: Floats, tetrahedra: AnyInts) -> LatticePattern | None:
    """Return the lattice that a mesh is, if it is one."""
    # Nothing but the mesh itself is believed: every vertex of every tetrahedron must be in its
    # place to within rounding, so that a lattice that was moved, refined or renumbered is none.
    if len(tetrahedra) == 0 or len(tetrahedra) % TETRAHEDRA_PER_CELL:
        return None
    groups = np.asarray(tetrahedra).reshape(-1, TETRAHEDRA_PER_CELL, 4)
    # The middle tetrahedron spans its hexahedron, so the first one tells the size of all.
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
