"""Deform woven fabric and other intricate objects by space mapping, on VTK.

The filters import from here; they are loaded when first named, so that a tool that needs
one of them, or none, does not wait for VTK.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from spacemap_vtk.errors import SpacemapWarning

if TYPE_CHECKING:
    from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
    from spacemap_vtk.filters.modal_response import ModalResponse
    from spacemap_vtk.filters.modal_solver import ModalSolver
    from spacemap_vtk.filters.motion_reader import MotionReader
    from spacemap_vtk.filters.object_source import ObjectSource
    from spacemap_vtk.filters.patch_tessellator import PatchTessellator
    from spacemap_vtk.filters.tetra_cage import TetraCage
    from spacemap_vtk.filters.weave_source import WeaveSource

__version__ = "0.1.0"

__all__ = [
    "BarycentricWarp",
    "ModalResponse",
    "ModalSolver",
    "MotionReader",
    "ObjectSource",
    "PatchTessellator",
    "SpacemapWarning",
    "TetraCage",
    "WeaveSource",
]

#: The filters, and the modules they are in.
FILTERS = {
    "BarycentricWarp": "barycentric_warp",
    "ModalResponse": "modal_response",
    "ModalSolver": "modal_solver",
    "MotionReader": "motion_reader",
    "ObjectSource": "object_source",
    "PatchTessellator": "patch_tessellator",
    "TetraCage": "tetra_cage",
    "WeaveSource": "weave_source",
}


def __getattr__(name: str) -> object:
    if name in FILTERS:
        return getattr(importlib.import_module(f"spacemap_vtk.filters.{FILTERS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
