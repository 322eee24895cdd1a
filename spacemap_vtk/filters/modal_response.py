"""ModalResponse: the cage's displacement at any time, as a closed-form sum over modes."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkInformation
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, vectors_of
from spacemap_vtk.errors import InputError, naming
from spacemap_vtk.filters.base import Provided, Stage
from spacemap_vtk.filters.cage_modes import Basis, CageModes, LoadVector
from spacemap_vtk.filters.load import Loads
from spacemap_vtk.filters.modal_model import rounding_of
from spacemap_vtk.filters.response_parameters import DampingPairs
from spacemap_vtk.mechanics.damping import Damping, rayleigh
from spacemap_vtk.mechanics.energy import Account
from spacemap_vtk.mechanics.harmonic import steady
from spacemap_vtk.mechanics.kinematics import LARGE_ROTATION, largest_rotation, strains
from spacemap_vtk.mechanics.motion import Drive, Motion, State
from spacemap_vtk.mechanics.oscillator import LOST
from spacemap_vtk.mechanics.stress import symmetric_tensors, von_mises
from spacemap_vtk.mechanics.timefunctions import step
from spacemap_vtk.parameters import Choice, Flag, Integer, Real, Text, Vector

FloatArray = NDArray[np.float64]

#: A static shape is warned of where rounding is more than this share of it.
ROUNDING = 1e-4

#: Share of the movable mass that the kept modes should hold along an axis with a load.
ENOUGH = 0.9


#: The field arrays of energies.
ENERGIES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
#: What is there only where it is computed.
_STRESS = {"stress": (True,)}
#: alpha and beta damp where no ratio is asked for.
_RAYLEIGH = {"damping_ratio": (None,), "damping_pairs": (None,)}


class ModalResponse(Stage):
    """Move a cage by its vibration modes, at any time, without stepping.

    The motion is a sum of closed-form responses of single oscillators, one for each mode: under-,
    critically and overdamped and rigid ones. Gravity is a step at t = 0; other loads each have
    their own time function. A residual vector for each load makes the static response exact,
    whatever number of modes is kept.

    The output has the point arrays ``displacement``, ``velocity`` and ``acceleration``; the cell
    arrays ``strain`` and ``stress`` (mean of each tetrahedron, in the axes of the fabric: x weft,
    y warp, z normal; VTK's order xx, yy, zz, xy, yz, xz) and ``von_mises``; and the field arrays
    ``modal_coordinates``, ``kinetic_energy``, ``strain_energy``, ``dissipated_energy`` and
    ``external_work`` (J, in coordinates relative to a moving base), of which the last is the sum
    of the three before.

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
    provides: ClassVar = {
        "displacement": Provided("point", "m"),
        "velocity": Provided("point", "m/s"),
        "acceleration": Provided("point", "m/s2"),
        "strain": Provided("cell", "", _STRESS),
        "stress": Provided("cell", "Pa", _STRESS),
        "von_mises": Provided("cell", "Pa", _STRESS),
        "modal_coordinates": Provided("field"),
        **{name: Provided("field", "J", {"energy": (True,)}) for name in ENERGIES},
    }
    whole_inputs = (0,)
    replicated = True

    alpha = Real(
        1.0,
        "Damping proportional to mass; slows every mode alike.",
        unit="1/s",
        minimum=0.0,
        when=_RAYLEIGH,
    )
    beta = Real(
        0.0,
        "Damping proportional to stiffness; stills the high modes.",
        unit="s",
        minimum=0.0,
        when=_RAYLEIGH,
    )
    damping_ratio = Real(
        None,
        "One damping ratio for all modes, in place of alpha and beta.",
        minimum=0.0,
        automatic="alpha and beta damp",
    )
    damping_pairs = DampingPairs(
        None,
        "Two pairs of frequency and damping ratio, from which alpha and beta are made.",
        automatic="alpha and beta damp",
    )
    gravity = Vector(
        (0.0, 0.0, -9.80665),
        "Acceleration of gravity, there from t = 0 on.",
        component=Real(0.0, "", unit="m/s2"),
    )
    loads = Loads((), "What else acts on the cage, each with its time function.")
    initial = Choice(
        "rest",
        "State at t = 0: undeformed, or already hanging at rest under the loads.",
        ["rest", "equilibrium"],
    )
    initial_velocity = Vector(
        (0.0, 0.0, 0.0),
        "Velocity at t = 0 of all that is not fixed.",
        component=Real(0.0, "", unit="m/s"),
    )
    initial_velocity_array = Text(
        "", "Name of a point array of the cage: velocities in m/s at t = 0, added to the others."
    )
    initial_displacement = Vector(
        (0.0, 0.0, 0.0),
        "Displacement at t = 0 of all that is not fixed, added to the initial state.",
        component=Real(0.0, "", unit="m"),
    )
    initial_displacement_array = Text(
        "", "Name of a point array of the cage: displacements in m at t = 0, added to the others."
    )
    residual_vectors = Flag(
        True, "Add to the modes what they miss of the static response to each load."
    )
    stress = Flag(True, "Compute strain and stress of each tetrahedron.")
    energy = Flag(True, "Compute kinetic, strain and dissipated energy, and external work.")
    duration = Real(
        10.0,
        "Length of the time range reported to players; any later time can be asked for too.",
        unit="s",
        above=0.0,
    )
    frames = Integer(
        101,
        "Number of time steps, evenly from 0 to the duration, that players and writers of other "
        "programs are offered; any time in between can be asked for too. The frames of a scene's "
        "own film are those of its animation.",
        minimum=2,
        maximum=100_000,
    )

    _kept_modes: tuple[int, CageModes] | None = None
    _kept_motion: tuple[tuple[int, int], _Prepared] | None = None

    def check(self) -> None:
        """Check how much is damped."""
        _ = self.damping

    @property
    def damping(self) -> Damping:
        """What damps the modes, out of the four parameters that say so.

        Raises
        ------
        InputError
            If two of them contradict each other.
        """
        ways = [
            name for name in ("damping_ratio", "damping_pairs") if getattr(self, name) is not None
        ]
        # The default alpha is no one's wish, and an alpha of zero contradicts nothing.
        ways += [name for name in ("alpha", "beta") if self._values.get(name) and ways]
        if len(ways) > 1:
            raise InputError(
                f"{ways[0]} and {ways[1]} both say how much is damped",
                key=ways[0],
                value=getattr(self, ways[0]),
                cure=f"Leave out {ways[0]} or {ways[1]}"
                + (f" ({ways[1]} = 0 does that, too)." if ways[1] in ("alpha", "beta") else "."),
            )
        if self.damping_ratio is not None:
            return Damping(ratio=self.damping_ratio)
        if self.damping_pairs is not None:
            try:
                return rayleigh(self.damping_pairs)
            except InputError as error:
                error.key, error.value = "damping_pairs", self.damping_pairs
                raise
        return Damping(self.alpha, self.beta)

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float]:
        """Return the continuous range of times."""
        return 0.0, self.duration

    def time_steps(self, inputs: list[vtkInformation]) -> list[float]:
        """Return the times of the frames, without which ParaView would write one step only."""
        return [float(t) for t in np.linspace(0.0, self.duration, self.frames)]

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Evaluate the sum at `time`; before t = 0 the initial state holds."""
        modes = self._modes(inputs[0])
        prepared = self._motion(inputs[0])
        state = prepared.motion.at(time)
        displacement, velocity, acceleration = prepared.fields(state, max(time, 0.0))
        for text in prepared.warnings:
            self.warn(text)
        gradients = modes.gradient.of(displacement)
        if largest_rotation(gradients) > LARGE_ROTATION:
            self.warn(
                f"the cage turns by more than {np.degrees(LARGE_ROTATION):.0f} degrees; a linear "
                "model stretches what turns: lower the load or raise the modulus to trust the shape"
            )
        output.ShallowCopy(inputs[0])
        data = output.GetPointData()
        add_array(data, "displacement", displacement)
        add_array(data, "velocity", velocity)
        add_array(data, "acceleration", acceleration)
        field = output.GetFieldData()
        add_array(field, "modal_coordinates", state.position[: len(modes.eigenvalues)].copy())
        if self.stress:
            strain = strains(gradients)
            stress = strain @ modes.model.elasticity
            cells = output.GetCellData()
            add_array(cells, "strain", symmetric_tensors(strain, engineering=True))
            add_array(cells, "stress", symmetric_tensors(stress, engineering=False))
            add_array(cells, "von_mises", von_mises(stress))
        if self.energy:
            energies = prepared.account.at(time, state)
            if np.isnan(energies.work):
                self.warn(
                    "so many periods have passed that the work of the loads is not added up: "
                    "dissipated_energy and external_work are not a number; take an earlier time, "
                    "or longer periods"
                )
            for name, value in zip(ENERGIES, energies, strict=True):
                add_array(field, name, np.array([value]))

    def history(self, weights: FloatArray, times: FloatArray) -> FloatArray:
        """Return how a point moves over time; call `update` before.

        Parameters
        ----------
        weights : ndarray of float64, shape (V,)
            Of the vertices in the point's displacement, see `CageModes.weights`.
        times : ndarray of float64, shape (t,)
            In s.

        Returns
        -------
        ndarray of float64, shape (3, t, 3)
            Displacement [m], velocity [m/s] and acceleration [m/s²] along x, y and z.
        """
        assert self._kept_motion is not None, "not updated yet"
        prepared = self._kept_motion[1]
        # The point is a mesh of one vertex.
        point = prepared.at_point(weights)
        return np.stack([point.fields(prepared.motion.at(t), t)[:, 0] for t in times], axis=1)

    def energies(self, times: FloatArray) -> FloatArray:
        """Return where the energy is over time; call `update` before.

        Parameters
        ----------
        times : ndarray of float64, shape (t,)
            In s.

        Returns
        -------
        ndarray of float64, shape (t, 4)
            Kinetic, strain and dissipated energy, and their sum, the external work [J].
        """
        assert self._kept_motion is not None, "not updated yet"
        account = self._kept_motion[1].account
        return np.array([account.at(t) for t in times]).reshape(-1, 4)

    def frequency_response(self, weights: FloatArray, frequencies: FloatArray) -> NDArray[Any]:
        """Return how a point answers to the loads as sines, all in phase; call `update` before.

        Parameters
        ----------
        weights : ndarray of float64, shape (V,)
            Of the vertices in the point's displacement.
        frequencies : ndarray of float64, shape (f,)
            Of the sines [Hz], above 0; loads have the sizes that they have, with factor 1.

        Returns
        -------
        ndarray of complex128, shape (f, 3)
            Displacement [m], its size and phase along x, y and z.

        Raises
        ------
        InputError
            If an undamped mode is met at its own frequency.
        """
        assert self._kept_motion is not None, "not updated yet"
        prepared = self._kept_motion[1]
        motion = prepared.motion
        point = prepared.at_point(weights).basis.shapes
        result = np.zeros((len(frequencies), 3), dtype=np.complex128)
        for row, omega in enumerate(2 * np.pi * np.asarray(frequencies)):
            receptance = steady(motion.stiffness, motion.half, omega)
            for drive, vector in zip(motion.drives, prepared.vectors, strict=True):
                factor = omega**2 if drive.moves_base else 1.0
                result[row] += (receptance * drive.gain * factor) @ point
                if vector.moves_base is not None:
                    result[row] += vector.moves_base * weights.sum()
        return result

    def cage_modes(self) -> CageModes:
        """Return what is known of the cage's modes; call `update` before.

        Returns
        -------
        CageModes
            Effective masses among other things.
        """
        assert self._kept_modes is not None, "not updated yet"
        return self._kept_modes[1]

    def _modes(self, grid: vtkUnstructuredGrid) -> CageModes:
        changed = grid.GetMTime()
        if self._kept_modes is None or self._kept_modes[0] != changed:
            former = None if self._kept_modes is None else self._kept_modes[1]
            self._kept_modes = changed, CageModes(grid, former)
        return self._kept_modes[1]

    def _motion(self, grid: vtkUnstructuredGrid) -> _Prepared:
        """Return the motion, which does not depend on the time asked for."""
        key = grid.GetMTime(), self.GetMTime()
        if self._kept_motion is None or self._kept_motion[0] != key:
            self._kept_motion = key, self._prepared(grid, self._modes(grid))
        return self._kept_motion[1]

    def _prepared(self, grid: vtkUnstructuredGrid, modes: CageModes) -> _Prepared:
        lost = int((rounding_of(grid) > LOST).sum())
        if self.initial == "equilibrium" and lost:
            raise InputError(
                f"rounding leaves no digit of {lost} of the cage's modes, and so none of its shape "
                "at rest",
                key="initial",
                value=self.initial,
                cure='Take a thicker cage, fewer divisions or more modes, or start from "rest".',
            )
        vectors = [modes.gravity(self.gravity, step())] if any(self.gravity) else []
        for number, load in enumerate(self.loads):
            try:
                vectors.append(modes.vector(load))
            except InputError as error:
                error.key = (error.key or "loads").replace("loads", f"loads[{number}]", 1)
                raise
        basis = modes.basis(vectors, self.residual_vectors, self._processes)
        drives = [
            Drive(basis.shapes @ modes.force(p), p.function, p.moves_base is not None)
            for p in vectors
        ]
        warnings = self._truncation(modes, vectors)
        if (share := modes.rounding(vectors)) > ROUNDING:
            digits = int(-np.log10(share))
            warnings.append(
                f"about {digits} digit{'s' * (digits != 1)} of the shape at rest hold: the cage "
                "resists bending by so much less than stretching that the rest is rounding; take "
                "fewer divisions, linear tetrahedra or a thicker cage to trust more"
            )
        free = modes.model.free
        warnings += [
            "a load falls on fixed vertices only, and moves nothing"
            for force in map(modes.force, vectors)
            if force.any() and not force[free].any()
        ]
        warnings += [
            f"loads[{number}] acts at a point that is {distance:.3g} m away from the cage, and so "
            "on the vertex nearest to it"
            for number, load in enumerate(self.loads)
            if load.at is not None and (distance := modes.away(load.at))
        ]
        start: dict[str, FloatArray] = {}
        for name, what in (("position", "displacement"), ("rate", "velocity")):
            field = self._start_field(grid, modes, f"initial_{what}")
            if field.any():
                inertia = modes.model.mass @ field
                start[name] = basis.shapes @ inertia
                missed = 1.0 - float(start[name] @ start[name]) / float(field @ inertia)
                if missed > 1.0 - ENOUGH:
                    warnings.append(
                        f"the modes miss {missed:.0%} of the initial {what}; raise their number"
                    )
        motion = Motion(
            basis.eigenvalues,
            self.damping.halves(basis.eigenvalues),
            drives,
            equilibrium=self.initial == "equilibrium",
            position=start.get("position"),
            rate=start.get("rate"),
        )
        return _Prepared(motion, basis, vectors, warnings)

    def _start_field(
        self,
        grid: vtkUnstructuredGrid,
        modes: CageModes,
        key: str,
    ) -> FloatArray:
        field = np.tile(getattr(self, key), (len(modes.nodal_mass), 1)).astype(np.float64)
        array = getattr(self, f"{key}_array")
        if array:
            with naming(f"{key}_array"):
                field += vectors_of(grid.GetPointData(), array, len(field), "ModalResponse")
        return field.ravel() * modes.model.free

    def _truncation(self, modes: CageModes, vectors: list[LoadVector]) -> list[str]:
        """Say along which loaded axes the modes hold too little of the mass."""
        if modes.complete:
            return []
        held = modes.effective_masses.sum(axis=0) / modes.movable_mass
        return [
            f"the {len(modes.eigenvalues)} modes hold {share:.0%} of the mass along {axis}, where "
            "it is loaded; raise modal.modes to trust how fast it moves"
            + (" (where it comes to rest is exact)" if self.residual_vectors else "")
            for share, axis, loaded in zip(held, "xyz", modes.loaded_axes(vectors), strict=True)
            if loaded and share < ENOUGH
        ]


class _Prepared:
    """A motion, and the shapes it is a motion of."""

    def __init__(
        self, motion: Motion, basis: Basis, vectors: list[LoadVector], warnings: list[str]
    ) -> None:
        self.motion, self.basis, self.vectors = motion, basis, vectors
        self.warnings = warnings
        self._account: Account | None = None

    @property
    def account(self) -> Account:
        """Its energies."""
        if self._account is None:
            self._account = Account(self.motion)
        return self._account

    def at_point(self, weights: FloatArray) -> _Prepared:
        """Return the same for one point, with shapes of three components."""
        shapes = self.basis.shapes.reshape(len(self.motion.stiffness), -1, 3)
        point = np.einsum("nvc,v->nc", shapes, weights)
        return _Prepared(self.motion, Basis(self.basis.eigenvalues, point), self.vectors, [])

    def fields(self, state: State, time: float) -> FloatArray:
        """Return displacement, velocity and acceleration of the vertices, (3, V, 3)."""
        fields: FloatArray = (np.stack(state) @ self.basis.shapes).reshape(3, -1, 3)
        for vector in self.vectors:
            if vector.moves_base is not None:
                function = vector.function
                value = function.value(time)
                fields[0] += value * vector.moves_base
                fields[1] += function.slope(time) * vector.moves_base
                # Of a sine; a linear piece has none.
                curvature = -(getattr(function, "omega", 0.0) ** 2) * value
                fields[2] += curvature * vector.moves_base
        return fields
