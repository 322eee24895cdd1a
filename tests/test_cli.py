"""The command line as a user runs it: exit codes, messages, files."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import shlex
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from spacemap_vtk.cli.main import COMMANDS, EXTENSIONS, app, main
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.algorithm import Algorithm
from spacemap_vtk.io import registry
from spacemap_vtk.scenes.pipeline import section_classes
from spacemap_vtk.scenes.scene import Scene

SCENES = Path(__file__).parents[1] / "scenes"
SMALL = ["--size", "160x120"]


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    return int(caught.value.code or 0)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run a command that must fail; return its only message."""
    assert run(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("spacemap: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


def test_render_by_name_in_a_fresh_process(tmp_path: Path) -> None:
    picture = tmp_path / "cloth.png"
    done = subprocess.run(
        [sys.executable, "-m", "spacemap_vtk", "render", "plain_weave", "-o", str(picture), *SMALL],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("stiffly") == 1
    assert "SpacemapWarning" not in done.stderr
    image = np.asarray(Image.open(picture))
    assert image.shape == (120, 160, 3)
    assert image.std() > 20
    assert [file.name for file in tmp_path.iterdir()] == ["cloth.png"]


def test_quiet_prints_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    target = str(tmp_path / "a.png")
    assert run("render", "plain_weave", "-o", target, *SMALL, "--quiet") == 0
    assert capfd.readouterr() == ("", "")


def test_time_size_and_set_change_the_picture(tmp_path: Path) -> None:
    def drawn(*more: str) -> np.ndarray:
        file = tmp_path / "x.png"
        assert run("render", "plain_weave", "-o", str(file), "-q", *more) == 0
        return np.asarray(Image.open(file)).astype(int)

    rest = drawn(*SMALL, "--time", "0")
    assert np.abs(drawn(*SMALL, "--time", "40 ms") - rest).max() > 30
    assert np.abs(drawn(*SMALL, "--time", "0", "--set", "weave.ends=3") - rest).max() > 30
    assert np.abs(drawn(*SMALL, "--time", "0", "--set", "view.camera=top") - rest).max() > 30
    assert drawn("--size", "100x80").shape == (80, 100, 3)


def test_a_draft_is_drawn_in_its_own_colours(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "twill.png"
    few = "--set", "surface.subdivisions=1"
    assert run("render", str(SCENES / "32-shaft_twill.wif"), "-o", str(file), *SMALL, *few) == 0
    # One line is printed if OpenGL libraries are missing.
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if "OpenGL libraries were not found" not in line] == []
    red, green, blue = np.asarray(Image.open(file)).astype(int).reshape(-1, 3).T
    assert np.sum(blue - red > 60) > 100  # the draft's turquoise, 55, 117, 178
    assert np.sum((red - green > 30) & (blue - green > 15)) > 100  # its magenta, 125, 60, 87
    assert np.sum(red - blue > 50) > 50  # its gold, 199, 157, 75


def test_animate_gif_and_frames(tmp_path: Path) -> None:
    short = ["--set", "animation.stop=0.02", "--set", "animation.speed=0.1"]
    short += ["--set", "animation.frames_per_second=20", "-q", "--size", "96x64"]
    film = tmp_path / "film.gif"
    assert run("animate", "plain_weave", "-o", str(film), *short) == 0
    with Image.open(film) as gif:
        assert gif.n_frames == 4
        assert gif.size == (96, 64)
        assert gif.info["duration"] == 50
        first = np.asarray(gif.convert("RGB")).astype(int)
        gif.seek(3)
        assert np.abs(np.asarray(gif.convert("RGB")).astype(int) - first).max() > 30
    assert run("animate", "plain_weave", "-o", str(tmp_path / "f%03d.png"), *short) == 0
    names = sorted(file.name for file in tmp_path.iterdir())
    assert names == ["f000.png", "f001.png", "f002.png", "f003.png", "film.gif"]


def test_animate_mp4(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="comes with the extra [movie]")
    film = tmp_path / "film.mp4"
    short = ["--set", "animation.stop=0.01", "--set", "animation.speed=0.1", "-q"]
    assert run("animate", "plain_weave", "-o", str(film), *short, "--size", "97x63") == 0
    assert film.read_bytes()[4:8] == b"ftyp"


def test_animate_checks_for_the_encoder_before_it_reads_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert run("animate", "no_such_scene", "-o", str(tmp_path / "film.mp4")) == 1
    assert "pip install 'spacemap_vtk[movie]'" in capsys.readouterr().err


def test_storyboard_draws_two_rows(tmp_path: Path) -> None:
    file = tmp_path / "figure6.png"
    arguments = ["-o", str(file), "--time", "0", "--time", "20ms,0.04", "--size", "300x200", "-q"]
    assert run("storyboard", "plain_weave", *arguments) == 0
    image = np.asarray(Image.open(file))
    assert image.shape[0] > 200
    assert image.shape[1] > 300


@pytest.mark.parametrize(
    ("name", "what", "cells"),
    [
        ("a.vtu", [], 1176),
        ("a.vtu", ["--what", "cage"], 125),
        ("a.vtp", [], 1176 * 36),
        ("a.stl", [], 1176 * 72),
        pytest.param("a.ply", [], 1176 * 72, marks=pytest.mark.nightly),
        ("a.ply", ["--what", "surface"], 1176 * 36),
    ],
)
def test_export_can_be_read_back(tmp_path: Path, name: str, what: list[str], cells: int) -> None:
    file = tmp_path / name
    assert run("export", "plain_weave", "-o", str(file), "--time", "0.02", "-q", *what) == 0
    mesh = pv.read(file)
    # In single precision some triangles at the corners of the caps collapse, and are dropped.
    assert cells * (0.99 if cells == 1176 * 72 else 1.0) <= mesh.n_cells <= cells
    if name == "a.vtu":
        assert np.abs(mesh["displacement"]).max() > 1e-5
        assert set(mesh.celltypes) == ({10} if what else {77})


def test_modes_and_info_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("modes", "plain_weave", "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["vertices"], figures["tetrahedra"], figures["dof"]) == (72, 125, 180)
    assert len(figures["modes"]) == 180
    first = figures["modes"][0]
    alpha = 10.0
    omega = 2 * np.pi * first["frequency_hz"]
    assert omega**2 == pytest.approx(first["eigenvalue"])
    assert first["damping_ratio"] == pytest.approx(alpha / 2 / omega)
    assert run("info", "plain_weave", "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["ends"], figures["picks"]) == (7, 7)
    assert figures["drawdown"][:2] == ["1010101", "0101010"]
    # Peirce with p = D, h = D / 2: the published table's second row.
    for family in ("warp", "weft"):
        assert figures[family]["theta_deg"] == pytest.approx(36.869898, abs=1e-6)
        assert figures[family]["crimp"] == pytest.approx(0.143501, abs=1e-6)
        assert figures[family]["height"] == pytest.approx(0.25e-3)
    assert figures["warnings"] == []


def test_free_cage_has_null_damping_ratio(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("modes", "plain_weave", "--json", "--set", "modal.fixed=''") == 0
    modes = json.loads(capsys.readouterr().out)["modes"]
    assert [mode["eigenvalue"] for mode in modes[:7]].count(0.0) == 6
    assert modes[0]["damping_ratio"] is None
    assert modes[0]["regime"] == "rigid"
    assert modes[0]["digits"] == 15
    assert 6 < modes[6]["digits"] < 15


@pytest.mark.nightly
def test_modes_lost_in_rounding_are_not_reported_as_rigid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path / "cache"))  # for the second command
    sheet = tmp_path / "sheet.ply"
    pv.Box((0, 50, 0, 50, 0, 3e-4)).triangulate().save(sheet)
    words = "--set", "cage.order=2", "--set", "modal.modes=8"
    assert run("modes", str(sheet), "--json", *words) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["modes"][0]["regime"] == "lost in rounding"
    assert found["modes"][0]["digits"] == 0
    assert "rigid" not in {mode["regime"] for mode in found["modes"]}
    assert any("lost in rounding" in text for text in found["warnings"])
    assert run("modes", str(sheet), *words) == 0
    assert "lost in rounding" in capsys.readouterr().out


def test_tables_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("modes", "plain_weave") == 0
    assert "180 degrees of freedom" in " ".join(capsys.readouterr().out.split())
    few = ["--set", "weave.ends=12", "--set", "weave.picks=10"]
    assert run("info", str(SCENES / "32-shaft_twill.wif"), *few) == 0
    out = capsys.readouterr().out
    assert "weave angle" in out
    assert "repeat 12 x 10" in " ".join(out.split())
    assert run("scenes") == 0
    assert "plain_weave" in capsys.readouterr().out
    assert run("scenes", "plain_weave") == 0
    assert "[weave]" in capsys.readouterr().out
    assert run("validate", "plain_weave") == 0
    assert "valid" in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    [
        "render",
        "animate",
        "storyboard",
        "figure",
        "print",
        "export",
        "modes",
        "plot",
        "info",
        "validate",
        "scenes",
        "keys",
        "materials",
        "yarns",
        "plan",
        "paraview",
        "serve",
        "gui",
    ],
)
def test_help_teaches(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command, "--help") == 0
    out = capsys.readouterr().out
    assert "Usage" in out
    assert len(out) > 200
    for noise in ("[default: ()]", "[default: False]", "File to write"):
        assert noise not in out
    # The function's docstring, whose first line the list of commands repeats.
    place = EXTENSIONS.get(command) or f"spacemap_vtk.cli.{COMMANDS[command][0]}"
    module, function = place.split(":")
    doc = getattr(importlib.import_module(module), function).__doc__
    reported = inspect.cleandoc(doc).partition("\n\nParameters\n")[0]
    assert " ".join(reported.split()) in " ".join(out.split())
    summary = out.strip().splitlines()[2].strip()
    assert summary == reported.splitlines()[0]
    assert command in EXTENSIONS or summary == COMMANDS[command][1]
    assert run("--help") == 0
    listed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert command in listed
    assert summary[:40] in listed


@pytest.mark.parametrize("command", [*COMMANDS, "paraview", "serve"])
def test_examples_in_the_help_are_valid_commands(command: str) -> None:
    place = EXTENSIONS.get(command) or f"spacemap_vtk.cli.{COMMANDS[command][0]}"
    module, function = place.split(":")
    doc = inspect.cleandoc(getattr(importlib.import_module(module), function).__doc__)
    examples = re.findall(r"^ {4,}(spacemap .*)$", doc.replace("\\\n", ""), re.M)
    assert examples or command == "serve"
    for example in examples:
        words = shlex.split(example.partition(" > ")[0])[1:]
        assert words[0] in (*COMMANDS, *EXTENSIONS)
        app.parse_args(words, exit_on_error=False, print_error=False)


def test_materials_print_their_source_and_assumptions(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run("materials") == 0
    out = capsys.readouterr().out
    assert "Wang" in out
    assert "2011" in out
    assert run("materials", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["materials"]) >= 5
    for name, row in found["materials"].items():
        assert name in out
        assert row["sample"] in out
        weight = 9.80665 * row["areal_mass"]
        assert row["bending_length_warp"] ** 3 * weight == pytest.approx(row["B_warp"])
        assert run("validate", "plain_weave", "-q", "--set", f"modal.material={name}") == 0
    assert any("E3" in text for text in found["assumed"])


def test_keys_explains_every_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("keys") == 0
    out = capsys.readouterr().out
    for section, cls in section_classes().items():
        assert f"[{section}]" in out
        for name in cls.parameters:
            assert f"\n{name} " in out
    assert run("keys", "cage") == 0
    out = capsys.readouterr().out
    assert "divisions" in out
    assert "[weave]" not in out


def test_keys_prints_defaults_as_toml(capsys: pytest.CaptureFixture[str]) -> None:
    """A line copied from the output is TOML and changes nothing."""
    assert run("keys") == 0
    lines = capsys.readouterr().out.splitlines()
    file = "\n".join(re.sub(r"^(\[\w+\]).*", r"\1", x) for x in lines if re.match(r"\S", x))
    values = tomllib.loads(file)
    assert values.pop("title") == "..."
    assert list(values) == list(section_classes())
    for section, cls in section_classes().items():
        automatic = {n: None for n, p in cls.parameters.items() if p.automatic_in_scenes}
        assert cls(**values[section]).settings == cls().settings | automatic
    assert 'Used only if method is "carved".' in " ".join(" ".join(lines).split())


def test_auto_removes_a_value_of_the_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``auto`` for --set or in the file equals a file without the key."""

    def height(text: str, *arguments: str) -> float:
        scene = tmp_path / "scene.toml"
        scene.write_text(text, encoding="utf-8")
        assert run("info", str(scene), "--json", "-q", *arguments) == 0
        return float(json.loads(capsys.readouterr().out)["warp"]["height"])

    chosen = '[weave]\nwarp_crimp_height = "0.1 mm"\n'
    assert height(chosen) == pytest.approx(1e-4)
    found = height("[weave]\n")
    assert found != pytest.approx(1e-4)
    assert height(chosen, "--set", "weave.warp_crimp_height=auto") == found
    assert height(chosen, "--set", 'weave.warp_crimp_height="auto"') == found
    assert height('[weave]\nwarp_crimp_height = "auto"\ndraft = "auto"\n') == found


@pytest.mark.parametrize("ending", [".stl", pytest.param(".ply", marks=pytest.mark.nightly)])
def test_a_missing_package_is_reported_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    assert run("export", "plain_weave", "-o", str(tmp_path / "a.vtp"), "-q") == 0
    polygons = pv.read(tmp_path / "a.vtp").n_cells
    scene = Scene.read("plain_weave")
    scene.update()
    monkeypatch.setattr("spacemap_vtk.memory.NEVER_REFUSED", 0)
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 80 * polygons)
    file = tmp_path / f"b{ending}"
    with pytest.raises(SizeError, match=f"to write {polygons} polygons as {ending} would need"):
        registry.writer(file, "surface").write(file, scene.data("surface"))
    registry.writer(file := tmp_path / "b.vtp").write(file, scene.data("surface"))
    assert pv.read(file).n_cells == polygons


def test_an_interrupt_inside_vtk_is_reported_as_stopped(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An interrupt in a callback of VTK is not caught there; VTK reports only a failure."""
    answer = Algorithm.ProcessRequest

    def interrupted(stage: Algorithm, *request: object) -> int:
        signal.raise_signal(signal.SIGINT)
        return answer(stage, *request)  # type: ignore[arg-type]

    monkeypatch.setattr(Algorithm, "ProcessRequest", interrupted)
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(SystemExit) as ended:
            main(["render", "plain_weave", "-q", "-o", str(tmp_path / "x.png")])
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, usual)
        for name in ("last_exc", "last_type", "last_value", "last_traceback"):
            vars(sys).pop(name, None)  # which keep the stages
    assert (ended.value.code, capsys.readouterr().err) == (1, "spacemap: stopped\n")
    assert list(tmp_path.iterdir()) == []
