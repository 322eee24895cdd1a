"""The commands that show a scene's dynamics: the table of modes, the sheet of shapes, the plot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.cli.main import main
from spacemap_vtk.embedding.interpolation import point_weights
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.scene import Scene

FEW = ("--set", "modal.modes=6")


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(arguments)
    return int(done.value.code or 0)


def test_the_table_shows_effective_mass(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("modes", "plain_weave", "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    last = figures["modes"][-1]
    np.testing.assert_allclose(last["cumulative_mass_share"], 1.0)
    total = np.sum([mode["effective_mass"] for mode in figures["modes"]], axis=0)
    np.testing.assert_allclose(total, figures["movable_mass"])
    assert (np.array(figures["movable_mass"]) < figures["mass"]).all()
    assert run("modes", "plain_weave", *FEW) == 0
    rows = capsys.readouterr().out
    assert "underdamped" in rows
    assert "Σz" in rows


def test_damping_of_each_mode_follows_the_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ratio = ("--set", "response.alpha=0", "--set", "response.damping_ratio=0.05")
    assert run("modes", "plain_weave", "--json", *FEW, *ratio) == 0
    modes = json.loads(capsys.readouterr().out)["modes"]
    assert [mode["damping_ratio"] for mode in modes] == pytest.approx([0.05] * 6)
    pairs = ("--set", "response.alpha=0", "--set", "response.damping_pairs=[[20, 1.2], [200, 1]]")
    assert run("modes", "plain_weave", "--json", *FEW, *pairs) == 0
    figures = json.loads(capsys.readouterr().out)
    omega = 2 * np.pi * figures["modes"][2]["frequency_hz"]
    expected = figures["alpha"] / (2 * omega) + figures["beta"] * omega / 2
    assert figures["modes"][2]["damping_ratio"] == pytest.approx(expected)
    assert run("modes", "plain_weave", "--set", "response.damping_ratio=0.1") == 2
    message = capsys.readouterr().err
    assert "damping_ratio and alpha both" in message
    assert "response.damping_ratio = 0.1" in message
    # A file is named where it says the value, and only there.
    assert "plain_weave.toml" not in message
    mine = tmp_path / "mine.toml"
    scene = (library.folder() / "plain_weave.toml").read_text(encoding="utf-8")
    mine.write_text(scene.replace("[response]\n", "[response]\ndamping_ratio = 0.1\n"))
    assert run("modes", str(mine)) == 2
    assert "mine.toml: response.damping_ratio = 0.1" in capsys.readouterr().err


@pytest.mark.nightly
def test_a_sheet_shows_each_mode_shape(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "sheet.png"
    assert run("modes", "plain_weave", "-q", *FEW, "--plot", str(file)) == 0
    with Image.open(file) as image:
        assert image.size == (4 * 440, 2 * 446)
        pixels = np.asarray(image).astype(int)
    for number in range(6):
        cell = pixels[number // 4 * 446 :, number % 4 * 440 :][:400, :440]
        assert 0.1 < (np.ptp(cell, axis=2) > 40).mean() < 0.7
    assert run("modes", "plain_weave", "--plot", str(tmp_path / "sheet.txt")) == 2
    assert 'unsupported format ".txt"' in capsys.readouterr().err


def test_a_sheet_of_modes_shows_the_object(tmp_path: Path) -> None:
    file = tmp_path / "sheet.png"
    few = ("--set", "modal.modes=1")
    assert run("modes", "animal_in_carved_cage", "-q", *few, "--plot", str(file)) == 0
    with Image.open(file) as image:
        cell = np.asarray(image).astype(int)[:400, :440]
    # Lines are grey: colours are those of what is inside the cage.
    assert 0.1 < (np.ptp(cell, axis=2) > 40).mean() < 0.7


@pytest.mark.parametrize(
    "quantity", ["displacement", pytest.param("acceleration", marks=pytest.mark.nightly)]
)
def test_a_plot_is_written_for_a_point(tmp_path: Path, quantity: str) -> None:
    file = tmp_path / "swing.png"
    chosen = ("-o", str(file), "--quantity", quantity, "-q", *FEW)
    assert run("plot", "plain_weave", *chosen, "--point", "0,-1mm,0") == 0
    with Image.open(file) as image:
        assert (np.ptp(np.asarray(image.convert("RGB")).astype(int), axis=2) > 60).mean() > 1e-3


def test_an_invalid_point_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    chosen = ("-o", str(tmp_path / "swing.png"), "-q", *FEW)
    assert run("plot", "plain_weave", *chosen, "--point", "0,-1") == 2
    assert "--point" in capsys.readouterr().err
    assert run("plot", "plain_weave", *chosen, "--point", "0,-1,0") == 2
    assert "outside" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_plotted_curves_agree_with_the_displacement_field() -> None:
    scene = Scene.read("plain_weave")
    scene.set("modal.modes=10")
    scene.set('response.loads=[{base_displacement=[0, 0, "1 um"]}]')
    scene.response.gravity = (0, 0, 0)
    scene.update_stage(scene.response, 0.0)
    modes = scene.response.motion.modes
    vertex = 7
    points = modes.model.points
    weights = point_weights(points, modes.model.cells, points[vertex])
    assert weights[vertex] == pytest.approx(1.0)
    times = np.array([0.0, 0.013, 0.1])
    history = scene.response.motion.history(weights, times)
    for k, time in enumerate(times):
        scene.update_stage(scene.response, time)
        data = scene.response.GetOutputDataObject(0).GetPointData()
        for row, name in enumerate(("displacement", "velocity", "acceleration")):
            expected = data.GetArray(name).GetTuple(vertex)
            np.testing.assert_allclose(history[row, k], expected, atol=1e-12)
    # Far below the first mode the cage follows its base.
    answer = scene.response.motion.frequency_response(weights, np.array([1e-3]))
    np.testing.assert_allclose(answer[0], [0, 0, 1e-6], atol=1e-13)
    # And a sine that has been going on for ever is what the response is made of.
    frequency = 30.0
    scene.set(
        'response.loads=[{base_displacement=[0, 0, "1 um"], time="harmonic", frequency=30, '
        "steady=true}]"
    )
    scene.update_stage(scene.response, 0.0)
    answer = scene.response.motion.frequency_response(weights, np.array([frequency]))[0]
    for time in (0.0, 0.0071):
        now = scene.response.motion.history(weights, np.array([time]))[0, 0]
        turned = (answer * np.exp(2j * np.pi * frequency * time)).imag
        np.testing.assert_allclose(now, turned, atol=1e-9 * abs(answer).max())


def test_energies_are_plotted_for_a_motion_in_time_steps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, file = tmp_path / "fall.toml", tmp_path / "fall.svg"
    scene.write_text(
        "weave = { ends = 3, picks = 5 }\ncage = { divisions = [1, 3, 1] }\n"
        'modal = { elements = "sheet", youngs_modulus = "20 kPa", fixed = "+y" }\n'
        'transient = { duration = "5 ms" }\n'
    )
    assert run("plot", str(scene), "-o", str(file)) == 0
    assert "has a frequency response" in capsys.readouterr().err
    # A line for each axis, and for each energy.
    assert file.read_text().count('<g id="legend_') == 2
    assert run("plot", "calculix_fabric", "-o", str(file)) == 2
    assert "a motion from a file" in capsys.readouterr().err
