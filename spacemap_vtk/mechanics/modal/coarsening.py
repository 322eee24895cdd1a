"""A sheet with cells twice as wide: results that differ there still depend on the cells."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.samples import sample_sheet
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import MidSurface, find_mid_surface
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Ints

#: Largest distance of a pair from its line of the lattice, as a share of the lattice's extent.
_LINE_TOLERANCE = 1e-6


def coarsen(model: Model) -> Model | None:
    """Make the undeformed model of a sheet with cells twice as wide, if possible."""
    # It has the supports of the vertices that are kept. None if the mesh is not a rectangular
    # lattice of at least four by four cells, if none of the vertices that are held is kept, or if
    # there are fittings (springs, masses, factors, …) or further energy terms other than obstacles.
    surface, plate = model.pencil.surface, model.plate
    obstacles = [term for term in model.terms if isinstance(term, ObstacleTerm)]
    if surface is None or plate is None or model.fittings.given:
        return None
    if len(obstacles) < len(model.terms):
        return None
    grid = _pair_grid(model.points, surface)
    if grid is None or min(grid.shape) <= 4:
        return None
    kept = grid[np.ix_(*(_kept_lines(n) for n in grid.shape))]
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.01), (kept.shape[1] - 1, kept.shape[0] - 1, 1))
    own = find_mid_surface(points, cells)
    assert own is not None
    order = np.lexsort(own.to_nodes(points)[: len(own.pairs), :2].T)
    held = np.zeros(points.shape, dtype=bool)
    for new, old in zip(own.pairs.T, surface.pairs.T, strict=True):
        points[new[order]] = model.points[old[kept.ravel()]]
        held[new[order]] = ~model.free.reshape(-1, 3)[old[kept.ravel()]]
    if not held.any() and not model.free.all():
        return None
    if not plate.follows_thickness:
        plate = Plate(plate.membrane, plate.bending, law=plate.law, curvature=plate.curvature)
    terms = [_coarsen_obstacle(term, points, own) for term in obstacles]
    return Model(points, cells, plate, model.density, held, model.lumped, terms=terms)


def coarsen_loads(coarse: Model, fine: Model, forces: Floats) -> Floats:
    """Share forces on the vertices, (3V,), linearly between the vertices that `coarsen` keeps."""
    result, parts = np.zeros_like(coarse.points), forces.reshape(-1, 3)
    for old, new in _ends_in_grids(coarse, fine):
        shared = parts[new]
        for axis, count in enumerate(new.shape):
            lines = _kept_lines(count)
            places, units = np.arange(count), np.eye(len(lines))
            weights = np.stack([np.interp(places, lines, unit) for unit in units])
            shared = np.moveaxis(np.tensordot(weights, shared, (1, axis)), 0, axis)
        result[old] = shared
    return result.ravel()


def refine(coarse: Model, fine: Model, moved: Floats) -> Floats:
    """Interpolate a displacement (V, 3) of the model made by `coarsen` to all vertices, (W, 3)."""
    # By cubic splines along both directions: linear interpolation would crease the sheet.
    from scipy.interpolate import make_interp_spline

    result = np.empty_like(fine.points)
    for old, new in _ends_in_grids(coarse, fine):
        values = moved[old]
        for axis, count in enumerate(new.shape):
            lines = _kept_lines(count)
            degree = min(3, len(lines) - 1)
            values = make_interp_spline(lines, values, k=degree, axis=axis)(np.arange(count))
        result[new] = values
    # What is held stays, also between the vertices that are held in both.
    return np.where(fine.free.reshape(-1, 3), result, 0.0)


def restrict(coarse: Model, fine: Model, moved: Floats) -> Floats:
    """Return the displacement of the vertices that `coarsen` keeps, (V, 3), from that of all."""
    result = np.empty_like(coarse.points)
    for old, new in _ends_in_grids(coarse, fine):
        result[old] = moved[new][np.ix_(*(_kept_lines(count) for count in new.shape))]
    return result


def _ends_in_grids(coarse: Model, fine: Model) -> Iterator[tuple[Ints, Ints]]:
    """Yield the vertices at the upper and lower ends of pairs, in rows and columns of both."""
    grids = []
    for model in (coarse, fine):
        surface = model.pencil.surface
        assert surface is not None
        grid = _pair_grid(model.points, surface)
        assert grid is not None
        grids.append(surface.pairs[grid])
    yield from ((grids[0][..., end], grids[1][..., end]) for end in (0, 1))


def _kept_lines(count: int) -> Ints:
    """Choose nearly every second of the lines: exactly if the number of cells is even."""
    return np.rint(np.linspace(0, count - 1, (count - 1) // 2 + 1)).astype(np.int64)


def _coarsen_obstacle(term: ObstacleTerm, points: Floats, surface: MidSurface) -> ObstacleTerm:
    """Make the term of an obstacle on wider cells, whose springs are softer as (cell)⁻⁴."""
    samples = sample_sheet(points, surface)
    cells = [float(each.areas.sum()) / len(each.nodes) for each in (samples, term.samples)]
    stiffness = term.stiffness * (cells[1] / cells[0]) ** 2
    return term.replace(samples=samples, stiffness=stiffness, surface=surface)


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
