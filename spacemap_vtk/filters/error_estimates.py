"""Estimate the errors of ModalSolver's figures from a second solution on a coarser cage."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spacemap_vtk.datasets.modal_model import ModesReader, sheet_of
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError, SolverError, SpacemapError, SpacemapWarning
from spacemap_vtk.filters.base import Stage, connect
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.convergence import (
    SAME_SHAPE,
    SAME_STATE,
    SHEET_ORDER,
    SOLID_ORDER,
    Estimate,
    estimate_error,
    match_modes,
    relative_difference,
)
from spacemap_vtk.mechanics.modal.resolution import fold_error, mode_errors
from spacemap_vtk.mechanics.response.oscillator import LOST
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.units import GRAVITY

#: The coarser cage also needs modes that are above the highest of the finer one.
_MORE_MODES = 1.25
#: Factor of the estimate of `mode_errors`, which may be half as large as the error.
_SAFETY = 2.0


@dataclass(frozen=True, eq=False)
class ErrorEstimates:
    """Solutions of one scene in cells of two widths, and what their difference says."""

    #: The stage whose figures are estimated, and a copy of it on the coarser cage.
    solver: ModalSolver
    coarse_solver: ModalSolver
    #: Width of the coarser cage's cells over that of the others.
    ratio: float

    @cached_property
    def modes(self) -> CageModes:
        """The modes in question."""
        return ModesReader().read(self.solver.output)

    @cached_property
    def coarse_modes(self) -> CageModes:
        """The modes of the coarser cage."""
        return ModesReader().read(self.coarse_solver.output)

    @cached_property
    def frequencies(self) -> list[Estimate | None]:
        """Relative error of each mode's frequency; None for rigid motions and lost frequencies."""
        own, other = self.modes, self.coarse_modes
        shapes, wider = (each.shapes.reshape(len(each.shapes), -1, 3) for each in (own, other))
        at_coarse = self._at_coarse_vertices(np.moveaxis(shapes, 1, 0))
        shares, eigenvalues = match_modes(
            np.moveaxis(at_coarse, 0, 1), wider, np.abs(other.nodal_mass), other.eigenvalues
        )
        waves = mode_errors(own.model, own.eigenvalues, own.shapes)
        found: list[Estimate | None] = []
        for number, (eigenvalue, wave) in enumerate(
            zip(own.eigenvalues.tolist(), waves, strict=True)
        ):
            if eigenvalue <= 0.0 or own.eigenvalue_rounding[number] > LOST:
                found.append(None)
                continue
            same = bool(shares[number] >= SAME_SHAPE)
            if not same:  # compare with the mode of the same number
                last = min(number, len(other.eigenvalues) - 1)
                eigenvalues[number] = other.eigenvalues[last]
            frequency = math.sqrt(max(eigenvalues[number], 0.0) / eigenvalue)
            estimate = self._estimate(1.0, frequency, same and self.same_state)
            if not estimate.converged and same and self.modes.model.displacement is None:
                # Waves of few cells: their dispersion is known better than the difference tells.
                estimate = estimate._replace(error=min(estimate.error, _SAFETY * wave or math.inf))
            found.append(estimate)
        return found

    @cached_property
    def same_state(self) -> bool:
        """Whether both cages hang in the same state of equilibrium."""
        own, other = self.modes.model.displacement, self.coarse_modes.model.displacement
        if own is None or other is None:
            return own is other
        return relative_difference(self._at_coarse_vertices(own), other) <= SAME_STATE

    @cached_property
    def folds(self) -> float:
        """Relative error of all figures of a sheet whose folds are too narrow for its cells."""
        gravity, sheet = math.hypot(*self.solver.gravity), sheet_of(self.solver.output)
        if sheet is None or gravity == 0.0:
            return 0.0
        length = min(sheet.bending_length) * (GRAVITY / gravity) ** (1 / 3)
        return fold_error(self.modes.model, length)

    def compare(self, fine: float, coarse: float) -> Estimate:
        """Estimate the error of a figure of the equilibrium.

        Parameters
        ----------
        fine, coarse : float
            The figure of `solver` and that of `coarse_solver`.

        Returns
        -------
        Estimate
            Its error, in the unit of the figure.
        """
        return self._estimate(fine, coarse, self.same_state)

    def _estimate(self, fine: float, coarse: float, same_state: bool) -> Estimate:
        order = SOLID_ORDER if self.modes.model.plate is None else SHEET_ORDER
        return estimate_error(
            fine, coarse, self.ratio, order=order, same_state=same_state, least=self.folds
        )

    @cached_property
    def _places(self) -> tuple[Floats, Ints]:
        """Weights and vertices that interpolate at the vertices of the coarser cage."""
        model = self.modes.model
        corners = model.cells[:, :4]
        found = locate(self.coarse_modes.model.points, model.points, corners)
        return found.weights, corners[found.tetrahedron]

    def _at_coarse_vertices(self, values: Floats) -> Floats:
        """Interpolate values of the vertices, (V, …), at those of the coarser cage."""
        weights, vertices = self._places
        result: Floats = np.einsum("vk,vk...->v...", weights, values[vertices])
        return result


def estimate_errors(solver: ModalSolver) -> ErrorEstimates:
    """Solve a cage again in cells about twice as wide, to estimate the errors of its figures.

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
    The second solution takes a quarter of the time or less, and is kept in the cache like any
    other. `spacemap_vtk.mechanics.modal.convergence` has the rule for the error.

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
    cage, ratio = chain[-1].make_coarser()
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
        except SpacemapError as error:
            raise SolverError(f"cells twice as wide have no solution: {error.message}") from error
        finally:
            coarse.RemoveObserver(observer)
    return ErrorEstimates(solver, coarse, ratio)


def _stage_above(stage: Stage) -> Stage:
    """Return the stage that makes the cage of another one."""
    connected = stage.GetNumberOfInputConnections(0)
    above = stage.GetInputConnection(0, 0).GetProducer() if connected else None
    if not isinstance(above, Stage) or above.makes != "cage":
        raise InputError("the cage does not come from TetraCage, which could make a coarser one")
    return above
