"""Every test fails on anything that VTK prints, and on a stage that is never freed."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

from spacemap_vtk.filters.base import Stage


@pytest.fixture(autouse=True)
def silent_vtk() -> Iterator[vtkStringOutputWindow]:
    window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    yield window
    vtkOutputWindow.SetInstance(usual)
    assert window.GetOutput() == ""


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep solved modes out of the user's cache; tests of the cache choose a folder."""
    monkeypatch.setenv("SPACEMAP_CACHE", "off")


@pytest.fixture(autouse=True)
def no_leaked_stages() -> Iterator[None]:
    before = _stages()
    yield
    leaked = _stages() - before
    if leaked:
        gc.collect()
        leaked = _stages() - before
    assert not leaked


def _stages() -> set[int]:
    return {id(thing) for thing in gc.get_objects() if isinstance(thing, Stage)}


@pytest.fixture
def open_window(tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Open windows as a person does; all are closed and freed, and no slot may have failed."""
    from PySide6.QtCore import QCoreApplication, QEvent, QSettings
    from PySide6.QtWidgets import QApplication
    from window import settled, wait_until

    import spacemap_vtk.app.launch  # noqa: F401  chooses the Qt binding
    from spacemap_vtk.app.main_window import MainWindow

    app = QApplication.instance() or QApplication([])
    app.setApplicationName("spacemap")
    QSettings.setDefaultFormat(QSettings.Format.IniFormat)
    QSettings.setPath(QSettings.Format.IniFormat, QSettings.Scope.UserScope, str(tmp_path))
    failures: list[Any] = []
    usual, sys.excepthook = sys.excepthook, lambda *error: failures.append(error)
    opened: list[Any] = []

    def open_(scene: str | None = "plain_weave", wait: bool = True) -> Any:
        window = MainWindow()
        opened.append(window)
        window.resize(1200, 800)
        window.start(scene)
        window.show()
        if wait:
            wait_until(lambda: settled(window))
        return window

    yield open_
    for window in opened:
        window.discard()
    opened.clear()
    app.processEvents()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    gc.collect()
    sys.excepthook = usual
    assert not failures
