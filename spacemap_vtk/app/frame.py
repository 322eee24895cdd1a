"""What one run of the pipeline gives the window to draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.scenes.load_arrows import Arrows


@dataclass(frozen=True)
class Frame:
    """Copies of a scene's results: the pipeline can run on while they are drawn.

    Parameters
    ----------
    time : float
        In s.
    surface : vtkPolyData
        The fabric's surface.
    cage : vtkUnstructuredGrid or None
        The cage at rest with its arrays; None for a still scene.
    coarse : bool
        Whether the surface is coarser than the scene asks for.
    swing : int or None
        The mode that is shown in place of the motion.
    generation : int
        Another number for another scene.
    values : dict
        The scene that it is of, as a file has it.
    color : str
        What the surface's colours show: a key of `spacemap_vtk.scenes.colorings.COLORINGS`.
    painting : vtkImageData or None
        What the object is painted with.
    closed : bool
        Whether nothing but the surface's outside can be seen, which faces the way its polygons do.
    arrows : Arrows or None
        What acts on the cage.
    warnings : tuple of str
        What the stages say of their trustworthiness.
    """

    time: float
    surface: vtkPolyData
    cage: vtkUnstructuredGrid | None
    coarse: bool
    swing: int | None
    generation: int
    values: dict[str, Any]
    color: str = "own"
    painting: vtkImageData | None = None
    closed: bool = False
    arrows: Arrows | None = None
    warnings: tuple[str, ...] = ()


def copied(data: Any) -> Any:
    """Return a data object of its own that shares the arrays.

    Parameters
    ----------
    data : vtkDataObject
        A stage's output.

    Returns
    -------
    vtkDataObject
        Of the same type; stages make new arrays at each run, so it stays as it is.
    """
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy
