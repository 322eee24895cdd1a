"""Unit cells for solvers on grids: other readers find the stiffness of each voxel again."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation
from unit_cells import phases_without_mixing

from spacemap_vtk.cli.main import main
from spacemap_vtk.cli.options import open_scene
from spacemap_vtk.io.formats.unit_cell import STRAIN
from spacemap_vtk.scenes.composite import unit_cell_model
from spacemap_vtk.unit_cell.homogenise import homogenise
from spacemap_vtk.unit_cell.mixtures import UPPER
from spacemap_vtk.unit_cell.phases import DIRECTION_STEP, Phases, UnitCellModel
from spacemap_vtk.unit_cell.voxel_elasticity import symmetric

yaml = pytest.importorskip("yaml")  # comes with myst-parser

#: A fibre whose shear moduli differ, so that axes and moduli may not be swapped.
WORDS = ["unit_cell.voxels=16", "unit_cell.fibre=carbon_t300"]
#: Rows and columns of stresses in Mandel's notation as FANS orders them.
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def write(file: Path, *more: str) -> UnitCellModel:
    """Write the unit cell of a plain weave, and return it."""
    sets = [word for one in (*WORDS, *more) for word in ("--set", one)]
    with pytest.raises(SystemExit) as end:
        main(["unit-cell", "plain_weave", *sets, "-o", str(file), "-q"])
    assert end.value.code == 0
    return unit_cell_model(open_scene("plain_weave", WORDS))


def from_mandel(rows: np.ndarray) -> np.ndarray:
    """Turn stiffnesses (n, 6, 6) in Mandel's notation into order xx, yy, zz, yz, xz, xy."""
    weight = np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    order = [0, 1, 2, 5, 4, 3]
    return (rows / np.outer(weight, weight))[:, order][:, :, order]


def phases_of(model: UnitCellModel, stiffness: np.ndarray) -> Phases:
    """Return materials of voxels from their stiffnesses (nz, ny, nx, 6, 6)."""
    upper = np.ascontiguousarray(stiffness[..., UPPER[0], UPPER[1]].transpose(0, 1, 3, 2))
    return Phases(upper, phases_without_mixing(model).thermal_stress, 0.0)


def compare(model: UnitCellModel, stiffness: np.ndarray) -> None:
    """Compare stiffnesses of voxels (nz, ny, nx, 6, 6) with those of their own directions."""
    exact = phases_without_mixing(model)
    own = symmetric(exact.stiffness.transpose(0, 1, 3, 2))
    # A turn by α changes a stiffness by at most about 4 sin α of its largest entry; the directions
    # of a class differ by at most a step each in azimuth and in elevation.
    bound = 4 * np.sin(np.radians(DIRECTION_STEP * 2**0.5)) * own.max()
    assert 0 < abs(stiffness - own).max() < bound
    classes = phases_of(model, stiffness)
    found, ours = (homogenise(one, model.spacing)[0].stiffness for one in (classes, exact))
    np.testing.assert_allclose(found, ours, rtol=0, atol=1e-3 * ours.max())


def read_fans(file: Path) -> tuple[np.ndarray, list[float]]:
    """Return the stiffnesses of voxels (nz, ny, nx, 6, 6) in a file for FANS, and its lengths."""
    content = json.loads(file.read_text())
    cell, (material,) = content["microstructure"], content["materials"]
    with h5py.File(file.parent / cell["filepath"]) as made:
        phases = made[cell["datasetname"]][()]
        assert made[cell["datasetname"]].attrs["permute_order"] == "zyx"
    assert phases.dtype == np.uint16
    assert material["phases"] == list(range(phases.max() + 1))
    names = [f"C_{i + 1}{j + 1}" for i, j in zip(*UPPER, strict=True)]
    rows = np.array([material["material_properties"][name] for name in names]).T
    return from_mandel(symmetric(rows))[phases], cell["L"]


def hooke(elastic: dict[str, Any]) -> np.ndarray:
    """Return the stiffness (3, 3, 3, 3) of a cubic or hexagonal lattice with the axis c along z."""
    c = {key: float(value) for key, value in elastic.items() if key != "type"}
    voigt = np.zeros((6, 6))
    voigt[:3, :3] = c["C_12"]
    voigt[range(2), range(2)] = c["C_11"]
    voigt[2, :2] = voigt[:2, 2] = c.get("C_13", c["C_12"])
    voigt[2, 2] = c.get("C_33", c["C_11"])
    voigt[range(3, 5), range(3, 5)] = c["C_44"]
    voigt[5, 5] = (c["C_11"] - c["C_12"]) / 2 if "C_33" in c else c["C_44"]
    place = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    return voigt[place[:, :, None, None], place]


def test_damask_gets_the_stiffness_of_each_voxel(tmp_path: Path) -> None:
    model = write(tmp_path / "cell.yaml")
    content = yaml.safe_load((tmp_path / "cell.yaml").read_text())
    grid = pv.read(tmp_path / "cell.vti")
    head = (tmp_path / "cell.vti").read_text()
    assert 'format="appended"' not in head  # which DAMASK cannot read
    assert grid.cell_data["material"].dtype == np.int32
    shape = model.voxels.fraction.shape
    made = []
    for material in content["material"]:
        (one,) = material["constituents"]
        assert one["v"] == content["homogenization"][material["homogenization"]]["N_constituents"]
        active = Rotation.from_quat([*one["O"][1:], one["O"][0]]).as_matrix()
        tensor = hooke(content["phase"][one["phase"]]["mechanical"]["elastic"])
        tensor = np.einsum("ai,bj,ck,dl,ijkl->abcd", *[active] * 4, tensor, optimize=True)
        pairs = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
        made.append([[tensor[i, j, k, m] for k, m in pairs] for i, j in pairs])
    numbers = grid.cell_data["material"].reshape(shape)
    assert set(np.unique(numbers)) == set(range(len(made)))
    compare(model, np.array(made)[numbers])
    np.testing.assert_allclose(grid.spacing, model.spacing)


def test_fans_gets_the_stiffness_of_each_voxel(tmp_path: Path) -> None:
    model = write(tmp_path / "cell.json")
    stiffness, lengths = read_fans(tmp_path / "cell.json")
    compare(model, stiffness)
    np.testing.assert_allclose(lengths, model.spacing * stiffness.shape[2::-1])


@pytest.mark.skipif(shutil.which("FANS") is None, reason="FANS is not installed")
def test_fans_finds_the_same_stiffness(tmp_path: Path) -> None:
    model = write(tmp_path / "cell.json")
    subprocess.run(["FANS", "cell.json", "out.h5"], cwd=tmp_path, capture_output=True, check=True)
    with h5py.File(tmp_path / "out.h5") as made:
        loads = made["phases_results"]
        stress = np.array([loads[f"load{n}/time_step0/stress_average"][()] for n in range(6)])
    found = from_mandel(stress[None] / STRAIN)[0]
    classes = phases_of(model, read_fans(tmp_path / "cell.json")[0])
    exact = homogenise(classes, model.spacing, 8, 1e-6)[0].stiffness
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-6 * exact.max())


def test_what_a_grid_cannot_hold_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.vti").touch()
    for name, more, text in (
        ("a.yaml", ["--set", "unit_cell.shear=10"], "right angles"),
        ("a.json", ["--fields"], "hold no fields"),
        ("own.yaml", [], "own.vti, which exists"),
    ):
        sets = ["--set", WORDS[0]]
        with pytest.raises(SystemExit) as end:
            main(["unit-cell", "plain_weave", *sets, *more, "-o", str(tmp_path / name), "-q"])
        assert end.value.code == 2
        assert text in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["own.vti"]


def test_a_cell_in_a_mould_is_a_lower_box(tmp_path: Path) -> None:
    words = [*WORDS, "unit_cell.thickness=0.45mm", "unit_cell.packing=0.5"]
    write(tmp_path / "cell.json", *words[2:])
    model = unit_cell_model(open_scene("plain_weave", words))
    found, lengths = read_fans(tmp_path / "cell.json")
    assert lengths[2] == pytest.approx(4.5e-4, rel=1e-12)
    exact = phases_without_mixing(model)
    spacing = np.array(lengths) / found.shape[2::-1]
    ours = homogenise(exact, model.spacing)[0].stiffness
    theirs = homogenise(phases_of(model, found), spacing)[0].stiffness
    np.testing.assert_allclose(theirs, ours, rtol=0, atol=2e-3 * ours.max())
