"""Permeability of a scene's textile to a fluid between its yarns, with its error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.unit_cell import make_unit_cell
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.scenes.composite import find_unit_cell, half_of, name_cell_errors, warn_of_cell
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.unit_cell.stokes import permeability

#: Error over value from which it is reported.
_ROUGH = 0.2


@dataclass(frozen=True)
class Permeability:
    """Permeability of a unit cell, also on voxels twice as large."""

    size: Floats
    """Size of the cell [m], (3,)."""
    voxels: tuple[int, int, int]
    """Voxels along x, y and z."""
    yarn_share: float
    """Volume of yarns over that of the cell."""
    tensor: Floats
    """(3, 3) [m²]."""
    coarse: Floats
    """The same on voxels twice as large."""


def compute_permeability(scene: Scene, progress: Progress | None = None) -> Permeability:
    """Compute the permeability of a scene's unit cell, whose yarns are solid."""
    stage, patches = find_unit_cell(scene)
    tensors: list[Floats] = []

    def report(share: float) -> None:
        if progress is not None:
            progress((len(tensors) + share) / 2)

    with name_cell_errors(scene):
        fine, size = make_unit_cell(stage, patches, stage.voxels)
        warn_of_cell(scene, stage, fine, size)
        voxels, spacing = fine, size
        longest = max(fine.fraction.shape[1:])
        for count in (longest, half_of(longest)):
            if count != longest:
                voxels, spacing = make_unit_cell(stage, patches, count)
            changed = stage.gradient(voxels, spacing)
            if changed is not None:
                factors = np.diagonal(changed)
                if abs(changed - np.diag(factors)).max() > 1e-12:
                    raise InputError(
                        "the permeability is that of a cell with right angles",
                        key="unit_cell.shear",
                        value=stage.shear,
                        allowed="0, and a textile whose repeat has right angles",
                    )
                spacing = spacing * factors
            if not tensors:
                size = spacing * fine.fraction.shape[::-1]
            tensors.append(permeability(voxels.fraction, spacing, report_progress=report))
    errors = abs(np.diagonal(tensors[0] - tensors[1])) / np.diagonal(tensors[0])
    if rough := [
        f"{axis}: {error:.0%}" for axis, error in zip("xyz", errors, strict=True) if error > _ROUGH
    ]:
        scene.warn(
            f"the permeability is rough ({', '.join(rough)} of the value): gaps between yarns are "
            f"few voxels wide. Take more, for example unit_cell.voxels = {2 * longest}"
        )
    depth, rows, width = fine.fraction.shape
    return Permeability(size, (width, rows, depth), float(fine.fraction.mean()), *tensors)


def permeability_as_json(found: Permeability) -> dict[str, Any]:
    """Return the permeability and its error for a JSON file."""
    return {
        "cell": found.size.tolist(),
        "voxels": list(found.voxels),
        "yarn_share": found.yarn_share,
        "permeability": found.tensor.tolist(),
        "error": abs(found.tensor - found.coarse).tolist(),
    }
