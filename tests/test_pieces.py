"""Pieces in one process: each stage makes a part of the whole with the bounds of the whole."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersGeneral import vtkPassArrays, vtkTransformFilter
from vtkmodules.vtkIOXML import vtkXMLPPolyDataReader, vtkXMLUnstructuredGridReader
from weaves import woven

from spacemap_vtk import BarycentricWarp, ObjectSource, TetraCage, WeaveSource, connect
from spacemap_vtk.datasets.arrays import points_of, tetrahedra_of
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.errors import GeometryError, InputError, SizeError
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.partition import cloth_bounds, select_piece
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.weave.cloth import Cloth

sys.path.insert(0, str(Path(__file__).parent / "mpi"))
from cases import connected, surface

MOVED = 0.05


@settings(max_examples=30, deadline=None)
@given(cloth=woven(), pieces=st.integers(1, 12))
def test_pieces_contain_each_yarn_once_and_in_place(cloth: Cloth, pieces: int) -> None:
    whole = build_weave(cloth)
    expected = np.stack([whole.points.min(axis=0), whole.points.max(axis=0)], axis=1).ravel()
    np.testing.assert_array_equal(cloth_bounds(cloth), expected)
    seen: list[int] = []
    for number in range(pieces):
        part = build_weave(cloth, select_piece(cloth, number, pieces))
        assert number > 0 or len(part.patches)
        seen += np.unique(part.yarn).tolist()
        for yarn in np.unique(part.yarn):
            mine, theirs = part.yarn == yarn, whole.yarn == yarn
            np.testing.assert_array_equal(
                part.points[part.patches[mine]], whole.points[whole.patches[theirs]]
            )
            assert part.family[mine][0] == whole.family[theirs][0]
    assert seen == list(range(sum(cloth.size)))  # each yarn once, in order


@pytest.mark.parametrize("pattern", ["plain", "satin 8/3"])
@pytest.mark.parametrize("pieces", [2, 3, 7])
def test_pieces_have_equal_work(pattern: str, pieces: int) -> None:
    weave = WeaveSource(pattern=pattern, ends=60, picks=40)
    counts = []
    for number in range(pieces):
        weave.update(piece=Piece(number, pieces))
        counts.append(weave.GetOutputDataObject(0).GetNumberOfCells())
    weave.update(piece=Piece())
    whole = weave.GetOutputDataObject(0).GetNumberOfCells()
    assert sum(counts) == whole
    yarn = 1.5 * whole / 100
    assert max(counts) - min(counts) <= 0.02 * whole / pieces + 2 * yarn


@pytest.mark.parametrize("pieces", [2, pytest.param(3, marks=pytest.mark.nightly), 11])
@pytest.mark.parametrize("spline", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_one_process_can_make_all_pieces_in_turn(pieces: int, spline: bool) -> None:
    case = {"source": {"ends": 4, "picks": 3, "axis": "spline" if spline else "arcs"}}
    serial, stages = connected(**case), connected(**case)
    serial[-1].update(MOVED)
    expected = surface(serial[-1].GetOutputDataObject(0))
    rows = np.argsort(expected["yarn"], kind="stable")
    found = []
    for number in range(pieces):
        stages[-1].update(MOVED, Piece(number, pieces))
        found.append(surface(stages[-1].GetOutputDataObject(0)))
        for cage in stages[1:4]:
            ghosts = cage.GetOutputDataObject(0).GetCellData().GetArray("vtkGhostType")
            assert set(vtk_to_numpy(ghosts)) == {int(number > 0)}
    for name, values in expected.items():
        joined = np.concatenate([piece[name] for piece in found if piece])
        order = np.argsort(
            np.concatenate([piece["yarn"] for piece in found if piece]), kind="stable"
        )
        np.testing.assert_allclose(joined[order], values[rows], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("weave", "cage"),
    [
        ({"weft_diameter": [2e-4, 3e-4]}, {"divisions": (60, 60, 4), "padding": 0.1}),
        ({"axis": "spline", "warp_spacing": 2e-3}, {"divisions": (90, 60, 2)}),
    ],
)
def test_a_carved_cage_encloses_yarns_of_other_pieces(
    weave: dict[str, Any], cage: dict[str, Any]
) -> None:
    grids = []
    for piece in (Piece(), Piece(3, 33)):
        source = WeaveSource(ends=18, picks=15, pattern="twill 2/2", **weave)
        stage = connect(source, TetraCage(method="carved", fill=False, **cage))
        grids.append(stage.update(piece=piece).output)
    whole, carved = grids
    np.testing.assert_array_equal(tetrahedra_of(carved), tetrahedra_of(whole))
    np.testing.assert_allclose(points_of(carved), points_of(whole), rtol=0, atol=1e-15)
    assert len(points_of(whole)) < 0.99 * np.prod(np.array(cage["divisions"]) + 1)


def test_a_single_piece_equals_the_whole() -> None:
    stages = connected({"ends": 3, "picks": 3})
    stages[-1].update(MOVED)
    for stage in stages:
        data = stage.GetOutputDataObject(0)
        assert not data.GetCellData().HasArray("vtkGhostType")
        assert not data.GetFieldData().HasArray("bounds_of_piece_and_whole")
    before = surface(stages[-1].GetOutputDataObject(0))
    stages[-1].update(MOVED, Piece(0, 1))
    after = surface(stages[-1].GetOutputDataObject(0))
    assert [stage.executions for stage in stages] == [1] * 6
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values)


def test_no_stage_runs_twice_for_a_piece() -> None:
    stages = connected({"ends": 4, "picks": 4})
    for stage in stages:
        stage.update(MOVED, Piece(1, 3))
    assert [stage.executions for stage in stages] == [1] * 6


def test_ghost_levels_do_not_change_yarns() -> None:
    # yarns share no points, so that none is a neighbour
    weave = WeaveSource(ends=4, picks=4)
    weave.update(piece=Piece(1, 2))
    points = weave.GetOutputDataObject(0).GetNumberOfPoints()
    weave.update(piece=Piece(1, 2, 2))
    assert weave.GetOutputDataObject(0).GetNumberOfPoints() == points


@pytest.mark.parametrize("kind", ["ball.vtp", "block.vtu"])
def test_pieces_of_an_object_add_up_to_it(kind: str, tmp_path: Path) -> None:
    mesh = pv.Sphere() if kind == "ball.vtp" else pv.ImageData(dimensions=(5, 4, 6))
    if kind == "block.vtu":
        mesh = mesh.cast_to_unstructured_grid()
    mesh.cell_data["part"] = np.arange(mesh.n_cells)
    mesh.save(tmp_path / kind)
    source = ObjectSource(file=tmp_path / kind, scale=0.01)
    parts, with_ghosts = [], []
    for number in range(3):
        source.update(piece=Piece(number, 3))
        parts += vtk_to_numpy(source.GetOutputDataObject(0).GetCellData().GetArray("part")).tolist()
        source.update(piece=Piece(number, 3, 1))
        data = source.GetOutputDataObject(0).GetCellData()
        owned = vtk_to_numpy(data.GetArray("vtkGhostType")) == 0
        assert not owned.all()
        with_ghosts += vtk_to_numpy(data.GetArray("part"))[owned].tolist()
    assert sorted(parts) == sorted(with_ghosts) == list(range(mesh.n_cells))


def test_a_warped_piece_is_not_reused_for_the_whole() -> None:
    weave, cage = WeaveSource(ends=4, picks=4), TetraCage()
    shift = vtkTransform()
    shift.Translate(1.0, 0.0, 0.0)
    mover = vtkTransformFilter()
    mover.SetTransform(shift)
    mover.SetInputConnection(weave.GetOutputPort())
    cage.SetInputConnection(mover.GetOutputPort())
    cage.update(piece=Piece(0, 1))
    with pytest.raises(GeometryError, match="only piece 1 of 3 of the input"):
        cage.update(piece=Piece(1, 3))


def test_a_carved_cage_requests_the_whole_object() -> None:
    weave, cage = WeaveSource(ends=4, picks=4), TetraCage(method="carved")
    shape = vtkPassArrays()  # its output does not state that it is a cloth
    shape.UseFieldTypesOn()
    shape.AddFieldType(vtkDataObject.FIELD_ASSOCIATION_NONE)
    shape.SetInputConnection(weave.GetOutputPort())
    cage.SetInputConnection(shape.GetOutputPort())
    with pytest.raises(InputError, match="has only piece 0 of 2"):
        cage.update(piece=Piece(0, 2))


def test_the_whole_cage_is_requested_from_a_reader(tmp_path: Path) -> None:
    scene = Scene({"weave": {"ends": 3, "picks": 3}, "response": {}})
    scene.update(MOVED)
    grid = pv.wrap(scene.deformed_cage).copy()
    grid.save(tmp_path / "cage.vtu")
    reader, weave, warp = vtkXMLUnstructuredGridReader(), WeaveSource(ends=3, picks=3), None
    reader.SetFileName(str(tmp_path / "cage.vtu"))
    warp = BarycentricWarp()
    warp.SetInputConnection(0, weave.GetOutputPort())
    warp.SetInputConnection(1, reader.GetOutputPort())
    points = []
    for number in range(4):
        warp.update(piece=Piece(number, 4))
        points.append(vtk_to_numpy(warp.GetOutputDataObject(0).GetPoints().GetData()).copy())
    found, expected = np.concatenate(points), pv.wrap(scene.patches).points
    order = [np.lexsort(np.round(p, 9).T) for p in (found, expected)]
    np.testing.assert_allclose(found[order[0]], expected[order[1]], atol=1e-9)


def test_a_large_cloth_can_be_made_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spacemap_vtk.memory.NEVER_REFUSED", 0)
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 10_000_000)
    weave = WeaveSource(ends=50, picks=50)
    with pytest.raises(SizeError):
        weave.update()
    with pytest.raises(SizeError, match="each of its 2 pieces"):
        weave.update(piece=Piece(0, 2))
    weave.update(piece=Piece(3, 10))
    assert weave.GetOutputDataObject(0).GetNumberOfCells()


@pytest.mark.parametrize("pieces", [pytest.param(50, marks=pytest.mark.nightly), 3])
def test_files_of_pieces_contain_the_whole_cloth(pieces: int, tmp_path: Path) -> None:
    values = {"weave": {"ends": 4, "picks": 3}, "surface": {"subdivisions": 2}, "response": {}}
    scene, file = Scene(values), tmp_path / "a.pvtp"
    scene.update(MOVED)
    whole = pv.wrap(scene.polygons).copy()
    make_data_job(file, times=[MOVED], pieces=pieces).run(scene)
    scene.update(MOVED)  # no more in pieces
    assert scene.polygons.GetNumberOfCells() == whole.n_cells
    reader = vtkXMLPPolyDataReader()
    reader.SetFileName(str(file))
    reader.Update()
    found = pv.wrap(reader.GetOutput())
    # Yarn by yarn, as the whole has them, with all that it has.
    assert found.point_data.keys() == whole.point_data.keys()
    assert found.cell_data.keys() == whole.cell_data.keys()
    order = [np.argsort(mesh.cell_data["yarn"], kind="stable") for mesh in (found, whole)]
    for name in ("yarn", "family", "color"):
        here, there = (m.cell_data[name][o] for m, o in zip((found, whole), order, strict=True))
        np.testing.assert_array_equal(here, there)
    corners = [m.regular_faces[o] for m, o in zip((found, whole), order, strict=True)]
    for name, atol in (("displacement", 1e-9), ("Normals", 1e-5), ("Points", 1e-9)):
        here, there = (
            (m.points if name == "Points" else m.point_data[name])[c]
            for m, c in zip((found, whole), corners, strict=True)
        )
        np.testing.assert_allclose(here, there, rtol=0, atol=atol)
    assert len(list((tmp_path / "a").iterdir())) == min(pieces, 7)
    for wrong, message in ((20_000, "between 1 and 10000"), (-1, "between 1 and 10000")):
        with pytest.raises(InputError, match=message):
            make_data_job(file, pieces=wrong)
    with pytest.raises(InputError, match="cannot be written in pieces"):
        make_data_job(tmp_path / "a.vtp", pieces=2)
