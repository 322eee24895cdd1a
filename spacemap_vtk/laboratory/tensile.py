"""Tension as by KES-FB1: a strip of 20 cm by 5 cm between clamps, with free sides, to 500 gf/cm.

The clamps hold the width, and the sides are free: cloth near them becomes narrower as yarns across
the pull crimp more. The extension therefore lies between that of a held width and that of a long
strip. A quarter of the specimen is computed, flat, with the law of the cloth; the clamps move apart
in steps. The force is that on a clamp, per width at rest.

E5, E20 and E100 are the extensions by which FAST-3 describes cloth: of a strip 5 cm wide between
clamps 10 cm apart, at 5, 20 and 100 gf/cm.

Sources: S. Kawabata, "Standardization and Analysis of Hand Evaluation", 2nd ed. (1980); N. G. Ly
and others, "Simple instruments for quality control by finishers and tailors", Int. J. Clothing Sci.
Tech. 3 (1991) 14, for FAST.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.laboratory.biaxial import LARGEST, find_end, tensile_readings
from spacemap_vtk.laboratory.fabric import DIRECTIONS, Fabric
from spacemap_vtk.laboratory.records import (
    GF_PER_CM,
    PERCENT,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    add_errors,
)
from spacemap_vtk.mechanics.boundary.grips import make_grip
from spacemap_vtk.mechanics.contact.path import states_on_path
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Ints, Progress

#: Width of the specimen and distance of the clamps [m].
WIDTH, LENGTH = 0.20, 0.05
#: Cells along the width and the length of a quarter of the specimen.
CELLS = (24, 12)
#: Width of FAST-3's specimen and distance of its clamps [m], and cells of a quarter of it.
FAST_SIZE, FAST_CELLS = (0.05, 0.10), (8, 16)
#: Its loads per width [gf/cm].
FAST_LOADS = (5, 20, 100)
#: Steps up to the extension of a held width, and largest number of steps beyond.
_STEPS, _MOST = 12, 240
#: Mass per volume that the model needs, but no state at rest [kg/m³].
_DENSITY = 1.0
#: Points of a curve.
_POINTS = 201
#: Width of the cells over that of the narrowest ones, in the solutions that give the errors, and
#: the share of the work after each.
_WIDTHS = ((1, 0.7), (2, 0.9), (4, 1.0))


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Pull a specimen along the warp, and one along the weft."""
    readings: list[Reading] = []
    curves, states, notes = [], None, []
    for number, (name, axis) in enumerate(DIRECTIONS):
        figures = []
        for width, share in _WIDTHS:
            cells, fast_cells = (
                (along // width, across // width) for along, across in (CELLS, FAST_CELLS)
            )
            extension, force, moved = pull_strip(fabric, axis, cells=cells)
            found = end_at_largest(extension, force)
            fast = pull_strip(fabric, axis, FAST_SIZE, fast_cells)[:2]
            figures.append(tensile_readings(name, *found) + fast_readings(name, *fast))
            if width == 1:
                curves.append(Curve(name, *found))
                if states is None:
                    states = _mirror(fabric, moved, np.stack([extension, force], axis=1))
            progress((number + share) / len(DIRECTIONS))
        known, doubts = add_errors(*figures)
        readings += known
        notes += doubts
    return Measurement(
        readings,
        curves,
        Axis("extension", PERCENT),
        Axis("force per width", GF_PER_CM),
        notes,
        states,
    )


def fast_readings(name: str, extension: Floats, force: Floats) -> list[Reading]:
    """Compute the extensions at the loads of FAST-3, 4.9, 19.6 and 98.1 N/m."""
    loads = np.array(FAST_LOADS) * GF_PER_CM.size
    found = np.interp(loads, force, extension)
    return [
        Reading(f"E{load}", f"extension at {load} gf/cm", name, float(each), PERCENT)
        for load, each in zip(FAST_LOADS, found, strict=True)
    ]


def pull_strip(
    fabric: Fabric,
    axis: int,
    size: tuple[float, float] = (WIDTH, LENGTH),
    cells: tuple[int, int] = CELLS,
) -> tuple[Floats, Floats, Floats]:
    """Pull a strip along an axis of the cloth, and return extension, force and displacements."""
    # `size` are the width and the distance of the clamps [m], `cells` those of a quarter. Extension
    # (n,), force per width at rest (n,) [N/m], and displacements of a quarter, (n, V, 3) [m].
    points, tetrahedra = _quarter(fabric, axis, size, cells)
    way = np.eye(3)[axis]
    step = size[1] / 2 * find_end(fabric, way[:2]) / _STEPS
    moves = np.outer(step * np.arange(_MOST), way)
    grip = make_grip(points, "+" + "xyz"[axis], moves=moves)
    held = grip.held.copy()
    held[:, 2] = True  # flat
    for side in (0, 1):
        held[points[:, side] == 0.0, side] = True  # planes of symmetry
    model = Model(points, tetrahedra, fabric.plate, _DENSITY, held)
    extension, force, moved = [], [], []
    for number, state in enumerate(states_on_path(model, grips=[grip])):
        extension.append(2 * moves[number] @ way / size[1])
        force.append(2 * state.holding[grip.held[:, axis], axis].sum() / size[0])
        moved.append(state.displacement)
        if force[-1] >= LARGEST:
            return np.array(extension), np.array(force), np.array(moved)
    raise InputError(
        f"the force of a clamped strip does not reach {LARGEST:.4g} N/m",
        value=f"{force[-1]:.4g} N/m at {extension[-1]:.1%}",
        cure="Give the yarns a larger tension or modulus, in [yarns] or [textile]",
    )


def _quarter(
    fabric: Fabric, axis: int, size: tuple[float, float], cells: tuple[int, int]
) -> tuple[Floats, Ints]:
    """Make the quarter of a specimen at x, y >= 0."""
    half, thick = (size[0] / 2, size[1] / 2), fabric.thickness / 2
    order = (0, 1) if axis == 1 else (1, 0)
    bounds = (0.0, half[order[0]], 0.0, half[order[1]], -thick, thick)
    return build_lattice(bounds, (cells[order[0]], cells[order[1]], 1))


def end_at_largest(extension: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Interpolate a curve up to exactly the largest force."""
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import brentq

    curve = PchipInterpolator(extension, force)
    end = brentq(lambda e: float(curve(e)) - LARGEST, extension[-2], extension[-1], xtol=1e-12)
    found = np.linspace(0.0, end, _POINTS)
    return found, np.asarray(curve(found))


def _mirror(fabric: Fabric, moved: Floats, marks: Floats) -> States:
    """Make the states of the whole specimen along the warp from those of its quarter."""
    thick = fabric.thickness / 2
    bounds = (-WIDTH / 2, WIDTH / 2, -LENGTH / 2, LENGTH / 2, -thick, thick)
    points, cells = build_lattice(bounds, (2 * CELLS[0], 2 * CELLS[1], 1))
    quarter, _ = _quarter(fabric, 1, (WIDTH, LENGTH), CELLS)
    folded = points.copy()
    folded[:, :2] = abs(points[:, :2])
    keys = np.round(folded / [WIDTH / 2 / CELLS[0], LENGTH / 2 / CELLS[1], thick]).astype(int)
    known = np.round(quarter / [WIDTH / 2 / CELLS[0], LENGTH / 2 / CELLS[1], thick]).astype(int)
    number = {tuple(key): k for k, key in enumerate(known.tolist())}
    source = [number[tuple(key)] for key in keys.tolist()]
    signs = np.where(points < 0.0, -1.0, 1.0)
    signs[:, 2] = 1.0
    return States(points, cells, moved[:, source] * signs, marks, "front")
