"""Offscreen pictures of a scene, at any time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.coloring import measure
from spacemap_vtk.draw.actors.glyphs import cut_of, moved_points, rest_of
from spacemap_vtk.draw.actors.shading import contact_shade, part_with
from spacemap_vtk.draw.actors.surface_actor import Span, natural_span, scale_share
from spacemap_vtk.draw.camera import (
    Seen,
    Viewpoint,
    aim,
    metres_from,
    pixels_of,
    pixels_per_metre,
    upward,
)
from spacemap_vtk.draw.compose import Background, Shaded, composed, gradient, nothing
from spacemap_vtk.draw.detail.cloth_sheet import Sheet
from spacemap_vtk.draw.detail.facets import choose_facets
from spacemap_vtk.draw.detail.yarn_parts import DrawnPieces
from spacemap_vtk.draw.frame import Frame, arrows_of, camera_of, frame_of, relief_of
from spacemap_vtk.draw.graphics import WITHOUT_OPENGL, draws_without_opengl
from spacemap_vtk.draw.offscreen import Offscreen, open_offscreen
from spacemap_vtk.draw.scene_view import Look, SceneView
from spacemap_vtk.ndarrays import AnyFloats, Bytes, Floats, Singles
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.face import picture_size
from spacemap_vtk.scenes.footprint import (
    SAMPLES,
    PictureRequest,
    grain_of,
    panels_of,
    widths_of,
)
from spacemap_vtk.scenes.level_of_detail import (
    DrawnCloth,
    Form,
    LevelOfDetail,
    choose_level,
)
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:
    from spacemap_vtk.draw.software.window import SoftwareWindow

Image = Bytes
#: Points that span a motion, (n, 3), and the ends of its scale.
Extent = tuple[Floats, Span | None]

#: Facets a quarter of a yarn from which distances are right to about a hundredth of its diameter.
_ROUND = 4
#: Height of a picture in which a point is a pixel, and the least part of a pixel that it becomes.
_USUAL, _LEAST = 960, 0.6


class _Panel(NamedTuple):
    """A window, what is in it, and whether there are soft shadows."""

    window: Offscreen | SoftwareWindow
    shown: SceneView
    look: Look
    shaded: bool
    #: What is seen where nothing is.
    behind: Background
    #: Width and height of its picture.
    size: tuple[int, int]


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
    extent : tuple, optional
        What the camera takes in and the ends of the scale, where that is more than the scene's
        present motion, see `over_motion`.
    bare : bool
        Whether it is laid over a page, which has a scale for all: then there is no background and
        no scale, and pictures have a fourth number, how much of a pixel is covered.
    clear : bool
        Whether there is no background, likewise, but a scale.
    wireframe : bool
        Whether only the edges of the fabric's facets are drawn.

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
        show: Sequence[str] = (),
        place: Viewpoint | None = None,
        extent: Extent | None = None,
        bare: bool = False,
        clear: bool = False,
        wireframe: bool = False,
    ) -> None:
        opengl = not draws_without_opengl()  # a machine that cannot draw need not solve
        if not opengl:
            scene.warn(WITHOUT_OPENGL)
        self._wireframe = wireframe
        self._place, self._bare, self._clear = place, bare, bare or clear
        self.scene = scene
        width, height = size or picture_size(scene)
        panels = panels_of(scene, show)
        self._request = PictureRequest((width, height), len(times), panels, wireframe)
        #: How yarns are drawn.
        self.level = choose_level(scene, self._request, opengl=opengl)
        #: What all yarns are in; None: they are in memory together.
        self.sheet = Sheet(scene) if self.level.has_sheet else None
        choose = partial(choose_scale, scene, (width, height), show, place, bare)
        room, self._span = extent or over_motion(scene, times, self.sheet, choose)
        self._relief = relief_of(scene)
        self.panels: list[_Panel] = []
        for panel, w in zip(panels, widths_of(width, len(panels)), strict=True):
            self.panels.append(self._panel(scene, panel, (w, height), room))
        #: What makes the yarns one piece after another; None: they are together, or not seen.
        self.pieces: DrawnPieces | None = None
        self._choose_form(room)
        self._cut = cut_of(scene.view, scene.patches if self.sheet is None else self.sheet.moved)

    def _choose_form(self, room: Floats) -> None:
        """Choose facets by what can be seen of a yarn, or draw the sheet."""
        scene, panel = self.scene, self.panels[-1]
        cloth = DrawnCloth.of(scene)
        if cloth is None:
            return
        seen = Seen.through(panel.window.camera, panel.size)
        self.level = _at_camera(scene, cloth, self.level, room, seen)
        if self.level.is_sampled:
            panel.window.take_samples(SAMPLES)
        if cloth.clearance:
            self._tell_of_facets()
        if self.level.form is Form.SHADER:
            for each in self.panels:
                each.shown.sheet.resolve(True)
        if self.level.form in (Form.PIECES, Form.TILES):
            self.pieces = DrawnPieces(scene, self.level)

    def _tell_of_facets(self) -> None:
        """Say that distances on few facets are rough: each is taken for flat."""
        if (sides := self.scene.surface.sides) < _ROUND:
            self.scene.warn(
                "distances between yarns are rough: in a picture of this size a yarn has "
                f"{4 * sides} facets around; surface.subdivisions = {_ROUND} measures them finely"
            )

    def draw(self, time: float) -> Image:
        """Return the picture at a time.

        Parameters
        ----------
        time : float
            In s.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green and blue; without background a fourth number, how much is covered.
        """
        view, sheet, surface, cloth, crossings = self.scene.view, self.sheet, None, None, None
        if sheet is None:
            self.scene.update(time)
        else:
            surface, cloth, crossings = sheet.update(time), sheet.cloth, sheet.crossings
        frame = frame_of(self.scene, time, surface, None, view.loads, cloth, crossings)
        return np.concatenate([self._drawn(panel, frame) for panel in self.panels], axis=1)

    def _drawn(self, panel: _Panel, frame: Frame) -> Image:
        window, shown, look, shaded, behind, _ = panel
        view, pieces = self.scene.view, self.pieces if look.fabric else None
        shown.show(frame, view, look, self._span, self._cut)
        self._choose_range(window, pieces)
        # A sheet has the shadows of its yarns in its colours.
        shaded = shaded and (self.sheet is None or pieces is not None)
        signs = shown.overlaid
        # What is drawn once solids have their shadows, or their pieces are all there.
        over = pieces is not None or (shaded and signs)
        others = (*shown.signs, shown.ghost, shown.ground, *shown.over)
        later = [prop for prop in others if over and prop.GetVisibility()]
        for prop in later:
            prop.VisibilityOff()
        if pieces is not None:
            shown.sheet.VisibilityOff()
        window.render(front=not over)
        if pieces is not None:
            assert self.sheet is not None
            width, height = window.size
            for piece in pieces.in_sight(frame.time, self.sheet, window.camera, width / height):
                shown.show_more(replace(frame, surface=piece, cloth=None, closed=True))
                window.render(front=False, over=True)
        depths = [window.depths()] if shaded else []
        if over:
            for solid in shown.solids:
                solid.VisibilityOff()
            for prop in later:
                prop.VisibilityOn()
            window.render(over=True)
            depths += [window.depths(over)] if shaded and signs else []
        shade = self._shade(panel, *depths) if depths else None
        return composed(window.pixels(), behind, shade)

    def _choose_range(self, window: Offscreen | SoftwareWindow, pieces: DrawnPieces | None) -> None:
        window.renderer.ResetCameraClippingRange()
        if pieces is not None:
            # One range for all: what is drawn first must not be farther for what comes later.
            low, high = np.array(window.renderer.ComputeVisiblePropBounds()).reshape(3, 2).T
            bounds = np.stack([low - self._relief, high + self._relief], axis=1)
            window.renderer.ResetCameraClippingRange(*bounds.ravel().tolist())

    def _shade(self, panel: _Panel, depths: Singles, signs: Singles | None = None) -> Shaded | None:
        """Return by what the light of pixels is to be multiplied, where it is at all."""
        window, height = panel.window, len(depths)
        pixels = self._relief * pixels_of(window.camera, height)
        box = part_with(depths < 1.0, pixels)
        if box is None:
            return None
        depth = metres_from(window.camera, depths[box])
        shade = contact_shade(depth, self._relief, pixels, self.scene.view.look.occlusion)
        if signs is not None:
            # A sign is no thing in the room: it neither casts a shadow nor stands in one.
            shade[signs[box] < depths[box]] = 1.0
        top, first = (side.start for side in box)
        for edges in panel.shown.annotations.boxes:
            left, low, right, high = map(round, edges)
            above, beside = max(height - high - top, 0), max(left - first, 0)
            shade[above : max(height - low - top, 0), beside : max(right - first, 0)] = 1.0
        return box, shade

    def _panel(self, scene: Scene, panel: str, size: tuple[int, int], extent: Floats) -> _Panel:
        view = scene.view
        fabric, cage = panel != "cage", panel != "fabric"
        look = Look(fabric, cage, self._wireframe, scale=not self._bare)
        shaded = look.occlusion(view, self._span) > 0.0
        block, samples = grain_of(panel, shaded, size)
        if self.level.form is Form.SHADER:
            block, samples = 1, SAMPLES  # the shader looks at many places in each pixel
        window = open_offscreen((size[0] * block, size[1] * block), samples, block)
        shown = SceneView(window.renderer, shades=True)
        # Dots and lines grow with the picture, as letters do, down to where they can be seen.
        point = block * max(_LEAST, size[1] / _USUAL) * view.line_scale
        shown.fit(view, size, block, point)
        shown.sheet.fit_pixels(block)
        shown.floor = float(extent[:, upward(camera_of(scene))].min())
        window.leave_background()
        if view.loads:
            window.add_in_front(shown.loads.through)
        # Panels side by side are of one scale, so all leave the room that one needs for numbers.
        room = 0.0 if self._span is None or self._bare else scale_share(size)
        _aim(scene, window.camera, extent, (1 - room) * size[0] / size[1], self._place)
        window.camera.SetWindowCenter(room, 0.0)
        behind = gradient(size, view.look.below, view.look.above)
        if self._clear:
            behind = nothing(size)
        return _Panel(window, shown, look, shaded, behind, size)

    def close(self) -> None:
        """Free the windows."""
        for panel in self.panels:
            panel.window.close()


def _aim(
    scene: Scene, camera: vtkCamera, room: Floats, aspect: float, place: Viewpoint | None
) -> None:
    """Place a camera where a scene's picture is seen from, or where somebody says."""
    aim(camera, room, aspect, camera_of(scene), scene.view.zoom)
    if place is not None:
        place.take(camera)


def _at_camera(
    scene: Scene, cloth: DrawnCloth, level: LevelOfDetail, room: Floats, seen: Seen
) -> LevelOfDetail:
    """Return the level of detail of points that are seen, and let a scene have its facets."""
    scale = pixels_per_metre(seen.camera, room, seen.size[1])
    found = level.at_scale(cloth, scale, seen.size)
    choose_facets(scene.surface, found, seen)
    return found


def choose_scale(
    scene: Scene,
    size: tuple[int, int],
    show: Sequence[str],
    place: Viewpoint | None,
    bare: bool,
    room: Floats,
) -> bool:
    """Let a scene have the facets of pictures of some points; return whether yarns are seen."""
    cloth = DrawnCloth.of(scene)
    if cloth is None:
        return False
    camera, width = vtkCamera(), widths_of(size[0], len(panels_of(scene, show)))[-1]
    scaled = COLORINGS[scene.view.color].numbers and not bare
    share = scale_share((width, size[1])) if scaled else 0.0
    _aim(scene, camera, room, (1 - share) * width / size[1], place)
    camera.SetWindowCenter(share, 0.0)
    seen = Seen.through(camera, (width, size[1]))
    return _at_camera(scene, cloth, LevelOfDetail(), room, seen).shows_yarns


def over_motion(
    scene: Scene,
    times: Sequence[float],
    sheet: Sheet | None = None,
    choose: Callable[[Floats], bool] | None = None,
) -> Extent:
    """Return points that span the scene over some of the times, (n, 3), and its scale's ends."""
    # The scale is that of the facets that `choose` chooses for these points; it returns whether
    # yarns are wide enough to be seen.
    sheet = sheet or Sheet.if_many(scene)
    # Nine times find the extremes of a swing well enough, and cost nine steps of the warp.
    chosen = [times[i] for i in sorted(set(np.linspace(0, len(times) - 1, 9).astype(int)))]
    clouds: list[AnyFloats] = []
    for time in chosen:
        if sheet is not None:
            clouds.append(points_of(sheet.place(time)))
        else:
            scene.update_stage(scene.last_object, time)
            clouds.append(_some(points_of(scene.patches)))
        arrows = arrows_of(scene, time) if scene.view.loads else None
        if arrows is not None:
            clouds.append(arrows.reach)
        if scene.moves:
            clouds.append(moved_points(scene.deformed_cage))
    if scene.view.ghost:
        clouds.append(_some(rest_of(scene.patches if sheet is None else sheet.moved)))
    room = np.concatenate(clouds, dtype=np.float64)
    if scene.view.ground:
        up, shadow = upward(camera_of(scene)), room.copy()
        shadow[:, up] = room[:, up].min()
        room = np.concatenate([room, shadow])
    # Facets cost more than what moves them: they are made once it is known how many, if at all.
    seen = choose is not None and choose(room)
    if sheet is not None and seen:
        sheet.sides = scene.surface.sides
    numbered = COLORINGS[scene.view.color].numbers
    ends = [end for time in chosen for end in _ends(scene, time, sheet)] if numbered else []
    return room, natural_span(np.array(ends)) if ends else None


def _ends(scene: Scene, time: float, sheet: Sheet | None) -> list[float]:
    """Return the least and the largest number that colours show at a time, if any."""
    if sheet is None:
        scene.update(time)
        numbers = measure(scene.polygons, scene.view.color)
    else:
        numbers = measure(sheet.update(time), scene.view.color)
        if numbers is None:
            numbers = sheet.crossings if sheet.ends is None else sheet.ends
    return [] if numbers is None else [float(numbers.min()), float(numbers.max())]


def together(extents: Sequence[Extent]) -> Extent:
    """Return what spans several motions, and the ends of a scale for all of them."""
    clouds, spans = zip(*extents, strict=True)
    ends = np.array([span for span in spans if span is not None])
    return np.concatenate(clouds), natural_span(ends) if ends.size else None


def _some(points: AnyFloats) -> AnyFloats:
    return points[:: max(1, len(points) // 20_000)]
