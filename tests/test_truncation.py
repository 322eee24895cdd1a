"""Truncated files: each is refused with one message, and none crashes the program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from spacemap_vtk import ObjectSource
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.exodus import is_truncated as netcdf_is_cut_off
from spacemap_vtk.io.formats.vtk_legacy import is_truncated as legacy_is_cut_off


def ball() -> pv.PolyData:
    mesh = pv.Sphere(theta_resolution=12, phi_resolution=9)
    mesh["heat"] = np.arange(mesh.n_points, dtype=np.float64)
    mesh.point_data["RGB"] = np.zeros((mesh.n_points, 3), dtype=np.uint8)
    mesh.cell_data["part"] = np.arange(mesh.n_cells, dtype=np.int32)
    return mesh


def write_mesh(folder: Path, name: str) -> Path:
    file, mesh = folder / name, ball()
    kind, ending = name.split(".")
    if ending == "e":
        from vtkmodules.vtkIOExodus import vtkExodusIIWriter

        writer = vtkExodusIIWriter()
        writer.SetInputData(pv.ImageData(dimensions=(4, 4, 4)).to_tetrahedra())
        writer.SetFileName(str(file))
        writer.Write()
    elif ending == "glb":
        file.write_bytes(glb(mesh))
    elif ending == "vtk" and kind == "grid":
        grid = pv.ImageData(dimensions=(4, 4, 4)).to_tetrahedra()
        grid["heat"] = grid.points[:, 0].copy()
        grid.save(file)
    elif ending in ("vtu", "vtkhdf"):
        mesh.cast_to_unstructured_grid().save(file)
    else:
        mesh.save(file, binary=kind != "text")
    return file


def glb(mesh: pv.PolyData) -> bytes:
    """Return a binary glTF file, made by its specification."""
    import json

    points = mesh.points.astype("<f4").tobytes()
    faces = mesh.regular_faces.astype("<u4").tobytes()
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
        {"buffer": 0, "byteOffset": len(points), "byteLength": len(faces)},
    ]
    low, high = mesh.points.min(axis=0).tolist(), mesh.points.max(axis=0).tolist()
    position = {"bufferView": 0, "componentType": 5126, "count": mesh.n_points, "type": "VEC3"}
    text = json.dumps(
        {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "buffers": [{"byteLength": len(points) + len(faces)}],
            "bufferViews": views,
            "accessors": [
                {**position, "min": low, "max": high},
                {"bufferView": 1, "componentType": 5125, "count": 3 * mesh.n_cells}
                | {"type": "SCALAR"},
            ],
        }
    ).encode()
    text += b" " * (-len(text) % 4)
    body = points + faces
    whole = 12 + 8 + len(text) + 8 + len(body)
    header = b"glTF" + (2).to_bytes(4, "little") + whole.to_bytes(4, "little")
    chunks = len(text).to_bytes(4, "little") + b"JSON" + text
    return header + chunks + len(body).to_bytes(4, "little") + b"BIN\0" + body


SHARES = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97)
#: Each file of these kinds is read in a process of its own, which takes a second to start.
SLOW = ("bin.vtp", "bin.vtu", "bin.vtkhdf")
FILES = [
    *("bin.ply", "text.ply", "bin.stl", "text.stl", "bin.vtk", "text.vtk", "grid.vtk"),
    *("bin.e", "bin.glb"),
]


@pytest.mark.parametrize(
    ("name", "shares"),
    [
        *((name, SHARES) for name in FILES),
        ("bin.vtu", (0.97,)),
        *(pytest.param(name, SHARES, marks=pytest.mark.nightly) for name in SLOW),
    ],
)
def test_every_truncated_file_is_refused(
    tmp_path: Path, name: str, shares: tuple[float, ...]
) -> None:
    file = write_mesh(tmp_path, name)
    content = file.read_bytes()
    source = ObjectSource(file=file)
    source.update()
    assert source.GetOutputDataObject(0).GetNumberOfPoints() > 0
    for share in shares:
        file.write_bytes(content[: int(share * len(content))])
        with pytest.raises(InputError) as caught:
            ObjectSource(file=file).update()
        assert str(file) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_binary_ply_with_faces_of_several_sizes_is_checked(tmp_path: Path) -> None:
    """VTK's writer also mixes triangles and quadrilaterals."""
    points = np.random.default_rng(0).random((9, 3))
    faces = [3, 0, 1, 2, 4, 1, 2, 3, 4, 3, 5, 6, 7, 5, 0, 2, 4, 6, 8]
    file = tmp_path / "mixed.ply"
    pv.PolyData(points, faces).save(file)
    source = ObjectSource(file=file)
    source.update()
    assert source.GetOutputDataObject(0).GetNumberOfCells() == 4
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(InputError, match="truncated"):
        ObjectSource(file=file).update()


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("kind", ["surface", "lines", "image", "rectilinear", "structured", "old"])
def test_complete_legacy_files_are_accepted(tmp_path: Path, kind: str, binary: bool) -> None:
    file, box = tmp_path / "thing.vtk", pv.ImageData(dimensions=(3, 4, 5))
    box["heat"] = np.arange(60.0)
    box["way"] = np.random.default_rng(0).random((60, 3))
    box.cell_data["part"] = np.arange(24)
    data = {
        "surface": ball,
        "lines": lambda: pv.Spline(np.random.default_rng(0).random((5, 3)), 30),
        "image": lambda: box,
        "rectilinear": box.cast_to_rectilinear_grid,
        "structured": box.cast_to_structured_grid,
        "old": box.cast_to_unstructured_grid,
    }[kind]()
    if kind == "old":
        from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter

        writer = vtkUnstructuredGridWriter()
        writer.SetFileVersion(42)
        writer.SetInputData(data)
        writer.SetFileName(str(file))
        if binary:
            writer.SetFileTypeToBinary()
        writer.Write()
    else:
        data.save(file, binary=binary)
    assert not legacy_is_cut_off(file)
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 3 // 5])
    assert legacy_is_cut_off(file)


def test_truncated_netcdf_of_every_version_is_found(tmp_path: Path) -> None:
    """The files are written by SciPy, with and without records."""
    from scipy.io import netcdf_file

    for version in (1, 2):
        path = tmp_path / f"v{version}.nc"
        with netcdf_file(path, "w", version=version) as file:
            file.createDimension("time", None)
            file.createDimension("node", 7)
            file.createVariable("x", "f8", ("node",))[:] = np.arange(7)
            for name in ("u", "v"):
                file.createVariable(name, "f4", ("time", "node"))
            for step in range(3):
                file.variables["u"][step] = np.full(7, step)
                file.variables["v"][step] = np.full(7, -step)
        assert not netcdf_is_cut_off(path)
        content = path.read_bytes()
        for length in (10, 60, len(content) // 2, len(content) - 1):
            path.write_bytes(content[:length])
            assert netcdf_is_cut_off(path)
    path.write_bytes(b"\x89HDF\r\n")
    assert not netcdf_is_cut_off(path)
