"""Formats that come with the program: each module in this folder registers its own.

A module imports neither numpy nor VTK at its top, because lists of formats do not need them; its
functions import them. Formats of other packages are registered after these
(`spacemap_vtk.extensions`).
"""

from importlib import import_module
from pkgutil import iter_modules

from spacemap_vtk import extensions

# In all lists of formats VTK's own come first, because they store everything that a scene has. The
# XML formats, which all programs based on VTK know, come before the other ones.
for _name in sorted(
    (module.name for module in iter_modules(__path__)),
    key=lambda name: (name != "vtk_xml", not name.startswith("vtk"), name),
):
    import_module(f"{__name__}.{_name}")
extensions.load_all("formats")
