"""Repeat commands from the records in files; a forged record reads no other file."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
import pyvista as pv

from spacemap_vtk import __version__
from spacemap_vtk.cli.main import app, main
from spacemap_vtk.cli.remake import describe_record
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.provenance import NAME, Record
from spacemap_vtk.jobs import job_from_json


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


def test_again_repeats_a_command_from_the_same_input_files(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "drafts").mkdir()
    draft, scene = tmp_path / "drafts" / "a.txt", tmp_path / "a.toml"
    draft.write_text("110\n011\n101\n")
    scene.write_text('[weave]\ndraft = "drafts/a.txt"\n[surface]\nsubdivisions = 1\n')
    file, other = tmp_path / "a.vtp", tmp_path / "a-again.vtp"
    assert run("export", scene, "-o", file, "-q", "--set", "weave.ends=4") == 0
    assert run("info", file) == 0
    printed = capsys.readouterr().out
    assert f"made by spacemap_vtk {__version__}\ncommand: spacemap export a.toml" in printed
    assert re.search(r"input: drafts/a\.txt, sha256 [0-9a-f]{16}…", printed)
    assert run("again", file) == 0
    printed = capsys.readouterr().out
    assert f"reads {draft}\nwrites {other}\n" in printed
    assert other.read_bytes() == file.read_bytes()
    # An existing file is kept unless --force is given; other values give another file.
    assert run("again", file) == 2
    assert "a-again.vtp exists. Choose another --output" in capsys.readouterr().err
    assert run("again", file, "--force", "--set", "weave.ends=5", "-q") == 0
    assert pv.read(other).n_cells > pv.read(file).n_cells
    assert run("again", file, "--check") == 0
    assert run("again", file, "--check", "--set", "weave.overhang=0.4mm", "-q") == 1
    assert "points differ by up to" in capsys.readouterr().err
    # After a move, --folder names the scene's folder; a changed input file is refused.
    (tmp_path / "b").mkdir()
    moved = file.rename(tmp_path / "b" / "a.vtp")
    assert run("again", moved, "--check", "-q") == 2
    assert "is missing. Restore it" in capsys.readouterr().err
    assert run("again", moved, "--check", "-q", "--folder", tmp_path) == 0
    draft.write_text("110\n011\n100\n")
    assert run("again", moved, "--check", "-q", "--folder", tmp_path) == 2
    assert "has changed" in capsys.readouterr().err
    assert run("again", scene) == 2
    assert "does not state how it was made" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "printed"),
    [
        ({"scene": '[weave]\ndraft = "../secret.wif"\n'}, "not among its input files"),
        ({"scene": '[motion]\nfile = "../s*.vtu"\n'}, "not among its input files"),
        ({"scene": '[[response.loads]]\nfile = "../secret.wif"\n'}, "not among its input files"),
        ({"inputs": {"../secret.wif": "0" * 64}}, "has changed"),
        ({"order": {"what": "painted", "nothing": 1}}, "invalid description of a job"),
        ({"order": {"what": "painted", "times": "soon"}}, "invalid description of a job"),
        ({"order": ["picture"]}, "damaged"),
        ({"scene": "= ["}, "damaged"),
    ],
)
def test_a_forged_record_reads_no_other_file(
    tmp_path: Path, capsys: Any, change: dict[str, Any], printed: str
) -> None:
    for name in ("secret.wif", "s1.vtu"):
        (tmp_path / name).write_text("[WIF]\nsecret words\n")
    (tmp_path / "in").mkdir()
    record = {"version": "9.9", "order": {"what": "painted"}, "scene": "[weave]\n", "file": "/a/b"}
    text = json.dumps({**record, "times": [], "inputs": {}, **change})
    file = tmp_path / "in" / "a.obj"
    file.write_text(f"# {NAME}: {text}|\n")
    words = "again", file, "-o", tmp_path / "in" / "b.obj", "-q", "--folder", tmp_path / "in"
    assert run(*words) == 2
    reported = capsys.readouterr().err
    assert printed in reported
    assert "secret words" not in reported
    assert [path.name for path in (tmp_path / "in").iterdir()] == ["a.obj"]


@pytest.mark.parametrize("name", ["a.inp", "a.glb"])
def test_check_finds_a_changed_material(tmp_path: Path, capsys: Any, name: str) -> None:
    """The mesh and the mode shapes stay the same."""
    words = "--set", "weave.ends=2", "--set", "weave.picks=2", "--set", "modal.modes=1"
    more = ("--modes",) if name == "a.glb" else ()
    file = tmp_path / name
    assert run("export", "plain_weave", "-o", file, "-q", *words, *more) == 0
    file.write_bytes(file.read_bytes().replace(__version__.encode(), b"0.0.1"))
    assert run("again", file, "--check") == 0
    assert run("again", file, "--check", "-q", "--set", "modal.youngs_modulus=2 kPa") == 1
    assert re.search(r"\d lines differ", capsys.readouterr().err)


def test_info_of_a_mesh_needs_no_library_for_its_record(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, other = tmp_path / "a.vtkhdf", tmp_path / "a.usdc"
    small = "--set", "weave.ends=2", "--set", "weave.picks=2", "--set", "surface.subdivisions=1"
    assert run("export", "plain_weave", "-o", mesh, "-q", "--times", "0", *small) == 0
    other.write_bytes(b"PXR-USDC")
    for library in ("h5py", "pxr"):
        monkeypatch.setitem(sys.modules, library, None)
    assert run("info", mesh) == 0
    assert re.search(r"data +vtkPolyData", capsys.readouterr().out)
    for command, file, extra in (("again", mesh, "hdf5"), ("info", other, "usd")):
        assert run(command, file) == 1
        assert f"pip install 'spacemap_vtk[{extra}]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "asked",
    [
        {"what": "picture", "samples": 9, "size": [64, 48], "place": [[0, 0, 1]], "framed": True},
        {"what": "shapes"},
        {"what": "biaxial"},
        {"what": "reactions", "over": "time"},
        {"what": "storyboard", "times": [0.0, 0.1], "motions": ["response", "transient"]},
        {"what": "figure", "panels": ["draft"], "page": {"lists": ["weave.ends=5,7"], "dpi": 96}},
        {"what": "moving", "tolerance": 1e-5, "subdivisions": 2},
    ],
)
def test_the_printed_command_can_be_parsed(asked: dict[str, Any]) -> None:
    times = tuple(asked.get("times", (0.1,) if asked["what"] == "picture" else ()))
    printed = describe_record(Record(__version__, asked, "", "a b.toml", times), Path("a b.png"))[1]
    words = shlex.split(printed.removeprefix("command: spacemap "))
    _, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
    assert "a b.toml" in bound.args
    assert Path("a b.png") in bound.kwargs.values()


def test_an_unknown_job_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="invalid description of a job"):
        job_from_json({"what": "picture", "place": [1, 2]}, tmp_path / "a.png")
