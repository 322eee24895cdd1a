"""Optional parts of the program and parts that other packages add, by group and name.

The core imports no optional part. It asks for a group here and imports the members that it needs.
Another package adds a member in its metadata, as an entry point:

    [project.entry-points."spacemap_vtk.formats"]
    alphabet = "alphabet.files"

The groups and what a member of each is:

- ``commands``: "module:function", a command of the command line with the member's name. The
  function's docstring is the help.
- ``formats``: "module", which registers readers and writers (`spacemap_vtk.io.registry`).
- ``stages``: "module:class", a stage (`spacemap_vtk.filters.base.Stage`).
- ``jobs``: "module:class", a kind of job (`spacemap_vtk.jobs.job.Job`) under ``register``.
- ``maps``: "module:class", an interpolation from the vertices of a cage to the points inside it
  (`spacemap_vtk.embedding.interpolation.EmbeddedPoints`).
- ``data``: "module:function", which returns data of a scene for a file format.
- ``renderers``: "module:function", which draws a picture of a scene.

Modules of commands and formats must not import numpy or VTK at their top, because they are imported
to make lists. A stage's module may.
"""

from __future__ import annotations

import os
import sys
import warnings
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

from spacemap_vtk.errors import MissingLibraryError

#: Prefix of the groups' names in the metadata of packages.
_PREFIX = "spacemap_vtk."
#: The program's optional parts. They are listed here and not in the package's metadata, because
#: a checkout on PYTHONPATH has no metadata, for example in ParaView. Formats are missing here: all
#: modules of `spacemap_vtk.io.formats` register themselves.
BUILT_IN = {
    "commands": {
        "serve": "spacemap_vtk.cli.serve:serve",
        "paraview": "spacemap_vtk.paraview.command:paraview",
    },
    "maps": {"smooth": "spacemap_vtk.embedding.smooth:SmoothInterpolation"},
    "data": {
        "analysis": "spacemap_vtk.scenes.input_deck:make_input_deck",
        "obstacles": "spacemap_vtk.scenes.obstacle_data:obstacle_data",
    },
    "renderers": {"raytrace": "spacemap_vtk.draw.raytrace:raytrace"},
}


@dataclass(frozen=True)
class Member:
    """A member of a group."""

    name: str
    #: As "module" or "module:attribute".
    value: str
    #: The package that adds it; empty for this program.
    package: str = ""

    def load(self) -> Any:
        """Import the module and return it, or its attribute if one is named."""
        module, _, attribute = self.value.partition(":")
        found = import_module(module)
        return getattr(found, attribute) if attribute else found


def members(group: str) -> list[Member]:
    """Return the members of a group: this program's first, then those of installed packages."""
    own = [Member(name, value) for name, value in BUILT_IN.get(group, {}).items()]
    return [*own, *_installed_members().get(group, [])]


def load(group: str, name: str) -> Any:
    """Import one member of a group. The program's member is preferred to others of that name."""
    for member in members(group):
        if member.name == name:
            return member.load()
    raise MissingLibraryError(f'no installed package provides "{name}" in its {group}')


def load_all(group: str) -> list[Any]:
    """Import all members of a group; if a package fails to import, warn and go on."""
    found = []
    for member in members(group):
        try:
            found.append(member.load())
        except Exception as error:
            if not member.package:
                raise
            # Not a SpacemapWarning: commands hide those, because they print them in another way.
            warnings.warn(
                f"the package {member.package} is ignored: cannot load {member.value}: "
                f"{type(error).__name__}: {error}",
                RuntimeWarning,
                stacklevel=2,
            )
    return found


@cache
def _installed_members() -> dict[str, list[Member]]:
    """Return the members that other packages add, by group."""
    # Every command calls this, hardly any machine has such a package, and importing
    # importlib.metadata takes a tenth of the command line's time.
    if not any(_has_our_groups(folder) for folder in sys.path):
        return {}
    from importlib.metadata import distributions

    found: dict[str, list[Member]] = {}
    for distribution in distributions():
        for point in distribution.entry_points:
            if point.group.startswith(_PREFIX):
                member = Member(point.name, point.value, distribution.name)
                found.setdefault(point.group.removeprefix(_PREFIX), []).append(member)
    return found


def _has_our_groups(folder: str) -> bool:
    """Return whether a folder of packages contains a package with one of this program's groups."""
    with suppress(OSError), os.scandir(folder or ".") as entries:
        for entry in entries:
            if entry.name.endswith((".dist-info", ".egg-info")):
                with suppress(OSError), open(f"{entry.path}/entry_points.txt", "rb") as file:
                    if f"[{_PREFIX}".encode() in file.read():
                        return True
    return False
