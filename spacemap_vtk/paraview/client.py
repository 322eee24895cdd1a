"""Extend ParaView's scripting, on the side of the client.

The filters work without this module. Without it (for example, if a client leaves the plugin to its
server) ParaView refuses a number for a parameter that it stores as a text.
"""

from __future__ import annotations

import importlib.util
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Parameter, Real, Vector
from spacemap_vtk.paraview.property_xml import property_of
from spacemap_vtk.paraview.stages import PROXIES

_SCRIPTING = "paraview.servermanager"


def adapt_scripting() -> None:
    """Let scripts set what the filters accept: numbers for texts, units, None."""
    if _SCRIPTING in sys.modules:
        _adapt_scripting(sys.modules[_SCRIPTING])
    else:
        sys.meta_path.insert(0, _ImportHook())


class _ImportHook(MetaPathFinder):
    """Finder that adapts ParaView's scripting on import; an import here would change ParaView."""

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
                _adapt_scripting(module)

        spec.loader.exec_module = execute_and_adapt  # type: ignore[method-assign]
        return spec


def _adapt_scripting(servermanager: Any) -> None:
    """Accept ``weave.WarpDiameter = 0.25e-3``, and explain what is wrong with ``Ends = "many"``."""
    original = servermanager.Proxy.SetPropertyWithName

    def set_property(self: Any, name: str, value: Any) -> Any:
        parameter: Any = _parameter_of(self, name)
        # A text property accepts any text, and only the stage would report what is wrong with it.
        written = isinstance(value, str) and isinstance(parameter, (Real, Vector))
        if not written:
            try:
                return original(self, name, value)
            except (TypeError, RuntimeError):  # wrong type or wrong number of values
                if parameter is None:
                    raise
        made = property_of(parameter)
        try:
            if written:
                value = made.read(value)
                parameter.require_plausible(value)
            checked = parameter.check(value)
        except InputError as error:
            # From a ValueError ParaView would keep only that the value is not valid.
            raise TypeError(f"{self.GetXMLName()}: {error}") from None
        return original(self, name, made.write(checked))

    servermanager.Proxy.SetPropertyWithName = set_property


def _parameter_of(proxy: Any, name: str) -> Parameter[Any] | None:
    """Return the parameter from which a property was made, or None if it is not one of ours."""
    stage = PROXIES.get(proxy.GetXMLName())
    made = proxy.GetProperty(name)
    if stage is None or made is None:
        return None
    command = made.SMProperty.GetCommand() or ""
    return stage.parameters.get(command.removeprefix("set_"))
