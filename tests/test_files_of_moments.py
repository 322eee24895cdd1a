"""Files of one moment for other programs (.obj, .ply, .csv), read back by VTK, meshio and numpy."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonCore import reference

from spacemap_vtk.draw.actors.surface_actor import RAMP
from spacemap_vtk.errors import InputError
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.scenes.scene import Scene

TIME = 0.1


def exported(file: Path, color: str = "own") -> pv.PolyData:
    """Write a banner that swings as it is after a while; return its surface."""
    scene = Scene.read("plain_weave")
    scene.set("surface.subdivisions=3")
    scene.set(f"view.color={color}")
    make_data_job(file, times=[TIME]).run(scene)
    scene.update(TIME)
    return pv.wrap(scene.polygons).copy()


def areas(mesh: pv.PolyData, of: np.ndarray) -> list[float]:
    sizes = mesh.triangulate().compute_cell_sizes(length=False, volume=False)["Area"]
    return [float(sizes[of == kind].sum()) for kind in range(2)]


@pytest.mark.parametrize("color", ["own", pytest.param("family", marks=pytest.mark.nightly)])
def test_obj_and_ply_have_normals_groups_and_colours(tmp_path: Path, color: str) -> None:
    surface = exported(tmp_path / "cloth.obj", color).triangulate()
    exported(tmp_path / "cloth.ply", color)
    found = pv.read(tmp_path / "cloth.obj")
    np.testing.assert_allclose(
        areas(found, found["GroupIds"].astype(int)), areas(surface, surface["family"]), rtol=1e-5
    )
    np.testing.assert_allclose(found.bounds, surface.bounds, atol=1e-9)
    reported = (tmp_path / "cloth.mtl").read_text().split()
    assert [reported[i + 1].split("_")[0] for i, w in enumerate(reported) if w == "newmtl"] == [
        "warp",
        "weft",
    ]
    painted = pv.read(tmp_path / "cloth.ply")
    assert painted.n_points == found.n_points
    assert painted.n_cells == found.n_cells
    np.testing.assert_allclose(painted.points, found.points, atol=1e-9)
    for mesh in (painted, found):  # outwards, as the corners go round
        corners = mesh.regular_faces
        across = mesh.compute_normals(
            cell_normals=True, point_normals=False, consistent_normals=False
        )["Normals"]
        given = np.asarray(mesh.GetPointData().GetNormals())[corners].sum(axis=1)
        assert (np.einsum("nk,nk->n", across, given) > 0).mean() > 0.999
    kinds, number = np.unique(np.asarray(painted["RGB"]), axis=0, return_inverse=True)
    places = [i for i, word in enumerate(reported) if word == "Kd"]
    written = np.array([[float(w) for w in reported[i + 1 : i + 4]] for i in places])
    np.testing.assert_array_equal(kinds, np.unique(np.round(255 * written), axis=0))
    if color == "family":
        assert kinds.tolist() == [[0x2F, 0x7F, 0xB0], [0xE2, 0xA0, 0x3F]]
    of_cells = number.reshape(-1)[painted.regular_faces[:, 0]]
    assert sorted(areas(painted, of_cells)) == pytest.approx(
        sorted(areas(surface, surface["family"])), rel=1e-5
    )


def test_colours_of_a_scale_leave_with_the_surface(tmp_path: Path) -> None:
    exported(tmp_path / "cloth.ply", "displacement")
    exported(tmp_path / "cloth.obj", "displacement")
    surface = exported(tmp_path / "cloth.vtp", "displacement")
    painted, values = pv.read(tmp_path / "cloth.ply"), surface["displacement"]
    lengths = np.linalg.norm(values, axis=1)
    where = cKDTree(surface.points).query(painted.points)[1]
    scale = re.search(
        rb"colours: Displacement, 0 to (.*) m\n", (tmp_path / "cloth.ply").read_bytes()
    )
    assert scale is not None
    high = float(scale[1])
    assert lengths.max() <= high < 2 * lengths.max()
    # The ramp's stops, evenly spaced; a colour is that of its number within a step of 256.
    stops = np.array([list(bytes.fromhex(color[1:])) for color in RAMP], float)
    at = lengths[where] / high * (len(stops) - 1)
    mixed = [np.interp(at, np.arange(len(stops)), channel) for channel in stops.T]
    steepest = np.abs(np.diff(stops, axis=0)).max() * (len(stops) - 1) / 256
    np.testing.assert_allclose(painted["RGB"], np.transpose(mixed), atol=steepest + 1)
    assert len(np.unique(painted["RGB"], axis=0)) > 50
    lines = (tmp_path / "cloth.obj").read_text().splitlines()
    rows = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
    np.testing.assert_allclose(rows[:, 3:] * 255, painted["RGB"], atol=1e-3)
    # Of a series all have one scale.
    scene = Scene.read("plain_weave")
    scene.set("surface.subdivisions=1")
    scene.set("view.color=displacement")
    make_data_job(tmp_path / "s%d.ply", "painted", times=[0.01, TIME]).run(scene)
    heads = [(tmp_path / f"s{k}.ply").read_bytes()[:9000] for k in (0, 1)]
    assert len({re.search(rb"colours: .*", head)[0] for head in heads}) == 1  # type: ignore[index]


def test_csv_has_the_middles_of_the_yarns(tmp_path: Path) -> None:
    surface = exported(tmp_path / "yarns.csv")
    table = np.genfromtxt(tmp_path / "yarns.csv", delimiter=",", skip_header=1)
    head = (tmp_path / "yarns.csv").read_text().partition("\n")[0]
    assert head == "yarn,point,x [m],y [m],z [m],width [m],red,green,blue"
    assert len(np.unique(table[:, 0])) == 14
    # The curve goes through the first of three: half a yarn away from its surface.
    on = table[(table[:, 1] % 3 == 0) & (table[:, 1] > 0)]
    distance = cKDTree(surface.points).query(on[:, 2:5])[0]
    np.testing.assert_allclose(distance[5:-5].mean(), on[:, 5].mean() / 2, rtol=0.05)
    pv.Sphere().save(tmp_path / "sphere.stl")
    scene = Scene({"object": {"file": str(tmp_path / "sphere.stl")}})
    with pytest.raises(InputError, match="no yarns"):
        make_data_job(tmp_path / "a.csv").run(scene)


@pytest.mark.parametrize("exact", ["false", "true"])
def test_the_documented_reader_of_patches_finds_what_vtk_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exact: str
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = Scene.read("plain_weave")
    scene.set(f"weave.exact={exact}")
    make_data_job(Path("cloth.vtu"), times=[TIME]).run(scene)
    text = (Path(__file__).parents[1] / "docs" / "reference" / "files.md").read_text(
        encoding="utf-8"
    )
    names: dict[str, Any] = {}
    exec(text.rpartition("```python\n")[2].partition("```")[0], names)
    cells, where = pv.read("cloth.vtu"), [names["u"], names["v"], 0.0]
    assert len(names["places"]) == cells.n_cells
    for number in range(0, cells.n_cells, 50):
        found, weights = [0.0] * 3, [0.0] * 16
        cells.GetCell(number).EvaluateLocation(reference(0), where, found, weights)
        np.testing.assert_allclose(names["places"][number], found, rtol=0, atol=1e-12)
