"""Series of data are read by other programs with exact times, and are complete or absent."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

from spacemap_vtk import MotionReader
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.datasets.arrays import array_of, points_of
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 2, "picks": 2},
    "cage": {"divisions": [2, 2, 1]},
    "modal": {"modes": 3, "elements": "sheet", "youngs_modulus": 1000.0},
    "response": {},
    "surface": {"subdivisions": 1},
}

TIME_STEPS = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
#: Only the first is exact in single precision.
TIMES = [0.0, 0.02, 0.1 / 3]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(VALUES)


def write(scene: Scene, file: Path, what: str = "", times: Any = TIMES) -> str:
    return make_data_job(file, what, times=times).run(scene)


def content(folder: Path) -> dict[str, bytes]:
    files = (file for file in folder.rglob("*") if file.is_file())
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def test_a_collection_stores_a_surface_for_each_time(scene: Scene, tmp_path: Path) -> None:
    assert write(scene, tmp_path / "cloth.pvd").startswith("3 times, ")
    reader = pv.PVDReader(tmp_path / "cloth.pvd")
    assert reader.time_values == TIMES
    for number, time in enumerate(TIMES):
        reader.set_active_time_point(number)
        found = reader.read()[0]
        scene.update(time)
        np.testing.assert_array_equal(found.points, points_of(scene.polygons))
        assert found.field_data["TimeValue"] == time
    names = {f"cloth/cloth_000{number}.vtp" for number in range(3)}
    assert content(tmp_path).keys() == names | {"cloth.pvd"}


@pytest.mark.parametrize("name", ["cage.pvd", "cage_%04d.vtu"])
def test_a_written_cage_series_moves_another_scene(scene: Scene, tmp_path: Path, name: str) -> None:
    write(scene, tmp_path / name, "cage")
    file = tmp_path / name.replace("%04d", "*")
    motion = MotionReader(file=file)
    assert motion.time_steps([]) == TIMES
    for time in TIMES:
        found, expected = motion.update(time).output, scene.cage_stage.update(time).output
        np.testing.assert_allclose(
            *(array_of(data.GetPointData(), "displacement", "") for data in (found, expected)),
            atol=1e-15,
        )


def test_constant_data_are_stored_once(scene: Scene, tmp_path: Path) -> None:
    for what, name in (("surface", "cloth.vtkhdf"), ("cage", "cage.vtkhdf")):
        write(scene, tmp_path / name, what)
        reader = vtkHDFReader()
        reader.SetFileName(str(tmp_path / name))
        reader.UpdateInformation()
        assert reader.GetOutputInformation(0).Get(TIME_STEPS) == tuple(TIMES)
        for time in (*TIMES, TIMES[0]):
            reader.UpdateTimeStep(time)
            scene.update_stage(scene.cage_stage if what == "cage" else scene.stages[-1], time)
            found, expected = reader.GetOutputDataObject(0), scene.data(what)
            np.testing.assert_array_equal(points_of(found), points_of(expected))
            for number in range(found.GetNumberOfCells()):
                assert found.GetCellType(number) == expected.GetCellType(number)
                ends = (each.GetCell(number).GetPointIds() for each in (found, expected))
                first, second = (
                    [ids.GetId(k) for k in range(ids.GetNumberOfIds())] for ids in ends
                )
                assert first == second
            for side in ("GetPointData", "GetCellData"):
                here, there = getattr(found, side)(), getattr(expected, side)()
                assert here.GetNumberOfArrays() == there.GetNumberOfArrays() > 0
                for k in range(there.GetNumberOfArrays()):
                    array = there.GetArray(k)
                    np.testing.assert_array_equal(
                        vtk_to_numpy(here.GetArray(array.GetName())), vtk_to_numpy(array)
                    )
    motion = MotionReader(file=tmp_path / "cage.vtkhdf")
    assert motion.time_steps([]) == TIMES
    # Three times store moving data three times, cells and colours once.
    write(scene, tmp_path / "one.vtkhdf", times=TIMES[:1])
    large, small = ((tmp_path / f"{name}.vtkhdf").stat().st_size for name in ("cloth", "one"))
    moving = 2 * scene.polygons.GetNumberOfPoints() * 3 * 3 * 4
    assert 0 < large - small - moving < 5000


def test_any_format_can_be_numbered(scene: Scene, tmp_path: Path) -> None:
    for ending in (".stl", ".glb"):
        write(scene, tmp_path / f"s-%02d{ending}", times=TIMES[1:])
        found = [pv.read(tmp_path / f"s-0{number}{ending}") for number in (0, 1)]
        meshes = [each.combine() if ending == ".glb" else each for each in found]
        for time, mesh in zip(TIMES[1:], meshes, strict=True):
            scene.update(time)
            bounds = scene.polygons.GetBounds()
            np.testing.assert_allclose(mesh.bounds, bounds, rtol=0.0, atol=1e-9)
        assert abs(np.subtract(meshes[0].bounds, meshes[1].bounds)).max() > 1e-6


@pytest.mark.parametrize("name", ["cloth.pvd", "cloth_%d.vtp", "c.vtkhdf"])
def test_a_stopped_series_leaves_earlier_files(scene: Scene, tmp_path: Path, name: str) -> None:
    def stop(done: int, _of: int) -> None:
        if done == 2:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        make_data_job(tmp_path / name, times=TIMES).run(scene, stop)
    assert list(tmp_path.iterdir()) == []
    write(scene, tmp_path / name)
    before = content(tmp_path)
    assert len(before) == {"cloth.pvd": 4, "c.vtkhdf": 1}.get(name, 3)
    with pytest.raises(Cancelled):
        make_data_job(tmp_path / name, times=TIMES).run(scene, stop)
    assert content(tmp_path) == before


def test_a_shorter_collection_replaces_a_longer_one(scene: Scene, tmp_path: Path) -> None:
    write(scene, tmp_path / "cloth.pvd")
    write(scene, tmp_path / "cloth.pvd", times=[0.01])
    assert content(tmp_path).keys() == {"cloth.pvd", "cloth/cloth_0000.vtp"}
    with pytest.raises(InputError, match=r"cloth, which has the files of .*cloth\.pvd\. Choose"):
        make_data_job(tmp_path / "cloth.pvtp")
    (tmp_path / "cloth" / "mine").touch()
    with pytest.raises(InputError, match=r"which has other files\. Choose another name"):
        make_data_job(tmp_path / "cloth.pvd")


def test_a_still_scene_has_one_time(tmp_path: Path) -> None:
    still = Scene({"weave": {"ends": 2, "picks": 2}, "surface": {"subdivisions": 1}})
    assert write(still, tmp_path / "a.vtkhdf", times=()).startswith("1 time, ")
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.Update()
    still.update()
    np.testing.assert_array_equal(
        points_of(reader.GetOutputDataObject(0)), points_of(still.polygons)
    )
    with pytest.raises(InputError, match="does not move"):
        write(still, tmp_path / "b.pvd")
    assert [file.name for file in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_output_too_large_for_the_disk_is_refused_early(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0))
    with pytest.raises(SpacemapError, match=r"5 times need about .* more, .* has 0 MB free\. Free"):
        write(scene, tmp_path / "cloth.pvd", times=[0.0, 0.1, 0.2, 0.3, 0.4])
    assert list(tmp_path.iterdir()) == []
