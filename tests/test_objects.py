"""Objects out of files: read, placed, deformed, drawn, written."""

from __future__ import annotations

import struct
import tracemalloc
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from spacemap_vtk import BarycentricWarp, ObjectSource, PatchTessellator, TetraCage
from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.draw.frame import camera_of
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.io.texture_atlas import read_picture
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values
from spacemap_vtk.workers import WORKER_VARIABLE


def ball() -> pv.PolyData:
    mesh = pv.Sphere(radius=1.0, theta_resolution=20, phi_resolution=20)
    mesh.point_data["heat"] = mesh.points[:, 2].astype(np.float32)
    mesh.cell_data["part"] = np.arange(mesh.n_cells)
    return mesh


def read(file: Path, **values: object) -> pv.DataSet:
    source = ObjectSource(file=file, **values)
    source.update()
    return pv.wrap(source.GetOutputDataObject(0))


@pytest.mark.parametrize("ending", ["stl", "ply", "obj", "vtp", "vtk", "vtu", "vtm", "gltf"])
def test_formats(tmp_path: Path, ending: str) -> None:
    mesh, file = ball(), tmp_path / f"ball.{ending}"
    if ending == "vtu":
        mesh = mesh.cast_to_unstructured_grid()
    if ending == "vtm":
        pv.MultiBlock([mesh, None, pv.MultiBlock([mesh.translate((3, 0, 0))])]).save(file)
    elif ending == "gltf":
        prepare_offscreen()
        plotter = pv.Plotter(off_screen=True, window_size=(40, 30))
        plotter.add_mesh(mesh)
        plotter.export_gltf(str(file))
        plotter.close()
    else:
        mesh.save(file)
    found = read(file)
    assert found.n_points == mesh.n_points * (1 + (ending == "vtm"))
    assert isinstance(found, pv.UnstructuredGrid if ending == "vtu" else pv.PolyData)
    # glTF has y upwards: the exporter turns
    tops = [np.sort(data.points[: mesh.n_points].max(axis=0)) for data in (found, mesh)]
    np.testing.assert_allclose(*tops, atol=1e-6)
    if ending in ("vtp", "vtk", "vtu", "vtm"):
        np.testing.assert_array_equal(found["heat"][: mesh.n_points], mesh["heat"])
        np.testing.assert_array_equal(found["part"][: mesh.n_cells], mesh["part"])
    if ending in ("vtp", "vtk", "vtu", "gltf"):
        normals = found.point_data.active_normals
        np.testing.assert_allclose(np.einsum("nk,nk->n", normals, found.points), 1, atol=0.02)
    if ending == "vtm":
        np.testing.assert_array_equal(np.bincount(found["block"]), [mesh.n_cells] * 2)


def scene_of_3ds() -> bytes:
    def chunk(kind: int, content: bytes) -> bytes:
        return struct.pack("<HI", kind, 6 + len(content)) + content

    points = struct.pack("<H9f", 3, 0, 0, 0, 1, 0, 0, 0, 1, 0)
    mesh = chunk(0x4110, points) + chunk(0x4120, struct.pack("<H4H", 1, 0, 1, 2, 7))
    return chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, b"one\0" + chunk(0x4100, mesh))))


VRML = (
    b"#VRML V2.0 utf8\nShape { geometry IndexedFaceSet { coord Coordinate { point "
    b"[0 0 0, 1 0 0, 0 1 0] } coordIndex [0 1 2 -1] } }\n"
)


@pytest.mark.parametrize(("ending", "content"), [("3ds", scene_of_3ds()), ("wrl", VRML)])
def test_3ds_file_is_read_without_a_plotter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, content: bytes
) -> None:
    """A plotter needs OpenGL: where its libraries are missing, to open one crashes."""
    monkeypatch.delattr(pv, "Plotter")
    monkeypatch.setenv(WORKER_VARIABLE, "1")  # read here, in no other process
    (tmp_path / f"a.{ending}").write_bytes(content)
    found = read(tmp_path / f"a.{ending}")
    np.testing.assert_array_equal(found.points, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert found.n_cells == 1


@pytest.mark.parametrize("ending", ["msh", "inp", "mesh", "off", "xdmf", "e"])
def test_formats_of_other_programs(tmp_path: Path, ending: str) -> None:
    """Gmsh's and Abaqus's share their endings with formats that come first."""
    file = tmp_path / f"box.{ending}"
    grid = pv.ImageData(dimensions=(3, 3, 3)).to_tetrahedra()
    if ending == "e":
        from vtkmodules.vtkIOExodus import vtkExodusIIWriter

        writer = vtkExodusIIWriter()
        writer.SetInputData(grid)
        writer.SetFileName(str(file))
        writer.Write()
    else:
        pytest.importorskip("meshio")
        skin = pv.Sphere(theta_resolution=8, phi_resolution=6)
        grid = pv.PolyData(skin.points, skin.faces) if ending == "off" else grid
        known = {"file_format": "gmsh"} if ending == "msh" else {}
        pv.save_meshio(file, grid, **known)
    scene = Scene.read(file)
    scene.update()
    found = pv.wrap(scene.object.GetOutputDataObject(0))
    assert (found.n_points, found.n_cells) == (grid.n_points, grid.n_cells)
    np.testing.assert_allclose(found.bounds, grid.bounds, atol=1e-6)


def test_blocks_of_different_types_keep_their_arrays(tmp_path: Path) -> None:
    line = pv.Line((0, 0, 0), (0, 0, 5))
    line["along"] = np.array([1.0, 2.0])
    box = pv.ImageData(dimensions=(2, 2, 2))
    file = tmp_path / "mixed.vtm"
    pv.MultiBlock([ball(), line, box]).save(file)
    found = read(file)
    assert isinstance(found, pv.UnstructuredGrid)
    assert np.isnan(found["along"]).sum() == found.n_points - 2
    assert np.isnan(found["heat"]).sum() == 10
    assert set(found["block"]) == {0, 1, 2}
    tinted = ball()
    tinted["RGB"] = np.zeros((tinted.n_points, 3), dtype=np.uint8)
    pv.MultiBlock([tinted, line]).save(file)
    colours = read(file)["RGB"]
    assert (colours[:-2] == 0).all()
    assert (colours[-2:] == 255).all()


def test_object_is_scaled_rotated_and_moved(tmp_path: Path) -> None:
    file = tmp_path / "ball.vtp"
    mesh = ball()
    mesh.save(file)
    found = read(file, scale=0.001, rotate=(90, 0, "90 deg"), place=("1 m", 0, "5 mm"))
    x, y, z = 0.001 * mesh.points.T
    # about x: y -> z, z -> -y; then about z: x -> y, y -> -x
    np.testing.assert_allclose(found.points, np.stack((z + 1, x, y + 0.005), axis=1), atol=1e-7)
    nx, ny, nz = mesh.point_data.active_normals.T
    np.testing.assert_allclose(
        found.point_data.active_normals, np.stack((nz, nx, ny), axis=1), atol=1e-6
    )


def warped(mesh: pv.DataSet, motion: np.ndarray) -> BarycentricWarp:
    """Move a mesh by an affine map, x -> motion x."""
    cage = TetraCage(divisions=(2, 2, 2), padding=0.1)
    cage.SetInputDataObject(mesh)
    cage.update()
    grid = pv.wrap(cage.GetOutputDataObject(0)).copy()
    add_array(grid.GetPointData(), "displacement", grid.points @ (motion - np.eye(3)).T)
    warp = BarycentricWarp()
    warp.SetInputDataObject(0, mesh)
    warp.SetInputDataObject(1, grid)
    warp.update()
    return warp


def test_normals_rotate_with_the_surface() -> None:
    """The normals of an ellipsoid in closed form: the gradient of its equation."""
    mesh = pv.Sphere(radius=1.0)
    mesh.points = mesh.points.astype(np.float64)
    mesh.point_data.active_normals = mesh.points.astype(np.float32)
    mesh = mesh.compute_normals(point_normals=False, auto_orient_normals=True)
    motion = (
        np.diag([1.0, 2.0, 3.0]) @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    )
    motion *= np.sign(np.linalg.det(motion))
    found = pv.wrap(warped(mesh, motion).GetOutputDataObject(0))
    expected = found.points @ np.linalg.inv(motion @ motion.T)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(found.point_data.active_normals, expected, atol=1e-6)
    cells = found.cell_data.active_normals
    np.testing.assert_allclose(cells, found.compute_normals(point_normals=False)["Normals"])
    np.testing.assert_allclose(np.linalg.norm(cells, axis=1), 1, atol=1e-6)


def test_texture_coordinates_and_colours_are_kept() -> None:
    mesh = pv.Plane(i_resolution=4, j_resolution=4)
    mesh.point_data["RGB"] = np.arange(75, dtype=np.uint8).reshape(25, 3)
    found = pv.wrap(warped(mesh, np.eye(3) * 2).GetOutputDataObject(0))
    np.testing.assert_array_equal(found.active_texture_coordinates, mesh.active_texture_coordinates)
    np.testing.assert_array_equal(found["RGB"], mesh["RGB"])


def test_higher_order_cells_move_by_their_control_points() -> None:
    """A quadratic tetrahedron under an affine map: its surface is the mapped surface."""
    grid = pv.examples.cells.QuadraticTetrahedron()
    grid.points[4:] += 0.05
    motion = np.array([[1.0, 0.3, 0], [0, 2.0, 0.1], [0, 0, 0.5]])

    def surface(data: pv.DataSet) -> pv.PolyData:
        stage = PatchTessellator(subdivisions=4)
        stage.SetInputDataObject(data)
        stage.update()
        return pv.wrap(stage.GetOutputDataObject(0))

    before, after = surface(grid), surface(warped(grid, motion).GetOutputDataObject(0))
    assert after.n_points == before.n_points > grid.n_points
    np.testing.assert_allclose(after.points, before.points @ motion.T, atol=1e-6)


def test_points_without_cells_are_drawn(tmp_path: Path) -> None:
    """A scan is often nothing but points."""
    file = tmp_path / "scan.ply"
    lines = "".join(f"{x} {x * x} {1 - x}\n" for x in np.linspace(0, 1, 20))
    header = "ply\nformat ascii 1.0\nelement vertex 20\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    file.write_text(f"{header}end_header\n{lines}")
    scene = Scene.read(file)
    scene.update()
    assert scene.polygons.GetNumberOfVerts() == 20


def test_attribute_types_of_arrays_are_kept() -> None:
    """Normals shade, and texture coordinates paint, a volume's surface too."""
    grid = ball().texture_map_to_sphere().cast_to_unstructured_grid()
    stage = PatchTessellator()
    stage.SetInputDataObject(grid)
    stage.update()
    found = pv.wrap(stage.GetOutputDataObject(0))
    np.testing.assert_array_equal(
        np.sort(found.point_data.active_normals, axis=0),
        np.sort(grid.point_data.active_normals, axis=0),
    )
    assert found.active_texture_coordinates.shape == (found.n_points, 2)
    assert found.point_data.active_scalars_name == grid.point_data.active_scalars_name


def test_surface_of_a_volume_is_extracted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    import spacemap_vtk.datasets.surface_extract as module

    calls = []
    real = module.extract_surface
    monkeypatch.setattr(module, "extract_surface", lambda *a: calls.append(1) or real(*a))
    grid = pv.ImageData(dimensions=(4, 4, 4)).cast_to_unstructured_grid()
    grid["heat"] = grid.points[:, 0].copy()
    grid.cell_data["part"] = np.arange(27)
    stage = PatchTessellator()
    for step in range(3):
        moved = grid.copy()
        moved.points = moved.points + step
        moved["heat"] = moved.points[:, 0] + step
        stage.SetInputDataObject(moved)
        stage.update()
        found = pv.wrap(stage.GetOutputDataObject(0))
        assert (found.n_cells, found.n_points) == (54, 56)
        np.testing.assert_allclose(found.bounds, moved.bounds)
        np.testing.assert_allclose(found["heat"], found.points[:, 0] + step)
        assert len(found["part"]) == 54
    assert len(calls) == 1
    # the same points in other cells
    stage.SetInputDataObject(grid.extract_cells(range(9)))
    stage.update()
    assert len(calls) == 2


@pytest.mark.parametrize("kind", ["surface", "volume", "lines", "points", "colours"])
def test_every_kind_of_object_is_drawn(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "thing.vtk"
    mesh: pv.DataSet = {
        "surface": ball,
        "volume": lambda: pv.ImageData(dimensions=(4, 4, 4)),
        "lines": lambda: pv.Spline(np.random.default_rng(0).random((9, 3)), 300),
        "points": lambda: pv.PolyData(np.random.default_rng(0).random((2000, 3))),
        "colours": ball,
    }[kind]()
    if kind == "colours":
        mesh["RGB"] = np.tile(np.array([[255, 0, 0]], dtype=np.uint8), (mesh.n_points, 1))
    mesh.save(file)
    scene = Scene({"object": {"file": str(file)}, "cage": {"divisions": [2, 2, 2]}})
    picture = Picture(scene, [0.0], (120, 90), ["fabric"])
    image = picture.draw(0.0).astype(int)
    picture.close()
    assert np.ptp(image[:, :, 0]) > 25
    red = (image[:, :, 0] - image[:, :, 1] > 100).mean()
    assert (red > 0.1) == (kind == "colours")


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    return int(caught.value.code or 0)


def test_render_and_export_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "ball.ply"
    ball().save(file)
    assert run("render", str(file), "-o", str(tmp_path / "a.png"), "--size", "90x60", "-q") == 0
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (90, 60)
    move = ["--set", "cage.divisions=[2,2,2]", "--set", "modal.fixed=-z", "--time", "0.1", "-q"]
    for name in ("b.vtu", "b.vtp", "b.stl", "b.ply"):
        assert run("export", str(file), "-o", str(tmp_path / name), *move) == 0, name
        assert pv.read(tmp_path / name).n_points == ball().n_points
    assert capsys.readouterr() == ("", "")


def refused(tmp_path: Path, content: bytes | None, ending: str = ".ply") -> str:
    file = tmp_path / f"bad{ending}"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        ObjectSource(file=file).update()
    text = str(caught.value)
    assert str(file) in text
    return text


@pytest.mark.nightly
@pytest.mark.parametrize("ending", [".ply", ".unknown"])
def test_file_that_is_no_mesh_is_refused(ending: str, tmp_path: Path) -> None:
    refused(tmp_path, b"not a mesh at all", ending)


def test_bad_files_are_refused_with_a_message(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path, None)
    assert "empty" in refused(tmp_path, b"")
    refused(tmp_path, b"<VTKFile>", ".vtu")
    with pytest.raises(InputError, match="no file is given"):
        ObjectSource().update()


REFUSED = r"a\.png.*(not a picture|too large|memory)"


@pytest.mark.parametrize(
    ("place", "put"),
    [(0, b"no picture"), (16, b"\0\0\xff\xff"), (33, b"\xff\0\0\0"), (43, b"\xff" * 8)],
    ids=["name", "size", "length", "data"],
)
def test_damaged_picture_is_refused(tmp_path: Path, place: int, put: bytes) -> None:
    """Found by fuzzing: lengths and sizes that a picture only claims were taken for memory."""
    Image.fromarray(np.eye(40, dtype=bool)).save(tmp_path / "whole.png")
    content = bytearray((tmp_path / "whole.png").read_bytes())
    content[place : place + len(put)] = put
    file = tmp_path / "a.png"
    file.write_bytes(content)
    tracemalloc.start()
    for read in (read_draft, read_picture):
        # Of a single chunk Pillow needs no length: but it would ask for 4 GiB to read that.
        whole = nullcontext() if place == 33 else pytest.raises(InputError, match=REFUSED)
        with whole:
            read(file)
    assert tracemalloc.get_traced_memory()[1] < 2**27
    tracemalloc.stop()


def test_c_libraries_print_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Found by fuzzing: libtiff wrote on standard error."""
    Image.fromarray(np.eye(8, dtype=bool)).save(
        tmp_path / "a.tif", compression="tiff_adobe_deflate"
    )
    content = (tmp_path / "a.tif").read_bytes()
    at = content.index(b"x\x9c")
    (tmp_path / "a.tif").write_bytes(content[:at] + b"zz" + content[at + 2 :])
    with pytest.raises(InputError, match="not a picture, or damaged"):
        read_draft(tmp_path / "a.tif")
    assert capfd.readouterr() == ("", "")


def test_points_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    mesh = ball()
    mesh.points[7] = np.nan
    mesh.save(tmp_path / "nan.vtp")
    with pytest.raises(GeometryError, match=r"1 of .* not finite.* the first is number 7"):
        ObjectSource(file=tmp_path / "nan.vtp").update()
    pv.PolyData().save(tmp_path / "none.vtp")
    with pytest.raises(GeometryError, match="no points"):
        ObjectSource(file=tmp_path / "none.vtp").update()


@pytest.mark.parametrize(
    "kind",
    ["obj", *(pytest.param(each, marks=pytest.mark.nightly) for each in ("ply", "vtk", "vtu"))],
)
def test_cells_with_invalid_points_are_refused(tmp_path: Path, kind: str) -> None:
    points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    texts = {
        "obj": "".join(f"v {p}\n" for p in points.splitlines()) + "f 1 2 9\n",
        "ply": "ply\nformat ascii 1.0\nelement vertex 4\n"
        + "".join(f"property float {axis}\n" for axis in "xyz")
        + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        + f"{points}3 0 1 9\n",
        "vtk": "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        f"POINTS 4 float\n{points}CELLS 1 5\n4 0 1 2 9\nCELL_TYPES 1\n10\n",
    }
    if kind == "vtu":
        file = tmp_path / "bad.vtu"
        pv.ImageData(dimensions=(3, 3, 3)).to_tetrahedra().save(file, binary=False)
        content = file.read_bytes().replace(b'NumberOfPoints="27"', b'NumberOfPoints="20"')
    else:
        content = texts[kind].encode()
    text = refused(tmp_path, content, f".{kind}")
    assert "a cell refers to point" in text or "f 1 2 9" in text


def test_repaired_file_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "late.vtp"
    source = ObjectSource(file=file)
    with pytest.raises(InputError, match="no such file"):
        source.update()
    ball().save(file)
    source.update()
    assert source.GetOutputDataObject(0).GetNumberOfPoints() == ball().n_points


def test_object_replaces_the_weave() -> None:
    with pytest.raises(InputError, match=r"\[object\].*\[weave\]"):
        Scene({"object": {"file": "a.ply"}, "weave": {}})


@pytest.mark.parametrize("scale", [0.01, 30.0])
def test_automatic_values_suit_objects_of_any_size(tmp_path: Path, scale: float) -> None:
    """The ant hung by one vertex, in a gravity to its side: it stands on its feet."""
    feet = [pv.Cone(center=(x, y, 0.5), direction=(0, 0, -1)) for x in (0, 3) for y in (0, 2)]
    body = pv.Box((-0.5, 3.5, 0.5, 1.5, 1.0, 2.0))
    body.append_polydata(*feet).save(tmp_path / "z.stl")
    moved = []
    for up, rotate in (("z", [0, 0, 0]), ("y", [-90, 0, 0])):
        scene = Scene(
            {
                "object": {"file": str(tmp_path / "z.stl"), "scale": scale, "rotate": rotate},
                "response": {},
            }
        )
        scene.update(time=0.0)
        assert scene.object.values_in_use == {"up": up}
        assert sorted(scene.cage.values_in_use["divisions"]) == [4, 6, 8]
        assert scene.modal.values_in_use["fixed"] == (f"-{up}",)
        down = scene.response.values_in_use["gravity"]["xyz".index(up)]
        assert down == -9.80665
        assert camera_of(scene) == ("lying" if up == "z" else "three-quarter")
        frequency = scene.modal.output.GetFieldData().GetArray("frequencies").GetValue(0)
        far = []
        for share in (0.1, 0.2, 0.3, 0.4, 0.5):
            scene.update(time=share / frequency)
            displacement = scene.deformed_cage.GetPointData().GetArray("displacement")
            far.append(displacement.GetMaxNorm() / (4.0 * scale))
        moved.append(max(far))
    # It is seen to move, and not to fly; the same whichever way it was modelled.
    assert 0.01 < moved[0] < 0.2
    np.testing.assert_allclose(moved[0], moved[1], rtol=0.1)
    # A given value goes before the default, also before the cloth's, and is kept in a record.
    scene = Scene({"object": {"file": str(tmp_path / "z.stl")}, "cage": {"divisions": [5, 5, 1]}})
    assert scene.cage.divisions == (5, 5, 1)
    assert scene_values(scene)["cage"] == {"divisions": [5, 5, 1]}
    assert Scene({"weave": {}, "cage": {}}).modal.fixed == ("+y",)
