"""RotationStrain: remove the artificial stretch of large rotations from a linear motion."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from vtkmodules.vtkCommonCore import vtkInformationVector
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, array_of, elements_of, mask_reader, points_of
from spacemap_vtk.datasets.modal_model import model_of
from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.algorithm import Inputs
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.cage_fittings import Supports
from spacemap_vtk.filters.shape_limits import check_folds, check_inversion
from spacemap_vtk.mechanics.boundary.supports import held_components
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.mechanics.response.rotation_coordinates import RotationCoordinates
from spacemap_vtk.ndarrays import Floats

#: Rates of a mover that are replaced here, in the order of their time derivatives.
_RATES = ("velocity", "acceleration")


class RotationStrain(Stage):
    """Rebuild a cage's shape from the rotation and strain of each element of a linear motion.

    A linear motion stretches parts that turn: a strip that swings by 45 degrees grows by 23 %. Here
    each element is rotated and strained as the linear motion intends, and the vertices are fitted
    to the elements by least squares. Held vertices keep their positions. A hanging cage is rotated
    from its equilibrium. Any time can be evaluated; a cage is factorised once.

    It follows any mover. The point arrays ``displacement``, ``velocity`` and ``acceleration`` of
    the output are those of the rebuilt shape; ``linear_displacement`` is that of the input. Strain
    and stress are those of the input, in axes that turn with the fabric.

    The stretch is removed, but a linear motion also responds too strongly to its loads where it
    turns. A clamped strip that turns by 37 degrees is wrong by 5 % of its length, by 115 degrees by
    51 %; there is a warning from 35 degrees on. TransientResponse, or a cage that hangs under the
    load (gravity and dead_loads of ModalSolver), does not have this limit.

    Notes
    -----
    J. Huang et al., IEEE Trans. Vis. Comput. Graph. 17 (2011) 983. The period of a large swing is
    still that of a small one (it would be 1.04 times as long at 45 degrees, 1.18 times at 90).

    Examples
    --------
    >>> from spacemap_vtk import ModalResponse, RotationStrain, connect
    >>> turned = connect(ModalResponse(), RotationStrain())
    >>> turned.parameter("fixed").automatic
    'the supports of the cage'
    """

    section = "rotation"
    role, after = "rotation", "mover"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"
    provides: ClassVar = {
        "displacement": ProvidedArray("point", "m"),
        "linear_displacement": ProvidedArray("point", "m"),
    }

    fixed = Supports(
        None,
        "Places that keep their motion, for a motion from a file; a cage of ModalSolver has its "
        "own supports.",
        automatic="the supports of the cage",
    )

    _kept: tuple[tuple[int, ...], RotationCoordinates] | None = None

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Rebuild the shape at the time of the input."""
        self._mark_upstream(False)  # another consumer of those stages may not have a RotationStrain
        output.ShallowCopy(inputs[0])
        linear = self.rebuild(output)
        kernel, points = self._coordinates(output), points_of(output)
        moved = points + array_of(output.GetPointData(), "displacement", "")
        self.check_limit("swing", kernel.largest_rotation(linear))
        self.check_limit("turned_strain", kernel.largest_turned_strain(linear))
        check_inversion(self, points, moved, elements_of(output), kernel.surface)
        check_folds(self, output, points, moved, kernel.surface)

    def rebuild(self, cage: vtkUnstructuredGrid) -> Floats:
        """Replace the linear motion in a cage's arrays by the motion without artificial stretch.

        Parameters
        ----------
        cage : vtkUnstructuredGrid
            A cage with a point array ``displacement``, and with any rates. Its arrays are replaced,
            not written to.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Displacement of the linear motion from the equilibrium or the undeformed shape [m].

        Raises
        ------
        InputError
            If the cage has no displacement.
        """
        data = cage.GetPointData()
        owner = "RotationStrain (it must follow a mover)"
        kernel = self._coordinates(cage)
        given = array_of(data, "displacement", owner)
        hung = array_of(data, "equilibrium", owner) if data.HasArray("equilibrium") else 0.0
        linear = np.asarray(given, np.float64) - hung
        rates = [array_of(data, name, owner) for name in _RATES if data.HasArray(name)]
        add_array(data, "linear_displacement", given)
        add_array(data, "displacement", hung + kernel.displacement(linear))
        if rates:
            add_array(data, "velocity", kernel.velocity(linear, rates[0]))
        if len(rates) == 2:
            add_array(data, "acceleration", kernel.acceleration(linear, *rates))
        return linear

    def largest_rotation_and_strain(
        self, cage: vtkUnstructuredGrid, linear: Floats
    ) -> tuple[float, float]:
        """Return the largest rotation and the largest strain of an element of a cage.

        Parameters
        ----------
        cage : vtkUnstructuredGrid
            As for `rebuild`.
        linear : ndarray of float64, shape (V, 3)
            Displacement of a linear motion from the equilibrium or the undeformed shape [m].

        Returns
        -------
        angle, strain : float
            As for `RotationCoordinates.largest_rotation_and_strain`.
        """
        return self._coordinates(cage).largest_rotation_and_strain(linear)

    def _request_update_extent(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        super()._request_update_extent(in_info, out_info)
        self._mark_upstream(True)

    def _mark_upstream(self, turned: bool) -> None:
        """Tell the stages above whether they run for this stage."""
        for stage in self.upstream():
            if isinstance(stage, Stage):
                if self.role in stage.excludes:
                    raise InputError(
                        "[rotation] cannot follow [transient], whose motion has no artificial "
                        "stretch",
                        cure="Leave out the section [rotation].",
                    )
                stage.rotation_removed = turned

    @property
    def motion(self) -> Motion | None:
        """The rebuilt motion as of the last update; None if the mover knows one time only."""
        above = (s for s in self.upstream() if isinstance(s, Stage) and s is not self)
        linear = next((stage.motion for stage in above if stage.motion is not None), None)
        return None if linear is None or self._kept is None else self._kept[1].motion(linear)

    def _coordinates(self, grid: vtkUnstructuredGrid) -> RotationCoordinates:
        """Return the object that rebuilds shapes of a cage, factorised once for each cage."""
        data = grid.GetPointData()
        # At a new time only displacements are new arrays; those that the kernel needs stay.
        known = data.HasArray("fixed_components")
        of_cage = [grid.GetPoints(), grid.GetCells()]
        names = ("fixed_components", "fixed_directions", "rigid_body", "equilibrium")
        arrays = [data.GetArray(name) for name in names]
        key = tuple(part.GetMTime() for part in [*of_cage, *arrays, self] if part is not None)
        if self._kept is not None and self._kept[0] == key:
            return self._kept[1]
        self.report_progress(0.0)
        if known and self.fixed is None:
            model = model_of(grid)
            moved = 0.0 if model.displacement is None else model.displacement
            kernel = RotationCoordinates(
                model.points + moved, model.cells, model.pencil.basis, model.pencil.surface
            )
        else:
            points = points_of(grid).astype(np.float64)
            with add_key_to_errors("fixed"):
                held = held_components(points, self.fixed or (), mask_reader(grid))
            kernel = RotationCoordinates.from_mesh(points, elements_of(grid), held)
        self._kept = key, kernel
        return kernel
