"""Check whether this machine can draw, because VTK would crash without OpenGL libraries."""

from __future__ import annotations

import ctypes
import os
import sys

from spacemap_vtk.errors import MissingLibraryError
from spacemap_vtk.parallel import load_loops

#: Message for a machine whose OpenGL library has no working driver, and its cure.
NO_DRIVER = "OpenGL cannot draw: no working driver was found"
INSTALL_DRIVERS = (
    'On Debian or Ubuntu: "apt-get install libgl1-mesa-dri"; on Fedora: "dnf install '
    'mesa-dri-drivers". These drivers also work without a graphics card.'
)

#: Libraries that VTK's wheel loads: libEGL for the window, libGL for the OpenGL functions.
_LIBRARIES = ("libEGL.so.1", "libGL.so.1")
_INSTALL = (
    'On Debian or Ubuntu: "apt-get install libegl1 libgl1"; '
    'on Fedora: "dnf install mesa-libEGL mesa-libGL".'
)
#: Environment variable; with the value "never", this program draws without OpenGL.
OPENGL_VARIABLE = "SPACEMAP_OPENGL"


def missing_libraries() -> list[str]:
    """Return the names of missing OpenGL libraries; an empty list if OpenGL can draw."""
    if os.environ.get(OPENGL_VARIABLE) == "never":
        return list(_LIBRARIES)
    if not sys.platform.startswith("linux"):
        return []
    missing = [name for name in _LIBRARIES if not can_load(name)]
    return [] if missing and _has_osmesa() else missing


def prepare_offscreen() -> None:
    """Choose VTK's offscreen window, and check that the libraries it loads are installed.

    Raises
    ------
    MissingLibraryError
        On Linux, if there is neither EGL nor OSMesa. VTK's wheel would crash with a segmentation
        fault when it opens its first window.
    """
    require_opengl("pictures")
    if sys.platform.startswith("linux"):
        found = all(map(can_load, _LIBRARIES))
        # Otherwise VTK tries an X server first, and prints an error if there is none.
        os.environ.setdefault(
            "VTK_DEFAULT_OPENGL_WINDOW",
            "vtkEGLRenderWindow" if found else "vtkOSOpenGLRenderWindow",
        )


def require_opengl(what: str) -> None:
    """Raise MissingLibraryError if no OpenGL library can be loaded; `what` are things to draw."""
    if missing := missing_libraries():
        raise MissingLibraryError(
            f"{' and '.join(missing)} not found: {what} need OpenGL", cure=_INSTALL
        )


def uses_software_renderer() -> bool:
    """Test whether pictures are drawn without OpenGL; raise an error if nothing can draw."""
    if (
        missing_libraries()
        and load_loops("spacemap_vtk.draw.software.raster_loops", many=True) is not None
    ):
        return True
    prepare_offscreen()
    return False


#: Warning about a picture that is drawn without OpenGL.
WITHOUT_OPENGL = (
    "OpenGL libraries were not found: pictures are drawn without them; cloths of very many yarns "
    f'and "spacemap serve" need them. {_INSTALL}'
)


def _has_osmesa() -> bool:
    return can_load("libOSMesa.so.8") or can_load("libOSMesa.so")


def can_load(name: str) -> bool:
    """Test whether the system can load a shared library."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
