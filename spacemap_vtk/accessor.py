"""Add ``mesh.spacemap`` to every pyvista mesh: deform the mesh with a cage.

pyvista finds this module by its entry point group ``pyvista.accessors`` and imports it when
``mesh.spacemap`` is first used. Importing it by hand has the same effect.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonDataModel import vtkPointSet, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkTrivialProducer

from spacemap_vtk.datasets.arrays import add_array, array_of
from spacemap_vtk.datasets.volume import split_into_tetrahedra
from spacemap_vtk.errors import InputError, UnknownNameError
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import Stage, connect
from spacemap_vtk.filters.modal_response import ModalResponse
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.parameters import suggestion


@pv.register_dataset_accessor("spacemap", pv.DataObject)
class SpacemapAccessor:
    """Space mapping on a mesh: the mesh is embedded in a coarse cage and moves with it.

    Parameters
    ----------
    mesh : pyvista.DataSet or pyvista.MultiBlock
        Any mesh. A mesh without explicit points (an image) becomes an unstructured grid. The
        blocks of a multi-block data set all move with the same cage.

    Examples
    --------
    >>> import pyvista as pv
    >>> import spacemap_vtk.accessor
    >>> cage = pv.Box(level=2).delaunay_3d()
    >>> bent = pv.Sphere(radius=0.5).spacemap.deform(cage, 0.5 * cage.points)
    >>> round(bent.length / pv.Sphere(radius=0.5).length, 6)
    1.5
    """

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh

    def deform(
        self,
        cage: Any,
        displacement: str | ArrayLike | Callable[[Any], ArrayLike] = "displacement",
        **warp: Any,
    ) -> Any:
        """Deform the mesh with a cage.

        Parameters
        ----------
        cage : pyvista.DataSet, pyvista.MultiBlock or vtkAlgorithm
            A mesh with a volume, or a stage that makes one. Cells that are not tetrahedra are
            split, and blocks are joined.
        displacement : str, array_like of shape (n_points, 3), or callable
            Displacement of the cage's points in m; or the name of the point array that holds it;
            or a function that computes it from the points, an array of shape (n_points, 3).
        **warp : object
            Parameters of `spacemap_vtk.BarycentricWarp`.

        Returns
        -------
        pyvista.DataSet or pyvista.MultiBlock
            A new mesh with all arrays, rotated normals, and a point array ``displacement``.

        Raises
        ------
        InputError
            If the cage is not a mesh, or the displacement is missing or has the wrong size.
        GeometryError
            If the cage has no volume, or a point is not finite.
        """
        if isinstance(cage, vtkAlgorithm):
            # Only Stage.update raises errors as exceptions.
            cage.update() if isinstance(cage, Stage) else cage.Update()
            cage = pv.wrap(cage.GetOutputDataObject(0))
        if not isinstance(cage, pv.DataObject):
            raise InputError(
                f"must be a mesh, not {type(cage).__name__}",
                key="cage",
                allowed="a pyvista mesh with a volume",
                cure="Write deform(cage, displacement); read a file with pyvista.read(file); "
                "modal() makes its own cage.",
            )
        if isinstance(cage, pv.MultiBlock):
            cage = cage.combine(merge_points=True)
        volume = split_into_tetrahedra(_to_point_set(cage), "the cage")
        if isinstance(displacement, str):
            values = array_of(volume.grid.GetPointData(), displacement, "deform")
        else:
            if callable(displacement):
                displacement = displacement(np.array(cage.points, dtype=np.float64))
            allowed = f"({cage.GetNumberOfPoints()}, 3): one row for each point of the cage"
            try:
                values = np.asarray(displacement, dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise InputError(
                    f"must be an array of numbers: {error}", key="displacement", allowed=allowed
                ) from None
            if values.shape != (cage.GetNumberOfPoints(), 3):
                text = f"has the shape {values.shape}"
                raise InputError(text, key="displacement", allowed=allowed)
            values = values[volume.points]
        moving = vtkUnstructuredGrid()
        moving.ShallowCopy(volume.grid)
        add_array(moving.GetPointData(), "displacement", np.array(values, dtype=np.float64))
        return pv.wrap(BarycentricWarp(**warp)(_to_point_set(self._mesh), moving))

    def modal(self, **parameters: Any) -> BarycentricWarp:
        """Connect a pipeline in which the mesh vibrates in a cage around it.

        ``swing = mesh.spacemap.modal(fixed="-z")`` returns the last of four connected stages.
        ``plotter.add_mesh(swing)`` draws it, ``swing.update(time=0.1)`` sets its time, and
        ``swing.upstream()`` yields the other stages.

        Parameters
        ----------
        **parameters : object
            Parameters of `spacemap_vtk.TetraCage`, `spacemap_vtk.ModalSolver`,
            `spacemap_vtk.ModalResponse` and `spacemap_vtk.BarycentricWarp`, by name.

        Returns
        -------
        BarycentricWarp
            The last stage, already updated at time 0.

        Raises
        ------
        UnknownNameError
            If none of the four stages has a parameter of that name.
        SpacemapError
            If a stage refuses its input.
        """
        warp = BarycentricWarp()
        stages: list[Stage] = [TetraCage(), ModalSolver(), ModalResponse(), warp]
        for name, value in parameters.items():
            owners = [stage for stage in stages if name in stage.parameters]
            if not owners:
                known = [known for stage in stages for known in stage.parameters]
                raise UnknownNameError(
                    "unknown parameter",
                    key=name,
                    allowed=", ".join(known),
                    cure=suggestion(name, known),
                )
            # Several stages may have the parameter; the last one gets it. So gravity goes to
            # ModalResponse, where it sets the mesh swinging. In ModalSolver gravity would only
            # prestress the cage.
            owners[-1].configure(**{name: value})
        source = vtkTrivialProducer()
        source.SetOutput(_to_point_set(self._mesh))
        return connect((source, connect(source, *stages[:-1])), warp).update(time=0.0)


def _to_point_set(mesh: Any) -> Any:
    if isinstance(mesh, pv.MultiBlock):
        blocks = pv.MultiBlock([block if block is None else _to_point_set(block) for block in mesh])
        for number, name in enumerate(mesh.keys()):
            blocks.set_block_name(number, name)
        return blocks
    if not isinstance(mesh, pv.DataSet):
        raise InputError(
            f"a {type(mesh).__name__} has no points", allowed="a mesh, or blocks of meshes"
        )
    return mesh if isinstance(mesh, vtkPointSet) else mesh.cast_to_unstructured_grid()
