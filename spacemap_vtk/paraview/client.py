"""What the plugin adds to ParaView's scripting, on the side of the client.

Nothing here is needed for the filters to work. Without it (a client that leaves the plugin to its
server) a number given for a text is refused.
"""

from __future__ import annotations

import importlib.util
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Parameter, Real, Vector
from spacemap_vtk.paraview.hosted import PROXIES
from spacemap_vtk.paraview.property_xml import property_of

_SCRIPTING = "paraview.servermanager"


def prepare() -> None:
    """Let scripts give what the filters themselves take: numbers for texts, units, None."""
    if _SCRIPTING in sys.modules:
        _adapt(sys.modules[_SCRIPTING])
    else:
        sys.meta_path.insert(0, _WhenImported())


class _WhenImported(MetaPathFinder):
    """Adapts ParaView's scripting once it is imported; importing it here would change ParaView."""

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if name != _SCRIPTING:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_adapt(module: Any) -> None:
            execute(module)
            if module.__name__ == _SCRIPTING:  # one loader may serve many modules
                _adapt(module)

        spec.loader.exec_module = execute_and_adapt  # type: ignore[method-assign]
        return spec


def _adapt(servermanager: Any) -> None:
    """Make ``weave.WarpDiameter = 0.25e-3`` work, and say what is wrong with ``Ends = "many"``."""
    original = servermanager.Proxy.SetPropertyWithName

    def set_property(self: Any, name: str, value: Any) -> Any:
        parameter: Any = _parameter(self, name)
        # A text may hold any number, and only the stage would say what is wrong with it.
        written = isinstance(value, str) and isinstance(parameter, (Real, Vector))
        if not written:
            try:
                return original(self, name, value)
            except (TypeError, RuntimeError):  # not the type or the number of values it holds
                if parameter is None:
                    raise
        made = property_of(parameter)
        try:
            if written:
                value = made.read(value)
                parameter.require_plausible(value)
            checked = parameter.check(value)
        except InputError as error:
            # Of a ValueError ParaView would keep no more than that the value is not valid.
            raise TypeError(f"{self.GetXMLName()}: {error}") from None
        return original(self, name, made.write(checked))

    servermanager.Proxy.SetPropertyWithName = set_property


def _parameter(proxy: Any, name: str) -> Parameter[Any] | None:
    """Return what a property was made from; None if it is not one of ours."""
    stage = PROXIES.get(proxy.GetXMLName())
    made = proxy.GetProperty(name)
    if stage is None or made is None:
        return None
    command = made.SMProperty.GetCommand() or ""
    return stage.parameters.get(command.removeprefix("set_"))
