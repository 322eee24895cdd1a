"""Polygon files made in memory equal those of VTK's writers."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOGeometry import vtkSTLWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter

from spacemap_vtk.io.formats.ply import write_ply
from spacemap_vtk.io.formats.stl import write_stl
from spacemap_vtk.io.polygons import orient_polygons, triangulate

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def cylinder(sides: int) -> pv.PolyData:
    """Return a cylinder: quadrilaterals between two polygons of many sides."""
    return pv.Cylinder(resolution=sides, capping=True)


def vertex_cloud() -> pv.PolyData:
    return pv.PolyData(np.random.default_rng(1).random((5, 3)), verts=[1, 2])


SURFACES = {
    "alike, with normals": lambda: pv.Sphere().compute_normals(),
    "alike, float64": lambda: pv.PolyData(pv.Sphere().points.astype(float), pv.Sphere().faces),
    "of all sizes": lambda: cylinder(40),
    "with texture coordinates": lambda: pv.Plane().texture_map_to_plane(),
    "no polygons": vertex_cloud,
}


@pytest.mark.parametrize("name", SURFACES)
def test_ply_equals_the_file_of_vtk(name: str, tmp_path: Path) -> None:
    data, file, theirs = SURFACES[name](), tmp_path / "a.ply", tmp_path / "b.ply"
    write_ply(file, data)
    writer = vtkPLYWriter()
    writer.SetFileName(str(theirs))
    writer.SetInputData(orient_polygons(data))
    writer.Write()
    (head, body), (other_head, other_body) = (
        path.read_bytes().split(b"end_header\n", 1) for path in (file, theirs)
    )
    assert body == other_body
    comments = (b"comment", b"obj_info")
    assert [line for line in head.split(b"\n") if not line.startswith(comments)] == [
        line for line in other_head.split(b"\n") if not line.startswith(comments)
    ]


def test_ply_stores_polygons_of_more_than_255_corners(tmp_path: Path) -> None:
    data, file = cylinder(300), tmp_path / "a.ply"
    write_ply(file, data)
    again = meshio.read(file)  # VTK's own reader counts in a byte, whatever the file says
    np.testing.assert_array_equal(again.points, data.points.astype(np.float32))
    found = [row for block in again.cells for row in block.data]
    assert [len(face) for face in found] == [4] * 300 + [300] * 2
    theirs = vtk_to_numpy(orient_polygons(data).GetPolys().GetConnectivityArray())
    np.testing.assert_array_equal(np.concatenate(found), theirs)


def test_stl_equals_the_file_of_vtk(tmp_path: Path) -> None:
    data, file, theirs = pv.Sphere(theta_resolution=300), tmp_path / "a.stl", tmp_path / "b.stl"
    data = data.merge(pv.PolyData([[0.0, 0, 0]] * 3, [3, 0, 1, 2]), merge_points=False)
    write_stl(file, data)
    writer = vtkSTLWriter()
    writer.SetFileTypeToBinary()
    writer.SetFileName(str(theirs))
    writer.SetInputData(orient_polygons(triangulate(data)))
    writer.Write()
    ours, vtks = file.read_bytes(), theirs.read_bytes()
    assert ours[80:84] == vtks[80:84]
    assert not ours.startswith(b"solid")
    one, other = (np.frombuffer(text[84:], _RECORD) for text in (ours, vtks))
    np.testing.assert_array_equal(one["corners"], other["corners"])
    np.testing.assert_allclose(one["normal"], other["normal"], atol=1e-6)
    assert not one["attributes"].any()
    assert np.isfinite(one["normal"]).all()


def test_an_empty_stl_is_written(tmp_path: Path) -> None:
    write_stl(tmp_path / "a.stl", pv.PolyData())
    assert len((tmp_path / "a.stl").read_bytes()) == 84
