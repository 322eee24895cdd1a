"""Modes of a cage, loads on them and residual vectors: all of a response but its time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary import loads as forces
from spacemap_vtk.mechanics.boundary.time_functions import TimeFunction
from spacemap_vtk.mechanics.elements.kinematics import MeanGradient, strains
from spacemap_vtk.mechanics.elements.shell import SheetGradient
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.residual_vectors import participation
from spacemap_vtk.ndarrays import Bools, Floats, Ints


class LoadVector(NamedTuple):
    """Forces on the vertices, with their time function."""

    parts: tuple[tuple[str, float], ...]
    """Name and size of each elementary vector in the sum."""
    function: TimeFunction
    """Factor over time."""
    moves_base: Floats | None = None
    """Displacement of the base [m]; the vector is the mass times this displacement."""
    pressure: float = 0.0
    """Pressure that stays normal to `faces` [Pa]; `parts` are its forces before anything moves."""
    faces: Ints | None = None
    """(f, k) of a `spacemap_vtk.mechanics.boundary.loads.SideFaces`; None for all other loads."""


class Basis(NamedTuple):
    """Shapes in which a cage moves."""

    eigenvalues: Floats
    """(n + k,), eigenvalues of the modes and of the residual vectors."""
    shapes: Floats
    """(n + k, 3V), their shapes."""


#: Largest distance of a load from the cage's bounding box, as a share of its diagonal.
FAR = 0.05


#: Function from forces to displacements, (3V, m), and to the share of each that is rounding, (m,).
Statics = Callable[[Floats], tuple[Floats, Floats]]


class CageModes:
    """Modes of a cage, and all that follows from them without a load's time function.

    Parameters
    ----------
    model : Model
        The cage.
    eigenvalues : ndarray of float64, shape (n,)
        Eigenvalues λ of its modes [1/s²].
    shapes : ndarray of float64, shape (n, 3V)
        Mass-normalised mode shapes [1/√kg].
    rounding : ndarray of float64, shape (n,)
        Share of each eigenvalue that is rounding.
    """

    # Elementary vectors (gravity along an axis, a unit traction on a side, …) and their static
    # solutions are kept by name, so changing the size of a load needs no new solution.

    def __init__(self, model: Model, eigenvalues: Floats, shapes: Floats, rounding: Floats) -> None:
        self.model, self.eigenvalues, self.shapes = model, eigenvalues, shapes
        self.eigenvalue_rounding = rounding
        self.nodal_mass = model.nodal_mass
        self._forces: dict[str, Floats] = {}
        self._statics: dict[str, Floats] = {}
        self._rounding: dict[str, float] = {}
        self._bases: dict[tuple[str, ...], Basis] = {}

    def distance_outside(self, place: ArrayLike) -> float:
        """Compute the distance of a point from the cage's bounding box.

        Parameters
        ----------
        place : array_like of float, shape (3,)
            Position of the point [m].

        Returns
        -------
        float
            Distance [m]; zero if the point is inside, or nearly inside.
        """
        low, high = self.model.points.min(axis=0), self.model.points.max(axis=0)
        where = np.asarray(place, dtype=np.float64)
        distance = float(np.linalg.norm(where - where.clip(low, high)))
        return distance if distance > FAR * np.linalg.norm(high - low) else 0.0

    @property
    def is_complete(self) -> bool:
        """Whether these are all modes of the cage."""
        return len(self.eigenvalues) >= self.model.pencil.size

    @cached_property
    def gradient(self) -> MeanGradient | SheetGradient:
        """Map from displacements from the equilibrium to their gradients in each tetrahedron."""
        moved, surface = self.model.displacement, self.model.pencil.surface
        if moved is None:
            return MeanGradient(self.model.points, self.model.cells)
        if surface is None:
            return MeanGradient(self.model.points + moved, self.model.cells)
        return SheetGradient(self.model.points, surface, moved)

    def strain_and_stress(self, moved: Floats, gradients: Floats) -> tuple[Floats, Floats]:
        """Compute strain and stress of each tetrahedron.

        Parameters
        ----------
        moved : ndarray of float64, shape (V, 3)
            Displacement from the equilibrium [m].
        gradients : ndarray of float64, shape (3, 3, T)
            Gradients of this displacement, from `gradient`; not used for a sheet, or in an
            equilibrium.

        Returns
        -------
        strain : ndarray of float64, shape (T, 6)
            Components xx, yy, zz, yz, zx, xy, with engineering shears.
        stress : ndarray of float64, shape (T, 6)
            Stress [Pa].
        """
        if self.model.plate is None and self.model.displacement is None:
            strain = strains(gradients)
            return strain, self.model.stress(strain)
        return self.model.strain_and_stress(moved)

    @cached_property
    def effective_masses(self) -> Floats:
        """Effective masses of each mode along x, y and z [kg], (n, 3)."""
        return participation(self.shapes, self.nodal_mass) ** 2

    @property
    def frequencies(self) -> Floats:
        """Undamped natural frequencies [Hz], (n,); 0 for rigid modes."""
        return np.asarray(np.sqrt(np.maximum(self.eigenvalues, 0.0)) / (2 * np.pi))

    @property
    def mass_shares(self) -> Floats:
        """Effective masses as shares of the movable mass along x, y and z, (n, 3)."""
        masses, movable = self.effective_masses, self.model.movable_mass
        # If a cage is held along an axis everywhere, no mass can move along it.
        return np.divide(masses, movable, out=np.zeros_like(masses), where=movable > 0)

    def load_vector(
        self,
        action: str,
        value: Any,
        function: TimeFunction,
        place: Any = None,
        follower: bool = False,
    ) -> LoadVector:
        """Make the vector of a load.

        Parameters
        ----------
        action : str
            "gravity", "base_acceleration", "base_displacement", "pressure", "traction", "force", or
            "array" (forces on all vertices).
        value : float or array_like
            Size in SI units: a number for a pressure, (V, 3) for an array, otherwise (3,).
        function : TimeFunction
            Factor over time.
        place : object, optional
            Side of a pressure or traction, point of a force, or name of an array.
        follower : bool, optional
            Whether a pressure turns with its side, which only `SteppedMotion` supports.

        Returns
        -------
        LoadVector
            Sum of elementary vectors, each of which is solved for only once.

        Raises
        ------
        InputError
            If a base moves but nothing is fixed, or the cage has no face on that side.
        """
        if action.startswith("base") and not self.model.is_grounded:
            raise InputError(
                "the base cannot move because nothing is fixed",
                key=f"loads.{action}",
                value=value,
                cure='Fix the cage ([modal] fixed = "+y")',
            )
        if action == "base_displacement":
            return LoadVector(_axis_parts("mass", value), function, np.array(value))
        if action in ("gravity", "base_acceleration"):
            sign = 1.0 if action == "gravity" else -1.0
            return LoadVector(_axis_parts("mass", [sign * v for v in value]), function)
        if action in ("pressure", "traction"):
            sheet = self.model.plate is not None
            where = forces.find_side_faces(self.model.points, self.model.cells, place, sheet)
            stress = -value * where.normal if action == "pressure" else value
            for axis, unit in enumerate(np.eye(3)):
                self._forces.setdefault(
                    f"{place} {axis}",
                    forces.traction_forces(len(self.nodal_mass), where, unit).ravel(),
                )
            follows = (value, where.faces) if follower else ()
            return LoadVector(_axis_parts(place, stress), function, None, *follows)
        if action == "force":
            nearest = forces.nearest_vertices(self.model.points, place)
            name = f"vertices {','.join(map(str, nearest.tolist()))}"
            return LoadVector(_axis_parts(name, value), function)
        self._forces[f"array {place}"] = np.ravel(value)
        return LoadVector(((f"array {place}", 1.0),), function)

    def vertex_forces(self, vector: LoadVector) -> Floats:
        """Compute the forces of a load vector.

        Parameters
        ----------
        vector : LoadVector
            Load vector, made by `vector`.

        Returns
        -------
        ndarray of float64, shape (3V,)
            Forces [N] for a factor of one.
        """
        total = np.zeros(self.shapes.shape[1])
        for name, size in vector.parts:
            total += size * self._elementary_force(name)
        return total

    def basis(
        self, vectors: Sequence[LoadVector], residual: bool = True, statics: Statics | None = None
    ) -> Basis:
        """Compute the shapes in which the cage moves under given loads.

        Parameters
        ----------
        vectors : sequence of LoadVector
            The loads.
        residual : bool, optional
            Whether the modes are followed by a residual vector for each elementary vector.
        statics : callable, optional
            Solver of the static responses; by default the model.

        Returns
        -------
        Basis
            Shapes and eigenvalues; the same object as long as the elementary vectors are the same.
        """
        names = tuple(sorted({name for vector in vectors for name, _ in vector.parts}))
        if not residual or self.is_complete or not names:
            return Basis(self.eigenvalues, self.shapes)
        if names not in self._bases:
            free = self.model.free
            new = [name for name in names if name not in self._statics]
            if new:
                load = np.stack([self._elementary_force(name) * free for name in new], axis=1)
                found, rounding = (statics or self.model.statics)(load)
                self._statics.update(zip(new, found.T, strict=True))
                self._rounding.update(zip(new, rounding.tolist(), strict=True))
            values, shapes = self.model.residual_modes(
                self.shapes,
                self.eigenvalues,
                np.stack([self._elementary_force(name) * free for name in names], axis=1),
                np.stack([self._statics[name] for name in names], axis=1),
            )
            # Only one is kept, as the basis of a large cage is large.
            self._bases = {
                names: Basis(
                    np.concatenate([self.eigenvalues, values]),
                    np.concatenate([self.shapes, shapes]),
                )
            }
        return self._bases[names]

    def static_rounding(self, vectors: Sequence[LoadVector]) -> float:
        """Estimate the rounding errors of the static response to given loads.

        Parameters
        ----------
        vectors : sequence of LoadVector
            The loads.

        Returns
        -------
        float
            Largest share of a static response that is rounding.
        """
        names = {name for vector in vectors for name, _ in vector.parts}
        return max((self._rounding.get(name, 0.0) for name in names), default=0.0)

    def loaded_axes(self, vectors: Sequence[LoadVector]) -> Bools:
        """Find the axes along which the loads have a resultant.

        Parameters
        ----------
        vectors : sequence of LoadVector
            The loads.

        Returns
        -------
        ndarray of bool, shape (3,)
            Whether there is a resultant along x, y and z.
        """
        loaded = np.zeros(3, dtype=bool)
        for vector in vectors:
            force = self.model.pencil.remove_held(self.vertex_forces(vector)[:, None]).reshape(
                -1, 3
            )
            loaded |= abs(force.sum(axis=0)) > 0.01 * abs(force).sum()
        return loaded

    def _elementary_force(self, name: str) -> Floats:
        if name not in self._forces:
            kind, _, axis = name.rpartition(" ")
            unit = np.eye(3)[int(axis)]
            if kind == "mass":
                force = forces.acceleration_forces(self.nodal_mass, unit)
            else:
                force = np.zeros_like(self.model.points)
                vertices = list(map(int, kind.removeprefix("vertices ").split(",")))
                force[vertices] = unit / len(vertices)
            self._forces[name] = force.ravel()
        return self._forces[name]


def _axis_parts(kind: str, vector: Sequence[float] | Floats) -> tuple[tuple[str, float], ...]:
    return tuple((f"{kind} {axis}", float(v)) for axis, v in enumerate(vector) if v != 0.0)
