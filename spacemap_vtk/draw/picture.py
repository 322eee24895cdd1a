"""Draw pictures of a scene at any time, offscreen."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkBoundingBox
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.actors.contact_shadows import contact_shadows, covered_part
from spacemap_vtk.draw.actors.glyphs import cut_of, moved_points, rest_points
from spacemap_vtk.draw.actors.sheet_actor import simplify_sheet
from spacemap_vtk.draw.actors.surface_actor import Span, color_bar_share, natural_span
from spacemap_vtk.draw.camera import (
    CameraView,
    Viewpoint,
    aim_camera,
    camera_up_axis,
    depths_to_metres,
    pixels_per_metre,
    pixels_per_metre_at_focus,
)
from spacemap_vtk.draw.compose import (
    Background,
    Shadows,
    compose,
    gradient_background,
    transparent_background,
)
from spacemap_vtk.draw.depth_of_field import mean_over_lens
from spacemap_vtk.draw.detail.cloth_sheet import ClothSheet
from spacemap_vtk.draw.detail.facets import choose_facets
from spacemap_vtk.draw.detail.underlay import ClothUnderlay
from spacemap_vtk.draw.detail.yarn_parts import YarnPieces
from spacemap_vtk.draw.frame import Frame, arrows_of, camera_of, frame_of, relief_of
from spacemap_vtk.draw.graphics import WITHOUT_OPENGL, uses_software_renderer
from spacemap_vtk.draw.inset import place_inset, view_of_inset
from spacemap_vtk.draw.obstacles import obstacle_reach
from spacemap_vtk.draw.offscreen import OffscreenWindow, open_offscreen
from spacemap_vtk.draw.scene_view import SceneView, ViewOptions
from spacemap_vtk.ndarrays import AnyFloats, Bytes, Floats, Progress, Singles
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.flat_picture import flat_cloth, picture_size
from spacemap_vtk.scenes.insets import Inset
from spacemap_vtk.scenes.level_of_detail import (
    DrawingMethod,
    DrawnCloth,
    LevelOfDetail,
    choose_level,
)
from spacemap_vtk.scenes.memory_estimates import (
    SAMPLES,
    PictureRequest,
    panel_contents,
    panel_widths,
    require_piece,
    require_pixels,
    supersampling,
)
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:
    from spacemap_vtk.draw.software.window import SoftwareWindow

Image = Bytes
#: Points that span a motion, (n, 3), and the ends of its scale; None without a scale.
Extent = tuple[Floats, Span | None]

#: Facets around a quarter of a yarn with which clearances are exact to about a hundredth of the
#: yarn's diameter.
_FINE_SIDES = 4
#: Largest error of a sheet's points, in pixels.
_SHEET_PIXELS = 0.1
#: Height of a picture in which a point is one pixel.
_POINT_HEIGHT = 960
#: Angle between two moments of an orbit for which the camera leaves room, in degrees.
_ORBIT_STEP = 15.0
#: Least size of a point, in pixels.
_LEAST_POINT = 0.6


class _Panel(NamedTuple):
    """A part of the picture with its window and contents."""

    window: OffscreenWindow | SoftwareWindow
    scene_view: SceneView
    options: ViewOptions
    #: Whether contact shadows are drawn.
    has_shadows: bool
    #: Background of the picture.
    background: Background
    #: Width and height of the panel's picture in pixels.
    size: tuple[int, int]


class Picture:
    """Draws a scene at several times, with a fixed camera.

    Parameters
    ----------
    scene : Scene
        Scene to draw.
    times : sequence of float
        Times in s that will be drawn; the camera shows the motion over all of them.
    size : tuple of 2 int, optional
        Width and height in pixels; by default the scene's.
    show : sequence of str, optional
        Content of each panel, ``"fabric"``, ``"cage"`` or ``"both"``; by default the scene's.
    viewpoint : Viewpoint, optional
        Placement of the camera; by default the scene's.
    extent : tuple, optional
        Points that the camera shows and the ends of the scale, for more than this motion of the
        scene; see `motion_extent`.
    for_page : bool
        Whether the picture is for a page, which has a scale for all pictures. Then there is no
        background and no scale, and pixels have a fourth value, their coverage.
    transparent : bool
        Whether there is no background, as for `for_page`, but a scale.
    wireframe : bool
        Whether only the edges of the fabric's facets are drawn.
    orbits : bool
        Whether the camera goes round the scene as ``[animation]`` says.

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
        viewpoint: Viewpoint | None = None,
        extent: Extent | None = None,
        for_page: bool = False,
        transparent: bool = False,
        wireframe: bool = False,
        orbits: bool = False,
    ) -> None:
        # Checked first, so that a machine that cannot draw does not solve the scene in vain.
        opengl = not uses_software_renderer()
        if not opengl:
            scene.warn(WITHOUT_OPENGL)
        self._wireframe = wireframe
        #: View for which the facets of the yarns were chosen; None without yarns.
        self._facets_for: CameraView | None = None
        #: Whether an inset has chosen other facets since.
        self._inset_facets = False
        self._viewpoint, self._for_page, self._transparent = (
            viewpoint,
            for_page,
            for_page or transparent,
        )
        self.scene = scene
        #: Receives the share of a picture that is drawn, for slow ones with a lens or insets.
        self.report_progress: Progress = lambda _: None
        width, height = size or picture_size(scene)
        panels = panel_contents(scene, show)
        self._request = PictureRequest((width, height), len(times), panels, wireframe)
        #: Level of detail of the yarns.
        self.level = choose_level(scene, self._request, opengl=opengl)
        #: The cloth as a sheet; None if all yarns fit into memory together.
        self.sheet = ClothSheet(scene) if self.level.has_sheet else None
        choose = partial(choose_picture_facets, scene, (width, height), show, viewpoint, for_page)
        points, self._span = extent or motion_extent(scene, times, self.sheet, choose)
        self._relief = relief_of(scene)
        self._up, self._orbits = camera_up_axis(camera_of(scene)), orbits and scene.animation.orbit
        #: Point about which the camera turns; None: its focus.
        self._orbit_middle: Floats | None = None
        if self._orbits:
            if viewpoint is None and isinstance(camera_of(scene), str):
                self._orbit_middle = (points.min(axis=0) + points.max(axis=0)) / 2
            points = _turn_points(points, self._up, scene.animation.orbit)
        cloth = DrawnCloth.from_scene(scene)
        if cloth is not None:
            view = _camera_view(scene, (width, height), show, viewpoint, for_page, points)
            self.level = _set_facets(scene, cloth, self.level, points, view)
            self._facets_for = view
            if self.level.method in (DrawingMethod.PIECES, DrawingMethod.TILES):
                require_pixels(scene, self._request)  # they need more than those of the sheet
            #: Largest error of a sheet's points in m.
            self._sheet_tolerance = _SHEET_PIXELS * cloth.spacing / max(self.level.pixels, 1e-9)
        self._has_lens = self._find_lens(points)
        self.panels: list[_Panel] = []
        for panel, w in zip(panels, panel_widths(width, len(panels)), strict=True):
            self.panels.append(self._make_panel(scene, panel, (w, height), points))
        #: Makes the yarns one piece after another; None if they are drawn together or not at all.
        self.pieces = None if cloth is None else self._make_pieces(cloth)
        #: Viewpoint of each panel when the picture was made.
        self._viewpoints = [Viewpoint.from_camera(each.window.camera) for each in self.panels]
        #: Makes the dark layer inside a closed cloth; None if there is none, or no yarn is drawn.
        self._underlay: ClothUnderlay | None = None
        if self.sheet is None or self.pieces is not None:
            self._underlay = ClothUnderlay.make_if_needed(scene, self.sheet)
        self._cut = cut_of(scene.view, scene.patches if self.sheet is None else self.sheet.moved)
        #: The frame that was drawn last.
        self._frame: Frame | None = None

    def _find_lens(self, points: Floats) -> bool:
        """Return whether the camera has a lens; warn if it cannot have the one of the scene."""
        scene, camera = self.scene, vtkCamera()
        _place_camera(scene, camera, points, 1.0, self._viewpoint)
        wanted, flat = scene.view.aperture > 0.0, bool(camera.GetParallelProjection())
        if wanted and flat:
            scene.warn(
                "view.aperture is ignored: a camera without perspective has no depth of field"
            )
        return wanted and not flat

    def _make_pieces(self, cloth: DrawnCloth) -> YarnPieces | None:
        """Prepare drawing the yarns piece by piece, if the level of detail asks for it."""
        if self.level.is_sampled:
            self.panels[-1].window.set_samples(SAMPLES)
        if cloth.clearance:
            self._warn_of_few_facets()
        if self.level.method not in (DrawingMethod.PIECES, DrawingMethod.TILES):
            return None
        patches = cloth.patches // self.level.pieces
        sides = cloth.subdivisions or self.level.sides
        require_piece(self.scene, (cloth.ends, cloth.picks), patches, sides)
        return YarnPieces(self.scene, self.level)

    def _warn_of_few_facets(self) -> None:
        """Warn that clearances on few facets are rough, because each facet is flat."""
        if (sides := self.scene.surface.sides) < _FINE_SIDES:
            self.scene.warn(
                f"clearances are approximate: at this picture size, yarns have only {4 * sides} "
                f"facets around; set surface.subdivisions = {_FINE_SIDES} for accurate values"
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
            Red, green and blue; without background also the coverage, shape (height, width, 4).
        """
        view, sheet, surface, cloth, crossings = self.scene.view, self.sheet, None, None, None
        self._aim_cameras(time)
        if sheet is None:
            self.scene.update(time)
        else:
            surface, cloth, crossings = sheet.update(time), sheet.cloth, sheet.crossings
        frame = frame_of(self.scene, time, surface, None, view.loads, cloth, crossings)
        if sheet is not None and self.pieces is None:
            few = simplify_sheet(frame.surface, sheet.cells, self._sheet_tolerance)
            frame = replace(frame, surface=few)
        if self._underlay is not None:
            cage = self.scene.deformed_cage if self.scene.moves else None
            frame = replace(frame, underlay=self._underlay.in_cage(cage))
        self._frame = frame
        return self._draw_frame(frame)

    def draw_from(self, viewpoint: Viewpoint) -> Image:
        """Return the picture at the time that was drawn last, from another viewpoint.

        Nothing is computed again: facets remain those of the picture's own viewpoint.

        Parameters
        ----------
        viewpoint : Viewpoint
            Where the camera is, and where it looks.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Colours; the first row is the top one.
        """
        assert self._frame is not None  # `draw` comes first
        for panel in self.panels:
            viewpoint.apply_to(panel.window.camera)
        return self._draw_frame(self._frame)

    def _draw_frame(self, frame: Frame) -> Image:
        """Draw a frame in all panels, with the present cameras."""
        view = self.scene.view
        insets = () if self._for_page else view.insets
        count = len(self.panels) + len(insets)
        drawn = [
            self._draw_panel(panel, frame, _part_of(self.report_progress, number, count))
            for number, panel in enumerate(self.panels)
        ]
        for number, inset in enumerate(insets):
            report = _part_of(self.report_progress, len(self.panels) + number, count)
            drawn[-1] = self._add_inset(drawn[-1], frame, number, inset, report)
        return np.concatenate(drawn, axis=1)

    def _aim_cameras(self, time: float) -> None:
        """Turn the cameras on their orbit, and choose the facets again if that is needed."""
        turn = self.scene.animation.turn_at(time) if self._orbits else 0.0
        for panel, start in zip(self.panels, self._viewpoints, strict=True):
            start.turned(turn, self._up, self._orbit_middle).apply_to(panel.window.camera)
        if self._facets_for is not None and (turn or self._inset_facets):
            aim = self._facets_for.viewpoint.turned(turn, self._up, self._orbit_middle)
            view = self._facets_for._replace(viewpoint=aim)
            choose_facets(self.scene.surface, self.level, view, self.scene.view.yarn_look)

    def _add_inset(
        self, image: Image, frame: Frame, number: int, inset: Inset, report: Progress
    ) -> Image:
        """Draw an inset of the last panel over its picture."""
        scene, panel = self.scene, self.panels[-1]
        content = panel_contents(scene, self._request.panels)[-1]
        surface = frame.surface if self.sheet is None else self.sheet.moved
        extent = points_of(surface).astype(np.float64), self._span
        camera, free = panel.window.camera, panel.scene_view.scale_width
        enlarged = panel.window.size[1] / panel.size[1]
        plates = [
            tuple(end / enlarged for end in box) for box in panel.scene_view.annotations.boxes
        ]
        shown = view_of_inset(number, inset, camera, surface, panel.size, free, plates)
        close = Picture(
            scene,
            [frame.time],
            (shown.side, shown.side),
            [content],
            shown.viewpoint,
            extent,
            for_page=True,
            wireframe=self._wireframe,
        )
        close.report_progress = report
        image = place_inset(image, close.draw(frame.time), shown, scene.view)
        close.close()
        self._inset_facets = True
        return image

    def _draw_panel(self, panel: _Panel, frame: Frame, report: Progress) -> Image:
        """Draw a panel with its camera, or with all cameras on the lens."""
        if not self._has_lens:
            return self._draw_once(panel, frame)
        return mean_over_lens(
            panel.window.camera,
            self.scene.view,
            panel.size,
            lambda place: self._draw_once(panel, frame, place),
            report,
            points_of(frame.surface),
        )

    def _draw_once(
        self, panel: _Panel, frame: Frame, place_camera: Callable[[], None] | None = None
    ) -> Image:
        window, scene_view, options, has_shadows, background, _ = panel
        view, pieces = self.scene.view, self.pieces if options.fabric else None
        options = replace(options, sheet=pieces is None)
        scene_view.show(frame, view, options, self._span, self._cut)
        if place_camera is not None:
            place_camera()
        self._set_clipping_range(window, pieces)
        # The colours of cloth, as yarns or as a sheet, include the contact shadows of its yarns.
        has_shadows = has_shadows and self.sheet is None and not scene_view.has_exposure
        has_overlays = scene_view.has_overlays
        # Signs and annotations are drawn after the solids have their shadows or all pieces.
        second_pass = pieces is not None or (has_shadows and has_overlays)
        # Bodies are shaded by `show_obstacles`; shadows from their depths would be dark rims.
        still = (scene_view.bodies, scene_view.planes, scene_view.ghost, scene_view.ground)
        others = (*scene_view.markers, *still, *scene_view.overlays)
        later = [prop for prop in others if second_pass and prop.GetVisibility()]
        for prop in later:
            prop.VisibilityOff()
        if pieces is not None:
            scene_view.sheet.VisibilityOff()
        window.render(front=not second_pass)
        if pieces is not None:
            assert self.sheet is not None
            width, height = window.size
            for piece in pieces.visible_pieces(
                frame.time, self.sheet, window.camera, width / height
            ):
                scene_view.replace_fabric(replace(frame, surface=piece, cloth=None, closed=True))
                window.render(front=False, keep=True)
        depths = [window.depths()] if has_shadows else []
        if second_pass:
            for solid in scene_view.solids:
                solid.VisibilityOff()
            for prop in later:
                prop.VisibilityOn()
            window.render(keep=True)
            depths += [window.depths(second_pass)] if has_shadows and has_overlays else []
        shadows = self._compute_shadows(panel, *depths) if depths else None
        return compose(window.pixels(), background, shadows)

    def _set_clipping_range(
        self, window: OffscreenWindow | SoftwareWindow, pieces: YarnPieces | None
    ) -> None:
        window.renderer.ResetCameraClippingRange()
        if pieces is not None:
            # All pieces need the same range. Otherwise depths of different pieces could not be
            # compared.
            assert self.sheet is not None
            visible = vtkBoundingBox(self.sheet.moved.GetBounds())
            visible.AddBounds(window.renderer.ComputeVisiblePropBounds())
            low, high = np.array(visible.GetMinPoint()), np.array(visible.GetMaxPoint())
            bounds = np.stack([low - self._relief, high + self._relief], axis=1)
            window.renderer.ResetCameraClippingRange(*bounds.ravel().tolist())

    def _compute_shadows(
        self, panel: _Panel, depths: Singles, marker_depths: Singles | None = None
    ) -> Shadows | None:
        """Return the factors for the light of pixels, and their part of the picture; or None."""
        window, height = panel.window, len(depths)
        pixels = self._relief * pixels_per_metre_at_focus(window.camera, height)
        box = covered_part(depths < 1.0, pixels)
        if box is None:
            return None
        depth = depths_to_metres(window.camera, depths[box])
        factors = contact_shadows(
            depth, self._relief, pixels, self.scene.view.resolved_style.occlusion
        )
        if marker_depths is not None:
            # Markers are not objects of the scene: they neither cast nor receive shadows.
            factors[marker_depths[box] < depths[box]] = 1.0
        top, first = (side.start for side in box)
        for edges in panel.scene_view.annotations.boxes:
            left, low, right, high = map(round, edges)
            above, beside = max(height - high - top, 0), max(left - first, 0)
            factors[above : max(height - low - top, 0), beside : max(right - first, 0)] = 1.0
        return box, factors

    def _make_panel(
        self, scene: Scene, panel: str, size: tuple[int, int], extent: Floats
    ) -> _Panel:
        view = scene.view
        fabric, cage = panel != "cage", panel != "fabric"
        options = ViewOptions(fabric, cage, self._wireframe, scale=not self._for_page)
        has_shadows = options.occlusion(view, self._span) > 0.0
        block, samples = supersampling(panel, has_shadows, size)
        if self.level.method is DrawingMethod.SHEET and panel == "fabric":
            block, samples = 1, SAMPLES  # a sheet needs samples only at its edges
        signs = view.triad or view.scale_bar or view.time_stamp or self._span is not None
        if self._has_lens and panel == "fabric" and not signs:
            block, samples = 1, 0  # the mean over the lens has smooth edges, but not of signs
        window = open_offscreen((size[0] * block, size[1] * block), samples, block)
        scene_view = SceneView(window.renderer, has_shadows=True)
        # Dots and lines scale with the picture, like text, but stay large enough to be seen.
        point = block * max(_LEAST_POINT, size[1] / _POINT_HEIGHT) * view.line_scale
        scene_view.fit(view, size, block, point)
        scene_view.sheet.set_grain(block)
        scene_view.sheet.shows_face = (
            flat_cloth(scene) is not None and self._viewpoint is None and not self._orbits
        )
        scene_view.floor = float(extent[:, self._up].min())
        window.hide_background()
        if view.loads:
            window.add_front_prop(scene_view.loads.pale_copy)
        # Panels side by side have the same scale, so each one leaves room for a colour scale.
        scale_width = 0.0 if self._span is None or self._for_page else color_bar_share(size)
        _place_camera(
            scene, window.camera, extent, (1 - scale_width) * size[0] / size[1], self._viewpoint
        )
        window.camera.SetWindowCenter(scale_width, 0.0)
        background = gradient_background(
            size, view.resolved_style.bottom_color, view.resolved_style.top_color
        )
        if self._transparent:
            background = transparent_background(size)
        return _Panel(window, scene_view, options, has_shadows, background, size)

    def close(self) -> None:
        """Close the windows and free their resources."""
        for panel in self.panels:
            panel.window.close()


def _place_camera(
    scene: Scene, camera: vtkCamera, points: Floats, aspect: float, viewpoint: Viewpoint | None
) -> None:
    """Place a camera as the scene requests, or at the given viewpoint."""
    aim_camera(camera, points, aspect, camera_of(scene), scene.view.zoom)
    if viewpoint is not None:
        viewpoint.apply_to(camera)


def _set_facets(
    scene: Scene, cloth: DrawnCloth, level: LevelOfDetail, points: Floats, view: CameraView
) -> LevelOfDetail:
    """Return the level of detail for points in a view, and set the scene's facets to it."""
    scale = pixels_per_metre(view.camera, points, view.size[1])
    new_level = level.at_scale(cloth, scale, view.size)
    choose_facets(scene.surface, new_level, view, scene.view.yarn_look)
    return new_level


def choose_picture_facets(
    scene: Scene,
    size: tuple[int, int],
    show: Sequence[str],
    viewpoint: Viewpoint | None,
    for_page: bool,
    points: Floats,
) -> bool:
    """Set the facets of a scene for a picture of the points; return whether yarns are visible."""
    cloth = DrawnCloth.from_scene(scene)
    if cloth is None:
        return False
    view = _camera_view(scene, size, show, viewpoint, for_page, points)
    return _set_facets(scene, cloth, LevelOfDetail(), points, view).shows_yarns


def _camera_view(
    scene: Scene,
    size: tuple[int, int],
    show: Sequence[str],
    viewpoint: Viewpoint | None,
    for_page: bool,
    points: Floats,
) -> CameraView:
    """Return the view of the panel with the fabric, in a picture of the points."""
    camera, width = vtkCamera(), panel_widths(size[0], len(panel_contents(scene, show)))[-1]
    has_scale = COLORINGS[scene.view.color].shows_numbers and not for_page
    share = color_bar_share((width, size[1])) if has_scale else 0.0
    _place_camera(scene, camera, points, (1 - share) * width / size[1], viewpoint)
    camera.SetWindowCenter(share, 0.0)
    return CameraView.from_camera(camera, (width, size[1]))


def motion_extent(
    scene: Scene,
    times: Sequence[float],
    sheet: ClothSheet | None = None,
    choose_facets: Callable[[Floats], bool] | None = None,
) -> Extent:
    """Return points that span the scene's motion, (n, 3), and the ends of its scale."""
    # `choose` sets the facets for these points, and returns whether yarns are wide enough to be
    # seen. The ends of the scale are those of numbers on these facets.
    sheet = sheet or ClothSheet.make_if_needed(scene)
    # Nine times are enough for the extremes of a vibration, and take nine runs of the warp.
    sampled_times = [times[i] for i in sorted(set(np.linspace(0, len(times) - 1, 9).astype(int)))]
    clouds: list[AnyFloats] = []
    for time in sampled_times:
        if sheet is not None:
            clouds.append(points_of(sheet.deform_at(time)))
        else:
            scene.update_stage(scene.last_object, time)
            clouds.append(_thin_out(points_of(scene.patches)))
        arrows = arrows_of(scene, time) if scene.view.loads else None
        if arrows is not None:
            clouds.append(arrows.reach)
        if scene.moves:
            clouds.append(moved_points(scene.deformed_cage))
    if scene.view.obstacles and scene.moves:
        clouds.append(_thin_out(obstacle_reach(scene.deformed_cage)))
    if scene.view.ghost:
        clouds.append(_thin_out(rest_points(scene.patches if sheet is None else sheet.moved)))
    points = np.concatenate(clouds, dtype=np.float64)
    if scene.view.ground:
        up, shadow = camera_up_axis(camera_of(scene)), points.copy()
        shadow[:, up] = points[:, up].min()
        points = np.concatenate([points, shadow])
    # Facets take longer than their motion, so they are made only after their number is chosen.
    yarns_visible = choose_facets is not None and choose_facets(points)
    if sheet is not None and yarns_visible:
        sheet.sides = scene.surface.sides
    has_numbers = COLORINGS[scene.view.color].shows_numbers
    ends = (
        [end for time in sampled_times for end in _value_range(scene, time, sheet)]
        if has_numbers
        else []
    )
    return points, natural_span(np.array(ends)) if ends else None


def _value_range(scene: Scene, time: float, sheet: ClothSheet | None) -> list[float]:
    """Return the smallest and largest number that colours show at a time; empty without numbers."""
    if sheet is None:
        scene.update(time)
        numbers = color_values(scene.polygons, scene.view.color)
    else:
        numbers = color_values(sheet.update(time), scene.view.color)
        if numbers is None:
            numbers = sheet.crossings if sheet.extremes is None else sheet.extremes
    return [] if numbers is None else [float(numbers.min()), float(numbers.max())]


def _turn_points(points: Floats, axis: int, angle: float) -> Floats:
    """Return points turned about their middle in steps, so that all of an orbit is in view."""
    # The camera turns, so that the points turn the other way for it.
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    count = 2 + int(min(abs(angle), 360.0) // _ORBIT_STEP)
    thin = _thin_out(points).astype(np.float64) - middle
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turned = []
    for turn in np.radians(np.linspace(0.0, -math.copysign(min(abs(angle), 360.0), angle), count)):
        each = thin.copy()
        each[:, first] = np.cos(turn) * thin[:, first] - np.sin(turn) * thin[:, second]
        each[:, second] = np.sin(turn) * thin[:, first] + np.cos(turn) * thin[:, second]
        turned.append(each + middle)
    return np.concatenate(turned)


def combine_extents(extents: Sequence[Extent]) -> Extent:
    """Combine the extents of several motions into one, with a common scale."""
    clouds, spans = zip(*extents, strict=True)
    ends = np.array([span for span in spans if span is not None])
    return np.concatenate(clouds), natural_span(ends) if ends.size else None


def _thin_out(points: AnyFloats) -> AnyFloats:
    return points[:: max(1, len(points) // 20_000)]


def _part_of(progress: Progress, number: int, count: int) -> Progress:
    """Return a function that reports the share of one of `count` parts as that of all."""
    return lambda share: progress((number + share) / count)
