"""Whether a window can be opened here, asked before Qt tries and aborts."""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import os
import sys
from collections.abc import Iterable

from spacemap_vtk.draw.graphics import can_load
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
_CURE = (
    'Start it {}, or with "xvfb-run -a spacemap gui"; '
    '"spacemap render" and "spacemap animate" need no display.'
)


def require_packages(what: str, packages: Iterable[str], extra: str) -> None:
    """Check that an extra's packages are here."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise MissingLibraryError(
            f"{what} needs {', '.join(missing)}",
            cure=f"Run: pip install 'spacemap_vtk[{extra}]'",
        )


def require_window() -> None:
    """Check packages, system libraries and display."""
    require_packages("the window", PACKAGES, "qt")
    if not sys.platform.startswith("linux"):
        return
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")  # of what it warns an error tells
    displays = {name: os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")}
    if not any(displays.values()):
        raise MissingLibraryError(
            "there is no display to open a window on", cure=_CURE.format("from a desktop")
        )
    absent = [name for name in LIBRARIES if not can_load(name)]
    if absent:
        raise MissingLibraryError(
            f"{', '.join(absent)} not found: Qt needs them to open a window",
            cure=f'On Debian or Ubuntu: "apt-get install {DEBIAN}".',
        )
    x, wayland = displays.values()
    if not (x and _x_answers(x)) and not (wayland and _wayland_answers(wayland)):
        named = " nor ".join(f'{name}="{value}"' for name, value in displays.items() if value)
        raise MissingLibraryError(
            f"no display server lets this program in at {named}",
            cure=_CURE.format("with the name of a display that runs"),
        )


@functools.cache
def _x_answers(display: str) -> bool:
    """Whether an X server takes this program in, as Qt asks it."""
    xcb = ctypes.CDLL("libxcb.so.1")
    xcb.xcb_connect.restype = ctypes.c_void_p
    xcb.xcb_connect.argtypes = ctypes.c_char_p, ctypes.c_void_p
    xcb.xcb_connection_has_error.argtypes = (ctypes.c_void_p,)
    # Left open as long as the process lives: a server like Xvfb begins anew when its last client
    # goes, and Qt would have to wait for it.
    return not xcb.xcb_connection_has_error(xcb.xcb_connect(os.fsencode(display), None))


def _wayland_answers(display: str) -> bool:
    """Whether a Wayland server listens."""
    import socket  # only here: to import it takes longer than all else

    with socket.socket(socket.AF_UNIX) as probe:
        try:
            # An absolute name needs no folder, and replaces it.
            probe.connect(os.path.join(os.environ.get("XDG_RUNTIME_DIR", ""), display))
        except OSError:
            return False
    return True
