"""Yarns of a file as a textile: read, completed with what the file lacks, shown or relaxed."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from spacemap_vtk import cache
from spacemap_vtk.errors import GeometryError, InputError, add_key_to_errors
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.io import registry
from spacemap_vtk.io.yarns.stitch_faces import read_smobj
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.curves import (
    Curve,
    CurveSet,
    fit_yarns,
    relax_curves,
    repeat_yarns,
)
from spacemap_vtk.textile.rods.overlap import find_largest_overlap
from spacemap_vtk.textile.rods.relax import SEARCH
from spacemap_vtk.textile.rods.yarns import Yarn, sample_yarns, unknowns

#: Length of 1 in a file that names no unit [m].
UNIT = 1e-3
#: Ending of files that are read with a library of faces.
_WITH_LIBRARY = ".smobj"
#: Overlap, as a share of the diameter, that is reported.
_SEEN = 0.01
#: Distances of splines from the curves in the file, in diameters, that are reported.
_FAR, _FAR_RELAXED = 1e-3, 2e-2


class FileYarns(NamedTuple):
    """Yarns of one cell."""

    yarns: list[Yarn]
    cell: Floats
    """(2, 3) Period vectors [m]."""
    aspects: Floats
    """(Y,) Width of each section over its height."""
    colors: list[tuple[int, int, int] | None]
    overlap: float
    """Largest overlap over the diameter, 0 if none."""
    deviation: float
    """Largest distance of the splines from the curves of the file, before relaxation [m]."""
    notes: list[str]


def read_yarn_file(
    path: Path, unit: float | None, library: Path | None = None
) -> tuple[CurveSet, list[str]]:
    """Read a file of yarns in metres, with sentences about it."""
    found = registry.reader(path, "yarns")
    if found is None:
        raise InputError(
            f"{path}: no format of yarns has this ending",
            key="file",
            value=path.suffix,
            allowed=registry.describe_readers("yarns"),
        )
    if library is not None and path.suffix.lower() != _WITH_LIBRARY:
        raise InputError(
            f"{path}: only a stitch mesh has its yarns in a library",
            key="library",
            value=library.name,
            cure="Remove library.",
        )
    with add_key_to_errors("file"):
        path = registry.require_file(path)
        given = found.read(path) if library is None else read_smobj(path, library)
    notes = [f"{path.name}: {note}" for note in given.notes]
    scale = given.unit if unit is None else unit
    if scale is None:
        scale = UNIT
        notes.append(
            f"{path.name} names no unit of length; 1 mm is assumed. Set textile.unit to change it"
        )
    return given.scaled(scale), notes


def make_file_yarns(
    path: Path,
    unit: float | None = None,
    diameter: float | None = None,
    period: tuple[float, float] | None = None,
    relax: bool = False,
    keep_cell: bool = False,
    library: Path | None = None,
    progress: Progress | None = None,
) -> FileYarns:
    """Read yarns of a file, and lay splines through their points or relax them."""
    # `unit` is the length of 1 in the file, `diameter` replaces those in the file, and `period` is
    # the size of a cell along x and y where the file has none; all in m. `keep_cell` keeps the size
    # of the cell while yarns relax. Raises InputError if the file is damaged, too large, or without
    # yarns or diameters, and SolverError if the yarns do not come to rest.
    given, notes = read_yarn_file(path, unit, library)
    if period is not None and any(period):
        given = _with_cell(given, period)
    if diameter is not None:
        aspect_free = [each._replace(diameter=diameter) for each in given.curves]
        given = given._replace(curves=aspect_free)
    bare = [number for number, each in enumerate(given.curves) if not each.diameter > 0.0]
    if bare:
        raise GeometryError(
            f"{path}: the file has no diameter of yarn {bare[0]}",
            key="diameter",
            cure="Set textile.diameter.",
        )
    aspects = np.array([each.aspect for each in given.curves])
    if relax:
        yarns, cell, deviation = _relaxed(given, keep_cell, progress)
        if (aspects != 1.0).any():
            notes.append(f"{path.name}: relaxed yarns are round, as thick as the sections are high")
        aspects = np.ones(len(aspects))
    else:
        fit = fit_yarns(given)
        yarns, cell, deviation = fit.yarns, given.cell, fit.deviation
    worst = find_largest_overlap(yarns, cell)
    share = 0.0 if worst is None else max(worst.share, 0.0)
    if worst is not None and share > _SEEN:
        x, y, z = worst.place * 1e3
        one, two = worst.yarns
        cure = "" if relax else "; textile.relax = true lets yarns come to rest"
        notes.append(
            f"{path.name}: yarns overlap by up to {share:.3g} of their diameter, yarns {one} and "
            f"{two} at ({x:.4g}, {y:.4g}, {z:.4g}) mm in the file{cure}"
        )
    thickest = max(yarn.diameter for yarn in yarns)
    if deviation > (_FAR_RELAXED if relax else _FAR) * thickest:
        notes.append(
            f"{path.name}: splines are up to {deviation * 1e3:.3g} mm from the curves in the file"
        )
    colors = [each.color for each in given.curves]
    return FileYarns(yarns, cell, aspects, colors, share, deviation, notes)


def _with_cell(given: CurveSet, period: tuple[float, float]) -> CurveSet:
    """Give a cell to yarns; those whose last point is the first one of the next cell repeat."""
    cell = np.array([[period[0], 0.0, 0.0], [0.0, period[1], 0.0]])
    curves = []
    for curve in given.curves:
        move = curve.nodes[-1] - curve.nodes[0]
        whole = [round(m / p) if p else 0 for m, p in zip(move[:2].tolist(), period, strict=True)]
        apart = np.linalg.norm(move - np.array(whole) @ cell)
        near = 1e-3 * max(period)
        if curve.periods is None and any(whole) and apart < near:
            curves.append(Curve(curve.nodes[:-1], (whole[0], whole[1]), *curve[2:]))
        else:
            curves.append(curve)
    return given._replace(curves=curves, cell=cell)


def _relaxed(
    given: CurveSet, keep_cell: bool, progress: Progress | None
) -> tuple[list[Yarn], Floats, float]:
    """Relax yarns, or load them as they were relaxed before."""
    parts = [part for curve in given.curves for part in (curve.nodes, curve.periods, curve[2])]
    key = digest_of("yarns of a file", SEARCH, given.cell, given.uniform, keep_cell, *parts)
    found = cache.load(key, points=(-1, 3), counts=(-1,), cell=(2, 3), deviation=(1,))
    if found is None:
        made, deviation = relax_curves(given, keep_cell, progress)
        found = {
            "points": np.concatenate([yarn.points for yarn in made.yarns]),
            "counts": np.array([len(yarn.points) for yarn in made.yarns]),
            "cell": made.cell,
            "deviation": np.array([deviation]),
        }
        cache.store(key, **found)
    pieces = np.split(found["points"], np.cumsum(found["counts"])[:-1])
    yarns = [
        Yarn(points, curve.periods, curve.diameter)
        for points, curve in zip(pieces, given.curves, strict=True)
    ]
    return yarns, found["cell"], float(found["deviation"][0])


class Piece(NamedTuple):
    """Lines of a piece of some cells."""

    lines: list[Floats]
    """Control points of each line about the middle of the piece [m]."""
    yarns: list[int]
    """Yarn of the cell that each line is."""


def piece_of(made: FileYarns, repeats: tuple[int, int]) -> Piece:
    """Repeat the yarns of a cell; lines of flatter sections come last."""
    lines = repeat_yarns(made.yarns, made.cell, repeats)
    lines.sort(key=lambda line: float(made.aspects[line[0]]))
    low = np.min([line[1:-1].min(axis=0) for _, line in lines], axis=0)
    high = np.max([line[1:-1].max(axis=0) for _, line in lines], axis=0)
    return Piece([line - (low + high) / 2 for _, line in lines], [number for number, _ in lines])


def file_figures(made: FileYarns, density: float) -> list[FabricFigure]:
    """List lengths, cell, thickness and mass; `density` is that of yarns [kg/m3]."""
    samples, z = sample_yarns(made.yarns), unknowns(made.yarns, made.cell)
    speed = np.linalg.norm(samples.slopes(z), axis=1)
    lengths = np.bincount(samples.yarn, speed * samples.weight)
    half = samples.diameter[samples.yarn] / 2
    height = samples.places(z)[:, 2]
    found = [
        FabricFigure("yarn_length", "yarn length in a cell", float(lengths.sum()), "m"),
        FabricFigure(
            "thickness", "thickness", float((height + half).max() - (height - half).min()), "m"
        ),
        FabricFigure("largest_overlap", "largest overlap over the diameter", made.overlap, "%"),
        FabricFigure("deviation", "distance of splines from the file", made.deviation, "m"),
    ]
    area = float(np.linalg.norm(np.cross(*made.cell)))
    if area > 0.0:
        sections = np.pi / 4 * samples.diameter**2 * made.aspects
        names = zip(("cell_x", "cell_y"), ("x", "y"), made.cell, strict=True)
        found = [
            *(
                FabricFigure(key, f"cell along {axis}", float(np.linalg.norm(vector)), "m")
                for key, axis, vector in names
            ),
            *found,
            FabricFigure(
                "areal_mass", "areal mass", density * float(lengths @ sections) / area, "kg/m2"
            ),
        ]
    return found
