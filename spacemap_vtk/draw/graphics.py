"""Whether this machine can draw, asked before VTK tries and crashes."""

from __future__ import annotations

import ctypes
import os
import sys

from spacemap_vtk.errors import MissingLibraryError

#: Where there is an OpenGL library that draws nothing.
NO_DRIVER = "OpenGL draws nothing here: no driver of its library works"
DRIVERS = (
    'On Debian or Ubuntu: "apt-get install libgl1-mesa-dri"; on Fedora: "dnf install '
    'mesa-dri-drivers": these draw without a graphics card, too.'
)


def prepare_offscreen() -> None:
    """Choose VTK's offscreen window, and make sure that the libraries it loads are there.

    Raises
    ------
    MissingLibraryError
        On Linux, if there is neither EGL nor OSMesa: VTK's wheel would end in a segmentation
        fault at its first window.
    """
    if not sys.platform.startswith("linux"):
        return
    # Both are needed for EGL: VTK's wheel loads libEGL for the window and libGL for the calls.
    missing = [name for name in ("libEGL.so.1", "libGL.so.1") if not can_load(name)]
    if not missing:
        window = "vtkEGLRenderWindow"
    elif can_load("libOSMesa.so.8") or can_load("libOSMesa.so"):
        window = "vtkOSOpenGLRenderWindow"
    else:
        raise MissingLibraryError(
            f"{' and '.join(missing)} not found: pictures need an OpenGL library",
            cure='On Debian or Ubuntu: "apt-get install libegl1 libgl1"; '
            'on Fedora: "dnf install mesa-libEGL mesa-libGL".',
        )
    # Otherwise VTK asks an X server first, and says that there is none.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", window)


def can_load(name: str) -> bool:
    """Return whether the system finds a shared library."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
