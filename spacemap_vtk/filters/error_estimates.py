"""Estimate the errors of ModalSolver's figures from solutions on coarser cages."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.modal_model import ModesReader, sheet_of
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError, SolverError, SpacemapError, SpacemapWarning
from spacemap_vtk.filters.base import Stage, connect
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.mechanics.boundary.places import (
    ends_between_vertices,
    find_spans,
    find_vertices,
)
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.convergence import (
    EDGE_ORDER,
    SAME_SHAPE,
    SAME_STATE,
    SHEET_ORDER,
    SOLID_ORDER,
    TOLERANCE,
    Estimate,
    estimate_error,
    match_modes,
    relative_difference,
)
from spacemap_vtk.mechanics.modal.resolution import fold_error, mode_errors
from spacemap_vtk.mechanics.response.oscillator import LOST
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.units import GRAVITY

#: The coarser cage also needs modes that are above the highest of the finer one.
_MORE_MODES = 1.25
#: Share of the thickness: a state of rest that moves by less is that of flat cloth.
_FLAT = 0.01
#: Number of coarser cages.
_WIDER = 2
#: Factor of the estimate of `mode_errors`, which may be half as large as the error.
_SAFETY = 2.0


@dataclass(frozen=True, eq=False)
class ErrorEstimates:
    """Solutions of one scene in cells of two or three widths, and what their differences say."""

    #: The stage whose figures are estimated.
    solver: ModalSolver
    #: One or two copies of it, on a coarser cage and on a still coarser one.
    wider: tuple[ModalSolver, ...]
    #: Width of the cells of each over that of the next finer ones.
    ratios: tuple[float, ...]
    #: Power of the width with which errors fall.
    order: float

    @cached_property
    def modes(self) -> CageModes:
        """The modes in question."""
        return ModesReader().read(self.solver.output)

    @cached_property
    def wider_modes(self) -> tuple[CageModes, ...]:
        """The modes of the coarser cages."""
        return tuple(ModesReader().read(each.output) for each in self.wider)

    @cached_property
    def frequencies(self) -> list[Estimate | None]:
        """Relative error of each mode's frequency; None for rigid motions and lost frequencies."""
        own = self.modes
        waves = mode_errors(own.model, own.eigenvalues, own.shapes)
        matches = [self._match(other) for other in self.wider_modes]
        found: list[Estimate | None] = []
        for number, (eigenvalue, wave) in enumerate(
            zip(own.eigenvalues.tolist(), waves, strict=True)
        ):
            if eigenvalue <= 0.0 or own.eigenvalue_rounding[number] > LOST:
                found.append(None)
                continue
            same = [bool(shares[number] >= SAME_SHAPE) for shares, _ in matches]
            values = [1.0]
            for (_, eigenvalues), other, is_same in zip(
                matches, self.wider_modes, same, strict=True
            ):
                if len(values) > 1 and not is_same:
                    break  # the widest cells do not show this mode
                last = min(number, len(other.eigenvalues) - 1)
                # Where no mode has this shape, compare with that of the same number.
                counterpart = eigenvalues[number] if is_same else other.eigenvalues[last]
                values.append(math.sqrt(max(counterpart, 0.0) / eigenvalue))
            estimate = self._estimate(values, same[0] and self.same_state)
            if not estimate.converged and same[0] and self.modes.model.displacement is None:
                # Waves of few cells: their dispersion is known better than the difference tells.
                error = min(estimate.error, _SAFETY * float(wave) or math.inf)
                estimate = Estimate(error, error <= TOLERANCE)
            found.append(estimate)
        return found

    def _match(self, other: CageModes) -> tuple[Floats, Floats]:
        """Find the modes on a coarser cage, as `match_modes` does."""
        own = self.modes
        shapes, wider = (each.shapes.reshape(len(each.shapes), -1, 3) for each in (own, other))
        at_coarse = self._at_vertices_of(other, np.moveaxis(shapes, 1, 0))
        masses = np.abs(other.nodal_mass)
        return match_modes(np.moveaxis(at_coarse, 0, 1), wider, masses, other.eigenvalues)

    @cached_property
    def state_difference(self) -> float:
        """Relative difference of the first two states of equilibrium; 0 for cages at rest."""
        own, other = self.modes.model.displacement, self.wider_modes[0].model.displacement
        if own is None or other is None:
            return 0.0
        # Cloth that moves by a small part of its thickness is flat, whatever the displacement is.
        thickness = np.ptp(self.modes.model.points, axis=0).min()
        if max(np.abs(own).max(), np.abs(other).max()) < _FLAT * thickness:
            return 0.0
        return relative_difference(self._at_vertices_of(self.wider_modes[0], own), other)

    @property
    def same_state(self) -> bool:
        """Whether the first two cages hang in the same state of equilibrium."""
        return self.state_difference <= SAME_STATE

    @cached_property
    def folds(self) -> float:
        """Relative error of all figures of a sheet whose folds are too narrow for its cells."""
        gravity, sheet = math.hypot(*self.solver.gravity), sheet_of(self.solver.output)
        if sheet is None or gravity == 0.0:
            return 0.0
        length = min(sheet.bending_length) * (GRAVITY / gravity) ** (1 / 3)
        return fold_error(self.modes.model, length)

    @cached_property
    def hidden_arms(self) -> dict[str, float]:
        """Half the size of supports of which the cage shows one place only, by their names [m]."""
        # Whatever moment such a support would carry, the cage has none.
        points = points_of(self.solver.output).astype(np.float64)
        low, high = points.min(axis=0), points.max(axis=0)
        normal = int((high - low).argmin())
        found = {}
        for place in self.solver.held_places:
            spans = find_spans(low, high, [place], normal)
            if sheet_of(self.solver.output) is None or not spans[normal]:
                continue
            held = points[find_vertices(points, place)]
            if np.delete(np.ptp(held, axis=0), normal).max() == 0.0:
                sizes = [b - a for ((a, b),) in spans] * (high - low)
                found[str(place)] = float(np.delete(sizes, normal).max()) / 2
        return found

    def compare(self, *values: ArrayLike, balanced: bool = False) -> Estimate:
        """Estimate the error of a figure of the equilibrium.

        Parameters
        ----------
        *values : float or array_like, shape (n,)
            The figure of `solver`, and those of `wider`.
        balanced : bool, optional
            Whether the figure follows from the balance of forces alone, as the force of the only
            body that holds a cage: then it does not matter in which folds cloth hangs.

        Returns
        -------
        Estimate
            Its error, in the unit of the figure.
        """
        return self._estimate(values, balanced or self.same_state, balanced)

    def _estimate(
        self, values: Sequence[ArrayLike], same_state: bool, balanced: bool = False
    ) -> Estimate:
        fine, coarse, *coarsest = values
        # Of two states, figures may by chance be alike.
        chance = 0.0 if self.same_state else min(self.state_difference, 1.0)
        return estimate_error(
            fine,
            coarse,
            self.ratios[0],
            coarsest=coarsest[0] if coarsest else None,
            coarsest_ratio=self.ratios[-1],
            order=self.order,
            same_state=same_state,
            least=0.0 if balanced else max(self.folds, chance),
        )

    def _at_vertices_of(self, other: CageModes, values: Floats) -> Floats:
        """Interpolate values of the vertices, (V, …), at those of a coarser cage."""
        model = self.modes.model
        corners = model.cells[:, :4]
        found = locate(other.model.points, model.points, corners)
        vertices = corners[found.tetrahedron]
        result: Floats = np.einsum("vk,vk...->v...", found.weights, values[vertices])
        return result


def estimate_errors(solver: ModalSolver) -> ErrorEstimates:
    """Solve a cage again in cells about two and four times as wide, to estimate its errors.

    Parameters
    ----------
    solver : ModalSolver
        A stage below a TetraCage; it is updated if it needs to be. It shows the progress, and
        can be aborted.

    Returns
    -------
    ErrorEstimates
        `ErrorEstimates.frequencies` has the relative error of each frequency.

    Raises
    ------
    InputError
        If there is no coarser cage: this one is from a file or has one cell, or the equilibrium
        begins from a file.
    SolverError
        If the coarser cage has no solution, for example because no vertex of it is held.

    Notes
    -----
    The second solution takes a quarter of the time or less, the third one a sixteenth. They are
    kept in the cache like any other. There is no third one if its cells would be too few.
    `spacemap_vtk.mechanics.modal.convergence` has the rule for the error.

    Examples
    --------
    >>> from spacemap_vtk import ModalSolver, TetraCage, WeaveSource, connect
    >>> solver = ModalSolver(elements="sheet", modes=1)
    >>> _ = connect(WeaveSource(), TetraCage(divisions=(10, 10, 1)), solver)
    >>> error, converged = estimate_errors(solver).frequencies[0]
    >>> 0.0 < error < 0.01, converged
    (True, True)
    """
    solver.update()
    if solver.start is not None:
        raise InputError("the equilibrium begins from a file, which fits this cage only")
    chain: list[Stage] = [solver]
    while not isinstance(chain[-1], TetraCage):
        chain.append(_stage_above(chain[-1]))
    cage, wider, ratios = chain[-1], list[ModalSolver](), list[float]()
    points, places = points_of(solver.output).astype(np.float64), solver.held_places
    spans = find_spans(points.min(axis=0), points.max(axis=0), places)
    # The share of the extent on the held side of each edge.
    edges = [[share for a, b in axis for share in (1 - a, b) if 0 < share < 1] for axis in spans]
    while len(wider) < _WIDER:
        try:
            cage, ratio = cage.make_coarser(edges)
            wider.append(_solve_again(chain, cage))
        except (InputError, SolverError):
            if not wider:
                raise
            break  # two widths have to do
        ratios.append(ratio)
    order = SOLID_ORDER if sheet_of(solver.output) is None else SHEET_ORDER
    if any(ends_between_vertices(points, place) for place in places):
        order = EDGE_ORDER
    return ErrorEstimates(solver, tuple(wider), tuple(ratios), order)


def _solve_again(chain: Sequence[Stage], cage: TetraCage) -> ModalSolver:
    """Solve a copy of a chain of stages, from a ModalSolver up to a cage, with another cage."""
    solver = chain[0]
    assert isinstance(solver, ModalSolver)
    between = [type(stage)(**stage.settings) for stage in reversed(chain[1:-1])]
    modes = math.ceil(_MORE_MODES * len(ModesReader().read(solver.output).eigenvalues))
    given = {**solver.settings, **solver.values_in_use, "modes": modes}
    coarse = ModalSolver(**given, terms=solver.terms)
    coarse.yarns = solver.yarns

    def show_progress(stage: Stage, event: str) -> None:
        solver.SetProgressText("errors")
        solver.UpdateProgress(stage.GetProgress())
        stage.SetAbortExecute(solver.GetAbortExecute())

    observer = coarse.AddObserver("ProgressEvent", show_progress)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SpacemapWarning)  # those of the finer cage are enough
        try:
            connect(chain[-1].GetInputDataObject(0, 0), cage, *between, coarse).update()
        except Cancelled:
            raise
        except SpacemapError as error:
            raise SolverError(f"cells twice as wide have no solution: {error.message}") from error
        finally:
            coarse.RemoveObserver(observer)
    return coarse


def _stage_above(stage: Stage) -> Stage:
    """Return the stage that makes the cage of another one."""
    connected = stage.GetNumberOfInputConnections(0)
    above = stage.GetInputConnection(0, 0).GetProducer() if connected else None
    if not isinstance(above, Stage) or above.makes != "cage":
        raise InputError("the cage does not come from TetraCage, which could make a coarser one")
    return above
