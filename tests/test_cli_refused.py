"""Refused input of the command line gives one message and changes no file."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_cli import SMALL, refused, run

from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.reading import read_with_vtk
from spacemap_vtk.scenes import library


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[weave\nends = 7", ["not a scene", "line 1"]),
        ("[waeve]\nends = 7", ["waeve", "[weave]", 'Did you mean "weave"?']),
        ("[weave]\nend = 7", ["weave.end", "ends, picks", 'Did you mean "ends"?']),
        ("weave = 3", ["weave = 3", "must be a section"]),
        ("title = 3", ["title = 3", "must be a string"]),
        ("[weave]\nends = 'many'", ['weave.ends = "many"', "must be a number", "whole number"]),
        ("[weave]\nends = 0", ["weave.ends = 0", "at least 1"]),
        ("[weave]\nends = 'automatic'", ["weave.ends", "must be a number", ', or "auto"']),
        ("[surface]\nsubdivisions = 'fine'", ["surface.subdivisions", ', or "auto"']),
        (
            "[[response.loads]]\npressure = 'auto'\non = '+z'",
            ["loads[0].pressure", "must be a number"],
        ),
        ("[weave]\nends = true", ["weave.ends = true", "must be a number"]),
        ("[weave]\nwarp_diameter = -0.001", ["weave.warp_diameter = -0.001", "greater than 0 m"]),
        ("[weave]\nwarp_diameter = nan", ["weave.warp_diameter = nan", "must be finite"]),
        ("[weave]\nwarp_diameter = inf", ["weave.warp_diameter = inf", "must be finite"]),
        ("[weave]\nwarp_diameter = '1 kg'", ['unit "kg"', "mm"]),
        ("[weave]\nwarp_crimp_height = '0.51 mm'", ["weave.warp_crimp_height", "0 mm to 0.5 mm"]),
        ("[weave]\nwarp_diameter = '0.4 mm'", ["weave.warp_diameter", "jammed"]),
        (
            "[weave]\nwarp_sett = '20 /cm'\nwarp_spacing = '1 mm'",
            ['weave.warp_sett = "20 /cm"', "--set weave.warp_sett=auto"],
        ),
        (f"title = {'[' * 5000}", ["not a scene", "brackets are nested"]),
        (f"[weave]\nends = {'9' * 5000}", ["not a scene", "thousands of digits"]),
        (f"[weave]\ndraft = '{'a' * 300}.wif'", ["weave.draft", "no such file"]),
        (f"[object]\nfile = '{'a' * 300}.ply'", ["object.file", "no such file"]),
        (f"[motion]\nfile = '{'a' * 300}.pvd'", ["motion.file", "no such file"]),
        ("[weave]\npattern = ['10', '0']", ["weave.pattern", "0 and 1"]),
        ("[weave]\npattern = 'plian'", ["weave.pattern", '"plain"']),
        ("[weave]\ndraft = 'no.wif'", ["weave.draft", "no.wif", "no such file", "(.wif, "]),
        ("[modal]\npoissons_ratio = 0.5", ["modal.poissons_ratio = 0.5", "less than 0.5"]),
        ("[modal]\nfixed = 'top'", ['modal.fixed = "top"', '"+y"']),
        ("[cage]\ndivisions = [5, 5]", ["cage.divisions", "[x, y, z]"]),
        ("[cage]\ndivisions = [60000, 60000, 60000]", ["cage.divisions", "GiB"]),
        ("[weave]\nends = 100000\npicks = 100000", ["weave.ends", "GiB"]),
        ("[modal]\nfixed = ''\n[response]\ninitial = 'equilibrium'", ["response.initial", "Fix"]),
        ("[view]\nsize = [1280]", ["view.size", "must have 2 components, not 1"]),
        ("[view]\nbackground = 'red'", ["view.background", "#rrggbb"]),
    ],
)
def test_a_bad_scene_gives_one_message_and_writes_nothing(
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
        (["render", "plain_weave", "-o", "a"], ["needs an ending", ".png"]),
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
        (["animate", "twill_2_2", "-o", "a.gif"], ["nothing in this scene moves", "[response]"]),
        (["animate", "twill_2_2", "-o", "f%04d.png"], ["nothing in this scene moves"]),
        (["animate", "plain_weave", "-o", "a.gif", "--set", "animation.stop=1e9"], ["frames"]),
        (["animate", "plain_weave", "-o", "a.gif", "--workers", "0"], ["--workers = 0"]),
        (
            ["animate", "plain_weave", "-o", "a.gif", "--set", "animation.start=3"],
            ["animation.stop"],
        ),
        (
            ["storyboard", "plain_weave", "-o", "a.png", "--times", "a,b"],
            ["--times", "a,b", "20ms"],
        ),
        (["storyboard", "plain_weave", "-o", "a.png", "--times", ""], ["--times"]),
        (
            ["render", "plain_weave", "-o", "a.png", "--time", "0", "--time", "1"],
            ["--time can be given only once", '"spacemap figure"'],
        ),
        (["render", "plain_weave", "-o", "a.png", "--time", "0,1"], ["several", "spacemap figure"]),
        (
            ["render", "plain_weave", "-o", "a.png", "--times", "0,1"],
            ["--times", "spacemap figure"],
        ),
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
        (
            ["render", "plain_weave", "-o", "a.png", "b.png"],
            ['does not accept "b.png"', "render --help"],
        ),
        (["render", "plain_weave", "-o"], ["-o requires", "render --help"]),
        (["render", "plain_weave", "-o", "a.png", "--bogus"], ["--bogus", "render --help"]),
        (["render", "-o", "a.png"], ["needs SCENE"]),
        # An unknown option comes first; what it should have been may be what is missing.
        (["render", "a.wif", "--drap"], ["Unknown option: --drap. Did you mean --drape?"]),
        (["render", "a.wif", "-O", "b.png"], ["Unknown option: -O"]),
        (["render", "a.wif"], ["needs --output, for example -o picture.png"]),
        (["render", "a.wif", "b.png"], ["needs --output, for example -o b.png"]),
        (
            ["render", __file__, "-o", "a.png"],
            [
                __file__,
                "the ending is not that of a scene, draft, mesh or textile",
                ".toml, .wif, .wifw, .plm, .dtx, .wpo, .twa, .vtu, .vtp, .vtkhdf, .vtk",
            ],
        ),
        (["render", "/", "-o", "a.png"], ["/: a folder"]),
        (["render", "plain_weave", "-o", f"{__file__}/a.png"], ["is a file, not a folder"]),
        (["render", "plain_weave", "-o", "a.png", "--color", "gold"], ["--color", '"clearance"']),
        (
            ["render", "plain_weave", "-o", "a.png", "--set", "weave.draft=no.wif"],
            ['spacemap: weave.draft = "no.wif": no such file'],  # the scene's file is not to blame
        ),
        (
            ["render", "plain_weave", "-o", "a.png", "--set", "textile.file=x.tg3"],
            [
                'spacemap: textile.file = "x.tg3": the scene has a section [weave]',
                'Open the file alone, as with "spacemap render x.tg3 -o picture.png".',
            ],
        ),
        (
            ["info", "stockinette", "--set", "weave.pattern=plain"],
            ["weave.pattern", "the scene has a section [textile]", '(see "spacemap scenes")'],
        ),
        (["animate", "plain_weave", "-o", "f%s.png"], ["one number", "f-%04d.png"]),
        (["animate", "plain_weave", "-o", "f%d%04d.png"], ["one number", "f-%04d.png"]),
        (["export", "plain_weave", "-o", "s_%d_%d.vtp"], ["one number", "s-%04d.vtp"]),
        (["export", "plain_weave", "-o", "s_%i.glb"], ["one number", "s-%04d.glb"]),
        (["export", "plain_weave", "-o", "s_%d.pvd"], ["not a numbered series", "s_0001.pvd"]),
        (["export", "plain_weave", "-o", "s_%d.wif"], ["not a numbered series", "s_0001.wif"]),
        (
            ["render", "plain_weave", "-o", "s_%3d.png"],
            ["not a numbered series", "spacemap animate"],
        ),
        (["animate", "plain_weave", "-o", "s_%04d.mp4"], ["not a numbered series", "s_0001.mp4"]),
        (["plot", "plain_weave", "-o", "s_%04d.pdf"], ["not a numbered series", "s_0001.pdf"]),
        (["plot", "plain_weave", "-o", "a.png", "--point", "1,2"], ["--point", "1mm,0,0.2mm"]),
        (["plot", "plain_weave", "-o", "a.png", "--point", "a,b,c"], ["--point", "1mm,0,0.2mm"]),
        (["plot", "plain_weave", "-o", "a.png", "--point", "nan,0,0"], ["--point", "nan,0,0"]),
        (["modes", "basket_2"], ["basket_2.toml", "no cage", "[modal]", "--set"]),
        (["keys", "wave"], ["wave", 'Did you mean "weave"?']),
        (["rendr", "plain_weave"], ["render"]),
    ],
)
def test_a_bad_command_gives_one_message(
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
        pytest.param(
            "a.vtu",
            b"\x00\x01\x02\xff",
            ["damaged", "Write the file again"],
            marks=pytest.mark.nightly,
        ),
        ("a.obj", b"\x00\x01\x02\xff", ["no points"]),
        ("a.glb", b"\x00\x01\x02\xff", ["not a binary glTF"]),
        ("a.vtk", b"\x00\x01\x02\xff", ["not a legacy .vtk file"]),
        ("a.wif", b"\x00\x01\x02\xff", ["line 1", "WIF"]),
        ("a.wif", b"", ["line 1", "WIF"]),
        ("a.toml", b"\x00\x01\x02\xff", ["line 1 has a byte 0xff", "UTF-8"]),
        ("a.toml", 'title = "a"\n\n# é'.encode("latin-1"), ["line 3 has a byte 0xe9", "UTF-8"]),
        ("a.toml", b"\xef\xbb\xbf[weave]", ["byte order mark", "without BOM"]),
    ],
)
def test_a_message_names_a_damaged_file_once(
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
        pytest.param(
            "[object]\nfile = 'a.bin'",
            ["object.file: ", "a.bin: the ending is not that of a mesh", ".stl"],
            marks=pytest.mark.nightly,
        ),
        ("[object]\nfile = 'tri.ply'\ntexture = 'a.vtu'", ["object.texture: ", "not a picture"]),
        ("[weave]\ndraft = '.'", ['weave.draft = "', "a folder", "(.wif, "]),
        ("[cage]\nmethod = 'file'", ["cage.file: ", "needs a file"]),
        ("[cage]\nmethod = 'file'\nfile = 'no.vtu'", ["cage.file: ", "no.vtu: no such file"]),
        (
            "[cage]\nmethod = 'file'\nfile = 'tri.ply'",
            ["cage.file: ", "is not a volume mesh", "tetwild"],
        ),
        ("[motion]\nfile = 'a.pvd'", ["motion.file: ", "a.pvd: not a ParaView collection"]),
        ("[modal]\nfixed = 'mask(foo)'", ["modal.fixed: ", '"foo"']),
        (
            "[response]\ninitial_velocity_array = 'foo'",
            ["response.initial_velocity_array: ", '"foo"', '"nodal_mass"'],
        ),
        ("[response]\ndamping_ratio = 0.1\nalpha = 3", ["response.damping_ratio = 0.1: "]),
        ("[response]\nloads = [3]", ["response.loads[0] = 3: ", "pressure"]),
        ("[weave]\nwarp_diameter = '0,3 mm'", ['value 1, "0": out of range']),
        ("[weave]\nwarp_diameter = 0.3 mm", ["line 2", "quotes"]),
        ("[weave]\nends = 3\nends = 4\n", ["line 3", "Correct that line"]),
    ],
)
def test_an_error_in_a_file_of_a_scene_names_its_key(
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


def test_modes_of_a_still_scene_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "still.toml"
    scene.write_text("[weave]\nends = 2\npicks = 2\n")
    assert "[modal]" in refused(capsys, "modes", str(scene))
    arguments = ["-o", str(tmp_path / "c.vtu"), "--what", "cage"]
    assert "cage" in refused(capsys, "export", str(scene), *arguments)


def test_a_failed_print_is_reported_once() -> None:
    # Python buffers its output, and would report the failure at its end.
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    command = [sys.executable, "-m", "spacemap_vtk", "scenes"]
    with open("/dev/full", "wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, env=kept, text=True)
    assert done.returncode == 1
    assert done.stderr == ("spacemap: the output could not be printed: no space left on device\n")


@pytest.mark.nightly
def test_closed_streams_do_not_spoil_the_output_file(tmp_path: Path) -> None:
    # A file takes the number of a closed stream, and a library prints into it.
    file = tmp_path / "a.csv"
    command = [sys.executable, "-m", "spacemap_vtk", "export", "plain_weave"]
    words = shlex.join([*command, "-o", str(file)])
    done = subprocess.run(f"{words} <&- >&- 2>&-", shell=True, check=True)
    assert done.returncode == 0
    assert file.read_text().count("\n") > 9


@pytest.mark.nightly
def test_unencodable_characters_are_printed_as_question_marks() -> None:
    command = [sys.executable, "-m", "spacemap_vtk", "keys", "weave"]
    few = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, env=few, capture_output=True, text=True, check=True)
    assert "bicubic B?zier patches" in done.stdout


def test_an_unreadable_file_is_reported(
    folder_of_nobody: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def forbidden() -> Path:
        raise PermissionError("as where the program lies in a folder of mode 700")

    monkeypatch.setattr(library, "folder", forbidden)
    file = folder_of_nobody / "a.wif"
    file.touch(mode=0)
    printed = "a.wif: permission denied. Check its permissions, or choose another file."
    with pytest.raises(SystemExit, match="2"):
        main(["info", str(file)])
    assert printed in capsys.readouterr().err
    with pytest.raises(InputError, match=r"file: .*a.wif: permission denied"):
        registry.require_file(file)
    (folder_of_nobody / "locked").mkdir(mode=0)
    with pytest.raises(InputError, match=r"locked/a.wif: permission denied"):
        library.find(folder_of_nobody / "locked/a.wif")


def test_a_mesh_deleted_while_it_is_read_is_not_called_damaged(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.vtu: the file was removed while it was read"):
        read_with_vtk(tmp_path / "a.vtu", "vtkIOXML", "vtkXMLUnstructuredGridReader")


def test_a_missing_library_is_named(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    # What draws without OpenGL is compiled.
    lacking = {"SPACEMAP_OPENGL": "never", "SPACEMAP_COMPILED": "never"}
    command = [sys.executable, "-m", "spacemap_vtk", "render", "plain_weave", "-o", str(target)]
    done = subprocess.run(
        command, env={**os.environ, **lacking}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.startswith("spacemap: libEGL.so.1 and libGL.so.1 not found: pictures need")
    assert "apt-get install libegl1 libgl1" in done.stderr
    assert not target.exists()


def test_a_library_missing_for_mitsuba_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # as its wheel does: the error that names the library is lost behind another one
    (tmp_path / "mitsuba.py").write_text(
        "try:\n    raise ImportError('libatomic.so.1: cannot open shared object file')\n"
        "except ImportError:\n    _drjit_ext\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mitsuba", raising=False)
    target = tmp_path / "a.png"
    assert run("render", "plain_weave", "-o", str(target), "--raytrace") == 1
    printed = capsys.readouterr().err
    assert "libatomic.so.1: cannot open" in printed
    assert "apt-get install libatomic1" in printed
    assert not target.exists()


def test_a_failed_film_leaves_the_earlier_one(
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
    assert {path.name for path in tmp_path.iterdir()} == {old.name, "f%04d.png.frames"}
