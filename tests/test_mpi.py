"""Several processes under MPI, inside ParaView's pvbatch: the union of the pieces is the whole."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from vtkmodules.vtkIOXML import vtkXMLPPolyDataReader

from spacemap_vtk.paraview import environment
from spacemap_vtk.scenes.scene import Scene

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "tests" / "mpi"
sys.path.insert(0, str(SCRIPTS))
from cases import connected, surface  # noqa: E402

pytestmark = pytest.mark.skipif(
    any(shutil.which(name) is None for name in ("mpirun", "pvbatch", "xvfb-run")),
    reason="needs mpirun, pvbatch and xvfb-run: "
    "apt-get install openmpi-bin paraview python3-paraview xvfb xauth",
)
NIGHTLY = pytest.mark.nightly
XVFB = ["xvfb-run", "-a", "-s", "-screen 0 1280x1024x24 -noreset"]
# Who waits lets others run: there may be fewer cores than processes.
YIELDING = ["--mca", "mpi_yield_when_idle", "1"]
MPIRUN = ["mpirun", "--allow-run-as-root", "--oversubscribe", *YIELDING]


def mpirun(
    *arguments: object, timeout: float = 300.0, reported: bool = False, **more: Any
) -> tuple[int, str, str]:
    """Run a command; what hangs is ended with all that it has started."""
    process = subprocess.Popen(
        [*XVFB, *MPIRUN, *map(str, arguments)],
        env={
            **environment.process_environment(),
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "SPACEMAP_CACHE": "off",
            "OMPI_MCA_plm": "isolated",  # one machine: no ssh is looked for
            "OMPI_MCA_mpi_yield_when_idle": "1",  # the others may have the core
        },
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **more,
    )
    try:
        out, error = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        out, error = process.communicate()
        pytest.fail(f"hangs\n{out}\n{error}")
    # Another test checks the message about what these cloths are too small for.
    if not reported:
        error = re.sub(r"^spacemap: \d+ processes on this machine .*\n", "", error, flags=re.M)
    return process.returncode, out, error


def cases(folder: Path) -> dict[str, dict[str, Any]]:
    """Weaves, objects and motions; the files of the latter two are written."""
    ball = pv.Sphere(radius=0.01, theta_resolution=24, phi_resolution=24)
    ball.cell_data["part"] = np.arange(ball.n_cells)
    ball.save(folder / "ball.vtp")
    grid = pv.ImageData(dimensions=(7, 6, 5), spacing=(1e-3,) * 3).cast_to_unstructured_grid()
    grid.cell_data["part"] = np.arange(grid.n_cells)
    grid.save(folder / "block.vtu")
    collection = []
    for step, time in enumerate((0.0, 0.1)):
        cage = pv.ImageData(dimensions=(4, 4, 3), origin=(-2e-3, -2e-3, -5e-4)).copy()
        cage.spacing = (4e-3 / 3, 4e-3 / 3, 5e-4)
        cage = cage.cast_to_unstructured_grid()
        shear = np.zeros((cage.n_points, 3))
        shear[:, 2] = 0.3 * step * cage.points[:, 0]
        cage["displacement"] = shear
        cage.save(folder / f"cage_{step}.vtu")
        collection.append(f'<DataSet timestep="{time}" file="cage_{step}.vtu"/>')
    (folder / "cage.pvd").write_text(
        f'<VTKFile type="Collection"><Collection>{"".join(collection)}</Collection></VTKFile>'
    )
    uneven = {"warp_diameter": [2e-4, 2.5e-4, 1.5e-4], "weft_section": "racetrack"}
    return {
        "plain": {"source": {"ends": 5, "picks": 4}},
        "twill": {"source": {"pattern": "twill 2/2", "ends": 9, "picks": 7, **uneven}},
        "kept": {"source": {"pattern": "twill 2/1", "ends": 8, "picks": 7, **uneven}, "yarns": {}},
        "spline": {"source": {"axis": "spline", "ends": 4, "picks": 6, "exact": True}},
        "carved": {"source": {"ends": 5, "picks": 4}, "cage": {"method": "carved", "margin": 1}},
        "ball": {"source": {"file": str(folder / "ball.vtp"), "rotate": [0, 30, 0]}},
        "block": {"source": {"file": str(folder / "block.vtu"), "scale": 2.0}},
        "idle": {
            "source": {"ends": 1, "picks": 1, "overhang": 1e-3},
            "cage": {"method": "carved"},
        },
        "motion": {
            "source": {"ends": 5, "picks": 4},
            "motion": {"file": str(folder / "cage.pvd")},
        },
    }


def ordered(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Sort cells by what they belong to; those of one yarn or part by their place."""
    middle = arrays["corners"].mean(axis=1)
    rounded = np.round(middle / (1e-5 * np.ptp(middle)))
    owner = arrays.get("yarn", arrays.get("part"))
    keys = [owner] if "yarn" in arrays else [*rounded.T, owner]  # of a yarn in their order
    rows = np.lexsort(keys)
    return {name: values[rows] for name, values in arrays.items()}


@pytest.mark.parametrize("processes", [2, pytest.param(3, marks=NIGHTLY)])
def test_the_union_of_the_pieces_is_the_serial_result(processes: int, tmp_path: Path) -> None:
    described = cases(tmp_path)
    if processes == 2:
        for name in ("twill", "spline", "block"):
            del described[name]
    file = tmp_path / "cases.json"
    file.write_text(json.dumps(described))
    code, out, error = mpirun(
        "-np", processes, "pvbatch", "--symmetric", SCRIPTS / "pieces.py", tmp_path, file
    )
    assert (code, error) == (0, ""), out + error
    for name, case in described.items():
        stages = connected(**case)
        for time in (0.0, 0.05):
            stages[-1].update(time)
        expected = ordered(surface(stages[-1].GetOutputDataObject(0)))
        pieces = [np.load(tmp_path / f"{name}_{k}.npz") for k in range(processes)]
        for piece in pieces:
            np.testing.assert_array_equal(
                piece["executions"], [stage.executions for stage in stages], err_msg=name
            )
            np.testing.assert_array_equal(piece["cage"], pieces[0]["cage"])
            np.testing.assert_array_equal(piece["displacement"], pieces[0]["displacement"])
        assert [bool(piece["solved"]) for piece in pieces] == [
            "motion" not in case and rank == 0 for rank in range(processes)
        ]
        size = np.ptp(expected["corners"])
        cage = pv.wrap(stages[-3].GetOutputDataObject(0))
        np.testing.assert_allclose(pieces[0]["cage"], cage.points, atol=1e-9 * size)
        assert sum(int(piece["owned"]) for piece in pieces) == cage.n_cells
        filled = [piece for piece in pieces if "corners" in piece]
        assert len(filled) == (2 if name == "idle" else processes)
        found = ordered({key: np.concatenate([piece[key] for piece in filled]) for key in expected})
        assert np.ptp(expected["moved"]) > 1e-3 * size, name
        for key, values in expected.items():
            if key in ("corners", "moved", "crimp"):
                least = 1e-6 if key == "crimp" else 2e-6 * size
                np.testing.assert_allclose(found[key], values, atol=least, err_msg=name)
            else:
                np.testing.assert_array_equal(found[key], values, err_msg=name)


@NIGHTLY
@pytest.mark.parametrize(
    ("processes", "yarns"),
    [(2, 4), (3, 8), (5, 2)],
    ids=["2", "3", "idle"],
)
def test_scripts_in_one_session(processes: int, yarns: int, tmp_path: Path) -> None:
    """A pipeline script, scenes and their files, and what only the last process lacks."""
    cloths = {tmp_path / "all": (7, 7), tmp_path / "idle": (1, 1)}
    for folder, (ends, picks) in cloths.items():
        folder.mkdir()
        (folder / "scene.toml").write_text(
            f"[weave]\nends = {ends}\npicks = {picks}\n"
            "[cage]\ndivisions = [3, 3, 1]\norder = 2\n[modal]\nmodes = 40\n"
            "[response]\ngravity = [0, 0, -9]\n"
        )
    picture = tmp_path / "cloth.png"
    scripts = {
        ROOT / "pipelines" / "paraview" / "cloth_over_ranks.py": [picture, yarns],
        SCRIPTS / "proxies.py": cloths,
        SCRIPTS / "mistake.py": [],
    }
    words = [",".join(map(str, [script, *more])) for script, more in scripts.items()]
    places = [tmp_path / "with", tmp_path / "without"]
    for place in places:
        place.mkdir()
    (places[0] / "draft.txt").write_text("10\n01\n")
    run = ["pvbatch", SCRIPTS / "session.py", *words]
    code, out, error = mpirun(
        *("-np", processes - 1, "-wdir", places[0], *run, ":"),
        *("-np", 1, "-wdir", places[1], *run),
        reported=True,
    )
    assert code == 0, out + error
    assert re.fullmatch(
        r"stretch .*\n" + re.escape(2 * "[1, 1, 1, 1]\n" + "all stopped, and went on\n"), out
    ), out

    in_picture(picture)
    assert set(pv.read(tmp_path / "cloth.pvtu")["yarn"]) == set(range(2 * yarns))
    for folder, threads in cloths.items():
        compare(folder, min(processes, sum(threads)))  # nothing for idle processes
    # Nothing is printed but the message of the mistake.
    before, _, failures = error.partition("mistake.py\n")
    assert before == "cloth_over_ranks.py\nproxies.py\n", error
    failed = failures.splitlines()
    assert 1 <= len(failed) <= 2, error  # once for each consumer of the weave
    for line in failed:
        assert f"rank {processes - 1} of {processes} has failed: " in line, error
        assert "draft.txt" in line, error


def in_picture(picture: Path) -> None:
    """Hold that both families are seen."""
    red, _, blue = np.asarray(Image.open(picture).convert("RGB")).astype(int).reshape(-1, 3).T
    assert np.mean(red - blue > 40) > 0.03  # the weft's sand
    assert np.mean((blue - red > 30) & (red < 50)) > 0.03  # the warp's blue


def compare(folder: Path, pieces: int) -> None:
    """Compare the files that were written of a scene with what one process makes of it."""
    scene = Scene.read(folder / "scene.toml")
    scene.update(0.05)
    expected = ordered(surface(scene.polygons))
    reader = vtkXMLPPolyDataReader()
    reader.SetFileName(str(folder / "surface.pvtp"))
    reader.Update()
    found = ordered(surface(reader.GetOutput()))
    size = np.ptp(expected["corners"])
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, atol=2e-6 * size, err_msg=name)
    patches = pv.read(folder / "patches.pvtu")
    assert patches.n_cells == scene.patches.GetNumberOfCells()
    np.testing.assert_allclose(patches.bounds, scene.patches.GetBounds(), atol=1e-9 * size)
    assert len(list((folder / "patches").iterdir())) == pieces


@pytest.mark.nightly
@pytest.mark.parametrize("blind", ["both", "the second"])
def test_without_a_display_all_end_with_the_message(blind: str, tmp_path: Path) -> None:
    script = ROOT / "pipelines" / "paraview" / "cloth_over_ranks.py"
    draws = ["pvbatch", script, tmp_path / "cloth.png", 2]
    cannot = ["env", "-u", "DISPLAY", *draws]
    ranks = ["-np", 1, *(cannot if blind == "both" else draws), ":", "-np", 1, *cannot]
    code, out, error = mpirun(*ranks, timeout=300.0)
    assert code == 1, out + error
    assert error.count("spacemap: ParaView has no display. Set DISPLAY ") == 1, error
    assert not (tmp_path / "cloth.png").exists()


@pytest.mark.nightly
def test_memory_and_work_fall_with_the_number_of_processes(tmp_path: Path) -> None:
    taken = {}
    for processes in (1, 3):
        folder = tmp_path / str(processes)
        folder.mkdir()
        script = ROOT / "benchmarks" / "ranks.py"
        code, _, error = mpirun(
            *("-np", processes, "pvbatch", "--symmetric", script, "worker", 110, "double", folder)
        )
        assert (code, error) == (0, "")
        found = [json.loads(file.read_text()) for file in folder.iterdir()]
        assert len(found) == processes
        taken[processes] = max(each["peak"] - each["base"] for each in found)
    # A third of the yarns; the cage, its modes and what a picture takes stay.
    assert taken[3] < 0.6 * taken[1], taken
