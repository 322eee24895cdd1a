"""ModalResponse: the cage's displacement at any time, as a sum over modes in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import ClassVar

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import cache
from spacemap_vtk.applicability import LIMITS, REFUSED_ROTATION
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.datasets.modal_model import ModesReader
from spacemap_vtk.datasets.processes import Processes
from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.load_parameters import (
    MOTION_ARRAYS,
    LoadParameters,
    add_energies,
    add_motion,
    add_stress,
)
from spacemap_vtk.filters.shape_limits import check_folds, check_inversion, check_strains
from spacemap_vtk.mechanics.contact.opening import RestingContact, resting_contacts
from spacemap_vtk.mechanics.contact.resting import obstacles_of
from spacemap_vtk.mechanics.elements.kinematics import largest_rotation
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.response.cage_response import Response
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import Flag


class ModalResponse(LoadParameters, Stage):
    """Move a cage by its vibration modes, at any time, without time steps.

    The motion is a sum of closed-form responses, one for each mode, for any damping. Gravity acts
    from t = 0 on; other loads each have their own time function. A residual vector for each load
    makes the static response exact for any number of modes.

    The output has the point arrays ``displacement``, ``velocity`` and ``acceleration``; the cell
    arrays ``strain`` and ``stress`` (mean of each tetrahedron, in the axes of the fabric: x weft,
    y warp, z normal; VTK's order xx, yy, zz, xy, yz, xz) and ``von_mises``; and the field arrays
    ``modal_coordinates``, ``kinetic_energy``, ``strain_energy``, ``dissipated_energy`` and
    ``external_work`` (J, in coordinates relative to a moving base). External work is the sum of
    the other three energies.

    Notes
    -----
    Equations (16) to (20) of Furukawa, Kitagawa and Shimizu, with these corrections: (16) is
    w = Sᵀ M u, and the decay in (20) is exp(-μt) with μ = (α + βλ)/2.

    Examples
    --------
    >>> from spacemap_vtk import ModalResponse
    >>> ModalResponse(alpha=2.0, gravity=(0, 0, -9.81)).gravity
    (0.0, 0.0, -9.81)
    >>> pressed = ModalResponse(loads=[{"pressure": "20 Pa", "on": "+z", "time": "step"}])
    >>> pressed.loads[0].pressure
    20.0
    """

    section = "response"
    role = "mover"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"
    provides: ClassVar = {**MOTION_ARRAYS, "modal_coordinates": ProvidedArray("field")}

    residual_vectors = Flag(
        True, "Add a residual vector for each load, which makes the static response exact."
    )

    #: Whether it is drawn beside truer motions to show how far it is off; it is then not refused.
    compared: bool = False
    _modes: ModesReader | None = None
    _last_motion: tuple[tuple[int, int], Response] | None = None
    _contacts: Sequence[RestingContact] = ()

    @property
    def motion(self) -> Response | None:
        """The motion as of the last update; None before the first."""
        return None if self._last_motion is None else self._last_motion[1]

    def check(self) -> None:
        """Check damping and loads."""
        super().check()
        for number, load in enumerate(self.loads):
            if load.follower:
                raise InputError(
                    "a linear motion does not support follower pressures",
                    key=f"loads[{number}].follower",
                    value=True,
                    cure="Leave out follower, or use [transient] instead of [response].",
                )

    def keeps_equilibrium(self, gravity: tuple[float, ...]) -> bool:
        """Return whether a cage stays in its equilibrium, as nothing moves it.

        Parameters
        ----------
        gravity : tuple of float
            Gravity of the equilibrium [m/s²].

        Returns
        -------
        bool
            False if there are loads, another gravity, or an initial displacement or velocity.
        """
        same = any(gravity) if self.gravity is None else self.gravity == gravity
        start = (*self.initial_velocity, *self.initial_displacement)
        arrays = self.initial_velocity_array or self.initial_displacement_array
        return same and not (self.loads or any(start) or arrays)

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Evaluate the sum at `time`; before t = 0 the cage is at rest in its initial state."""
        grid = inputs[0]
        if self._modes is None:
            self._modes = ModesReader()
        modes = self._modes.read(grid)
        for number, term in enumerate(obstacles_of(modes.model)):
            if term.motion is not None:
                raise InputError(
                    "a linear motion does not support obstacles that move",
                    key=f"obstacles[{number}].displacement",
                    value=tuple(term.motion.displacement.tolist()),
                    cure="Use [transient] instead of [response], or leave out displacement.",
                )
        # The motion is the same for all requested times.
        key = grid.GetMTime(), self.GetMTime()
        if self._last_motion is None or self._last_motion[0] != key:
            self._last_motion = key, self._make_response(grid, modes)
            self._contacts = resting_contacts(modes.model)
        motion = self._last_motion[1]
        state = motion.modal.at_time(time)
        displacement, velocity, acceleration = motion.at_time(time, state)
        for text in motion.warnings:
            self.warn(text)
        if lost := motion.count_lost_phases(time, state):
            self.warn(
                f"the phases of {lost} modes are lost in rounding after so many periods; use an "
                "earlier time, or more damping"
            )
        rest = modes.model.displacement
        moved = displacement if rest is None else displacement - rest
        if self._contacts:
            openings = [contact.find_openings(moved[None]) for contact in self._contacts]
            multiples = [float(opening.forwards[0]) for opening in openings]
            number = int(np.argmin(multiples))
            self.check_limit(
                "contact",
                1.0 / multiples[number],
                found=f"the motion is {{}} of that at which the cage lifts off obstacle {number}",
            )
        gradients = modes.gradient.evaluate(moved)
        model = modes.model
        if not self.rotation_removed:
            angle = largest_rotation(gradients)
            if angle > REFUSED_ROTATION and not self.compared:
                raise SolverError(
                    f"the cage would turn by {math.degrees(angle):.3g}° at {time:.3g} s, and a "
                    f"linear motion shows nothing real beyond {math.degrees(REFUSED_ROTATION):g}°",
                    cure="Hang the cloth in one step (--hang), lower the loads, add a section "
                    "[rotation], or replace [response] by [transient].",
                    window_cure="Choose Cloth > Hang as curtain, lower the loads, or tick Rotation "
                    "strain or Transient response in the pipeline of the window.",
                )
            words = {"cure": LIMITS["swing"].cure} if angle > LIMITS["swing"].most else {}
            self.check_limit("rotation", angle, **words)
            at = model.points + displacement
            check_inversion(self, model.points, at, model.cells, model.pencil.surface)
            check_folds(self, grid, model.points, at, model.pencil.surface)
        strain, stress = modes.strain_and_stress(moved, gradients)
        check_strains(self, grid, strain, model, linear=True)
        output.ShallowCopy(grid)
        add_motion(output, (displacement, velocity, acceleration))
        coordinates = state.position[: len(modes.eigenvalues)].copy()
        add_array(output.GetFieldData(), "modal_coordinates", coordinates)
        if self.stress:
            add_stress(output, strain, stress)
        if self.energy:
            energies = motion.energy(time, state)
            if np.isnan(energies.work):
                self.warn(
                    "dissipated_energy and external_work are not a number, because the loads have "
                    "too many periods to sum their work; use an earlier time, or longer periods"
                )
            add_energies(output, energies)

    def _make_response(self, grid: vtkUnstructuredGrid, modes: CageModes) -> Response:
        self.check()
        displacement, velocity = self.initial_fields(grid)
        response = Response(
            modes,
            self.load_vectors(grid, modes),
            self.damping,
            equilibrium=self.initial == "equilibrium",
            displacement=displacement,
            velocity=velocity,
            residual=self.residual_vectors,
            statics=partial(static_displacements, modes.model, processes=self._processes),
        )
        response.warnings += self.warnings_of_far_loads(modes)
        return response


def static_displacements(
    model: Model, forces: Floats, processes: Processes | None = None
) -> tuple[Floats, Floats]:
    """Return static displacements, from the user's cache folder if they are there.

    Parameters
    ----------
    model : Model
        The loaded model.
    forces : ndarray of float64, shape (3V, m)
        Forces on the vertices [N].
    processes : Processes, optional
        Processes of a collective run; the first one solves for all.

    Returns
    -------
    displacements : ndarray of float64, shape (3V, m)
        Displacements in m.
    rounding : ndarray of float64, shape (m,)
        Share of each displacement that is rounding error, see `Model.statics`.
    """
    if processes is not None:
        first = processes.make_in_first(lambda: list(static_displacements(model, forces)))
        return first[0], first[1]
    # Entries are for unit modulus, so that they serve every modulus: the displacement scales.
    keys = [f"static-{digest_of(model.digest, np.ascontiguousarray(f))}" for f in forces.T]
    result, rounding = np.empty(forces.shape), np.empty(len(keys))
    missing = []
    for column, key in enumerate(keys):
        entry = cache.load(key, displacement=(len(forces),), rounding=(1,))
        if entry is None or not np.isfinite(entry["displacement"]).all():
            missing.append(column)
        else:
            result[:, column] = entry["displacement"]
            rounding[column] = entry["rounding"][0]
    if missing:
        result[:, missing], rounding[missing] = model.unit_statics(forces[:, missing])
        for column in missing:
            cache.store(
                keys[column], displacement=result[:, column], rounding=rounding[column : column + 1]
            )
    return result / model.modulus, rounding
