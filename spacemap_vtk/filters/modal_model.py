"""The mechanical model of a cage, written into ModalSolver's output and read from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import cache
from spacemap_vtk.datasets.arrays import add_array, array_of, elements_of, points_of
from spacemap_vtk.mechanics.model import Model, digest_of


def attach(grid: vtkUnstructuredGrid, model: Model) -> None:
    """Write what a model is made of beside mesh: supports and material."""
    held = (~model.free).reshape(-1, 3).astype(np.uint8)
    data = grid.GetPointData()
    add_array(data, "fixed", held.max(axis=1))
    add_array(data, "fixed_components", held)
    add_array(data, "nodal_mass", model.nodal_mass)
    field = grid.GetFieldData()
    add_array(field, "elasticity", model.elasticity)
    add_array(field, "density", np.array([model.density]))
    add_array(field, "lumped", np.array([model.lumped], dtype=np.uint8))


def model_of(grid: vtkUnstructuredGrid) -> Model:
    """Return the mechanical model that a cage's modes were computed with."""
    # While ModalSolver, or anyone else, holds that model, its matrices and factors are shared;
    # otherwise they are made when they are first asked for.
    owner = "ModalResponse (put a ModalSolver before it)"
    field = grid.GetFieldData()
    return Model(
        points_of(grid).astype(np.float64, copy=False),
        elements_of(grid),
        array_of(field, "elasticity", owner),
        float(array_of(field, "density", owner)[0]),
        array_of(grid.GetPointData(), "fixed_components", owner) != 0,
        bool(array_of(field, "lumped", owner)[0]),
    )


def rounding_of(grid: vtkUnstructuredGrid) -> NDArray[np.float64]:
    """Return the share of each eigenvalue that is rounding."""
    field = grid.GetFieldData()
    if field.GetArray("eigenvalue_rounding") is None:
        return np.zeros(len(array_of(field, "eigenvalues", "the modes")))
    return array_of(field, "eigenvalue_rounding", "the modes")


def static_displacements(
    model: Model, forces: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return static displacements, from the user's cache folder where they were solved before."""
    # For the unit modulus: another one changes neither the entry nor, but for its size, the answer.
    keys = [f"static-{digest_of(model.digest, np.ascontiguousarray(f))}" for f in forces.T]
    result, rounding = np.empty(forces.shape), np.empty(len(keys))
    missing = []
    for column, key in enumerate(keys):
        entry = cache.load(key) or {}
        kept, share = entry.get("displacement"), entry.get("rounding")
        if (
            kept is None
            or share is None
            or kept.shape != (len(forces),)
            or share.shape != (1,)
            or not kept.dtype == share.dtype == np.float64
        ):
            missing.append(column)
        else:
            result[:, column], rounding[column] = kept / model.modulus, share[0]
    if missing:
        result[:, missing], rounding[missing] = model.statics(forces[:, missing])
        for column in missing:
            cache.store(
                keys[column],
                displacement=result[:, column] * model.modulus,
                rounding=rounding[column : column + 1],
            )
    return result, rounding
