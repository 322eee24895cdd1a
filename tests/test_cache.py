"""Kept work: what is not solved again, in a process and from one to the next."""

from __future__ import annotations

import contextlib
import io
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import ModalResponse, ModalSolver, TetraCage, WeaveSource, cache
from spacemap_vtk.filters import modal_solver
from spacemap_vtk.mechanics.modal import eigen, mesh_pencil
from spacemap_vtk.mechanics.modal.model import Model


@pytest.fixture
def place(monkeypatch, tmp_path):
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def calls(monkeypatch):
    """Count solutions and assemblies."""
    counted = {"solved": 0, "assembled": 0}
    lowest, assemble = eigen.solve_modes, mesh_pencil.assemble

    def count(name, function):
        def counting(*arguments):
            counted[name] += 1
            return function(*arguments)

        return counting

    monkeypatch.setattr(eigen, "solve_modes", count("solved", lowest))
    monkeypatch.setattr(mesh_pencil, "assemble", count("assembled", assemble))
    return counted


def solver(**settings):
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(3, 3, 2))
    cage.SetInputConnection(weave.GetOutputPort())
    made = ModalSolver(**{"modes": 8, **settings})
    made.SetInputConnection(cage.GetOutputPort())
    return made


def result(made):
    made.update()
    grid = made.GetOutputDataObject(0)
    eigenvalues = vtk_to_numpy(grid.GetFieldData().GetArray("eigenvalues")).copy()
    names = [f"mode_{k:03d}" for k in range(len(eigenvalues))]
    return eigenvalues, np.array([vtk_to_numpy(grid.GetPointData().GetArray(n)) for n in names])


def test_modulus_and_density_only_scale(calls):
    made = solver(youngs_modulus=1e6, density=300.0)
    eigenvalues, shapes = result(made)
    made.configure(youngs_modulus=3e6, density=700.0)
    scaled = result(made)
    assert calls == {"solved": 1, "assembled": 1}
    fresh = result(solver(youngs_modulus=3e6, density=700.0))
    np.testing.assert_allclose(scaled[0], fresh[0], rtol=1e-12)
    np.testing.assert_allclose(scaled[1], fresh[1], rtol=1e-9, atol=1e-9 * abs(fresh[1]).max())
    np.testing.assert_allclose(scaled[0], eigenvalues * 3 * 300 / 700, rtol=1e-12)
    np.testing.assert_allclose(scaled[1], shapes * np.sqrt(300 / 700), rtol=1e-12)


def test_equal_modes_are_identical_arrays():
    made, response = solver(), ModalResponse()
    response.SetInputConnection(made.GetOutputPort())

    def arrays():
        response.update(0.1)
        data = response.GetOutputDataObject(0).GetPointData()
        return [data.GetArray(f"mode_{k:03d}") for k in range(8)], data.GetArray("displacement")

    first, before = arrays()
    table = response.motion.modes.shapes
    made.youngs_modulus = 3e6
    again, after = arrays()
    assert all(a is b for a, b in zip(first, again, strict=True))
    assert response.motion.modes.shapes is table
    assert not np.array_equal(vtk_to_numpy(before), vtk_to_numpy(after))
    shapes = np.array([vtk_to_numpy(array) for array in first])
    for change in ({"density": 700.0}, {"poissons_ratio": 0.2}, {"modes": 10}):
        made.configure(**change)
        other, _ = arrays()
        assert not any(a is b for a, b in zip(again, other, strict=True))
        table = np.array([vtk_to_numpy(array) for array in other])
        np.testing.assert_array_equal(
            response.motion.modes.shapes[:8], table.reshape(len(table), -1)
        )
        if change == {"density": 700.0}:
            np.testing.assert_allclose(table, shapes * np.sqrt(300.0 / 700.0), rtol=1e-14)
        again = other


def test_new_support_ratio_or_mass_reuses_the_assembly(calls):
    made = solver()
    for change in ({"fixed": "-x"}, {"poissons_ratio": 0.2}, {"mass": "lumped"}):
        made.configure(**change)
        made.update()
    assert calls == {"solved": 3, "assembled": 1}


def test_fewer_modes_equal_those_solved_alone(calls, monkeypatch):
    monkeypatch.setenv("SPACEMAP_CACHE", "off")
    made = solver(modes=8)
    made.update()
    made.modes = 5
    fewer, alone = result(made), result(solver(modes=5))
    assert calls["solved"] == 3
    np.testing.assert_array_equal(fewer[0], alone[0])
    np.testing.assert_array_equal(fewer[1], alone[1])


def test_same_scene_again_solves_nothing(place, calls):
    first = result(solver())
    assert calls == {"solved": 1, "assembled": 1}
    again = result(solver())
    assert calls == {"solved": 1, "assembled": 1}
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    result(solver(youngs_modulus=5e6))
    assert calls["solved"] == 1
    result(solver(modes=9))
    assert calls["solved"] == 2
    assert len(list(place.iterdir())) == 2


def test_every_change_of_the_modes_makes_a_new_entry(place, calls):
    for number, settings in enumerate(
        ({}, {"fixed": "-x"}, {"fixed": "+y:xy"}, {"poissons_ratio": 0.2}, {"mass": "lumped"})
    ):
        result(solver(**settings))
        assert calls["solved"] == number + 1


def test_dragging_a_value_stores_few_entries(place, calls, monkeypatch):
    # Whatever else the machine does meanwhile.
    monkeypatch.setattr(modal_solver, "_QUICK", np.inf)
    monkeypatch.setattr(modal_solver, "_PAUSE", 60.0)
    made = solver()
    for number in range(5):
        made.poissons_ratio = 0.2 + 0.01 * number
        result(made)
    assert calls["solved"] == 5
    assert len(list(place.iterdir())) == 1
    # The value that it ended with is no worse for it, nor is another stage's.
    result(solver(poissons_ratio=0.24))
    assert calls["solved"] == 6
    assert len(list(place.iterdir())) == 2


@pytest.mark.parametrize("damage", ["truncated", "flipped", "empty", "text", "other", "few"])
def test_damaged_entry_is_replaced(place, calls, damage):
    right = result(solver())
    (path,) = place.iterdir()
    content = bytearray(path.read_bytes())
    if damage == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "flipped":
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(content)
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "text":
        path.write_text("not an archive")
    elif damage == "other":
        with path.open("wb") as file:
            np.savez(file, eigenvalues=np.ones(8), shapes=np.ones((8, 2, 3)))
    else:
        with path.open("wb") as file:
            np.savez(file, shapes=np.ones((8, 2, 3)))
    again = result(solver())
    assert calls["solved"] == 2
    np.testing.assert_array_equal(right[0], again[0])
    result(solver())
    assert calls["solved"] == 2
    assert len(list(place.iterdir())) == 1


@pytest.mark.parametrize("device", ["/dev/zero", None])
def test_endless_entry_is_replaced(place, device):
    cache.store("entry", values=np.arange(8.0))
    path = place / "entry-1.npz"
    path.unlink()
    path.symlink_to(device) if device else os.mkfifo(path)
    assert cache.load("entry") is None
    cache.store("entry", values=np.arange(8.0))
    assert len(cache.load("entry")["values"]) == 8


def test_changed_entry_never_gives_wrong_arrays(place):
    right = {"values": np.arange(8.0), "shapes": np.random.default_rng(0).random((8, 5, 3))}
    cache.store("entry", **right)
    path = place / "entry-1.npz"
    whole, chance = path.read_bytes(), random.Random(3)
    missing = 0
    for number in range(150):
        data = bytearray(whole)
        at = chance.randrange(len(data))
        if number % 3 == 0:
            data[at] ^= 1 << chance.randrange(8)
        elif number % 3 == 1:
            del data[at:]
        else:
            data[at : at + 40] = chance.randbytes(chance.randrange(40))
        path.write_bytes(data)
        found = cache.load("entry")
        missing += found is None
        for name, array in (found or {}).items():
            np.testing.assert_array_equal(array, right[name])
    assert missing > 100


def test_cache_can_be_switched_off(monkeypatch, tmp_path, calls):
    monkeypatch.setenv("SPACEMAP_CACHE", "off")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    result(solver())
    result(solver())
    assert calls["solved"] == 2
    assert not list(tmp_path.iterdir())
    assert cache.folder() is None


def test_folder_is_in_the_users_home(monkeypatch, tmp_path):
    monkeypatch.delenv("SPACEMAP_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    if sys.platform.startswith("linux"):
        assert cache.folder() == tmp_path / "spacemap_vtk"
        monkeypatch.delenv("XDG_CACHE_HOME")
        assert cache.folder() == Path.home() / ".cache" / "spacemap_vtk"


def test_oldest_entries_are_removed_when_the_cache_is_full(place, monkeypatch):
    monkeypatch.setattr(cache, "MAX_BYTES", 40_000)
    for number in range(6):
        cache.store(f"entry{number}", a=np.arange(1000.0))
        os.utime(place / f"entry{number}-1.npz", (number, number))
        if number == 3:
            cache.load("entry1")  # now the latest used
            os.utime(place / "entry1-1.npz", (3.5, 3.5))
    kept = {path.name[:6] for path in place.iterdir()}
    assert kept == {"entry1", "entry3", "entry4", "entry5"}
    cache.store("large", a=np.zeros(3000))
    assert cache.load("large") is None


def test_read_only_disk_is_not_an_error(monkeypatch, tmp_path, calls):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv("SPACEMAP_CACHE", str(blocked / "cache"))
    result(solver())
    assert calls["solved"] == 1
    assert cache.load("entry") is None


@pytest.mark.parametrize("room", [0, 2**13])
def test_full_disk_is_not_an_error(small_disk, monkeypatch, calls, room):
    disk = small_disk(2**17)
    with contextlib.suppress(OSError), (disk / "fill").open("wb", buffering=0) as fill:
        fill.write(bytes(2**17 - room))
    monkeypatch.setenv("SPACEMAP_CACHE", str(disk / "cache"))
    assert result(solver())[0].shape == result(solver())[0].shape
    assert calls["solved"] == 2
    cache.store("entry", a=np.zeros(10**5))
    assert cache.load("entry") is None
    assert list(disk.glob("cache/*")) == []


def test_killed_process_leaves_no_partial_entry(place):
    program = "import numpy as np\nfrom spacemap_vtk import cache\n"
    program += "while True: cache.store('entry', a=np.zeros(10**7))"
    with subprocess.Popen([sys.executable, "-c", program]) as process:
        try:
            end = time.monotonic() + 300
            while not list(place.glob(".spacemap-*/entry.npz")):
                assert time.monotonic() < end
                time.sleep(0.001)
            process.terminate()
            assert process.wait(300) in (143, -signal.SIGTERM)
        finally:
            process.kill()
    assert [path.suffix for path in place.glob("*")] in ([], [".npz"])


def test_files_of_other_programs_are_ignored(place, monkeypatch):
    """Found by fuzzing: each was an error of numpy's, zlib's or tokenize's, or believed."""
    monkeypatch.setattr(cache, "MAX_BYTES", 10**6)

    def packed(compress=False, **arrays):
        file = io.BytesIO()
        (np.savez_compressed if compress else np.savez)(file, **arrays)
        return file.getvalue()

    good = packed(a=np.zeros((2, 3)))
    alone = io.BytesIO()
    np.save(alone, np.zeros((2, 3)))
    deflated = packed(compress=True, a=np.arange(600.0).reshape(-1, 3))
    wrong = [
        alone.getvalue(),
        good.replace(b"(2, 3)", b"(2, 3 "),
        deflated[:250] + bytes([deflated[250] ^ 255]) + deflated[251:],
        packed(a=np.zeros((2, 2))),
        packed(a=np.array([["x"] * 3] * 2)),
        packed(b=np.zeros((2, 3))),
        packed(compress=True, a=np.zeros((2, 3)), more=np.zeros(cache.MAX_BYTES, np.uint8)),
    ]
    cache.store("entry", a=np.zeros((2, 3)))
    (file,) = place.iterdir()
    assert cache.load("entry", a=(-1, 3)) is not None
    for content in wrong:
        file.write_bytes(content)
        assert cache.load("entry", a=(-1, 3)) is None
        assert not file.exists()


def test_cancelling_works_on_a_cached_solution(place):
    from spacemap_vtk.errors import SpacemapError

    result(solver())
    made = solver()
    made.AddObserver("ProgressEvent", lambda caller, event: caller.SetAbortExecute(1))
    with pytest.raises(SpacemapError, match="cancelled"):
        made.update()


def test_static_displacements_are_cached(place, monkeypatch):
    from spacemap_vtk.datasets.modal_model import model_of
    from spacemap_vtk.filters.modal_response import static_displacements

    made = solver()
    made.update()
    model = model_of(made.GetOutputDataObject(0))
    forces = np.random.default_rng(0).standard_normal((len(model.free), 2))
    first, rounding = static_displacements(model, forces)
    np.testing.assert_allclose(
        first, model.statics(forces)[0], rtol=1e-12, atol=1e-12 * abs(first).max()
    )
    assert 0 < rounding.min() <= rounding.max() < 1e-9
    monkeypatch.setattr(Model, "statics", None)
    again, as_before = static_displacements(model, forces)
    np.testing.assert_allclose(again, first, rtol=1e-15)
    np.testing.assert_array_equal(as_before, rounding)
    last, _ = static_displacements(model, forces[:, 1:])
    np.testing.assert_allclose(last, first[:, 1:], rtol=1e-15)
    made.youngs_modulus = 2e6
    made.update()
    stiffer = model_of(made.GetOutputDataObject(0))
    np.testing.assert_allclose(static_displacements(stiffer, forces)[0], first / 2, rtol=1e-12)


def test_command_line_switches_the_cache_off(place, monkeypatch, capsys):
    from spacemap_vtk.cli.main import main

    for options, entries in ((["--no-cache"], 0), ([], 1)):
        monkeypatch.setenv("SPACEMAP_CACHE", str(place))
        with pytest.raises(SystemExit) as stopped:
            main(["modes", "plain_weave", "--json", "--no-errors", *options])
        assert stopped.value.code == 0
        assert len(list(place.glob("modes-*"))) == entries
    capsys.readouterr()
