"""Show frames of a scene in a renderer, for the window, pictures and films."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPlane, vtkPolyData
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import VTK_SURFACE, VTK_WIREFRAME, vtkActor, vtkProp, vtkRenderer

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.color_values import COLOR_VALUES
from spacemap_vtk.draw.actors.cut_face import CutFaceActor
from spacemap_vtk.draw.actors.glyphs import (
    DOT,
    CageActor,
    Cut,
    GhostActor,
    GroundActor,
    LoadActor,
    OutlineActor,
    SupportActor,
    UnderlayActor,
    moved_points,
    rest_points,
)
from spacemap_vtk.draw.actors.sheet_actor import SheetActor
from spacemap_vtk.draw.actors.surface_actor import (
    Span,
    SurfaceActor,
    color_bar_share,
    fit_color_bar,
    natural_span,
)
from spacemap_vtk.draw.annotate.annotations import Annotations
from spacemap_vtk.draw.camera import camera_up_axis, set_background
from spacemap_vtk.draw.detail.underlay import hole_color
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.draw.obstacles import fading_image
from spacemap_vtk.filters.patch_tessellator import LOOK
from spacemap_vtk.ndarrays import AnyFloats, Floats, Ints
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.settings import View
from spacemap_vtk.textile.weave.cloth import Cloth

#: Up to this number of fixed vertices, their dots have full size.
_MANY_DOTS = 40
#: Least size of dots, in points.
_LEAST_DOT = 6.0


@dataclass
class ViewOptions:
    """Selects what a view shows, in addition to the section ``[view]`` of a scene."""

    fabric: bool = True
    cage: bool = True
    #: Whether only the edges of the fabric's facets are drawn.
    wireframe: bool = False
    #: Whether colour scale and annotations are shown.
    scale: bool = True
    #: Whether the sheet of a cloth is drawn, and not all of its yarns in its place.
    sheet: bool = True
    #: Whether the axes are shown even if the scene does not request them.
    triad: bool = False
    #: Whether the scale bar is shown even if the scene does not request it.
    scale_bar: bool = False
    #: Whether the axes can be clicked.
    axes_clickable: bool = False

    def occlusion(self, view: View, span: Span | None) -> float:
        """Return the strength of contact shadows; 0 without shadows."""
        # Shadows would change colours that show numbers, so that the scale has no such colours.
        wanted = view.shadows and self.fabric and not self.wireframe and span is None
        return view.resolved_style.occlusion if wanted else 0.0


class SceneView:
    """Shows frames in a renderer, with actors that are made once and updated for each frame."""

    # `loads.pale_copy` is for a renderer in front, if the caller has one.

    def __init__(self, renderer: vtkRenderer, has_shadows: bool, samples: int = 0) -> None:
        self.renderer = renderer
        #: Whether the caller adds contact shadows, as for pictures.
        self.has_shadows = has_shadows
        #: The fabric's surface. For `samples` see `SurfaceActor`: pictures need none, because their
        #: pixels are means of smaller ones.
        self.surface = SurfaceActor(samples)
        self.cut_face, self.ghost = CutFaceActor(), GhostActor()
        self.sheet, self.preview, self.outline = SheetActor(), SurfaceActor(), OutlineActor()
        self.ground, self.underlay = GroundActor(), UnderlayActor()
        #: Obstacles: bodies, and planes, which fade out.
        self.bodies, self.planes = SurfaceActor(), SurfaceActor()
        self.planes.ForceTranslucentOn()
        self._fading: tuple[object, vtkImageData] | None = None
        for actor in (self.bodies, self.planes):
            actor.SetPickable(False)
            actor.GetProperty().BackfaceCullingOn()
        #: Height of the ground [m]: the lowest point that has been shown of the scene.
        self.floor = np.inf
        self.cage, self.supports, self.loads = CageActor(), SupportActor(), LoadActor()
        # Translucent actors are drawn in this order.
        for actor in (*self.solids, self.planes, self.ground, self.ghost, *self.markers):
            renderer.AddActor(actor)
        # Annotations come first, because their plates are behind the colour scales.
        self.annotations = Annotations(renderer)
        for drawn in (self.surface, self.sheet):
            renderer.AddViewProp(drawn.color_bar)
        #: Current clipping plane; None if nothing is cut.
        self.cut: Cut | None = None
        #: Width of the colour scale, as a share of the picture's width.
        self.scale_width = 0.0
        #: State for which the last scale was made, and its ends; see `span_of`.
        self.span: tuple[object, Span] | None = None
        self._plane = vtkPlane()
        self._size, self._pixels, self._pixels_per_point = (1, 1), 1.0, 1.0
        #: The current frame; None if nothing is shown.
        self._frame: Frame | None = None
        self._view, self._options = View(), ViewOptions()
        self._span: Span | None = None
        self._moving, self._generation = False, 0

    @property
    def solids(self) -> list[vtkActor]:
        """Actors of objects in the scene, which cast contact shadows."""
        drawn = [self.surface, self.sheet, self.preview, self.outline, self.cut_face]
        return [*drawn, self.underlay, self.bodies]

    @property
    def markers(self) -> list[vtkActor]:
        """Actors of lines, dots and arrows, which cast no contact shadows."""
        return [self.cage, self.supports, self.loads]

    @property
    def overlays(self) -> list[vtkProp]:
        """Annotations and colour scales, which are drawn over everything else."""
        return [*self.annotations.props, self.surface.color_bar, self.sheet.color_bar]

    @property
    def has_overlays(self) -> bool:
        """Whether anything is shown that casts no contact shadow."""
        others = [*self.markers, self.bodies, self.surface.color_bar, self.sheet.color_bar]
        if self.annotations.props[0].GetVisibility():
            others += [self.ghost, self.ground, self.planes]
            if self.annotations.has_content:
                return True
        return any(prop.GetVisibility() for prop in others)

    def fit(
        self, view: View, size: tuple[int, int], pixels: float, pixels_per_point: float
    ) -> None:
        """Set colours and sizes of a view; `pixels` are drawn per pixel of the picture."""
        self._size, self._pixels, self._pixels_per_point = size, pixels, pixels_per_point
        below, above = view.resolved_style.bottom_color, view.resolved_style.top_color
        set_background(self.renderer, below, above)
        self.cage.GetProperty().SetColor(*(c / 255 for c in view.line_color))
        self.supports.GetProperty().SetColor(*(c / 255 for c in view.support_color))
        self.sheet.set_background(below, above)
        self.annotations.fit(below, size, pixels)
        for drawn in (self.surface, self.sheet):
            fit_color_bar(drawn.color_bar, size, below, pixels)

    def span_of(self, frame: Frame) -> Span | None:
        """Return the ends of a frame's scale; while only the time changes, it never shrinks."""
        numbers = frame.surface.GetPointData().GetArray(COLOR_VALUES)
        values = frame.crossings if COLORINGS[frame.color].shows_numbers else None
        if numbers is not None:
            values = vtk_to_numpy(numbers)
        if values is None:
            return None
        low, high = natural_span(values)
        if self.span is not None and self.span[0] == (frame.values, frame.mode):
            low, high = min(low, self.span[1][0]), max(high, self.span[1][1])
        self.span = (frame.values, frame.mode), (low, high)
        return low, high

    def show(
        self,
        frame: Frame,
        view: View,
        options: ViewOptions,
        span: Span | None = None,
        cut: Cut | None = None,
    ) -> None:
        """Show a frame, with a colour scale over `span`."""
        self._frame, self._view, self._options, self._span = frame, view, options, span
        self._moving = False
        has_scale = options.fabric and options.scale and span is not None
        self.scale_width = color_bar_share(self._size) if has_scale else 0.0
        self.renderer.GetActiveCamera().SetWindowCenter(self.scale_width, 0.0)
        for actor in (self.surface, self.sheet, self.preview):
            actor.VisibilityOff()
            actor.color_bar.VisibilityOff()
        self.outline.VisibilityOff()
        if options.fabric:
            self._show_fabric(frame)
        self._show_underlay(frame)
        time, annotations = (
            frame.time if frame.cage else None,
            (options.triad, options.scale_bar, options.axes_clickable),
        )
        self.annotations.show(view, time, has_scale, *annotations)
        if not options.scale:
            for prop in self.overlays:
                prop.VisibilityOff()
        ghost, supports = view.ghost and options.fabric, view.supports and options.cage
        self.ghost.SetVisibility(ghost)
        if ghost:
            self.ghost.show(frame.surface, frame.closed)
        self.cage.SetVisibility(options.cage)
        if options.cage:
            self.cage.show(frame.cage, self._pixels_per_point, options.fabric)
            # Translucent ghost and ground are drawn after opaque actors. The lines must then be
            # translucent too, or they would not be drawn over them.
            self.cage.SetForceOpaque(not (ghost or view.ground))
        self.supports.SetVisibility(supports)
        if supports:
            self.supports.show(frame.cage)
            count = self.supports.GetMapper().GetInput().GetNumberOfPoints()
            self.supports.SetVisibility(count > 0)  # VTK goes on to draw points that are gone
            dot = DOT * min(1.0, (_MANY_DOTS / max(1, count)) ** 0.5)  # else they hide the cloth
            self.supports.GetProperty().SetPointSize(max(_LEAST_DOT, dot) * self._pixels_per_point)
        self.loads.SetVisibility(view.loads)
        self._show_obstacles(frame)
        self._show_ground(frame)
        self.apply_cut(cut)

    def replace_fabric(self, frame: Frame) -> None:
        """Replace the shown part of the fabric by another one, and keep everything else."""
        self._show_surface(self.surface, frame)
        self.surface.color_bar.VisibilityOff()
        self._fill_cut(frame, frame.surface)

    def apply_cut(self, cut: Cut | None) -> None:
        """Cut the shown objects with a plane; None shows them whole."""
        if cut is not None:
            self._plane.SetNormal(*cut[0])
            self._plane.SetOrigin(*cut[1])
        if (cut is None) != (self.cut is None):
            # Arrows are not clipped: `LoadActor.show` hides whole arrows.
            for actor in (*self.solids[:4], self.ghost, self.cage, self.supports):
                if cut is None:
                    actor.GetMapper().RemoveAllClippingPlanes()
                else:
                    actor.GetMapper().AddClippingPlane(self._plane)
        self.cut = cut
        if cut is not None:
            self.underlay.VisibilityOff()
        if (frame := self._frame) is not None:
            self._fill_cut(frame, frame.surface if frame.cloth is None else frame.yarns)
            if self._view.loads:
                self.loads.show(frame.arrows, cut)

    def _fill_cut(self, frame: Frame, yarns: vtkPolyData | None) -> None:
        """Draw the face of the cut, except for wireframes, in motion, or if no yarns are drawn."""
        options, view = self._options, self._view
        solid = options.fabric and not options.wireframe and not self._moving
        cut = self.cut if solid and yarns is not None else None
        surface = frame.surface if yarns is None else yarns
        self.cut_face.fill(
            surface, cut, frame.color, view.object_color, self._span, view.resolved_style
        )

    @property
    def occlusion(self) -> float:
        """Strength of the contact shadows; 0 without shadows."""
        shown = self._frame is not None
        return self._options.occlusion(self._view, self._span) if shown else 0.0

    @property
    def has_exposure(self) -> bool:
        """Whether the surface itself is shaded where yarns touch, so that no shadows are added."""
        frame = self._frame
        surface = None if frame is None else frame.surface if frame.cloth is None else frame.yarns
        return surface is not None and surface.GetPointData().HasArray(LOOK) == 1

    def include_shadows(self, on: bool) -> None:
        """Set whether the colours of a sheet include the contact shadows of its yarns."""
        self.has_shadows = on
        self.sheet.set_shadow_strength(self.occlusion if on else 0.0)

    def show_alone(self, color_bar: vtkScalarBarActor) -> None:
        """Hide the frame; show annotations and scale beside objects that the caller draws."""
        self._hide_frame()
        for drawn in (self.surface, self.sheet):
            drawn.color_bar.VisibilityOff()
        has_scale = bool(color_bar.GetVisibility()) and self._options.scale
        color_bar.SetVisibility(has_scale)
        below = self._view.resolved_style.bottom_color
        fit_color_bar(color_bar, self._size, below, self._pixels)
        self.scale_width = color_bar_share(self._size) if has_scale else 0.0
        self.renderer.GetActiveCamera().SetWindowCenter(self.scale_width, 0.0)
        triad, bar, clickable = (
            self._options.triad,
            self._options.scale_bar,
            self._options.axes_clickable,
        )
        self.annotations.show(self._view, None, has_scale, triad, bar, clickable)

    def _hide_frame(self) -> None:
        self._frame = None
        for actor in (*self.solids, *self.markers, self.planes, self.ghost, self.ground):
            actor.VisibilityOff()
        self.loads.show(None)  # clears the arrows in the renderer in front, too

    def hide(self) -> None:
        """Show nothing until the next frame."""
        self._hide_frame()
        for prop in self.overlays:
            prop.VisibilityOff()

    def set_moving(self, moving: bool) -> None:
        """Show the light version of the frame while the camera moves, or the frame again."""
        frame = self._frame
        if frame is None or moving == self._moving:
            return
        preview = frame.preview
        if not self._options.fabric or preview is None:
            return
        self._moving = moving
        if preview.cloth is not None:
            self._show_sheet(preview if moving else frame, preview.cloth)
            # Cells of the light sheet are so wide that it would cross the dark layer.
            self._show_underlay(None if moving else frame)
        # A second actor is used, so that the fine one keeps its buffers in OpenGL.
        yarns = preview.surface if preview.cloth is None else preview.yarns
        if moving and yarns is not None:
            closed = preview.closed or preview.cloth is not None
            self._show_surface(self.preview, replace(preview, surface=yarns, closed=closed))
            self.preview.color_bar.VisibilityOff()
        self.preview.SetVisibility(moving and yarns is not None)
        fine = frame.cloth is None or frame.yarns is not None
        self.surface.SetVisibility(fine and not moving)
        self.ghost.SetVisibility(self._view.ghost and not moving)
        if moving:
            self.cut_face.VisibilityOff()
        elif self.cut is not None:
            self.apply_cut(self.cut)

    def _show_underlay(self, frame: Frame | None) -> None:
        """Show the dark layer inside the cloth of a frame; None hides it."""
        underlay = frame.underlay if frame is not None and self.occlusion > 0.0 else None
        self.underlay.show(None if underlay is None else underlay.surface)
        if underlay is not None:
            self.underlay.GetProperty().SetColor(*underlay.color)

    def _show_obstacles(self, frame: Frame) -> None:
        """Show bodies and planes in the material of the style, also beside a scale."""
        style = self._view.resolved_style
        lit = replace(style.for_obstacles, occlusion=style.occlusion * self._view.shadows)
        shown = frame.obstacles
        if self._fading is None or self._fading[0] != style.ground_color:
            self._fading = style.ground_color, fading_image(style.ground_color)
        for actor, name, picture in (
            (self.bodies, "bodies", None),
            (self.planes, "planes", self._fading[1]),
        ):
            surface = None if shown is None else getattr(shown, name)
            visible = surface is not None and surface.GetNumberOfPolys() > 0
            actor.SetVisibility(visible and self._view.obstacles)
            if visible:
                plain = style.obstacle_color
                actor.show(surface, "own", plain, None, picture, lit, self._pixels_per_point)

    def _show_ground(self, frame: Frame) -> None:
        # A plane is the ground itself.
        wanted = self._view.ground and self._options.fabric and not self.planes.GetVisibility()
        strength = self._view.resolved_style.shadow if wanted else 0.0
        self.ground.SetVisibility(strength > 0.0)
        if strength > 0.0:
            points, up = points_of(frame.surface), camera_up_axis(frame.camera)
            if self.bodies.GetVisibility():
                points = np.concatenate([points, points_of(self.bodies.GetMapper().GetInput())])
            if frame.generation != self._generation:
                self._generation, self.floor = frame.generation, np.inf
            self.floor = min(self.floor, float(points[:, up].min()))
            self.ground.show(points, up, self.floor, strength)

    def _show_fabric(self, frame: Frame) -> None:
        if frame.cloth is None:
            self._show_surface(self.surface, frame)
            return
        # The sheet also has the colour scale of yarns that are drawn in its place.
        if self._options.sheet or COLORINGS[frame.color].shows_numbers:
            self._show_sheet(frame, frame.cloth)
        if frame.yarns is not None:
            self._show_surface(self.surface, replace(frame, surface=frame.yarns, closed=True))
            self.surface.color_bar.VisibilityOff()

    def _show_sheet(self, frame: Frame, cloth: Cloth) -> None:
        sheet = frame.surface if frame.surroundings is None else frame.surroundings
        style = self._view.resolved_style
        # The sheet gets contact shadows only if yarns would get them too.
        strength = self.occlusion if self.has_shadows else 0.0
        self.sheet.set_shadow_strength(strength)
        self.sheet.show_sheet(sheet, cloth, frame.color, self._span, style, frame.crossings)
        is_dark_inside = strength > 0.0 and not style.shines_through
        self.sheet.set_hole_color(hole_color(cloth) if is_dark_inside else None)
        self._set_representation(self.sheet)

    def _show_surface(self, actor: SurfaceActor, frame: Frame) -> None:
        style, colors = (
            replace(self._view.resolved_style, occlusion=self.occlusion),
            (frame.color, self._view.object_color, self._span),
        )
        # Outlines in the shader need round edges; other surfaces get lines of `OutlineActor` only.
        actor.show(
            frame.surface, *colors, frame.texture, style, self._pixels_per_point * frame.closed
        )
        # Back faces of closed yarns are hidden, but take as much time as front faces.
        actor.GetProperty().SetBackfaceCulling(frame.closed)
        self._set_representation(actor)
        has_outline = style.outline > 0.0 and not self._options.wireframe
        has_outline &= frame.surface.GetPointData().GetNormals() is not None
        self.outline.SetVisibility(has_outline)
        if has_outline:
            pixels = max(
                1.0, (0.5 if frame.closed else 1.0) * style.outline * self._pixels_per_point
            )
            max_width = style.outline_share * frame.relief
            size = self.renderer.GetRenderWindow().GetSize()
            self.outline.show(frame.surface, style, pixels, size, max_width)

    def _set_representation(self, actor: SurfaceActor) -> None:
        actor.VisibilityOn()
        properties, wireframe = actor.GetProperty(), self._options.wireframe
        properties.SetRepresentation(VTK_WIREFRAME if wireframe else VTK_SURFACE)
        # Widths for wireframes, and for objects made of lines or points.
        properties.SetLineWidth((1.0 if wireframe else 2.0) * self._pixels_per_point)
        properties.SetPointSize(3.0 * self._pixels_per_point)


def extent_of(frame: Frame, loads: bool) -> Floats:
    """Return points that must be visible in a frame's picture, (n, 3)."""
    points = points_of(frame.surface)
    # A few thousand points are enough.
    clouds = [points[:: 1 + len(points) // 5000].astype(np.float64)]
    if frame.cage is not None:
        # The cage at rest and displaced: a vibration should not leave the picture at once. A cage
        # with an equilibrium vibrates around it, and never appears in its rest shape.
        rest, equilibrium = points_of(frame.cage), frame.cage.GetPointData().GetArray("equilibrium")
        if equilibrium is not None:
            rest = rest + vtk_to_numpy(equilibrium)
        clouds += [rest, moved_points(frame.cage)]
    if loads and frame.arrows is not None:
        clouds.append(frame.arrows.reach)
    if frame.obstacles is not None:
        clouds.append(frame.obstacles.reach)
    return np.concatenate(clouds)


def visible_cells(frame: Frame, view: View, options: ViewOptions) -> list[tuple[AnyFloats, Ints]]:
    """Return points of each shown object, and the index of the first point of each cell."""
    objects, points = [], []
    if options.fabric:
        polygons = frame.surface.GetPolys()
        if polygons.GetNumberOfCells():
            corners = vtk_to_numpy(polygons.GetConnectivityArray())
            first = vtk_to_numpy(polygons.GetOffsetsArray())[:-1].astype(np.int64)
            objects.append((points_of(frame.surface)[corners], first))
        else:
            points.append(points_of(frame.surface))
        if view.ghost:
            points.append(rest_points(frame.surface))
    if options.cage and frame.cage is not None:
        points.append(moved_points(frame.cage))
    if view.loads and frame.arrows is not None:
        points.append(frame.arrows.reach)
    if view.obstacles and frame.obstacles is not None:
        points.append(frame.obstacles.reach)
    # Each of these points is a cell.
    return objects + [(each, np.arange(len(each))) for each in points]
