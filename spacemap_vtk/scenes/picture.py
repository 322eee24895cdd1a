"""Offscreen pictures of a scene, at any time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPlane, vtkPointSet, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersCore import vtkExtractEdges
from vtkmodules.vtkFiltersGeneral import vtkWarpVector
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from spacemap_vtk.scenes.coloring import add_measure, measure
from spacemap_vtk.scenes.glyphs import GhostActor, LoadActor, SupportActor, cut_of, rest_of
from spacemap_vtk.scenes.graphics import prepare_offscreen
from spacemap_vtk.scenes.load_arrows import Arrows, load_arrows
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.shading import averaged, contact_shade
from spacemap_vtk.scenes.surface_actor import (
    Span,
    SurfaceActor,
    fit_scale,
    natural_span,
    scale_share,
)

Image = NDArray[np.uint8]

#: Where a camera stands, seen from the middle of the scene; y is up, except from the top.
CAMERAS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "three-quarter": ((0.75, 0.35, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "top": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
}
#: Full opening of the lens, in degrees, and the share of the picture left free at each edge.
_VIEW_ANGLE, _MARGIN = 24.0, 0.06
#: Depth of an object's folds as a share of its diagonal; a fabric's is the yarn's diameter.
_OBJECT_RELIEF = 0.03
#: A pixel of the picture is the mean of a block of drawn ones, this many wide and high.
_SAMPLES = 2


class Place(NamedTuple):
    """Where a camera stands, in m."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float]
    parallel_scale: float = 0.0
    """Half the height of what a parallel projection shows; 0 for perspective."""


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
    place : Place, optional
        Where the camera stands; by default where the scene says.

    Raises
    ------
    MissingLibraryError
        If this machine cannot draw.
    """

    def __init__(
        self,
        scene: Scene,
        times: Sequence[float],
        size: tuple[int, int] | None = None,
        show: Sequence[str] | None = None,
        place: Place | None = None,
    ) -> None:
        prepare_offscreen()
        self._place = place
        self.scene = scene
        width, height = size or scene.view.size
        chosen = scene.view.show if scene.moves else "fabric"
        panels = show or (["cage", "fabric"] if chosen == "side by side" else [chosen])
        extent, self._span = _over_motion(scene, times)
        self._relief = _relief(scene)
        # The last panel takes the pixels that do not divide evenly.
        widths = [width // len(panels)] * len(panels)
        widths[-1] += width - sum(widths)
        self._followers: list[vtkAlgorithm] = []
        self._solids: list[SurfaceActor] = []
        self._ghosts: list[GhostActor] = []
        self._loads: list[LoadActor] = []
        cut = cut_of(scene.view, scene.polygons)
        self._plane = None
        if cut is not None:
            self._plane = vtkPlane()
            self._plane.SetNormal(cut[0])
            self._plane.SetOrigin(cut[1])
        self._panels = [
            (
                self._plotter(scene, panel, (w * _SAMPLES, height * _SAMPLES), extent),
                scene.view.shadows and panel != "cage",
            )
            for panel, w in zip(panels, widths, strict=True)
        ]

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
            for ghost in self._ghosts:
                ghost.show(surface)
        for arrows in self._loads:
            arrows.show(_arrows(self.scene, time))
        return np.concatenate([self._drawn(*panel) for panel in self._panels], axis=1)

    def _drawn(self, plotter: pv.Plotter, shaded: bool) -> Image:
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()
        light = plotter.screenshot(None, return_img=True).astype(np.float32)
        if shaded:
            camera = plotter.camera
            half = camera.distance * np.tan(np.radians(_VIEW_ANGLE / 2))
            if camera.GetParallelProjection():
                half = camera.parallel_scale
            pixel = 2 * half / light.shape[0]
            light *= contact_shade(_depth(plotter), self._relief, self._relief / pixel)[:, :, None]
        return np.clip(averaged(light, _SAMPLES) + 0.5, 0, 255).astype(np.uint8)

    def _plotter(
        self, scene: Scene, panel: str, size: tuple[int, int], extent: NDArray[np.float64]
    ) -> pv.Plotter:
        view = scene.view
        plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        plotter.set_background(view.background, top=view.background_top)
        solid = _solid() if panel in ("fabric", "both") else None
        # Panels side by side are of one scale, so all leave the room that one needs for numbers.
        room = 0.0 if self._span is None else scale_share(size)
        aim(plotter.camera, extent, (1 - room) * size[0] / size[1], view.camera, view.zoom)
        if self._place is not None:
            plotter.camera.position, plotter.camera.focal_point = self._place[:2]
            plotter.camera.up = self._place.up
            if self._place.parallel_scale:
                plotter.camera.parallel_scale = self._place.parallel_scale
                plotter.camera.SetParallelProjection(True)
        add_lights(plotter)
        actors: list[vtkActor] = []
        if solid is not None:
            fit_scale(solid.bar, size, view.background)
            plotter.camera.SetWindowCenter(room, 0.0)
            self._solids.append(solid)
            actors.append(solid)
            plotter.renderer.AddViewProp(solid.bar)
            if view.ghost:
                self._ghosts.append(GhostActor())
                actors.append(self._ghosts[-1])
        if panel in ("cage", "both"):
            edges = _cage_edges(scene)
            self._followers.append(edges)
            actors.append(_lines(edges, view.cage_color))
            if view.supports and scene.mover is scene.response:
                actors.append(_supports(scene, view.support_color))
        if self._plane is not None:
            for actor in actors:
                actor.GetMapper().AddClippingPlane(self._plane)
        if view.loads:  # half an arrow says nothing
            self._loads.append(LoadActor())
            actors.append(self._loads[-1])
        for actor in actors:
            plotter.add_actor(actor, reset_camera=False)
        plotter.enable_anti_aliasing("msaa", multi_samples=4)
        return plotter

    def close(self) -> None:
        """Free the windows."""
        for plotter, _ in self._panels:
            plotter.close()


def storyboard(
    scene: Scene,
    times: Sequence[float],
    size: tuple[int, int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Image:
    """Draw the paper's figure 6: cage above, fabric below, time from left to right.

    Parameters
    ----------
    scene : Scene
        A scene that moves.
    times : sequence of float
        The times of the columns, in s.
    size : tuple of 2 int, optional
        Width and height of the whole in pixels; by default the scene's height for each row.
    progress : callable, optional
        Told the number of columns drawn.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Rows a and b, labelled, with the time under each column.
    """
    from spacemap_vtk.scenes.labels import label_storyboard

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
    chosen = [times[i] for i in np.unique(np.linspace(0, len(times) - 1, 9).astype(int))]
    clouds, ends = [], []
    for time in chosen:
        scene.update(time)
        points = _points(scene.patches)
        clouds.append(points[:: max(1, len(points) // 20_000)])
        arrows = _arrows(scene, time) if scene.view.loads else None
        if arrows is not None:
            clouds += [arrows.starts, arrows.starts + arrows.vectors]
        numbers = measure(scene.polygons, scene.view.color)
        if numbers is not None:
            ends += [float(numbers.min()), float(numbers.max())]
        if scene.moves:
            cage = scene.deformed_cage
            clouds.append(
                _points(cage) + vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
            )
    if scene.view.ghost:
        clouds.append(rest_of(scene.polygons).astype(np.float64))
    return np.concatenate(clouds), natural_span(np.array(ends)) if ends else None


def _arrows(scene: Scene, time: float) -> Arrows | None:
    """Return what acts on a scene's cage; None where that is not known."""
    if not scene.moves or scene.mover is not scene.response:
        return None
    return load_arrows(scene.response, scene.deformed_cage, time)


def _points(data: vtkPointSet) -> NDArray[np.float64]:
    return vtk_to_numpy(data.GetPoints().GetData())


def _depth(plotter: pv.Plotter) -> NDArray[np.float32]:
    """Return the distance from the camera of what was drawn last, NaN where nothing was."""
    width, height = plotter.render_window.GetSize()
    buffer = vtkFloatArray()
    plotter.render_window.GetZbufferData(0, 0, width - 1, height - 1, buffer)
    z = vtk_to_numpy(buffer).reshape(height, width)[::-1]
    near, far = plotter.camera.clipping_range
    if plotter.camera.GetParallelProjection():
        distance = near + z * (far - near)
    else:
        distance = near * far / (far - z * (far - near))
    distance[z >= 1.0] = np.nan
    return distance.astype(np.float32)


def _relief(scene: Scene) -> float:
    """Return the size of the scene's relief in m, by which its contact shadows are made."""
    if scene.source is scene.weave:
        cloth = scene.weave.fabric.cloth
        return float(max(np.max(cloth.warp_diameter), np.max(cloth.weft_diameter)))
    return _OBJECT_RELIEF * scene.source.GetOutputDataObject(0).GetLength()


def _solid() -> SurfaceActor:
    actor = SurfaceActor()
    surface = actor.GetProperty()
    # for objects of lines or points alone
    surface.SetLineWidth(2.0 * _SAMPLES)
    surface.SetPointSize(3.0 * _SAMPLES)
    return actor


def _cage_edges(scene: Scene) -> vtkAlgorithm:
    moved = vtkWarpVector()
    moved.SetInputConnection(scene.mover.GetOutputPort())
    moved.SetInputArrayToProcess(0, 0, 0, vtkDataObject.FIELD_ASSOCIATION_POINTS, "displacement")
    edges = vtkExtractEdges()
    edges.SetInputConnection(moved.GetOutputPort())
    return edges


def _lines(edges: vtkAlgorithm, color: Sequence[int]) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(edges.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    line = actor.GetProperty()
    line.SetColor(*(c / 255 for c in color))
    line.SetLighting(False)
    line.SetLineWidth(1.6 * _SAMPLES)
    return actor


def _supports(scene: Scene, color: Sequence[int]) -> SupportActor:
    actor = SupportActor()
    actor.show(scene.modal.GetOutputDataObject(0))
    actor.GetProperty().SetColor(*(c / 255 for c in color))
    actor.GetProperty().SetPointSize(actor.GetProperty().GetPointSize() * _SAMPLES)
    return actor


def add_lights(plotter: pv.Plotter) -> None:
    """Light a scene.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Without lights of its own.
    """
    # A raking key light from the upper left shows the crowns of the yarns; a weak one from the
    # right opens the shadows. Both are fixed to the camera.
    for position, intensity, color in (
        ((-0.9, 1.0, 0.9), 0.85, (1.0, 0.98, 0.94)),
        ((1.0, 0.1, 0.8), 0.30, (0.90, 0.94, 1.0)),
        ((0.0, 0.0, 1.0), 0.15, (1.0, 1.0, 1.0)),
    ):
        light = pv.Light(
            position=position, intensity=intensity, color=color, light_type="camera light"
        )
        plotter.add_light(light)


def aim(
    camera: pv.Camera, points: NDArray[np.float64], aspect: float, name: str, zoom: float
) -> None:
    """Place the camera so that the points just fill the picture.

    Parameters
    ----------
    camera : pyvista.Camera
        To be placed.
    points : ndarray, shape (n, 3)
        What is to be seen.
    aspect : float
        The picture's width over its height.
    name : str
        A key of `CAMERAS`.
    zoom : float
        Above 1: nearer.
    """
    direction, up = (np.array(v) / np.linalg.norm(v) for v in CAMERAS[name])
    right = np.cross(up, direction)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    axes = np.stack([right, up, direction])
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    slope = np.tan(np.radians(_VIEW_ANGLE / 2)) * (1 - 2 * _MARGIN)
    # What is near looks larger, so the middle of the picture is not that of the scene: a few
    # rounds of placing the camera and centring what it sees.
    for _ in range(4):
        across, above, toward = (seen - middle).T
        # A point is in the picture if |across| <= slope * (distance - toward), above likewise.
        distance = max(
            float((np.abs(across) / (slope * aspect) + toward).max()),
            float((np.abs(above) / slope + toward).max()),
        )
        for axis, offset in enumerate((across, above)):
            ratio = offset / (distance - toward)
            middle[axis] += (ratio.min() + ratio.max()) / 2 * distance
    focus = middle @ axes
    camera.focal_point = focus
    camera.position = focus + direction * distance / zoom
    camera.up = up
    camera.view_angle = _VIEW_ANGLE
