"""The engine's scene: set to the values of a request, and updated stage by stage."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import (
    VTK_BEZIER_QUADRILATERAL,
    vtkPolyData,
    vtkUnstructuredGrid,
)
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

from spacemap_vtk import cancel
from spacemap_vtk.app.work.frame_request import FrameRequest, Pull, Swing
from spacemap_vtk.cancel import CancelToken
from spacemap_vtk.datasets.arrays import add_array, array_of, cells_of, points_of, shallow_copy
from spacemap_vtk.datasets.processes import WHOLE, Piece
from spacemap_vtk.draw.actors.cloth_appearance import appearance_of
from spacemap_vtk.draw.actors.color_values import add_color_values
from spacemap_vtk.draw.actors.sheet_actor import coarsen_sheet
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.draw.detail.facets import FacetChooser, coarse_scale
from spacemap_vtk.draw.detail.underlay import ClothUnderlay, Underlay
from spacemap_vtk.draw.detail.yarn_parts import NearYarns
from spacemap_vtk.draw.frame import PULLED, Frame, apply_mode_shape, frame_of
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES, PatchTessellator
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.memory import require_memory
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.level_of_detail import (
    LEAST_SIDES,
    DrawnCloth,
    choose_level,
    quads_in_view,
)
from spacemap_vtk.scenes.memory_estimates import DRAWN_POINT
from spacemap_vtk.scenes.presets import plain_warnings
from spacemap_vtk.scenes.scene import Scene

#: Quadrilaterals that software rendering draws in 1/20 s, the time of a frame during a drag.
COARSE_QUADS = 8_000
#: Cells along each side of a sheet while the sheet or the camera moves.
_MOVING_CELLS = 48
#: Surfaces with more patches are drawn without fibres, which would be too fine for the window.
#: Yarns that are built only near the camera, in front of a sheet, have fibres.
_FIBRED = 60_000
#: Facets are kept while the camera turns if there are at most so many times the needed number.
_SPARE = 1.25
#: A surface with more quadrilaterals is replaced by a coarser one while the camera moves.
_HEAVY_QUADS = 150_000


class Pipeline:
    """Update one scene at a time for requests; used only by the engine's thread."""

    def __init__(
        self,
        ran: Callable[[str, float, int], None],
        progressed: Callable[[str, float, str], None],
    ) -> None:
        self._report_run, self._report_progress = ran, progressed
        self._generation = -1
        #: The scene with the values of the last request.
        self.scene: Scene | None = None
        self._settings: dict[str, dict[str, Any]] = {}
        # Index of the first stage that must run again even if the time is unchanged.
        self._first_stale = 0
        #: Bytes that drawing the last surface takes.
        self._drawn_bytes = 0
        self._coarse_tessellator = PatchTessellator()
        #: Last analysed motion with the stage that reconstructs its rotations, and its figures.
        self._analysed: tuple[Motion | None, Stage | None] = None, None
        self._motion_values: dict[str, Any] | None = None
        self._swing = vtkTrivialProducer()
        self._swing_crimp = CrimpInterchange()
        self._swing_warp = BarycentricWarp()
        #: Gives yarns near the camera more facets, and the scale in pixels per metre up to which
        #: the usual number of facets is enough.
        self._detail: FacetChooser | None = None
        self._enough_scale = 0.0
        self._sheet: ClothSheet | None = None
        #: Makes the dark layer inside a closed cloth, for a view and a sheet.
        self._underlay: tuple[object, ClothUnderlay | None] | None = None
        self._near_yarns: NearYarns | None = None
        #: Key of the last drawing of the near yarns, and their fine and coarse surfaces.
        self._near_drawn: tuple[list[Any], list[vtkPolyData | None]] | None = None
        #: Cancels the present run. The caller sets a new token for each request.
        self.token = CancelToken()

    def run(self, request: FrameRequest) -> Frame:
        """Compute the frame of a request."""
        with self.token.active():
            return self._run(request)

    def _run(self, request: FrameRequest) -> Frame:
        scene = self.apply_request(request)
        *stages, surface = scene.stages
        # A shown mode or pull replaces the motion, so the stages of motion need not run.
        solver, mover = scene.stage("solver"), scene.stage("mover")
        swing = request.swing if solver else None
        skipped = scene.motion_stages if swing else []
        # The tab Composite fills the cell itself, around one repeat: the drawn piece of a knit or
        # of a small weave has no whole one inside.
        skipped = [*skipped, *(stage for stage in stages if stage.role == "unit_cell")]
        # A shown mode never comes to rest, a pull does.
        coarse = request.coarse or isinstance(swing, Swing)
        sheet, piece = self._choose_sheet(scene), WHOLE
        if sheet is not None:  # the sheet replaces the stages that build yarns
            piece = sheet.one_yarn
            skipped = [*skipped, *(stage for stage in stages[1:] if stage.makes == "object")]
        # Stages before `first` are up to date. Updating them would take time, as each update checks
        # all stages upstream of it.
        first = min(self._first_stale, stages.index(mover)) if mover else self._first_stale
        for stage in stages[first:]:
            if stage not in skipped:
                self._update(scene, stage, request.time, piece)
        self._first_stale = len(stages)
        source = scene.last_object
        cage = None
        if swing and solver:
            cage = shallow_copy(solver.output)
            if isinstance(swing, Pull):
                _add_pull(cage, swing)
            else:
                _add_swing(scene, cage, swing)
            source = source if sheet else self._connect_swing(scene, cage)
        if sheet is not None:
            moved = scene.deformed_cage if scene.moves and cage is None else cage
            drawn = sheet.update_with(moved, coarse)
        else:
            fibres = source.GetOutputDataObject(0).GetNumberOfCells() <= _FIBRED
            look = scene.view.yarn_look
            self._coarse_tessellator.set_detail(AUTOMATIC_SIDES, fibres, look=look)
            numbers = None if coarse or swing is not None else DrawnCloth.from_scene(scene)
            follows = numbers is not None and numbers.follows_camera
            detail = self._choose_detail(numbers, source, request) if numbers and follows else None
            scene.surface.set_detail(AUTOMATIC_SIDES, fibres, detail, look)
            if coarse or swing is not None:
                surface = self._coarse_surface(scene, source, coarse) or surface
            if surface is self._coarse_tessellator:
                surface.update(request.time)
            else:
                self._update(scene, surface, request.time, WHOLE)
            drawn = surface.GetOutputDataObject(0)
            self._require_memory(drawn)
        cloth, crossings = (None, None) if sheet is None else (sheet.cloth, sheet.crossings)
        warnings = (text for stage in scene.stages for text in stage.warnings)
        frame = replace(
            frame_of(scene, request.time, drawn, cage, swing is None, cloth, crossings, coarse),
            values=request.values,
            coarse=coarse and (surface is self._coarse_tessellator or sheet is not None),
            mode=None if swing is None else getattr(swing, "mode", PULLED),
            generation=request.generation,
            warnings=tuple(dict.fromkeys(scene.state_plainly(warnings))),
            motion=None if swing else self._motion_figures(scene, request.coarse),
        )
        if sheet is not None:
            return self._add_near_yarns(scene, request, frame, sheet)
        frame = replace(frame, underlay=self._find_underlay(scene, frame.cage, sheet))
        if follows:
            frame = replace(
                frame,
                camera_view=request.camera_view,
                coarse_scale=self._enough_scale,
                has_finer_yarns=detail is not None,
            )
        if not coarse and drawn.GetNumberOfCells() > _HEAVY_QUADS:
            return self._add_light_frame(scene, source, frame)
        return frame

    def _find_underlay(
        self, scene: Scene, cage: vtkUnstructuredGrid | None, sheet: ClothSheet | None
    ) -> Underlay | None:
        """Return the dark layer inside a closed cloth; None if there is none."""
        key = scene.view.settings, sheet
        kept = self._underlay
        if kept is None or kept[0] != key or kept[1] is None or not kept[1].is_current(scene):
            self._underlay = kept = key, ClothUnderlay.make_if_needed(scene, sheet)
        return None if kept[1] is None else kept[1].in_cage(cage)

    def _choose_detail(
        self, cloth: DrawnCloth, source: Stage, request: FrameRequest
    ) -> FacetChooser | None:
        """Choose more facets for yarns near the camera; None if they would not be visible."""
        grid = source.GetOutputDataObject(0)
        points, patches = points_of(grid), cells_of(grid, VTK_BEZIER_QUADRILATERAL, "patches")
        self._enough_scale = coarse_scale(cloth.plies, points, patches)
        if request.camera_view is None:
            self._detail = None
            return None
        facets = FacetChooser(
            request.camera_view, LEAST_SIDES, quads_in_view(request.camera_view.size), cloth.plies
        )
        wanted_sides = facets(points, patches)
        # Keep the present facets if they are enough, and not far too many, so that a small turn of
        # the camera rebuilds nothing.
        present_sides = (
            np.full(1, AUTOMATIC_SIDES) if self._detail is None else self._detail(points, patches)
        )
        not_too_many = (
            np.square(present_sides, dtype=float).sum()
            <= _SPARE * np.square(wanted_sides, dtype=float).sum()
        )
        if not ((present_sides >= wanted_sides).all() and not_too_many):
            self._detail = facets if wanted_sides.max(initial=0) > AUTOMATIC_SIDES else None
        return self._detail

    def _add_near_yarns(
        self, scene: Scene, request: FrameRequest, frame: Frame, sheet: ClothSheet
    ) -> Frame:
        """Add the yarns near the camera to the frame of a sheet."""
        full_sheet, coarse_sheet = (
            frame.surface,
            coarsen_sheet(frame.surface, sheet.cells, _MOVING_CELLS),
        )
        if frame.coarse:
            frame = replace(frame, surface=coarse_sheet)
        else:
            frame = replace(
                frame, preview=replace(frame, surface=coarse_sheet), camera_view=request.camera_view
            )
        if request.camera_view is None or (frame.coarse and sheet.is_slow):
            return frame
        near = self._near_yarns
        if near is None or not near.is_current(scene, sheet):
            self._near_yarns = near = NearYarns(scene, sheet)
        cage = None
        if scene.moves:
            cage = scene.deformed_cage if request.swing is None else frame.cage
        reason = near.follow_view(request.camera_view, cage, request.swing is not None)
        if frame.coarse:
            light_yarns = None if reason else near.preview(request.time)
            if light_yarns is None or near.part is None:
                return frame
            light_yarns = shallow_copy(light_yarns)
            add_color_values(light_yarns, frame.color)
            surroundings = coarsen_sheet(full_sheet, sheet.cells, _MOVING_CELLS, near.part)
            return replace(frame, yarns=light_yarns, surroundings=surroundings)
        if not reason:
            try:
                for stage in near.stages:
                    self._update(scene, stage, request.time, WHOLE)
            except SizeError as error:
                self._near_yarns, reason = None, str(error)
        if reason or near.part is None:
            return replace(frame, warnings=(*frame.warnings, reason))

        # Reuse unchanged objects, as new ones would be sent to OpenGL again.
        light_yarns = near.preview(request.time)
        key = [near, frame.color, *(stage.executions for stage in near.stages)]
        if self._near_drawn is None or self._near_drawn[0] != key:
            surfaces = [
                None if yarns is None else shallow_copy(yarns)
                for yarns in (near.yarns, light_yarns)
            ]
            for yarns in surfaces:
                if yarns is not None:
                    add_color_values(yarns, frame.color)
            self._near_drawn = key, surfaces
        fine_yarns, light_yarns = self._near_drawn[1]
        if light_yarns is not None and frame.preview is not None:
            coarse_sheet = coarsen_sheet(frame.surface, sheet.cells, _MOVING_CELLS, near.part)
            frame = replace(
                frame, preview=replace(frame.preview, yarns=light_yarns, surroundings=coarse_sheet)
            )
        surroundings = coarsen_sheet(frame.surface, sheet.cells, max(sheet.cells), near.part)
        # A sheet has no holes: the dark layer is seen between these yarns only.
        underlay = self._find_underlay(scene, frame.cage, sheet)
        return replace(frame, yarns=fine_yarns, surroundings=surroundings, underlay=underlay)

    def _add_light_frame(self, scene: Scene, source: Stage, frame: Frame) -> Frame:
        """Add a frame with fewer facets, to be drawn while the camera moves."""
        tessellator = self._coarse_surface(scene, source, coarse=True)
        if tessellator is None:
            return frame
        surface = shallow_copy(tessellator.update(frame.time).output)
        add_color_values(surface, frame.color)
        return replace(frame, preview=replace(frame, surface=surface))

    def apply_request(self, request: FrameRequest) -> Scene:
        """Set the values of a request in the scene; values that are equal are not set again."""
        scene = self.scene
        if scene is None or request.generation != self._generation:
            scene, self._first_stale = Scene(request.values, request.base), 0
            self.scene, self._generation = scene, request.generation
        else:
            # Only stages downstream of a changed value run.
            changed = {k: v for k, v in request.settings.items() if v != self._settings[k]}
            former_stages = scene.stages
            scene.apply_settings(changed, request.values)
            if scene.stages != former_stages:
                self._first_stale = 0
            indices = [n for n, stage in enumerate(scene.stages) if stage.section in changed]
            self._first_stale = min([self._first_stale, *indices])
        self._settings = request.settings
        scene.plain_warnings = plain_warnings(scene.title)
        return scene

    def _choose_sheet(self, scene: Scene) -> ClothSheet | None:
        """Return the sheet that is drawn for a cloth with very many yarns, or None."""
        sheet = self._sheet
        if sheet is None or not sheet.is_current(scene):
            has_sheet = choose_level(scene, window=True).has_sheet
            sheet = ClothSheet(scene) if has_sheet else None
            if sheet is not None:  # here, because the window would stand still meanwhile
                self._report_progress(scene.surface.section, 0.0, "colours of the cloth")
                appearance_of(sheet.cloth).tables(tilted=True)
            self._sheet = sheet
            self._near_yarns = self._near_drawn = None  # these belong to the former scene
        return sheet

    def _update(self, scene: Scene, stage: Stage, time_s: float, piece: Piece) -> None:
        cancel.check()
        # Stages that build only the part in view are reported as the stage of the surface.
        listed = stage in scene.stages
        section, before = stage.section if listed else scene.surface.section, stage.executions
        progressed = self._report_progress

        def on_event(caller: Stage, event: str) -> None:
            progressed(section, caller.GetProgress(), caller.GetProgressText() or "")

        progressed(section, 0.0, "")
        # Only during the update: a permanent observer would keep the window alive with the stage.
        observer = stage.AddObserver("ProgressEvent", on_event)
        begin = time.perf_counter()
        try:
            scene.update_stage(stage, time_s, piece)
        finally:
            stage.RemoveObserver(observer)
        if listed and stage.executions != before:
            self._report_run(section, time.perf_counter() - begin, stage.executions)

    def _motion_figures(self, scene: Scene, coarse: bool) -> dict[str, Any] | None:
        """Return the figures of the motion; during a drag, return the former ones to save time."""
        mover = scene.stage("mover")
        now = (mover and mover.motion), scene.stage("rotation")
        if not coarse and now != self._analysed:
            self._analysed, self._motion_values = now, report.report_last_motion(scene)
        return self._motion_values

    def _require_memory(self, surface: vtkPolyData) -> None:
        """Raise an error if a surface needs too much memory in addition to the one drawn last."""
        size = DRAWN_POINT * surface.GetNumberOfPoints()
        if size > self._drawn_bytes:
            require_memory(
                size - self._drawn_bytes,
                f"to draw {surface.GetNumberOfCells()} polygons",
                cure="Lower surface.subdivisions, or use fewer ends and picks.",
            )
        self._drawn_bytes = size

    def _coarse_surface(self, scene: Scene, source: Stage, coarse: bool) -> PatchTessellator | None:
        """Connect and return the coarse tessellator; None if the scene's own is as coarse."""
        patches = max(1, scene.source.GetOutputDataObject(0).GetNumberOfCells())
        subdivisions = scene.surface.sides
        if coarse:
            subdivisions = max(1, int(math.sqrt(COARSE_QUADS / patches)))
        if subdivisions >= scene.surface.sides and source is not self._swing_warp:
            return None
        self._coarse_tessellator.subdivisions = min(subdivisions, scene.surface.sides)
        self._coarse_tessellator.SetInputConnection(source.GetOutputPort())
        return self._coarse_tessellator

    def _connect_swing(self, scene: Scene, cage: vtkUnstructuredGrid) -> BarycentricWarp:
        self._swing.SetOutput(cage)
        # A mode has no velocity to interpolate.
        self._swing_warp.configure(**{**scene.warp.settings, "carried": ""})
        source, crimp = scene.object_at_rest, scene.stage("crimp")
        if isinstance(crimp, CrimpInterchange):
            self._swing_crimp.configure(**crimp.settings)
            self._swing_crimp.SetInputConnection(0, source.GetOutputPort())
            self._swing_crimp.SetInputConnection(1, self._swing.GetOutputPort())
            source = self._swing_crimp
        self._swing_warp.SetInputConnection(0, source.GetOutputPort())
        self._swing_warp.SetInputConnection(1, self._swing.GetOutputPort())
        return self._swing_warp


def _add_swing(scene: Scene, cage: vtkUnstructuredGrid, swing: Swing) -> None:
    """Add the displacement of a mode to a cage."""
    count = len(array_of(cage.GetFieldData(), "eigenvalues", "a mode"))
    mode = min(swing.mode, count - 1)
    side = float(np.ptp(points_of(cage), axis=0).max())
    now = math.sin(2 * math.pi * swing.phase)
    angle = None if swing.angle is None else swing.angle * now
    apply_mode_shape(scene, cage, mode, swing.amplitude * side * now, angle)


def _add_pull(cage: vtkUnstructuredGrid, pull: Pull) -> None:
    """Add the displacement of a uniform stretch about the middle of a cage."""
    points = points_of(cage).astype(np.float64)
    stretch = np.array([pull.weft, pull.warp, 1.0]) - 1.0
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    add_array(cage.GetPointData(), "displacement", stretch * (points - middle))
