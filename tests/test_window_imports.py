"""Imports of the window, and messages about what it needs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from window import require_display

from spacemap_vtk.app import requirements
from spacemap_vtk.cli.main import main


def test_window_imports_neither_plotter_nor_solver() -> None:
    require_display()
    code = (
        "import sys\n"
        "import spacemap_vtk.app.launch\n"
        "heavy = ('pyvista', 'matplotlib', 'PIL', 'cyclopts', 'mypy', 'scipy', 'psutil')\n"
        "print([m for m in sys.modules if m.split('.')[0] in heavy])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.nightly
def test_first_picture_with_cached_modes_imports_no_solver(tmp_path: Path) -> None:
    require_display()
    code = (
        "import sys\n"
        "from spacemap_vtk.cli.main import main\n"
        "from spacemap_vtk.app.requirements import require_window\n"
        "require_window()\n"
        "from PySide6.QtWidgets import QApplication\n"
        "from spacemap_vtk.app import splash\n"
        "def watch(self, window):\n"
        "    def reported(frame):\n"
        "        heavy = ('scipy', 'psutil', 'matplotlib', 'numpy.ma',"
        " 'vtkmodules.vtkInteractionWidgets')\n"
        "        print(frame.coarse, [m for m in heavy if m in sys.modules])\n"
        "        QApplication.instance().quit()\n"
        "    window.director.drawn.connect(reported)\n"
        "splash.Splash.close_after_first_frame = watch\n"
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


def test_missing_extra_is_reported_with_the_command_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(requirements, "PACKAGES", ("there_is_no_such_package",))
    with pytest.raises(SystemExit) as ended:
        main(["gui"])
    assert ended.value.code == 1
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "pip install 'spacemap_vtk[qt]'" in message


def test_missing_system_library_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def lacking(_name: str) -> None:
        raise ImportError("libEGL.so.1: cannot open shared object file")

    monkeypatch.setattr(requirements, "PACKAGES", ())
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setattr(requirements, "import_module", lacking)
    with pytest.raises(SystemExit) as ended:
        main(["gui"])
    assert ended.value.code == 1
    message = capsys.readouterr().err
    assert "libEGL.so.1" in message
    assert "apt-get install" in message


def free_display() -> str:
    """Return the name of an X display without a server."""
    used = {path.name for path in Path("/tmp/.X11-unix").glob("X*")}
    return next(f":{number}" for number in range(77, 977) if f"X{number}" not in used)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of X and Wayland")
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"DISPLAY": free_display()},
        pytest.param({"DISPLAY": "no name of a display"}, marks=pytest.mark.nightly),
        pytest.param({"WAYLAND_DISPLAY": "wayland-77"}, marks=pytest.mark.nightly),
        pytest.param(
            {"DISPLAY": free_display(), "WAYLAND_DISPLAY": "wayland-77"}, marks=pytest.mark.nightly
        ),
    ],
)
def test_missing_display_is_reported(given: dict[str, str]) -> None:
    pytest.importorskip("PySide6")
    rest = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "spacemap_vtk", "gui"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**rest, **given}
    )
    # Qt alone would abort the process.
    assert done.returncode == 1
    # Wayland's library prints another line.
    message = done.stderr.splitlines()[-1]
    assert message.startswith("spacemap: ")
    assert done.stderr.count("\n") == 1 or "WAYLAND_DISPLAY" in given
    assert "xvfb-run -a spacemap gui" in message
    for name, value in given.items():
        assert f'{name}="{value}"' in message
    assert given or "no display" in message


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of X and Wayland")
def test_missing_qt_plugin_is_named() -> None:
    require_display()
    environment = {**os.environ, "QT_QPA_PLATFORM": "none_such"}
    command = [sys.executable, "-m", "spacemap_vtk", "gui"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "none_such" in done.stderr
    assert "apt-get install" in done.stderr


def test_unknown_scene_name_is_refused_before_a_window_opens(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["gui", "plain_weve"])
    assert ended.value.code == 2
    assert "plain_weave" in capsys.readouterr().err


def test_unreadable_scene_ends_the_program_with_one_message(tmp_path: Path) -> None:
    require_display()
    scene = tmp_path / "bad.toml"
    scene.write_text("[weave]\nends = -3\n")
    command = [sys.executable, "-m", "spacemap_vtk", "gui", str(scene)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # Qt once aborted the process because the engine's thread was running.
    assert done.returncode == 2
    assert "weave.ends = -3" in done.stderr
    assert done.stderr.count("\n") == 1
