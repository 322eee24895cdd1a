"""BarycentricWarp: any points ride along with a cage that moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkUnstructuredGrid

from spacemap_vtk.embedding.interpolation import Interpolation
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.filters.arrays import add_array, array_of, elements_of, points_of, to_points
from spacemap_vtk.filters.base import SAME_AS_INPUT, Stage
from spacemap_vtk.filters.kept import Geometry
from spacemap_vtk.parameters import Choice
from spacemap_vtk.units import format_quantity


class BarycentricWarp(Stage):
    """Move the points of port 0 with the displacement of the tetrahedral mesh on port 1.

    Each point keeps its barycentric weights in the tetrahedron that holds it, or the weights of
    all ten nodes if the mesh is of quadratic tetrahedra. They are computed once, and again only
    when points or mesh change: a new displacement costs one sparse product.

    Notes
    -----
    Equations (6) to (8) of Furukawa, Kitagawa and Shimizu. A point outside every tetrahedron
    belongs to the truly nearest one.

    Examples
    --------
    >>> from spacemap_vtk import BarycentricWarp
    >>> BarycentricWarp(outside="clamp").outside
    'clamp'
    """

    section = "warp"
    inputs = ("vtkPointSet", "vtkUnstructuredGrid")
    input_names = ("Input", "Cage")
    output = SAME_AS_INPUT

    outside = Choice(
        "extrapolate",
        "Points outside the cage: follow the nearest tetrahedron's affine motion, move as the "
        "nearest point of the cage does, or stop with an error.",
        ["extrapolate", "clamp", "error"],
    )

    _kept: tuple[str, Geometry, Geometry, Interpolation, str] | None = None

    def run(self, inputs: list[Any], output: vtkPointSet, time: float) -> None:
        """Interpolate the displacement at each point and add it."""
        interpolation = self._interpolation(inputs[0], inputs[1])
        moved, displacement = interpolation.displace(
            points_of(inputs[0]),
            array_of(inputs[1].GetPointData(), "displacement", "BarycentricWarp, on port 1,"),
        )
        output.ShallowCopy(inputs[0])
        output.SetPoints(to_points(moved))
        add_array(output.GetPointData(), "displacement", displacement)

    def _interpolation(self, points: vtkPointSet, cage: vtkUnstructuredGrid) -> Interpolation:
        kept = self._kept
        if (
            kept is None
            or kept[0] != self.outside
            or not kept[1].matches(points)
            or not kept[2].matches(cage)
        ):
            vertices = points_of(cage).astype(np.float64, copy=False)
            elements = elements_of(cage)
            # Quadratic ones are straight-sided: their corners alone say where a point lies.
            where = locate(
                points_of(points).astype(np.float64, copy=False),
                vertices,
                elements[:, :4],
                self.outside,
            )
            note = ""
            if where.outside:
                note = (
                    f"{where.outside} of {points.GetNumberOfPoints()} points lie outside the cage, "
                    f"by up to {format_quantity(where.largest_distance, 'm')}; "
                    + {"extrapolate": "they are extrapolated", "clamp": "they are clamped"}[
                        self.outside
                    ]
                )
            weights = Interpolation(where, elements, len(vertices))
            kept = self._kept = self.outside, Geometry(points), Geometry(cage), weights, note
        if kept[4]:
            self.warn(kept[4])
        return kept[3]
