"""Start the window."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from PySide6.QtCore import Qt, QTimer, qInstallMessageHandler
from PySide6.QtGui import QOpenGLContext

from spacemap_vtk import __version__
from spacemap_vtk.app.main_window import MainWindow
from spacemap_vtk.app.requirements import create_application
from spacemap_vtk.draw.graphics import INSTALL_DRIVERS, NO_DRIVER
from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.temporary_files import END_SIGNALS


def launch(
    scene: str | None,
    on_created: Callable[[MainWindow], object] | None = None,
    preset: Mapping[str, Any] | None = None,
) -> None:
    """Open the window and return when it is closed; `preset` is what `apply_preset` receives."""
    app = create_application()
    if app.platformName() == "xcb":
        _require_opengl()
    app.setApplicationName("spacemap")
    app.setOrganizationName("spacemap")
    app.setApplicationVersion(__version__)
    window = MainWindow()
    if on_created is not None:
        on_created(window)
    try:
        window.start(scene)
        if preset is not None:
            window.apply_preset(**preset)
    except BaseException:
        # The engine's thread is running. Qt aborts the process if it exits with that thread alive.
        window.discard()
        raise
    window.show()
    window.director.drawn.connect(_preload_eigensolver, Qt.ConnectionType.SingleShotConnection)
    # An idle Qt event loop runs no Python code, so Ctrl-C would have no effect until the next
    # click. The timer lets Python handle signals.
    # It does not close the window itself: while a question about unsaved changes is open, the timer
    # would not fire again, and no further signal would be heard.
    signal.signal(signal.SIGINT, lambda *_: QTimer.singleShot(0, window.close))
    ended: list[int] = []

    def end(number: int, _frame: object) -> None:
        # Close the window without questions; unfinished exports leave no files.
        ended.append(number)
        window.discard()
        app.quit()

    for number in END_SIGNALS:
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, end)
    timer = QTimer(window)
    timer.timeout.connect(lambda: None)
    timer.start(200)
    app.exec()
    if ended:
        sys.exit(128 + ended[0])


def _require_opengl() -> None:
    """Raise an error if OpenGL has no driver; otherwise the window would stay grey."""
    handler = qInstallMessageHandler(lambda *_: None)
    try:
        created = QOpenGLContext().create()
    finally:
        qInstallMessageHandler(handler)
    if not created:
        raise MissingLibraryError(NO_DRIVER, cure=INSTALL_DRIVERS)


def _preload_eigensolver(_frame: object) -> None:
    """Import the eigensolver after the first picture, or else the first drag would wait for it."""
    thread = threading.Thread(target=import_module, args=("spacemap_vtk.mechanics.modal.eigen",))
    QTimer.singleShot(500, thread.start)
