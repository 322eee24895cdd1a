"""Offscreen pictures of a scene, at any time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPlane, vtkPointSet, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersCore import vtkExtractEdges
from vtkmodules.vtkFiltersGeneral import vtkWarpVector
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.draw.camera import VIEW_ANGLE, aim
from spacemap_vtk.draw.coloring import add_measure, measure
from spacemap_vtk.draw.cut_face import CutFaceActor
from spacemap_vtk.draw.glyphs import (
    DOT,
    LINE,
    GhostActor,
    LoadActor,
    SupportActor,
    cut_of,
    rest_of,
)
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.load_arrows import Arrows, Loaded, load_arrows
from spacemap_vtk.draw.offscreen import Offscreen
from spacemap_vtk.draw.shading import averaged, contact_shade, strips
from spacemap_vtk.draw.surface_actor import (
    Span,
    SurfaceActor,
    fit_scale,
    natural_span,
    scale_share,
)
from spacemap_vtk.scenes.scene import Scene

Image = NDArray[np.uint8]

#: Depth of an object's folds as a share of its diagonal; a fabric's is the yarn's diameter.
_OBJECT_RELIEF = 0.03
#: A pixel of the picture is the mean of a block of drawn ones, this many wide and high.
_SAMPLES = 2
#: Height of a picture in which a point is a pixel, and the least part of a pixel that it becomes.
_USUAL, _LEAST = 960, 0.6


class Viewpoint(NamedTuple):
    """Where a camera stands, in m."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float]
    parallel_scale: float = 0.0
    """Half the height of what a parallel projection shows; 0 for perspective."""


class _Panel(NamedTuple):
    """A window, whether there are soft shadows in it, and what is in it."""

    window: Offscreen
    shaded: bool
    solids: list[vtkActor]
    """The things of the picture's room: they cast shadows."""
    signs: list[vtkActor]
    """Lines, dots and arrows, which do not."""


class Picture:
    """Draws a scene at one time after the other, from a camera that stands still.

    Parameters
    ----------
    scene : Scene
        What to draw.
    times : sequence of float
        The times in s that will be drawn: the camera takes in the motion over all of them.
    size : tuple of 2 int, optional
        Width and height in pixels; by default the scene's.
    show : sequence of str, optional
        What each panel shows, ``"fabric"``, ``"cage"`` or ``"both"``; by default the scene's.
    place : Viewpoint, optional
        Where the camera stands; by default where the scene says.

    Raises
    ------
    MissingLibraryError
        If this machine cannot draw.
    SizeError
        If the picture would not fit into memory.
    """

    def __init__(
        self,
        scene: Scene,
        times: Sequence[float],
        size: tuple[int, int] | None = None,
        show: Sequence[str] | None = None,
        place: Viewpoint | None = None,
    ) -> None:
        prepare_offscreen()  # a machine that cannot draw need not solve
        self._place = place
        self.scene = scene
        width, height = size or scene.view.size
        scene.require_picture(width * height, len(times))
        chosen = scene.view.show if scene.moves else "fabric"
        panels = show or (["cage", "fabric"] if chosen == "side by side" else [chosen])
        extent, self._span = _over_motion(scene, times)
        self._relief = _relief(scene)
        # The last panel takes the pixels that do not divide evenly.
        widths = [width // len(panels)] * len(panels)
        widths[-1] += width - sum(widths)
        self._followers: list[vtkAlgorithm] = []
        self._solids: list[SurfaceActor] = []
        self._faces: list[CutFaceActor] = []
        self._ghosts: list[GhostActor] = []
        self._loads: list[LoadActor] = []
        self._cut = cut_of(scene.view, scene.polygons)
        self._plane = None
        if self._cut is not None:
            self._plane = vtkPlane()
            self._plane.SetNormal(self._cut[0])
            self._plane.SetOrigin(self._cut[1])
        self._panels: list[_Panel] = []
        for panel, w in zip(panels, widths, strict=True):
            self._panels.append(self._panel(scene, panel, (w, height), extent))

    def draw(self, time: float) -> Image:
        """Return the picture at a time.

        Parameters
        ----------
        time : float
            In s.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green and blue.
        """
        self.scene.update(time)
        for follower in self._followers:
            # A change of time is no change of the pipeline: each branch must ask for it itself.
            follower.UpdateTimeStep(time)
        if self._solids:
            surface = vtkPolyData()
            surface.ShallowCopy(self.scene.polygons)
            add_measure(surface, self.scene.view.color)
            for solid in self._solids:
                scene, view = self.scene, self.scene.view
                solid.show(surface, view.color, view.object_color, self._span, scene.painting)
            for face in self._faces:
                face.fill(surface, self._cut, view.color, view.object_color, self._span)
            for ghost in self._ghosts:
                ghost.show(surface)
        for arrows in self._loads:
            arrows.show(_arrows(self.scene, time), self._cut)
        return np.concatenate([self._drawn(panel) for panel in self._panels], axis=1)

    def _drawn(self, panel: _Panel) -> Image:
        window, shade = panel.window, None
        apart = panel.shaded and bool(panel.signs)
        depths = [_depth_of(panel, part) for part in (panel.solids, panel.signs) if apart]
        pixels = window.draw()
        if panel.shaded:
            shade = self._shade(window, *(depths or [window.depth()]))
        height, width = pixels.shape[:2]
        image = np.empty((height // _SAMPLES, width // _SAMPLES, 3), np.uint8)
        for rows in strips(height):
            light = pixels[rows].astype(np.float32)
            if shade is not None:
                light *= shade[rows, :, None]
            mean = np.clip(averaged(light, _SAMPLES) + 0.5, 0, 255)
            image[rows.start // _SAMPLES : rows.stop // _SAMPLES] = mean
        return image

    def _shade(
        self,
        window: Offscreen,
        depth: NDArray[np.float32],
        signs: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return by what each pixel's light is to be multiplied."""
        camera = window.camera
        half = camera.GetDistance() * np.tan(np.radians(VIEW_ANGLE / 2))
        if camera.GetParallelProjection():
            half = camera.GetParallelScale()
        shade = contact_shade(depth, self._relief, self._relief / (2 * half / len(depth)))
        if signs is not None:
            # A sign is no thing in the room: it neither casts a shadow nor stands in one.
            shade[np.nan_to_num(signs, nan=np.inf) < np.nan_to_num(depth, nan=np.inf)] = 1.0
        return shade

    def _panel(
        self, scene: Scene, panel: str, size: tuple[int, int], extent: NDArray[np.float64]
    ) -> _Panel:
        view = scene.view
        window = Offscreen(
            (size[0] * _SAMPLES, size[1] * _SAMPLES),
            view.background,
            view.background_top,
            samples=4,
            pixels=_SAMPLES,
            beside=self._panels[-1].window if self._panels else None,
        )
        # Dots and lines grow with the picture, as letters do, down to where they can be seen.
        point = _SAMPLES * max(_LEAST, size[1] / _USUAL) * scene.view.line_scale
        solid = _solid(point) if panel in ("fabric", "both") else None
        # Panels side by side are of one scale, so all leave the room that one needs for numbers.
        room = 0.0 if self._span is None else scale_share(size)
        camera = window.camera
        aim(camera, extent, (1 - room) * size[0] / size[1], view.camera, view.zoom)
        if self._place is not None:
            camera.SetPosition(*self._place.position)
            camera.SetFocalPoint(*self._place.focus)
            camera.SetViewUp(*self._place.up)
            if self._place.parallel_scale:
                camera.SetParallelScale(self._place.parallel_scale)
                camera.SetParallelProjection(True)
        solids: list[vtkActor] = []
        signs: list[vtkActor] = []
        cut: list[vtkActor] = []
        if solid is not None:
            fit_scale(solid.bar, size, view.background, _SAMPLES)
            camera.SetWindowCenter(room, 0.0)
            self._solids.append(solid)
            self._faces.append(CutFaceActor())
            solids += [solid, self._faces[-1]]
            cut.append(solid)
            window.renderer.AddViewProp(solid.bar)
            if view.ghost:
                self._ghosts.append(GhostActor())
                window.renderer.AddActor(self._ghosts[-1])
                cut.append(self._ghosts[-1])
        if panel in ("cage", "both"):
            edges = _cage_edges(scene)
            self._followers.append(edges)
            signs.append(_lines(edges, view.line_color, point))
            if view.supports and "fixed" in scene.arrays:
                signs.append(_supports(scene, view.support_color, point))
            cut += signs
        if self._plane is not None:
            for actor in cut:
                actor.GetMapper().AddClippingPlane(self._plane)
        if view.loads:  # never cut
            self._loads.append(LoadActor())
            signs.append(self._loads[-1])
            window.add_in_front(self._loads[-1].through)
        for actor in (*solids, *signs):
            window.renderer.AddActor(actor)
        # A colour that stands for a number must be found again in the scale.
        shaded = view.shadows and panel != "cage" and self._span is None
        return _Panel(window, shaded, solids, signs)

    def close(self) -> None:
        """Free the windows."""
        for panel in self._panels:
            panel.window.close()


def storyboard(
    scene: Scene,
    times: Sequence[float],
    size: tuple[int, int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Image:
    """Draw the paper's figure 6: cage above, fabric below, time from left to right."""
    from spacemap_vtk.draw.labels import label_storyboard

    width, height = size or (scene.view.size[0], scene.view.size[1])
    cell = width // len(times), height // 2
    picture = Picture(scene, times, (2 * cell[0], cell[1]), ["cage", "fabric"])
    columns = []
    for count, time in enumerate(times, 1):
        cage, fabric = np.split(picture.draw(time), 2, axis=1)
        columns.append(np.concatenate([cage, fabric]))
        if progress:
            progress(count)
    picture.close()
    return label_storyboard(np.concatenate(columns, axis=1), times)


def _over_motion(scene: Scene, times: Sequence[float]) -> tuple[NDArray[np.float64], Span | None]:
    """Return points that span the scene over some of the times, (n, 3), and its scale's ends."""
    # Nine times find the extremes of a swing well enough, and cost nine steps of the warp.
    chosen = [times[i] for i in sorted(set(np.linspace(0, len(times) - 1, 9).astype(int)))]
    clouds, ends = [], []
    for time in chosen:
        scene.update(time)
        clouds.append(_some(_points(scene.patches)))
        arrows = _arrows(scene, time) if scene.view.loads else None
        if arrows is not None:
            clouds.append(arrows.reach)
        numbers = measure(scene.polygons, scene.view.color)
        if numbers is not None:
            ends += [float(numbers.min()), float(numbers.max())]
        if scene.moves:
            cage = scene.deformed_cage
            clouds.append(
                _points(cage) + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
            )
    if scene.view.ghost:
        clouds.append(_some(rest_of(scene.polygons)).astype(np.float64))
    return np.concatenate(clouds), natural_span(np.array(ends)) if ends else None


def _arrows(scene: Scene, time: float) -> Arrows | None:
    """Return what acts on a scene's cage; None where that is not known."""
    mover = scene.stage("mover")
    if not isinstance(mover, Loaded):
        return None
    return load_arrows(mover, scene.deformed_cage, time)


def _some(points: NDArray[np.floating]) -> NDArray[np.floating]:
    return points[:: max(1, len(points) // 20_000)]


def _points(data: vtkPointSet) -> NDArray[np.float64]:
    return vtk_to_numpy(data.GetPoints().GetData())


def _depth_of(panel: _Panel, shown: list[vtkActor]) -> NDArray[np.float32]:
    """Return how far from the camera some of the things of a panel are; NaN where none is."""
    hidden = [
        actor
        for actor in (*panel.solids, *panel.signs)
        if actor not in shown and actor.GetVisibility()
    ]
    for actor in hidden:
        actor.VisibilityOff()
    panel.window.draw(front=False)
    depth = panel.window.depth()
    for actor in hidden:
        actor.VisibilityOn()
    return depth


def _relief(scene: Scene) -> float:
    """Return the size of the scene's relief in m, by which its contact shadows are made."""
    if scene.source is scene.weave:
        cloth = scene.weave.fabric.cloth
        return float(max(np.max(cloth.warp_diameter), np.max(cloth.weft_diameter)))
    return _OBJECT_RELIEF * scene.source.GetOutputDataObject(0).GetLength()


def _solid(point: float) -> SurfaceActor:
    actor = SurfaceActor()
    surface = actor.GetProperty()
    # for objects of lines or points alone
    surface.SetLineWidth(2.0 * point)
    surface.SetPointSize(3.0 * point)
    return actor


def _cage_edges(scene: Scene) -> vtkAlgorithm:
    moved = vtkWarpVector()
    moved.SetInputConnection(scene.deforming.GetOutputPort())
    moved.SetInputArrayToProcess(0, 0, 0, vtkDataObject.FIELD_ASSOCIATION_POINTS, "displacement")
    edges = vtkExtractEdges()
    edges.SetInputConnection(moved.GetOutputPort())
    return edges


def _lines(edges: vtkAlgorithm, color: Sequence[int], point: float) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(edges.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    line = actor.GetProperty()
    line.SetColor(*(c / 255 for c in color))
    line.SetLighting(False)
    line.SetLineWidth(LINE * point)
    return actor


def _supports(scene: Scene, color: Sequence[int], point: float) -> SupportActor:
    actor = SupportActor()
    actor.show(scene.deformed_cage)
    actor.GetProperty().SetColor(*(c / 255 for c in color))
    actor.GetProperty().SetPointSize(DOT * point)
    return actor
