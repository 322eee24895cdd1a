"""A frame: what a scene is at a time, ready to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, array_of, copied
from spacemap_vtk.datasets.extent import up_axis
from spacemap_vtk.datasets.modal_model import MODE_NAME
from spacemap_vtk.draw.actors.coloring import add_measure
from spacemap_vtk.draw.actors.load_arrows import Arrows, load_arrows
from spacemap_vtk.draw.camera import Seen
from spacemap_vtk.filters.load_parameters import LoadParameters
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.rotation_strain import RotationStrain
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.cloth import Cloth

#: Depth of an object's folds as a share of its diagonal.
_OBJECT_RELIEF = 0.03


@dataclass(frozen=True)
class Frame:
    """Copies of a scene's results: the pipeline can run on while they are drawn."""

    #: In s.
    time: float
    #: The fabric's surface, with what its colours show.
    surface: vtkPolyData
    #: The cage at rest with its arrays; None for a still scene.
    cage: vtkUnstructuredGrid | None = None
    #: What the surface's colours show: a key of `spacemap_vtk.scenes.colorings.COLORINGS`.
    color: str = "own"
    #: What the object is painted with.
    painting: vtkImageData | None = None
    #: Whether nothing but the surface's outside can be seen, which faces the way its polygons do.
    closed: bool = False
    #: How deep its folds are in m: of a fabric, a yarn's diameter.
    relief: float = 0.0
    #: Where it is seen from, a key of `spacemap_vtk.scenes.settings.CAMERAS`.
    camera: str = "three-quarter"
    #: What automatic values came to, by section and name.
    in_use: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    #: What acts on the cage; None where that is not known.
    arrows: Arrows | None = None
    #: Whether the surface is coarser than the scene asks for.
    coarse: bool = False
    #: The mode that is shown in place of the motion; -1 for a pull.
    swing: int | None = None
    #: Another number for another scene.
    generation: int = 0
    #: The scene that it is of, as a file has it.
    values: dict[str, Any] = field(default_factory=dict)
    #: What the stages say of their trustworthiness.
    warnings: tuple[str, ...] = ()
    #: The cloth whose sheet the surface is; None where its yarns are drawn.
    cloth: Cloth | None = None
    #: Of a sheet, what its colours show at each crossing, (2 or 1, picks, ends).
    crossings: NDArray[Any] | None = None
    #: Of a sheet, the yarns that are seen near, and the sheet where these are not.
    yarns: vtkPolyData | None = None
    around: vtkPolyData | None = None
    #: The view that these, or the facets of all yarns, were chosen for.
    seen: Seen | None = None
    #: Pixels of a metre up to which a view needs no more facets than yarns out of sight have; 0
    #: where facets do not follow the view.
    enough: float = 0.0
    #: Whether yarns near the camera have more facets than these.
    finer: bool = False
    #: What is drawn in its place while the camera moves; None: itself.
    light: Frame | None = None
    #: How far its motion turns and stretches, see `spacemap_vtk.scenes.report.motion`.
    motion: dict[str, Any] | None = None


def frame_of(
    scene: Scene,
    time: float,
    surface: vtkPolyData | None = None,
    cage: vtkUnstructuredGrid | None = None,
    loads: bool = True,
    cloth: Cloth | None = None,
    crossings: NDArray[Any] | None = None,
) -> Frame:
    """Return what a scene's last update has made, or what is given in place of that."""
    if cage is None and scene.moves:
        cage = copied(scene.deformed_cage)
    drawn = copied(scene.polygons if surface is None else surface)
    add_measure(drawn, scene.view.color)
    return Frame(
        time,
        drawn,
        cage,
        scene.view.color,
        scene.painting,
        closed=scene.textile is not None and scene.textile.closed and cloth is None,
        relief=relief_of(scene),
        camera=camera_of(scene),
        in_use={
            "view": {"camera": camera_of(scene)},
            **{stage.section: stage.in_use for stage in scene.stages},
        },
        arrows=arrows_of(scene, time) if loads else None,
        cloth=cloth,
        crossings=crossings,
    )


def camera_of(scene: Scene) -> str:
    """Return where a scene is seen from: z can be up in an object."""
    if scene.view.camera is not None:
        return scene.view.camera
    return "lying" if up_axis(scene.source.output) == 2 else type(scene.view).camera.default


def relief_of(scene: Scene) -> float:
    """Return how deep a scene's folds are in m, by which contact shadows are made."""
    if scene.textile is not None:
        return float(scene.textile.yarn_diameters.max())
    return _OBJECT_RELIEF * float(scene.source.GetOutputDataObject(0).GetLength())


def arrows_of(scene: Scene, time: float) -> Arrows | None:
    """Return what acts on a scene's cage; None where that is not known."""
    mover = scene.stage("mover")
    if not isinstance(mover, LoadParameters):
        return None
    solver = scene.stage("solver")
    dead = solver.dead_loads if isinstance(solver, ModalSolver) and solver.hangs else ()
    return load_arrows(mover, scene.deformed_cage, time, dead)


def add_shape(
    scene: Scene, cage: vtkUnstructuredGrid, mode: int, largest: float, angle: float | None = None
) -> None:
    """Move a cage by a mode's shape, at most by so much [m], or by an angle [rad] if rebuilt."""
    data = cage.GetPointData()
    shape = array_of(data, MODE_NAME.format(mode), "a mode's shape")
    shape = shape / (float(np.linalg.norm(shape, axis=1).max()) or 1.0)
    rotation = scene.stage("rotation")
    if angle is not None and isinstance(rotation, RotationStrain):
        # Not each mode turns: one that strains is shown at less, strained by a third of the angle.
        turn, strain = rotation.largest(cage, shape)
        largest = angle / max(turn, 3 * strain)
    moved = shape * largest
    if data.HasArray("equilibrium"):  # what hangs swings about where it hangs
        moved += array_of(data, "equilibrium", "a mode's shape")
    add_array(data, "displacement", moved)
    if isinstance(rotation, RotationStrain):
        rotation.rebuild(cage)
