"""The cloth that travels with a data set: whole, through files, and to the cage round it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

from spacemap_vtk import PatchTessellator, TetraCage, WeaveSource, connect
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.datasets.cloth_data import add_cloth, cloth_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

SCENES = Path(__file__).parents[1] / "scenes"


def same(found: Cloth | None, cloth: Cloth) -> None:
    """Both are built of the same numbers, to the last bit."""
    assert found is not None
    assert (found.size, found.density) == (cloth.size, cloth.density)
    made, expected = build_weave(found), build_weave(cloth)
    assert np.array_equal(made.points, expected.points)
    assert np.array_equal(made.patches, expected.patches)
    assert np.array_equal(made.weights, expected.weights)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "values",
    [
        {"pattern": "plain"},
        {"pattern": "twill 2/2", "warp_crimp": "9 %", "ends": 9},
        {"pattern": "satin 8/3 warp", "weft_diameter": "0.2 mm", "exact": True},
        {"pattern": "basket 2", "overhang": "1 mm", "caps": False},
        {"pattern": "rib 2/1", "warp_section": "racetrack", "warp_aspect": 1.3},
        {"pattern": ["110", "011", "101"], "axis": "spline", "weft_section": "elliptic"},
        {"ends": 1, "picks": 2},
        {"warp_diameter": ["0.2 mm", "0.3 mm"], "weft_spacing": ["0.5 mm", "0.7 mm", "0.6 mm"]},
        {"draft": SCENES / "32-shaft_twill.wif", "ends": 40, "picks": 24},
    ],
)
def test_output_of_a_weave_contains_its_cloth(values: dict[str, Any]) -> None:
    source = WeaveSource(**values)
    same(cloth_of(source.update().output), source.cloth)


def test_part_of_a_weave_contains_its_position() -> None:
    whole = WeaveSource(pattern="twill 2/2", ends=20, picks=18, weft_spacing=["0.5 mm", "0.6 mm"])
    part = WeaveSource(**whole.settings)
    whole.lend(part, YarnSelection(slice(4, 9), slice(10, 16)))
    found = cloth_of(part.update().output)
    assert found is not None
    for number, some in ((0, slice(4, 9)), (1, slice(10, 16))):
        wanted = whole.cloth.yarns[number].position[some]
        np.testing.assert_allclose(found.yarns[number].position, wanted, rtol=1e-12)
    # Its yarns have the numbers that they have in the whole, the ends first.
    yarn = vtk_to_numpy(part.output.GetCellData().GetArray("yarn"))
    assert np.unique(yarn).tolist() == [*range(4, 9), *range(30, 36)]


def test_single_yarn_has_no_spacing() -> None:
    lone = Threads(diameter=np.array([0.1]), spacing=np.empty(0))
    cloth = Cloth(drawdown=[[1]], warp=lone, weft=lone, overhang=0.5)
    data = vtkUnstructuredGrid()
    add_cloth(data, cloth)
    same(cloth_of(data), cloth)
    assert cloth_of(vtkUnstructuredGrid()) is None


def test_cloth_is_kept_in_files_cages_and_surfaces(tmp_path: Path) -> None:
    weave, cage = WeaveSource(pattern="twill 2/1"), TetraCage()
    connect(weave, cage)
    surface = connect(weave, PatchTessellator(subdivisions=1))
    for stage in (cage, surface):
        same(cloth_of(stage.update().output), weave.cloth)
    writer, reader = vtkXMLUnstructuredGridWriter(), vtkXMLUnstructuredGridReader()
    for it in (writer, reader):
        it.SetFileName(str(tmp_path / "weave.vtu"))
    writer.SetInputData(weave.output)
    assert writer.Write() == 1
    reader.Update()
    same(cloth_of(reader.GetOutput()), weave.cloth)


def test_drawdown_uses_one_byte_per_crossing() -> None:
    source = WeaveSource(ends=60, picks=40)
    field = source.update().output.GetFieldData()
    arrays = [field.GetArray(i) for i in range(field.GetNumberOfArrays())]
    cloth = [a for a in arrays if a.GetName().startswith("cloth_")]
    assert sum(a.GetDataSize() * a.GetDataTypeSize() for a in cloth) < 60 * 40 + 200


def test_missing_array_is_named() -> None:
    data = WeaveSource().update().output
    field = data.GetFieldData()
    add_array(field, "cloth_drawdown", np.zeros(5, np.uint8))
    with pytest.raises(InputError, match='"cloth_drawdown" has 5 values'):
        cloth_of(data)
    field.RemoveArray("cloth_drawdown")
    with pytest.raises(InputError, match="cloth_drawdown"):
        cloth_of(data)
