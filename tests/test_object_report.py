"""What ``info`` tells of objects and their cages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.cage.split import count_parts
from spacemap_vtk.cli.main import main
from spacemap_vtk.scenes.object_report import report_object
from spacemap_vtk.scenes.scene import Scene


def info(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as ending:
        main(["info", *words])
    assert ending.value.code == 0
    return capsys.readouterr().out


def test_figures_of_an_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cup = pv.Sphere(radius=0.5, theta_resolution=12, phi_resolution=12).clip("z")
    cup.cell_data["part"] = np.arange(cup.n_cells, dtype=np.int32)
    file = tmp_path / "cup.vtp"
    cup.save(file)
    found = json.loads(info(capsys, str(file), "--json"))
    assert (found["points"], found["cells"]) == (cup.n_points, cup.n_cells)
    assert sum(found["cell_types"].values()) == cup.n_cells
    np.testing.assert_allclose(np.ravel(found["bounds"]), np.reshape(cup.bounds, (3, 2)).T.ravel())
    assert found["open_edges"] == cup.n_open_edges > 0
    assert found["cage"] is None
    assert found["picture"] is None
    roles = {
        array["name"]: (array["on"], array["components"], array["role"])
        for array in found["arrays"]
    }
    assert roles["Normals"] == ("points", 3, "Normals")
    assert roles["part"][:2] == ("cells", 1)
    text = info(capsys, str(file))
    assert f"{cup.n_open_edges} open and 0 branching edges" in text
    assert '"part"' in text


def test_object_with_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pv.Plane().save(tmp_path / "plane.vtp")
    Image.new("RGB", (30, 20)).save(tmp_path / "a.png")
    words = [str(tmp_path / "plane.vtp"), "--set", f"object.texture={tmp_path / 'a.png'}"]
    assert json.loads(info(capsys, *words, "--json"))["picture"] == [30, 20]
    assert "30 x 20 pixels" in info(capsys, *words)


def test_cage_with_points_outside(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pv.Sphere(radius=0.5).save(tmp_path / "ball.ply")
    vertices, cells = build_lattice((-0.4, 0.4, -0.6, 0.6, -0.6, 0.6), (2, 2, 2))
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, vertices)
    grid.save(tmp_path / "cage.vtu")
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'object.file = "ball.ply"\n[cage]\nmethod = "file"\nfile = "cage.vtu"\n[warp]\n'
    )
    cage = json.loads(info(capsys, str(scene), "--json"))["cage"]
    x = pv.Sphere(radius=0.5).points[:, 0]
    assert cage["points_outside"] == np.count_nonzero(np.abs(x) > 0.4 + 1e-6)
    assert cage["largest_distance"] == pytest.approx(x.max() - 0.4, abs=1e-6)
    assert cage["volume"] == pytest.approx(0.8 * 1.2 * 1.2)
    assert cage["pieces"] == [40]
    share = cage["points_outside"] / len(x)
    reported = f"{cage['points_outside']} ({100 * share:.3g} %), by up to 99.267 mm"
    assert reported in info(capsys, str(scene))


def test_report_does_not_solve_modes(tmp_path: Path) -> None:
    pv.Sphere().save(tmp_path / "ball.ply")
    scene = Scene({"object": {"file": str(tmp_path / "ball.ply")}, "cage": {}})
    assert report_object(scene)["cage"]["tetrahedra"] == 5 * 8**3
    assert scene.cage.executions == 1
    assert scene.modal.executions == scene.response.executions == 0


def test_pieces_are_connected_through_faces() -> None:
    cells = build_lattice((0, 1, 0, 1, 0, 1), (3, 1, 1))[1]
    assert count_parts(cells)[0] == [15]
    assert count_parts(np.concatenate((cells[:5], cells[10:])))[0] == [5, 5]
    edge = np.array([[0, 1, 2, 3], [2, 3, 4, 5]])
    assert count_parts(edge)[0] == [1, 1]
