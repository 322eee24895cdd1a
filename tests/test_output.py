"""Files appear complete or not at all, whatever error a real disk reports."""

from __future__ import annotations

import ast
import contextlib
import errno
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import spacemap_vtk
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.io.formats.film import write_film
from spacemap_vtk.io.output import atomic_file, atomic_files, check_output, write_parts
from spacemap_vtk.io.registry import DRAWN, writer_endings

SMALL = "--set weave.ends=3 --set weave.picks=3 -q"
FILM = f"animate plain_weave {SMALL} --set animation.speed=1 --size 320x240 -o"
#: Commands by the name of their output; each writes more than 16 kB, except the drafts.
WRITERS = {
    "x.vtu": f"export plain_weave {SMALL} -o",
    "x.vtp": f"export plain_weave {SMALL} -o",
    "x.stl": f"export plain_weave {SMALL} -o",
    "x.ply": f"export plain_weave {SMALL} -o",
    "x.glb": f"export plain_weave {SMALL} --times 0,0.02 -o",
    "x.html": f"export plain_weave {SMALL} --times 0,0.02 -o",
    "x.pvd": f"export plain_weave {SMALL} --times 0,0.02 -o",
    "x.pvtp": f"export plain_weave {SMALL} -o",
    "x.pvtu": f"export plain_weave {SMALL} -o",
    "x.usdc": f"export plain_weave {SMALL} --times 0 -o",
    "x.usda": f"export plain_weave {SMALL} --times 0 -o",
    "x.obj": f"export plain_weave {SMALL} -o",
    "x.bcc": f"export plain_weave {SMALL.replace('=3', '=30')} -o",
    "x.tg3": f"export plain_weave {SMALL.replace('=3', '=9')} -o",
    "x.csv": f"export plain_weave {SMALL.replace('=3', '=5')} -o",
    "x.inp": f"export plain_weave {SMALL} --set cage.divisions=[9,9,1] --set modal.modes=1 -o",
    "x.vtkhdf": f"export plain_weave {SMALL} --times 0,0.02 -o",
    "x.wif": f"export plain_weave {SMALL} -o",
    "x.dtx": f"export plain_weave {SMALL} -o",
    "x.txt": f"export plain_weave {SMALL} -o",
    "x.png": f"render plain_weave --size 480x360 {SMALL} -o",
    "x.jpg": f"render plain_weave --size 960x720 {SMALL} -o",
    "x.gif": FILM,
    "x.mp4": FILM.replace("320x240", "480x360"),
    "x%02d.png": FILM,
    "sheet.png": f"modes plain_weave --set modal.modes=2 {SMALL} --plot",
    "x.vti": "unit-cell plain_weave --voxels 64 -o",
    "x.yaml": "unit-cell plain_weave --voxels 64 -o",
    "x.json": "unit-cell plain_weave --voxels 64 -o",
    "plot.png": f"plot plain_weave {SMALL} -o",
    "plot.pdf": f"plot plain_weave {SMALL} -o",
    "plot.svg": f"plot plain_weave {SMALL} -o",
}
DRAFTS = {"x.wif": b"[WIF]", "x.dtx": b"@@StartDTX", "x.txt": b"101"}
PRECIOUS = b"precious"


def run(words: str, file: Path) -> int:
    with pytest.raises(SystemExit) as caught:
        main([*words.split(), str(file)])
    return int(caught.value.code or 0)


#: One of each way to write: text, VTK, a folder, a picture, a film, its frames.
_WAYS = ("x.wif", "x.vtp", "x.pvd", "x.png", "x.mp4", "x%02d.png")


@pytest.mark.parametrize(
    ("name", "room", "older"),
    [
        pytest.param(
            *(name, room, older),
            id=f"{name}-{words}",
            marks=[pytest.mark.nightly] * (name not in _WAYS),
        )
        for room, older, words in ((2**14, True, "little"), (0, False, "none"))
        for name in WRITERS
    ],
)
def test_a_full_disk_leaves_earlier_files_unchanged(
    name: str,
    room: int,
    older: bool,
    small_disk: Callable[..., Path],
    capfd: pytest.CaptureFixture[str],
) -> None:
    disk = small_disk(2**17)
    names = ("x00.png", "x03.png") if "%" in name else (name,)
    kept = {disk / each: PRECIOUS for each in names if older}
    for path in kept:
        path.write_bytes(PRECIOUS)
    fill(disk, room)
    code = run(WRITERS[name], disk / name)
    printed = capfd.readouterr().err
    if room and name in DRAFTS:
        assert code == 0
        assert (disk / name).read_bytes().startswith(DRAFTS[name])
        return
    assert code == 1
    assert printed.startswith(f"spacemap: {disk / name}: could not be written: disk full. ")
    assert printed.count("\n") == 1
    assert {path: path.read_bytes() for path in disk.iterdir() if path.name != "fill"} == kept


def test_every_format_is_tested_on_a_full_disk() -> None:
    tried = {Path(name).suffix for name in WRITERS} | {".jpeg"}  # as .jpg
    found = {ending for kind in (None, *DRAWN) for ending in writer_endings(kind)}
    assert tried == found


#: Functions that write without `spacemap_vtk.io.output`, with the reason.
OWN_WRITERS = {
    "io/output.py": {
        "write_parts": {"file.open"},
        "_flush_to_disk": {"os.open"},
        "_replace": {"os.replace"},
    },
    "temporary_files.py": {"try_lock": {"os.open"}},
    # the null device
    "datasets/vtk_messages.py": {"silence_stderr": {"os.open"}},
    # a cache entry with checksums, through a hidden folder
    "cache.py": {"store": {"np.savez", "os.replace"}},
    # kept frames of a film, with checksums
    "jobs/frames.py": {"write": {"os.replace"}, "remove": {"os.replace"}},
    # input of another program, in a hidden folder
    "cage/tetwild.py": {"_run_tetwild": {"np.savez"}},
    "draw/raytrace.py": {"_shapes": {"open", "np.savetxt"}},
    "io/formats/usd.py": {"write_usd": {"layer.Export"}},
    # in memory
    "app/documents/draft_versions.py": {"add_state": {"writer.Write"}},
    "app/web/screen.py": {"picture": {"image.save"}, "draw_file": {"image.save"}},
    "app/web/session.py": {"_list_patterns": {"Image.fromarray(pixels).save"}},
    # a draft from the browser, in a temporary folder
    "app/web/server.py": {"_add_guard": {"session.uploads.save"}},
    "app/web/uploads.py": {"save": {"path.write_bytes"}},
    # in the folder of the cache
    "app/documents/file_thumbnails.py": {"save_thumbnail": {"small.copy(cut).save"}},
    "io/formats/pictures.py": {
        "write_picture": {"Image.fromarray(image).save"},
        "write_figure": {"figure.savefig"},
        "write_pages": {"document.savefig"},
    },
    "io/formats/vtk_xml.py": {"write_xml": {"writer.Write"}},
    # films are too large for memory; they check the end of the file
    "io/formats/film.py": {"_write_gif": {"palette.save"}, "_raise_disk_error": {"file.open"}},
    # a pipe, and the null device
    "workers.py": {"main": {"os.fdopen"}},
    "cli/main.py": {"_open_streams": {"os.fdopen", "os.open"}, "_discard_output": {"os.open"}},
    "io/formats/vtk_hdf.py": {"ErrorKeepingFile": {"FileIO"}},
}
_WRITING = re.compile(
    r"write_(text|bytes)|save(z|z_compressed|txt|fig)?|tofile|Write|Export|im(write|save)|FileIO"
    r"|NamedTemporaryFile|mkstemp|mkdtemp|TemporaryDirectory|copy(2|file|tree)|rename|symlink_to"
    r"|hardlink_to|memmap|to_csv|screenshot|open_(movie|gif)|WriteToFile"
)
_LIKE = re.compile(
    rf"\b((fd)?open|save|os\.(replace|link|symlink)|shutil\.(move|copy)|{_WRITING.pattern})\("
    r"|\(FileIO"
)


def is_write(call: ast.Call) -> bool:
    words = ast.unparse(call.func)
    last = words.rpartition(".")[2]
    if last in ("open", "fdopen"):
        given = [*call.args, *(each.value for each in call.keywords)]
        modes = [each.value for each in given if isinstance(each, ast.Constant)]
        return words == "os.open" or any(
            re.fullmatch("[rwaxbt+]*[wax+][bt+]*", str(m)) for m in modes
        )
    if last == "save":
        return bool(call.args)
    known = words in ("os.replace", "os.link", "os.symlink", "shutil.move", "shutil.copy")
    return known or bool(_WRITING.fullmatch(last))


def test_all_writers_use_the_output_module() -> None:
    package = Path(spacemap_vtk.__file__).parent
    found: dict[str, dict[str, set[str]]] = {}

    def visit(node: ast.AST, file: str, name: str) -> None:
        for each in ast.iter_child_nodes(node):
            if isinstance(each, ast.Call) and is_write(each):
                found.setdefault(file, {}).setdefault(name, set()).add(ast.unparse(each.func))
            named = isinstance(each, (ast.FunctionDef, ast.ClassDef))
            if isinstance(each, ast.ClassDef) and any(
                ast.unparse(b) == "FileIO" for b in each.bases
            ):
                found.setdefault(file, {})[each.name] = {"FileIO"}
            visit(each, file, each.name if named else name)

    for path in package.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if _LIKE.search(text):  # to take all modules apart would take seconds
            visit(ast.parse(text), path.relative_to(package).as_posix(), "")
    assert found == OWN_WRITERS


def fill(disk: Path, room: int) -> None:
    """Fill a disk except for some bytes."""
    with (disk / "fill").open("wb", buffering=0) as stream:
        try:
            while True:
                stream.write(bytes(4096))
        except OSError:
            pass
        stream.truncate(stream.tell() - room)


@pytest.mark.parametrize(
    ("name", "number", "more"),
    [
        ("x.mp4", signal.SIGTERM, ""),
        pytest.param("x.mp4", signal.SIGINT, "--workers 2", marks=pytest.mark.nightly),
        pytest.param("x%02d.png", signal.SIGINT, "", marks=pytest.mark.nightly),
    ],
)
def test_a_stopped_film_keeps_its_frames(
    name: str, number: signal.Signals, more: str, tmp_path: Path
) -> None:
    words = WRITERS[name].replace("speed=1", f"speed=0.001 {more}")  # far too long a film
    words = words.replace("480x360", "96x72")
    command = [sys.executable, "-m", "spacemap_vtk", *words.split(), str(tmp_path / name)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            wait_until(lambda: list(tmp_path.glob("*.frames/*.png")) or process.poll())
            wait_until(lambda: name != "x.mp4" or ffmpegs(tmp_path))
            process.send_signal(number)
            assert process.wait(300) == (143 if number == signal.SIGTERM else 1)
        finally:
            process.kill()
        assert process.stderr is not None
        printed = process.stderr.read()
    folder = tmp_path / f"{name}.frames"
    count = len(list(folder.glob("*.png")))
    assert printed == (
        f"spacemap: {count} frames are kept in {folder}; the same command continues from there\n"
        + "spacemap: stopped\n" * (number == signal.SIGINT)
    )
    assert list(tmp_path.iterdir()) == [folder]
    assert ffmpegs(tmp_path) == []


#: Raises a signal while VTK draws, in a Python callback of VTK.
_HEARD_IN_VTK = """
import os, signal, sys
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.offscreen import OffscreenWindow

def render(self, *rest, **more):
    self.renderer.AddObserver("StartEvent", lambda *_: os.kill(os.getpid(), signal.SIGTERM))
    plain(self, *rest, **more)

plain, OffscreenWindow.render = OffscreenWindow.render, render
main(sys.argv[1:])
"""


@pytest.mark.nightly
def test_a_film_can_be_stopped_inside_vtk(tmp_path: Path) -> None:
    prepare_offscreen()
    # At exit VTK waits for its threads, and the encoder thread waited for frames.
    words = [*WRITERS["x.gif"].split(), str(tmp_path / "x.gif"), "--workers", "1"]
    done = subprocess.run([sys.executable, "-c", _HEARD_IN_VTK, *words], timeout=300)
    assert done.returncode == 143
    assert [*tmp_path.glob("x.gif"), *tmp_path.glob(".spacemap-*")] == []


def test_ffmpeg_ends_if_drawing_fails(tmp_path: Path) -> None:
    def images() -> Iterator[NDArray[np.uint8]]:
        yield from np.zeros((5, 240, 320, 3), np.uint8)
        assert ffmpegs(tmp_path) != []
        raise RuntimeError

    with pytest.raises(RuntimeError), atomic_file(tmp_path / "x.mp4") as file:
        write_film(file, images(), 25.0)
    assert ffmpegs(tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def wait_until(done: Callable[[], object]) -> None:
    end = time.monotonic() + 300
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def ffmpegs(folder: Path) -> list[Path]:
    """Return the processes whose command line contains a temporary folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if f"{folder}/.spacemap-".encode() in process.read_bytes():
                found.append(process)
    return found


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name",
    ["x.png", "x.vtp", "x.ply", "x.mp4"],
)
def test_a_file_above_the_size_limit_is_reported(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(PRECIOUS)
    command = [sys.executable, "-m", "spacemap_vtk", *WRITERS[name].split(), str(tmp_path / name)]
    done = subprocess.run(
        command,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2**14, 2**14)),
        # compiled modules are files too: Python 3.11 would leave an incomplete one
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert (
        f"{tmp_path / name}: could not be written: the file is larger than allowed" in done.stderr
    )
    assert done.stderr.count("\n") == 1
    assert [(path, path.read_bytes()) for path in tmp_path.iterdir()] == [
        (tmp_path / name, PRECIOUS)
    ]


def test_a_read_only_disk_is_reported(small_disk: Callable[..., Path]) -> None:
    disk = small_disk(2**16, ",ro")
    with pytest.raises(InputError, match="the disk is read-only"):
        check_output(disk / "x.png", {".png": "picture"})
    printed = "could not be written: the disk is read-only"
    with pytest.raises(SpacemapError, match=printed), atomic_file(disk / "x.png"):
        pass


def test_an_unwritable_folder_is_refused_before_any_work() -> None:
    with pytest.raises(InputError, match="the folder /proc: it cannot be written to"):
        check_output(Path("/proc/x.png"), {".png": "picture"})


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("folder.png", "a folder of that name exists"),
        ("pipe.png", "a device or pipe of that name exists"),
        ("link.png", "is a link to .*precious.png. Remove the link, or write to its"),
        ("none.png", "is a link to nowhere"),
        ("full.png", "is a link to /dev/full"),
        (f"{'a' * 252}.png", "file name too long. Choose another name"),
        ("a\nb.png", "without control characters"),
        ("a\udcffb.png", "must be UTF-8"),
        ("precious.png/a.png", "precious.png is a file, not a folder"),
    ],
)
def test_output_replaces_only_regular_files(name: str, printed: str, tmp_path: Path) -> None:
    (tmp_path / "precious.png").write_bytes(PRECIOUS)
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    for link, target in (("link", tmp_path / "precious.png"), ("none", "nowhere")):
        (tmp_path / f"{link}.png").symlink_to(target)
    (tmp_path / "full.png").symlink_to("/dev/full")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match=printed):
        check_output(tmp_path / name, {".png": "picture"})
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "precious.png").read_bytes() == PRECIOUS


def test_nothing_is_written_into_a_forbidden_folder(folder_of_nobody: Path) -> None:
    (folder_of_nobody / "locked").mkdir(mode=0)
    with pytest.raises(InputError, match=r"the folder .*locked: permission denied"):
        check_output(folder_of_nobody / "locked/a.png", {".png": "picture"})


@pytest.mark.parametrize("program", [f"plot plain_weave {SMALL}", f"render plain_weave {SMALL}"])
@pytest.mark.nightly
def test_log_messages_of_libraries_are_not_printed(program: str, tmp_path: Path) -> None:
    # matplotlib has no folder for its font lists, and VTK no driver
    lacking = {"HOME": "/proc/none", "LIBGL_DRIVERS_PATH": "/proc/none", "MPLCONFIGDIR": ""}
    command = [
        sys.executable,
        "-m",
        "spacemap_vtk",
        *program.split(),
        "-o",
        str(tmp_path / "x.png"),
    ]
    done = subprocess.run(command, env={**os.environ, **lacking}, capture_output=True, text=True)
    if program.startswith("plot"):
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    else:
        assert done.returncode == 1
        assert done.stderr.startswith("spacemap: OpenGL cannot draw: no working driver")
        assert done.stderr.count("\n") == 1


def write_all(path: Path, names: list[str]) -> None:
    with atomic_files(path) as folder:
        for name in names:
            write_parts(folder / name, [b"new"])


def test_a_series_replaces_an_earlier_one(tmp_path: Path) -> None:
    for numbers in (3, 2):
        with atomic_files(tmp_path / "a.pvd") as folder:
            (folder / "a").mkdir()
            for number in range(numbers):
                write_parts(folder / "a" / f"a_{number}.vtp", [bytes([numbers])])
            write_parts(folder / "a.pvd", [bytes([numbers])])
    found = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert found == {"a.pvd", "a/a_0.vtp", "a/a_1.vtp"}
    assert (tmp_path / "a/a_1.vtp").read_bytes() == b"\2"


def test_a_folder_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    file = tmp_path / "a.png"

    def write_while_a_folder_appears() -> None:
        with atomic_files(file) as folder:
            (folder / file.name).write_bytes(b"new")
            file.mkdir()
            (file / "mine").touch()

    with pytest.raises(SpacemapError, match="a directory"):
        write_while_a_folder_appears()
    assert [path.name for path in tmp_path.rglob("*")] == ["a.png", "mine"]


def test_a_folder_is_not_replaced_by_a_file_of_a_series(tmp_path: Path) -> None:
    (tmp_path / "b.png").mkdir()
    with pytest.raises(SpacemapError, match="is a directory"):
        write_all(tmp_path / "a.png", ["a.png", "b.png"])
    assert [path.name for path in tmp_path.iterdir()] == ["b.png"]


def test_an_error_of_another_file_is_not_blamed_on_the_output(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    target = tmp_path / "out" / "x.png"
    with pytest.raises(FileNotFoundError, match=r"mesh\.ply"), atomic_file(target):
        (tmp_path / "mesh.ply").read_bytes()
    with pytest.raises(SpacemapError, match="nothing was written"), atomic_file(tmp_path / "x.png"):
        pass
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


@pytest.mark.parametrize(
    ("number", "printed"),
    [
        (errno.EDQUOT, "your quota on this disk is used up. Free some space"),
        (errno.EACCES, "permission denied. Choose another folder"),
        (errno.EIO, "input/output error"),
    ],
)
def test_rare_disk_errors_have_messages(number: int, printed: str, tmp_path: Path) -> None:
    with pytest.raises(SpacemapError) as caught, atomic_file(tmp_path / "x.png") as file:
        raise OSError(number, "whatever", str(file))
    assert str(caught.value).startswith(f"{tmp_path / 'x.png'}: could not be written: {printed}")


def test_parts_of_all_types_are_written(tmp_path: Path) -> None:
    write_parts(
        tmp_path / "a", [b"ab", np.arange(3, dtype="<u2"), np.empty((0, 3)), memoryview(b"c")]
    )
    assert (tmp_path / "a").read_bytes() == b"ab\0\0\1\0\2\0c"
    assert os.stat(tmp_path / "a").st_size == 9
