"""What files say of themselves, found by readers that are not ours, and files made anew from it."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import pyvista as pv
from PIL import Image

from spacemap_vtk import __version__
from spacemap_vtk.cli.again import differences
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.order import Order, carry_out
from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.provenance import NAME, Record, record_in, recorded
from spacemap_vtk.scenes.origin import scene_of
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "title": 'Two by two, "--" (small) \\ é',
    "weave": {"ends": 2, "picks": 2, "warp_diameter": "0.2 mm"},
    "cage": {"divisions": [2, 2, 1]},
    "modal": {"modes": 3, "elements": "tetrahedra", "youngs_modulus": "1 kPa"},
    "response": {"loads": [{"pressure": "3 Pa", "on": "+z", "time": "ramp", "rise": "0.1 s"}]},
    "surface": {"subdivisions": 1},
    "view": {"size": [64, 48], "color": "displacement"},
    "animation": {"stop": 0.08},
}
#: Formats without room for a record.
MUTE = {".stl", ".dtx", ".txt"}
#: Those that are made anew here; the others know no more of their order.
ANEW = {".png", ".glb", ".vtp", ".vtu", ".obj", ".usdc", ".pvd", ".svg"}
#: What is ordered of each ending that is drawn.
DRAWN = {"picture": "picture", "film": "film", "frames": "film", "plot": "plot"}


def orders(folder: Path) -> list[Order]:
    """Return an order for each ending that is written."""
    kinds = {(each, ending) for each in ("", *DRAWN) for ending in registry.written(each or None)}
    names = {"frames": "frame%02d"}
    found = []
    for kind, ending in sorted(kinds):
        if ending == ".jpeg" or (kind == "plot" and ending != ".svg"):
            continue  # as .jpg; all plots are of one figure, below
        name = f"{names.get(kind, kind or 'data')}{ending}"
        order = Order(DRAWN.get(kind, kind), folder / name)
        order.times = [0.0, 0.03] if order.lasts or order.what == "moving" else [0.03]
        found.append(order)
    return found


def found_by_others(file: Path) -> str:
    """Return the record as a program finds it that has never heard of ours."""
    ending = file.suffix
    if ending in (".png", ".gif", ".jpg", ".jpeg"):
        with Image.open(file) as image:
            return str(image.info.get(NAME) or image.info["comment"])
    if ending == ".mp4":
        from imageio_ffmpeg import get_ffmpeg_exe

        words = [get_ffmpeg_exe(), "-hide_banner", "-i", str(file)]
        return subprocess.run(words, capture_output=True, text=True).stderr
    if ending in (".vtp", ".vtu"):
        return bytes(pv.read(file).field_data[NAME]).decode()
    if ending in (".usda", ".usdc"):
        sdf = pytest.importorskip("pxr.Sdf")
        return str(sdf.Layer.FindOrOpen(str(file)).customLayerData[NAME])
    if ending == ".vtkhdf":
        import h5py

        with h5py.File(file) as made:
            return str(made[NAME].asstr()[()])
    if ending == ".glb":
        head = file.read_bytes()[20:]
        return json.dumps(json.JSONDecoder().raw_decode(head.decode("latin-1"))[0]["asset"])
    if ending == ".csv":
        return file.with_name(f"{file.name}-metadata.json").read_text()
    if ending == ".svg":
        ElementTree.parse(file)
    return file.read_bytes().decode("latin-1")


def test_every_format_says_how_it_was_made_and_is_made_anew(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    mute = set()
    for order in orders(tmp_path):
        if order.output.suffix in (".usda", ".usdc"):
            pytest.importorskip("pxr")
        carry_out(order, Scene(VALUES, tmp_path / "two.toml"), lambda *_: None)
        name = order.output.name % 1 if order.numbered else order.output.name
        record = record_in(tmp_path / name)
        if record is None:
            mute.add(order.output.suffix)
            continue
        assert "Two by two" in found_by_others(tmp_path / name), name
        assert record.version == __version__
        scene, inputs = scene_of(record, [tmp_path])
        assert scene.title == VALUES["title"]
        assert inputs == []
        assert scene.response.loads == Scene(VALUES).response.loads
        if order.output.suffix not in ANEW:
            continue
        anew = Order.of(record.order, tmp_path / "new" / name)
        carry_out(anew, scene, lambda *_: None)
        if order.numbered:  # seen from where its film is
            assert record.times == (0.04,)
        made, was = ((folder / name).read_bytes() for folder in (tmp_path / "new", tmp_path))
        assert made == was, name
        assert list(differences(tmp_path / name, tmp_path / "new" / name)) == []
    assert mute == MUTE


def test_a_plot_says_it_in_any_format(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    record = Record(__version__, {"what": "plot"}, 'title = "a (b) \\\\ <&> -- Two by two"', "é")
    for ending in registry.written("plot"):
        file = tmp_path / f"a{ending}"
        with recorded(record):
            registry.writer(file, "plot").write(file, Figure((1, 1)))
        assert record_in(file) == record
        assert "Two by two" in found_by_others(file)


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


def test_a_file_is_made_anew_from_the_files_it_was_made_of(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "drafts").mkdir()
    draft, scene = tmp_path / "drafts" / "a.txt", tmp_path / "a.toml"
    draft.write_text("110\n011\n101\n")
    scene.write_text('[weave]\ndraft = "drafts/a.txt"\n[surface]\nsubdivisions = 1\n')
    file, other = tmp_path / "a.vtp", tmp_path / "a-again.vtp"
    assert run("export", scene, "-o", file, "-q", "--set", "weave.ends=4") == 0
    assert run("info", file) == 0
    said = capsys.readouterr().out
    assert f"made by spacemap_vtk {__version__}\nas by spacemap export a.toml" in said
    assert re.search(r"from drafts/a\.txt, sha256 [0-9a-f]{16}…", said)
    assert run("again", file) == 0
    said = capsys.readouterr().out
    assert f"reads {draft}\nwrites {other}\n" in said
    assert other.read_bytes() == file.read_bytes()
    # What is there stays, unless someone says so; with other values it is another.
    assert run("again", file) == 2
    assert "a-again.vtp is there already. Name an --output" in capsys.readouterr().err
    assert run("again", file, "--force", "--set", "weave.ends=5", "-q") == 0
    assert pv.read(other).n_cells > pv.read(file).n_cells
    assert run("again", file, "--check") == 0
    assert run("again", file, "--check", "--set", "weave.warp_diameter=0.3mm", "-q") == 1
    assert "points differ by up to" in capsys.readouterr().err
    # Elsewhere it says where the scene's folder is; an input that is another is refused.
    (tmp_path / "b").mkdir()
    moved = file.rename(tmp_path / "b" / "a.vtp")
    assert run("again", moved, "--check", "-q") == 2
    assert "which was read for it, is not there. Put it back" in capsys.readouterr().err
    assert run("again", moved, "--check", "-q", "--folder", tmp_path) == 0
    draft.write_text("110\n011\n100\n")
    assert run("again", moved, "--check", "-q", "--folder", tmp_path) == 2
    assert "has changed since" in capsys.readouterr().err
    assert run("again", scene) == 2
    assert "does not say how it was made" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"scene": '[weave]\ndraft = "../secret.wif"\n'}, "not among the files"),
        ({"scene": '[motion]\nfile = "../s*.vtu"\n'}, "not among the files"),
        ({"scene": '[[response.loads]]\nfile = "../secret.wif"\n'}, "not among the files"),
        ({"inputs": {"../secret.wif": "0" * 64}}, "has changed since"),
        ({"order": {"what": "painted", "nothing": 1}}, "no order"),
        ({"order": {"what": "painted", "size": "large"}}, "no order"),
        ({"order": ["picture"]}, "damaged"),
        ({"scene": "= ["}, "damaged"),
    ],
)
def test_a_strangers_record_leads_nowhere_else(
    tmp_path: Path, capsys: Any, change: dict[str, Any], said: str
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
    told = capsys.readouterr().err
    assert said in told
    assert "secret words" not in told
    assert [path.name for path in (tmp_path / "in").iterdir()] == ["a.obj"]


def test_an_order_that_is_no_order_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no order that this program knows"):
        Order.of({"what": "picture", "place": [1, 2]}, tmp_path / "a.png")
