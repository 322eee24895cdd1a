"""Whether this machine can draw, asked before VTK tries and crashes."""

from __future__ import annotations

import ctypes
import os
import sys

from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.parallel import loops

#: Where there is an OpenGL library that draws nothing.
NO_DRIVER = "OpenGL draws nothing here: no driver of its library works"
DRIVERS = (
    'On Debian or Ubuntu: "apt-get install libgl1-mesa-dri"; on Fedora: "dnf install '
    'mesa-dri-drivers": these draw without a graphics card, too.'
)


#: What VTK's wheel loads: libEGL for the window, libGL for the calls.
_LIBRARIES = ("libEGL.so.1", "libGL.so.1")
_INSTALL = (
    'On Debian or Ubuntu: "apt-get install libegl1 libgl1"; '
    'on Fedora: "dnf install mesa-libEGL mesa-libGL".'
)
#: Set to "never", it lets this program draw without OpenGL, as where there is none.
VARIABLE = "SPACEMAP_OPENGL"


def missing_libraries() -> list[str]:
    """Return the libraries without which OpenGL draws nothing; none where it can draw."""
    if os.environ.get(VARIABLE) == "never":
        return list(_LIBRARIES)
    if not sys.platform.startswith("linux"):
        return []
    missing = [name for name in _LIBRARIES if not can_load(name)]
    return [] if missing and _osmesa() else missing


def prepare_offscreen() -> None:
    """Choose VTK's offscreen window, and make sure that the libraries it loads are there.

    Raises
    ------
    MissingLibraryError
        On Linux, if there is neither EGL nor OSMesa: VTK's wheel would end in a segmentation
        fault at its first window.
    """
    require_opengl("pictures need")
    if sys.platform.startswith("linux"):
        found = all(map(can_load, _LIBRARIES))
        # Otherwise VTK asks an X server first, and says that there is none.
        os.environ.setdefault(
            "VTK_DEFAULT_OPENGL_WINDOW",
            "vtkEGLRenderWindow" if found else "vtkOSOpenGLRenderWindow",
        )


def require_opengl(what: str) -> None:
    """Refuse something where no OpenGL library can be loaded."""
    if missing := missing_libraries():
        raise MissingLibraryError(
            f"{' and '.join(missing)} not found: {what} an OpenGL library", cure=_INSTALL
        )


def draws_without_opengl() -> bool:
    """Return whether pictures are drawn without OpenGL; refuse a machine that cannot draw."""
    if (
        missing_libraries()
        and loops("spacemap_vtk.draw.software.raster_loops", many=True) is not None
    ):
        return True
    prepare_offscreen()
    return False


#: Said of a picture that is drawn without OpenGL.
WITHOUT_OPENGL = (
    "drawn without OpenGL, whose libraries were not found; cloths of very many yarns and "
    f'"spacemap serve" need them. {_INSTALL}'
)


def _osmesa() -> bool:
    return can_load("libOSMesa.so.8") or can_load("libOSMesa.so")


def can_load(name: str) -> bool:
    """Return whether the system finds a shared library."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
