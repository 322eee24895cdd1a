"""Relax yarns to their least energy without letting them pass through each other.

Newton's method with Levenberg's damping. No step moves two yarns against each other by more than a
quarter of their least distance, so they cannot change places. Yarns grow from thin to their full
thickness on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError, SolverError
from spacemap_vtk.ndarrays import Bools, Floats, Ints, Progress
from spacemap_vtk.textile.rods.contact import Pairs, relative_distances
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics, State
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Shares of their diameters that yarns have in turn.
GROWTH = (0.4, 0.6, 0.8, 0.9, 1.0)
#: Smallest distance of two yarns at the start, in diameters; nearer ones may be on either side.
NEAREST = 0.15
#: Largest move of two samples against each other in a step, as a share of the least distance.
SAFE = 0.25
#: Pairs are found again when they may have come nearer by this share of a diameter.
MARGIN = 0.5
#: Yarns are at rest if no force is above this share of EA …
TOLERANCE = 1e-9
#: … and, while they grow, above this one.
ROUGH = 1e-2
#: Damping: at first, and its least and largest value, as shares of the largest stiffness …
DAMPING = (1e-3, 1e-11, 1e3)
#: … and its factors after a good and after a bad step.
EASE, BRAKE = 0.25, 6.0


class Relaxed(NamedTuple):
    """Yarns at rest."""

    yarns: list[Yarn]
    """The yarns with new control points."""
    cell: Floats
    """(2, 3) Period vectors [m]."""
    state: State
    """Their energy and its derivatives."""
    lengths: Floats
    """(Y,) Length of each yarn in one period [m]."""
    overlap: float
    """Largest overlap of two yarns, in diameters."""
    steps: int
    """Number of Newton steps."""


def relax_yarns(
    yarns: Sequence[Yarn],
    cell: Floats,
    mechanics: RodMechanics,
    free: Bools,
    *,
    growth: Sequence[float] = GROWTH,
    progress: Progress | None = None,
    max_steps: int = 1000,
) -> Relaxed:
    """Relax yarns in a periodic cell to their least energy.

    Parameters
    ----------
    yarns : sequence of Yarn
        First guess of the centre lines, with the right topology.
    cell : ndarray of float64, shape (2, 3)
        Period vectors [m]; zero where the yarns do not repeat themselves.
    mechanics : RodMechanics
        Stiffness and length of the yarns.
    free : ndarray of bool, shape (2, 3)
        Components of the period vectors that follow the yarns; the others are given.
    growth : sequence of float, optional
        Shares of their diameters that the yarns have in turn; the last is 1.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.
    max_steps : int, optional
        Largest number of Newton steps.

    Returns
    -------
    Relaxed
        The yarns at rest.

    Raises
    ------
    GeometryError
        If centre lines are so near each other at the start that it is not clear which is above.
    SolverError
        If the yarns do not come to rest.
    """
    energy = RodEnergy(sample_yarns(yarns), mechanics)
    z = unknowns(yarns, cell)
    nearest = 1.0 - largest_overlap(energy, z)
    if nearest < NEAREST:
        raise GeometryError(
            "two yarns are so near each other that it is not clear which is above",
            value=f"{nearest:.3g} diameters",
            allowed=f"{NEAREST} diameters or more",
            cure="Draw the first guess with more room between crossing yarns",
        )
    moves = np.ones(z.shape, dtype=bool)
    moves[-2:] = free
    search = _Search(energy, np.flatnonzero(moves), max_steps)
    for number, thickness in enumerate(growth, 1):
        z = search.run(z, thickness, TOLERANCE if number == len(growth) else ROUGH)
        if progress is not None:
            progress(number / len(growth))
    state = energy.evaluate(z, energy.pairs_within(z, float(energy.samples.diameter.max())))
    ends = np.cumsum([len(yarn.points) for yarn in yarns])
    return Relaxed(
        [yarn._replace(points=points) for yarn, points in zip(yarns, np.split(z, ends))],
        z[-2:].copy(),
        state,
        energy.lengths(z),
        largest_overlap(energy, z),
        search.steps,
    )


def largest_overlap(energy: RodEnergy, z: Floats) -> float:
    """Compute the largest overlap of two yarns, in diameters; 0 if none touch."""
    pairs = energy.pairs_within(z, float(energy.samples.diameter.max()))
    return 1.0 - float(relative_distances(energy.samples, pairs, z).min(initial=1.0))


class _Search:
    """Newton's method from state to state, with the number of steps and the damping."""

    def __init__(self, energy: RodEnergy, active: Ints, max_steps: int) -> None:
        self._energy, self._active, self._max_steps = energy, active, max_steps
        self._diameter = float(energy.samples.diameter.max())
        self.steps = 0

    def run(self, z: Floats, thickness: float, tolerance: float) -> Floats:
        """Find the place of least energy of yarns with a share of their thickness."""
        reach = (thickness + MARGIN) * self._diameter
        pairs, moved = self._energy.pairs_within(z, reach), 0.0
        state = self._energy.evaluate(z, pairs, thickness)
        limit = tolerance * float(self._energy.mechanics.tension.max())
        scale = float(state.tangent.diagonal().max())
        first, least, most = (share * scale for share in DAMPING)
        damping = first
        while abs(force := state.gradient.ravel()[self._active]).max() > limit:
            self.steps += 1
            if self.steps > self._max_steps or damping > most:
                raise SolverError(
                    f"the yarns did not come to rest in {self.steps} steps",
                    cure="Give a first guess that is nearer, longer yarns, or a stiffer contact",
                )
            move = self._solve(state.tangent, force, damping)
            move *= min(1.0, self._safe_share(state.z, move, pairs))
            here = moved + 2 * float(
                np.linalg.norm(self._energy.samples.place @ move, axis=1).max()
            )
            z = state.z + move
            near = pairs
            if here > MARGIN * self._diameter:
                near, here = self._energy.pairs_within(z, reach), 0.0
            trial = self._energy.evaluate(z, near, thickness)
            slope = float(force @ move.ravel()[self._active])
            rounding = 1e-14 * abs(state.parts).sum()
            if slope < 0.0 and trial.energy <= state.energy + 1e-4 * slope + rounding:
                state, pairs, moved = trial, near, here
                damping = max(EASE * damping, least)
            else:
                damping *= BRAKE
        return state.z

    def _solve(self, tangent: csr_matrix, force: Floats, damping: float) -> Floats:
        """Solve for the step of Newton's method with damping, (n + 2, 3)."""
        from scipy.sparse import identity
        from scipy.sparse.linalg import splu

        active = self._active
        matrix = tangent[active][:, active] + damping * identity(len(active))
        move = np.zeros(tangent.shape[0])
        move[active] = -splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        ).solve(force)
        return move.reshape(-1, 3)

    def _safe_share(self, z: Floats, move: Floats, pairs: Pairs) -> float:
        """Compute the largest share of a move in which no two yarns can change places."""
        place = self._energy.samples.place
        if not len(pairs.first):
            return self._diameter / (4 * float(np.linalg.norm(place @ move, axis=1).max()))
        against = np.linalg.norm(pairs.separate(place @ move, move[-2:]), axis=1)
        distance = np.linalg.norm(pairs.separate(place @ z, z[-2:]), axis=1)
        return SAFE * float(distance.min()) / max(float(against.max()), 1e-300)
