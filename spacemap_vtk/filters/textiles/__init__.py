"""Kinds of textiles: each subclass of `TextileKind` in a module of this folder is registered."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from spacemap_vtk.filters.textiles.kind import KINDS as KINDS

for _module in sorted(found.name for found in iter_modules(__path__)):
    import_module(f"{__name__}.{_module}")
