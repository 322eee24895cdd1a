"""The command `spacemap paraview`, which prints how ParaView finds the plugin."""

from __future__ import annotations

import shlex
from typing import Annotated

from spacemap_vtk.cli.options import flag
from spacemap_vtk.paraview import environment


def paraview(
    *,
    check: Annotated[bool, flag("Test the plugin in pvpython.")] = False,
) -> None:
    """Print how to start ParaView with the plugin, or test the plugin.

    Prints the environment variables that make ParaView load the plugin, as commands for a shell.

    For example:

        eval "$(spacemap paraview)" && paraview
        spacemap paraview --check
    """
    if check:
        print(environment.check())
        return
    print(f"# plugin: {environment.PLUGIN}")
    for name, value in environment.variables().items():
        rest = f'"${{{name}:+:${name}}}"' if name == "PYTHONPATH" else ""
        print(f"export {name}={shlex.quote(value)}{rest}")
