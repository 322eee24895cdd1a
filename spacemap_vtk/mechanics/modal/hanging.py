"""Equilibrium of a sheet under dead loads, found in cells twice as wide first."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface, find_layer
from spacemap_vtk.mechanics.modal.coarsening import coarsen, coarsen_loads, refine
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress

#: Least number of unknowns of a sheet that is solved in wider cells first; the search is short
#: enough for others.
FEWEST = 30_000
#: Wider cells show the folds of a sheet if they are at most this share of its bending length wide.
#: In still wider ones cloth hangs in other folds, from which the way is longer than from level.
RESOLVED = 0.5
#: Share of the progress that wider cells take.
_FIRST = 0.3


def find_hung_state(
    model: Model, forces: Floats, progress: Progress | None = None
) -> tuple[Floats, float | None]:
    """Find the equilibrium of the undeformed body under dead loads.

    Parameters
    ----------
    model : Model
        The body.
    forces : ndarray of float64, shape (3V,)
        Forces on the vertices [N] of constant direction.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    displacement : ndarray of float64, shape (V, 3)
        Displacement of the vertices [m].
    critical : float or None
        Share of the load at which the body buckled, if it did; for a large sheet, in cells twice as
        wide.

    Raises
    ------
    InputError
        If nothing holds the body against the load, or a part of it is rigid.
    SolverError
        If no stable state was found.
    """
    coarse = None
    if model.pencil.surface is not None and model.pencil.size >= FEWEST:
        coarse = coarsen(model)
    if coarse is None or not _shows_folds(coarse, forces):
        return model.solve_equilibrium(forces, progress)
    report = progress or (lambda _: None)
    load = coarsen_loads(coarse, model, forces)
    found, critical = find_hung_state(coarse, load, lambda share: report(_FIRST * share))
    guess = refine(coarse, model, found)
    fine, _ = model.solve_equilibrium(
        forces, lambda share: report(_FIRST + (1 - _FIRST) * share), guess
    )
    return fine, critical


def _shows_folds(model: Model, forces: Floats) -> bool:
    """Check whether the cells of a sheet are narrow enough for its folds under a load."""
    layer, plate = find_layer(model.points, model.cells), model.plate
    assert layer is not None
    assert plate is not None
    assert isinstance(model.pencil.surface, MidSurface)
    pull = float(np.linalg.norm(forces.reshape(-1, 3).sum(axis=0)))
    corners = model.pencil.surface.to_nodes(model.points)[model.pencil.surface.quads]
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = float(np.linalg.norm(np.cross(*diagonals), axis=1).sum()) / 2
    rigidity = float(np.diag(plate.bending)[:2].min())
    # The bending length under this load in place of the weight.
    return pull * layer.cell**3 <= rigidity * area * RESOLVED**3
