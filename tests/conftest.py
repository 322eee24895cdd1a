"""Every test fails on anything that VTK prints, and on a stage that is never freed."""

from __future__ import annotations

import gc
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# Workers have a core each. OpenBLAS' threads keep one while they wait for the next call: of tests
# that solve small problems they take two thirds of the time. It reads this as NumPy is imported.
os.environ["OPENBLAS_NUM_THREADS"] = os.environ.get("OPENBLAS_NUM_THREADS", "1")

from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

from spacemap_vtk.app.requirements import require_window
from spacemap_vtk.draw import graphics
from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.scenes import library

# Collecting garbage would take a sixth of the time in which the tests are imported: `noted_stages`
# enables it before the first one runs.
gc.disable()

# A container may forbid to keep what is compiled: then each of a hundred processes that the tests
# start, and each worker, would compile the package and the tests anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Where the libraries of OpenGL are missing, a test is skipped as soon as it asks for them.
if missing := graphics.missing_libraries():
    reason = f"{' and '.join(missing)} not found"
    graphics.require_opengl = lambda what: pytest.skip(reason)


def own_screen() -> subprocess.Popen[str] | None:
    """Start a screen for this one of several processes: windows take the keyboard from each other.

    It ends with this process, however that ends: then nothing holds the pipe open any more.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ or "DISPLAY" not in os.environ:
        return None
    if shutil.which("Xvfb") is None:
        # tests/window.py then skips what opens windows.
        del os.environ["DISPLAY"]
        return None
    script = "Xvfb -displayfd 1 -screen 0 1600x1000x24 2>/dev/null & read -r _; kill $!"
    pipe = subprocess.PIPE
    shell = subprocess.Popen(["sh", "-c", script], stdin=pipe, stdout=pipe, text=True)
    assert shell.stdout is not None
    os.environ.pop("WAYLAND_DISPLAY", None)
    os.environ["DISPLAY"] = f":{shell.stdout.readline().strip()}"
    return shell


_screen = own_screen()


def pytest_unconfigure() -> None:
    if _screen is not None:
        _screen.communicate()


# pytest-qt imports Qt at once, and would end every run where Qt's own libraries are missing: it is
# kept from loading itself (see pyproject.toml), and loaded here where a window can be opened.
try:
    require_window()
except MissingLibraryError:
    pass
else:
    os.environ["PYTEST_QT_API"] = os.environ["QT_API"] = "pyside6"
    pytest_plugins = ["pytestqt.plugin"]


# An example may take as long as a busy machine lets it. The nightly run tries many more of them.
settings.register_profile("gate", deadline=None, max_examples=12)
settings.register_profile("nightly", deadline=None, max_examples=200)


def pytest_configure(config: pytest.Config) -> None:
    settings.load_profile("gate" if config.option.markexpr == "not nightly" else "nightly")


@contextmanager
def silence() -> Iterator[vtkStringOutputWindow]:
    window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    yield window
    vtkOutputWindow.SetInstance(usual)
    assert window.GetOutput() == ""


@pytest.fixture(autouse=True)
def silent_vtk() -> Iterator[vtkStringOutputWindow]:
    with silence() as window:
        yield window


@pytest.fixture(autouse=True, scope="session")
def heard_signals() -> None:
    """Let children hear what ends programs, though the tests be run in the background.

    What is ignored there, and under nohup, stays ignored in a new program; what has a handler not.
    """
    for name in ("SIGINT", "SIGHUP"):
        number = getattr(signal, name, None)
        if number and signal.getsignal(number) == signal.SIG_IGN:
            usual = signal.default_int_handler if name == "SIGINT" else lambda *_: None
            signal.signal(number, usual)


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep solved modes out of the user's cache; tests of the cache choose a folder."""
    monkeypatch.setenv("SPACEMAP_CACHE", "off")


@pytest.fixture
def kept_modes(no_cache: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the scenes that come with the program be solved once in both runs of .ci/run."""
    monkeypatch.setenv("SPACEMAP_CACHE", os.environ.get("SPACEMAP_TESTS_CACHE", "off"))


#: What takes longest, or waits for other processes, comes first: so no worker is left with it when
#: the others are done.
_SLOW = (
    *("test_paraview", "test_scenes", "test_mpi", "test_site", "test_contributing", "test_cages"),
    *("test_serve", "test_html", "test_killed", "test_study", "test_calculix_transient"),
    *("test_window_export", "test_window_files", "test_window_lives", "test_window_walk_engineer"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.path.stem not in _SLOW)


#: Every stage made. To look for them among all objects would take 25 ms, twice a test; and a set of
#: weak references runs Python where a stage dies, which may be within VTK's collector.
_made: list[weakref.ref[Stage]] = []


@pytest.fixture(autouse=True, scope="session")
def noted_stages() -> Iterator[None]:
    make = Stage.__new__

    def noted(cls: type[Stage], *args: Any, **values: Any) -> Stage:
        stage = make(cls)
        _made.append(weakref.ref(stage))
        return stage

    Stage.__new__ = noted
    # What is imported stays: no collection need go through it again, and there are a thousand.
    gc.collect()
    gc.freeze()
    gc.enable()
    yield
    Stage.__new__ = make


@contextmanager
def freed_stages() -> Iterator[None]:
    before = len(_made)
    yield
    if any(stage() is not None for stage in _made[before:]):
        gc.collect()
        # What is left then stays, as what had been imported: the next look need not go through it.
        if all(stage() is None for stage in _made):
            gc.freeze()
    leaked = [stage for stage in _made[before:] if stage() is not None]
    del _made[before:]
    assert not leaked


#: The modules whose tests share a window, while they run: one, or none.
_sharing: list[Any] = []


@pytest.fixture(autouse=True)
def no_leaked_stages() -> Iterator[None]:
    # Stages of the window that a module shares are freed with it: see `module_window`. Its timers
    # may make one while a test runs that does not use it.
    with nullcontext() if _sharing else freed_stages():
        yield


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """Make disks that are full after so many bytes, if this user may mount any."""
    made = []

    def make(size: int, options: str = "") -> Path:
        disk = tmp_path / f"disk{len(made)}"
        disk.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}{options}", "tmpfs", str(disk)]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no disk can be mounted here: {getattr(error, 'stderr', error)}")
        made.append(disk)
        return disk

    yield make
    for disk in made:
        subprocess.run(["umount", "--recursive", str(disk)], check=True)


@pytest.fixture
def folder_of_nobody() -> Iterator[Path]:
    """Make a folder, and be meanwhile whom permissions bind, as they do not bind root."""
    import spacemap_vtk.io.formats  # noqa: F401  # whose files this user may not read

    with tempfile.TemporaryDirectory() as name:
        os.chmod(name, 0o777)
        if root := os.geteuid() == 0:
            os.seteuid(65534)
        yield Path(name)
        if root:
            os.seteuid(0)
        for path in Path(name).rglob("*"):
            path.chmod(0o700)


@contextmanager
def freed_windows(app: Any) -> Iterator[Callable[[], Any]]:
    """Make windows as a person opens them; all are closed and freed."""
    from PySide6.QtCore import QCoreApplication, QEvent
    from shiboken6 import isValid
    from window import SIZE

    from spacemap_vtk.app.main_window import MainWindow

    opened: list[Any] = []

    def make() -> Any:
        opened.append(MainWindow())
        opened[-1].resize(*SIZE)
        return opened[-1]

    yield make
    for window in opened:
        # A test that closes its window has freed it.
        if isValid(window):
            window.discard()
    opened.clear()
    app.processEvents()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    gc.collect()


@pytest.fixture(scope="session")
def coarse_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy the scenes that come with the program; those that most tests open get fewer facets.

    A window computes and draws them again after most of what a test does in it.
    """
    folder = tmp_path_factory.mktemp("scenes")
    shutil.copytree(library.folder(), folder, dirs_exist_ok=True)
    names = ("plain_weave", "calculix_fabric", "double_weave", "gust", "handweaving", "stockinette")
    for name in names:
        scene = folder / f"{name}.toml"
        text, count = re.subn(r"(?m)^subdivisions = \d+", "subdivisions = 2", scene.read_text())
        assert count == 1
        scene.write_text(text)
    with (folder / "twill_2_2.toml").open("a") as stream:
        stream.write("[surface]\nsubdivisions = 2\n")
    return folder


@pytest.fixture
def own_settings(
    request: pytest.FixtureRequest,
    tmp_path: Path,
    coarse_library: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Let what windows remember be this test's alone; draw coarse scenes, and each pixel once."""
    from PySide6.QtCore import QSettings

    from spacemap_vtk.app.view import view3d

    monkeypatch.setattr(library, "folder", lambda: coarse_library)
    monkeypatch.setattr(view3d, "FINE_SAMPLES", 1)
    request.getfixturevalue("qapp").setApplicationName("spacemap")
    QSettings.setDefaultFormat(QSettings.Format.IniFormat)
    QSettings.setPath(QSettings.Format.IniFormat, QSettings.Scope.UserScope, str(tmp_path))


def begin(window: Any, scene: str | None, wait: bool) -> Any:
    from window import settled, wait_until

    window.start(scene)
    window.show()
    if wait:
        wait_until(lambda: settled(window))
    return window


@pytest.fixture
def open_window(request: pytest.FixtureRequest, own_settings: None) -> Iterator[Callable[..., Any]]:
    """Open windows of the test's own: for what starts, closes, cancels, or leaves one changed.

    A slot that fails fails the test: pytest-qt sees to it.
    """
    with freed_windows(request.getfixturevalue("qapp")) as make:
        yield lambda scene="plain_weave", wait=True: begin(make(), scene, wait)


@pytest.fixture(scope="module")
def module_window(request: pytest.FixtureRequest) -> Iterator[Callable[[int], Any]]:
    """Make a module's window when it is first asked for; all that it had made goes with it."""
    with silence(), freed_stages(), freed_windows(request.getfixturevalue("qapp")) as make:
        window = cache(lambda _failures: make())
        _sharing.append(request.node)
        yield window
        _sharing.pop()
        window.cache_clear()


@pytest.fixture
def open_scene(
    request: pytest.FixtureRequest, module_window: Callable[[int], Any], own_settings: None
) -> Callable[..., Any]:
    """Open a scene in the window that the module's tests share: a quarter of a new one's time.

    A test that fails may leave anything in it: the next one has another window.
    """
    from window import as_new

    failures = request.session.testsfailed
    return lambda scene="plain_weave", wait=True: begin(
        as_new(module_window(failures)), scene, wait
    )


TWILL = """title = "twill"
[weave]
draft = "twill.wif"
[cage]
divisions = [2, 2, 1]
[modal]
[response]
"""
WIF = """[WIF]
Version=1.1
Date=April 20, 1997
Developers=wif@mhsoft.com
Source Program=by hand
[CONTENTS]
WEAVING=true
WARP=true
WEFT=true
THREADING=true
TIEUP=true
TREADLING=true
[WEAVING]
Shafts=4
Treadles=4
Rising Shed=true
[WARP]
Threads=8
[WEFT]
Threads=8
[THREADING]
1=1
2=2
3=3
4=4
5=1
6=2
7=3
8=4
[TIEUP]
1=1,2
2=2,3
3=3,4
4=1,4
[TREADLING]
1=1
2=2
3=3
4=4
5=1
6=2
7=3
8=4
"""


@pytest.fixture
def twill(tmp_path: Path) -> Path:
    (tmp_path / "twill.wif").write_text(WIF)
    (tmp_path / "twill.toml").write_text(TWILL)
    return tmp_path / "twill.toml"


@pytest.fixture
def draft_of(open_scene: Any) -> Any:
    """Open a scene with its draft in sight."""
    from PySide6.QtGui import QColor
    from window import settled, wait_until

    def open_(scene: object, wait: bool = True) -> Any:
        window = open_scene(str(scene), wait=False)
        draft = window.draft
        window.tabs.setCurrentWidget(draft)
        wait_until(lambda: not wait or settled(window))
        draft.grid.color = QColor("#2d6a8e")
        for tool in (draft.colors_button, draft.cloth_button):
            tool.setChecked(True)
        off = draft.reverse_button, draft.select_button, draft.float_box, draft.counts_button
        for tool in off:
            tool.setChecked(False)
        draft.grid.select(None)
        draft.fit_button.click()
        return window

    return open_
