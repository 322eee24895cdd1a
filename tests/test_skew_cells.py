"""Unit cells that are skew or pressed: against cells whose yarns were deformed before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import UnitCell, WeaveSource
from spacemap_vtk.cli.options import open_scene
from spacemap_vtk.datasets.arrays import add_array, array_of, points_of, shallow_copy, to_points
from spacemap_vtk.datasets.cloth_data import CORNER, REPEAT
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.unit_cell import make_unit_cell, shear_gradient
from spacemap_vtk.io.formats.unit_cell import write_vti, write_vtu
from spacemap_vtk.scenes.composite import compute_constants, fibre_share, local_fields
from spacemap_vtk.scenes.composite_map import tabulate_constants
from spacemap_vtk.unit_cell.homogenise import homogenise, homogenise_plate
from spacemap_vtk.unit_cell.mixtures import Constituent, turn_stiffness
from spacemap_vtk.unit_cell.phases import assign_materials
from spacemap_vtk.unit_cell.rasterise import Voxels
from spacemap_vtk.unit_cell.voxel_elasticity import symmetric


@pytest.fixture(scope="module")
def weave() -> vtkUnstructuredGrid:
    """Patches of a plain weave that is half as dense along the warp, in m."""
    source = WeaveSource(warp_spacing=5e-4, weft_spacing=8e-4)
    return source.around_repeat().update().output


def deform(patches: vtkUnstructuredGrid, gradient: np.ndarray, repeat: Any = None) -> Any:
    """Return deformed patches; the repeat follows, or is given as multiples of the former one."""
    field = patches.GetFieldData()
    own = array_of(field, REPEAT, "a weave").reshape(2, 3)
    own = own if repeat is None else np.array(repeat) @ own
    made = shallow_copy(patches)
    made.SetPoints(to_points(points_of(patches) @ gradient.T))
    add_array(made.GetFieldData(), REPEAT, (own @ gradient.T).ravel())
    add_array(made.GetFieldData(), CORNER, gradient @ array_of(field, CORNER, "a weave").ravel())
    return made


def stiffness_of(stage: UnitCell, patches: vtkUnstructuredGrid) -> np.ndarray:
    voxels, spacing = make_unit_cell(stage, patches, stage.voxels)
    return homogenise(stage.assign(voxels, spacing), spacing)[0].stiffness


def test_pure_shear_at_constant_thickness_is_that_of_a_sheared_weave(
    weave: vtkUnstructuredGrid,
) -> None:
    angle = np.radians(30.0)
    voxels, spacing = make_unit_cell(UnitCell(), weave, 16)
    height = spacing[2] * len(voxels.fraction)
    # The patches are sheared, so that the repeat is skew; the packing of yarns is given.
    lean = shear_gradient(angle, 1.0)
    packing = 0.6 / np.cos(angle)
    direct = stiffness_of(UnitCell(voxels=16, packing=packing), deform(weave, lean))
    mould = UnitCell(voxels=16, packing=0.6, thickness=height, shear=30.0)
    found = stiffness_of(mould, weave)
    np.testing.assert_allclose(found, direct, rtol=0, atol=1e-5 * direct.max())
    # The table of a map, at a node and between nodes, with the share of fibre.
    shear = np.array([0.0, 12.0, 24.0])
    table = tabulate_constants(mould, weave, shear, np.ones(3))
    share = fibre_share(voxels, 0.6)
    np.testing.assert_allclose(table.fibre_share, share / np.cos(np.radians(shear)), rtol=1e-12)
    np.testing.assert_allclose(table.thickness, height, rtol=1e-12)
    assert table.angles.tolist() == [0.0, 8.0, 16.0, 24.0]
    modulus = 1 / np.linalg.inv(table.stiffness)[:, [0, 1], [0, 1]]
    for number, tolerance in ((1, 1e-3), (2, 1e-4)):
        angle = np.radians(shear[number])
        cell = UnitCell(voxels=16, packing=0.6 / np.cos(angle))
        compliance = np.linalg.inv(stiffness_of(cell, deform(weave, shear_gradient(angle, 1.0))))
        np.testing.assert_allclose(modulus[number], 1 / np.diag(compliance)[:2], rtol=tolerance)
    # Without a mould the share stays.
    free = tabulate_constants(UnitCell(voxels=16, packing=0.6), weave, shear[:2], np.ones(2))
    np.testing.assert_allclose(free.fibre_share, share, rtol=1e-12)


def test_a_pressed_cell_has_less_matrix(weave: vtkUnstructuredGrid) -> None:
    # Where the area grows at constant thickness, the share falls.
    voxels, spacing = make_unit_cell(UnitCell(), weave, 16)
    height = spacing[2] * len(voxels.fraction)
    cell = UnitCell(voxels=16, packing=0.5, thickness=0.9 * height)
    area = np.array([0.98, 1.0, 1.02])
    table = tabulate_constants(cell, weave, np.zeros(3), area)
    np.testing.assert_allclose(table.fibre_share, fibre_share(voxels, 0.5) / 0.9 / area, rtol=1e-12)
    np.testing.assert_allclose(table.stiffness[1], stiffness_of(cell, weave), rtol=2e-3, atol=1e7)
    with pytest.raises(InputError, match="fibres have no room"):
        stiffness_of(UnitCell(voxels=16, thickness=0.6 * height), weave)


@pytest.mark.parametrize(
    ("count", "tolerance"), [(32, 8e-3), pytest.param(64, 2e-3, marks=pytest.mark.nightly)]
)
def test_a_skew_repeat_of_the_same_weave_has_the_same_constants(
    weave: vtkUnstructuredGrid, count: int, tolerance: float
) -> None:
    # The smallest repeat of a plain weave has half the yarns, and a side along a diagonal.
    exact = stiffness_of(UnitCell(voxels=count), weave)
    for repeat in (((1, 0), (0.5, 0.5)), ((0.5, 0.5), (1, 0))):
        skew = deform(weave, np.eye(3), repeat)
        found = stiffness_of(UnitCell(voxels=5 * count // 8), skew)
        np.testing.assert_allclose(found, exact, rtol=0, atol=tolerance * exact.max())
        voxels, spacing = make_unit_cell(UnitCell(), skew, 32)
        assert voxels.base is not None
        volume = np.linalg.det(voxels.base) * spacing.prod() * voxels.fraction.sum()
        whole, size = make_unit_cell(UnitCell(), weave, 32)
        assert volume == pytest.approx(0.5 * size.prod() * whole.fraction.sum(), rel=2e-3)


def test_a_sheared_plate_of_layers_bends_as_laminate_theory_says() -> None:
    # Fibres along the warp over fibres along the weft; the warp leans by 30°.
    fibre = Constituent(100e9, 10e9, 5e9, 0.3, 0.4)
    depth, height = 32, 2e-3
    number = np.zeros((depth, 4, 4), np.int32)
    axis = np.zeros((depth, 4, 4, 3))
    axis[: depth // 2, ..., 0] = axis[depth // 2 :, ..., 1] = 1.0
    voxels = Voxels(np.ones(number.shape), number, axis, np.ones(number.shape), 0.0)
    spacing = np.array([1e-3, 1e-3, height / depth])
    angle = np.radians(30.0)
    gradient = shear_gradient(angle)
    made = assign_materials(voxels, spacing, lambda _: fibre, fibre, np.float64, gradient)
    plate = homogenise_plate(made, spacing, tolerance=1e-7)
    ways = np.array([[1.0, 0.0, 0.0], [np.sin(angle), np.cos(angle), 0.0]])
    plane = []
    for full in symmetric(turn_stiffness(fibre, ways).T):
        # Plane stress.
        compliance = np.linalg.inv(full)[np.ix_([0, 1, 5], [0, 1, 5])]
        plane.append(np.linalg.inv(compliance))
    height /= np.cos(angle)
    exact = (
        (plane[0] + plane[1]) * height / 2,
        (plane[1] - plane[0]) * height**2 / 8,
        (plane[0] + plane[1]) * height**3 / 24,
    )
    found = plate.membrane, plate.coupling, plate.bending
    for one, other in zip(found, exact, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-3 * abs(other).max())


def test_fields_of_a_sheared_cell_have_the_mean_strain_and_stress(
    weave: vtkUnstructuredGrid,
) -> None:
    stage = UnitCell(voxels=16, shear=30.0)
    voxels, spacing = make_unit_cell(stage, weave, 16)
    phases = stage.assign(voxels, spacing)
    fields = local_fields(phases, spacing)
    exact = homogenise(phases, spacing)[0].stiffness
    for column, name in enumerate(("xx", "yy", "zz", "yz", "xz", "xy")):
        np.testing.assert_allclose(
            fields[f"strain_{name}"].mean(axis=0), np.eye(6)[column], atol=1e-5
        )
        stress = fields[f"stress_{name}"].mean(axis=0)
        np.testing.assert_allclose(stress, exact[:, column], rtol=0, atol=2e-3 * exact.max())


def test_files_of_a_sheared_cell_lean(tmp_path: Path, weave: vtkUnstructuredGrid) -> None:
    stage = UnitCell(voxels=8, shear=30.0)
    model = stage.model("sheared", weave)
    size = model.spacing * model.voxels.fraction.shape[::-1]
    lean = shear_gradient(np.radians(30.0))
    corner = lean @ size
    write_vtu(tmp_path / "cell.vtu", model)
    write_vti(tmp_path / "cell.vti", model)
    for name in ("cell.vtu", "cell.vti"):
        cell = pv.read(tmp_path / name)
        np.testing.assert_allclose(cell.points.max(axis=0), corner, rtol=1e-6)
        inside = model.voxels.fraction.ravel() > 0.5
        direction = cell.cell_data["direction"][inside]
        own = model.voxels.direction.reshape(-1, 3)[inside] @ lean.T
        own /= np.linalg.norm(own, axis=1, keepdims=True)
        np.testing.assert_allclose(direction, own, atol=1e-6)


def test_constants_of_a_mould_state_its_size_and_share() -> None:
    words = ["unit_cell.voxels=16", "unit_cell.shear=20 deg", "unit_cell.thickness=0.5mm"]
    found = compute_constants(open_scene("plain_weave", words))
    free = compute_constants(open_scene("plain_weave", words[:1]))
    assert found.size[2] == pytest.approx(5e-4, rel=1e-12)
    np.testing.assert_allclose(found.size[:2], free.size[:2], rtol=1e-12)
    grown = np.cos(np.radians(20.0)) * found.size[2] / free.size[2]
    assert found.fibre_share == pytest.approx(free.fibre_share / grown, rel=1e-12)
    # The mean density is that of the shares.
    glass, epoxy = 2540.0, 1300.0
    assert found.constants.density == pytest.approx(
        epoxy + found.fibre_share * (glass - epoxy), rel=2e-3
    )
