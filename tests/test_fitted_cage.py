"""ModalSolver with sliders, rigid places, springs, masses, factors: parameters, arrays, errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import ModalResponse, ModalSolver, TetraCage, WeaveSource
from spacemap_vtk.datasets.modal_model import model_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.paraview.property_xml import property_of
from spacemap_vtk.scenes.scene import Scene

FITTED: dict[str, Any] = {
    "fixed": "-x:(0, 1, 1) +y",
    "rigid": "-y",
    "springs": ["-z:z 1e4 N/m3", "sphere(0, 0, 0, 0.5 mm) 0.2 N/m"],
    "masses": "-y 5 mg",
    "stiffness_factors": "wet",
    "density_factors": "wet",
}


def wet_cage(wet: np.ndarray | None = None, order: int = 1) -> vtkUnstructuredGrid:
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(3, 3, 1), order=order)
    cage.SetInputConnection(weave.GetOutputPort())
    cage.update()
    grid = vtkUnstructuredGrid()
    grid.DeepCopy(cage.GetOutputDataObject(0))
    wet = 1.0 + np.arange(grid.GetNumberOfCells()) % 3 if wet is None else wet
    array = numpy_to_vtk(wet, deep=True)
    array.SetName("wet")
    grid.GetCellData().AddArray(array)
    return grid


def solve_grid(grid: vtkUnstructuredGrid, **settings: Any) -> ModalSolver:
    solver = ModalSolver(modes=5, **settings)
    solver.SetInputDataObject(0, grid)
    solver.update()
    return solver


@pytest.mark.parametrize("elements", ["tetrahedra", "sheet"])
def test_a_response_finds_the_model_of_its_solver(elements: str) -> None:
    solver = solve_grid(wet_cage(), elements=elements, **FITTED)
    output = solver.GetOutputDataObject(0)
    made, found = solver._model, model_of(output)
    assert made is not None
    assert found.pencil is made.pencil
    names = [
        name for name in solver.arrays if name.startswith(("rigid", "spring", "point", "stif"))
    ]
    assert len(names) == 4
    tables = output.GetPointData(), output.GetCellData()
    for name, array in solver.arrays.items():
        if array.association != "field":
            assert tables[array.association == "cell"].HasArray(name), name
    points = vtk_to_numpy(output.GetPoints().GetData())
    body = vtk_to_numpy(output.GetPointData().GetArray("rigid_body"))
    np.testing.assert_array_equal(body, points[:, 1] == points[:, 1].min())
    assert vtk_to_numpy(output.GetPointData().GetArray("point_mass")).sum() == pytest.approx(5e-6)
    fixed = vtk_to_numpy(output.GetPointData().GetArray("fixed"))
    held = (points[:, 1] == points[:, 1].max()) | (points[:, 0] == points[:, 0].min())
    np.testing.assert_array_equal(fixed, held)
    # Statics by the model, and where a damped response ends.
    response = ModalResponse(alpha=200.0, gravity=(0, 0, -9.81), stress=True)
    response.SetInputConnection(solver.GetOutputPort())
    response.update(30.0)
    moved = vtk_to_numpy(response.GetOutputDataObject(0).GetPointData().GetArray("displacement"))
    weight = np.zeros_like(moved)
    weight[:, 2] = -9.81 * made.nodal_mass
    static = made.statics(weight.ravel())[0].reshape(-1, 3)
    np.testing.assert_allclose(moved, static, atol=1e-6 * abs(static).max())


@pytest.mark.parametrize("elements", ["tetrahedra", "sheet"])
def test_moving_base_carries_a_cage_on_springs(elements: str) -> None:
    solver = solve_grid(wet_cage(), elements=elements, fixed="", springs="-z 5 N/m +y:z 1 N/m")
    load = {"base_displacement": [0, "1 mm", "2 mm"], "time": "ramp", "rise": "1 s"}
    response = ModalResponse(alpha=100.0, gravity=(0, 0, 0), loads=[load])
    response.SetInputConnection(solver.GetOutputPort())
    response.update(60.0)
    moved = vtk_to_numpy(response.GetOutputDataObject(0).GetPointData().GetArray("displacement"))
    np.testing.assert_allclose(moved, [[0, 1e-3, 2e-3]] * len(moved), atol=1e-8)
    solver.springs = ""
    with pytest.raises(InputError, match="base cannot move because nothing is fixed"):
        response.update(1.0)


def test_stress_uses_the_material_of_each_cell() -> None:
    solver = solve_grid(wet_cage(), elements="tetrahedra", stiffness_factors="wet")
    response = ModalResponse(initial="equilibrium")
    response.SetInputConnection(solver.GetOutputPort())
    response.update(0.0)
    cells = response.GetOutputDataObject(0).GetCellData()
    strain, stress = (vtk_to_numpy(cells.GetArray(name)) for name in ("strain", "stress"))
    wet = vtk_to_numpy(cells.GetArray("wet"))
    shear = solver.youngs_modulus / (2 * (1 + solver.poissons_ratio))
    np.testing.assert_allclose(stress[:, 3], 2 * shear * wet * strain[:, 3], rtol=1e-9)


def test_arrays_of_an_earlier_solver_are_removed() -> None:
    first = solve_grid(wet_cage(), **FITTED)
    second = solve_grid(first.GetOutputDataObject(0), fixed="+y")
    data = second.GetOutputDataObject(0).GetPointData()
    for name in ("fixed_directions", "rigid_body", "spring_stiffness", "point_mass"):
        assert not data.HasArray(name)
    assert model_of(second.GetOutputDataObject(0)).fittings.given == {}


@pytest.mark.parametrize("key", ["stiffness_factors", "density_factors"])
@pytest.mark.parametrize(
    ("wet", "message"),
    [
        (
            np.where(np.arange(45) == 7, -2.0, 1.0),
            'the cell array "wet" has the value -2 in cell 7; allowed',
        ),
        (
            np.where(np.arange(45) == 3, np.nan, 1.0),
            'the cell array "wet" has the value nan in cell 3',
        ),
        (np.zeros(45), 'the cell array "wet" has the value 0 in cell 0'),
        (np.ones((45, 3)), 'the cell array "wet" has 3 components.*one number for each cell'),
    ],
)
def test_factors_must_be_above_zero(key: str, wet: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        solve_grid(wet_cage(wet), **{key: "wet"})
    assert caught.value.key == key


def test_missing_array_is_named() -> None:
    with pytest.raises(InputError, match=r'stiffness_factors.*"dry".*"wet"'):
        solve_grid(wet_cage(), stiffness_factors="dry")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rigid": "-x -y"}, r'modal\.rigid.*"-x" and "-y" share a vertex'),
        ({"rigid": "sphere(9, 9, 9, 1)"}, r"modal\.rigid.*rigid place .* contains no vertex"),
        ({"springs": "sphere(9, 9, 9, 1) 1 N/m"}, r"modal\.springs.*contains no vertex"),
        ({"masses": "mask(no) 1 g"}, r'modal\.masses.*the place mask\(no\) needs an array "no"'),
        (
            {"rigid": "-y", "gravity": (0, 0, -9.81)},
            r"modal\.rigid: a cage with a rigid place cannot hang",
        ),
    ],
)
def test_errors_name_the_parameter(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve_grid(wet_cage(), **settings)


@pytest.mark.parametrize("key", ["fixed", "rigid", "springs", "masses"])
def test_places_round_trip_as_text(key: str) -> None:
    parameter = ModalSolver.parameter(key)
    value = parameter.check(FITTED[key])
    assert parameter.check(parameter.format(value).strip('"')) == value
    there = property_of(parameter)
    assert parameter.check(there.read(there.write(value))) == value
    assert parameter.check(there.read(there.write(()))) == ()


def test_scene_file_can_contain_fittings(tmp_path: Any) -> None:
    file = tmp_path / "batten.toml"
    file.write_text("""
        [weave]
        ends = 3
        picks = 3
        [modal]
        rigid = "-y"
        springs = ["-z:z 1 N/cm3", "+x:(1, 1, 0) 3 mN/m"]
        masses = "-y 5 mg"
        """)
    scene = Scene.read(file)
    scene.set('modal.masses="-y 7 mg sphere(0, 0, 0, 1 mm) 1 g"')
    solver = scene.stage("solver")
    assert solver.springs == ("+x:(1, 1, 0) 0.003 N/m", "-z:z 1000000 N/m3")
    assert solver.masses == ("-y 7 mg", "sphere(0, 0, 0, 0.001) 1 g")
    scene.update(0.01)
