"""What ModalResponse keeps of ModalSolver's output: modes, loads on them, residual vectors."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import array_of, vectors_of
from spacemap_vtk.datasets.processes import Processes
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.load import Load
from spacemap_vtk.filters.modal_model import model_of, static_displacements
from spacemap_vtk.filters.modal_solver import MODE_NAME
from spacemap_vtk.mechanics import loads as forces
from spacemap_vtk.mechanics.elements import shape_functions
from spacemap_vtk.mechanics.kinematics import MeanGradient
from spacemap_vtk.mechanics.model import Model
from spacemap_vtk.mechanics.residual_vectors import participation, residual_modes
from spacemap_vtk.mechanics.timefunctions import TimeFunction
from spacemap_vtk.units import format_quantity

FloatArray = NDArray[np.float64]

_OWNER = "ModalResponse (put a ModalSolver before it)"


class LoadVector(NamedTuple):
    """Forces on the vertices, with their factor over time."""

    parts: tuple[tuple[str, float], ...]
    """Name and size of each elementary vector that it is a sum of."""
    function: TimeFunction
    """The factor."""
    moves_base: FloatArray | None = None
    """The displacement of the base [m], for which the vector is the mass times it."""


class Basis(NamedTuple):
    """The shapes that a cage moves in."""

    eigenvalues: FloatArray
    """(n + k,): of the modes and of the residual vectors."""
    shapes: FloatArray
    """(n + k, 3V)."""


#: Share of a cage's diagonal by which a load may miss it.
FAR = 0.05


class CageModes:
    """The modes of a cage, and whatever follows from them without a load's time function."""

    # Elementary vectors (gravity along an axis, a unit traction on a side, …) and their static
    # solutions are kept by name, so that another size of a load solves nothing.

    def __init__(self, grid: vtkUnstructuredGrid, former: CageModes | None = None) -> None:
        data = grid.GetPointData()
        self.eigenvalues: FloatArray = array_of(grid.GetFieldData(), "eigenvalues", _OWNER)
        names = [MODE_NAME.format(k) for k in range(len(self.eigenvalues))]
        self._arrays = [data.GetArray(name) for name in names]
        self._times = [array.GetMTime() for array in self._arrays if array is not None]
        if former is not None and self._same_modes(former):
            self.shapes: FloatArray = former.shapes
        else:
            shapes = [array_of(data, name, _OWNER) for name in names]
            self.shapes = np.stack(shapes).reshape(len(shapes), -1)
        self.nodal_mass: FloatArray = array_of(data, "nodal_mass", _OWNER)
        self.model: Model = model_of(grid)
        self._grid = data
        self._forces: dict[str, FloatArray] = {}
        self._statics: dict[str, FloatArray] = {}
        self._rounding: dict[str, float] = {}
        self._bases: dict[tuple[str, ...], Basis] = {}

    def _same_modes(self, former: CageModes) -> bool:
        # One by one: VTK's arrays compare as numpy's do.
        return (
            len(self._arrays) == len(former._arrays)
            and self._times == former._times
            and all(a is b for a, b in zip(self._arrays, former._arrays, strict=True))
        )

    def away(self, place: ArrayLike) -> float:
        """Return how far a place is from the cage's bounding box."""
        low, high = self.model.points.min(axis=0), self.model.points.max(axis=0)
        where = np.asarray(place, dtype=np.float64)
        distance = float(np.linalg.norm(where - where.clip(low, high)))
        return distance if distance > FAR * np.linalg.norm(high - low) else 0.0

    @property
    def complete(self) -> bool:
        """Whether these are all modes there are."""
        return len(self.eigenvalues) >= int(self.model.free.sum())

    @cached_property
    def gradient(self) -> MeanGradient:
        """Displacements to their gradient in each tetrahedron."""
        return MeanGradient(self.model.points, self.model.cells)

    @cached_property
    def effective_masses(self) -> FloatArray:
        """Of each mode along x, y and z [kg], (n, 3)."""
        return participation(self.shapes, self.nodal_mass) ** 2

    @cached_property
    def movable_mass(self) -> FloatArray:
        """What the effective masses of all modes sum to, (3,) in kg."""
        return self.model.movable_mass

    def vector(self, load: Load) -> LoadVector:
        """Return the vector of a load."""
        action, value = load.action, getattr(load, load.action)
        if action.startswith("base") and self.model.free.all():
            raise InputError(
                "nothing is fixed, so there is no base to move",
                key=f"loads.{action}",
                value=value,
                cure='Fix the cage ([modal] fixed = "+y")',
            )
        if action == "base_displacement":
            base = np.array(value)
            return LoadVector(_axes("mass", value), load.function, base)
        if action in ("gravity", "base_acceleration"):
            sign = 1.0 if action == "gravity" else -1.0
            return LoadVector(_axes("mass", [sign * v for v in value]), load.function)
        if action in ("pressure", "traction"):
            where = forces.wall(self.model.points, self.model.cells, load.on)
            stress = -value * where.normal if action == "pressure" else value
            for axis, unit in enumerate(np.eye(3)):
                self._forces.setdefault(
                    f"{load.on} {axis}",
                    forces.traction(len(self.nodal_mass), where, unit).ravel(),
                )
            return LoadVector(_axes(load.on, stress), load.function)
        if action == "force":
            vertex = forces.nearest(self.model.points, load.at)
            return LoadVector(_axes(f"vertex {vertex}", value), load.function)
        try:
            values = vectors_of(self._grid, load.array, len(self.nodal_mass), "ModalResponse")
        except InputError as error:
            error.key = "loads.array"
            raise
        self._forces[f"array {load.array}"] = values.ravel()
        return LoadVector(((f"array {load.array}", 1.0),), load.function)

    def gravity(self, acceleration: Sequence[float], function: TimeFunction) -> LoadVector:
        """Return the vector of gravity."""
        return LoadVector(_axes("mass", acceleration), function)

    def force(self, vector: LoadVector) -> FloatArray:
        """Return a vector's forces."""
        total = np.zeros(self.shapes.shape[1])
        for name, size in vector.parts:
            total += size * self._elementary(name)
        return total

    def basis(
        self, vectors: Sequence[LoadVector], residual: bool, processes: Processes | None = None
    ) -> Basis:
        """Return the shapes that a cage under some loads moves in."""
        names = tuple(sorted({name for vector in vectors for name, _ in vector.parts}))
        if not residual or self.complete or not names:
            return Basis(self.eigenvalues, self.shapes)
        if names not in self._bases:
            free = self.model.free
            new = [name for name in names if name not in self._statics]
            if new:
                load = np.stack([self._elementary(name) * free for name in new], axis=1)
                if processes is None:
                    found, rounding = static_displacements(self.model, load)
                else:
                    found, rounding = processes.from_first(
                        lambda: list(static_displacements(self.model, load))
                    )
                self._statics.update(zip(new, found.T, strict=True))
                self._rounding.update(zip(new, rounding.tolist(), strict=True))
            values, shapes = residual_modes(
                self.shapes,
                self.eigenvalues,
                self.model.stiffness,
                self.model.mass,
                np.stack([self._elementary(name) * free for name in names], axis=1),
                np.stack([self._statics[name] for name in names], axis=1),
            )
            # One at a time: a basis of a large cage is large.
            self._bases = {
                names: Basis(
                    np.concatenate([self.eigenvalues, values]),
                    np.concatenate([self.shapes, shapes]),
                )
            }
        return self._bases[names]

    def rounding(self, vectors: Sequence[LoadVector]) -> float:
        """Return how far rounding disturbs the static response to some loads."""
        names = {name for vector in vectors for name, _ in vector.parts}
        return max((self._rounding.get(name, 0.0) for name in names), default=0.0)

    def weights(self, place: FloatArray) -> FloatArray:
        """Return how much each vertex counts in the motion of a point."""
        cells, points = self.model.cells, self.model.points
        where = locate([place], points, cells[:, :4], threads=1)
        if where.outside:
            low, high = (
                [float(f"{x:.6g}") for x in end] for end in (points.min(axis=0), points.max(axis=0))
            )
            distance = format_quantity(where.largest_distance, "m")
            raise InputError(
                f"the point lies outside the cage, by {distance}",
                key="point",
                value=[float(x) for x in place],
                allowed=f"a point inside; the cage's box goes from {low} to {high} m",
            )
        functions = where.weights[:1]
        if cells.shape[1] == 10:
            functions = shape_functions(functions)
        result = np.zeros(len(self.model.points))
        result[cells[where.tetrahedron[0]]] = functions[0]
        return result

    def loaded_axes(self, vectors: Sequence[LoadVector]) -> NDArray[np.bool_]:
        """Return along which axes the loads have a resultant."""
        loaded = np.zeros(3, dtype=bool)
        for vector in vectors:
            force = (self.force(vector) * self.model.free).reshape(-1, 3)
            loaded |= abs(force.sum(axis=0)) > 0.01 * abs(force).sum()
        return loaded

    def _elementary(self, name: str) -> FloatArray:
        if name not in self._forces:
            kind, _, axis = name.rpartition(" ")
            unit = np.eye(3)[int(axis)]
            if kind == "mass":
                force = forces.on_mass(self.nodal_mass, unit)
            else:
                force = np.zeros_like(self.model.points)
                force[int(kind.removeprefix("vertex "))] = unit
            self._forces[name] = force.ravel()
        return self._forces[name]


def _axes(kind: str, vector: Sequence[float] | FloatArray) -> tuple[tuple[str, float], ...]:
    return tuple((f"{kind} {axis}", float(v)) for axis, v in enumerate(vector) if v != 0.0)
