"""The window costs the other commands nothing, and says what it needs."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from window import require_display

from spacemap_vtk.app import requirements
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.graphics import can_load
from spacemap_vtk.errors import MissingLibraryError


def test_other_commands_import_no_qt() -> None:
    code = (
        "import sys\n"
        "from spacemap_vtk.cli.main import main\n"
        "try: main(['info', 'plain_weave', '--json'])\n"
        "except SystemExit: pass\n"
        "print([m for m in sys.modules if m.split('.')[0] in"
        " ('PySide6', 'pyvistaqt', 'qtpy', 'tomlkit', 'matplotlib')], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "[]"


def test_the_window_imports_neither_plotter_nor_solver() -> None:
    require_display()
    code = (
        "import sys\n"
        "import spacemap_vtk.app.launch\n"
        "from spacemap_vtk.app.canvas import Canvas\n"
        "heavy = ('pyvista', 'pyvistaqt', 'qtpy', 'matplotlib', 'PIL', 'cyclopts', 'mypy',"
        " 'scipy', 'psutil')\n"
        "found = [m for m in sys.modules if m.split('.')[0] in heavy]\n"
        "import pyvistaqt, pyvista, qtpy.QtCore\n"
        "whole = hasattr(pyvistaqt.QtInteractor, 'add_mesh')\n"
        "print(found, Canvas.__mro__[1].__module__, whole, pyvista._vtk.__name__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    # What comes after it gets the packages whole.
    assert done.stdout.strip() == "[] pyvistaqt.rwi True pyvista._vtk"


def test_the_first_picture_of_kept_modes_needs_no_solver(tmp_path: Path) -> None:
    require_display()
    code = (
        "import sys\n"
        "from spacemap_vtk.cli.main import main\n"
        "import spacemap_vtk.app.qt\n"
        "from PySide6.QtWidgets import QApplication\n"
        "from spacemap_vtk.app import splash\n"
        "def watch(self, window):\n"
        "    def told(frame):\n"
        "        heavy = ('scipy', 'psutil', 'matplotlib', 'numpy.ma',"
        " 'vtkmodules.vtkInteractionWidgets')\n"
        "        print(frame.coarse, [m for m in heavy if m in sys.modules])\n"
        "        QApplication.instance().quit()\n"
        "    window.director.drawn.connect(told)\n"
        "splash.Splash.give_way_to = watch\n"
        "main(['gui', 'plain_weave'])"
    )
    environment = {**os.environ, "SPACEMAP_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", code]
    first, again = (
        subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        for _ in range(2)
    )
    assert "scipy" in first.stdout
    assert again.stdout.strip() == "False []"


def test_without_the_extra_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(requirements, "PACKAGES", ("there_is_no_such_package",))
    with pytest.raises(SystemExit) as ended:
        main(["gui"])
    assert ended.value.code == 1
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "pip install 'spacemap_vtk[qt]'" in message


def test_a_missing_system_library_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(requirements, "PACKAGES", ())
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setattr(requirements, "LIBRARIES", ("libnosuch.so.7",))
    with pytest.raises(SystemExit) as ended:
        main(["gui"])
    assert ended.value.code == 1
    assert "apt-get install" in capsys.readouterr().err


def free_display() -> str:
    """Return an X display that no server has."""
    taken = {path.name for path in Path("/tmp/.X11-unix").glob("X*")}
    return next(f":{number}" for number in range(77, 977) if f"X{number}" not in taken)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of X and Wayland")
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"DISPLAY": free_display()},
        {"DISPLAY": "no name of a display"},
        {"WAYLAND_DISPLAY": "wayland-77"},
        {"DISPLAY": free_display(), "WAYLAND_DISPLAY": "wayland-77"},
    ],
)
def test_without_a_display_it_says_so(given: dict[str, str]) -> None:
    pytest.importorskip("PySide6")
    rest = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "spacemap_vtk", "gui"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**rest, **given}
    )
    # Qt aborts the process.
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    if given and not all(map(can_load, requirements.LIBRARIES)):
        assert "apt-get install" in done.stderr
        return
    assert "xvfb-run -a spacemap gui" in done.stderr
    for name, value in given.items():
        assert f'{name}="{value}"' in done.stderr
    assert given or "no display" in done.stderr


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of X and Wayland")
def test_a_wayland_server_alone_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requirements, "PACKAGES", ())
    monkeypatch.setattr(requirements, "LIBRARIES", ())
    monkeypatch.delenv("DISPLAY", raising=False)
    # The name of a socket may not be long.
    with TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as server:
        server.bind(f"{folder}/wayland-77")
        server.listen()
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        for name in ("wayland-77", f"{folder}/wayland-77"):
            monkeypatch.setenv("WAYLAND_DISPLAY", name)
            requirements.require_window()
        monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-78")
        with pytest.raises(MissingLibraryError, match="wayland-78"):
            requirements.require_window()


def test_a_wrong_name_is_refused_before_anything_opens(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["gui", "plain_weve"])
    assert ended.value.code == 2
    assert "plain_weave" in capsys.readouterr().err


def test_a_scene_that_cannot_be_read_ends_the_program_in_order(tmp_path: Path) -> None:
    require_display()
    scene = tmp_path / "bad.toml"
    scene.write_text("[weave]\nends = -3\n")
    command = [sys.executable, "-m", "spacemap_vtk", "gui", str(scene)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # Qt aborted the process, whose engine's thread still ran.
    assert done.returncode == 2
    assert "weave.ends = -3" in done.stderr
    assert done.stderr.count("\n") == 1
