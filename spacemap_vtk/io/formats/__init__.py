"""The formats that come with the program: each module here registers its own, by being here.

A module's head imports neither numpy nor VTK, which lists of formats need not; its functions do.
The formats of other packages come after these (`spacemap_vtk.extensions`).
"""

from importlib import import_module
from pkgutil import iter_modules

from spacemap_vtk import extensions

# VTK's own come first wherever formats are listed, those that all of its programs know before the
# others: they hold all that a scene has.
for _name in sorted(
    (module.name for module in iter_modules(__path__)),
    key=lambda name: (name != "vtk_xml", not name.startswith("vtk"), name),
):
    import_module(f"{__name__}.{_name}")
extensions.load_all("formats")
