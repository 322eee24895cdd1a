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
from spacemap_vtk.textile.rods.contact import Pairs, relative_distances, separate
from spacemap_vtk.textile.rods.energy import RodEnergy, RodMechanics, State
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

if TYPE_CHECKING:
    pass


class Stage(NamedTuple):
    """A stage of the search."""

    thickness: float
    """Share of their diameters that yarns have."""
    stiffness: float
    """Share of the stiffness that tension and contact have; soft yarns find their shape sooner."""
    tolerance: float
    """Largest force at the end, as a share of EA."""


#: The stages: yarns grow, find their shape, and become stiff.
STAGES = (
    Stage(0.4, 0.03, 1e-2),
    Stage(0.7, 0.03, 1e-2),
    Stage(1.0, 0.03, 1e-5),
    Stage(1.0, 0.2, 1e-5),
    Stage(1.0, 1.0, 1e-8),
)
#: The stage of yarns that were at rest and are moved a little.
LAST = Stage(1.0, 1.0, 1e-10)
#: Smallest distance of two yarns at the start, in diameters; nearer ones may be on either side.
NEAREST = 0.15
#: Largest move of two samples against each other in a step, as a share of the least distance.
SAFE = 0.25
#: Where no step lowers the energy any more, yarns are at rest if no force is above this share of
#: EA; soft yarns go on to the next stage.
STALLED = 1e-5
#: The exact tangent is tried after a step that moves nothing by more than this share of a diameter.
EXACT = 0.1
#: The list of pairs is rebuilt once samples may have approached by this share of a diameter.
MARGIN = 0.5
#: Damping: at first, and its least and largest value, as shares of the largest stiffness …
DAMPING = (1e-3, 1e-11, 1e6)
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
    held: Bools | None = None,
    stages: Sequence[Stage] = STAGES,
    progress: Progress | None = None,
    max_steps: int = 1000,
) -> Relaxed:
    """Relax yarns in a periodic cell to their least energy."""
    # `cell` has two period vectors, zero where yarns do not repeat themselves; its components that
    # are `free` follow the yarns. Control points that are `held`, (n,), stay. Raises GeometryError
    # if it is not clear at the start which of two yarns is above, and SolverError if they do not
    # come to rest.
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
    if held is not None:
        moves[:-2] = ~held[:, None]
    search = _Search(energy, np.flatnonzero(moves), max_steps)
    for number, stage in enumerate(stages, 1):
        z = search.run(z, stage)
        if progress is not None:
            progress(number / len(stages))
    state = energy.evaluate(z, energy.pairs_within(z, float(energy.samples.diameter.max())))
    ends = np.cumsum([len(yarn.points) for yarn in yarns])[:-1]
    return Relaxed(
        [
            yarn._replace(points=points)
            for yarn, points in zip(yarns, np.split(z[:-2], ends), strict=True)
        ],
        z[-2:].copy(),
        state,
        energy.lengths(z),
        largest_overlap(energy, z),
        search.steps,
    )


def relax_again(energy: RodEnergy, z: Floats, free: Bools, max_steps: int = 1000) -> State:
    """Relax yarns that are nearly at rest already, to the last digits."""
    moves = np.ones(z.shape, dtype=bool)
    moves[-2:] = free
    z = _Search(energy, np.flatnonzero(moves), max_steps).run(z, LAST)
    return energy.evaluate(z, energy.pairs_within(z, float(energy.samples.diameter.max())))


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

    def run(self, z: Floats, stage: Stage) -> Floats:
        """Find the place of least energy in a stage."""
        reach = (stage.thickness + MARGIN) * self._diameter
        energy = self._energy.softened(stage.stiffness)
        pairs, moved = energy.pairs_within(z, reach), 0.0
        state = energy.evaluate(z, pairs, stage.thickness)
        limit = stage.tolerance * float(energy.mechanics.tension.max())
        scale = float(state.tangent(True).diagonal().max())
        first, least, most = (share * scale for share in DAMPING)
        damping, exact = first, False
        while abs(force := state.gradient.ravel()[self._active]).max() > limit:
            self.steps += 1
            stalled = damping > most
            still = abs(force).max() <= STALLED * float(energy.mechanics.tension.max())
            if stalled and (still or stage.stiffness < 1.0):
                break
            if self.steps > self._max_steps or stalled:
                raise SolverError(
                    f"the yarns did not come to rest in {self.steps} steps",
                    cure="Give a first guess that is nearer, longer yarns, or a stiffer contact",
                )
            move, exact = self._solve(state, force, damping, exact)
            move *= min(1.0, self._safe_share(state.z, move, pairs))
            here = moved + 2 * float(np.linalg.norm(energy.samples.places(move), axis=1).max())
            z = state.z + move
            near = pairs
            if here > MARGIN * self._diameter:
                near, here = energy.pairs_within(z, reach), 0.0
            trial = energy.evaluate(z, near, stage.thickness)
            slope = float(force @ move.ravel()[self._active])
            rounding = 1e-14 * abs(state.parts).sum()
            if trial.energy <= state.energy + 1e-4 * slope + rounding:
                state, pairs, moved = trial, near, here
                damping = max(EASE * damping, least)
                exact = float(abs(move).max()) < EXACT * self._diameter
            else:
                damping *= BRAKE
        return state.z

    def _solve(
        self, state: State, force: Floats, damping: float, exact: bool
    ) -> tuple[Floats, bool]:
        """Solve for a step of Newton's method, (n + 2, 3); return it and whether it is exact."""
        from scipy.sparse import identity
        from scipy.sparse.linalg import splu

        active = self._active
        while True:
            matrix = state.tangent(not exact)[active][:, active] + damping * identity(len(active))
            factors = splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            if not exact or (factors.U.diagonal() > 0.0).all():
                break
            exact = False
        move = np.zeros(state.z.size)
        move[active] = -factors.solve(force)
        return move.reshape(-1, 3), exact

    def _safe_share(self, z: Floats, move: Floats, pairs: Pairs) -> float:
        """Compute the largest share of a move in which no two yarns can change places."""
        samples = self._energy.samples
        if not len(pairs.first):
            return self._diameter / (4 * float(np.linalg.norm(samples.places(move), axis=1).max()))
        against = np.linalg.norm(separate(samples, pairs, move), axis=1)
        distance = np.linalg.norm(separate(samples, pairs, z), axis=1)
        return SAFE * float(distance.min()) / max(float(against.max()), 1e-300)
