"""Files from strangers may only make the program read files next to them."""

from __future__ import annotations

import ast
import io
import os
import re
from contextlib import suppress
from pathlib import Path

import pytest
from PIL import Image
from test_layers import PACKAGE

from spacemap_vtk import workers
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.io import registry
from spacemap_vtk.io.file_references import file_references
from spacemap_vtk.io.formats.pictures import decode_picture
from spacemap_vtk.jobs.frames import FrameFolder
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import describe_outside_files
from spacemap_vtk.temporary_files import temporary_folder

#: Modules that may unpickle data, which come through a pipe from their own child process.
PIPES = {"workers"}
#: Allowed uses of such words: a memory view, and an argument that is the name of a shell.
HARMLESS = {"pickle.PickleBuffer", "app.generate_completion"}
FORBIDDEN = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml"}


#: Only modules that contain one of these words are parsed.
_DOUBTFUL = re.compile(
    rf"(import|from) ({'|'.join(sorted(FORBIDDEN))})|shell=|np\.load|os\.(system|popen)|mktemp"
    r"|\b(eval|exec)\(|(?<!re\.)\bcompile\("
)


def _runs_what_it_reads(module: str, node: ast.AST) -> bool:
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        of = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
        names = {of + alias.name for alias in node.names} - HARMLESS
        return module not in PIPES and any(n.partition(".")[0] in FORBIDDEN for n in names)
    if not isinstance(node, ast.Call):
        return False
    given = {word.arg: ast.unparse(word.value) for word in node.keywords}
    called = ast.unparse(node.func)
    return called not in HARMLESS and (
        called in ("eval", "exec", "compile", "os.system", "os.popen", "tempfile.mktemp")
        or given.get("shell", "False") != "False"
        or (called == "np.load" and given.get("allow_pickle") != "False")
    )


def test_settings_in_the_folder_do_not_run_latex(monkeypatch, tmp_path):
    import matplotlib

    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context({"text.usetex": True}):  # as matplotlib reads it when it is loaded
        assert not new_figure().suptitle("a").get_usetex()
    monkeypatch.chdir("/")
    with matplotlib.rc_context({"text.usetex": True}):  # the user's own
        assert new_figure().suptitle("a").get_usetex()


def test_no_code_unpickles_evaluates_or_starts_a_shell():
    read = {file: file.read_text(encoding="utf-8") for file in PACKAGE.rglob("*.py")}
    found = [
        f"{file}:{node.lineno}: {ast.unparse(node)}"
        for file, text in read.items()
        if _DOUBTFUL.search(text)
        for node in ast.walk(ast.parse(text))
        if _runs_what_it_reads(file.stem, node)
    ]
    assert found == []
    for text in ("import pickle", "eval(x)", "run(x, shell=True)", "np.load(x)"):
        assert _DOUBTFUL.search(text)
        assert any(_runs_what_it_reads("io", node) for node in ast.walk(ast.parse(text)))


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """Return the folder of a scene, next to a folder with unrelated files."""
    for folder in ("scene/below", "other"):
        (tmp_path / folder).mkdir(parents=True)
    for place in ("scene/near.wif", "scene/below/deep.wif", "other/far.wif"):
        text = "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=2\nTreadles=2\n[WARP]\nThreads=2\n[WEFT]\n"
        text += "Threads=2\n[THREADING]\n1=1\n2=2\n[TREADLING]\n1=1\n2=2\n[TIEUP]\n1=1\n2=2\n"
        (tmp_path / place).write_text(text)
    (tmp_path / "scene/link.wif").symlink_to(tmp_path / "other/far.wif")
    (tmp_path / "scene/folder").symlink_to(tmp_path / "other")
    return tmp_path / "scene"


def _scene(home: Path, text: str) -> Scene:
    (home / "a.toml").write_text(text)
    return Scene.read(home / "a.toml")


@pytest.mark.parametrize(
    ("name", "far"),
    [
        *(("near.wif", False), ("below/deep.wif", False), ("below/../near.wif", False)),
        *(("../other/far.wif", True), ("link.wif", True), ("folder/far.wif", True)),
        *(("ABOVE/other/far.wif", True), ("ABOVE/scene/near.wif", False)),
        # Names that a shell would interpret.
        *(("~/far.wif", False), ("$HOME/far.wif", False), ("https://a.example/far.wif", False)),
    ],
)
def test_a_file_outside_the_scenes_folder_is_reported(home, name, far, capsys):
    above = home.parent.as_posix()
    scene = _scene(home, f'[weave]\ndraft = "{name.replace("ABOVE", above)}"\n')
    reported = list(describe_outside_files(scene))
    assert len(reported) == far
    if far:
        assert str(home.parent / "other/far.wif") in reported[0]
        with pytest.raises(SystemExit, match="0"):
            main(["validate", str(home / "a.toml")])
        assert reported[0] in capsys.readouterr().err
    # Files named on the command line are chosen by the user.
    scene.set(f"weave.draft={home.parent / 'other/far.wif'}")
    assert list(describe_outside_files(scene)) == []
    assert (
        list(describe_outside_files(Scene({"weave": {"draft": home.parent / "other/far.wif"}})))
        == []
    )


_XML = '<?xml version="1.0"?><VTKFile>{}</VTKFile>'
#: Files that refer to others: name, content, and the referenced files.
NAMING = [
    ("a.vtm", _XML.format('<DataSet index="0" file="{}"/>')),
    ("a.pvtu", _XML.format('<Piece Source="{}"/>')),
    ("a.pvtk", '<File><Piece fileName="{}"/></File>'),
    ("a.pvd", _XML.format('<DataSet timestep="0" file="{}"/>')),
    ("a.vtu.series", '{{"files": [{{"name": "{}", "time": 0}}]}}'),
    ("a.gltf", '{{"buffers": [{{"uri": "{}", "byteLength": 4}}]}}'),
    ("a.obj", "v 0 0 0\rmtllib {}\r\n"),
    ("a.xdmf", "<Xdmf><DataItem>\n{}:/points\n</DataItem></Xdmf>"),
    ("b.xdmf", '<Xdmf xmlns:x="http://www.w3.org/2001/XInclude"><x:include href="{}"/></Xdmf>'),
    ("a.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: 1 {}\n"),
    ("a.inp", "*NODE\n*Include, input={}\n"),
    ("a.mha", "NDims = 3\nElementDataFile = {}\n"),
    ("a.nrrd", "NRRD0004\ndata file: {}\n"),
]


@pytest.mark.parametrize(("file", "text"), NAMING)
def test_referenced_files_are_found(home, file, text):
    """Paths on other machines are found but not opened, because Windows would log in there."""
    path = home / file
    for word in ("near.dat", "../other/far.dat"):
        path.write_text(text.format(word))
        os.utime(path, ns=(0, len(word)))  # as if time had gone by
        assert [other for _, other in file_references(path)][-1] == home / word
    scene = _scene(home, f'[object]\nfile = "{file}"\n')
    (reported,) = describe_outside_files(scene)
    assert reported.startswith(f"{path} refers to {home.parent / 'other/far.dat'}")
    path.write_text(text.format("//host/share/x"))
    reader = registry.reader(path, "motion") or registry.reader(path, "mesh")
    assert reader is not None
    with pytest.raises(InputError, match="on another machine"):
        reader.read(path)


def test_references_are_followed_recursively(home):
    (home / "a.obj").write_text("mtllib below/a.mtl\n")
    (home / "below/a.mtl").write_text("newmtl a\nmap_Kd -s 1 1 1 ../../other/a.png\n")
    (home / "a.pvd").write_text(_XML.format('<DataSet timestep="0" file="a.vtm"/>'))
    (home / "a.vtm").write_text(_XML.format('<DataSet file="a.vtm"/><DataSet file="/x.vtp"/>'))
    for file, far in (("a.obj", home.parent / "other/a.png"), ("a.pvd", Path("/x.vtp"))):
        scene = _scene(home, f'[object]\nfile = "{file}"\n')
        (reported,) = describe_outside_files(scene)
        assert str(far) in reported


def test_links_in_hdf5_files_are_found(home):
    h5py = pytest.importorskip("h5py")
    with h5py.File(home / "a.vtkhdf", "w") as made:
        made["VTKHDF/Points"] = h5py.ExternalLink("link.h5", "/x")
        made.create_dataset("raw", (4,), "u1", external=[("/etc/passwd", 0, 4)])
        layout = h5py.VirtualLayout((4,), "u1")
        layout[:] = h5py.VirtualSource("virtual.h5", "x", (4,))
        made.create_virtual_dataset("virtual", layout)
    found = {str(other) for _, other in file_references(home / "a.vtkhdf")}
    assert found == {str(home / "link.h5"), "/etc/passwd", str(home / "virtual.h5")}


@pytest.mark.parametrize("word", ["//host/share/a.wif", r"\\host\share\a.wif", r"\\?\UNC\h\s\a"])
def test_paths_on_other_machines_are_refused(tmp_path, word):
    with pytest.raises(InputError, match="must not be on another machine"):
        WeaveSource.parameters["draft"].resolve_path(word, tmp_path)


def test_links_in_a_scenes_folder_write_nothing_elsewhere(home):
    """Links named like the folder of a killed process, or like that of film frames."""
    other = home.parent / "other"
    (home / ".spacemap-0123456789ab").mkdir()
    (home / ".spacemap-0123456789ab/older").symlink_to(other)
    for place in (home, home / ".spacemap-0123456789ab"):
        (place / "planted").write_text("x")
        os.utime(place / "planted", (0, 0))
    (home / "film.gif.frames").mkdir()
    (home / "film.gif.frames/of.txt").symlink_to(other / "far.wif")
    before = {path.name: path.read_bytes() for path in other.iterdir()}
    with temporary_folder(home):
        pass
    with (
        pytest.raises(InputError, match="is a symbolic link"),
        FrameFolder(home / "film.gif", "digest").lock(),
    ):
        pass
    assert {path.name: path.read_bytes() for path in other.iterdir()} == before
    assert not (home / ".spacemap-0123456789ab").exists()


def test_titles_are_not_interpreted(home):
    title = r"[/end] \u001b]0;theirs\u0007[red]"
    scene = _scene(home, f'title = "{title}"\n[weave]\nends = 3\npicks = 3\n')
    assert scene.title == "[/end]  ]0;theirs [red]"
    for file in (PACKAGE / "cli").glob("*.py"):
        for console in re.findall(r"\bConsole\((.*?)\)", file.read_text(encoding="utf-8")):
            assert console in ("markup=False", "stderr=True"), file.name


def test_postscript_pictures_are_refused(monkeypatch):
    ran = []
    monkeypatch.setattr("PIL.EpsImagePlugin.Ghostscript", lambda *given: ran.append(given))
    text = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 8\n%%EndComments\nshowpage\n%%EOF\n"
    with Image.open(io.BytesIO(text)) as picture, suppress(Exception):
        picture.load()  # Pillow would run it, of a file with any ending
    assert ran
    ran.clear()
    with pytest.raises(InputError, match="not a picture"):
        decode_picture(text, lambda width, height: None)
    assert ran == []


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("[weave]\nends = " + "[" * 50_000, "brackets are nested"),
        (f"[{'.'.join('a' * 50_000)}]\n", "a key has more than 16 names"),
        (f"[weave]\nends = {'9' * 50_000}", "thousands of digits"),
        ("#" * (2**24 + 1), "more than 16777216 bytes"),
    ],
)
def test_a_scene_that_would_take_hours_to_parse_is_refused(tmp_path, text, reported):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError, match=reported):
        registry.read(tmp_path / "a.toml", "scene")


def test_a_module_in_the_folder_of_a_scene_is_not_run(tmp_path):
    (tmp_path / "pickle.py").write_text('open("ran", "w")\n')
    child = workers.start_worker("math:sqrt", os.environ, cwd=tmp_path)
    assert workers.run_task(child, 4.0)[0] == 2.0
    workers.end_worker(child)
    assert not (tmp_path / "ran").exists()
