"""Effective constants of the composite that a scene's textile makes, with their errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.textile import Textile
from spacemap_vtk.filters.unit_cell import FEWEST_VOXELS, UnitCell, make_unit_cell
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.unit_cell.homogenise import (
    Constants,
    PlateStiffness,
    homogenise,
    homogenise_plate,
    von_mises,
)
from spacemap_vtk.unit_cell.mixtures import COMPONENTS
from spacemap_vtk.unit_cell.phases import Phases, UnitCellModel, pure_voxels, strain_map
from spacemap_vtk.unit_cell.rasterise import Voxels
from spacemap_vtk.unit_cell.voxel_elasticity import VoxelElasticity


@dataclass(frozen=True)
class Composite:
    """Constants of a unit cell, and how much they differ from those on voxels twice as large."""

    size: Floats
    """Size of the cell [m], (3,)."""
    voxels: tuple[int, int, int]
    """Voxels along x, y and z."""
    yarn_share: float
    """Volume of yarns over that of the cell."""
    fibre_share: float
    """Volume of fibres over that of the cell."""
    overlap: float
    """Share of the yarns' volume inside other yarns."""
    constants: Constants
    coarse: Constants
    plate: PlateStiffness | None = None
    coarse_plate: PlateStiffness | None = None


@contextmanager
def name_cell_errors(scene: Scene) -> Iterator[None]:
    """Add the scene's file to errors, and the section to those about a key of the unit cell."""
    with scene.add_file_to_errors():
        try:
            yield
        except SpacemapError as error:
            if error.section is None and error.key in UnitCell.parameters:
                error.section = UnitCell.section
            raise


def find_unit_cell(scene: Scene) -> tuple[UnitCell, Any]:
    """Return the parameters of a scene's unit cell, and the patches of its repeat."""
    source = scene.stage("source")
    if not isinstance(source, Textile):
        raise InputError(
            "a unit cell is made of the yarns of a textile, and this scene has none",
            cure="Choose a scene with [weave] or [textile].",
        )
    stage = scene.parts["unit_cell"]
    assert isinstance(stage, UnitCell)
    with name_cell_errors(scene):
        return stage, source.around_repeat().update().output


def warn_of_cell(scene: Scene, stage: UnitCell, voxels: Voxels, spacing: Floats) -> None:
    """Add what is doubtful in a cell to the warnings of its scene."""
    for text in stage.find_warnings(voxels, spacing):
        scene.warn(text)


def half_of(count: int) -> int:
    """Return the number of voxels from which the error follows; refuse too few to halve."""
    if count < 2 * FEWEST_VOXELS:
        raise InputError(
            "too few voxels for an error, which is the difference from half as many",
            key="unit_cell.voxels",
            value=count,
            allowed=f"at least {2 * FEWEST_VOXELS}",
        )
    return count // 2


def unit_cell_model(
    scene: Scene, fields: bool = False, progress: Progress | None = None
) -> UnitCellModel:
    """Return voxels, materials and perhaps fields of a scene's unit cell, for a file."""
    stage, patches = find_unit_cell(scene)
    with name_cell_errors(scene):
        model = stage.model(scene.title, patches)
        warn_of_cell(scene, stage, model.voxels, model.spacing)
        if not fields:
            return model
        phases = stage.assign(model.voxels, model.spacing)
        found = local_fields(phases, model.spacing, progress)
    return replace(model, fields=found)


def local_fields(
    phases: Phases, spacing: Floats, progress: Progress | None = None
) -> dict[str, NDArray[Any]]:
    """Return stresses [Pa], strains and equivalent stresses of the voxels under unit strains."""
    elasticity = VoxelElasticity(phases.stiffness, spacing)
    turn = np.eye(6) if phases.gradient is None else strain_map(phases.gradient)
    back = np.linalg.inv(turn)
    loads = np.ascontiguousarray(back.T)
    response = elasticity.solve(loads, report_progress=progress)
    made: dict[str, NDArray[Any]] = {}
    for name, load, moved in zip(COMPONENTS, loads, response.displacements, strict=True):
        strain, stress = elasticity.fields(moved, load)
        if phases.gradient is not None:
            strain = np.einsum("ij,j...->i...", turn, strain)
            stress = np.einsum("ji,j...->i...", back, stress)
        made[f"von_mises_{name}"] = von_mises(stress).ravel()
        made[f"stress_{name}"] = np.ascontiguousarray(stress.reshape(6, -1).T)
        made[f"strain_{name}"] = np.ascontiguousarray(strain.reshape(6, -1).T)
    return made


def largest_stresses(model: UnitCellModel) -> list[tuple[str, str, float]]:
    """Return load, constituent and largest equivalent stress [Pa] in it, for each load."""
    found = []
    for name in COMPONENTS:
        size = model.fields[f"von_mises_{name}"].reshape(model.voxels.fraction.shape)
        for constituent, inside in pure_voxels(model.voxels).items():
            if inside.any():
                found.append((name, constituent, float(size[inside].max())))
    return found


def directional_moduli(compliance: Floats, count: int = 361) -> tuple[Floats, Floats]:
    """Compute Young's modulus in the plane over its angle from x: angles [rad] and moduli [Pa]."""
    angle = np.linspace(0, 2 * np.pi, count)
    c, s = np.cos(angle), np.sin(angle)
    stress = np.stack([c**2, s**2, 0 * c, 0 * c, 0 * c, c * s])
    return angle, 1 / np.einsum("in,ij,jn->n", stress, compliance, stress)


def compute_constants(
    scene: Scene, plate: bool = False, progress: Progress | None = None
) -> Composite:
    """Compute the constants of a scene's unit cell, also on voxels twice as large."""
    stage, patches = find_unit_cell(scene)
    parts = 4 if plate else 2
    done = 0

    def report(share: float) -> None:
        if progress is not None:
            progress((done + share) / parts)

    made: list[Any] = []
    with name_cell_errors(scene):
        voxels, spacing = make_unit_cell(stage, patches, stage.voxels)
        warn_of_cell(scene, stage, voxels, spacing)
        fine = voxels
        longest = max(voxels.fraction.shape[1:])
        for count in (longest, half_of(longest)):
            if count != longest:
                voxels, spacing = make_unit_cell(stage, patches, count)
            else:
                changed = stage.gradient(voxels, spacing)
                gradient = np.eye(3) if changed is None else changed
                size = spacing * voxels.fraction.shape[::-1] * np.linalg.norm(gradient, axis=0)
            phases = stage.assign(voxels, spacing)
            made.append(homogenise(phases, spacing, report_progress=report)[0])
            done += 1
            if plate:
                made.append(homogenise_plate(phases, spacing, report_progress=report))
                done += 1
    share = float(fine.fraction.mean())
    fibres = fibre_share(fine, stage.packing) / float(np.linalg.det(gradient))
    depth, rows, width = fine.fraction.shape
    return Composite(
        size,
        (width, rows, depth),
        share,
        fibres,
        fine.overlap,
        made[0],
        made[parts // 2],
        made[1] if plate else None,
        made[3] if plate else None,
    )


def fibre_share(voxels: Voxels, packing: float) -> float:
    """Return the volume of fibres over that of the box of the voxels."""
    local = np.where(voxels.yarn >= 0, packing / voxels.area, 0.0)
    return float((voxels.fraction * local).mean())


def constant_rows(composite: Composite) -> list[tuple[str, str, str, str]]:
    """Return name, value, error and unit of each constant, as text."""
    fine, coarse = composite.constants, composite.coarse
    rough, made = coarse.engineering, []
    for name, value in fine.engineering.items():
        scale, unit = (1.0, "") if name.startswith("nu") else (1e9, "GPa")
        error = abs(value - rough[name])
        made.append((name.replace("nu", "ν"), f"{value / scale:.4g}", f"{error / scale:.1g}", unit))
    for axis, value, other in zip("xyz", fine.expansion[:3], coarse.expansion[:3], strict=True):
        made.append((f"α{axis}", f"{1e6 * value:.4g}", f"{1e6 * abs(value - other):.1g}", "ppm/K"))
    change = abs(fine.density - coarse.density)
    return [*made, ("density", f"{fine.density:.4g}", f"{change:.1g}", "kg/m³")]


def composite_as_json(composite: Composite) -> dict[str, Any]:
    """Return constants and errors for a JSON file."""
    fine, coarse = composite.constants, composite.coarse
    rough = coarse.engineering
    made: dict[str, Any] = {
        "order": list(COMPONENTS),
        "cell": composite.size.tolist(),
        "voxels": list(composite.voxels),
        "yarn_share": composite.yarn_share,
        "fibre_share": composite.fibre_share,
        "overlap": composite.overlap,
        "stiffness": fine.stiffness.tolist(),
        "constants": fine.engineering,
        "expansion": fine.expansion.tolist(),
        "density": fine.density,
        "error": {
            "stiffness": abs(fine.stiffness - coarse.stiffness).tolist(),
            "constants": {
                name: abs(value - rough[name]) for name, value in fine.engineering.items()
            },
            "expansion": abs(fine.expansion - coarse.expansion).tolist(),
            "density": abs(fine.density - coarse.density),
        },
    }
    if composite.plate is not None and composite.coarse_plate is not None:
        names = {"A": "membrane", "B": "coupling", "D": "bending"}
        made["plate"] = {
            letter: getattr(composite.plate, name).tolist() for letter, name in names.items()
        }
        made["error"]["plate"] = {
            letter: abs(
                getattr(composite.plate, name) - getattr(composite.coarse_plate, name)
            ).tolist()
            for letter, name in names.items()
        }
    return made
