"""BarycentricWarp: move the points of an object with a cage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

from spacemap_vtk import extensions
from spacemap_vtk.cage.split import repair_tetrahedra
from spacemap_vtk.cage.split_quadratic import TETRAHEDRON, split_quadratic
from spacemap_vtk.datasets.arrays import (
    add_array,
    array_of,
    elements_of,
    points_of,
    to_array,
    to_points,
)
from spacemap_vtk.datasets.cloth_data import FOOT, OFFSET
from spacemap_vtk.datasets.geometry_snapshot import GeometrySnapshot
from spacemap_vtk.embedding.affine import AffineInterpolation
from spacemap_vtk.embedding.gradients import (
    QuadraticGradients,
    cofactors,
    deform_normals,
    vertex_averages,
)
from spacemap_vtk.embedding.interpolation import EmbeddedPoints, Interpolation
from spacemap_vtk.embedding.locate import Location, locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.algorithm import SAME_AS_INPUT
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.shape_limits import check_yarns
from spacemap_vtk.memory import ArrayPool, require_memory
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints
from spacemap_vtk.parallel import MANY_POINTS, blocks, for_each
from spacemap_vtk.parameters import Choice, Flag, Text
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


#: Rings per block when offsets are added; the points of a block stay in the cache.
_BLOCK = 2**10


class BarycentricWarp(Stage):
    """Move the points of an object with the cage around them.

    Port 0 is the object, port 1 the cage: a tetrahedral mesh with a displacement. Each point keeps
    its barycentric weights in the tetrahedron that contains it, or the weights of all ten nodes of
    a quadratic tetrahedron. The weights are computed again only if points or cage change. Normals
    are rotated with the surface.

    Notes
    -----
    Equations (6) to (8) of Furukawa, Kitagawa and Shimizu. A point outside all tetrahedra belongs
    to the one with the smallest distance.

    Examples
    --------
    >>> from spacemap_vtk import BarycentricWarp
    >>> BarycentricWarp(outside="clamp").outside
    'clamp'
    """

    section = "warp"
    role = "warp"
    inputs = ("vtkPointSet", "vtkUnstructuredGrid")
    takes = ("object", "cage")
    provides: ClassVar = {"displacement": ProvidedArray("point", "m")}
    input_names = ("Input", "Cage")
    output_type = SAME_AS_INPUT

    outside = Choice(
        "extrapolate",
        "Points outside the cage: extrapolate the affine motion of the nearest tetrahedron, move "
        "with the nearest point of the cage (clamp), or stop with an error.",
        ["extrapolate", "clamp", "error"],
    )

    smooth = Flag(
        False,
        "Interpolate with a cubic spline through the cage's vertices, without kinks between "
        "tetrahedra, instead of an affine map in each tetrahedron.",
    )

    carried = Text(
        "",
        'Names of other arrays of the cage to interpolate, such as "velocity von_mises"; cell '
        "arrays are averaged at the vertices first.",
    )

    _embedding: _Embedding | None = None
    _rings: _Rings | None = None
    _color_array = ""

    @property
    def color_array(self) -> str:
        """Name of the array shown as colours; it is interpolated, too, if the cage has it."""
        return self._color_array

    @color_array.setter
    def color_array(self, name: str) -> None:
        if name != self._color_array:
            self._color_array = name
            self.Modified()

    def _carried_names(self, cage: vtkUnstructuredGrid) -> list[str]:
        """Return the names of the cage's arrays to interpolate, each once."""
        names, color = self.carried.replace(",", " ").split(), self._color_array
        data = cage.GetPointData(), cage.GetCellData()
        if color and any(each.HasArray(color) for each in data):
            names.append(color)
        return list(dict.fromkeys(names))

    def run(self, inputs: list[Any], output: vtkPointSet, time: float) -> None:
        """Interpolate the displacement at each point and add it."""
        if self.piece.total > 1 and inputs[0].GetNumberOfPoints() == 0:
            output.ShallowCopy(inputs[0])  # this process has no points
            return
        rings = self._find_rings(inputs[0])
        points = inputs[0] if rings is None else rings.feet
        prepared = self._embed(points, inputs[1], inputs[0].GetNumberOfPoints())
        field = array_of(inputs[1].GetPointData(), "displacement", "BarycentricWarp, on port 1,")
        moved, displacement = prepared.interpolation.displace(points_of(points), field)
        output.ShallowCopy(inputs[0])
        data = output.GetPointData()
        if rings is not None:
            offset = array_of(data, OFFSET, "BarycentricWarp")
            moved, displacement = rings.add_offsets(moved, offset, points_of(inputs[0]))
            for name in (FOOT, OFFSET):
                data.RemoveArray(name)
        output.SetPoints(to_points(moved))
        normals = data.GetNormals()
        if normals is not None:
            turned = prepared.rotate_normals(vtk_to_numpy(normals), field, rings)
            data.SetNormals(to_array(turned, normals.GetName()))
        if output.GetCellData().GetNormals() is not None:
            _update_cell_normals(output)
        add_array(data, "displacement", displacement)
        for name in self._carried_names(inputs[1]):
            values = self._vertex_values(inputs[1], prepared, name)
            carried = prepared.interpolation.apply(values).astype(np.float32)
            add_array(data, name, carried if rings is None else rings.repeat(carried))
        self._check_yarns(inputs[0], inputs[1])

    def _check_yarns(self, points: vtkPointSet, cage: vtkUnstructuredGrid) -> None:
        """Check what happens to the yarns of a cloth, if the strain of the cage is known."""
        array = cage.GetCellData().GetArray("strain")
        if array is None:
            return
        strain = vtk_to_numpy(array)[:, [0, 1, 2, 4, 5, 3]] * [1, 1, 1, 2, 2, 2]  # VTK's order
        keeps_length = points.GetPointData().HasArray(OFFSET) == 1
        check_yarns(self, points, strain, keeps_length)

    def _find_rings(self, points: vtkPointSet) -> _Rings | None:
        """Return the rings of yarns whose feet move with the cage; None for any other object."""
        feet = points.GetPointData().GetArray(FOOT)
        if feet is None or not points.GetPointData().HasArray(OFFSET):
            return None
        # Making points of the array marks them as changed, so this is done only once.
        if self._rings is None or self._rings.array is not feet:
            self._rings = _Rings(feet)
        return self._rings

    def _vertex_values(self, cage: vtkUnstructuredGrid, prepared: _Embedding, name: str) -> Floats:
        at_points, of_cells = cage.GetPointData(), cage.GetCellData()
        if at_points.GetArray(name) is not None:
            values = vtk_to_numpy(at_points.GetArray(name))
        elif of_cells.GetArray(name) is not None:
            values = vtk_to_numpy(of_cells.GetArray(name))
        else:
            names = {
                data.GetArrayName(i)
                for data in (at_points, of_cells)
                for i in range(data.GetNumberOfArrays())
                if not data.GetArrayName(i).startswith("mode_")
            }
            raise InputError(
                "the cage does not have this array",
                key="carried",
                value=name,
                allowed=", ".join(sorted(names)) or "none: it has no arrays",
            )
        table = values.reshape(len(values), -1).astype(np.float64, copy=False)
        return table if at_points.GetArray(name) is not None else prepared.averages @ table

    def _embed(self, points: vtkPointSet, cage: vtkUnstructuredGrid, moved: int) -> _Embedding:
        """Return where points lie in the cage; `moved` is the number of points that they move."""
        kept = self._embedding
        if kept is None or not kept.matches((self.outside, self.smooth), points, cage):
            vertices = points_of(cage).astype(np.float64, copy=False)
            elements = cells = elements_of(cage)
            if self.smooth and elements.shape[1] > 4:
                # The spline passes through all nodes.
                pieces = split_quadratic(elements, TETRAHEDRON)
                elements = repair_tetrahedra(vertices, pieces)[0].astype(np.int64)
            # Quadratic tetrahedra have straight sides: their corners determine where a point lies.
            corners = elements[:, :4]
            count = points.GetNumberOfPoints()
            riding = [
                data.GetArray(name).GetNumberOfComponents()
                for data in (cage.GetPointData(), cage.GetCellData())
                for name in self._carried_names(cage)
                if data.HasArray(name)
            ]
            single = points_of(points).dtype.itemsize == 4
            require_memory(
                estimate_bytes(
                    moved,
                    elements.shape[1],
                    self.smooth,
                    sum(riding),
                    single,
                    None if count == moved else count,
                ),
                f"to embed {count} points in the cage",
                cure="Use fewer ends and picks, or a coarser object.",
            )
            # A linear tetrahedron has one map for all its points: many points need no weights.
            affine = elements.shape[1] == 4 and not self.smooth and count > MANY_POINTS
            where = locate(points_of(points), vertices, corners, self.outside, weighted=not affine)
            note = ""
            if where.outside:
                room = format_quantity(float(f"{1.2 * where.largest_distance:.2g}"), "m")
                note = (
                    f"{where.outside} of {count} points ({100 * where.outside / count:.3g} %) "
                    "lie outside the cage, by up to "
                    f"{format_quantity(where.largest_distance, 'm')}; "
                    + {"extrapolate": "they are extrapolated", "clamp": "they are clamped"}[
                        self.outside
                    ]
                    + f'; cage.method = "tetwild" with cage.inflate = "{room}" encloses them'
                )
            ride: EmbeddedPoints
            places, clamp = points_of(points), self.outside == "clamp"
            if self.smooth:
                places = places.astype(np.float64, copy=False)
                smooth = extensions.load("maps", "smooth")
                ride = smooth(places, where, vertices, corners, clamp)
            elif affine:
                ride = AffineInterpolation(places, where, vertices, corners, clamp)
            else:
                ride = Interpolation(where, elements, len(vertices))
            if elements.shape[1] == 4:  # only gradients of quadratic cages need the weights
                where = replace(where, weights=np.empty((0, 4)), is_outside=np.empty(0, np.bool_))
            kept = self._embedding = _Embedding(
                settings=(self.outside, self.smooth),
                points=GeometrySnapshot(points),
                cage=GeometrySnapshot(cage),
                vertices=vertices,
                cells=cells,
                elements=elements,
                location=where,
                interpolation=ride,
                note=note,
            )
        if kept.note:
            self.warn(kept.note)
        return kept


def estimate_bytes(
    points: int,
    nodes: int = 4,
    smooth: bool = False,
    columns: int = 0,
    single: bool = False,
    embedded: int | None = None,
) -> int:
    """Estimate the memory for embedded points.

    Parameters
    ----------
    points : int
        Number of points.
    nodes : int, optional
        Nodes of each tetrahedron: 4 or 10.
    smooth : bool, optional
        Whether the map is the spline.
    columns : int, optional
        Components of the cage's arrays that are interpolated.
    single : bool, optional
        Whether points are in single precision.
    embedded : int, optional
        Number of rings of yarns, whose feet are embedded; by default all points are.

    Returns
    -------
    int
        Bytes.
    """
    each = 12 if single else 24
    # Position and displacement, and arrays in single precision.
    size = points * (2 * each + 4 * columns)
    if embedded is not None:
        size += embedded * (3 * each + 8)  # feet, moved, displaced; number of points
    # Tetrahedron; one of the arrays, of up to six components, in double precision.
    own = 4 + 8 * min(columns, 6)
    if nodes > 4 or smooth:
        # Whether the point is outside; weights of the corners; and weights of all nodes, or, for
        # the spline, of values and gradients at the corners.
        own += 1 + 8 * (4 + (16 if smooth else nodes))
    return size + (points if embedded is None else embedded) * own


class _Rings:
    """Rings of yarns: their control points follow each other, and have the same foot."""

    def __init__(self, feet: vtkDataArray) -> None:
        each = vtk_to_numpy(feet)
        first = np.ones(len(each), np.bool_)
        np.any(each[1:] != each[:-1], axis=1, out=first[1:])
        #: The array of the feet of all points.
        self.array = feet
        self._begin = np.append(np.flatnonzero(first), len(each))
        self._counts = np.diff(self._begin)
        #: One foot for each ring.
        self.feet = vtkPolyData()
        self.feet.SetPoints(to_points(each[first]))
        self._recycler = ArrayPool()

    def repeat(self, values: NDArray[Any]) -> NDArray[Any]:
        """Repeat values of rings for their control points."""
        return np.repeat(values, self._counts, axis=0)

    def add_offsets(
        self, feet: NDArray[Any], offset: NDArray[Any], rest: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the control points from moved feet, and their displacement from rest."""
        moved, displacement = (self._recycler.empty(rest.shape, rest.dtype) for _ in range(2))

        def add(rings: slice) -> None:  # in blocks, which stay in the cache
            rows = slice(self._begin[rings.start], self._begin[rings.stop])
            np.add(
                np.repeat(feet[rings], self._counts[rings], axis=0), offset[rows], out=moved[rows]
            )
            np.subtract(moved[rows], rest[rows], out=displacement[rows])

        for_each(blocks(len(feet), _BLOCK), lambda: add)
        return moved, displacement


@dataclass
class _Embedding:
    """Results that depend only on points and cage."""

    settings: tuple[str, bool]
    points: GeometrySnapshot
    cage: GeometrySnapshot
    vertices: Floats
    cells: Ints
    elements: Ints
    location: Location
    interpolation: EmbeddedPoints
    note: str

    def matches(
        self, settings: tuple[str, bool], points: vtkPointSet, cage: vtkUnstructuredGrid
    ) -> bool:
        return self.settings == settings and self.points.matches(points) and self.cage.matches(cage)

    @cached_property
    def averages(self) -> csr_matrix:
        """Matrix (V, T) that averages values of tetrahedra at the vertices."""
        return vertex_averages(self.vertices, self.cells)

    @cached_property
    def _gradients(self) -> Any:
        """Return an object for the gradients of the map, of each tetrahedron or at each point."""
        if hasattr(self.interpolation, "gradients"):
            return self.interpolation
        if self.elements.shape[1] > 4:
            return QuadraticGradients(self.location, self.vertices, self.elements)
        return AffineInterpolation(np.empty((0, 3)), self.location, self.vertices, self.elements)

    def rotate_normals(
        self, normals: NDArray[Any], displacement: NDArray[Any], rings: _Rings | None = None
    ) -> NDArray[np.float32]:
        each: AnyInts = np.arange(len(self.location.tetrahedron))
        if isinstance(self._gradients, QuadraticGradients):
            gradients = self._gradients.compute(displacement)
        else:
            gradients = self._gradients.gradients(displacement)
            if isinstance(self._gradients, AffineInterpolation):
                each = self.location.tetrahedron
        if rings is not None:
            each = rings.repeat(each)
        return deform_normals(normals, cofactors(gradients), each)


def _update_cell_normals(output: vtkPointSet) -> None:
    """Recompute the normals of polygons; remove those of other cells, which would be stale."""
    cells = output.GetCellData()
    name = cells.GetNormals().GetName()
    cells.RemoveArray(name)
    if isinstance(output, vtkPolyData):
        bare = vtkPolyData()
        bare.CopyStructure(output)
        maker = vtkPolyDataNormals()
        maker.SetInputData(bare)
        maker.ComputePointNormalsOff()
        maker.ComputeCellNormalsOn()
        maker.SplittingOff()
        maker.ConsistencyOff()
        maker.Update()
        made = maker.GetOutput().GetCellData().GetNormals()
        if made is not None and made.GetNumberOfTuples() == output.GetNumberOfCells():
            made.SetName(name)
            cells.SetNormals(made)
