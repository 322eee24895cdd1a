"""ModalResponse: the cage's displacement at any time, as a closed-form sum over modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkInformation
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import add_array, array_of
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.modal_solver import MODE_NAME
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

    # Modes as (n, 3V) and the modal loads per unit gravity (n, 3), kept until the input changes.
    _kept: tuple[int, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None = None

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float]:
        """Return the continuous range of times."""
        return 0.0, self.duration

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Evaluate the sum at `time`; before t = 0 the initial state holds."""
        eigenvalues, shapes, participation = self._modes(inputs[0])
        load = participation @ np.asarray(self.gravity)
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
        output.ShallowCopy(inputs[0])
        add_array(output.GetPointData(), "displacement", (coordinates @ shapes).reshape(-1, 3))
        add_array(output.GetPointData(), "velocity", (rates @ shapes).reshape(-1, 3))
        add_array(output.GetFieldData(), "modal_coordinates", coordinates)

    def _modes(
        self, grid: vtkUnstructuredGrid
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        changed = grid.GetMTime()
        if self._kept is None or self._kept[0] != changed:
            owner = "ModalResponse (put a ModalSolver before it)"
            eigenvalues = array_of(grid.GetFieldData(), "eigenvalues", owner)
            data = grid.GetPointData()
            shapes = np.stack(
                [array_of(data, MODE_NAME.format(k), owner) for k in range(len(eigenvalues))]
            )
            mass = array_of(data, "nodal_mass", owner)
            # Gravity's load on vertex v is its share of the mass times g; (16) with M u = M g.
            participation = np.einsum("nvc,v->nc", shapes, mass)
            self._kept = changed, eigenvalues, shapes.reshape(len(shapes), -1), participation
        return self._kept[1:]
