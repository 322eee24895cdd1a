"""ParaView plugin: load this file with Tools > Manage Plugins, or see `spacemap paraview`.

The plugin finds the package by the path of this file, so that nothing needs to be on the path of
ParaView's Python: the folder of an installed spacemap_vtk may also hold another numpy or VTK.
"""

import importlib.util
import sys
from pathlib import Path


def _import_package() -> None:
    package = Path(__file__).resolve().parents[1]
    spec = importlib.util.spec_from_file_location(
        "spacemap_vtk", package / "__init__.py", submodule_search_locations=[str(package)]
    )
    assert spec is not None
    assert spec.loader is not None
    sys.modules["spacemap_vtk"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules["spacemap_vtk"])


if "spacemap_vtk" not in sys.modules:
    _import_package()

# These imports work only after `_import_package`.
from spacemap_vtk import __version__  # noqa: E402
from spacemap_vtk.paraview import client, rendering  # noqa: E402
from spacemap_vtk.paraview.stages import PROXIES  # noqa: E402

client.adapt_scripting()
rendering.show_colors()
rendering.require_batch_display()

# ParaView reads these names, and searches the module's attributes for classes with XML.
paraview_plugin_name = "Space mapping"
paraview_plugin_version = __version__
globals().update(PROXIES, SpacemapOpaque=rendering.SpacemapOpaque)
