"""What stands in a view of a scene: in the window, in a picture, in a film."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPolyData
from vtkmodules.vtkRenderingCore import VTK_SURFACE, VTK_WIREFRAME, vtkActor, vtkProp, vtkRenderer

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.coloring import SHOWN
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
    moved_points,
    rest_of,
)
from spacemap_vtk.draw.actors.sheet_actor import SheetActor
from spacemap_vtk.draw.actors.surface_actor import (
    Span,
    SurfaceActor,
    fit_scale,
    natural_span,
    scale_share,
)
from spacemap_vtk.draw.annotate.annotations import Annotations
from spacemap_vtk.draw.camera import set_background, upward
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.ndarrays import AnyFloats, Floats, Ints
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.settings import View
from spacemap_vtk.textile.weave.cloth import Cloth

#: Fixed vertices whose dots are of full size, and the least size [points] of those of more.
_MANY_DOTS, _LEAST_DOT = 40, 6.0


@dataclass
class Look:
    """Which things are shown; all else is said by a scene's section ``[view]``."""

    fabric: bool = True
    cage: bool = True
    #: Whether of the fabric only the facets' edges are drawn.
    wireframe: bool = False
    #: Whether numbers have their scale at the right, and anything is written over the view.
    scale: bool = True
    #: Whether the axes and a round length are shown even where no scene asks for them; axes that
    #: are handled can be clicked at.
    triad: bool = False
    scale_bar: bool = False
    handled: bool = False

    def occlusion(self, view: View, span: Span | None) -> float:
        """Return how deep contact shadows are; 0 where there are none."""
        # A colour that stands for a number must be found again in the scale.
        wanted = view.shadows and self.fabric and not self.wireframe and span is None
        return view.look.occlusion if wanted else 0.0


class SceneView:
    """Shows frames in a renderer: its actors are made once, and brought up to date by each."""

    # What shines through, `loads.through`, is for a renderer in front, if the caller has one.

    def __init__(self, renderer: vtkRenderer, shades: bool, samples: int = 0) -> None:
        self.renderer = renderer
        #: Whether the caller shades what is drawn, as pictures are.
        self.shades = shades
        #: See `SurfaceActor`: pictures, whose pixels are means of many, need none.
        self.surface = SurfaceActor(samples)
        self.face, self.ghost = CutFaceActor(), GhostActor()
        self.sheet, self.light, self.outline = SheetActor(), SurfaceActor(), OutlineActor()
        self.ground = GroundActor()
        #: How high the ground is [m]: nothing that has been shown of a scene is below.
        self.floor = np.inf
        self.cage, self.supports, self.loads = CageActor(), SupportActor(), LoadActor()
        for actor in (*self.solids, *self.signs, self.ghost, self.ground):
            renderer.AddActor(actor)
        # Its plates lie under the scales.
        self.annotations = Annotations(renderer)
        for drawn in (self.surface, self.sheet):
            renderer.AddViewProp(drawn.bar)
        #: What it is cut with at present; None: the whole is shown.
        self.cut: Cut | None = None
        #: Share of the width that the scale takes.
        self.room = 0.0
        #: What the last scale was for, and its ends; see `span_of`.
        self.span: tuple[object, Span] | None = None
        self._plane = vtkPlane()
        self._size, self._point = (1, 1), 1.0
        #: What is shown and how; no frame: nothing is.
        self._frame: Frame | None = None
        self._view, self._look = View(), Look()
        self._span: Span | None = None
        self._moving, self._generation = False, 0

    @property
    def solids(self) -> list[vtkActor]:
        """The things of the scene's room: they cast shadows."""
        return [self.surface, self.sheet, self.light, self.outline, self.face]

    @property
    def signs(self) -> list[vtkActor]:
        """Lines, dots and arrows, which do not."""
        return [self.cage, self.supports, self.loads]

    @property
    def over(self) -> list[vtkProp]:
        """What is written over all else."""
        return [*self.annotations.props, self.surface.bar, self.sheet.bar]

    @property
    def overlaid(self) -> bool:
        """Whether anything is shown that casts no shadow."""
        others = [*self.signs, self.surface.bar, self.sheet.bar]
        if self.annotations.props[0].GetVisibility():
            others += [self.ghost, self.ground]
            if self.annotations.written:
                return True
        return any(prop.GetVisibility() for prop in others)

    def fit(self, view: View, size: tuple[int, int], pixels: float, point: float) -> None:
        """Take a view's colours; a scale fits a size of so many pixels, lines count in points."""
        self._size, self._point = size, point
        below, above = view.look.below, view.look.above
        set_background(self.renderer, below, above)
        self.cage.GetProperty().SetColor(*(c / 255 for c in view.line_color))
        self.supports.GetProperty().SetColor(*(c / 255 for c in view.support_color))
        self.sheet.behind(below, above)
        self.annotations.fit(below, size, pixels)
        for drawn in (self.surface, self.sheet):
            fit_scale(drawn.bar, size, below, pixels)

    def span_of(self, frame: Frame) -> Span | None:
        """Return the ends of a frame's scale; while only time passes, they never come nearer."""
        numbers = frame.surface.GetPointData().GetArray(SHOWN)
        values = frame.crossings if COLORINGS[frame.color].numbers else None
        if numbers is not None:
            values = vtk_to_numpy(numbers)
        if values is None:
            return None
        low, high = natural_span(values)
        if self.span is not None and self.span[0] == (frame.values, frame.swing):
            low, high = min(low, self.span[1][0]), max(high, self.span[1][1])
        self.span = (frame.values, frame.swing), (low, high)
        return low, high

    def show(
        self, frame: Frame, view: View, look: Look, span: Span | None = None, cut: Cut | None = None
    ) -> None:
        """Show a frame, its colours' scale from one end of `span` to the other."""
        self._frame, self._view, self._look, self._span = frame, view, look, span
        self._moving = False
        scaled = look.fabric and look.scale and span is not None
        self.room = scale_share(self._size) if scaled else 0.0
        self.renderer.GetActiveCamera().SetWindowCenter(self.room, 0.0)
        for actor in (self.surface, self.sheet, self.light):
            actor.VisibilityOff()
            actor.bar.VisibilityOff()
        self.outline.VisibilityOff()
        if look.fabric:
            self._show_fabric(frame)
        time, signs = frame.time if frame.cage else None, (look.triad, look.scale_bar, look.handled)
        self.annotations.show(view, time, scaled, *signs)
        if not look.scale:
            for prop in self.over:
                prop.VisibilityOff()
        ghost, supports = view.ghost and look.fabric, view.supports and look.cage
        self.ghost.SetVisibility(ghost)
        if ghost:
            self.ghost.show(frame.surface, frame.closed)
        self.cage.SetVisibility(look.cage)
        if look.cage:
            self.cage.show(frame.cage, self._point, look.fabric)
            # Unless it lies over what is drawn afterwards.
            self.cage.SetForceOpaque(not (ghost or view.ground))
        self.supports.SetVisibility(supports)
        if supports:
            self.supports.show(frame.cage)
            count = self.supports.GetMapper().GetInput().GetNumberOfPoints()
            dot = DOT * min(1.0, (_MANY_DOTS / max(1, count)) ** 0.5)  # many would hide the cloth
            self.supports.GetProperty().SetPointSize(max(_LEAST_DOT, dot) * self._point)
        self.loads.SetVisibility(view.loads)
        self._show_ground(frame)
        self.cut_open(cut)

    def show_more(self, frame: Frame) -> None:
        """Show another part of the fabric in place of the last, all else as it is."""
        self._show_surface(self.surface, frame)
        self.surface.bar.VisibilityOff()
        self._fill_cut(frame, frame.surface)

    def cut_open(self, cut: Cut | None) -> None:
        """Cut what is shown open with another plane, or show the whole."""
        if cut is not None:
            self._plane.SetNormal(*cut[0])
            self._plane.SetOrigin(*cut[1])
        if (cut is None) != (self.cut is None):
            # Loads are never cut, see `LoadActor`.
            for actor in (*self.solids[:4], self.ghost, self.cage, self.supports):
                if cut is None:
                    actor.GetMapper().RemoveAllClippingPlanes()
                else:
                    actor.GetMapper().AddClippingPlane(self._plane)
        self.cut = cut
        if (frame := self._frame) is not None:
            self._fill_cut(frame, frame.surface if frame.cloth is None else frame.yarns)
            if self._view.loads:
                self.loads.show(frame.arrows, cut)

    def _fill_cut(self, frame: Frame, yarns: vtkPolyData | None) -> None:
        """Fill what is cut, unless it is seen through, or no yarns are drawn."""
        look, view = self._look, self._view
        solid = look.fabric and not look.wireframe and not self._moving
        cut = self.cut if solid and yarns is not None else None
        surface = frame.surface if yarns is None else yarns
        self.face.fill(surface, cut, frame.color, view.object_color, self._span, view.look)

    @property
    def occlusion(self) -> float:
        """How deep contact shadows are; 0 where there are none."""
        shown = self._frame is not None
        return self._look.occlusion(self._view, self._span) if shown else 0.0

    def shade(self, on: bool) -> None:
        """Let a sheet have the shadows of its yarns in its colours, or not."""
        self.shades = on
        self.sheet.shade(self.occlusion if on else 0.0)

    def hide(self) -> None:
        """Show nothing until the next frame."""
        self._frame = None
        for actor in (*self.solids, *self.signs, self.ghost, self.ground):
            actor.VisibilityOff()
        self.loads.show(None)  # those that shine through, too
        for prop in self.over:
            prop.VisibilityOff()

    def move(self, moving: bool) -> None:
        """Show what takes little time to be drawn in place of the frame, or the frame again."""
        frame = self._frame
        if frame is None or moving == self._moving:
            return
        light = frame.light
        if not self._look.fabric or light is None:
            return
        self._moving = moving
        if light.cloth is not None:
            self._show_sheet(light if moving else frame, light.cloth)
        # Another actor: the fine one keeps what it has handed to OpenGL.
        few = light.surface if light.cloth is None else light.yarns
        if moving and few is not None:
            closed = light.closed or light.cloth is not None
            self._show_surface(self.light, replace(light, surface=few, closed=closed))
            self.light.bar.VisibilityOff()
        self.light.SetVisibility(moving and few is not None)
        fine = frame.cloth is None or frame.yarns is not None
        self.surface.SetVisibility(fine and not moving)
        self.ghost.SetVisibility(self._view.ghost and not moving)
        if moving:
            self.face.VisibilityOff()
        elif self.cut is not None:
            self.cut_open(self.cut)

    def _show_ground(self, frame: Frame) -> None:
        wanted = self._view.ground and self._look.fabric
        strength = self._view.look.shadow if wanted else 0.0
        self.ground.SetVisibility(strength > 0.0)
        if strength > 0.0:
            points, up = points_of(frame.surface), upward(frame.camera)
            if frame.generation != self._generation:
                self._generation, self.floor = frame.generation, np.inf
            self.floor = min(self.floor, float(points[:, up].min()))
            self.ground.show(points, up, self.floor, strength)

    def _show_fabric(self, frame: Frame) -> None:
        if frame.cloth is None:
            self._show_surface(self.surface, frame)
            return
        self._show_sheet(frame, frame.cloth)
        if frame.yarns is not None:
            self._show_surface(self.surface, replace(frame, surface=frame.yarns, closed=True))
            self.surface.bar.VisibilityOff()

    def _show_sheet(self, frame: Frame, cloth: Cloth) -> None:
        around = frame.surface if frame.around is None else frame.around
        style = self._view.look
        # As its yarns would be: only pictures shade them.
        self.sheet.show_sheet(around, cloth, frame.color, self._span, style, frame.crossings)
        self.sheet.shade(self.occlusion if self.shades else 0.0)
        self._dress(self.sheet)

    def _show_surface(self, actor: SurfaceActor, frame: Frame) -> None:
        style, colors = self._view.look, (frame.color, self._view.object_color, self._span)
        # Of what has no round edges, only `OutlineActor` draws lines.
        actor.show(frame.surface, *colors, frame.painting, style, self._point * frame.closed)
        # Nobody sees the far sides of closed yarns, and they cost as much as the near ones.
        actor.GetProperty().SetBackfaceCulling(frame.closed)
        self._dress(actor)
        lined = style.outline > 0.0 and not self._look.wireframe
        lined &= frame.surface.GetPointData().GetNormals() is not None
        self.outline.SetVisibility(lined)
        if lined:
            pixels = max(1.0, (0.5 if frame.closed else 1.0) * style.outline * self._point)
            most = style.outline_share * frame.relief
            size = self.renderer.GetRenderWindow().GetSize()
            self.outline.show(frame.surface, style, pixels, size, most)

    def _dress(self, actor: SurfaceActor) -> None:
        actor.VisibilityOn()
        drawn, wireframe = actor.GetProperty(), self._look.wireframe
        drawn.SetRepresentation(VTK_WIREFRAME if wireframe else VTK_SURFACE)
        # Of a wire frame, and of objects of lines or points alone.
        drawn.SetLineWidth((1.0 if wireframe else 2.0) * self._point)
        drawn.SetPointSize(3.0 * self._point)


def extent_of(frame: Frame, loads: bool) -> Floats:
    """Return points that a frame's picture must have room for."""
    points = points_of(frame.surface)
    # Of many, some thousand are enough.
    clouds = [points[:: 1 + len(points) // 5000].astype(np.float64)]
    if frame.cage is not None:
        # At rest and moved: a swing should not leave the picture at once. What hangs rests where it
        # hangs, and is never seen where it was made.
        rest, hangs = points_of(frame.cage), frame.cage.GetPointData().GetArray("equilibrium")
        if hangs is not None:
            rest = rest + vtk_to_numpy(hangs)
        clouds += [rest, moved_points(frame.cage)]
    if loads and frame.arrows is not None:
        clouds.append(frame.arrows.reach)
    return np.concatenate(clouds)


def cells_shown(frame: Frame, view: View, look: Look) -> list[tuple[AnyFloats, Ints]]:
    """Return points of what is shown, and the first point of each cell that they make."""
    shown, points = [], []
    if look.fabric:
        polygons = frame.surface.GetPolys()
        if polygons.GetNumberOfCells():
            corners = vtk_to_numpy(polygons.GetConnectivityArray())
            first = vtk_to_numpy(polygons.GetOffsetsArray())[:-1].astype(np.int64)
            shown.append((points_of(frame.surface)[corners], first))
        else:
            points.append(points_of(frame.surface))
        if view.ghost:
            points.append(rest_of(frame.surface))
    if look.cage and frame.cage is not None:
        points.append(moved_points(frame.cage))
    if view.loads and frame.arrows is not None:
        points.append(frame.arrows.reach)
    # Of these, each point is a cell of its own.
    return shown + [(each, np.arange(len(each))) for each in points]
