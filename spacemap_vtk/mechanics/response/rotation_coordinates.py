"""Rotation-strain coordinates: correct a linear motion for large rotations.

A linear motion stretches whatever it turns. In each element its gradient G still contains a strain
ε = sym G and a rotation, the axial vector ω of skew G. The intended gradient is

    F = exp([ω]×) (I + ε)

The corrected shape has the gradients that are closest to F, in least squares over the volume; held
vertices keep the positions of the linear motion. Times are independent of each other: a cage is
factorised once, and each time costs one back-substitution. Source: J. Huang, Y. Tong, K. Zhou,
H. Bao, M. Desbrun, "Interactive shape interpolation through controllable dynamic deformation", IEEE
Trans. Vis. Comput. Graph. 17 (2011) 983. For a sheet, the gradient at a point follows from three
vectors, its legs: two along the mid-surface, and the director.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from spacemap_vtk.mechanics.elements.shell import (
    SHEET_ASPECT,
    MidSurface,
    find_layer,
    find_mid_surface,
    frame_matrix,
    free_sheet_motions,
)
from spacemap_vtk.mechanics.elements.strains import shape_gradients
from spacemap_vtk.mechanics.modal.pencil import free_columns
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix, csr_matrix


#: Up to this size a dense inverse is faster than a back-substitution.
_DENSE = 1000


class RotationCoordinates:
    """Shapes of a cage from its linear motion, without the stretch caused by rotation.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices where the motion is zero, undeformed or in equilibrium [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    held : ndarray of bool, shape (V, 3), or csc_matrix of float64, shape (3V, N)
        Components that keep the linear motion; or, for a cage with a
        `spacemap_vtk.mechanics.modal.model.Model`, the basis of its pencil. Along an axis where
        nothing is held, the mean position is that of the linear motion.
    surface : MidSurface, optional
        Mid-surface from `spacemap_vtk.mechanics.elements.shell.find_mid_surface`, if the cage is a
        sheet.

    Raises
    ------
    GeometryError
        If a tetrahedron is flat.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> free = np.zeros((4, 3), dtype=bool)
    >>> turn = RotationCoordinates(corners, np.array([[0, 1, 2, 3]]), free)
    >>> quarter = np.pi / 2 * np.cross([0, 0, 1.0], corners - corners.mean(axis=0))
    >>> (corners + turn.displacement(quarter))[1].round(9).tolist()
    [0.5, 1.0, 0.0]
    """

    def __init__(
        self,
        points: Floats,
        cells: Ints,
        held: Bools | csc_matrix,
        surface: MidSurface | None = None,
    ) -> None:
        self.points, self.surface = points, surface
        if surface is None:
            self._frames, self._weights = _gradient_matrix(points, cells)
        else:
            self._frames, self._weights = frame_matrix(points, surface)
        if isinstance(held, np.ndarray):
            if surface is None:
                held = free_columns(~held.ravel())
            else:
                held = free_sheet_motions(points, surface, held)
        self._held: csc_matrix = held
        self._nodal = self._to_nodes(points)
        #: Legs of each point where the motion is zero, as columns, and their inverse.
        self._rest = self._frames_of(self._nodal)
        self._inverse = np.linalg.inv(self._rest)

    @classmethod
    def from_mesh(cls, points: Floats, cells: Ints, held: Bools) -> RotationCoordinates:
        """Make the coordinates of a mesh of which only the held components are known.

        Parameters
        ----------
        points : ndarray of float64, shape (V, 3)
            Vertices [m].
        cells : ndarray of int64, shape (T, 4) or (T, 10)
            Tetrahedra; a one-layer lattice of wide cells counts as a sheet.
        held : ndarray of bool, shape (V, 3)
            Components that keep the linear motion.

        Returns
        -------
        RotationCoordinates
            Rotation-strain coordinates of this mesh.
        """
        thin = find_layer(points, cells)
        sheet = thin is not None and thin.aspect > SHEET_ASPECT
        return cls(points, cells, held, find_mid_surface(points, cells) if sheet else None)

    def displacement(self, linear: Floats) -> Floats:
        """Compute the corrected displacement of the vertices.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Corrected displacement [m].
        """
        moved = self._to_nodes(linear)
        gradients = self._frames_of(moved) @ self._inverse
        turn, strain = _rotation_and_stretch(gradients)
        return self._fit_vertices(turn @ strain @ self._rest, self._nodal + moved) - self.points

    def largest_rotation_and_strain(self, linear: Floats) -> tuple[float, float]:
        """Compute the largest rotation and the largest strain of any element.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        angle : float
            Largest rotation [rad]; it and the strain grow with the displacement.
        strain : float
            Largest principal strain, of either sign.
        """
        gradients = self._frames_of(self._to_nodes(linear)) @ self._inverse
        strains = np.linalg.eigvalsh((gradients + gradients.swapaxes(1, 2)) / 2)
        angles = np.linalg.norm(_axial_vectors(gradients), axis=1)
        return float(angles.max()), float(abs(strains).max())

    def largest_rotation(self, linear: Floats) -> float:
        """Compute the largest rotation of any element, without the rotation of a free cage.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        float
            Largest rotation [rad].
        """
        turns = _axial_vectors(self._frames_of(self._to_nodes(linear)) @ self._inverse)
        if len(self._free_axes) == 3:  # a rotation of the whole cage is exact
            turns -= np.average(turns, axis=0, weights=self._weights[::3])
        return float(np.sqrt(np.einsum("ni,ni->n", turns, turns).max()))

    def largest_turned_strain(self, linear: Floats) -> float:
        """Compute the largest product of rotation and strain of an element.

        Strain and rotation do not commute, and a linear motion does not know their order: the
        gradients exp(ω) (1 + ε) and exp(ω + ε) differ by up to the product of their sizes.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        float
            Largest product of an angle in rad and a principal strain.
        """
        gradients = self._frames_of(self._to_nodes(linear)) @ self._inverse
        strains = np.linalg.eigvalsh((gradients + gradients.swapaxes(1, 2)) / 2)
        angles = np.linalg.norm(_axial_vectors(gradients), axis=1)
        return float((angles * abs(strains).max(axis=1)).max())

    def velocity(self, linear: Floats, rate: Floats) -> Floats:
        """Compute the corrected velocity of the vertices.

        Parameters
        ----------
        linear, rate : ndarray of float64, shape (V, 3)
            Displacement [m] and velocity [m/s] of the linear motion.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Corrected velocity [m/s], the exact derivative of `displacement`.
        """
        moving = self._to_nodes(rate)
        gradients = self._frames_of(self._to_nodes(linear)) @ self._inverse
        rates = self._frames_of(moving) @ self._inverse
        turn, strain = _rotation_and_stretch(gradients)
        spin = _cross_matrices(_angular_velocity(_axial_vectors(gradients), _axial_vectors(rates)))
        meant = spin @ turn @ strain + turn @ ((rates + rates.swapaxes(1, 2)) / 2)
        return self._fit_vertices(meant @ self._rest, moving)

    def acceleration(self, linear: Floats, rate: Floats, second: Floats) -> Floats:
        """Compute the corrected acceleration of the vertices.

        Parameters
        ----------
        linear, rate, second : ndarray of float64, shape (V, 3)
            Displacement [m], velocity [m/s] and acceleration [m/s²] of the linear motion.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Derivative of `velocity` [m/s²], by a central difference with six correct digits.
        """
        size = float(np.ptp(self.points, axis=0).max())
        fastest = max(float(abs(rate).max()), (size * float(abs(second).max())) ** 0.5)
        if fastest == 0.0:
            return np.zeros_like(linear)
        step = 1e-4 * size / fastest
        ends = [
            self.velocity(linear + t * rate + t**2 / 2 * second, rate + t * second)
            for t in (-step, step)
        ]
        return (ends[1] - ends[0]) / (2 * step)

    def motion(self, linear: Motion) -> Motion:
        """Make the corrected motion from a linear motion.

        Parameters
        ----------
        linear : Motion
            Linear motion of the cage, with displacements from the undeformed vertices.

        Returns
        -------
        Motion
            Corrected motion; its energies are those of the linear one.
        """
        return _CorrectedMotion(linear, self)

    def _to_nodes(self, vertices: Floats) -> Floats:
        return vertices if self.surface is None else self.surface.to_nodes(vertices)

    def _frames_of(self, nodal: Floats) -> Floats:
        """Compute the legs of each point as columns, (n, 3, 3)."""
        return (self._frames @ nodal).reshape(-1, 3, 3).swapaxes(1, 2)

    def _fit_vertices(self, meant: Floats, given: Floats) -> Floats:
        """Fit the vertices to the intended legs, with held components as given."""
        load = self._weighted_frames @ meant.swapaxes(1, 2).reshape(-1, 3)
        result = np.empty_like(given)
        for axes, system in self._systems:
            result[:, axes] = system.solve(load[:, axes], given[:, axes])
        places = slice(None) if self.surface is None else slice(len(self.surface.pairs))
        result[places, self._free_axes] += (given - result)[places, self._free_axes].mean(axis=0)
        return result if self.surface is None else self.surface.to_vertices(result)

    @cached_property
    def _free_axes(self) -> Ints:
        """Axes along which nothing is held."""
        size = len(self.points) if self.surface is None else len(self.surface.pairs)
        places = np.arange(len(self.points)) < size
        push = (places[:, None, None] * np.eye(3)).reshape(-1, 3)
        return np.flatnonzero(abs(push - self._held @ (self._held.T @ push)).max(axis=0) < 1e-9)

    @cached_property
    def _weighted_frames(self) -> csr_matrix:
        return self._frames.T.multiply(self._weights).tocsr()

    @cached_property
    def _systems(self) -> list[tuple[list[int], _System]]:
        """Groups of axes that share a system, and the system of each group."""
        from scipy.sparse import eye, kron

        springs = (self._weighted_frames @ self._frames).tocsr()
        # Along a free axis one node is anchored to solve, and the result is then moved so that its
        # mean position is the given one.
        anchor = np.zeros(3)
        anchor[self._free_axes] = springs.diagonal().mean()
        basis = self._held
        axis = basis.indices % 3
        first = axis[basis.indptr[:-1]]
        if (axis != np.repeat(first, np.diff(basis.indptr))).any():
            return [([0, 1, 2], _System(kron(springs, eye(3), format="csr"), basis, anchor))]
        found: dict[bytes, list[int]] = {}
        for i in range(3):
            found.setdefault(np.unique(basis[i::3].nonzero()[0]).tobytes(), []).append(i)
        return [
            (axes, _System(springs, basis[axes[0] :: 3][:, first == axes[0]], anchor[axes[:1]]))
            for axes in found.values()
        ]


class _CorrectedMotion(Motion):
    """Corrected motion, computed from a linear motion at any time."""

    def __init__(self, linear: Motion, kernel: RotationCoordinates) -> None:
        self._linear, self._kernel = linear, kernel
        self.points, self.cells = linear.points, linear.cells
        #: Displacement of the equilibrium, where the motion is zero.
        self._rest = kernel.points - linear.points

    def at_time(self, time: float) -> Floats:
        moved, rate, second = self._linear.at_time(time)
        moved = moved - self._rest
        shape = self._rest + self._kernel.displacement(moved)
        speed = self._kernel.velocity(moved, rate)
        return np.stack([shape, speed, self._kernel.acceleration(moved, rate, second)])

    def history(self, weights: Floats, times: Floats) -> Floats:
        return np.stack([weights @ self.at_time(float(time)) for time in times], axis=1)

    def energies(self, times: Floats) -> Floats:
        return self._linear.energies(times)

    def potential(self, times: Floats) -> Floats:
        return self._linear.potential(times)


class _System:
    """Least-squares system for the positions of nodes, some of which are held."""

    def __init__(self, springs: csr_matrix, basis: csc_matrix, anchor: Floats) -> None:
        self._springs, self._basis, self._anchor = springs, basis, anchor
        if basis.shape[1]:
            rows = basis[: len(anchor)]
            fixed = rows.T.multiply(anchor) @ rows
            self._solve = _factorise((basis.T @ springs @ basis + fixed).tocsr())

    def solve(self, load: Floats, given: Floats) -> Floats:
        """Solve for the positions of all nodes, (V, m), or along three axes that are coupled."""
        basis, shape = self._basis, given.shape
        load, given = (part.reshape(basis.shape[0], -1) for part in (load, given))
        kept = given - basis @ (basis.T @ given)
        if not basis.shape[1]:
            return kept.reshape(shape)
        pushed = load - self._springs @ kept
        pushed[: len(self._anchor)] += self._anchor[:, None] * (given - kept)[: len(self._anchor)]
        return (kept + basis @ self._solve(basis.T @ pushed)).reshape(shape)


def _gradient_matrix(points: Floats, cells: Ints) -> tuple[csr_matrix, Floats]:
    """Build the gradients of tetrahedra as a matrix, (3 n, V), and the volume of each row."""
    from scipy.sparse import csr_matrix

    slopes, weights = shape_gradients(points, cells)
    values = slopes.swapaxes(2, 3)
    count, nodes = values.size // cells.shape[1], cells.shape[1]
    columns = np.repeat(cells, 3 * slopes.shape[1], axis=0)
    parts = values.ravel(), columns.ravel(), nodes * np.arange(count + 1)
    return csr_matrix(parts, shape=(count, len(points))), np.repeat(weights.ravel(), 3)


def _axial_vectors(gradients: Floats) -> Floats:
    """Compute the axial vectors of the skew parts of gradients, (n, 3)."""
    turned = [gradients[:, j, i] - gradients[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(turned, axis=1) / 2


def _cross_matrices(vectors: Floats) -> Floats:
    """Build the matrices [v]×, (n, 3, 3)."""
    result = np.zeros((len(vectors), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[:, k, j], result[:, j, k] = vectors[:, i], -vectors[:, i]
    return result


def _rotation_and_stretch(gradients: Floats) -> tuple[Floats, Floats]:
    """Compute exp([ω]×) and I + ε of each gradient."""
    omega = _axial_vectors(gradients)
    angle = np.linalg.norm(omega, axis=1)[:, None, None]
    cross = _cross_matrices(omega)
    # sin θ/θ and (1 - cos θ)/θ²; the latter is sin²(θ/2)/2 over (θ/2)².
    half = np.sinc(angle / (2 * np.pi))
    turn = np.eye(3) + np.sinc(angle / np.pi) * cross + half**2 / 2 * (cross @ cross)
    return turn, np.eye(3) + (gradients + gradients.swapaxes(1, 2)) / 2


def _angular_velocity(omega: Floats, rate: Floats) -> Floats:
    """Compute the angular velocity of exp([ω]×) from ω and its rate, (n, 3)."""
    # The left Jacobian of rotations: I + (1 - cos θ)/θ² [ω] + (θ - sin θ)/θ³ [ω]².
    angle = np.linalg.norm(omega, axis=1)[:, None]
    half = np.sinc(angle / (2 * np.pi)) ** 2 / 2
    safe = np.where(angle > 1e-2, angle, 1.0)
    square = angle**2
    rest = np.where(
        angle > 1e-2, (safe - np.sin(safe)) / safe**3, (1 - square / 20 + square**2 / 840) / 6
    )
    once = np.cross(omega, rate)
    return rate + half * once + rest * np.cross(omega, once)


def _factorise(matrix: csr_matrix) -> Callable[[Floats], Floats]:
    """Factorise a definite matrix; return its solver."""
    if matrix.shape[0] <= _DENSE:
        inverse = np.linalg.inv(matrix.toarray())
        return lambda right: inverse @ right
    from spacemap_vtk.mechanics.linalg.factors import factorise
    from spacemap_vtk.mechanics.linalg.fronts import Analysis

    return factorise(matrix, lambda: Analysis(matrix, np.arange(matrix.shape[0]))).solve
