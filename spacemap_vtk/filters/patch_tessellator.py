"""PatchTessellator: Bézier patches to a surface with analytic normals."""

from __future__ import annotations

import math
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

from spacemap_vtk.datasets.arrays import cells_of, points_of, to_array, to_cells, to_points
from spacemap_vtk.datasets.cloth_data import PLACES, cloth_of
from spacemap_vtk.datasets.geometry_cache import Connectivity
from spacemap_vtk.datasets.surface_extract import Skin
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import FAMILIES
from spacemap_vtk.fabric.plies import Strands
from spacemap_vtk.fabric.tessellation import Tessellation
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.memory import require
from spacemap_vtk.parameters import Integer

#: Point array for shading: where fibres run.
STRANDS = "strands"
#: Subdivisions where nobody says how many, and nobody knows how large a patch is seen.
AUTOMATIC_SIDES = 4
#: How far a facet may be from what is round, in pixels, and most of them along a quarter circle.
_CHORD, _MOST_SIDES = 0.3, 12


class PatchTessellator(Stage):
    """Turn Bézier quadrilaterals into polygons with analytic normals; let other cells pass.

    Each patch is evaluated on a regular grid of parameters by matrix products; what depends on
    the connectivity alone is kept while only the control points move.

    Notes
    -----
    Points are not shared between patches: their normals are each patch's own. A whole number that
    is the same at all points of each patch, as that of a yarn in ParaView, is no quantity to
    interpolate, and becomes an array of the polygons as those of cells do. Of a grid of other
    cells comes its surface, with its lines and points; curved cells are subdivided by VTK. A
    surface passes as it is.

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
        automatic="as many as can be seen in a picture; 4 in files and in the window",
    )

    _chosen: int = AUTOMATIC_SIDES
    _strands: bool = False
    _kept: _Patches | None = None
    _skin: Skin | None = None

    @property
    def tessellation(self) -> Tessellation | None:
        """What evaluates the patches of the last update; None where there are none."""
        return None if self._kept is None else self._kept.tessellation

    @property
    def sides(self) -> int:
        """The subdivisions in force."""
        return self.subdivisions or self._chosen

    def choose(self, sides: int, strands: bool = False) -> None:
        """Say how many subdivisions automatic ones are, and what shading needs.

        Parameters
        ----------
        sides : int
            From 1 on.
        strands : bool
            Whether points of yarns get where their fibres run, see
            `spacemap_vtk.fabric.plies.Strands.coordinates`.
        """
        changed = sides != self._chosen and self.subdivisions is None
        if changed or strands != self._strands:
            self.Modified()
        self._chosen, self._strands = sides, strands

    def run(self, inputs: list[vtkPointSet], output: vtkPolyData, time: float) -> None:
        """Evaluate the patches at the present control points."""
        grid = inputs[0]
        if self.piece.of > 1 and grid.GetNumberOfPoints() == 0:
            return  # a process with nothing to do
        if isinstance(grid, vtkPolyData):
            output.ShallowCopy(grid)
            self._drop_ghosts(output)
            return
        if not _only_patches(grid):
            if self._skin is None:
                self._skin = Skin()
            self._skin.extract(grid, self.sides, output)
            self._drop_ghosts(output)
            return
        prepared = self._prepared(grid)
        if prepared.tessellation.has_earned_loops:
            self.report(0.0, "compiling")
            prepared.tessellation.compile()
        given = grid.GetPointData()
        rational = given.GetRationalWeights()
        weights = None if rational is None else vtk_to_numpy(rational)
        positions, normals = prepared.tessellation.evaluate(points_of(grid), weights=weights)
        if (strands := prepared.strands(grid)) is not None:
            if strands.made:
                views = prepared.tessellation.views(positions, normals)
                strands.make(points_of(grid), weights, views)
            if self._strands:
                output.GetPointData().AddArray(prepared.coordinates(strands))
        output.SetPoints(to_points(positions))
        output.SetPolys(prepared.polygons)
        at_points, of_cells = output.GetPointData(), output.GetCellData()
        at_points.SetNormals(to_array(normals, "Normals"))
        for array in _numeric_arrays(given):
            if array is rational:
                continue  # it says how to interpolate, and is nothing on the surface
            if (label := prepared.label(array, grid)) is not None:
                of_cells.AddArray(prepared.cell_array(label))
                continue
            # In float32 as the positions are: twice the bytes would say no more.
            values = prepared.tessellation.interpolate(vtk_to_numpy(array), weights, np.float32)
            at_points.AddArray(to_array(values, array.GetName()))
        for array in _numeric_arrays(grid.GetCellData()):
            of_cells.AddArray(prepared.cell_array(array))
        output.GetFieldData().ShallowCopy(grid.GetFieldData())

    def _drop_ghosts(self, output: vtkPolyData) -> None:
        """Drop what was there to find the outer faces of a piece."""
        if self.piece.of > 1 and self.piece.ghosts == 0:
            output.RemoveGhostCells()
            for data in (output.GetCellData(), output.GetPointData()):
                data.RemoveArray(vtkDataSetAttributes.GhostArrayName())

    def _prepared(self, grid: vtkUnstructuredGrid) -> _Patches:
        if self._kept is None or not self._kept.serves(grid, self.sides):
            self._kept = _Patches(grid, self.sides)
        return self._kept


def sides_seen(pixels: float, plies: int = 1) -> int:
    """Return how many facets a quarter of a yarn of some pixels needs to look round.

    Parameters
    ----------
    pixels : float
        Its diameter.
    plies : int, optional
        That make its outline.

    Returns
    -------
    int
        Subdivisions.
    """
    radius = 0.5 * pixels
    if radius <= _CHORD:
        return 1
    sides = max(1, min(_MOST_SIDES, math.ceil(math.pi / 4 / math.acos(1.0 - _CHORD / radius))))
    if plies > 1:  # the outline is as many times as curved
        sides = min(_MOST_SIDES, max(2 * plies, math.ceil(1.5 * sides)))
    return sides


def polygons_of(data: vtkDataSet) -> vtkPolyData:
    """Return the surface of any object, curved patches in few polygons.

    Parameters
    ----------
    data : vtkDataSet
        Points, lines, polygons, patches, a grid or an image.

    Returns
    -------
    vtkPolyData
        `data` itself where it is one.
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


def estimate_bytes(patches: int, subdivisions: int, columns: int = 0) -> int:
    """Return the memory that the surface of some patches takes.

    Parameters
    ----------
    patches : int
        How many.
    subdivisions : int
        Of each, along both sides.
    columns : int, optional
        Components of the point arrays that are carried over.

    Returns
    -------
    int
        Bytes.
    """
    samples, polygons = patches * (subdivisions + 1) ** 2, patches * subdivisions**2
    # Positions, normals and what is carried over in float32; four point numbers, an offset, yarn,
    # family and colour of each polygon; of each patch where its control points are, what it is
    # labelled with, and where fibres would run.
    number = 8 if 4 * polygons >= 2**31 else 4
    return samples * 4 * (6 + columns) + polygons * (5 * number + 11) + patches * 180


class _Patches:
    """What depends on connectivity and subdivisions alone."""

    def __init__(self, grid: vtkUnstructuredGrid, subdivisions: int) -> None:
        patches = cells_of(grid, VTK_BEZIER_QUADRILATERAL, "Bézier quadrilaterals")
        order = math.isqrt(patches.shape[1])
        if order**2 != patches.shape[1]:
            raise GeometryError(
                f"Bézier quadrilaterals of {patches.shape[1]} points have no equal degrees",
                allowed="as many control points along both parameters",
            )
        columns = sum(a.GetNumberOfComponents() for a in _numeric_arrays(grid.GetPointData()))
        require(
            estimate_bytes(len(patches), subdivisions, columns),
            "this surface",
            key="subdivisions",
            value=subdivisions,
            cure="Use fewer subdivisions, or fewer yarns.",
        )
        self.subdivisions = subdivisions
        self.cells = Connectivity(grid)
        self.tessellation = Tessellation(patches, (order - 1, order - 1), subdivisions)
        self.polygons: vtkCellArray = to_cells(self.tessellation.quads)
        self.patches = patches
        self.told: list[bytes | None] = []
        self.placed: tuple[vtkDataArray, int] | None = None
        self.woven: Strands | None = None
        self.ways: vtkDataArray | None = None
        self.arrays: dict[str, tuple[vtkDataArray, int, vtkDataArray]] = {}
        self.labels: dict[str, tuple[vtkDataArray, int, vtkDataArray | None]] = {}

    def serves(self, grid: vtkUnstructuredGrid, subdivisions: int) -> bool:
        return self.subdivisions == subdivisions and self.cells.matches(grid)

    def strands(self, grid: vtkUnstructuredGrid) -> Strands | None:
        """Return where fibres and plies run on a whole weave; None on anything else."""
        places = grid.GetFieldData().GetArray(PLACES)
        # what decides is written together: the same array is of the same weave
        if places is not None and self.placed is not None:
            array, time = self.placed
            if places is array and places.GetMTime() == time:
                return self.woven
        self.placed = None if places is None else (places, places.GetMTime())
        told = _told(grid)
        if told != self.told:
            self.told, self.woven, self.ways = told, None, None
            cloth = cloth_of(grid) if told[0] is not None and self.patches.shape[1] == 16 else None
            if cloth is not None:
                # not of some patches of a weave
                with suppress(GeometryError):
                    places = vtk_to_numpy(places)
                    self.woven = Strands(self.patches, cloth, places, self.subdivisions)
        return self.woven

    def coordinates(self, strands: Strands) -> vtkDataArray:
        """Return where fibres run, as long as the yarns are the same one array."""
        if self.ways is None:
            ways = np.empty((self.tessellation.point_count, 3), np.float32)
            for which, view in self.tessellation.views(ways):
                view[:] = strands.coordinates(which)
            self.ways = to_array(ways, STRANDS)
        return self.ways

    def label(self, array: vtkDataArray, grid: vtkUnstructuredGrid) -> vtkDataArray | None:
        """Return an array of points as one of patches, where it is a whole number of theirs."""
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
        # The same object for the same values, so that a picture need not take them over again.
        if kept is not None and kept[0].GetMTime() == kept[1] and _equal(kept[0], array):
            made = kept[2]
        else:
            made = to_array(np.repeat(vtk_to_numpy(array), self.subdivisions**2, axis=0), name)
        self.arrays[name] = array, array.GetMTime(), made
        return made


def _told(grid: vtkUnstructuredGrid) -> list[bytes | None]:
    """Return what decides where fibres and plies run."""
    field = grid.GetFieldData()
    seen = (f"cloth_{family}_{key}" for family in FAMILIES for key in ("twist", "plies"))
    arrays = (field.GetArray(name) for name in (PLACES, *seen))
    return [None if array is None else vtk_to_numpy(array).tobytes() for array in arrays]


def _equal(first: vtkDataArray, second: vtkDataArray) -> bool:
    if first is second:
        return True
    a, b = vtk_to_numpy(first), vtk_to_numpy(second)
    return a.dtype == b.dtype and np.array_equal(a, b)


def _only_patches(grid: vtkPointSet) -> bool:
    if not isinstance(grid, vtkUnstructuredGrid) or not grid.GetNumberOfCells():
        return False
    return grid.GetCellType(0) == VTK_BEZIER_QUADRILATERAL and bool(grid.IsHomogeneous())


def _numeric_arrays(data: vtkFieldData) -> list[vtkDataArray]:
    arrays = (data.GetArray(i) for i in range(data.GetNumberOfArrays()))
    return [array for array in arrays if array is not None and array.GetName()]
