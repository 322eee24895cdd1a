"""TetraCage: a coarse tetrahedral mesh round any data set."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import (
    VTK_QUADRATIC_TETRA,
    VTK_TETRA,
    vtkDataSet,
    vtkUnstructuredGrid,
)

from spacemap_vtk.cage.bounds import padded_bounds
from spacemap_vtk.cage.lattice import estimate_bytes, lattice
from spacemap_vtk.cage.quadratic import with_midpoints
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.filters.arrays import to_cells, to_points
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.memory import require
from spacemap_vtk.parameters import Choice, Integer, Real, Vector


class TetraCage(Stage):
    """Enclose a data set in a coarse cage of tetrahedra.

    The bounding box is cut into hexahedra, and each of these into five tetrahedra; the cut is
    mirrored from one hexahedron to the next, so that the mesh conforms.

    Notes
    -----
    After section 3 of Furukawa, Kitagawa and Shimizu, "Deformation of Flexible Objects Based on
    Space Mapping".

    Examples
    --------
    >>> from spacemap_vtk import TetraCage, WeaveSource
    >>> weave, cage = WeaveSource(), TetraCage(divisions=(5, 5, 1))
    >>> cage.SetInputConnection(weave.GetOutputPort())
    >>> cage.update()
    >>> cage.GetOutputDataObject(0).GetNumberOfCells()
    125
    """

    section = "cage"
    inputs = ("vtkDataSet",)

    method = Choice("lattice", "How the cage is made.", ["lattice"])
    divisions = Vector(
        (5, 5, 1),
        "Number of hexahedra along x, y and z. At least two through the thickness bend well.",
        component=Integer(1, "", minimum=1, maximum=100_000),
    )
    order = Integer(
        1,
        "1: linear tetrahedra, whose vertices are their corners. 2: quadratic ones, with midpoints "
        "on their edges: they bend, with one layer as well as linear ones with ten.",
        minimum=1,
        maximum=2,
    )
    padding = Real(
        0.0,
        "Room between the object and the cage on each side, as a share of that side's length.",
        minimum=0.0,
        maximum=10.0,
    )

    def run(self, inputs: list[vtkDataSet], output: vtkUnstructuredGrid, time: float) -> None:
        """Make the mesh."""
        if inputs[0].GetNumberOfPoints() == 0:
            raise GeometryError("there is nothing to enclose: the input has no points")
        require(
            estimate_bytes(self.divisions) * (1 if self.order == 1 else 5),
            "this cage",
            key="divisions",
            value=list(self.divisions),
            cure="Use fewer divisions: a cage is meant to be coarse.",
        )
        bounds = padded_bounds(inputs[0].GetBounds(), self.padding)
        vertices, tetrahedra = lattice(bounds, self.divisions)
        cell_type = VTK_TETRA
        if self.order == 2:
            vertices, tetrahedra = with_midpoints(vertices, tetrahedra)
            cell_type = VTK_QUADRATIC_TETRA
        output.SetPoints(to_points(vertices))
        output.SetCells(cell_type, to_cells(tetrahedra))
