"""Deform woven fabric and other intricate objects by space mapping, on VTK.

The filters are imported from here. Each is loaded when it is first used, so that a tool that needs
only one of them, or none, does not wait for VTK.
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING

from spacemap_vtk.errors import SpacemapWarning as SpacemapWarning

if TYPE_CHECKING:
    from spacemap_vtk.filters.barycentric_warp import BarycentricWarp as BarycentricWarp
    from spacemap_vtk.filters.base import connect as connect
    from spacemap_vtk.filters.crimp_interchange import CrimpInterchange as CrimpInterchange
    from spacemap_vtk.filters.error_estimates import estimate_errors as estimate_errors
    from spacemap_vtk.filters.layer_contact import LayerContact as LayerContact
    from spacemap_vtk.filters.modal_response import ModalResponse as ModalResponse
    from spacemap_vtk.filters.modal_solver import ModalSolver as ModalSolver
    from spacemap_vtk.filters.motion_reader import MotionReader as MotionReader
    from spacemap_vtk.filters.object_source import ObjectSource as ObjectSource
    from spacemap_vtk.filters.patch_tessellator import PatchTessellator as PatchTessellator
    from spacemap_vtk.filters.rotation_strain import RotationStrain as RotationStrain
    from spacemap_vtk.filters.tetra_cage import TetraCage as TetraCage
    from spacemap_vtk.filters.textile_source import TextileSource as TextileSource
    from spacemap_vtk.filters.transient_response import TransientResponse as TransientResponse
    from spacemap_vtk.filters.unit_cell import UnitCell as UnitCell
    from spacemap_vtk.filters.weave_source import WeaveSource as WeaveSource

__version__ = "0.1.0"

#: The filters and their modules. This table is all that the program knows of them: scenes, the
#: window, the command line and ParaView's plugin are generated from what each class declares. If
#: several filters have the same role, a scene uses the first, unless it has the section of another.
FILTERS = {
    "WeaveSource": "spacemap_vtk.filters.weave_source",
    "TextileSource": "spacemap_vtk.filters.textile_source",
    "ObjectSource": "spacemap_vtk.filters.object_source",
    "UnitCell": "spacemap_vtk.filters.unit_cell",
    "TetraCage": "spacemap_vtk.filters.tetra_cage",
    "LayerContact": "spacemap_vtk.filters.layer_contact",
    "ModalSolver": "spacemap_vtk.filters.modal_solver",
    "ModalResponse": "spacemap_vtk.filters.modal_response",
    "TransientResponse": "spacemap_vtk.filters.transient_response",
    "MotionReader": "spacemap_vtk.filters.motion_reader",
    "RotationStrain": "spacemap_vtk.filters.rotation_strain",
    "CrimpInterchange": "spacemap_vtk.filters.crimp_interchange",
    "BarycentricWarp": "spacemap_vtk.filters.barycentric_warp",
    "PatchTessellator": "spacemap_vtk.filters.patch_tessellator",
}

#: The functions that are imported from here, and their modules.
_FUNCTIONS = {
    "connect": "spacemap_vtk.filters.base",
    "estimate_errors": "spacemap_vtk.filters.error_estimates",
}

__all__ = ["SpacemapWarning", *_FUNCTIONS, *FILTERS]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> object:
    module = {**FILTERS, **_FUNCTIONS}.get(name)
    if module is not None:
        return getattr(importlib.import_module(module), name)
    # With name and obj, Python suggests the name that may have been meant.
    text = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(text, name=name, obj=sys.modules[__name__])
