"""What the surface carries over, and keeps, from step to step."""

from __future__ import annotations

import numpy as np
from test_pipeline import Chain, point_array, points
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import (
    PatchTessellator,
    WeaveSource,
)
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.paraview.stages import arrays_to_points


def test_point_arrays_are_interpolated_to_the_surface() -> None:
    chain = Chain()
    chain.update(time=0.1)
    patches, surface = chain.warp.GetOutputDataObject(0), chain.surface.GetOutputDataObject(0)
    data = surface.GetCellData()
    for name in ("yarn", "family", "color"):
        np.testing.assert_array_equal(
            vtk_to_numpy(data.GetArray(name)),
            np.repeat(vtk_to_numpy(patches.GetCellData().GetArray(name)), 4, axis=0),
        )
    normals = vtk_to_numpy(surface.GetPointData().GetNormals())
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert surface.GetFieldData().GetArray("warp_theta") is not None


def test_in_single_precision_a_cloth_takes_half_and_looks_the_same() -> None:
    chains = [Chain(), Chain()]
    chains[1].weave.precision = "single"
    for chain in chains:
        chain.update(time=0.1)
    double, single = chains
    for stage in ("weave", "warp"):
        one, other = (points(getattr(chain, stage)) for chain in chains)
        assert 2 * other.nbytes == one.nbytes
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-9)  # of 2 mm
    shift = [point_array(chain.warp, "displacement") for chain in chains]
    assert shift[1].dtype == np.float32
    np.testing.assert_allclose(shift[1], shift[0], rtol=0, atol=1e-9)
    # physics is of the cage, and stays double
    assert point_array(single.response, "displacement").dtype == np.float64
    np.testing.assert_allclose(points(single.surface), points(double.surface), rtol=0, atol=1e-9)
    normals = [point_array(chain.surface, "Normals") for chain in chains]
    np.testing.assert_allclose(normals[1], normals[0], rtol=0, atol=3e-3)  # of caps


def test_a_surface_of_the_same_cells_keeps_its_polygons_and_cell_arrays() -> None:
    chain = Chain()
    chain.update()
    before = chain.surface.GetOutputDataObject(0)
    polygons, yarn = before.GetPolys(), before.GetCellData().GetArray("yarn")
    position = before.GetPoint(0)
    chain.weave.warp_diameter = 1.1e-4
    chain.update()
    after = chain.surface.GetOutputDataObject(0)
    assert after.GetPoint(0) != position
    assert after.GetPolys() is polygons
    assert after.GetCellData().GetArray("yarn") is yarn
    chain.weave.ends = 5
    chain.update()
    assert chain.surface.GetOutputDataObject(0).GetPolys() is not polygons


def test_a_cell_array_changed_in_place_is_updated() -> None:
    weave, surface = WeaveSource(ends=1, picks=1), PatchTessellator(subdivisions=2)
    weave.update()
    grid = vtkUnstructuredGrid()
    grid.DeepCopy(weave.GetOutputDataObject(0))
    surface.SetInputDataObject(0, grid)
    surface.update()
    array = grid.GetCellData().GetArray("yarn")
    vtk_to_numpy(array)[:] = 7
    array.Modified()
    grid.Modified()
    surface.update()
    carried = surface.GetOutputDataObject(0).GetCellData().GetArray("yarn")
    assert (vtk_to_numpy(carried) == 7).all()


def test_yarn_numbers_at_points_become_cell_arrays() -> None:
    weave = WeaveSource(ends=3, picks=4, exact=True)
    usual, surface = PatchTessellator(subdivisions=2), PatchTessellator(subdivisions=2)
    (weave >> usual).update()
    grid = weave()
    count, cells = grid.GetNumberOfCells(), grid.GetCellData()
    add_array(cells, "patch", np.arange(count))  # neighbours differ
    arrays_to_points(grid)
    assert [cells.GetArrayName(i) for i in range(cells.GetNumberOfArrays())] == ["patch"]
    assert weave.output.GetCellData().GetNumberOfArrays() == 3
    varying = np.arange(grid.GetNumberOfPoints())
    add_array(grid.GetPointData(), "varying", varying)
    surface.SetInputDataObject(grid)
    surface.update()
    made = surface.output.GetCellData()
    for name in ("yarn", "family", "color"):
        found, expected = (
            vtk_to_numpy(data.GetArray(name)) for data in (made, usual.output.GetCellData())
        )
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(vtk_to_numpy(made.GetArray("patch")), np.arange(4 * count) // 4)
    points_made = surface.output.GetPointData()
    assert {points_made.GetArrayName(i) for i in range(points_made.GetNumberOfArrays())} == {
        "Normals",
        "varying",
    }
    # interpolated: a patch's corners are points of the surface
    corners = {grid.GetCell(0).GetPointId(corner) for corner in range(4)}
    assert corners <= set(vtk_to_numpy(points_made.GetArray("varying")))

    kept = made.GetArray("yarn")
    grid.Modified()
    surface.update()
    assert surface.output.GetCellData().GetArray("yarn") is kept
    array = grid.GetPointData().GetArray("yarn")
    vtk_to_numpy(array)[:] = 7
    array.Modified()
    grid.Modified()
    surface.update()
    assert (vtk_to_numpy(surface.output.GetCellData().GetArray("yarn")) == 7).all()
