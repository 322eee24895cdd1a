"""Stiffness of a textile as a sheet, from the cell of its relaxed yarns.

Yarns follow a strain of the cell so that the energy is least. So the stiffness of the membrane is
the second derivative of the energy by the periods, less what the yarns give back (a Schur
complement). A cell that is bent by an angle in each period has an energy whose first derivative is
a moment: without one, a free edge of the textile would curl.

Yarns of a knit are springs: straight if free, and bent by each other (`cell_stiffness`). Yarns
that are set keep the shape in which they were laid, without any force (`set_stiffness`). Small
strains of the cell then stretch them, and change their curvature against a frame that follows the
tangent t without twist. With r′ = a, r″ = b, s = |a| and P = 1 - t tᵀ,

    δε = t · δa/ℓ,    δκ = P δb/s² - (t · b) P δa/s³ - 2 κ (t · δa)/s,    κ = P b/s²,

and yarns that touch neither part nor come nearer by δd without a force:

    E = ½ Σ (EA ℓ δε² + B s δκ² + k δd²).

All these are linear in the unknowns z, the strains and the curvatures of the cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Progress
from spacemap_vtk.textile.rods.assembly import place_matrix
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics
from spacemap_vtk.textile.rods.relax import LAST, relax_again, relax_yarns
from spacemap_vtk.textile.rods.yarns import Samples, Yarn, sample_yarns, unknowns

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Components of the periods that follow yarns which are springs.
SIDES = np.eye(2, 3, dtype=bool)
#: Curvatures of the cell, per diameter, between which the energy of bending is differenced: a tenth
#: of that to which free stockinette curls.
_CURVATURE = 0.05
#: Shear of a cell of springs between which its force is differenced. The force of smaller ones
#: depends by 20 % on where the samples of contact are, because loops slide by less than their
#: distance; from 1 % on by 2 %.
_SHEAR = 0.01
#: Angle of a period between which samples of set yarns are differenced [rad].
_SMALL_TURN = 1e-4
#: Least eigenvalue of a stiffness, as a share of the largest one: yarns without friction may let a
#: textile shear or bend without any force.
FLOOR = 1e-3
#: Least eigenvalue of the bending of springs, as a share of that of the same yarns if they are set.
#: The rows of garter stitch, which are hardly held apart, turn into each other almost freely.
SOFTEST = 0.05
#: Moments below this, in units of B over the square of a diameter, are rounding.
LEAST_MOMENT = 0.01


class CellStiffness(NamedTuple):
    """Stiffness of a textile per width; axis 1 is x, axis 2 is y."""

    membrane: Floats
    """(3, 3) Force per width from the strains 11, 22, 2 · 12 [N/m]."""
    bending: Floats
    """(2, 2) Moments per width from the curvatures along x and along y, without forces in the plane
    [N m]."""
    moment: Floats
    """(2,) Moment per width that holds the textile flat [N], positive if it would curl up, towards
    z."""


def settle_springs(
    yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics
) -> tuple[list[Yarn], Floats]:
    """Let yarns that were at rest with a similar stiffness come to rest with their own one.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns nearly at rest.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, along x and y [m]; their lengths follow the yarns.
    mechanics : RodMechanics
        Stiffness of the yarns.

    Returns
    -------
    tuple of list of Yarn, and ndarray of float64, shape (2, 3)
        Yarns and cell at rest.

    Raises
    ------
    SolverError
        If they do not come to rest.
    """
    found = relax_yarns(yarns, cell, mechanics, SIDES, stages=[LAST])
    return found.yarns, found.cell


def cell_stiffness(
    yarns: Sequence[Yarn],
    cell: Floats,
    mechanics: RodMechanics,
    free: Bools,
    progress: Progress | None = None,
) -> CellStiffness:
    """Compute the stiffness of a textile from its yarns, which are at rest and straight if free.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns at rest.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, along x and y [m].
    mechanics : RodMechanics
        Stiffness of the yarns.
    free : ndarray of bool, shape (2, 3)
        Components of the periods that follow the yarns when the cell is bent.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    CellStiffness
        Bending along one direction is taken to cause no moment along the other one.

    Raises
    ------
    SolverError
        If the yarns of a bent cell do not come to rest.
    """
    membrane = _membrane(yarns, cell, mechanics)
    membrane[2, 2] = _shear(yarns, cell, mechanics)
    # To bend along y, x and y are exchanged.
    order = np.ix_([1, 0], [1, 0, 2])
    ways = (yarns, cell, free), (_exchange(yarns), cell[order], free[order])
    along: list[tuple[float, float]] = []
    for number, (own, period, moves) in enumerate(ways):

        def report(share: float, done: int = number) -> None:
            if progress is not None:
                progress((done + share) / len(ways))

        along.append(_bending(own, period, mechanics, moves, report))
    rigidity, moment = np.array(along).T
    return CellStiffness(membrane, np.diag(rigidity), moment)


def set_stiffness(yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics) -> CellStiffness:
    """Compute the stiffness of a textile whose yarns are set in their present shape.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns as they are; those that overlap, if ever so little, touch.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, along x and y [m]; zero along x for a strip, whose width is
        that of its yarns.
    mechanics : RodMechanics
        Stiffness of the yarns; their lengths at rest are the present ones.

    Returns
    -------
    CellStiffness
        Without a moment; along a missing period all is zero.
    """
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    strains = _SetStrains(yarns, cell, mechanics)
    rows, size = strains.rows, 3 * len(strains.z) - 6
    sides = [rows[:, size:] @ change for change in _strain_changes(cell)]
    for axis, length in enumerate(np.linalg.norm(cell, axis=1).tolist()):
        sides.append(length * strains.bend(axis))
    side = np.stack(sides, axis=1)
    own = rows[:, :size]
    matrix = own.T @ own
    shift = 1e-10 * float(matrix.diagonal().max())
    mixed = own.T @ side
    given = splu((matrix + shift * identity(size)).tocsc()).solve(mixed)
    total = (side.T @ side - mixed.T @ given) / cell_area(yarns, cell)
    total = (total + total.T) / 2
    membrane, coupling = total[:3, :3], total[:3, 3:]
    bending = total[3:, 3:] - coupling.T @ np.linalg.pinv(membrane, hermitian=True) @ coupling
    return CellStiffness(membrane, (bending + bending.T) / 2, np.zeros(2))


def raise_to_floor(stiffness: Floats, least: float = 0.0) -> tuple[Floats, bool]:
    """Raise eigenvalues below `FLOOR` of the largest one, or below a given one, to it.

    Parameters
    ----------
    stiffness : ndarray of float64, shape (n, n)
        Symmetric stiffness.
    least : float, optional
        Least eigenvalue.

    Returns
    -------
    tuple of ndarray of float64, shape (n, n), and bool
        A positive definite stiffness, and whether it differs.
    """
    values, vectors = np.linalg.eigh(stiffness)
    raised = np.maximum(values, max(least, FLOOR * float(values[-1])))
    if (raised == values).all():
        return stiffness, False
    return (vectors * raised) @ vectors.T, True


def _exchange(yarns: Sequence[Yarn]) -> list[Yarn]:
    """Exchange x and y, and both periods."""
    return [
        yarn._replace(
            points=yarn.points[:, [1, 0, 2]],
            periods=None if yarn.periods is None else yarn.periods[::-1],
        )
        for yarn in yarns
    ]


def _strain_changes(cell: Floats) -> Floats:
    """Return the changes of the periods by strains 11, 22, 2 · 12, (3, 6)."""
    strains = np.zeros((3, 3, 3))
    strains[0, 0, 0] = strains[1, 1, 1] = 1.0
    strains[2, 0, 1] = strains[2, 1, 0] = 0.5
    return np.asarray((cell @ strains).reshape(3, -1))


def cell_area(yarns: Sequence[Yarn], cell: Floats) -> float:
    """Compute the area of a cell; of a strip, its period times its width.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns of the cell.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, one of them zero for a strip [m].

    Returns
    -------
    float
        Area [m²].
    """
    area = abs(float(np.cross(cell[0], cell[1])[2]))
    if area > 0.0:
        return area
    period = cell[np.linalg.norm(cell, axis=1).argmax()]
    across = 0 if abs(period[1]) > abs(period[0]) else 1
    places = np.concatenate([yarn.points[:, across] for yarn in yarns])
    width = float(np.ptp(places)) + max(yarn.diameter for yarn in yarns)
    return float(np.linalg.norm(period)) * width


class _SetStrains:
    """Strains of set yarns as linear functions of z, each times the root of its stiffness."""

    def __init__(self, yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics) -> None:
        self._yarns, self._cell, self.z = yarns, cell, unknowns(yarns, cell)
        samples = sample_yarns(yarns)
        a, b = samples.slopes(self.z), samples.bends(self.z)
        speed = np.linalg.norm(a, axis=1)
        t = a / speed[:, None]
        ahead = (t * b).sum(axis=1)
        curvature = (b - ahead[:, None] * t) / speed[:, None] ** 2
        across = np.eye(3) - t[:, :, None] * t[:, None, :]
        share = mechanics.tension[samples.yarn] * samples.weight / mechanics.length[samples.yarn]
        self._stretch = np.sqrt(share)[:, None] * t
        root = np.sqrt(mechanics.bending[samples.yarn] * samples.weight * speed)[:, None, None]
        self._by_b = root * across / speed[:, None, None] ** 2
        self._by_a = -root * (ahead / speed**3)[:, None, None] * across
        self._by_a -= 2 * root * curvature[:, :, None] * (t / speed[:, None])[:, None, :]
        energy = RodEnergy(samples, mechanics)
        pairs = energy.pairs_within(self.z, float(samples.diameter.max()))
        distance = np.linalg.norm(pairs.separate(self.z), axis=1)
        self._pairs = pairs = pairs.select(distance < pairs.diameter)
        apart = pairs.separate(self.z)
        root = np.sqrt(mechanics.contact * pairs.area) / np.linalg.norm(apart, axis=1)
        self._push = root[:, None] * apart
        self.rows = self._rows(samples)

    def _rows(self, samples: Samples) -> csr_matrix:
        from scipy.sparse import vstack

        count = len(self.z)
        slope, bend = (place_matrix(samples, order, count) for order in (1, 2))
        bent = _along(self._by_a) @ slope + _along(self._by_b) @ bend
        stretched = _along(self._stretch[:, None]) @ slope
        places = place_matrix(self._pairs.images, 0, count)
        first, second = (
            places[(3 * which[:, None] + np.arange(3)).ravel()]
            for which in (self._pairs.first, self._pairs.second)
        )
        apart = first - second
        return vstack([stretched, bent, _along(self._push[:, None]) @ apart]).tocsr()

    def bend(self, axis: int) -> Floats:
        """Compute the strains by an angle of bending in each period along x or y."""
        yarns, cell = self._yarns, self._cell
        order = [0, 1, 2]
        images = self._pairs.images
        if axis == 1:
            yarns, order = _exchange(yarns), [1, 0, 2]
            cell = cell[np.ix_([1, 0], order)]
            images = images._replace(wraps=images.wraps[..., ::-1])
        z = unknowns(yarns, cell)
        found = []
        for turn in (-_SMALL_TURN, _SMALL_TURN):
            samples = sample_yarns(yarns, turn=turn)
            a, b = samples.slopes(z)[:, order], samples.bends(z)[:, order]
            pairs = self._pairs._replace(images=images._replace(turn=turn))
            apart = pairs.separate(z)[:, order]
            found.append(
                np.concatenate(
                    [
                        (self._stretch * a).sum(axis=1),
                        ((self._by_a @ a[..., None]) + (self._by_b @ b[..., None])).ravel(),
                        (self._push * apart).sum(axis=1),
                    ]
                )
            )
        return np.asarray((found[1] - found[0]) / (2 * _SMALL_TURN))


def _along(blocks: Floats) -> csr_matrix:
    """Build the matrix of blocks (n, r, 3) on its diagonal."""
    from scipy.sparse import bsr_matrix

    count, rows, columns = blocks.shape
    parts = blocks, np.arange(count), np.arange(count + 1)
    return bsr_matrix(parts, shape=(count * rows, count * columns)).tocsr()


def _membrane(yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics) -> Floats:
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    energy, z = RodEnergy(sample_yarns(yarns), mechanics), unknowns(yarns, cell)
    pairs = energy.pairs_within(z, float(energy.samples.diameter.max()))
    tangent = energy.evaluate(z, pairs).tangent()
    change = _strain_changes(cell).T
    own, mixed, outer = tangent[:-6, :-6], tangent[:-6, -6:], tangent[-6:, -6:]
    # Nothing resists a move of all yarns together.
    shift = 1e-10 * float(own.diagonal().max())
    side = mixed @ change
    given = splu((own + shift * identity(own.shape[0])).tocsc()).solve(side)
    area = abs(np.cross(cell[0], cell[1])[2])
    found = (change.T @ (outer @ change) - side.T @ given) / area
    return np.asarray((found + found.T) / 2)


def _shear(yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics) -> float:
    """Compute the stiffness in shear from the forces of cells that are sheared both ways."""
    held, half = np.zeros((2, 3), dtype=bool), np.zeros((3, 3))
    half[0, 1] = half[1, 0] = 0.5
    forces = []
    for strain in (-_SHEAR, _SHEAR):
        change = np.eye(3) + strain * half
        moved = [yarn._replace(points=yarn.points @ change) for yarn in yarns]
        energy = RodEnergy(sample_yarns(moved), mechanics)
        state = relax_again(energy, unknowns(moved, cell @ change), held)
        forces.append(float((state.gradient[-2:] * (cell @ half)).sum()))
    return (forces[1] - forces[0]) / (2 * _SHEAR) / cell_area(yarns, cell)


def _bending(
    yarns: Sequence[Yarn], cell: Floats, mechanics: RodMechanics, free: Bools, progress: Progress
) -> tuple[float, float]:
    """Compute rigidity and moment of bending along the first period."""
    energies: list[float] = []
    angle = _CURVATURE / max(yarn.diameter for yarn in yarns) * float(cell[0, 0])
    for turn in (-angle, 0.0, angle):
        progress(len(energies) / 3)
        samples = sample_yarns(yarns, turn=turn)
        state = relax_again(RodEnergy(samples, mechanics), unknowns(yarns, cell), free)
        energies.append(state.energy)
    length, width = cell[0, 0], cell[1, 1]
    before, middle, after = energies
    rigidity = (before - 2 * middle + after) / angle**2 * length / width
    moment = (before - after) / (2 * angle) / width
    return rigidity, moment
