"""ModalResponse: the cage's displacement at any time, as a closed-form sum over modes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkInformation
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import cache
from spacemap_vtk.datasets.arrays import add_array, array_of, vectors_of
from spacemap_vtk.datasets.modal_model import GRAVITY_IN_FORCE, ModesReader, gravity_in
from spacemap_vtk.datasets.processes import Processes
from spacemap_vtk.errors import InputError, naming
from spacemap_vtk.filters.base import Provided, Stage
from spacemap_vtk.filters.load import Loads, load_vectors
from spacemap_vtk.io import registry
from spacemap_vtk.mechanics.cage_modes import CageModes
from spacemap_vtk.mechanics.damping import Damping, rayleigh
from spacemap_vtk.mechanics.kinematics import (
    LARGE_ROTATION,
    largest_rotation,
    symmetric_tensors,
    von_mises,
)
from spacemap_vtk.mechanics.mesh_pencil import digest_of
from spacemap_vtk.mechanics.model import Model
from spacemap_vtk.mechanics.response import Response
from spacemap_vtk.mechanics.timefunctions import step
from spacemap_vtk.parameters import Choice, Flag, Integer, Parameter, Real, Series, Text, Vector

FloatArray = NDArray[np.float64]

#: The field arrays of energies.
ENERGIES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
#: What is there only where it is computed.
_STRESS = {"stress": (True,)}
#: alpha and beta damp where no ratio is asked for.
_RAYLEIGH = {"damping_ratio": (None,), "damping_pairs": (None,)}


_FREQUENCY = Real(1.0, "", unit="1/s", above=0.0)
_RATIO = Real(0.0, "", minimum=0.0)


class DampingPairs(Parameter[Any]):
    """Two pairs of frequency and damping ratio."""

    kind = "pairs"
    annotation = "sequence of 2 pairs of float"
    form = 'two pairs of frequency and ratio, as in [["10 Hz", 0.02], ["80 Hz", 0.03]]'

    def convert(self, value: Any) -> tuple[tuple[float, float], ...]:
        """Return two pairs of floats, the lower frequency first."""
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise InputError("not a list of pairs")
        pairs = []
        for pair in value:
            numbers = tuple(pair) if isinstance(pair, Iterable) else ()
            if isinstance(pair, str) or len(numbers) != 2:
                raise InputError("not a list of pairs")
            frequency, ratio = numbers
            pairs.append((_FREQUENCY.convert(frequency), _RATIO.convert(ratio)))
        if len(pairs) != 2:
            raise InputError(f"{len(pairs)} pairs in place of 2")
        return tuple(sorted(pairs))

    def text(self, value: Any) -> str:
        """Return TOML's spelling."""
        return str([list(pair) for pair in value])


class DampingRatio(Series):
    """A damping ratio for all modes, one for each, or the name of a text file with these."""

    each = (
        "one for each mode from mode 0 on, the last for all that follow; or the name of a text "
        "file with one ratio in each line"
    )

    def convert(self, value: Any) -> Any:
        """Return a ratio, a tuple of several, or the path of a file, read when it is used."""
        return Path(value) if _is_file(value) else super().convert(value)

    def within(self, value: Any, folder: Path) -> Any:
        """Return a file's path, from the folder on; numbers as they are."""
        return folder / value if _is_file(value) and not self.is_automatic(value) else value

    def text(self, value: Any) -> str:
        """Return the ratios with commas, or the file."""
        return str(value) if isinstance(value, Path) else super().text(value)


def _is_file(value: Any) -> bool:
    # What has letters, but for those that numbers have.
    numbers = r"[-+.,%\d\seE]*|[-+]?(nan|inf)"
    return isinstance(value, Path) or (
        isinstance(value, str) and re.fullmatch(numbers, value) is None
    )


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
    damping_ratio = DampingRatio(
        Real(0.0, "Damping ratio of the modes, in place of alpha and beta.", minimum=0.0),
        automatic="alpha and beta damp",
    )
    damping_pairs = DampingPairs(
        None,
        "Two pairs of frequency and damping ratio, from which alpha and beta are made.",
        automatic="alpha and beta damp",
    )
    gravity = Vector(
        (0.0, 0.0, -9.80665),
        "Acceleration of gravity, there from t = 0 on. A cage with modal.gravity goes on under "
        "that where this is the default; where it hangs and this is another, it moves by the "
        "difference.",
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

    _modes: ModesReader | None = None
    _kept_motion: tuple[tuple[int, int], Response] | None = None

    def check(self) -> None:
        """Check how much is damped."""
        _ = self.damping

    @property
    def damping(self) -> Damping:
        """What damps the modes, out of the four parameters that say so.

        Raises
        ------
        InputError
            If two of them contradict each other, or a file has no ratios.
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
        if (ratio := self.damping_ratio) is not None:
            try:
                if isinstance(ratio, Path):
                    ratio = type(self).damping_ratio.convert(registry.read(ratio, "column"))
                return Damping(ratio=ratio)
            except InputError as error:
                error.key, error.value = "damping_ratio", self.damping_ratio
                raise
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

    @property
    def motion(self) -> Response | None:
        """The motion as of the last update; None before."""
        return None if self._kept_motion is None else self._kept_motion[1]

    def gravity_on(self, grid: vtkUnstructuredGrid) -> FloatArray:
        """Return the gravity from t = 0 on [m/s²], (3,): as given, or the solver's own.

        Parameters
        ----------
        grid : vtkUnstructuredGrid
            The cage.

        Returns
        -------
        ndarray of float64, shape (3,)
            In m/s².
        """
        # The default is no one's wish, and ParaView's users write three numbers.
        field = grid.GetFieldData()
        if field.HasArray(GRAVITY_IN_FORCE) and "gravity" not in self._values:
            return array_of(field, GRAVITY_IN_FORCE, "the modes")
        return np.array(self.gravity)

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Evaluate the sum at `time`; before t = 0 the initial state holds, at rest."""
        grid = inputs[0]
        if self._modes is None:
            self._modes = ModesReader()
        modes = self._modes.read(grid)
        # The motion does not depend on the time asked for.
        key = grid.GetMTime(), self.GetMTime()
        if self._kept_motion is None or self._kept_motion[0] != key:
            self._kept_motion = key, self._response(grid, modes)
        motion = self._kept_motion[1]
        state = motion.modal.at(time)
        displacement, velocity, acceleration = motion.at(time, state)
        for text in motion.warnings:
            self.warn(text)
        rest = modes.model.displacement
        moved = displacement if rest is None else displacement - rest
        gradients = modes.gradient.of(moved)
        turned, self.turned = self.turned, False  # whoever comes next may not turn it
        if not turned and largest_rotation(gradients) > LARGE_ROTATION:
            self.warn(
                f"the cage turns by more than {np.degrees(LARGE_ROTATION):.0f} degrees; a linear "
                "model stretches what turns: put RotationStrain behind it (a section [rotation]), "
                "lower the load or raise the modulus to trust the shape"
            )
        output.ShallowCopy(grid)
        data = output.GetPointData()
        add_array(data, "displacement", displacement)
        add_array(data, "velocity", velocity)
        add_array(data, "acceleration", acceleration)
        field = output.GetFieldData()
        add_array(field, "modal_coordinates", state.position[: len(modes.eigenvalues)].copy())
        if self.stress:
            strain, stress = modes.strained(moved, gradients)
            cells = output.GetCellData()
            add_array(cells, "strain", symmetric_tensors(strain, engineering=True))
            add_array(cells, "stress", symmetric_tensors(stress, engineering=False))
            add_array(cells, "von_mises", von_mises(stress))
        if self.energy:
            energies = motion.energy(time, state)
            if np.isnan(energies.work):
                self.warn(
                    "so many periods have passed that the work of the loads is not added up: "
                    "dissipated_energy and external_work are not a number; take an earlier time, "
                    "or longer periods"
                )
            for name, value in zip(ENERGIES, energies, strict=True):
                add_array(field, name, np.array([value]))

    def _response(self, grid: vtkUnstructuredGrid, modes: CageModes) -> Response:
        # A cage that hangs has its gravity, and its dead loads, in its equilibrium.
        more = self.gravity_on(grid) - gravity_in(grid)
        vectors = [modes.vector("gravity", more, step())] if more.any() else []
        vectors += load_vectors(modes, grid, self.loads, "loads")
        displacement, velocity = (
            self._start(grid, *given)
            for given in (
                (self.initial_displacement, "displacement", self.initial_displacement_array),
                (self.initial_velocity, "velocity", self.initial_velocity_array),
            )
        )
        made = Response(
            modes,
            vectors,
            self.damping,
            equilibrium=self.initial == "equilibrium",
            displacement=displacement,
            velocity=velocity,
            residual=self.residual_vectors,
            statics=partial(static_displacements, modes.model, processes=self._processes),
        )
        made.warnings += [
            f"loads[{number}] acts at a point that is {distance:.3g} m away from the cage, and so "
            "on the vertex nearest to it"
            for number, load in enumerate(self.loads)
            if load.at is not None and (distance := modes.away(load.at))
        ]
        return made

    def _start(
        self, grid: vtkUnstructuredGrid, everywhere: tuple[float, ...], what: str, array: str
    ) -> FloatArray:
        field = np.tile(np.array(everywhere, np.float64), (grid.GetNumberOfPoints(), 1))
        if array:
            field += self._vectors(grid, f"initial_{what}_array", array)
        return field

    def _vectors(self, grid: vtkUnstructuredGrid, key: str, name: str) -> FloatArray:
        with naming(key):
            return vectors_of(grid.GetPointData(), name, grid.GetNumberOfPoints(), "ModalResponse")


def static_displacements(
    model: Model, forces: FloatArray, processes: Processes | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return static displacements, from the user's cache folder where they were solved before.

    Parameters
    ----------
    model : Model
        What is loaded.
    forces : ndarray of float64, shape (3V, m)
        Forces on the vertices [N].
    processes : Processes, optional
        Those of which the first solves for all.

    Returns
    -------
    displacements : ndarray of float64, shape (3V, m)
        In m.
    rounding : ndarray of float64, shape (m,)
        The share of each that is rounding, see `Model.statics`.
    """
    if processes is not None:
        first = processes.from_first(lambda: list(static_displacements(model, forces)))
        return first[0], first[1]
    # For the unit modulus: another one changes neither the entry nor, but for its size, the answer.
    keys = [f"static-{digest_of(model.digest, np.ascontiguousarray(f))}" for f in forces.T]
    result, rounding = np.empty(forces.shape), np.empty(len(keys))
    missing = []
    for column, key in enumerate(keys):
        entry = cache.load(key) or {}
        kept, share = entry.get("displacement"), entry.get("rounding")
        if (
            kept is None
            or share is None
            or kept.shape != (len(forces),)
            or share.shape != (1,)
            or not kept.dtype == share.dtype == np.float64
        ):
            missing.append(column)
        else:
            result[:, column], rounding[column] = kept / model.modulus, share[0]
    if missing:
        result[:, missing], rounding[missing] = model.statics(forces[:, missing])
        for column in missing:
            cache.store(
                keys[column],
                displacement=result[:, column] * model.modulus,
                rounding=rounding[column : column + 1],
            )
    return result, rounding
