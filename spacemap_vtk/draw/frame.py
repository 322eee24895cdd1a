"""Frames: the state of a scene at one time, ready to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, array_of, shallow_copy
from spacemap_vtk.datasets.extent import up_axis
from spacemap_vtk.datasets.modal_model import MODE_NAME
from spacemap_vtk.draw.actors.color_values import add_color_values
from spacemap_vtk.draw.actors.load_arrows import Arrows, load_arrows
from spacemap_vtk.draw.camera import Aim, CameraView, aim_of
from spacemap_vtk.draw.detail.underlay import Underlay
from spacemap_vtk.draw.obstacles import ShownObstacles, show_obstacles
from spacemap_vtk.filters.load_parameters import LoadParameters
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.rotation_strain import RotationStrain
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.weave.cloth import Cloth

#: Depth of an object's folds as a share of its diagonal.
_OBJECT_RELIEF = 0.03
#: `Frame.mode` of a pull.
PULLED = -1


@dataclass(frozen=True)
class Frame:
    """Copies of a scene's results, so that the pipeline can run while they are drawn."""

    #: Time of the motion [s].
    time: float
    #: The fabric's surface, with the numbers that its colours show.
    surface: vtkPolyData
    #: The cage at rest with its arrays; None for a still scene.
    cage: vtkUnstructuredGrid | None = None
    #: Colouring of the surface: a key of `spacemap_vtk.scenes.colorings.COLORINGS`.
    color: str = "own"
    #: Image that textures the object.
    texture: vtkImageData | None = None
    #: Whether the surface is closed and its polygons face outwards, so that only front faces are
    #: visible.
    closed: bool = False
    #: Depth of the surface's folds in m; for a fabric, the diameter of a yarn.
    relief: float = 0.0
    #: Where the camera of the scene is.
    camera: Aim = "three-quarter"
    #: Values chosen for automatic parameters, by section and name.
    in_use: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    #: Arrows of the loads on the cage; None if the loads are unknown.
    arrows: Arrows | None = None
    #: Obstacles that the cage touches; None without any.
    obstacles: ShownObstacles | None = None
    #: Whether the surface is coarser than the scene requests.
    coarse: bool = False
    #: Index of the mode that is shown in place of the motion; `PULLED` for a pull.
    mode: int | None = None
    #: Number that differs between scenes.
    generation: int = 0
    #: Sections and values of the frame's scene, as in a scene file.
    values: dict[str, Any] = field(default_factory=dict)
    #: Warnings of the stages.
    warnings: tuple[str, ...] = ()
    #: The cloth, if the surface is a sheet; None if its yarns are drawn.
    cloth: Cloth | None = None
    #: Values that the colours of a sheet show at each crossing, (2 or 1, picks, ends).
    crossings: NDArray[Any] | None = None
    #: The yarns that are drawn in place of a part of the sheet.
    yarns: vtkPolyData | None = None
    #: The rest of the sheet around these yarns.
    surroundings: vtkPolyData | None = None
    #: The dark layer inside a closed cloth whose yarns are drawn.
    underlay: Underlay | None = None
    #: The view for which `yarns`, or the facets of all yarns, were chosen.
    camera_view: CameraView | None = None
    #: Pixels per metre up to which a view needs no more facets than yarns out of sight have; 0 if
    #: facets do not depend on the view.
    coarse_scale: float = 0.0
    #: Whether yarns near the camera have more facets than in this frame.
    has_finer_yarns: bool = False
    #: Frame that is drawn in place of this one while the camera moves; None: this frame.
    preview: Frame | None = None
    #: Figures of the motion, see `spacemap_vtk.scenes.report.report_motion`.
    motion: dict[str, Any] | None = None


def frame_of(
    scene: Scene,
    time: float,
    surface: vtkPolyData | None = None,
    cage: vtkUnstructuredGrid | None = None,
    loads: bool = True,
    cloth: Cloth | None = None,
    crossings: NDArray[Any] | None = None,
    quick: bool = False,
) -> Frame:
    """Return a frame with the results of a scene's last update, or with the given surface."""
    # `quick` shades obstacles roughly, for frames that are replaced at once.
    if cage is None and scene.moves:
        cage = shallow_copy(scene.deformed_cage)
    drawn = shallow_copy(scene.polygons if surface is None else surface)
    add_color_values(drawn, scene.view.color)
    return Frame(
        time,
        drawn,
        cage,
        scene.view.color,
        scene.picture,
        closed=scene.textile is not None and scene.textile.closed and cloth is None,
        relief=relief_of(scene),
        camera=camera_of(scene),
        in_use={
            "view": {"camera": scene.view.camera or camera_of(scene)},
            **{stage.section: stage.values_in_use for stage in scene.stages},
        },
        arrows=arrows_of(scene, time) if loads else None,
        obstacles=obstacles_of(scene, cage, drawn, quick),
        cloth=cloth,
        crossings=crossings,
    )


def camera_of(scene: Scene) -> Aim:
    """Return the camera of a scene; by default "lying" if z is up in its object."""
    aim = aim_of(scene.view)
    if aim is not None:
        return aim
    return "lying" if up_axis(scene.source.output) == 2 else type(scene.view).camera.default


def relief_of(scene: Scene) -> float:
    """Return the depth of a scene's folds [m], on which contact shadows depend."""
    if scene.textile is not None:
        return float(scene.textile.yarn_diameters.max())
    return _OBJECT_RELIEF * float(scene.source.GetOutputDataObject(0).GetLength())


def arrows_of(scene: Scene, time: float) -> Arrows | None:
    """Return the arrows of the loads on a scene's cage; None if the loads are unknown."""
    mover = scene.stage("mover")
    if not isinstance(mover, LoadParameters):
        return None
    solver = scene.stage("solver")
    dead = solver.dead_loads if isinstance(solver, ModalSolver) and solver.is_hung else ()
    return load_arrows(mover, scene.deformed_cage, time, dead)


def obstacles_of(
    scene: Scene, cage: vtkUnstructuredGrid | None, surface: vtkPolyData, quick: bool = False
) -> ShownObstacles | None:
    """Return the obstacles of a scene as its view shows them; None without any."""
    view = scene.view
    if cage is None or not view.obstacles:
        return None
    shadows = view.shadows and view.resolved_style.occlusion > 0.0
    return show_obstacles(cage, surface, shadows, quick)


def apply_mode_shape(
    scene: Scene, cage: vtkUnstructuredGrid, mode: int, largest: float, angle: float | None = None
) -> None:
    """Displace a cage by a mode shape, scaled to a largest displacement [m] or rotation [rad]."""
    data = cage.GetPointData()
    shape = array_of(data, MODE_NAME.format(mode), "a mode's shape")
    shape = shape / (float(np.linalg.norm(shape, axis=1).max()) or 1.0)
    rotation = scene.stage("rotation")
    if angle is not None and isinstance(rotation, RotationStrain):
        # A mode that strains more than it rotates is limited to a strain of a third of the angle.
        turn, strain = rotation.largest_rotation_and_strain(cage, shape)
        largest = angle / max(turn, 3 * strain)
    moved = shape * largest
    if data.HasArray("equilibrium"):  # the cage vibrates around its equilibrium
        moved += array_of(data, "equilibrium", "a mode's shape")
    add_array(data, "displacement", moved)
    if isinstance(rotation, RotationStrain):
        rotation.rebuild(cage)
