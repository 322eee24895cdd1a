"""PatchTessellator: turn Bézier patches into a surface with analytic normals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import (
    VTK_BEZIER_QUADRILATERAL,
    vtkCellArray,
    vtkDataSet,
    vtkDataSetAttributes,
    vtkFieldData,
    vtkPointSet,
    vtkPolyData,
    vtkUnstructuredGrid,
)
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

from spacemap_vtk.datasets.arrays import (
    cells_of,
    points_of,
    shallow_copy,
    to_array,
    to_cells,
    to_points,
)
from spacemap_vtk.datasets.cloth_data import PLACES, cloth_of
from spacemap_vtk.datasets.geometry_snapshot import ConnectivitySnapshot
from spacemap_vtk.datasets.surface_extract import SurfaceExtractor
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Bytes, Ints
from spacemap_vtk.parameters import Integer
from spacemap_vtk.textile.geometry.exposure import ClothExposure
from spacemap_vtk.textile.geometry.irregularity import Irregularity
from spacemap_vtk.textile.geometry.plies import Strands
from spacemap_vtk.textile.patches import bezier
from spacemap_vtk.textile.patches.tessellation import Tessellation
from spacemap_vtk.textile.weave.cloth import Cloth

#: Point array for shading: the direction of the fibres.
STRANDS = "strands"
#: Point array for shading: exposure to light from all sides, and relative brightness of the yarn.
LOOK = "look"
#: Subdivisions if none are given and the size of a patch on the screen is unknown.
AUTOMATIC_SIDES = 4
#: Function that computes each patch's subdivisions from control points and patches; see
#: `PatchTessellator.set_detail`.
Detail = Callable[[AnyFloats, AnyInts], AnyInts]
#: Largest distance between the edge of a facet and the round surface [pixels]. That of the middle
#: of the facet can be a third larger, because yarns bend too.
_CHORD = 0.19
#: Most subdivisions of a surface with the same number everywhere. In close-ups only the visible
#: part gets more.
MOST_SIDES = 12
#: Bytes of yarn, family and colour of a polygon.
LABEL_BYTES = 4 + 4 + 3


class PatchTessellator(Stage):
    """Turn Bézier quadrilaterals into polygons with analytic normals; other cells pass unchanged.

    Each patch is evaluated on a regular grid of parameters. Data that depend only on the
    connectivity are kept while the control points move.

    Notes
    -----
    Patches share no points, so each has its own normals. A point array with one whole number for
    each patch, such as the number of a yarn in ParaView, becomes a cell array of the polygons
    instead of being interpolated. From a grid of other cells the outer surface, lines and points
    are extracted; VTK subdivides curved cells. A surface passes unchanged.

    Examples
    --------
    >>> from spacemap_vtk import PatchTessellator, WeaveSource
    >>> weave, surface = WeaveSource(ends=1, picks=1), PatchTessellator(subdivisions=2)
    >>> surface.SetInputConnection(weave.GetOutputPort())
    >>> polygons = surface.update().output.GetNumberOfCells()
    >>> polygons == 4 * weave.output.GetNumberOfCells()
    True
    """

    section = "surface"
    role = "surface"
    inputs = ("vtkPointSet",)
    takes = ("object",)
    output_type = "vtkPolyData"

    subdivisions = Integer(
        None,
        "Number of quadrilaterals along each side of a patch.",
        minimum=1,
        maximum=64,
        automatic="as many as are visible in pictures and in the window; 4 in files",
    )

    _chosen: int = AUTOMATIC_SIDES
    _strands: bool = False
    _detail: Detail | None = None
    _look: Irregularity | None = None
    _kept: _PreparedPatches | None = None
    _skin: SurfaceExtractor | None = None
    #: Exposure of the last cloth, and the data that determine it: the pieces of a cloth share it.
    _exposure: tuple[list[bytes | None], ClothExposure] | None = None

    @property
    def tessellation(self) -> Tessellation | None:
        """Evaluator of the last update's patches; None if their subdivisions differ."""
        if self._kept is None or len(self._kept.groups) != 1:
            return None
        return self._kept.groups[0].tessellation

    @property
    def sides(self) -> int:
        """The subdivisions that are used."""
        return self.subdivisions or self._chosen

    @property
    def detail(self) -> tuple[int, bool, Detail | None, Irregularity | None]:
        """Arguments with which `set_detail` gives the same facets."""
        return self._chosen, self._strands, self._detail, self._look

    def set_detail(
        self,
        sides: int,
        strands: bool = False,
        detail: Detail | None = None,
        look: Irregularity | None = None,
    ) -> None:
        """Set the number of automatic subdivisions, and the data for shading.

        Parameters
        ----------
        sides : int
            At least 1.
        strands : bool
            Whether points of yarns get the direction of their fibres, see
            `spacemap_vtk.textile.geometry.plies.Strands.coordinates`.
        detail : callable, optional
            Computes the subdivisions of each patch, (P,), from the control points and the patches,
            (P, k), and replaces `sides`. Of two different results one must divide the other.
        look : Irregularity, optional
            For pictures: makes woven yarns irregular, and adds the array `LOOK`. By default the
            surface is that of the patches, as for measurements.
        """
        changed = (sides, detail) != (self._chosen, self._detail) and self.subdivisions is None
        if changed or (strands, look) != (self._strands, self._look):
            self.Modified()
        self._chosen, self._strands, self._detail, self._look = sides, strands, detail, look

    def run(self, inputs: list[vtkPointSet], output: vtkPolyData, time: float) -> None:
        """Evaluate the patches at the present control points."""
        grid = inputs[0]
        if self.piece.total > 1 and grid.GetNumberOfPoints() == 0:
            return  # this process has no points
        if isinstance(grid, vtkPolyData):
            output.ShallowCopy(grid)
            self._drop_ghosts(output)
            return
        if not _has_only_patches(grid):
            if self._skin is None:
                self._skin = SurfaceExtractor()
            self._skin.extract(grid, self.sides, output)
            self._drop_ghosts(output)
            return
        prepared = self._prepare(grid)
        if any(group.tessellation.is_worth_compiling for group in prepared.groups):
            self.report_progress(0.0, "compiling")
            for group in prepared.groups:
                group.tessellation.compile()
        given = grid.GetPointData()
        rational = given.GetRationalWeights()
        weights = None if rational is None else vtk_to_numpy(rational)
        strands = prepared.strands(grid)
        points = points_of(grid)
        if strands is not None and self._look is not None and self._look.amount > 0.0:
            points = strands.make_irregular(points, self._look)
        surfaces = [group.evaluate(points, weights, strands) for group in prepared.groups]
        positions, normals = map(_concatenate, zip(*surfaces, strict=True))
        prepared.close_seams(positions)
        if strands is not None and self._strands:
            output.GetPointData().AddArray(prepared.coordinates(strands))
        output.SetPoints(to_points(positions))
        output.SetPolys(prepared.polygons)
        at_points, of_cells = output.GetPointData(), output.GetCellData()
        at_points.SetNormals(to_array(normals, "Normals"))
        for array in _numeric_arrays(given):
            if array is rational:
                continue  # weights are for interpolation; the surface does not need them
            if (label := prepared.label(array, grid)) is not None:
                of_cells.AddArray(prepared.cell_array(label))
                continue
            # In float32 like the positions: double precision would take twice the bytes for
            # nothing.
            numbers = vtk_to_numpy(array)
            values = _concatenate(
                [
                    group.tessellation.interpolate(numbers, weights, np.float32)
                    for group in prepared.groups
                ]
            )
            at_points.AddArray(to_array(values, array.GetName()))
        for array in _numeric_arrays(grid.GetCellData()):
            of_cells.AddArray(prepared.cell_array(array))
        if strands is not None and self._look is not None:
            moved = at_points.GetArray("displacement")
            rest = positions if moved is None else positions - vtk_to_numpy(moved)
            look = prepared.look(strands, rest, self._find_exposure(prepared), self._look)
            at_points.AddArray(to_array(look, LOOK))
        output.GetFieldData().ShallowCopy(grid.GetFieldData())

    def irregular(self, grid: vtkUnstructuredGrid, look: Irregularity) -> vtkUnstructuredGrid:
        """Return the patches of a weave with irregular yarns, whose surface is that of `look`.

        Parameters
        ----------
        grid : vtkUnstructuredGrid
            Patches of a weave, wherever they have been moved.
        look : Irregularity
            Amount and seed.

        Returns
        -------
        vtkUnstructuredGrid
            Without the array `PLACES`, so that no picture makes the yarns irregular again.

        Raises
        ------
        GeometryError
            If these are not the patches of a weave.
        """
        prepared = self._prepare(grid)
        strands = prepared.strands(grid)
        if strands is None:
            raise GeometryError("only the patches of a weave can be irregular")
        moved = shallow_copy(grid)
        moved.SetPoints(to_points(strands.make_irregular(points_of(grid), look)))
        bright = np.empty((len(prepared.patches), 1))
        for group in prepared.groups:
            samples = group.strands(strands).relative_brightness(group.numbers, look)
            bright[group.numbers, 0] = samples.mean(axis=0)
        _brighten_cells(moved.GetCellData(), bright)
        moved.GetFieldData().RemoveArray(PLACES)
        return moved

    def _drop_ghosts(self, output: vtkPolyData) -> None:
        """Remove the ghosts, which were needed only to find the outer faces of a piece."""
        if self.piece.total > 1 and self.piece.ghosts == 0:
            output.RemoveGhostCells()
            for data in (output.GetCellData(), output.GetPointData()):
                data.RemoveArray(vtkDataSetAttributes.GhostArrayName())

    def _find_exposure(self, prepared: _PreparedPatches) -> ClothExposure:
        key = prepared.strand_inputs[1:]
        if self._exposure is None or self._exposure[0] != key:
            assert prepared.cloth is not None
            self._exposure = key, ClothExposure(prepared.cloth)
        return self._exposure[1]

    def _prepare(self, grid: vtkUnstructuredGrid) -> _PreparedPatches:
        sides: int | AnyInts = self.sides
        if self._detail is not None and self.subdivisions is None:
            patches = cells_of(grid, VTK_BEZIER_QUADRILATERAL, "Bézier quadrilaterals")
            each = self._detail(points_of(grid), patches)
            sides = int(each[0]) if len(each) and (each == each[0]).all() else each
        if self._kept is None or not self._kept.is_valid_for(grid, sides):
            self._kept = _PreparedPatches(grid, sides)
        return self._kept


def bake_brightness(surface: vtkPolyData) -> vtkPolyData:
    """Multiply the colours of irregular yarns by their brightness.

    Parameters
    ----------
    surface : vtkPolyData
        Facets with the cell array ``color``.

    Returns
    -------
    vtkPolyData
        Without the point array `LOOK`; `surface` itself if it has none.
    """
    bright = point_brightness(surface)
    if bright is None:
        return surface
    baked = shallow_copy(surface)
    corners = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    _brighten_cells(baked.GetCellData(), bright[corners].mean(axis=1, keepdims=True))
    baked.GetPointData().RemoveArray(LOOK)
    return baked


def point_brightness(surface: vtkPolyData) -> AnyFloats | None:
    """Return the relative brightness of irregular yarns at the points of a surface.

    Parameters
    ----------
    surface : vtkPolyData
        Facets of patches.

    Returns
    -------
    ndarray of float32, shape (N,), or None
        About 1; None if the yarns are regular.
    """
    look = surface.GetPointData().GetArray(LOOK)
    return None if look is None else vtk_to_numpy(look)[:, 1]


def brighten(colors: Bytes, bright: AnyFloats) -> Bytes:
    """Multiply colours by a relative brightness.

    Parameters
    ----------
    colors : ndarray of uint8, shape (n, 3)
        Red, green and blue.
    bright : ndarray of float, shape (n, 1)
        About 1.

    Returns
    -------
    ndarray of uint8, shape (n, 3)
        At most 255.
    """
    return np.rint(np.clip(colors * bright, 0.0, 255.0)).astype(np.uint8)


def _brighten_cells(data: vtkFieldData, bright: AnyFloats) -> None:
    """Multiply the colours of cells by a relative brightness, (cells, 1)."""
    colors = data.GetArray("color")
    if colors is not None:
        data.AddArray(to_array(brighten(vtk_to_numpy(colors), bright), "color"))


def _concatenate(parts: Sequence[AnyFloats]) -> AnyFloats:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def sides_for_pixels(pixels: float, plies: int = 1) -> int:
    """Return how many facets a quarter of a yarn's outline needs to look round.

    Parameters
    ----------
    pixels : float
        Diameter of the yarn in pixels.
    plies : int, optional
        Number of plies that form its outline.

    Returns
    -------
    int
        Number of subdivisions.
    """
    radius = 0.5 * pixels
    if radius <= _CHORD:
        return 1
    sides = max(1, min(MOST_SIDES, math.ceil(math.pi / 4 / math.acos(1.0 - _CHORD / radius))))
    if plies > 1:  # the curvature of the outline grows with the number of plies
        sides = min(MOST_SIDES, max(2 * plies, math.ceil(1.5 * sides)))
    return sides


def polygons_of(data: vtkDataSet) -> vtkPolyData:
    """Return the surface of any object; curved patches become few polygons.

    Parameters
    ----------
    data : vtkDataSet
        Points, lines, polygons, patches, a grid or an image.

    Returns
    -------
    vtkPolyData
        `data` itself if it is vtkPolyData.
    """
    if isinstance(data, vtkPolyData):
        return data
    if data.GetNumberOfCells() == 0:
        return vtkPolyData()
    if data.IsA("vtkPointSet"):
        stage = PatchTessellator(subdivisions=2)
        stage.SetInputDataObject(data)
        stage.update()
        return stage.GetOutputDataObject(0)
    maker = vtkDataSetSurfaceFilter()
    maker.SetInputData(data)
    maker.Update()
    return maker.GetOutput()


def estimate_bytes(
    patches: int, subdivisions: int, columns: int = 0, labels: int = LABEL_BYTES
) -> int:
    """Estimate the memory for the surface of patches.

    Parameters
    ----------
    patches : int
        Number of patches.
    subdivisions : int
        Subdivisions along each side of a patch.
    columns : int, optional
        Components of the point arrays that are interpolated.
    labels : int, optional
        Bytes of the cell arrays for each polygon.

    Returns
    -------
    int
        Bytes.
    """
    samples, polygons = patches * (subdivisions + 1) ** 2, patches * subdivisions**2
    # Positions, normals and interpolated arrays in float32. For each polygon four point numbers, an
    # offset and labels. For each patch its control points, its labels and the direction of its
    # fibres.
    number = 8 if 4 * polygons >= 2**31 else 4
    return samples * 4 * (6 + columns) + polygons * (5 * number + labels) + patches * 180


class _Group:
    """Patches with the same number of subdivisions."""

    def __init__(self, patches: AnyInts, numbers: Ints, sides: int) -> None:
        order = math.isqrt(patches.shape[1])
        self.numbers, self.sides = numbers, sides
        self.tessellation = Tessellation(patches[numbers], (order - 1, order - 1), sides)
        self._strands: tuple[Strands, Strands] | None = None

    def strands(self, whole: Strands) -> Strands:
        """Return the strands of all patches, sampled at these patches' points."""
        if self._strands is None or self._strands[0] is not whole:
            self._strands = whole, whole.with_sides(self.sides)
        return self._strands[1]

    def evaluate(
        self, points: AnyFloats, weights: AnyFloats | None, whole: Strands | None
    ) -> tuple[AnyFloats, AnyFloats]:
        """Return positions and normals, shaped into plies."""
        surface = self.tessellation.evaluate(points, weights=weights)
        if whole is not None and whole.can_shape_plies(self.sides):
            views = self.tessellation.views(*surface)
            self.strands(whole).shape_plies(
                points, weights, ((self.numbers[which], *parts) for which, *parts in views)
            )
        return surface

    def coordinates(self, whole: Strands) -> AnyFloats:
        """Return the direction of the fibres at the points of these patches."""
        ways = np.empty((self.tessellation.point_count, 3), np.float32)
        for which, view in self.tessellation.views(ways):
            view[:] = self.strands(whole).coordinates(self.numbers[which])
        return ways

    def face_and_brightness(
        self, whole: Strands, irregularity: Irregularity
    ) -> tuple[AnyFloats, AnyFloats]:
        """Return the face and the relative brightness of irregular yarns at these points."""
        face, bright = np.empty((2, self.tessellation.point_count, 1), np.float32)
        strands = self.strands(whole)
        for which, *views in self.tessellation.views(face, bright):
            numbers = self.numbers[which]
            views[0][..., 0] = strands.face(numbers)
            views[1][..., 0] = strands.relative_brightness(numbers, irregularity)
        return face[:, 0], bright[:, 0]


class _PreparedPatches:
    """Results that depend only on connectivity and subdivisions."""

    def __init__(self, grid: vtkUnstructuredGrid, subdivisions: int | AnyInts) -> None:
        patches = cells_of(grid, VTK_BEZIER_QUADRILATERAL, "Bézier quadrilaterals")
        order = math.isqrt(patches.shape[1])
        if order**2 != patches.shape[1]:
            raise GeometryError(
                f"Bézier quadrilaterals of {patches.shape[1]} points have no equal degrees",
                allowed="as many control points along both parameters",
            )
        columns = sum(a.GetNumberOfComponents() for a in _numeric_arrays(grid.GetPointData()))
        labels = sum(
            a.GetNumberOfComponents() * a.GetDataTypeSize()
            for a in _numeric_arrays(grid.GetCellData())
        )
        sides, counts = np.unique(np.broadcast_to(subdivisions, len(patches)), return_counts=True)
        need = sum(
            estimate_bytes(int(count), int(each), columns, labels)
            for each, count in zip(sides, counts, strict=True)
        )
        require_memory(
            need,
            "this surface",
            key="subdivisions",
            value=int(sides.max(initial=1)),
            cure="Use fewer subdivisions, or fewer yarns.",
        )
        #: One number for each patch, or one for all.
        self.subdivisions = subdivisions
        self.cells = ConnectivitySnapshot(grid)
        if isinstance(subdivisions, int):
            self.groups = [_Group(patches, np.arange(len(patches)), subdivisions)]
        else:
            numbers = [np.flatnonzero(subdivisions == each) for each in sides]
            self.groups = [
                _Group(patches, some, int(each)) for some, each in zip(numbers, sides, strict=True)
            ]
        self.polygons: vtkCellArray = to_cells(self._quads())
        self.patches = patches
        self._seams = _find_seams(patches, self.groups) if len(self.groups) > 1 else []
        self.strand_inputs: list[bytes | None] = []
        self.places_state: tuple[vtkDataArray, int] | None = None
        self.cloth: Cloth | None = None
        self.cloth_strands: Strands | None = None
        self.fibre_directions: vtkDataArray | None = None
        #: Irregularity of the last result of `look`, and the arrays that it has at any time.
        self.irregular: tuple[Irregularity, AnyFloats, AnyFloats, AnyFloats] | None = None
        self.arrays: dict[str, tuple[vtkDataArray, int, vtkDataArray]] = {}
        self.labels: dict[str, tuple[vtkDataArray, int, vtkDataArray | None]] = {}

    def _quads(self) -> AnyInts:
        """Return the point numbers of each facet, group by group."""
        if len(self.groups) == 1:
            return self.groups[0].tessellation.quads
        parts, first = [], 0
        for group in self.groups:
            parts.append(group.tessellation.quads + first)
            first += group.tessellation.point_count
        return np.concatenate(parts)

    def close_seams(self, positions: AnyFloats) -> None:
        """Move edges with many facets onto the coarser edges of neighbours, to close gaps."""
        for fine, before, after, share in self._seams:
            positions[fine] = (1.0 - share) * positions[before] + share * positions[after]

    def is_valid_for(self, grid: vtkUnstructuredGrid, subdivisions: int | AnyInts) -> bool:
        return np.array_equal(self.subdivisions, subdivisions) and self.cells.matches(grid)

    def strands(self, grid: vtkUnstructuredGrid) -> Strands | None:
        """Return the strands of fibres and plies of a whole weave; None for anything else."""
        places = grid.GetFieldData().GetArray(PLACES)
        # These arrays are always written together: the same array belongs to the same weave.
        if places is not None and self.places_state is not None:
            array, time = self.places_state
            if places is array and places.GetMTime() == time:
                return self.cloth_strands
        self.places_state = None if places is None else (places, places.GetMTime())
        inputs = _strand_inputs(grid)
        if inputs != self.strand_inputs:
            self.strand_inputs, self.cloth_strands, self.fibre_directions = inputs, None, None
            self.irregular, self.cloth = None, None
            cloth = (
                cloth_of(grid) if inputs[0] is not None and self.patches.shape[1] == 16 else None
            )
            if cloth is not None:
                # Not possible for a part of a weave's patches.
                with suppress(GeometryError):
                    places, self.cloth = vtk_to_numpy(places), cloth
                    self.cloth_strands = Strands(self.patches, cloth, places, self.groups[0].sides)
        return self.cloth_strands

    def coordinates(self, strands: Strands) -> vtkDataArray:
        """Return the direction of the fibres: the same array as long as the yarns are the same."""
        if self.fibre_directions is None:
            self.fibre_directions = to_array(
                _concatenate([g.coordinates(strands) for g in self.groups]), STRANDS
            )
        return self.fibre_directions

    def look(
        self,
        strands: Strands,
        rest: AnyFloats,
        exposure: ClothExposure,
        irregularity: Irregularity,
    ) -> AnyFloats:
        """Return exposure and relative brightness of points that are given at rest, (N, 2)."""
        if self.irregular is None or self.irregular[0] != irregularity:
            parts = [group.face_and_brightness(strands, irregularity) for group in self.groups]
            face, bright = map(_concatenate, zip(*parts, strict=True))
            sides = [np.full(g.tessellation.point_count, 1.0 / g.sides) for g in self.groups]
            self.irregular = irregularity, face, bright, _concatenate(sides)
        _, face, bright, facet = self.irregular
        return np.stack([exposure.evaluate(rest, face, facet), bright], axis=1)

    def label(self, array: vtkDataArray, grid: vtkUnstructuredGrid) -> vtkDataArray | None:
        """Return a point array as a cell array, if it has one integer for each patch."""
        name = array.GetName()
        values = vtk_to_numpy(array)
        if values.dtype.kind not in "iu" or grid.GetCellData().HasArray(name):
            return None
        kept = self.labels.get(name)
        if kept is None or kept[0] is not array or kept[1] != array.GetMTime():
            own = values[self.patches[:, 0]]
            whole = bool((values[self.patches] == own[:, np.newaxis]).all())
            kept = array, array.GetMTime(), to_array(own, name) if whole else None
            self.labels[name] = kept
        return kept[2]

    def cell_array(self, array: vtkDataArray) -> vtkDataArray:
        name = array.GetName()
        kept = self.arrays.get(name)
        # Return the same object for the same values, so that renderers need not upload them again.
        if (
            kept is not None
            and kept[0].GetMTime() == kept[1]
            and _have_equal_values(kept[0], array)
        ):
            made = kept[2]
        else:
            values = vtk_to_numpy(array)
            parts = [np.repeat(values[g.numbers], g.sides**2, axis=0) for g in self.groups]
            made = to_array(_concatenate(parts), name)
        self.arrays[name] = array, array.GetMTime(), made
        return made


#: Points along edges; for each the points of a coarser edge before and after it; and its position
#: between these as a share, (n, 1).
_Seam = tuple[AnyInts, AnyInts, AnyInts, AnyFloats]


def _find_seams(patches: AnyInts, groups: Sequence[_Group]) -> list[_Seam]:
    """Return the seams where edges with more facets meet edges with fewer."""
    degree = math.isqrt(patches.shape[1]) - 1
    order = bezier.quadrilateral_order(degree, degree)
    count, first = int(patches.max()) + 1, 0
    keys, owners, edges = [], [], []
    for number, group in enumerate(groups):
        n = group.sides
        net = patches[group.numbers][:, order].reshape(-1, degree + 1, degree + 1)
        numbers = np.arange(group.tessellation.point_count, dtype=np.float64)[:, None]
        views = [ids[..., 0].T for _, ids in group.tessellation.views(numbers)]
        samples = np.concatenate(views).astype(np.int64).reshape(-1, n + 1, n + 1)
        for side in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1]):
            ends, along = net[side].astype(np.int64)[:, [0, -1]], samples[side] + first
            turned = ends[:, 0] > ends[:, 1]
            along = np.where(turned[:, None], along[:, ::-1], along)
            # An edge that is collapsed to a point has no seam.
            keys.append(
                np.where(ends[:, 0] == ends[:, 1], -1, ends.min(axis=1) * count + ends.max(axis=1))
            )
            owners.append(np.full(len(along), number))
            edges.append(along)
        first += group.tessellation.point_count
    key, owner = np.concatenate(keys), np.concatenate(owners)
    place = np.concatenate([np.arange(len(each)) for each in edges])
    block = np.repeat(np.arange(len(edges)), [len(each) for each in edges])
    rows = np.lexsort((owner, key))
    rows = rows[key[rows] >= 0]
    begun = np.flatnonzero(np.diff(key[rows], prepend=-1))
    coarsest = rows[np.repeat(begun, np.diff(begun, append=len(rows)))]
    apart = owner[rows] > owner[coarsest]
    fine, coarse = rows[apart], coarsest[apart]
    seams = []
    for one, other in np.unique(np.stack([block[fine], block[coarse]]), axis=1).T:
        which = (block[fine] == one) & (block[coarse] == other)
        many, few = edges[one][place[fine[which]]], edges[other][place[coarse[which]]]
        step = np.arange(many.shape[1]) * (few.shape[1] - 1) / (many.shape[1] - 1)
        left = np.minimum(step.astype(int), few.shape[1] - 2)
        share = np.broadcast_to((step - left).astype(np.float32), many.shape)
        parts = many, few[:, left], few[:, left + 1]
        seams.append((*(part.ravel() for part in parts), share.reshape(-1, 1)))
    return seams


def _strand_inputs(grid: vtkUnstructuredGrid) -> list[bytes | None]:
    """Return the places of yarns, and the data of their cloth, which determine their look."""
    field = grid.GetFieldData()
    names = (field.GetArrayName(number) for number in range(field.GetNumberOfArrays()))
    cloth = sorted(name for name in names if name and name.startswith("cloth_"))
    arrays = (field.GetArray(name) for name in (PLACES, *cloth))
    return [None if array is None else vtk_to_numpy(array).tobytes() for array in arrays]


def _have_equal_values(first: vtkDataArray, second: vtkDataArray) -> bool:
    if first is second:
        return True
    a, b = vtk_to_numpy(first), vtk_to_numpy(second)
    return a.dtype == b.dtype and np.array_equal(a, b)


def _has_only_patches(grid: vtkPointSet) -> bool:
    if not isinstance(grid, vtkUnstructuredGrid) or not grid.GetNumberOfCells():
        return False
    return grid.GetCellType(0) == VTK_BEZIER_QUADRILATERAL and bool(grid.IsHomogeneous())


def _numeric_arrays(data: vtkFieldData) -> list[vtkDataArray]:
    arrays = (data.GetArray(i) for i in range(data.GetNumberOfArrays()))
    return [array for array in arrays if array is not None and array.GetName()]
