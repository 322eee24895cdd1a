"""Drape as by Cusick's drapemeter: a round cloth hangs over a round disc.

The cloth, 30 cm across, is held between two discs of 18 cm. Its shadow has the area A_d, and

    DC = (A_d - A_18) / (A_30 - A_18)

is the drape coefficient. The folds of the hanging ring are counted as nodes: maxima of the radius
of its edge, seen from above.

The ring is a sheet on a polar lattice, held flat at the edge of the discs. Its membrane is linear,
with the stiffness of strips with free sides: a hanging cloth is hardly stretched, and can exchange
crimp. It is solved in wide cells first, then in cells half as wide; the difference of both is the
estimate of the error. Cloth can drape in several ways; this is the one that a flat cloth reaches.

Source: G. E. Cusick, "The measurement of fabric drape", J. Textile Inst. 59 (1968) T253; ISO
9073-9.
"""

from __future__ import annotations

from functools import partial
from math import pi
from typing import NamedTuple

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.laboratory.records import (
    DEGREE,
    MILLIMETRE,
    PERCENT,
    PURE,
    Axis,
    Curve,
    Measurement,
    Reading,
)
from spacemap_vtk.mechanics.contact.resting import Resting, find_resting_state
from spacemap_vtk.mechanics.elements.plates import Plate, strip_stiffness
from spacemap_vtk.mechanics.equilibrium.drape import drape_coefficient, shadow_area
from spacemap_vtk.mechanics.modal.convergence import estimate_error
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.units import GRAVITY

#: Radii of the cloth and of the disc [m].
CLOTH, DISC = 0.15, 0.09
#: Cells round the ring and outwards in each solution, and the share of the work after each.
CELLS = ((32, 4, 0.1), (64, 8, 0.3), (128, 16, 1.0))
#: Least height of a fold that is counted as a node [m].
_NODE = 1e-3


class Ring(NamedTuple):
    """Polar lattice of one layer between the discs and the edge of the cloth."""

    points: Floats
    """(V, 3), the lower, then the upper vertices; round the ring, then outwards [m]."""
    cells: Ints
    """(T, 4)."""
    around: int
    """Number of cells round the ring."""
    outwards: int
    """Number of cells from the discs to the edge."""

    def grid(self, values: Floats) -> Floats:
        """Arrange values of the vertices, (V, 3), as (2, outwards + 1, around, 3)."""
        return values.reshape(2, self.outwards + 1, self.around, 3)

    @property
    def triangles(self) -> Ints:
        """Triangles of the mid-surface, (n, 3)."""
        number = np.arange((self.outwards + 1) * self.around).reshape(-1, self.around)
        a, d = number[:-1], number[1:]
        b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
        return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Let a round cloth hang over a round disc."""
    fabric.require_areal_mass()
    coefficients = []
    guess: Floats | None = None
    before = 0.0
    for around, outwards, share in CELLS:
        ring = build_ring(fabric.thickness, around, outwards)
        moved = hang(fabric, ring, guess, partial(_report_part, progress, before, share))
        guess, before = refine_ring(ring, moved), share
        middle = ring.grid(ring.points + moved).mean(axis=0)
        coefficients.append(_drape_coefficient(middle, ring))
    error = estimate_error(coefficients[-1], coefficients[-2], 2.0)
    edge = middle[-1, :, :2]
    angle = np.arctan2(*edge.T[::-1]) % (2 * pi)
    order = angle.argsort()
    radius = np.linalg.norm(edge, axis=1)[order]
    readings = [
        Reading("DC", "drape coefficient", "", coefficients[-1], PERCENT, error.error),
        Reading("nodes", "folds", "", float(count_nodes(radius)), PURE),
    ]
    notes = ["the membrane is linear; of the states in which a cloth can drape, this is one"]
    if not error.converged:
        notes.append("the drape coefficient still depends on the cells")
    return Measurement(
        readings,
        [Curve("edge of the cloth", angle[order], radius)],
        Axis("angle from the weft", DEGREE),
        Axis("radius of the shadow", MILLIMETRE),
        notes,
    )


def build_ring(thickness: float, around: int, outwards: int) -> Ring:
    """Build a ring; the number of cells round it must be even."""
    flat, cells = build_lattice((0, 1, 0, 1, -0.5, 0.5), (around, outwards, 1))
    # The last column of vertices is the first one.
    number = np.arange(2 * (outwards + 1) * around).reshape(2, outwards + 1, around)
    wrapped = np.concatenate([number, number[..., :1]], axis=2).ravel()
    share = flat.reshape(2, outwards + 1, around + 1, 3)[:, :, :-1].reshape(-1, 3)
    angle, radius = 2 * pi * share[:, 0], DISC + (CLOTH - DISC) * share[:, 1]
    # Angles run clockwise, so that the cells are oriented as those of the lattice.
    places = [radius * np.sin(angle), radius * np.cos(angle), thickness * share[:, 2]]
    return Ring(np.stack(places, axis=1), wrapped[cells], around, outwards)


def refine_ring(ring: Ring, moved: Floats) -> Floats:
    """Interpolate a displacement for a ring of cells half as wide, by cubic splines."""
    from scipy.interpolate import make_interp_spline

    grid = ring.grid(moved)
    grid = np.concatenate([grid, grid[:, :, :1]], axis=2)
    places = np.arange(ring.around + 1.0)
    around = make_interp_spline(places, grid, k=3, axis=2, bc_type="periodic")
    grid = around(np.arange(0, ring.around, 0.5))
    outwards = make_interp_spline(np.arange(ring.outwards + 1.0), grid, k=3, axis=1)
    found: Floats = outwards(np.arange(2 * ring.outwards + 1) / 2).reshape(-1, 3)
    return found


def count_nodes(radius: Floats) -> int:
    """Count the maxima of a radius round the disc [m]."""
    from scipy.signal import find_peaks

    count = len(radius)
    peaks, _ = find_peaks(np.tile(radius, 3), prominence=_NODE)
    return int(((peaks >= count) & (peaks < 2 * count)).sum())


def hang(fabric: Fabric, ring: Ring, guess: Floats | None, progress: Progress) -> Floats:
    """Find the displacement of a ring under its weight; by default from a flat start."""
    warp, weft = strip_stiffness(fabric.plate.membrane)
    shear = float(fabric.plate.membrane[2, 2])
    plate = Plate(np.diag([weft, warp, shear]), fabric.plate.bending)
    held = np.zeros(ring.points.shape, dtype=bool)
    ring.grid(held)[:, 0] = True
    density = fabric.require_areal_mass() / fabric.thickness
    model = Model(ring.points, ring.cells, plate, density, held)
    weight = np.zeros_like(ring.points)
    weight[:, 2] = -GRAVITY * model.nodal_mass

    start = None if guess is None else Resting(guess, np.empty((0, 3)))
    return find_resting_state(model, weight.ravel(), progress, start).displacement


def _report_part(progress: Progress, before: float, after: float, share: float) -> None:
    """Report the progress of a part of the work."""
    progress(before + share * (after - before))


def _drape_coefficient(middle: Floats, ring: Ring) -> float:
    """Compute the drape coefficient of a mid-surface, with the discs as in the lattice."""
    cast = shadow_area(middle.reshape(-1, 3), ring.triangles, [0, 0, -1])
    # Areas of polygons with as many corners as the lattice.
    polygon = ring.around / 2 * np.sin(2 * pi / ring.around)
    disc, cloth = polygon * DISC**2, polygon * CLOTH**2
    return drape_coefficient(cast + disc, cloth, disc)
