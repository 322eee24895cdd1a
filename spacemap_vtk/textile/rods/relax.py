"""Relax yarns to their least energy without letting them pass through each other.

Newton's method with Levenberg's damping and a search along each step. No step brings two points of
yarns nearer to each other by more than a quarter of their distance, so yarns cannot change places.
Yarns grow from thin to their full thickness on the way.

Curvature that makes the tangent indefinite is left out: as large a share of it, in each sample, as
is needed. A yarn that slides along its own shape changes the energy by almost nothing, and each
step of such a slide is short; so a stage ends, too, where steps hardly lower the energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk import cancel
from spacemap_vtk.errors import GeometryError, SolverError
from spacemap_vtk.ndarrays import Bools, Floats, Ints, Progress
from spacemap_vtk.textile.rods.energy import ImagePairs, RodEnergy, RodMechanics, State
from spacemap_vtk.textile.rods.overlap import largest_overlap
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Number of the search, a part of the digests of results that are kept on disk: it grows when the
#: same yarns come to rest elsewhere than before.
SEARCH = 2


class Stage(NamedTuple):
    """A stage of the search."""

    thickness: float
    """Share of their diameters that yarns have."""
    stiffness: float
    """Share of the stiffness that tension and contact have; soft yarns find their shape sooner."""
    tolerance: float
    """Largest force at the end, as a share of EA."""
    change: float = 1e-7
    """Share of the energy by which three steps at the end lower it; yarns that slide along
    themselves hardly change it."""


#: The stages: yarns grow, find their shape, and become stiff.
STAGES = (
    *(Stage(thickness, 0.03, 1e-2, 1e-2) for thickness in (0.4, 0.6, 0.8, 0.9)),
    Stage(1.0, 0.03, 1e-5, 1e-5),
    Stage(1.0, 0.2, 1e-5, 1e-5),
    Stage(1.0, 1.0, 1e-8, 1e-7),
)
#: The stage of yarns that were at rest and are moved a little.
LAST = Stage(1.0, 1.0, 1e-10, 1e-8)
#: Smallest distance of two yarns at the start, in diameters; nearer ones may be on either side.
NEAREST = 0.15
#: Largest approach of two samples in a step, as a share of their distance; and of those that are
#: too far apart to be listed.
SAFE, SAFE_FAR = 0.25, 0.7
#: Where no step lowers the energy any more, yarns are at rest if no force is above this share of
#: EA; soft yarns go on to the next stage.
STALLED = 1e-5
#: The exact tangent is tried after steps that move nothing by more than this share of a diameter,
#: from one of these shares of the curvature that is left out to the next lower one.
EXACT = 0.1
SHARES = (0.0, 1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0)
#: Pairs of samples are listed up to this share of a diameter beyond contact; the list is made again
#: once samples may have approached so far. It is shorter while steps are short.
MARGIN, LEAST_MARGIN = 0.5, 0.1
#: Damping: at first, and its least and largest value, as shares of the largest stiffness …
DAMPING = (1e-3, 1e-11, 1e6)
#: … its factors after a good and after a bad step, and its least value after a step that fails.
EASE, BRAKE, FAILED = 0.25, 4.0, 1e-6
#: A step is good if the energy falls by more than the first share of what is expected, bad if by
#: less than the second one.
GOOD, BAD = 0.7, 0.25
#: Steps after which a stage counts as half done, for the progress.
USUAL_STEPS = 40
#: Times that a step is shortened before it fails.
TRIES = 3


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
    """Largest overlap of two yarns, over their mean diameter."""
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
    nearest = nearest_distance(energy, z)
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
    # Yarns find their shape, in about half of all steps, in the first stage of full thickness.
    parts = np.array([1.0 if stage.thickness < 1.0 else len(stages) for stage in stages])
    parts[np.flatnonzero(parts > 1.0)[1:]] = 1.0
    begins = np.append(0.0, parts.cumsum()) / parts.sum()
    for number, stage in enumerate(stages):
        z = search.run(z, stage, _part_of(progress, *begins[number : number + 2]))
    state = energy.evaluate(z, energy.pairs_within(z, float(energy.samples.diameter.max())))
    ends = np.cumsum([len(yarn.points) for yarn in yarns])[:-1]
    found = [
        yarn._replace(points=points)
        for yarn, points in zip(yarns, np.split(z[:-2], ends), strict=True)
    ]
    cell, lengths = z[-2:].copy(), energy.lengths(z)
    return Relaxed(found, cell, state, lengths, largest_overlap(found, cell), search.steps)


def _part_of(progress: Progress | None, begin: float, end: float) -> Progress:
    """Return the progress function of a part that takes the work from one share to another."""
    return lambda share: None if progress is None else progress(begin + share * (end - begin))


def relax_again(energy: RodEnergy, z: Floats, free: Bools, max_steps: int = 1000) -> State:
    """Relax yarns that are nearly at rest already, to the last digits."""
    moves = np.ones(z.shape, dtype=bool)
    moves[-2:] = free
    z = _Search(energy, np.flatnonzero(moves), max_steps).run(z, LAST)
    return energy.evaluate(z, energy.pairs_within(z, float(energy.samples.diameter.max())))


def nearest_distance(energy: RodEnergy, z: Floats) -> float:
    """Compute the least distance of two samples, over the diameter; at most 1."""
    pairs = energy.pairs_within(z, float(energy.samples.diameter.max()))
    distance = np.linalg.norm(pairs.separate(z), axis=1)
    return float((distance / pairs.diameter).min(initial=1.0))


class _Search:
    """Newton's method from state to state, with the number of steps."""

    def __init__(self, energy: RodEnergy, active: Ints, max_steps: int) -> None:
        self._energy, self._active, self._max_steps = energy, active, max_steps
        self._diameter = float(energy.samples.diameter.max())
        self.steps = 0

    def run(self, z: Floats, stage: Stage, progress: Progress = lambda _: None) -> Floats:
        """Find the place of least energy in a stage."""
        energy = self._energy.softened(stage.stiffness)
        near = _Near(energy, z, stage.thickness * self._diameter, self._diameter)
        state = energy.evaluate(z, near.pairs, stage.thickness)
        tension = float(energy.mechanics.tension.max())
        scale = float(state.tangent(1.0).diagonal().max())
        damping, least, most = (share * scale for share in DAMPING)
        level, energies = len(SHARES) - 1, [state.energy]
        begun = self.steps
        while True:
            cancel.check()
            progress((self.steps - begun) / (self.steps - begun + USUAL_STEPS))
            force = state.gradient.ravel()[self._active]
            largest = float(abs(force).max())
            if largest <= stage.tolerance * tension:
                break
            if len(energies) > 3 and energies[-4] - energies[-1] < stage.change * energies[-1]:
                break
            stalled = damping > most
            if stalled and (stage.stiffness < 1.0 or largest <= STALLED * tension):
                break
            self.steps += 1
            if self.steps > self._max_steps or stalled:
                raise SolverError(
                    f"the yarns did not come to rest in {self.steps} steps",
                    cure="Give a first guess that is nearer, longer yarns, or a stiffer contact",
                )
            step = self._solve(state, force, damping, level)
            level, safe = step.level, min(1.0, near.safe_share(state.z, step.move))
            share = safe
            for _ in range(TRIES):
                z = state.z + share * step.move
                trial = energy.evaluate(z, near.update(z), stage.thickness)
                change, slope = trial.energy - state.energy, share * step.slope
                if change <= 1e-4 * slope + 1e-14 * abs(state.parts).sum():
                    break
                share *= float(np.clip(slope / (2 * (slope - change)), 0.1, 0.5))
            else:
                damping = max(BRAKE**2 * damping, FAILED * scale)
                continue
            state = trial
            energies.append(state.energy)
            expected = -slope - share**2 * step.curvature / 2
            if share < safe or -change < BAD * expected:
                damping *= BRAKE
            elif -change > GOOD * expected:
                damping = max(EASE * damping, least)
            small = float(abs(step.move).max()) < EXACT * self._diameter
            level = max(level - 1, 0) if small else len(SHARES) - 1
        progress(1.0)
        return state.z

    def _solve(self, state: State, force: Floats, damping: float, level: int) -> _Step:
        """Solve for a step of Newton's method."""
        from scipy.sparse import identity
        from scipy.sparse.linalg import splu

        active = self._active
        while True:
            matrix = state.tangent(SHARES[level])[active][:, active]
            matrix = matrix + damping * identity(len(active))
            factors = splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            if level == len(SHARES) - 1 or (factors.U.diagonal() > 0.0).all():
                break
            level = max(level + 1, 2)
        own = -factors.solve(force)
        move = np.zeros(state.z.size)
        move[active] = own
        return _Step(move.reshape(-1, 3), level, float(force @ own), float(own @ (matrix @ own)))


class _Step(NamedTuple):
    """A step of Newton's method."""

    move: Floats
    """(n + 2, 3) Change of z [m]."""
    level: int
    """Which of `SHARES` of the negative curvature is left out."""
    slope: float
    """First derivative of the energy along it [J]."""
    curvature: float
    """Second one, by the matrix that was solved [J]."""


class _Near:
    """The pairs of samples that are near each other while yarns move."""

    def __init__(self, energy: RodEnergy, z: Floats, reach: float, diameter: float) -> None:
        self._energy, self._reach, self._diameter = energy, reach, diameter
        self._find(z, MARGIN)

    def _find(self, z: Floats, margin: float) -> None:
        self._margin = margin * self._diameter
        self.pairs = self._energy.pairs_within(z, self._reach + self._margin)
        self._start = self._last = z

    def update(self, z: Floats) -> ImagePairs:
        """Return the pairs after a move; search again if other samples may be near by now."""
        step, self._last = self._approach(z - self._last), z
        if self._approach(z - self._start) > self._margin:
            self._find(z, float(np.clip(4 * step / self._diameter, LEAST_MARGIN, MARGIN)))
        return self.pairs

    def _approach(self, move: Floats) -> float:
        """Compute the most by which a move may bring two samples nearer to each other."""
        places = self._energy.surface.places(move)
        return 2 * float(np.linalg.norm(places, axis=1).max()) + float(
            np.linalg.norm(move[-2:], axis=1).sum()
        )

    def safe_share(self, z: Floats, move: Floats) -> float:
        """Compute the largest share of a move in which no two yarns can change places."""
        most = self._approach(move) / (SAFE_FAR * (self._reach + self._margin))
        if len(self.pairs.first):
            apart, change = self.pairs.separate(z), self.pairs.separate(move)
            closing, square = (np.einsum("ci,ci->c", apart, each) for each in (change, apart))
            most = max(most, float((-closing / square).max()) / SAFE)
        return 1.0 / max(most, 1e-300)
