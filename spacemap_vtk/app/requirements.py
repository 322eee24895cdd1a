"""Whether a window can be opened here, asked before Qt tries and aborts."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys

from spacemap_vtk.errors import MissingLibraryError

#: The packages of the extra ``[qt]``, by the name they are imported under.
PACKAGES = ("PySide6", "pyvistaqt", "tomlkit")
#: Libraries that Qt's window plugin loads on X11, and that wheels do not bring.
LIBRARIES = (
    "libGL.so.1",
    "libEGL.so.1",
    "libdbus-1.so.3",
    "libfontconfig.so.1",
    "libglib-2.0.so.0",
    "libxkbcommon-x11.so.0",
    "libxcb-cursor.so.0",
    "libxcb-icccm.so.4",
    "libxcb-image.so.0",
    "libxcb-keysyms.so.1",
    "libxcb-render-util.so.0",
    "libxcb-shape.so.0",
)
#: The packages of Debian that hold them.
DEBIAN = (
    "libegl1 libgl1 libdbus-1-3 libfontconfig1 libglib2.0-0 libxkbcommon-x11-0 libxcb-cursor0 "
    "libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-render-util0 libxcb-shape0"
)


def require_window() -> None:
    """Check packages, system libraries and display.

    Raises
    ------
    MissingLibraryError
        If something is not there; the message says what to install. Qt itself would abort the
        process.
    """
    missing = [name for name in PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        raise MissingLibraryError(
            f"the window needs {', '.join(missing)}",
            cure="Run: pip install 'spacemap_vtk[qt]'",
        )
    if not sys.platform.startswith("linux"):
        return
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise MissingLibraryError(
            "there is no display to open a window on",
            cure='Start it from a desktop, or with "xvfb-run -a spacemap gui"; '
            '"spacemap render" and "spacemap animate" need no display.',
        )
    absent = [name for name in LIBRARIES if not _loads(name)]
    if absent:
        raise MissingLibraryError(
            f"{', '.join(absent)} not found: Qt needs them to open a window",
            cure=f'On Debian or Ubuntu: "apt-get install {DEBIAN}".',
        )


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
