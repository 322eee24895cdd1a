"""ModalResponse: the cage's displacement at any time, as a closed-form sum over modes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from vtkmodules.vtkCommonCore import vtkInformation
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import add_array, array_of, points_of, tetrahedra_of
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.modal_solver import MODE_NAME
from spacemap_vtk.modal.kinematics import (
    LARGE_ROTATION,
    largest_rotation,
    rotation_operator,
)
from spacemap_vtk.modal.oscillator import oscillate
from spacemap_vtk.parameters import Choice, Real, Vector


class ModalResponse(Stage):
    """Move a cage by its vibration modes, at any time, without stepping.

    Displacement and velocity are sums of closed-form responses of single oscillators, one for
    each mode: under-, critically and overdamped and rigid ones. Gravity is a step at t = 0.

    Notes
    -----
    Equations (16) to (20) of Furukawa, Kitagawa and Shimizu, with these corrections: (16) is
    w = Sᵀ M u, and the decay in (20) is exp(-μt) with μ = (α + βλ)/2.

    Examples
    --------
    >>> from spacemap_vtk import ModalResponse
    >>> ModalResponse(alpha=2.0, gravity=(0, 0, -9.81)).gravity
    (0.0, 0.0, -9.81)
    """

    section = "response"
    inputs = ("vtkUnstructuredGrid",)

    alpha = Real(
        1.0, "Damping proportional to mass; slows every mode alike.", unit="1/s", minimum=0.0
    )
    beta = Real(
        0.0, "Damping proportional to stiffness; stills the high modes.", unit="s", minimum=0.0
    )
    gravity = Vector(
        (0.0, 0.0, -9.80665),
        "Acceleration of gravity, there from t = 0 on.",
        component=Real(0.0, "", unit="m/s2"),
    )
    initial = Choice(
        "rest",
        "State at t = 0: undeformed, or already hanging at rest under the loads.",
        ["rest", "equilibrium"],
    )
    duration = Real(
        10.0,
        "Length of the time range reported to players; any later time can be asked for too.",
        unit="s",
        above=0.0,
    )

    _kept: tuple[int, _Modes] | None = None

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float]:
        """Return the continuous range of times."""
        return 0.0, self.duration

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Evaluate the sum at `time`; before t = 0 the initial state holds."""
        modes = self._modes(inputs[0])
        eigenvalues = modes.eigenvalues
        load = modes.participation @ np.asarray(self.gravity)
        response = oscillate(eigenvalues, self.alpha, self.beta, max(time, 0.0))
        if self.initial == "equilibrium":
            rigid = (eigenvalues == 0.0) & (np.abs(load) > 0.0)
            if rigid.any():
                raise InputError(
                    f"there is no equilibrium: {rigid.sum()} rigid modes fall freely",
                    key="initial",
                    value=self.initial,
                    cure='Fix the cage ([modal] fixed = "+y"), or start from "rest".',
                )
            static = np.divide(load, eigenvalues, out=np.zeros_like(load), where=eigenvalues > 0)
            coordinates, rates = static, np.zeros_like(load)
        else:
            coordinates, rates = response.step * load, response.impulse * load
        displacement = (coordinates @ modes.shapes).reshape(-1, 3)
        velocity = (rates @ modes.shapes).reshape(-1, 3)
        if largest_rotation(modes.rotation, displacement) > LARGE_ROTATION:
            self.warn(
                f"the cage turns by more than {np.degrees(LARGE_ROTATION):.0f} degrees; a linear "
                "model stretches what turns: lower the load or raise the modulus to trust the shape"
            )
        output.ShallowCopy(inputs[0])
        add_array(output.GetPointData(), "displacement", displacement)
        add_array(output.GetPointData(), "velocity", velocity)
        add_array(output.GetFieldData(), "modal_coordinates", coordinates)

    def _modes(self, grid: vtkUnstructuredGrid) -> _Modes:
        changed = grid.GetMTime()
        if self._kept is None or self._kept[0] != changed:
            self._kept = changed, _Modes.of(grid)
        return self._kept[1]


class _Modes(NamedTuple):
    """What the response needs of ModalSolver's output."""

    eigenvalues: NDArray[np.float64]
    """(n,)"""
    shapes: NDArray[np.float64]
    """(n, 3 V)"""
    participation: NDArray[np.float64]
    """(n, 3): the modal load of a unit gravity along x, y and z."""
    rotation: csr_matrix
    """(3 T, 3 V)"""

    @classmethod
    def of(cls, grid: vtkUnstructuredGrid) -> _Modes:
        owner = "ModalResponse (put a ModalSolver before it)"
        eigenvalues = array_of(grid.GetFieldData(), "eigenvalues", owner)
        data = grid.GetPointData()
        shapes = np.stack(
            [array_of(data, MODE_NAME.format(k), owner) for k in range(len(eigenvalues))]
        )
        # Gravity's load on a vertex is its share of the mass times g: (16) with M u = M g.
        mass = array_of(data, "nodal_mass", owner)
        vertices = points_of(grid).astype(np.float64, copy=False)
        return cls(
            eigenvalues,
            shapes.reshape(len(shapes), -1),
            np.einsum("nvc,v->nc", shapes, mass),
            rotation_operator(vertices, tetrahedra_of(grid)),
        )
