"""The ParaView plugin: load this file by Tools > Manage Plugins, or see `spacemap paraview`.

It finds the package by its own place, so that ParaView's Python needs nothing on its path: the
folder that holds an installed spacemap_vtk may hold another numpy or VTK as well.
"""

import importlib.util
import sys
from pathlib import Path

if "spacemap_vtk" not in sys.modules:
    _package = Path(__file__).resolve().parents[1]
    _spec = importlib.util.spec_from_file_location(
        "spacemap_vtk", _package / "__init__.py", submodule_search_locations=[str(_package)]
    )
    assert _spec is not None
    assert _spec.loader is not None
    sys.modules["spacemap_vtk"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["spacemap_vtk"])

from spacemap_vtk import __version__
from spacemap_vtk.paraview.hosted import PROXIES

# ParaView reads these names, and looks for classes with XML among the module's attributes.
paraview_plugin_name = "Space mapping"
paraview_plugin_version = __version__
globals().update(PROXIES)
