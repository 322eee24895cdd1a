"""What one run of the pipeline gives the window to draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.draw.load_arrows import Arrows


@dataclass(frozen=True)
class Frame:
    """Copies of a scene's results: the pipeline can run on while they are drawn."""

    #: In s.
    time: float
    #: The fabric's surface.
    surface: vtkPolyData
    #: The cage at rest with its arrays; None for a still scene.
    cage: vtkUnstructuredGrid | None
    #: Whether the surface is coarser than the scene asks for.
    coarse: bool
    #: The mode that is shown in place of the motion.
    swing: int | None
    #: Another number for another scene.
    generation: int
    #: The scene that it is of, as a file has it.
    values: dict[str, Any]
    #: What the surface's colours show: a key of `spacemap_vtk.scenes.colorings.COLORINGS`.
    color: str = "own"
    #: What the object is painted with.
    painting: vtkImageData | None = None
    #: Whether nothing but the surface's outside can be seen, which faces the way its polygons do.
    closed: bool = False
    #: What acts on the cage.
    arrows: Arrows | None = None
    #: What the stages say of their trustworthiness.
    warnings: tuple[str, ...] = ()


def copied(data: Any) -> Any:
    """Return a data object of its own that shares the arrays."""
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy
