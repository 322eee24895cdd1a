"""Draw a renderer's contents on the processor, for machines without OpenGL.

`SoftwareWindow` replaces `spacemap_vtk.draw.offscreen.OffscreenWindow` if no OpenGL library can be
loaded, with the same actors, camera, light and shadows. It needs Numba, which this program
installs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

# VTK finds its implementations of actors and text only after these modules are imported.
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkMath
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkExtractEdges, vtkTriangleFilter
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import (
    VTK_WIREFRAME,
    vtkActor,
    vtkActor2D,
    vtkCamera,
    vtkGlyph3DMapper,
    vtkProp,
    vtkRenderer,
    vtkTextActor,
    vtkTextProperty,
    vtkTextRenderer,
)

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw import graphics
from spacemap_vtk.draw.actors.contact_shadows import row_strips
from spacemap_vtk.draw.actors.glyphs import OutlineActor
from spacemap_vtk.draw.actors.lighting import lighting_tables
from spacemap_vtk.draw.actors.sheet_actor import SheetActor
from spacemap_vtk.draw.actors.surface_actor import SurfaceActor
from spacemap_vtk.draw.camera import LIGHTS, add_lights
from spacemap_vtk.filters.patch_tessellator import LOOK, STRANDS
from spacemap_vtk.ndarrays import Bytes, Floats, Ints, Singles
from spacemap_vtk.parallel import for_each, thread_count

#: Number of corners of the disc that draws a dot.
_CORNERS = 16
#: Number of bands of rows into which the picture is divided for each thread.
_BANDS = 4


class _Renderer(vtkRenderer):
    """A renderer without a VTK window; it is also its window, of which only the size is used."""

    size = (1, 1)

    def GetSize(self) -> tuple[int, int]:
        return self.size

    def GetRenderWindow(self) -> _Renderer:
        return self


class _Light(NamedTuple):
    """The light of a shape, as arguments of `spacemap_vtk.draw.software.raster_loops.shade`."""

    mode: int
    triples: Floats
    numbers: Floats


_NO_CELLS = np.zeros(0, np.int64)
_NO_NORMALS = np.zeros((0, 3))
_NO_STRANDS = np.zeros((0, 3), np.float32)
_NO_LOOKS = np.zeros((0, 2), np.float32)


class _Shape(NamedTuple):
    """Triangles of one actor, ready to be drawn."""

    #: Points in m, (n, 3).
    points: Floats
    #: Point indices of the triangles, (m, 3).
    corners: Ints
    #: Colours, 0 to 1, (k, 3): one for each point, or a table that `cells` refers to.
    colors: Singles
    light: _Light
    #: Index of each triangle's colour; empty if the points have the colours.
    cells: Ints = _NO_CELLS
    normals: Floats = _NO_NORMALS
    strands: Singles = _NO_STRANDS
    looks: Singles = _NO_LOOKS
    #: `ALL`, `BACK` or `FRONT` of `spacemap_vtk.draw.software.raster_loops`.
    cull: int = 0
    #: x, y, depth and reciprocal distance of triangles that were made in screen coordinates. Their
    #: normals are in the camera's coordinates.
    screen: Floats | None = None
    #: Texture by which colours are multiplied.
    picture: Bytes | None = None
    #: Texture coordinates of the points.
    texels: Floats | None = None


class SoftwareWindow:
    """A window that draws one renderer on the processor."""

    def __init__(self, size: tuple[int, int], samples: int = 0, pixels: int = 1) -> None:
        self.renderer = _Renderer()
        add_lights(self.renderer)
        self.size = self.renderer.size = size
        #: Resolution of text, as in VTK: 72 dpi for one pixel per point.
        self._dpi = 72 * pixels
        self._front: list[vtkProp] = []
        self.set_samples(samples)

    def add_front_prop(self, prop: vtkProp) -> None:
        """Add a prop that is drawn in front of everything else."""
        self._front.append(prop)

    def hide_background(self) -> None:
        """Do nothing, because this window never draws a background."""

    def set_samples(self, samples: int) -> None:
        """Set the number of samples: four per pixel if more than one is requested, else one."""
        width, height = self.size
        #: Number of samples along each side of a pixel.
        self._grain = 2 if samples > 1 else 1
        self._drawn = np.zeros((self._grain * height, self._grain * width, 4), np.float32)
        self._depths = np.ones(self._drawn.shape[:2], np.float32)
        #: The drawn picture with its text, in pixels of the window; None until it is requested.
        self._pixels: Singles | None = None

    @property
    def camera(self) -> vtkCamera:
        """The active camera."""
        return self.renderer.GetActiveCamera()

    def draw(self) -> Bytes:
        """Draw the renderer and return red, green, blue and coverage of each pixel."""
        self.renderer.ResetCameraClippingRange()
        self.render()
        return self.pixels()

    def render(self, front: bool = True, keep: bool = False) -> None:
        """Draw with the camera's current clipping range; `keep` keeps what was drawn before."""
        self.renderer.InvokeEvent("StartEvent")
        self._pixels = None
        if not keep:
            self._drawn[:] = 0.0
            self._depths = np.ones_like(self._depths)
        else:
            self._depths = self._depths.copy()  # a caller may still hold the depths
        actors = [a for a in _list_props(self.renderer.GetActors()) if a.GetVisibility()]
        translucent = [a for a in actors if _is_translucent(a)]
        for actor in actors:
            if actor not in translucent:
                self._draw_actor(actor, solid=True)
        for actor in translucent:
            self._draw_actor(actor, solid=False)
        if front:
            depths, self._depths = self._depths, np.ones_like(self._depths)
            for prop in self._front:
                if prop.GetVisibility():
                    self._draw_actor(prop, solid=False)
            self._depths = depths

    def pixels(self) -> Bytes:
        """Return red, green, blue and coverage of each pixel, 0 to 255, (height, width, 4)."""
        if self._pixels is None:
            (width, height), grain = self.size, self._grain
            fine = self._drawn.reshape(height, grain, width, grain, 4)
            self._pixels = self._drawn if grain == 1 else fine.mean(axis=(1, 3))
            self._draw_annotations(self._pixels)
        pixels = np.empty(self._pixels.shape, np.uint8)
        for rows in row_strips(len(pixels)):
            pixels[rows] = np.rint(255.0 * np.clip(self._pixels[rows], 0.0, 1.0))
        return pixels

    def depths(self, second: bool = False) -> Singles:
        """Return the depth of each pixel, 0 to 1; 1 where nothing is drawn."""
        return self._depths[:: self._grain, :: self._grain]

    def close(self) -> None:
        """Remove all props from the renderer."""
        self.renderer.RemoveAllViewProps()

    def _draw_actor(self, actor: vtkActor, solid: bool) -> None:
        view = _View.from_renderer(self.renderer, self.size, self._grain)
        opacity = actor.GetProperty().GetOpacity()
        for shape in _shapes(actor, view):
            self._draw_shape(shape, _clip_distances(actor, shape.points), view, opacity, solid)

    def _draw_shape(
        self, shape: _Shape, cut: Floats, view: _View, opacity: float, solid: bool
    ) -> None:
        from spacemap_vtk.draw.software import raster_loops as loops

        screen, normals = shape.screen, shape.normals
        if screen is None:
            screen, normals = (
                view.screen_coordinates(shape.points),
                normals @ view.to_camera[:3, :3].T,
            )
        places = view.camera_coordinates(shape.points)
        tables = normals, shape.strands, shape.looks, shape.colors, shape.cells

        def draw(rows: slice) -> None:
            depth, drawn = self._depths[rows], self._drawn[rows]
            depth = depth if solid else depth.copy()
            which = np.full(depth.shape, -1, np.int32)
            ends = rows.start, rows.stop
            loops.fill(screen, shape.corners, cut, shape.cull, *ends, depth, which)
            covered = which >= 0
            if not covered.any():
                return
            color = np.zeros((*which.shape, 3), np.float32)
            arguments = which, screen, shape.corners, places, *tables, *shape.light
            loops.shade(*arguments, view.parallel, float(view.grain), rows.start, color)
            colors, cover = color[covered], np.full((1, 1), opacity, np.float32)
            if shape.picture is not None and shape.texels is not None:
                texels = _texels(which, rows.start, shape, screen)
                colors = colors * texels[:, :3]
                cover = opacity * texels[:, 3:]
            premultiplied = [cover * colors, np.broadcast_to(cover, (len(colors), 1))]
            drawn[covered] = np.concatenate(premultiplied, axis=1) + drawn[covered] * (1.0 - cover)

        for_each(_bands(len(self._drawn)), lambda: draw)

    def _draw_annotations(self, canvas: Singles) -> None:
        """Draw annotations over the view: panels, text and colour bars."""
        for prop in _list_props(self.renderer.GetViewProps()):
            if not prop.GetVisibility() or not isinstance(prop, vtkActor2D):
                continue
            if isinstance(prop, vtkTextActor):
                position = prop.GetPosition()
                self._draw_text(
                    canvas, prop.GetTextProperty(), prop.GetInput(), position[0], position[1]
                )
            elif isinstance(prop, vtkScalarBarActor):
                self._draw_color_bar(canvas, prop)
            else:
                self._draw_polygons(canvas, prop)

    def _draw_polygons(self, canvas: Singles, actor: vtkActor2D) -> None:
        polygons = actor.GetMapper().GetInput()
        if not polygons.GetNumberOfPolys():
            return
        points, colors = points_of(polygons)[:, :2], polygons.GetCellData().GetScalars()
        plain = [round(255 * part) for part in actor.GetProperty().GetColor()]
        opacity = actor.GetProperty().GetOpacity()
        cells = polygons.GetPolys()
        offsets = vtk_to_numpy(cells.GetOffsetsArray())
        numbers = vtk_to_numpy(cells.GetConnectivityArray())
        for cell in range(len(offsets) - 1):
            ring = points[numbers[offsets[cell] : offsets[cell + 1]]]
            color = plain if colors is None else [int(c) for c in colors.GetTuple3(cell)]
            self._draw_polygon(canvas, ring, color, opacity)

    def _draw_polygon(
        self, canvas: Singles, ring: NDArray[Any], color: list[int], opacity: float
    ) -> None:
        """Draw a polygon whose corners are in pixels, with y upwards from the lowest row."""
        mask = Image.new("L", self.size)
        corners = [(float(x), self.size[1] - float(y)) for x, y in ring]
        ImageDraw.Draw(mask).polygon(corners, fill=255)
        covered = np.asarray(mask) > 0
        paint = np.array([*(opacity * part / 255 for part in color), opacity], np.float32)
        canvas[covered] = paint + canvas[covered] * (1.0 - opacity)

    def _draw_text(
        self, canvas: Singles, properties: vtkTextProperty, text: str, x: float, y: float
    ) -> None:
        """Draw text whose anchor is at (x, y) in pixels."""
        if not text:
            return
        image, ends = vtkImageData(), [0, 0]
        if not vtkTextRenderer.GetInstance().RenderString(properties, text, image, ends, self._dpi):
            return
        (width, height, _), extent = image.GetDimensions(), image.GetExtent()
        letters = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1]
        left, top = round(x) + extent[0], self.size[1] - round(y) - extent[3] - 1
        rows = slice(max(0, top), min(top + height, self.size[1]))
        columns = slice(max(0, left), min(left + width, self.size[0]))
        if rows.start >= rows.stop or columns.start >= columns.stop:
            return  # the text is outside the picture
        part = letters[
            rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
        ]
        part = part.astype(np.float32) / 255.0
        cover = part[..., 3:]
        background = canvas[rows, columns]
        premultiplied = np.concatenate([part[..., :3] * cover, cover], axis=2)
        canvas[rows, columns] = premultiplied + background * (1.0 - cover)

    def _draw_color_bar(self, canvas: Singles, bar: vtkScalarBarActor) -> None:
        """Draw a colour scale: title, strip of colours, and numbers to the right of the strip."""
        width, height = self.size
        table, labels = bar.GetLookupTable(), vtk_to_numpy(bar.GetCustomLabels())
        title, text = bar.GetTitleTextProperty(), bar.GetLabelTextProperty()
        (x, y), letter = bar.GetPosition(), text.GetFontSize() * self._dpi / 72
        left, bar_width = x * width, bar.GetWidth() * width
        low, high = y * height, (y + bar.GetHeight()) * height
        lines = bar.GetTitle().split("\n")
        top = high - letter * len(lines) - bar.GetVerticalTitleSeparation()
        title.SetJustificationToCentered()
        left += 0.1 * bar_width
        right = left + 0.35 * bar_width
        count = table.GetNumberOfTableValues()
        for number in range(count):
            ends = [low + (top - low) * part / count for part in (number, number + 1)]
            color = [round(255 * part) for part in table.GetTableValue(number)[:3]]
            ring = [[left, ends[0]], [right, ends[0]], [right, ends[1]], [left, ends[1]]]
            self._draw_polygon(canvas, np.array(ring), color, 1.0)
        for number, line in enumerate(lines):
            middle = (x + 0.5 * bar.GetWidth()) * width
            self._draw_text(canvas, title, line, middle, high - letter * (number + 0.6))
        least, most = table.GetTableRange()
        for value in labels:
            # The margins keep the first and last number within the height of the strip.
            share = (value - least) / (most - least)
            place = low + 0.15 * letter + (top - low - 0.5 * letter) * share
            label = f"{value:.3g}"
            self._draw_text(canvas, text, label, right + bar.GetTextPad(), place - 0.35 * letter)


class _View(NamedTuple):
    """The matrices of a camera: world to camera coordinates, and world to screen."""

    to_camera: Floats
    to_clip: Floats
    #: Width and height of the picture in samples.
    size: tuple[int, int]
    #: Number of samples along each side of a pixel.
    grain: int
    parallel: bool

    @classmethod
    def from_renderer(cls, renderer: _Renderer, size: tuple[int, int], grain: int) -> _View:
        camera = renderer.GetActiveCamera()
        to_camera = camera.GetViewTransformMatrix()
        to_clip = camera.GetCompositeProjectionTransformMatrix(size[0] / size[1], -1.0, 1.0)
        tables = [
            np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
            for matrix in (to_camera, to_clip)
        ]
        fine = grain * size[0], grain * size[1]
        return cls(tables[0], tables[1], fine, grain, bool(camera.GetParallelProjection()))

    def camera_coordinates(self, points: Floats) -> Floats:
        """Return points in the camera's coordinates."""
        return np.ascontiguousarray(points @ self.to_camera[:3, :3].T + self.to_camera[:3, 3])

    def clip_coordinates(self, points: Floats) -> Floats:
        """Return clip coordinates (n, 4); a point is in the picture if |x|, |y| and |z| <= w."""
        return np.asarray(points @ self.to_clip[:, :3].T + self.to_clip[:, 3])

    def screen_coordinates(self, points: Floats) -> Floats:
        """Return x and y in samples, depth and reciprocal distance of points, (n, 4)."""
        return self.screen_from_clip(self.clip_coordinates(points))

    def screen_from_clip(self, clip: Floats) -> Floats:
        """Return x and y in samples, depth and reciprocal distance from clip coordinates."""
        behind = clip[:, 3] <= 1e-9 * np.abs(clip[:, 3]).max(initial=1e-300)
        reciprocal = 1.0 / np.where(behind, 1.0, clip[:, 3])
        x, y, z = (clip[:, :3] * reciprocal[:, None]).T
        reciprocal[behind] = 0.0
        width, height = self.size
        return np.stack(
            [(x + 1) / 2 * width, (1 - y) / 2 * height, (z + 1) / 2, reciprocal], axis=1
        )


def _bands(height: int) -> list[slice]:
    """Divide the rows of a picture into bands for threads."""
    step = max(16, -(-height // (_BANDS * thread_count())))
    return [slice(top, min(top + step, height)) for top in range(0, height, step)]


def _list_props(props: Any) -> list[Any]:
    props.InitTraversal()
    return [props.GetNextProp() for _ in range(props.GetNumberOfItems())]


def _is_translucent(actor: vtkActor) -> bool:
    if actor.GetForceOpaque():
        return False
    return bool(actor.GetForceTranslucent()) or actor.GetProperty().GetOpacity() < 1.0


def _clip_distances(actor: vtkActor, points: Floats) -> Floats:
    """Return each point's smallest signed distance from the clipping planes; negative: hidden."""
    planes = actor.GetMapper().GetClippingPlanes()
    if planes is None or not planes.GetNumberOfItems():
        return np.zeros(0)
    sides = []
    for number in range(planes.GetNumberOfItems()):
        plane = planes.GetItem(number)
        sides.append((points - plane.GetOrigin()) @ np.array(plane.GetNormal()))
    return np.asarray(np.min(sides, axis=0))


def _shapes(actor: vtkActor, view: _View) -> Iterator[_Shape]:
    """Yield the shapes of an actor."""
    if isinstance(actor, SheetActor):
        graphics.require_opengl("cloths of very many yarns")
    mapper = actor.GetMapper()
    if isinstance(mapper, vtkGlyph3DMapper):
        yield from _glyph_shapes(actor, mapper)
        return
    data = mapper.GetInput()
    if data is None or not data.GetNumberOfPoints():
        return
    wired = actor.GetProperty().GetRepresentation() == VTK_WIREFRAME
    triangulated = _facet_edges(data) if wired else _triangulate(data)
    points = points_of(triangulated).astype(np.float64) + np.array(actor.GetPosition())
    colors, of_cells = _colors(actor, triangulated)
    if triangulated.GetNumberOfPolys():
        if isinstance(actor, OutlineActor):
            yield _outline_shape(actor, triangulated, points, view)
        else:
            yield _surface_shape(actor, triangulated, points, colors, of_cells)
    if triangulated.GetNumberOfLines() or triangulated.GetNumberOfVerts():
        yield from _line_and_dot_shapes(actor, triangulated, points, colors, of_cells, view)


def _triangulate(data: vtkPolyData) -> vtkPolyData:
    """Return a surface whose polygons and strips are cut into triangles; lines and dots stay."""
    if not data.GetNumberOfPolys() and not data.GetNumberOfStrips():
        return data
    filter_ = vtkTriangleFilter()
    filter_.SetInputData(data)
    # The executive's Update keeps Python's global lock: see `Stage.update`.
    filter_.GetExecutive().Update()
    return filter_.GetOutput()


def _facet_edges(data: vtkPolyData) -> vtkPolyData:
    """Return the edges of a surface's facets as lines."""
    edges = vtkExtractEdges()
    edges.SetInputData(data)
    edges.GetExecutive().Update()
    return edges.GetOutput()


def _colors(actor: vtkActor, data: vtkPolyData) -> tuple[Singles, bool]:
    """Return colours, 0 to 1, and whether they belong to cells instead of points."""
    mapper = actor.GetMapper()
    plain = np.array(actor.GetProperty().GetColor(), np.float32)
    if mapper.GetScalarVisibility() and not isinstance(mapper, vtkGlyph3DMapper):
        copy = type(mapper)()
        copy.ShallowCopy(mapper)
        copy.SetInputData(data)
        colors_array = copy.MapScalars(1.0)
        if colors_array is not None:
            of_cells = colors_array.GetNumberOfTuples() != data.GetNumberOfPoints()
            if mapper.GetScalarMode() in (2, 4):
                of_cells = True
            colors = vtk_to_numpy(colors_array)[:, :3] / np.float32(255.0)
            return np.ascontiguousarray(colors, np.float32), of_cells
    return np.broadcast_to(plain, (data.GetNumberOfPoints(), 3)).copy(), False


def _unlit() -> _Light:
    from spacemap_vtk.draw.software.raster_loops import UNLIT

    return _Light(UNLIT, np.zeros((12, 3)), np.zeros(10))


def _plain_light(ambient: float) -> _Light:
    """Return the light of `spacemap_vtk.draw.camera.LIGHTS`, as VTK computes it."""
    from spacemap_vtk.draw.software.raster_loops import PLAIN

    triples, numbers = np.zeros((12, 3)), np.zeros(10)
    numbers[0] = ambient
    for number, (place, strength, color) in enumerate(LIGHTS):
        triples[number] = np.array(place) / np.linalg.norm(place)
        triples[3 + number] = (1.0 - ambient) * strength * np.array(color)
    return _Light(PLAIN, triples, numbers)


def _surface_shape(
    actor: vtkActor, data: vtkPolyData, points: Floats, colors: Singles, of_cells: bool
) -> _Shape:
    from spacemap_vtk.draw.software.raster_loops import STYLED

    corners = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    before = data.GetNumberOfVerts() + data.GetNumberOfLines()
    cells = before + np.arange(len(corners)) if of_cells else _NO_CELLS
    properties, normal_array = actor.GetProperty(), data.GetPointData().GetNormals()
    normals = _NO_NORMALS if normal_array is None else vtk_to_numpy(normal_array).astype(np.float64)
    strands, looks, light = _NO_STRANDS, _NO_LOOKS, _unlit()
    if isinstance(actor, SurfaceActor) and actor.lighting is not None and actor.lighting.has_faces:
        light = _Light(
            STYLED, *lighting_tables(actor.lighting.style, actor.lighting.pixels_per_point)
        )
        if actor.lighting.fibres:
            strands = vtk_to_numpy(data.GetPointData().GetArray(STRANDS))
        if actor.lighting.looks:
            looks = vtk_to_numpy(data.GetPointData().GetArray(LOOK))
    elif properties.GetLighting():
        light = _plain_light(properties.GetAmbient())
    shape = _Shape(
        points,
        np.ascontiguousarray(corners, np.int64),
        colors,
        light,
        cells,
        normals,
        np.ascontiguousarray(strands, np.float32),
        np.ascontiguousarray(looks, np.float32),
        properties.GetBackfaceCulling() + 2 * properties.GetFrontfaceCulling(),
    )
    texture, texels = actor.GetTexture(), data.GetPointData().GetTCoords()
    if texture is None or texels is None:
        return shape
    image = texture.GetInput()
    width, height, _ = image.GetDimensions()
    picture = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)
    return shape._replace(picture=picture, texels=vtk_to_numpy(texels).astype(np.float64))


def _outline_shape(actor: OutlineActor, data: vtkPolyData, points: Floats, view: _View) -> _Shape:
    """Return a surface enlarged as by the vertex shader of `OutlineActor`."""
    from spacemap_vtk.draw.software.raster_loops import FRONT

    corners = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    normals = vtk_to_numpy(data.GetPointData().GetNormals()).astype(np.float64)
    directions = (normals @ view.to_camera[:3, :3].T)[:, :2]
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-6)
    clip, rows = view.clip_coordinates(points), np.linalg.norm(view.to_clip[:, :3], axis=1)
    max_width = actor.max_width * rows[:2]
    clip[:, :2] += directions * np.minimum(np.multiply.outer(clip[:, 3], actor.width), max_width)
    back = clip[:, 2:] + 0.2 * actor.max_width * rows[2:]
    clip = np.concatenate([clip[:, :2] * (back[:, 1:] / clip[:, 3:]), back], axis=1)
    colors = np.broadcast_to(np.array(actor.GetProperty().GetColor(), np.float32), points.shape)
    return _Shape(
        points,
        np.ascontiguousarray(corners, np.int64),
        np.ascontiguousarray(colors),
        _unlit(),
        cull=FRONT,
        screen=view.screen_from_clip(clip),
    )


def _glyph_shapes(actor: vtkActor, mapper: vtkGlyph3DMapper) -> Iterator[_Shape]:
    """Yield an arrow for each vector of a glyph mapper."""
    places, properties = mapper.GetInput(), actor.GetProperty()
    if places is None or not places.GetNumberOfPoints():
        return
    source = mapper.GetInputAlgorithm(1, 0)
    source.Update()
    arrow = _triangulate(source.GetOutput())
    arrow_points = points_of(arrow).astype(np.float64)
    corners = vtk_to_numpy(arrow.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64)
    normal_array = arrow.GetPointData().GetNormals()
    normals = _NO_NORMALS if normal_array is None else vtk_to_numpy(normal_array).astype(np.float64)
    data = places.GetPointData()
    vectors = vtk_to_numpy(data.GetArray("vector")).astype(np.float64)
    colors = vtk_to_numpy(data.GetArray("color"))
    light = _plain_light(properties.GetAmbient()) if properties.GetLighting() else _unlit()
    for start, vector, color in zip(points_of(places), vectors, colors, strict=True):
        length = float(np.linalg.norm(vector))
        if length == 0.0:
            continue
        along, second, third = vector / length, [0.0] * 3, [0.0] * 3
        vtkMath.Perpendiculars(along.tolist(), second, third, 0.0)
        axes = np.array([along, second, third])
        arrow_colors = np.broadcast_to((color[:3] / 255.0).astype(np.float32), arrow_points.shape)
        yield _Shape(
            start + length * arrow_points @ axes,
            corners,
            np.ascontiguousarray(arrow_colors),
            light,
            normals=normals @ axes,
            cull=properties.GetBackfaceCulling(),
        )


def _line_and_dot_shapes(
    actor: vtkActor, data: vtkPolyData, points: Floats, colors: Singles, of_cells: bool, view: _View
) -> Iterator[_Shape]:
    """Yield lines and dots as triangles in screen coordinates, with widths in pixels."""
    properties, screen = actor.GetProperty(), view.screen_coordinates(points)
    verts, lines = (_segments(cells) for cells in (data.GetVerts(), data.GetLines()))
    if len(lines[0]):
        (begin, end), cell = lines[0].T, lines[1] + data.GetNumberOfVerts()
        directions = screen[end, :2] - screen[begin, :2]
        directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
        offset = np.zeros((len(directions), 4))
        offset[:, :2] = (
            0.5
            * view.grain
            * properties.GetLineWidth()
            * np.stack([-directions[:, 1], directions[:, 0]], axis=1)
        )
        ends = [screen[begin] - offset, screen[begin] + offset, screen[end] + offset]
        screen_corners = np.concatenate([*ends, screen[end] - offset])
        four = np.arange(4)[:, None] * len(begin) + np.arange(len(begin))
        # In C order, as of other shapes: the loops would be compiled once more for another order.
        corners = np.ascontiguousarray(np.concatenate([four[[0, 1, 2]].T, four[[0, 2, 3]].T]))
        which = np.concatenate([begin, begin, end, end])
        hue = np.tile(colors[cell], (4, 1)) if of_cells else colors[which]
        yield _Shape(points[which], corners, hue, _unlit(), screen=screen_corners)
    if len(verts[0]):
        dots, cell = verts[0][:, 0], verts[1]
        turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
        disc = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(turn), np.sin(turn)], axis=1)])
        sphere, count = properties.GetRenderPointsAsSpheres(), len(disc)
        radius = 0.5 * view.grain * properties.GetPointSize()
        screen_corners = np.repeat(screen[dots], count, axis=0)
        screen_corners[:, :2] += np.tile(radius * disc * [1.0, -1.0], (len(dots), 1))
        if sphere:
            # The centre is nearer to the camera by the radius. Otherwise a surface through the
            # point would hide half of the sphere.
            scale = np.linalg.norm(view.to_clip[1, :3]) * screen[dots, 3] * view.size[1] / 2
            toward = np.array(view.to_camera[2, :3])
            near = view.screen_coordinates(
                points[dots] + toward * (radius / np.maximum(scale, 1e-12))[:, None]
            )
            screen_corners[::count, 2:] = near[:, 2:]
        first, ring = np.arange(len(dots))[:, None] * count, np.arange(1, count)
        fan = np.stack([np.zeros_like(ring), ring, np.roll(ring, -1)], axis=1)
        corners = (first[:, :, None] + fan).reshape(-1, 3)
        normals = np.concatenate([disc, np.zeros((count, 1))], axis=1)
        normals[0] = (0.0, 0.0, 1.0)
        which = np.repeat(dots, count)
        hue = np.repeat(colors[cell] if of_cells else colors[dots], count, axis=0)
        normals = np.tile(normals, (len(dots), 1))
        light = _plain_light(0.0) if sphere and properties.GetLighting() else _unlit()
        yield _Shape(points[which], corners, hue, light, normals=normals, screen=screen_corners)


def _segments(cells: Any) -> tuple[Ints, Ints]:
    """Return the point pairs of all line segments, (n, 2), and the cell of each segment."""
    # A cell with one point becomes a segment from this point to itself.
    offsets = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    numbers = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    if len(offsets) < 2 or not len(numbers):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    segment_cells = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    if len(numbers) == len(offsets) - 1:
        return np.stack([numbers, numbers], axis=1), segment_cells
    same_cell = segment_cells[1:] == segment_cells[:-1]
    return np.stack([numbers[:-1], numbers[1:]], axis=1)[same_cell], segment_cells[1:][same_cell]


def _texels(which: NDArray[Any], top: int, shape: _Shape, screen: Floats) -> Singles:
    """Return the texture's colour and coverage in each pixel of a shape, (n, 4)."""
    assert shape.picture is not None
    assert shape.texels is not None
    rows, columns = np.nonzero(which >= 0)
    a, b, c = shape.corners[which[rows, columns]].T
    x, y = columns + 0.5 - screen[a, 0], top + rows + 0.5 - screen[a, 1]
    abx, aby = (screen[b, :2] - screen[a, :2]).T
    acx, acy = (screen[c, :2] - screen[a, :2]).T
    scale = 1.0 / (abx * acy - aby * acx)
    wb, wc = (x * acy - y * acx) * scale, (abx * y - aby * x) * scale
    weights = np.stack([1.0 - wb - wc, wb, wc]) * np.stack([screen[k, 3] for k in (a, b, c)])
    weights /= weights.sum(axis=0)
    s, t = np.einsum("kn,knd->dn", weights, np.stack([shape.texels[k, :2] for k in (a, b, c)]))
    return _sample_texture(shape.picture, s, t)


def _sample_texture(picture: Bytes, s: Floats, t: Floats) -> Singles:
    """Sample a repeating texture at coordinates (s, t), bilinearly: RGB and coverage, (n, 4)."""
    height, width, depth = picture.shape
    x, y = s * width - 0.5, t * height - 0.5
    left, low = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    across, up = (x - left)[:, None], (y - low)[:, None]
    samples = np.zeros((len(s), depth))
    for column, row in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = (across if column else 1.0 - across) * (up if row else 1.0 - up)
        samples += share * picture[(low + row) % height, (left + column) % width]
    samples /= 255.0
    if depth < 3:  # a grey image, with or without coverage
        samples = np.concatenate([samples[:, :1]] * 3 + [samples[:, 1:]], axis=1)
    if samples.shape[1] == 3:
        samples = np.concatenate([samples, np.ones((len(samples), 1))], axis=1)
    return samples.astype(np.float32)
