"""The engine's own scene: brought to what a job asks for, and run stage by stage."""

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
from spacemap_vtk.app.work.job import Job, Pull, Swing
from spacemap_vtk.cancel import CancelToken
from spacemap_vtk.datasets.arrays import add_array, array_of, cells_of, copied, points_of
from spacemap_vtk.datasets.processes import WHOLE, Piece
from spacemap_vtk.draw.actors.coloring import add_measure
from spacemap_vtk.draw.actors.sheet_actor import thinned
from spacemap_vtk.draw.detail.cloth_sheet import Sheet
from spacemap_vtk.draw.detail.facets import Facets, pixels_enough
from spacemap_vtk.draw.detail.yarn_parts import NearYarns
from spacemap_vtk.draw.frame import Frame, add_shape, frame_of
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES, PatchTessellator
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.memory import require
from spacemap_vtk.scenes import report
from spacemap_vtk.scenes.footprint import DRAWN_POINT
from spacemap_vtk.scenes.level_of_detail import (
    LEAST_SIDES,
    DrawnCloth,
    choose_level,
    quads_in_view,
)
from spacemap_vtk.scenes.scene import Scene

#: Quadrilaterals that software rendering draws in the twentieth of a second that a drag has.
COARSE_QUADS = 8_000
#: Cells along each side of a sheet that moves, or is seen while the camera does.
_MOVING_CELLS = 48
#: Of more patches, all in sight, fibres are too fine for the window; those in view have theirs.
_FIBRED = 60_000
#: How many times as many facets as are needed stay while the camera turns.
_SPARE = 3.0
#: More quadrilaterals have fewer in their place while the camera moves.
_HEAVY_QUADS = 150_000


class Pipeline:
    """Runs one scene after the other; belongs to the engine's thread."""

    def __init__(
        self,
        ran: Callable[[str, float, int], None],
        progressed: Callable[[str, float, str], None],
    ) -> None:
        self._ran, self._progressed = ran, progressed
        self._generation = -1
        #: As the last job wanted it.
        self.scene: Scene | None = None
        self._settings: dict[str, dict[str, Any]] = {}
        # Place of the first stage that is yet to be brought up to date, whatever the time.
        self._first = 0
        #: What the last surface takes to be drawn [bytes].
        self._drawn = 0
        self._coarse = PatchTessellator()
        #: The motion that was looked at last, what rebuilds it, and its figures.
        self._looked_at: tuple[Motion | None, Stage | None] = None, None
        self._figures: dict[str, Any] | None = None
        self._swing = vtkTrivialProducer()
        self._swing_crimp = CrimpInterchange()
        self._swing_warp = BarycentricWarp()
        #: What gives near yarns more facets, and pixels of a metre up to which nobody needs them.
        self._detail: Facets | None = None
        self._enough = 0.0
        self._sheet: Sheet | None = None
        self._near: NearYarns | None = None
        #: What they were drawn as last, by what made it: they, and fewer facets of them.
        self._near_drawn: tuple[list[Any], list[vtkPolyData | None]] | None = None
        #: Stops the present run; whoever takes the next job gives it a new one.
        self.token = CancelToken()

    def run(self, job: Job) -> Frame:
        """Return what a job asks for."""
        with self.token.active():
            return self._run(job)

    def _run(self, job: Job) -> Frame:
        scene = self.prepared(job)
        *stages, surface = scene.stages
        # A swing replaces the motion, which need not be known for it.
        solver, mover = scene.stage("solver"), scene.stage("mover")
        swing = job.swing if solver else None
        skipped = scene.moving if swing else []
        # A swing never rests, a pull does.
        coarse = job.coarse or isinstance(swing, Swing)
        sheet, piece = self._sheet_of(scene), WHOLE
        if sheet is not None:  # in place of what has yarns
            piece = sheet.one
            skipped = [*skipped, *(stage for stage in stages[1:] if stage.makes == "object")]
        # What lies above is fresh, and each update asks all the stages above, which takes its time.
        first = min(self._first, stages.index(mover)) if mover else self._first
        for stage in stages[first:]:
            if stage not in skipped:
                self._update(scene, stage, job.time, piece)
        self._first = len(stages)
        source: Stage = stages[-1]
        cage = None
        if swing and solver:
            cage = copied(solver.output)
            if isinstance(swing, Pull):
                _add_pull(cage, swing)
            else:
                _add_swing(scene, cage, swing)
            source = source if sheet else self._swung(scene, cage)
        if sheet is not None:
            moved = scene.deformed_cage if scene.moves and cage is None else cage
            drawn = sheet.ride(moved, coarse)
        else:
            fibres = source.GetOutputDataObject(0).GetNumberOfCells() <= _FIBRED
            self._coarse.choose(AUTOMATIC_SIDES, fibres)
            numbers = None if coarse or swing is not None else DrawnCloth.of(scene)
            follows = numbers is not None and numbers.follows_camera
            detail = self._detail_of(numbers, source, job) if numbers and follows else None
            scene.surface.choose(AUTOMATIC_SIDES, fibres, detail)
            if coarse or swing is not None:
                surface = self._coarse_surface(scene, source, coarse) or surface
            if surface is self._coarse:
                surface.update(job.time)
            else:
                self._update(scene, surface, job.time, WHOLE)
            drawn = surface.GetOutputDataObject(0)
            self._require_drawn(drawn)
        cloth, crossings = (None, None) if sheet is None else (sheet.cloth, sheet.crossings)
        frame = replace(
            frame_of(scene, job.time, drawn, cage, swing is None, cloth, crossings),
            values=job.values,
            coarse=coarse and (surface is self._coarse or sheet is not None),
            swing=None if swing is None else getattr(swing, "mode", -1),
            generation=job.generation,
            warnings=tuple(dict.fromkeys(text for s in scene.stages for text in s.warnings)),
            motion=None if swing else self._motion(scene, job.coarse),
        )
        if sheet is not None:
            return self._nearer(scene, job, frame, sheet)
        if follows:
            frame = replace(frame, seen=job.seen, enough=self._enough, finer=detail is not None)
        if not coarse and drawn.GetNumberOfCells() > _HEAVY_QUADS:
            return self._lighter(scene, source, frame)
        return frame

    def _detail_of(self, cloth: DrawnCloth, source: Stage, job: Job) -> Facets | None:
        """Return what gives yarns near the camera more facets; None where nobody would see them."""
        grid = source.GetOutputDataObject(0)
        points, patches = points_of(grid), cells_of(grid, VTK_BEZIER_QUADRILATERAL, "patches")
        self._enough = pixels_enough(cloth.plies, points, patches)
        if job.seen is None:
            self._detail = None
            return None
        new = Facets(job.seen, LEAST_SIDES, quads_in_view(job.seen.size), cloth.plies)
        wanted = new(points, patches)
        # What has as many, and not far more, stays: nothing is made again for a small turn.
        present = (
            np.full(1, AUTOMATIC_SIDES) if self._detail is None else self._detail(points, patches)
        )
        few = np.square(present, dtype=float).sum() <= _SPARE * np.square(wanted, dtype=float).sum()
        if not ((present >= wanted).all() and few):
            self._detail = new if wanted.max(initial=0) > AUTOMATIC_SIDES else None
        return self._detail

    def _nearer(self, scene: Scene, job: Job, frame: Frame, sheet: Sheet) -> Frame:
        """Return a sheet's frame with the yarns that are seen near."""
        whole, thin = frame.surface, thinned(frame.surface, sheet.cells, _MOVING_CELLS)
        if frame.coarse:
            frame = replace(frame, surface=thin)
        else:
            frame = replace(frame, light=replace(frame, surface=thin), seen=job.seen)
        if job.seen is None or (frame.coarse and sheet.solves_long):
            return frame
        near = self._near
        if near is None or not near.serves(scene, sheet):
            self._near = near = NearYarns(scene, sheet)
        cage = None
        if scene.moves:
            cage = scene.deformed_cage if job.swing is None else frame.cage
        why = near.follow(job.seen, cage, job.swing is not None)
        if frame.coarse:
            few = None if why else near.light(job.time)
            if few is None or near.part is None:
                return frame
            few = copied(few)
            add_measure(few, frame.color)
            around = thinned(whole, sheet.cells, _MOVING_CELLS, near.part)
            return replace(frame, yarns=few, around=around)
        if not why:
            try:
                for stage in near.stages:
                    self._update(scene, stage, job.time, WHOLE)
            except SizeError as error:
                self._near, why = None, str(error)
        if why or near.part is None:
            return replace(frame, warnings=(*frame.warnings, why))

        # What has not changed stays the same object: it is not handed to OpenGL again.
        few = near.light(job.time)
        key = [near, frame.color, *(stage.executions for stage in near.stages)]
        if self._near_drawn is None or self._near_drawn[0] != key:
            made = [None if yarns is None else copied(yarns) for yarns in (near.yarns, few)]
            for yarns in made:
                if yarns is not None:
                    add_measure(yarns, frame.color)
            self._near_drawn = key, made
        fine, few = self._near_drawn[1]
        if few is not None and frame.light is not None:
            thin = thinned(frame.surface, sheet.cells, _MOVING_CELLS, near.part)
            frame = replace(frame, light=replace(frame.light, yarns=few, around=thin))
        around = thinned(frame.surface, sheet.cells, max(sheet.cells), near.part)
        return replace(frame, yarns=fine, around=around)

    def _lighter(self, scene: Scene, source: Stage, frame: Frame) -> Frame:
        """Return a frame with one of fewer facets to be drawn while the camera moves."""
        few = self._coarse_surface(scene, source, coarse=True)
        if few is None:
            return frame
        surface = copied(few.update(frame.time).output)
        add_measure(surface, frame.color)
        return replace(frame, light=replace(frame, surface=surface))

    def prepared(self, job: Job) -> Scene:
        """Return the scene with a job's values set; only what differs is touched."""
        here = self.scene
        if here is None or job.generation != self._generation:
            here, self._first = Scene(job.values, job.base), 0
            self.scene, self._generation = here, job.generation
        else:
            # An equal value changes nothing: only what lies downstream of a change runs.
            changed = {k: v for k, v in job.settings.items() if v != self._settings[k]}
            before = here.stages
            here.adopt(changed, job.values.keys())
            if here.stages != before:
                self._first = 0
            places = [n for n, stage in enumerate(here.stages) if stage.section in changed]
            self._first = min([self._first, *places])
        self._settings = job.settings
        return here

    def _sheet_of(self, scene: Scene) -> Sheet | None:
        """Return the sheet that a cloth of many yarns is drawn as."""
        found = self._sheet
        if found is None or not found.serves(scene):
            many = choose_level(scene, window=True).has_sheet
            self._sheet = found = Sheet(scene) if many else None
            self._near = self._near_drawn = None  # of the scene before
        return found

    def _update(self, scene: Scene, stage: Stage, at: float, piece: Piece) -> None:
        cancel.check()
        # What is made of the part in view beside the scene's stages is its surface.
        listed = stage in scene.stages
        section, before = stage.section if listed else scene.surface.section, stage.executions
        progressed = self._progressed

        def tell(caller: Stage, event: str) -> None:
            progressed(section, caller.GetProgress(), caller.GetProgressText() or "")

        progressed(section, 0.0, "")
        # Only while it runs: an observer that stays would keep the window alive with the stage.
        observer = stage.AddObserver("ProgressEvent", tell)
        begun = time.perf_counter()
        try:
            scene.update_stage(stage, at, piece)
        finally:
            stage.RemoveObserver(observer)
        if listed and stage.executions != before:
            self._ran(section, time.perf_counter() - begun, stage.executions)

    def _motion(self, scene: Scene, coarse: bool) -> dict[str, Any] | None:
        """Return how far the motion turns; a drag's, which has another at each frame, waits."""
        mover = scene.stage("mover")
        now = (mover and mover.motion), scene.stage("rotation")
        if not coarse and now != self._looked_at:
            self._looked_at, self._figures = now, report.last_motion(scene)
        return self._figures

    def _require_drawn(self, surface: vtkPolyData) -> None:
        """Refuse a surface that could not be drawn; what is drawn already takes no more."""
        size = DRAWN_POINT * surface.GetNumberOfPoints()
        if size > self._drawn:
            require(
                size - self._drawn,
                f"to draw {surface.GetNumberOfCells()} polygons",
                cure="Lower surface.subdivisions, or use fewer ends and picks.",
            )
        self._drawn = size

    def _coarse_surface(self, scene: Scene, source: Stage, coarse: bool) -> PatchTessellator | None:
        """Return the quick tessellator, connected; None where the scene's own is as coarse."""
        patches = max(1, scene.source.GetOutputDataObject(0).GetNumberOfCells())
        subdivisions = scene.surface.sides
        if coarse:
            subdivisions = max(1, int(math.sqrt(COARSE_QUADS / patches)))
        if subdivisions >= scene.surface.sides and source is not self._swing_warp:
            return None
        self._coarse.subdivisions = min(subdivisions, scene.surface.sides)
        self._coarse.SetInputConnection(source.GetOutputPort())
        return self._coarse

    def _swung(self, scene: Scene, cage: vtkUnstructuredGrid) -> BarycentricWarp:
        self._swing.SetOutput(cage)
        # A mode has no velocity that could ride along.
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
    """Put a mode's displacement on a cage."""
    count = len(array_of(cage.GetFieldData(), "eigenvalues", "a swing"))
    mode = min(swing.mode, count - 1)
    side = float(np.ptp(points_of(cage), axis=0).max())
    now = math.sin(2 * math.pi * swing.phase)
    angle = None if swing.angle is None else swing.angle * now
    add_shape(scene, cage, mode, swing.amplitude * side * now, angle)


def _add_pull(cage: vtkUnstructuredGrid, pull: Pull) -> None:
    """Stretch a cage about its middle."""
    points = points_of(cage).astype(np.float64)
    stretch = np.array([pull.weft, pull.warp, 1.0]) - 1.0
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    add_array(cage.GetPointData(), "displacement", stretch * (points - middle))
