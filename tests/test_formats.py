"""A format registered in one file appears in help, dialogs, readers and ParaView."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import pyvista as pv

from spacemap_vtk import MotionReader, ObjectSource
from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import InputError, UnknownNameError
from spacemap_vtk.io import registry
from spacemap_vtk.io.reading import read_blocks
from spacemap_vtk.io.registry import reads, writes
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.paraview.stages import make_proxies
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.drafts.draft import Draft

#: A module with three formats, also run in another process.
_MODULE = """
from pathlib import Path

import numpy as np

from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.io.registry import reads, truncated_error, writes


@reads(".bits", label="Toy draft", holds="draft")
def read_bits(path):
    from spacemap_vtk.textile.drafts.draft import Draft

    rows = [[c == "1" for c in row] for row in path.read_text().split()]
    return Draft(np.array(rows), title="bits")


def whole(path):
    if not path.read_text().endswith("end"):
        raise truncated_error(path)


@reads(".dots", label="Toy mesh", holds="mesh", check=whole)
def read_dots(path):
    import pyvista as pv

    return pv.PolyData(np.loadtxt(path, comments="end"))


@writes(".xyz", label="Toy points", holds=("surface", "cage"))
def write_points(file, data):
    from spacemap_vtk.datasets.arrays import points_of

    np.savetxt(file, points_of(data))


def need_ink(file):
    raise MissingLibraryError(f"{file.name}: there is no ink")


@writes(".ink", label="toy picture", holds=("picture",))
def write_ink(file, image):
    file.write_text(str(image.shape))


@writes(".noink", label="film", holds=("film",), require=need_ink)
@writes(".blank", label="Nothing", holds=("draft",))
def write_nothing(file, *_):
    pass


@writes(".film", label="Toy film", holds=("cage",), times=True)
def write_film(file, steps):
    with file.open("w") as stream:
        for time, data in steps:
            stream.write(f"{time} {data.GetNumberOfPoints()}\\n")
"""


@pytest.fixture
def toys() -> Iterator[dict[str, Any]]:
    """Register the formats, and unregister them afterwards."""
    names: dict[str, Any] = {}
    exec(_MODULE, names)
    yield names
    for name, made in names.items():
        if name.startswith(("read_", "write_")):
            registry.unregister(made)


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(words)
    return int(ended.value.code or 0)


@pytest.mark.usefixtures("toys")
def test_a_new_draft_format_is_read_everywhere(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "a.bits"
    file.write_text("110\n011\n")
    scene = Scene.read(file)
    np.testing.assert_array_equal(scene.draft.drawdown, [[1, 1, 0], [0, 1, 1]])
    assert run("info", str(file), "--json") == 0
    assert json.loads(capsys.readouterr().out)["drawdown"] == ["110", "011"]
    assert run("export", str(file), "-o", str(tmp_path / "a.wif"), "-q") == 0
    assert Scene.read(tmp_path / "a.wif").draft.title == "bits"


@pytest.mark.usefixtures("toys")
def test_a_new_mesh_format_is_read_everywhere(tmp_path: Path) -> None:
    file = tmp_path / "a.dots"
    file.write_text("0 0 0\n1 0 0\n0 1 0\n0 0 1\nend")
    scene = Scene.read(file)
    scene.update()
    assert scene.polygons.GetNumberOfPoints() == 4
    assert MotionReader(file=file).time_steps([]) == [0.0]
    # The check runs before the reader wherever a file is read.
    file.write_text(file.read_text()[:-1])
    for stage in (ObjectSource(file=file), MotionReader(file=file)):
        with pytest.raises(InputError, match="truncated"):
            stage.update()
    with pytest.raises(InputError, match="truncated"):
        read_blocks(file)


@pytest.mark.usefixtures("toys")
def test_a_new_writer_is_used_everywhere(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "a.xyz"
    words = "export", "plain_weave", "-o", str(file), "-q"
    assert run(*words, "--what", "cage") == 0
    scene = Scene.read("plain_weave")
    scene.update(scene.view.time)
    assert np.loadtxt(file).shape == (72, 3)
    assert run(*words) == 0
    assert len(np.loadtxt(file)) == scene.polygons.GetNumberOfPoints()
    assert run(*words, "--what", "draft") == 2
    allowed = "cannot contain this kind of data; allowed: surface, cage"
    assert f".xyz files {allowed}" in capsys.readouterr().err
    # A writer of many times receives those of the film.
    film = tmp_path / "a.film"
    assert run("export", "plain_weave", "-o", str(film), "-q", "--set", "animation.stop=0.2") == 0
    scene.set("animation.stop=0.2")
    times = np.loadtxt(film)
    np.testing.assert_allclose(times[:, 0], scene.animation.frame_times())
    assert set(times[:, 1]) == {72}
    # A writer that writes nothing is reported.
    assert run("export", "plain_weave", "-o", str(tmp_path / "a.blank"), "-q") == 1
    assert "a.blank: nothing was written" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.film", "a.xyz"]


@pytest.mark.usefixtures("toys")
def test_a_new_writer_of_pictures_and_films_is_used(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "a.ink"
    assert run("render", "plain_weave", "-o", str(file), "--size", "64x48", "-q") == 0
    assert file.read_text() == "(48, 64, 3)"
    assert registry.name_filter("Pictures", registry.writer_endings("picture")).endswith("*.ink)")
    # A missing package is reported before any work, and dialogs do not offer the format.
    assert run("animate", "plain_weave", "-o", str(tmp_path / "a.noink"), "-q") == 1
    assert "a.noink: there is no ink" in capsys.readouterr().err
    assert ".noink" in registry.writer_endings("film")
    assert ".noink" not in registry.available_writer_endings("film")


@pytest.mark.usefixtures("toys")
def test_lists_of_formats_contain_a_new_format(tmp_path: Path, capsys: Any) -> None:
    opened, drafts = registry.scene_dialog_filters().split(";;"), registry.draft_dialog_filters()
    assert re.search(r"\*\.wif .*\*\.dtx .*\*\.bits .*\*\.dots", opened[0])
    assert "*.bits" in drafts
    written = registry.export_dialog_filters()
    assert written["Surface (*.xyz)"] == "surface"
    assert written["Cage with its motion, all times (*.film)"] == "cage"
    # The messages about files that no format reads or writes.
    (tmp_path / "a.png").write_bytes(b"\x89PNG")
    assert run("render", str(tmp_path / "a.png"), "-o", "b.png") == 2
    assert ".toml, .wif, .wifw, .plm, .dtx, .wpo, .twa, .bits, " in capsys.readouterr().err
    assert run("render", "nothing.nope", "-o", "b.png") == 2
    assert (
        "a weaver's draft (.wif, .wifw, .plm, .dtx, .wpo, .twa, .bits)" in capsys.readouterr().err
    )
    assert run("export", "plain_weave", "-o", "b.png") == 2
    assert ".xyz (surface or cage)" in capsys.readouterr().err
    # ParaView opens drafts and scenes by their endings, and meshes with its own readers.
    xml = make_proxies()["WIFReader"]._pvsm_proxy_xml
    factory = ElementTree.fromstring(xml).find(".//ReaderFactory")
    assert factory is not None
    assert factory.attrib == {
        "extensions": "wif wifw plm dtx wpo twa bits",
        "file_description": "Weaver's draft",
    }


def test_the_help_lists_a_new_format(tmp_path: Path) -> None:
    (tmp_path / "toys.py").write_text(_MODULE)
    code = "import sys, toys; from spacemap_vtk.cli.main import main; main(sys.argv[1:])"

    def printed(*words: str) -> str:
        command = [sys.executable, "-c", code, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
        return " ".join(done.stdout.replace("│", " ").split())

    assert ".wpo, .twa, .bits), a mesh (" in printed("--help")
    help = printed("export", "--help")
    for part in (
        ".vtu (patches or cage), ",
        ".xyz (surface or cage)",
        ".film (cage)",
        ".wif, .txt, .dtx or .blank (draft)",
    ):
        assert part in help


def test_an_unregistered_format_is_gone() -> None:
    @reads(".gone", label="Gone", holds="draft")
    @writes(".gone", label="Gone", holds=("surface",))
    def both(*_: Any) -> Draft:
        raise NotImplementedError

    assert ".gone" in registry.writer_endings()
    assert registry.kind_of(Path("a.gone")) == "draft"
    registry.unregister(both)
    assert ".gone" not in registry.writer_endings()
    assert registry.kind_of(Path("a.gone")) is None


def test_an_unknown_kind_of_data_is_refused() -> None:
    for decorator, holds in ((reads, "surfaces"), (writes, ("mesh",))):
        with pytest.raises(UnknownNameError, match="unknown kind of data; allowed: "):
            decorator(".abc", label="Alphabet", holds=holds)


def test_two_writers_can_share_an_ending() -> None:
    @writes(".vtu", label="Mine", holds=("surface",))
    def mine(file: Path, surface: Any) -> None:
        raise NotImplementedError

    try:
        assert registry.writer_endings()[".vtu"] == "patches or cage or surface"
        assert make_data_job(Path("a.vtu"), "surface").kind == "surface"
        assert registry.writer(Path("a.vtu"), "surface").write is mine
        assert registry.writer(Path("a.vtu"), "cage").write is not mine
    finally:
        registry.unregister(mine)


def test_the_last_registered_reader_is_used(tmp_path: Path) -> None:
    ball = pv.Sphere()

    @reads(".ply", label="Mine", holds="mesh")
    def mine(path: Path) -> pv.PolyData:
        return ball

    (tmp_path / "a.ply").write_text("not one at all")
    try:
        assert read_blocks(tmp_path / "a.ply") is ball
        assert registry.reader_endings("mesh").count(".ply") == 1
    finally:
        registry.unregister(mine)


def test_only_the_formats_list_endings() -> None:
    """There is no second list of endings."""
    package = Path(registry.__file__).parents[1]
    meshes = [
        ending for ending in registry.reader_endings("mesh") if ending not in (".e", ".g", ".cas")
    ]
    pattern = re.compile("|".join(f'"{re.escape(ending)}"' for ending in meshes))
    found = {
        file.relative_to(package).as_posix()
        for file in package.rglob("*.py")
        if pattern.search(file.read_text(encoding="utf-8"))
    }
    assert [name for name in sorted(found) if not name.startswith("io/formats/")] == []
