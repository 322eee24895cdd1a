"""A sheet with cells twice as wide: results that differ there still depend on the cells."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import MidSurface, find_mid_surface
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Ints

#: Largest distance of a pair from its line of the lattice, as a share of the lattice's extent.
_LINE_TOLERANCE = 1e-6


def coarsen(model: Model) -> Model | None:
    """Make the model of a sheet with cells twice as wide, if possible.

    Parameters
    ----------
    model : Model
        Model of a sheet.

    Returns
    -------
    Model or None
        Undeformed, with the supports of the vertices that are kept. None if the mesh is not a
        rectangular lattice of at least four by four cells, or if there are fittings (springs,
        masses, factors, …) or further energy terms.
    """
    surface, plate = model.pencil.surface, model.plate
    if surface is None or plate is None or model.fittings.given or model.terms:
        return None
    grid = _pair_grid(model.points, surface)
    if grid is None or min(grid.shape) <= 4:
        return None
    # Lines that are nearly evenly spaced: every second one if the number of cells is even.
    rows, columns = (np.rint(np.linspace(0, n - 1, (n - 1) // 2 + 1)) for n in grid.shape)
    kept = grid[np.ix_(rows.astype(np.int64), columns.astype(np.int64))]
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.01), (kept.shape[1] - 1, kept.shape[0] - 1, 1))
    own = find_mid_surface(points, cells)
    assert own is not None
    order = np.lexsort(own.to_nodes(points)[: len(own.pairs), :2].T)
    held = np.zeros(points.shape, dtype=bool)
    for new, old in zip(own.pairs.T, surface.pairs.T, strict=True):
        points[new[order]] = model.points[old[kept.ravel()]]
        held[new[order]] = ~model.free.reshape(-1, 3)[old[kept.ravel()]]
    if not plate.follows_thickness:
        plate = Plate(plate.membrane, plate.bending)
    return Model(points, cells, plate, model.density, held, model.lumped)


def _pair_grid(points: Floats, surface: MidSurface) -> Ints | None:
    """Arrange the pairs of a rectangular lattice in rows and columns; None for other meshes."""
    places = surface.to_nodes(points)[: len(surface.pairs)]
    near = _LINE_TOLERANCE * float(np.ptp(places, axis=0).max())
    lines = []
    for axis in ((surface.normal + 2) % 3, (surface.normal + 1) % 3):
        order = np.argsort(places[:, axis], kind="stable")
        number = np.empty(len(order), dtype=np.int64)
        number[order] = np.cumsum(np.diff(places[order, axis], prepend=-np.inf) > near) - 1
        lines.append(number)
    shape = int(lines[0].max()) + 1, int(lines[1].max()) + 1
    grid = np.full(shape, -1, dtype=np.int64)
    grid[lines[0], lines[1]] = np.arange(len(places))
    return None if grid.size != len(places) or (grid < 0).any() else grid
