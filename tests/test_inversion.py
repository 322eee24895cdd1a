"""Elements that a motion turns inside out are counted and reported."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from spacemap_vtk import (
    ModalResponse,
    ModalSolver,
    RotationStrain,
    TetraCage,
    TransientResponse,
    WeaveSource,
)
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import SpacemapWarning
from spacemap_vtk.filters.base import connect
from spacemap_vtk.mechanics.elements.inversion import count_inverted
from spacemap_vtk.mechanics.elements.shell import find_mid_surface


def run_mover(mover: Any, shift: float) -> tuple[Any, list[str]]:
    """Return a cage that a mover starts shifted, or with z mirrored and stretched, and warnings."""
    solver = ModalSolver(youngs_modulus=1e3, modes=1000, elements="tetrahedra")
    grid = connect(WeaveSource(ends=4, picks=3), TetraCage(divisions=(3, 3, 1)), solver)
    cage = grid.update().output
    points = vtk_to_numpy(cage.GetPoints().GetData()).astype(float)
    field = np.zeros_like(points)
    field[:, 2] = shift if shift else -2.5 * points[:, 2]
    array = numpy_to_vtk(field, deep=True)
    array.SetName("start")
    moved = cage.NewInstance()
    moved.ShallowCopy(cage)
    moved.GetPointData().AddArray(array)
    mover.configure(initial_displacement_array="start", gravity=(0, 0, 0))
    mover.SetInputDataObject(0, moved)
    last = connect(mover, RotationStrain()) if isinstance(mover, RotatedResponse) else mover
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SpacemapWarning)
        output = last.update(0.0).output
    return output, [str(w.message) for w in caught if "inside out" in str(w.message)]


class RotatedResponse(ModalResponse):
    """A response with a RotationStrain behind it."""


@pytest.mark.parametrize("kind", [ModalResponse, TransientResponse, RotatedResponse])
def test_inverted_tetrahedra_are_counted(
    kind: type, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path))
    output, caught = run_mover(kind(), 0.0)
    points = vtk_to_numpy(output.GetPoints().GetData())
    moved = points + vtk_to_numpy(output.GetPointData().GetArray("displacement"))
    cells = vtk_to_numpy(output.GetCells().GetConnectivityArray()).reshape(-1, 4)
    edges = [np.linalg.det(at[cells[:, 1:]] - at[cells[:, :1]]) for at in (points, moved)]
    count = int((edges[0] * edges[1] < 0).sum())
    assert count > len(cells) / 2
    (text,) = caught
    assert re.match(rf"{count} of {len(cells)} tetrahedra are turned inside out", text)
    assert run_mover(kind(), 1e-6)[1] == []


def test_inverted_cells_of_a_sheet_are_counted() -> None:
    """Rolling it up tightly turns tetrahedra inside out, but no cell."""
    points, cells = build_lattice((0, 1, 0, 0.5, -0.01, 0.01), (8, 3, 1))
    surface = find_mid_surface(points, cells)
    assert surface is not None
    mirrored = points * [0, 0, -2]
    assert count_inverted(points, mirrored, cells, surface) == 24
    half = np.where((points[:, 0] > 0.49)[:, None], mirrored, 0.0)
    assert 8 < count_inverted(points, half, cells, surface) < 16
    radius = 0.005  # a quarter of its thickness
    angle, reach = points[:, 0] / radius, radius - points[:, 2]
    rolled = np.stack(
        [reach * np.sin(angle / 40), points[:, 1], radius - reach * np.cos(angle / 40)], 1
    )
    assert count_inverted(points, rolled - points, cells, surface) == 0
