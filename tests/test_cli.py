"""The command line as a user runs it: exit codes, messages, files."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from spacemap_vtk import WeaveSource
from spacemap_vtk.cli.main import COMMANDS, main
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.algorithm import Algorithm
from spacemap_vtk.io import registry
from spacemap_vtk.io.wif import read_wif
from spacemap_vtk.scenes.chain import sections
from spacemap_vtk.scenes.scene import Scene

SCENES = Path(__file__).parents[1] / "scenes"
SMALL = ["--size", "160x120"]


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    return int(caught.value.code or 0)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run what must be refused; return its one message."""
    assert run(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("spacemap: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


# --- what works --------------------------------------------------------------------------------


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


def test_quiet_says_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
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


def test_a_real_draft_in_its_own_colours(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "twill.png"
    assert run("render", str(SCENES / "32-shaft_twill.wif"), "-o", str(file), *SMALL) == 0
    assert "too thick to interlace" in capsys.readouterr().err
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


def test_animate_asks_for_its_encoder_before_it_reads_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert run("animate", "no_such_scene", "-o", str(tmp_path / "film.mp4")) == 1
    assert "pip install 'spacemap_vtk[movie]'" in capsys.readouterr().err


def test_storyboard_draws_two_rows(tmp_path: Path) -> None:
    file = tmp_path / "figure6.png"
    arguments = ["-o", str(file), "--times", "0,20ms,0.04", "--size", "300x200", "-q"]
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
        ("a.ply", [], 1176 * 36),
    ],
)
def test_export_can_be_read_back(tmp_path: Path, name: str, what: list[str], cells: int) -> None:
    file = tmp_path / name
    assert run("export", "plain_weave", "-o", str(file), "--time", "0.02", "-q", *what) == 0
    mesh = pv.read(file)
    # STL is single precision: at the corners of the caps some triangles collapse, and are dropped
    assert cells * (0.99 if name == "a.stl" else 1.0) <= mesh.n_cells <= cells
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


def test_modes_that_are_lost_in_rounding_are_not_called_rigid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = tmp_path / "sheet.ply"
    pv.Box((0, 50, 0, 50, 0, 3e-4)).triangulate().save(sheet)
    words = "--set", "cage.order=2", "--set", "modal.modes=8"
    assert run("modes", str(sheet), "--json", *words) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["modes"][0]["regime"] == "lost in rounding"
    assert found["modes"][0]["digits"] == 0
    assert found["modes"][7]["regime"] == "underdamped"
    assert any("lost in rounding" in text for text in found["warnings"])
    assert run("modes", str(sheet), *words) == 0
    assert "lost in rounding" in capsys.readouterr().out


def test_tables_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("modes", "plain_weave") == 0
    assert "180 degrees of freedom" in " ".join(capsys.readouterr().out.split())
    assert run("info", str(SCENES / "32-shaft_twill.wif")) == 0
    out = capsys.readouterr().out
    assert "weave angle" in out
    assert "repeat 62 x 62" in " ".join(out.split())
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
        "export",
        "modes",
        "plot",
        "info",
        "validate",
        "scenes",
        "keys",
        "materials",
        "bench",
        "paraview",
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
    name, _ = COMMANDS[command]
    module, function = name.split(":")
    doc = getattr(importlib.import_module(f"spacemap_vtk.cli.{module}"), function).__doc__
    told = inspect.cleandoc(doc).partition("\n\nParameters\n")[0]
    assert " ".join(told.split()) in " ".join(out.split())
    summary = out.strip().splitlines()[2].strip()
    assert summary == COMMANDS[command][1] == told.splitlines()[0]
    assert run("--help") == 0
    listed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert command in listed
    assert summary[:40] in listed


def test_materials_name_their_source_and_what_it_leaves_open(
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
    for section, cls in sections().items():
        assert f"[{section}]" in out
        for name in cls.parameters:
            assert f"\n{name} " in out
    assert run("keys", "cage") == 0
    out = capsys.readouterr().out
    assert "divisions" in out
    assert "[weave]" not in out


def test_keys_prints_a_scene_file_of_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    """Whoever copies a line out of it has written TOML, and changed nothing."""
    assert run("keys") == 0
    lines = capsys.readouterr().out.splitlines()
    file = "\n".join(re.sub(r"^(\[\w+\]).*", r"\1", x) for x in lines if re.match(r"\S", x))
    values = tomllib.loads(file)
    assert values.pop("title") == "..."
    assert list(values) == list(sections())
    for section, cls in sections().items():
        assert cls(**values[section]).settings == cls().settings
    assert 'Counts where method is "carved".' in " ".join(" ".join(lines).split())


def test_what_a_scene_gives_can_be_automatic_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``auto`` for --set and in the file is what the file without the key is."""

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


# --- what is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[weave\nends = 7", ["not a scene", "line 1"]),
        ("[waeve]\nends = 7", ["waeve", "[weave]", 'Did you mean "weave"?']),
        ("[weave]\nend = 7", ["weave.end", "ends, picks", 'Did you mean "ends"?']),
        ("weave = 3", ["weave = 3", "not a section"]),
        ("title = 3", ["title = 3", "not a string"]),
        ("[weave]\nends = 'many'", ['weave.ends = "many"', "not a number", "whole number"]),
        ("[weave]\nends = 0", ["weave.ends = 0", "at least 1"]),
        ("[weave]\nends = 'automatic'", ["weave.ends", "not a number", ', or "auto"']),
        ("[surface]\nsubdivisions = 'fine'", ["surface.subdivisions", ', or "auto"']),
        ("[[response.loads]]\npressure = 'auto'\non = '+z'", ["loads[0].pressure", "not a number"]),
        ("[weave]\nends = true", ["weave.ends = true", "not a number"]),
        ("[weave]\nwarp_diameter = -0.001", ["weave.warp_diameter = -0.001", "greater than 0 m"]),
        ("[weave]\nwarp_diameter = nan", ["weave.warp_diameter = nan", "not a finite number"]),
        ("[weave]\nwarp_diameter = inf", ["weave.warp_diameter = inf", "not a finite number"]),
        ("[weave]\nwarp_diameter = '1 kg'", ['unit "kg"', "mm"]),
        ("[weave]\nwarp_crimp_height = '0.51 mm'", ["weave.warp_crimp_height", "0 mm to 0.5 mm"]),
        ("[weave]\nwarp_diameter = '0.4 mm'", ["weave.warp_diameter", "jammed"]),
        ("[weave]\npattern = ['10', '0']", ["weave.pattern", "0 and 1"]),
        ("[weave]\npattern = 'plian'", ["weave.pattern", '"plain"']),
        ("[weave]\ndraft = 'no.wif'", ["weave.draft", "no.wif", "no such file", "(.wif, "]),
        ("[modal]\npoissons_ratio = 0.5", ["modal.poissons_ratio = 0.5", "less than 0.5"]),
        ("[modal]\nfixed = 'top'", ['modal.fixed = "top"', '"+y"']),
        ("[cage]\ndivisions = [5, 5]", ["cage.divisions", "[x, y, z]"]),
        ("[cage]\ndivisions = [60000, 60000, 60000]", ["cage.divisions", "GiB"]),
        ("[weave]\nends = 100000\npicks = 100000", ["weave.ends", "GiB"]),
        ("[modal]\nfixed = ''\n[response]\ninitial = 'equilibrium'", ["response.initial", "Fix"]),
        ("[view]\nsize = [1280]", ["view.size", "1 components in place of 2"]),
        ("[view]\nbackground = 'red'", ["view.background", "#rrggbb"]),
    ],
)
def test_a_bad_scene_gets_one_message_and_touches_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, parts: list[str]
) -> None:
    scene, picture = tmp_path / "bad.toml", tmp_path / "old.png"
    scene.write_text(text)
    picture.write_bytes(b"precious")
    message = refused(capsys, "render", str(scene), "-o", str(picture), *SMALL)
    assert str(scene) in message or "no.wif" in message
    for part in parts:
        assert part in message
    assert picture.read_bytes() == b"precious"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bad.toml", "old.png"]


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["render", "nowhere.toml", "-o", "a.png"], ["nowhere.toml", "no such file"]),
        (["render", "plian_weave", "-o", "a.png"], ['Did you mean "plain_weave"?']),
        (["render", "plain_weave", "-o", "a.xyz"], ["a.xyz", ".png (picture)"]),
        (["render", "plain_weave", "-o", "a"], ["names no format", ".png"]),
        (["render", "plain_weave", "-o", "no/such/a.png"], ["no/such", "mkdir"]),
        (["render", "plain_weave"], ["--output"]),
        (["render", "plain_weave", "-o", "a.png", "--size", "big"], ["--size", "1920x1080"]),
        (
            ["render", "plain_weave", "-o", "a.png", "--size", "0x10"],
            ["--size", '"0x10"', "at least 16"],
        ),
        (["render", "plain_weave", "-o", "a.png", "--size", "99999x9"], ["--size", "8192"]),
        (["render", "plain_weave", "-o", "a.png", "--time", "-1"], ["--time", "at least 0 s"]),
        (["render", "plain_weave", "-o", "a.png", "--time", "nan"], ["--time", "finite"]),
        (["render", "plain_weave", "-o", "a.png", "--set", "ends=3"], ["section.key=value"]),
        (["render", "plain_weave", "-o", "a.png", "--set", "weave.ens=3"], ["weave.ens", "ends"]),
        (["render", "plain_weave", "-o", "a.png", "--colour"], ["--colour"]),
        (["animate", "plain_weave", "-o", "a.png"], ["%04d"]),
        (["animate", "plain_weave", "-o", "a.avi"], ["a.avi", ".gif"]),
        (["animate", "plain_weave", "-o", "a.gif", "--set", "animation.stop=1e9"], ["frames"]),
        (
            ["animate", "plain_weave", "-o", "a.gif", "--set", "animation.start=3"],
            ["animation.stop"],
        ),
        (
            ["storyboard", "plain_weave", "-o", "a.png", "--times", "a,b"],
            ["--times", "a,b", "20ms"],
        ),
        (["storyboard", "plain_weave", "-o", "a.png", "--times", ""], ["--times"]),
        (["export", "plain_weave", "-o", "a.docx"], [".vtu (patches or cage)"]),
        (["export", "plain_weave", "-o", "a.vtp", "--what", "cage"], ["--what", "surface"]),
        (
            ["validate", "plain_weave", "--set", "modal.material=orthotropic"],
            ["modal.youngs_moduli", "E1, E2, E3"],
        ),
        (
            ["modes", "plain_weave", "--set", "modal.material=denin"],
            ['"tablecloth"', 'Did you mean "denim"?'],
        ),
        (["scenes", "nothing"], ["nothing", "plain_weave"]),
        (["scenes", "plian_weave"], ['Did you mean "plain_weave"?']),
        (["render", "plain_weave", "-o", "a.png", "b.png"], ['"b.png" is more', "render --help"]),
        (["render", "plain_weave", "-o"], ["-o requires", "render --help"]),
        (["render", "plain_weave", "-o", "a.png", "--bogus"], ["--bogus", "render --help"]),
        (["render", "-o", "a.png"], ["needs SCENE"]),
        (
            ["render", __file__, "-o", "a.png"],
            [
                __file__,
                "by its ending",
                ".toml, .wif, .wifw, .plm, .dtx, .wpo, .twa, .vtkhdf, .vtk, .vtu",
            ],
        ),
        (["render", "/", "-o", "a.png"], ["/: a folder"]),
        (["render", "plain_weave", "-o", f"{__file__}/a.png"], ["is a file, not a folder"]),
        (["render", "plain_weave", "-o", "a.png", "--color", "gold"], ["--color", '"clearance"']),
        (
            ["render", "plain_weave", "-o", "a.png", "--set", "object.file=no.ply"],
            ["spacemap: object.file: no.ply: no such file"],  # the scene's file is not to blame
        ),
        (["animate", "plain_weave", "-o", "f%s.png"], ["one number", "f-%04d.png"]),
        (["animate", "plain_weave", "-o", "f%d%04d.png"], ["one number", "f-%04d.png"]),
        (["export", "plain_weave", "-o", "s_%04d.vtp"], ["no series", "s_0001.vtp", "--time"]),
        (["export", "plain_weave", "-o", "s_%d.wif"], ["no series", "s_0001.wif"]),
        (["render", "plain_weave", "-o", "s_%3d.png"], ["no series", "spacemap animate"]),
        (["animate", "plain_weave", "-o", "s_%04d.mp4"], ["no series", "s_0001.mp4"]),
        (["plot", "plain_weave", "-o", "s_%04d.pdf"], ["no series", "s_0001.pdf"]),
        (["plot", "plain_weave", "-o", "a.png", "--point", "1,2"], ["--point", "1mm,0,0.2mm"]),
        (["plot", "plain_weave", "-o", "a.png", "--point", "a,b,c"], ["--point", "1mm,0,0.2mm"]),
        (["plot", "plain_weave", "-o", "a.png", "--point", "nan,0,0"], ["--point", "nan,0,0"]),
        (["modes", "basket_2"], ["basket_2.toml", "no cage", "[modal]", "--set"]),
        (["keys", "wave"], ["wave", 'Did you mean "weave"?']),
        (["rendr", "plain_weave"], ["render"]),
    ],
)
def test_a_bad_command_gets_one_message(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    parts: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    message = refused(capsys, *arguments)
    for part in parts:
        assert part in message
    assert list(tmp_path.iterdir()) == []


_TRIANGLE = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


@pytest.mark.parametrize(
    ("name", "content", "parts"),
    [
        ("a.ply", b"ply\nformat ascii 1.0\n", ["header", "Write the file again"]),
        ("a.ply", b"", ["the file is empty"]),
        ("a.stl", b"\x00\x01\x02\xff", ["truncated", "Write the file again"]),
        ("a.vtu", b"\x00\x01\x02\xff", ["damaged", "Write the file again"]),
        ("a.obj", b"\x00\x01\x02\xff", ["no points"]),
        ("a.glb", b"\x00\x01\x02\xff", ["no binary glTF"]),
        ("a.vtk", b"\x00\x01\x02\xff", ["no legacy .vtk file"]),
        ("a.wif", b"\x00\x01\x02\xff", ["line 1", "WIF"]),
        ("a.wif", b"", ["line 1", "WIF"]),
        ("a.toml", b"\x00\x01\x02\xff", ["line 1 has a byte 0xff", "UTF-8"]),
        ("a.toml", 'title = "a"\n\n# é'.encode("latin-1"), ["line 3 has a byte 0xe9", "UTF-8"]),
        ("a.toml", b"\xef\xbb\xbf[weave]", ["byte order mark", "without BOM"]),
    ],
)
def test_a_broken_file_is_named_once(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: bytes,
    parts: list[str],
) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    message = refused(capsys, "render", str(file), "-o", str(tmp_path / "a.png"), *SMALL)
    assert message.startswith(f"spacemap: {file}: ")
    assert message.count(str(file)) == 1
    for part in parts:
        assert part in message
    for noise in ("0x5", "vtkInformation", "Reference Count", "codec", "object.file"):
        assert noise not in message
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[object]\nfile = 'a.vtu'", ["object.file: ", "a.vtu: damaged"]),
        ("[object]\nfile = '.'", ["object.file: ", "a folder"]),
        ("[object]\nfile = 'a.bin'", ["object.file: ", "a.bin: no mesh, by its ending", ".stl"]),
        ("[object]\nfile = 'tri.ply'\ntexture = 'a.vtu'", ["object.texture: ", "no picture"]),
        ("[weave]\ndraft = '.'", ['weave.draft = "', "a folder", "(.wif, "]),
        ("[cage]\nmethod = 'file'", ["cage.file: ", "needs a file"]),
        ("[cage]\nmethod = 'file'\nfile = 'no.vtu'", ["cage.file: ", "no.vtu: no such file"]),
        ("[cage]\nmethod = 'file'\nfile = 'tri.ply'", ["cage.file: ", "no volume mesh", "tetwild"]),
        ("[motion]\nfile = 'a.pvd'", ["motion.file: ", "a.pvd: no ParaView collection"]),
        ("[modal]\nfixed = 'mask(foo)'", ["modal.fixed: ", '"foo"']),
        (
            "[response]\ninitial_velocity_array = 'foo'",
            ["response.initial_velocity_array: ", '"foo"', '"nodal_mass"'],
        ),
        ("[response]\ndamping_ratio = 0.1\nalpha = 3", ["response.damping_ratio = 0.1: "]),
        ("[response]\nloads = [3]", ["response.loads[0] = 3: ", "pressure"]),
        ("[weave]\nwarp_diameter = '0,3 mm'", ['value 1, "0": out of range']),
        ("[weave]\nwarp_diameter = 0.3 mm", ["line 2", "quotes"]),
        ("[weave]\nends = 3\nends = 4\n", ["line 3", "Mend that line"]),
    ],
)
def test_a_file_that_a_scene_names_is_named_with_its_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, parts: list[str]
) -> None:
    for name in ("a.vtu", "a.bin", "a.pvd"):
        (tmp_path / name).write_bytes(b"\x00\x01")
    (tmp_path / "tri.ply").write_bytes(_TRIANGLE)
    scene = tmp_path / "bad.toml"
    scene.write_text(text)
    message = refused(capsys, "render", str(scene), "-o", str(tmp_path / "new.png"), *SMALL)
    assert message.startswith(f"spacemap: {scene}: ")
    assert message.count(str(scene)) == 1
    for part in parts:
        assert part in message
    assert not (tmp_path / "new.png").exists()


def test_modes_of_a_still_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "still.toml"
    scene.write_text("[weave]\nends = 2\npicks = 2\n")
    assert "[modal]" in refused(capsys, "modes", str(scene))
    arguments = ["-o", str(tmp_path / "c.vtu"), "--what", "cage"]
    assert "cage" in refused(capsys, "export", str(scene), *arguments)


def test_a_missing_library_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from spacemap_vtk.draw import graphics

    monkeypatch.setattr(graphics, "can_load", lambda name: False)
    target = tmp_path / "a.png"
    assert run("render", "plain_weave", "-o", str(target)) == 1
    assert "apt-get install libegl1 libgl1" in capsys.readouterr().err
    assert not target.exists()


def test_a_film_that_breaks_off_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from spacemap_vtk.draw.picture import Picture

    real, count = Picture.draw, []

    def failing(self: Picture, time: float) -> np.ndarray:
        count.append(time)
        if len(count) == 3:
            raise KeyboardInterrupt
        return real(self, time)

    monkeypatch.setattr(Picture, "draw", failing)
    old = tmp_path / "f0000.png"
    old.write_bytes(b"precious")
    arguments = ["-o", str(tmp_path / "f%04d.png"), "--size", "32x32", "-q"]
    assert run("animate", "plain_weave", *arguments) == 1
    assert old.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [old]


def test_info_tells_mass_intervals_and_clearance(capsys: pytest.CaptureFixture[str]) -> None:
    # by hand: 30 tex in both families, 20 to the cm, no crimp: 2 x 30 g/km x 2000 /m = 120 g/m2
    yarns = ["weave.warp_count=30 tex", "weave.weft_count=30 tex", "weave.weft_crimp=0"]
    arguments = [word for assignment in yarns for word in ("--set", assignment)]
    assert run("info", "plain_weave", "--json", *arguments) == 2
    assert "warp_diameter and warp_count" in capsys.readouterr().err
    assert run("info", "twill_2_2", "--json", "--set", "weave.weft_crimp=0") == 0
    figures = json.loads(capsys.readouterr().out)
    warp, weft = figures["warp"], figures["weft"]
    assert weft["crimp"] == pytest.approx(0.0, abs=1e-12)
    assert warp["tex"] == pytest.approx(30.0)
    mass = 0.1 * 30 * (24 * (1 + warp["mean_crimp"]) + 22)
    assert 1e3 * figures["areal_mass"] == pytest.approx(mass)
    # the fibres' share of the volume is their mass over their density and the thickness
    assert figures["fibre_volume_fraction"] == pytest.approx(
        figures["areal_mass"] / 1520 / figures["thickness"]
    )
    assert figures["feasible"]["warp_crimp"][0] == 0.0
    assert figures["feasible"]["warp_spacing"][1] is None
    assert "warp_diameter" in figures["feasible"]
    assert figures["memory_bytes"] > 1e5
    # one cubic misses a quarter circle by 2.7e-4, and adds what its arcs along the yarn are off
    assert 2.7e-4 < figures["radial_error"] < 4e-4
    assert figures["warnings"] == []


def test_info_of_a_moved_fabric(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "plain_weave", "--json", "--time", "0 s", "-q") == 0
    figures = json.loads(capsys.readouterr().out)
    diameter = figures["warp"]["diameter"]
    # at rest patches touch, but for what a cubic misses of an arc
    assert abs(figures["deformed_clearance"]["distance"]) < 1e-3 * diameter
    assert run("info", "plain_weave", "--time", "0.02", "-q") == 0
    assert "when deformed" in capsys.readouterr().out
    assert run("info", "basket_2", "--time", "0.02") == 2
    assert "does not move" in capsys.readouterr().err


def test_a_draft_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "twill.wif"
    assert run("export", "twill_2_2", "-o", str(file), "-q") == 0
    assert run("info", str(file), "--json") == 0
    again = json.loads(capsys.readouterr().out)
    assert run("info", "twill_2_2", "--json") == 0
    first = json.loads(capsys.readouterr().out)
    assert again["drawdown"] == first["drawdown"]
    for family in ("warp", "weft"):
        for name in ("diameter", "spacing", "theta_deg", "crimp"):
            assert again[family][name] == pytest.approx(first[family][name], rel=1e-12)


def test_what_is_odd_about_a_draft_is_told_when_it_is_exported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, again = tmp_path / "odd.wif", tmp_path / "again.wif"
    assert run("export", "twill_2_2", "-o", str(file), "-q") == 0
    file.write_text(file.read_text().replace("Units=Centimeters", "Units=mm"))  # not the standard's
    assert run("info", str(file), "--json") == 0
    told = json.loads(capsys.readouterr().out)["warnings"]
    assert any("Units=mm is not of the standard" in warning for warning in told)
    assert run("export", str(file), "-o", str(again)) == 0
    said = capsys.readouterr().err.splitlines()
    assert said == [f"spacemap: warning: {warning}" for warning in told]
    assert run("export", str(file), "-o", str(again), "-q") == 0
    assert capsys.readouterr().err == ""


_LOOM = """[WIF]
Version=1.1
[WEAVING]
Shafts=2
Treadles=2
Rising Shed=true
[COLOR PALETTE]
Range=0,255
[COLOR TABLE]
1=255,0,0
2=0,0,255
[WARP]
Threads=6
Color=1
Units=centimeters
Spacing={spacing}
Thickness={thickness}
[WEFT]
Threads=4
Color=2
Units=centimeters
Spacing=0.1
Thickness={weft}
[THREADING]
1=1
2=2
3=1
4=2
5=1
6=1
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
3=1
4=2
{more}"""
#: Drafts of our own whose yarns have no room, and what is said of each.
_NO_ROOM = {
    # a slip of units: 90 cm thick, half a millimetre apart
    "all too thick": ("0.05", "90", "0.05", "", "warp yarns overlap: they are 900 mm thick"),
    "two too near": (
        "0.01",
        "0.1",
        "0.05",
        "[WARP THICKNESS]\n1=0.5\n2=0.05\n3=1\n4=50\n5=1\n6=0.01\n",
        "neighbouring warp yarns 1 and 2 overlap",
    ),
    # no spacing: yarns side by side
    "jammed": (
        "0",
        "5",
        "0",
        "[WARP THICKNESS]\n1=1\n2=0.01\n3=0.001\n4=0.001\n5=5\n6=0.5\n"
        "[WEFT SPACING]\n1=0.01\n2=0.001\n3=1\n4=1\n",
        "jammed at every warp_crimp_height",
    ),
}


@pytest.mark.parametrize("kind", _NO_ROOM)
def test_a_draft_without_room_for_its_yarns_is_a_draft(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    spacing, thickness, weft, more, why = _NO_ROOM[kind]
    file, copy = tmp_path / "draft.wif", tmp_path / "copy.wif"
    file.write_text(_LOOM.format(spacing=spacing, thickness=thickness, weft=weft, more=more))
    assert why in refused(capsys, "render", str(file), "-o", str(tmp_path / "a.png"), *SMALL)

    assert run("export", str(file), "-o", str(copy)) == 0
    first, again = read_wif(file), read_wif(copy)
    said = [f"spacemap: warning: {text}" for text in first.warnings]
    assert capsys.readouterr().err.splitlines() == said
    assert again.loom == first.loom
    np.testing.assert_array_equal(again.drawdown, first.drawdown)
    assert np.shape(again.warp.thickness) == np.shape(first.warp.thickness)
    assert again.warp.thickness == pytest.approx(first.warp.thickness, rel=1e-12)

    assert run("info", str(file), "--json", "-q") == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["ends"], figures["picks"]) == (6, 4)
    assert figures["drawdown"] == ["101011", "010100", "101011", "010100"]
    assert figures["threading"] == [[1], [2], [1], [2], [1], [1]]
    assert (figures["shafts"], figures["treadles"]) == (2, 2)
    assert any("no room for its yarns" in text and why in text for text in figures["warnings"])
    for family, color, longest in (("warp", "#ff0000", 1), ("weft", "#0000ff", 2)):
        for name in ("theta_deg", "length", "crimp", "height"):
            assert figures[family][name] is None
        assert figures[family]["colors"] == [color]
        assert figures[family]["longest_float"] == longest
    assert run("info", str(file)) == 0
    said = capsys.readouterr()
    assert "–" in said.out
    assert why in said.err

    assert run("validate", str(file)) == 0
    said = capsys.readouterr()
    assert "valid" in said.out
    assert why in said.err
    # What a scene asks of it is another matter.
    scene = tmp_path / "scene.toml"
    scene.write_text('[weave]\ndraft = "draft.wif"\n')
    assert why in refused(capsys, "validate", str(scene), "-q")
    changed = ["--set", "weave.weft_color=#102030"]
    assert why in refused(capsys, "validate", str(file), "-q", *changed)


def test_a_draft_too_large_to_be_made_whole_is_drawn_and_told_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, copy = tmp_path / "large.wif", tmp_path / "copy.wif"
    words = ["--set", "weave.ends=150", "--set", "weave.picks=150"]
    assert run("export", "basket_2", "-o", str(file), "-q", *words) == 0
    monkeypatch.setattr("spacemap_vtk.memory.available", lambda: 100_000_000)
    few = ["--size", "200x150", "--set", "animation.stop=0.1"]
    for picture in ("render", "animate"):
        output = tmp_path / ("a.png" if picture == "render" else "a.gif")
        assert (
            run(picture, str(file), "-o", str(output), *few[: 2 if picture == "render" else 4]) == 0
        )
        assert "drawn as a sheet: a yarn is" in capsys.readouterr().err
    message = refused(capsys, "export", str(file), "-o", str(tmp_path / "a.vtp"), "-q")
    assert "weave.ends = 150: a weave of 150 x 150 yarns would need about 0." in message
    assert run("validate", str(file)) == 0
    assert "too large to be made whole" in capsys.readouterr().err
    assert run("export", str(file), "-o", str(copy)) == 0
    np.testing.assert_array_equal(read_wif(copy).drawdown, read_wif(file).drawdown)
    capsys.readouterr()
    assert run("info", str(file), "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["ends"] == 150
    assert figures["warp"]["theta_deg"] > 0
    assert abs(figures["least_clearance"]["distance"]) < 1e-12  # of crops in which all occurs
    assert "too large to be made whole" in " ".join(figures["warnings"])


def test_info_counts_what_is_built_and_builds_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    built = WeaveSource(pattern="twill 3/1", ends=24, picks=18, warp_section="racetrack")
    built.update()
    grid = built.GetOutputDataObject(0)
    monkeypatch.setattr(WeaveSource, "run", None)
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[weave]\npattern = "twill 3/1"\nends = 24\npicks = 18\nwarp_section = "racetrack"\n'
    )
    assert run("info", str(scene), "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["patches"] == grid.GetNumberOfCells()
    assert figures["control_points"] == grid.GetNumberOfPoints()
    assert figures["memory_bytes"] == pytest.approx(1024 * grid.GetActualMemorySize(), rel=0.01)
    error = grid.GetFieldData().GetArray("radial_error").GetValue(0)
    assert figures["radial_error"] == pytest.approx(error)


@pytest.mark.parametrize("ending", [".stl", ".ply"])
def test_what_a_writer_needs_is_asked_for_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    assert run("export", "plain_weave", "-o", str(tmp_path / "a.vtp"), "-q") == 0
    polygons = pv.read(tmp_path / "a.vtp").n_cells
    scene = Scene.read("plain_weave")
    scene.update()
    monkeypatch.setattr("spacemap_vtk.memory.SMALL", 0)
    monkeypatch.setattr("spacemap_vtk.memory.available", lambda: 100 * polygons)
    with pytest.raises(SizeError, match=f"to write {polygons} polygons as {ending} would need"):
        registry.writer(file := tmp_path / f"b{ending}").write(file, scene.data("surface"))
    registry.writer(file := tmp_path / "b.vtp").write(file, scene.data("surface"))
    assert pv.read(file).n_cells == polygons


def test_an_interrupt_between_vtk_and_python_is_told_as_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where VTK has just called, nothing catches it, and VTK knows of a failure only."""
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
    assert (ended.value.code, capsys.readouterr().err) == (1, "spacemap: stopped\n")
    assert list(tmp_path.iterdir()) == []
