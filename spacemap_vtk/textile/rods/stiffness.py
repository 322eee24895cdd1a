"""Stiffness of a textile as a sheet, from the cell of its relaxed yarns.

Yarns follow a strain of the cell so that the energy is least. So the stiffness of the membrane is
the second derivative of the energy by the periods, less what the yarns give back (a Schur
complement). A cell that is bent by an angle in each period has an energy whose first derivative is
a moment: without one, a free edge of the textile would curl.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics
from spacemap_vtk.textile.rods.relax import relax_again
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Angles of a period, in rad, between which the energy of bending is differenced.
_TURN = 0.05


class CellStiffness(NamedTuple):
    """Stiffness of a textile per width; axis 1 is x, axis 2 is y."""

    membrane: Floats
    """(3, 3) Force per width from the strains 11, 22, 2 · 12 [N/m]."""
    bending: Floats
    """(2,) Rigidity in bending along x and along y, without forces in the plane [N m]."""
    moment: Floats
    """(2,) Moment per width that holds the textile flat [N], positive if it would curl up, towards
    z."""


def cell_stiffness(
    yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics, free: Bools
) -> CellStiffness:
    """Compute the stiffness of a textile from its relaxed yarns."""
    # Components of the periods that are `free` follow the yarns when the cell is bent.
    membrane = _membrane(yarns, cell, mechanics)
    along = [_bending(yarns, cell, mechanics, free)]
    # To bend along y, x and y are exchanged.
    turned = [
        yarn._replace(
            points=yarn.points[:, [1, 0, 2]],
            periods=None if yarn.periods is None else yarn.periods[::-1],
        )
        for yarn in yarns
    ]
    order = np.ix_([1, 0], [1, 0, 2])
    along.append(_bending(turned, cell[order], mechanics, free[order]))
    rigidity, moment = np.array(along).T
    return CellStiffness(membrane, rigidity, moment)


def _membrane(yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics) -> Floats:
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    energy, z = RodEnergy(sample_yarns(yarns), mechanics), unknowns(yarns, cell)
    pairs = energy.pairs_within(z, float(energy.samples.diameter.max()))
    tangent = energy.evaluate(z, pairs).tangent()
    # Changes of the periods by strains 11, 22, 2 · 12.
    strains = np.zeros((3, 3, 3))
    strains[0, 0, 0] = strains[1, 1, 1] = 1.0
    strains[2, 0, 1] = strains[2, 1, 0] = 0.5
    change = (cell @ strains).reshape(3, -1).T
    own, mixed, outer = tangent[:-6, :-6], tangent[:-6, -6:], tangent[-6:, -6:]
    # Nothing resists a move of all yarns together.
    shift = 1e-10 * float(own.diagonal().max())
    side = mixed @ change
    given = splu((own + shift * identity(own.shape[0])).tocsc()).solve(side)
    area = abs(np.cross(cell[0], cell[1])[2])
    found = (change.T @ (outer @ change) - side.T @ given) / area
    return np.asarray((found + found.T) / 2)


def _bending(
    yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics, free: Bools
) -> tuple[float, float]:
    """Compute rigidity and moment of bending along the first period."""
    energies = []
    for turn in (-_TURN, 0.0, _TURN):
        samples = sample_yarns(yarns, turn=turn)
        state = relax_again(RodEnergy(samples, mechanics), unknowns(yarns, cell), free)
        energies.append(state.energy)
    length, width = cell[0, 0], cell[1, 1]
    before, middle, after = energies
    rigidity = (before - 2 * middle + after) / _TURN**2 * length / width
    moment = (before - after) / (2 * _TURN) / width
    return rigidity, moment
