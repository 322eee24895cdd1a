"""Start Qt, and explain in one sentence if it cannot open a window."""

from __future__ import annotations

import builtins
import importlib.util
import os
import sys
from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING

from spacemap_vtk.errors import MissingLibraryError

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

#: Packages of the extra ``[qt]``, by their import names.
PACKAGES = ("PySide6", "tomlkit")
#: Debian packages with the libraries that Qt loads on X11 and that its wheels do not contain.
_DEBIAN_PACKAGES = (
    "libegl1 libgl1 libdbus-1-3 libfontconfig1 libglib2.0-0 libxkbcommon-x11-0 libxcb-cursor0 "
    "libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-render-util0 libxcb-shape0"
)
_INSTALL = f'On Debian or Ubuntu: "apt-get install {_DEBIAN_PACKAGES}".'
_NEEDS_DISPLAY = (
    'Run it on a desktop, or with "xvfb-run -a spacemap gui"; '
    '"spacemap render" and "spacemap animate" need no display.'
)


def require_packages(user: str, packages: Iterable[str], extra: str) -> None:
    """Check that the packages of an extra are installed."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise MissingLibraryError(
            f"{user} needs {', '.join(missing)}",
            cure=f"Run: pip install 'spacemap_vtk[{extra}]'",
        )


def require_window() -> None:
    """Check packages and display, and import Qt. Call this before any other import of Qt."""
    require_packages("the window", PACKAGES, "qt")
    if sys.platform.startswith("linux"):
        # EGL's warnings would only repeat the error that this program raises.
        os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise MissingLibraryError("there is no display for a window", cure=_NEEDS_DISPLAY)
    # PySide6 replaces Python's import function. The replacement reads the source of every module
    # that imports another, to look for a feature that is not used here; this takes as long as
    # importing all of Qt. Therefore the original function is restored.
    original = builtins.__import__
    try:
        import_module("PySide6.QtWidgets")
    except ImportError as error:
        raise MissingLibraryError(f"Qt cannot be loaded: {error}", cure=_INSTALL) from error
    finally:
        builtins.__import__ = original


def create_application() -> QApplication:
    """Create Qt's application; if Qt cannot open a window, print one sentence and exit."""
    from PySide6.QtCore import QtMsgType, qInstallMessageHandler
    from PySide6.QtWidgets import QApplication

    existing = QApplication.instance()
    if isinstance(existing, QApplication):
        return existing
    messages: list[str] = []

    def collect(kind: QtMsgType, _context: object, text: str) -> None:
        messages.append(text)
        if kind == QtMsgType.QtFatalMsg:
            # Qt aborts the process when this function returns.
            print(f"spacemap: {_explain(messages)}", file=sys.stderr, flush=True)
            os._exit(1)

    handler = qInstallMessageHandler(collect)
    try:
        return QApplication(sys.argv[:1])
    finally:
        qInstallMessageHandler(handler)


def _explain(messages: list[str]) -> str:
    """Return the reason why Qt cannot open a window, and the cure."""
    refused = any("connect to display" in text or "wl_display" in text for text in messages)
    if not refused:
        return f"Qt cannot open a window: {messages[0]}. {_INSTALL}"
    names = {name: os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")}
    shown = " nor ".join(f'{name}="{value}"' for name, value in names.items() if value)
    return f"cannot connect to the display {shown}. {_NEEDS_DISPLAY}"
