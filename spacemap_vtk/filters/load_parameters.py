"""Parameters of a motion under loads (damping, loads, initial state, frames), and its arrays."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonCore import vtkInformation
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, add_number, array_of, vectors_of
from spacemap_vtk.datasets.extent import up_axis
from spacemap_vtk.datasets.modal_model import GRAVITY_IN_FORCE, gravity_of
from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.base import ProvidedArray
from spacemap_vtk.filters.load import Loads, load_vectors
from spacemap_vtk.io import registry
from spacemap_vtk.mechanics.boundary.time_functions import step
from spacemap_vtk.mechanics.elements.kinematics import von_mises
from spacemap_vtk.mechanics.modal.cage_modes import CageModes, LoadVector
from spacemap_vtk.mechanics.modal.damping import Damping, rayleigh
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import (
    Choice,
    Flag,
    Integer,
    Parameter,
    Parameterised,
    Real,
    Series,
    Text,
    Vector,
)
from spacemap_vtk.units import GRAVITY

#: The field arrays of energies.
ENERGIES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
#: The point arrays of a motion.
_MOTION = ("displacement", "velocity", "acceleration")
#: Condition under which strain and stress are computed.
_STRESS = {"stress": (True,)}
#: Damping proportional to mass if no damping is given [1/s].
DEFAULT_ALPHA = 1.0
#: Gravity if none is given and the object does not say which way is up [m/s²].
DOWN = (0.0, 0.0, -GRAVITY)
#: The arrays that `add_motion`, `add_stress` and `add_energies` write.
MOTION_ARRAYS = {
    "displacement": ProvidedArray("point", "m"),
    "velocity": ProvidedArray("point", "m/s"),
    "acceleration": ProvidedArray("point", "m/s2"),
    "strain": ProvidedArray("cell", "", _STRESS),
    "stress": ProvidedArray("cell", "Pa", _STRESS),
    "von_mises": ProvidedArray("cell", "Pa", _STRESS),
    **{name: ProvidedArray("field", "J", {"energy": (True,)}) for name in ENERGIES},
}
#: alpha and beta have an effect only if no damping ratio is given.
_RAYLEIGH = {"damping_ratio": (None,), "damping_pairs": (None,)}


_FREQUENCY = Real(1.0, "", unit="1/s", above=0.0)
_RATIO = Real(0.0, "", minimum=0.0)


class DampingPairs(Parameter[Any]):
    """Two pairs of frequency and damping ratio."""

    kind = "pairs"
    annotation = "sequence of 2 pairs of float"
    expected = 'two pairs of frequency and ratio, as in [["10 Hz", 0.02], ["80 Hz", 0.03]]'

    def convert(self, value: Any) -> tuple[tuple[float, float], ...]:
        """Convert to two pairs of floats, the lower frequency first."""
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise InputError("must be a list of two pairs")
        pairs = []
        for pair in value:
            numbers = tuple(pair) if isinstance(pair, Iterable) else ()
            if isinstance(pair, str) or len(numbers) != 2:
                raise InputError("must be a list of two pairs")
            frequency, ratio = numbers
            pairs.append((_FREQUENCY.convert(frequency), _RATIO.convert(ratio)))
        if len(pairs) != 2:
            raise InputError(f"must be two pairs, not {len(pairs)}")
        return tuple(sorted(pairs))

    def text(self, value: Any) -> str:
        """Format the pairs as in TOML."""
        return str([list(pair) for pair in value])


class DampingRatio(Series):
    """A damping ratio for all modes, one for each, or the name of a text file of ratios."""

    list_meaning = (
        "one for each mode, in order, the last also for all higher modes; or the name of a text "
        "file with one ratio in each line"
    )

    def convert(self, value: Any) -> Any:
        """Convert to a ratio, a tuple of ratios, or a file's path; the file is read when used."""
        return Path(value) if _is_file(value) else super().convert(value)

    def resolve_path(self, value: Any, folder: Path) -> Any:
        """Join the folder and a file's path; return numbers unchanged."""
        return folder / value if _is_file(value) and not self.is_automatic(value) else value

    def text(self, value: Any) -> str:
        """Format the ratios with commas, or the file's path."""
        return str(value) if isinstance(value, Path) else super().text(value)


def _is_file(value: Any) -> bool:
    # A file name contains letters that do not occur in numbers.
    numbers = r"[-+.,%\d\seE]*|[-+]?(nan|inf)"
    return isinstance(value, Path) or (
        isinstance(value, str) and re.fullmatch(numbers, value) is None
    )


class LoadParameters(Parameterised):
    """Parameters of stages that move a cage by loads from t = 0 on."""

    alpha = Real(
        None,
        "Damping proportional to mass; damps all modes at the same rate.",
        unit="1/s",
        minimum=0.0,
        automatic=f"{DEFAULT_ALPHA:g} 1/s; 0 if damping_ratio or damping_pairs is given",
        when=_RAYLEIGH,
    )
    beta = Real(
        0.0,
        "Damping proportional to stiffness; damps mainly the high modes.",
        unit="s",
        minimum=0.0,
        when=_RAYLEIGH,
    )
    damping_ratio = DampingRatio(
        Real(0.0, "Damping ratio of the modes, instead of alpha and beta.", minimum=0.0),
        automatic="alpha and beta are used",
    )
    damping_pairs = DampingPairs(
        None,
        "Two pairs of frequency and damping ratio, from which alpha and beta are computed.",
        automatic="alpha and beta are used",
    )
    gravity = Vector(
        None,
        "Acceleration of gravity from t = 0 on. If automatic, a cage with modal.gravity keeps that "
        "value. A hanging cage moves by the difference between the two.",
        component=Real(0.0, "", unit="m/s2"),
        automatic="modal.gravity, if it is given; otherwise 9.80665 m/s2 down (along -z, or as the "
        "object defines it)",
    )
    loads = Loads((), "Further loads on the cage, each with its time function.")
    initial = Choice(
        "rest",
        "State at t = 0: undeformed, or in equilibrium under the loads.",
        ["rest", "equilibrium"],
    )
    initial_velocity = Vector(
        (0.0, 0.0, 0.0),
        "Velocity at t = 0, except where the cage is fixed.",
        component=Real(0.0, "", unit="m/s"),
    )
    initial_velocity_array = Text(
        "", "Name of a point array of the cage: velocities at t = 0 in m/s, added to the others."
    )
    initial_displacement = Vector(
        (0.0, 0.0, 0.0),
        "Displacement at t = 0, except where the cage is fixed; added to the initial state.",
        component=Real(0.0, "", unit="m"),
    )
    initial_displacement_array = Text(
        "", "Name of a point array of the cage: displacements at t = 0 in m, added to the others."
    )
    stress = Flag(True, "Compute strain and stress of each tetrahedron.")
    energy = Flag(True, "Compute kinetic, strain and dissipated energy, and external work.")
    duration = Real(
        10.0,
        "Length of the time range that is offered to players; later times are possible, too.",
        unit="s",
        above=0.0,
    )
    frames = Integer(
        101,
        "Number of evenly spaced time steps from 0 to the duration that are offered to other "
        "programs; times in between are possible, too. With 0 only the range is offered, and "
        "ParaView writes one time. A film of a scene has the frames of its animation instead.",
        minimum=0,
        maximum=100_000,
    )

    def check(self) -> None:
        """Check that the damping is given only once."""
        _ = self.damping

    @property
    def damping(self) -> Damping:
        """Damping of the modes, from the four parameters for it."""
        ways = [
            name for name in ("damping_ratio", "damping_pairs") if getattr(self, name) is not None
        ]
        ways += [name for name in ("alpha", "beta") if ways and self._contradicts(name)]
        if len(ways) > 1:
            raise InputError(
                f"{ways[0]} and {ways[1]} both define the damping",
                key=ways[0],
                value=getattr(self, ways[0]),
                cure=f"Leave out {ways[0]} or {ways[1]}"
                + (f" (or set {ways[1]} = 0)." if ways[1] in ("alpha", "beta") else "."),
            )
        if not ways:
            return Damping(DEFAULT_ALPHA if self.alpha is None else self.alpha, self.beta)
        try:
            if self.damping_pairs is not None:
                return rayleigh(self.damping_pairs)
            ratio = self.damping_ratio
            if isinstance(ratio, Path):
                ratio = type(self).damping_ratio.convert(registry.read(ratio, "column"))
            return Damping(ratio=ratio)
        except InputError as error:
            error.key, error.value = ways[0], getattr(self, ways[0])
            raise

    def disabled_by(self, name: str) -> str:
        """Return why a parameter has no effect; empty if `damping` refuses it instead."""
        return "" if self._contradicts(name) else super().disabled_by(name)

    def _contradicts(self, name: str) -> bool:
        # A value of zero contradicts nothing.
        return name in ("alpha", "beta") and bool(getattr(self, name))

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float]:
        """Return the first and last time."""
        return 0.0, self.duration

    def time_steps(self, inputs: list[vtkInformation]) -> list[float]:
        """Return the times of the frames; without them ParaView would write only one time step."""
        return [float(t) for t in np.linspace(0.0, self.duration, self.frames)]

    def gravity_for(self, grid: vtkUnstructuredGrid) -> Floats:
        """Return the gravity from t = 0 on [m/s²], (3,): as given, or that of the solver."""
        field, up, in_use = grid.GetFieldData(), up_axis(grid), {}
        if self.alpha is None and self.damping_ratio is None and self.damping_pairs is None:
            in_use["alpha"] = DEFAULT_ALPHA
        gravity = self.gravity
        if gravity is None:
            if field.HasArray(GRAVITY_IN_FORCE):
                gravity = tuple(array_of(field, GRAVITY_IN_FORCE, "the modes").ravel().tolist())
            else:
                gravity = DOWN if up is None else tuple((-GRAVITY * np.eye(3)[up] + 0.0).tolist())
            in_use["gravity"] = gravity
        self.values_in_use = in_use
        return np.array(gravity)

    def load_vectors(self, grid: vtkUnstructuredGrid, modes: CageModes) -> list[LoadVector]:
        """Return the loads in addition to those of the equilibrium."""
        # The equilibrium of a hanging cage already contains its gravity and its dead loads.
        more = self.gravity_for(grid) - gravity_of(grid)
        vectors = [modes.load_vector("gravity", more, step())] if more.any() else []
        return vectors + load_vectors(modes, grid, self.loads, "loads")

    def initial_fields(self, grid: vtkUnstructuredGrid) -> tuple[Floats, Floats]:
        """Return what is added to displacement and velocity at t = 0, both (V, 3)."""
        displacement = self._initial_field(
            grid, self.initial_displacement, "displacement", self.initial_displacement_array
        )
        velocity = self._initial_field(
            grid, self.initial_velocity, "velocity", self.initial_velocity_array
        )
        return displacement, velocity

    def warnings_of_far_loads(self, modes: CageModes) -> list[str]:
        """Return a warning for each load that acts at a point outside the cage."""
        return [
            f"loads[{number}] acts at a point {distance:.3g} m away from the cage; it is applied "
            "to the nearest vertex"
            for number, load in enumerate(self.loads)
            if load.at is not None and (distance := modes.distance_outside(load.at))
        ]

    def _initial_field(
        self, grid: vtkUnstructuredGrid, everywhere: tuple[float, ...], what: str, array: str
    ) -> Floats:
        field = np.tile(np.array(everywhere, np.float64), (grid.GetNumberOfPoints(), 1))
        if array:
            with add_key_to_errors(f"initial_{what}_array"):
                field += vectors_of(grid.GetPointData(), array, len(field), type(self).__name__)
        return field


def add_motion(output: vtkUnstructuredGrid, fields: Iterable[Floats]) -> None:
    """Write displacement, velocity and acceleration, (V, 3) each."""
    points = output.GetPointData()
    for name, field in zip(_MOTION, fields, strict=True):
        add_array(points, name, field)


def add_stress(output: vtkUnstructuredGrid, strain: Floats, stress: Floats) -> None:
    """Write strain and stress of each tetrahedron, both (T, 6)."""
    cells = output.GetCellData()
    # VTK's order. Its shear strains are those of a tensor, half the engineering strains.
    order = [0, 1, 2, 5, 3, 4]
    add_array(cells, "strain", strain[:, order] * [1, 1, 1, 0.5, 0.5, 0.5])
    add_array(cells, "stress", stress[:, order])
    add_array(cells, "von_mises", von_mises(stress))


def add_energies(output: vtkUnstructuredGrid, energies: Sequence[float] | Floats) -> None:
    """Write kinetic, strain and dissipated energy, and external work [J]."""
    field = output.GetFieldData()
    for name, value in zip(ENERGIES, energies, strict=True):
        add_number(field, name, value)
