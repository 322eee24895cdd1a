"""Large rotations of a linear motion: rotation-strain coordinates.

A linear motion stretches what it turns. But in each element its gradient G still tells a strain
ε = sym G and a rotation, the axial vector ω of skew G; the gradient that was meant is

    F = exp([ω]×) (I + ε)

and the shape the one whose gradients are nearest to these, in least squares over the volume, with
the held vertices where the motion has them. Time stays free: a cage is factorised once, and a time
costs one back-substitution. Source: J. Huang, Y. Tong, K. Zhou, H. Bao, M. Desbrun, "Interactive
shape interpolation through controllable dynamic deformation", IEEE Trans. Vis. Comput. Graph. 17
(2011) 983; a sheet has its own legs here, two along its mid-surface and its director.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from spacemap_vtk.mechanics.pencil import selection
from spacemap_vtk.mechanics.response import Motion
from spacemap_vtk.mechanics.shell import THIN, MidSurface, free_pairs, layer, legs_of, mid_surface
from spacemap_vtk.mechanics.strains import sampled_slopes
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix, csr_matrix


#: Up to here a dense inverse is quicker than a back-substitution.
_DENSE = 1000


class RotationCoordinates:
    """The shapes of a cage whose linear motion is given, without the stretch that turning brings.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices where the motion is zero: undeformed, or hung [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    held : ndarray of bool, shape (V, 3), or csc_matrix of float64, shape (3V, N)
        Components that stay where the motion has them; or, of a cage that has a
        `spacemap_vtk.mechanics.model.Model`, its pencil's basis. What nothing holds along an axis
        keeps its middle there.
    surface : MidSurface, optional
        Of the sheet that the cage is, from `spacemap_vtk.mechanics.shell.mid_surface`.

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
            self._legs, self._weights = _of_tetrahedra(points, cells)
        else:
            self._legs, self._weights = legs_of(points, surface)
        if isinstance(held, np.ndarray):
            if surface is None:
                held = selection(~held.ravel())
            else:
                held = free_pairs(points, surface, held)
        self._held: csc_matrix = held
        self._nodal = self._of_nodes(points)
        #: Legs of each place where the motion is zero, as columns, and their inverse.
        self._rest = self._columns(self._nodal)
        self._inverse = np.linalg.inv(self._rest)

    @classmethod
    def of_mesh(cls, points: Floats, cells: Ints, held: Bools) -> RotationCoordinates:
        """Return what rebuilds the shapes of a mesh of which no more is known than what it holds.

        Parameters
        ----------
        points : ndarray of float64, shape (V, 3)
            Vertices [m].
        cells : ndarray of int64, shape (T, 4) or (T, 10)
            Tetrahedra; a lattice of one layer of wide cells counts as a sheet.
        held : ndarray of bool, shape (V, 3)
            Components that stay where the motion has them.

        Returns
        -------
        RotationCoordinates
            Of this mesh.
        """
        thin = layer(points, cells)
        sheet = thin is not None and thin.aspect > THIN
        return cls(points, cells, held, mid_surface(points, cells) if sheet else None)

    def displacement(self, linear: Floats) -> Floats:
        """Return where the vertices go.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        ndarray of float64, shape (V, 3)
            In m.
        """
        moved = self._of_nodes(linear)
        gradients = self._columns(moved) @ self._inverse
        turn, strain = _parts(gradients)
        return self._fitted(turn @ strain @ self._rest, self._nodal + moved) - self.points

    def largest(self, linear: Floats) -> tuple[float, float]:
        """Return by how much an element turns at most, and is strained at most.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        angle : float
            In rad; it grows with the displacement, and so does the strain.
        strain : float
            Largest principal one, of either sign.
        """
        gradients = self._columns(self._of_nodes(linear)) @ self._inverse
        strains = np.linalg.eigvalsh((gradients + gradients.swapaxes(1, 2)) / 2)
        angles = np.linalg.norm(_axial(gradients), axis=1)
        return float(angles.max()), float(abs(strains).max())

    def rotation(self, linear: Floats) -> float:
        """Return by how much an element turns at most, less what a free cage turns as a whole.

        Parameters
        ----------
        linear : ndarray of float64, shape (V, 3)
            Displacement of the linear motion [m].

        Returns
        -------
        float
            In rad.
        """
        turns = _axial(self._columns(self._of_nodes(linear)) @ self._inverse)
        if len(self._loose) == 3:  # turning as a whole is exact
            turns -= np.average(turns, axis=0, weights=self._weights[::3])
        return float(np.sqrt(np.einsum("ni,ni->n", turns, turns).max()))

    def velocity(self, linear: Floats, rate: Floats) -> Floats:
        """Return how fast the vertices go.

        Parameters
        ----------
        linear, rate : ndarray of float64, shape (V, 3)
            Displacement [m] and velocity [m/s] of the linear motion.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            In m/s, the exact rate of `displacement`.
        """
        moving = self._of_nodes(rate)
        gradients = self._columns(self._of_nodes(linear)) @ self._inverse
        rates = self._columns(moving) @ self._inverse
        turn, strain = _parts(gradients)
        spin = _cross(_spin(_axial(gradients), _axial(rates)))
        meant = spin @ turn @ strain + turn @ ((rates + rates.swapaxes(1, 2)) / 2)
        return self._fitted(meant @ self._rest, moving)

    def acceleration(self, linear: Floats, rate: Floats, second: Floats) -> Floats:
        """Return the rate of `velocity`.

        Parameters
        ----------
        linear, rate, second : ndarray of float64, shape (V, 3)
            Displacement [m], velocity [m/s] and acceleration [m/s²] of the linear motion.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            In m/s², by a central difference over so short a time that six digits hold.
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
        """Return a linear motion rebuilt at any time.

        Parameters
        ----------
        linear : Motion
            Of the cage, its displacements from the undeformed vertices.

        Returns
        -------
        Motion
            Energies are those of the linear one.
        """
        return _Turned(linear, self)

    def _of_nodes(self, vertices: Floats) -> Floats:
        return vertices if self.surface is None else self.surface.nodal(vertices)

    def _columns(self, nodal: Floats) -> Floats:
        """Return the legs of each place as columns, (n, 3, 3)."""
        return (self._legs @ nodal).reshape(-1, 3, 3).swapaxes(1, 2)

    def _fitted(self, meant: Floats, given: Floats) -> Floats:
        """Return the vertices with the nearest legs, held ones as given."""
        load = self._pull @ meant.swapaxes(1, 2).reshape(-1, 3)
        result = np.empty_like(given)
        for axes, system in self._systems:
            result[:, axes] = system.solved(load[:, axes], given[:, axes])
        places = slice(None) if self.surface is None else slice(len(self.surface.pairs))
        result[places, self._loose] += (given - result)[places, self._loose].mean(axis=0)
        return result if self.surface is None else self.surface.vertices(result)

    @cached_property
    def _loose(self) -> Ints:
        """The axes along which nothing is held."""
        size = len(self.points) if self.surface is None else len(self.surface.pairs)
        places = np.arange(len(self.points)) < size
        push = (places[:, None, None] * np.eye(3)).reshape(-1, 3)
        return np.flatnonzero(abs(push - self._held @ (self._held.T @ push)).max(axis=0) < 1e-9)

    @cached_property
    def _pull(self) -> csr_matrix:
        return self._legs.T.multiply(self._weights).tocsr()

    @cached_property
    def _systems(self) -> list[tuple[list[int], _System]]:
        """Axes that can be solved for side by side, and their system."""
        from scipy.sparse import eye, kron

        springs = (self._pull @ self._legs).tocsr()
        # What nothing holds is solved for with one node held, and then put where its middle was.
        anchor = np.zeros(3)
        anchor[self._loose] = springs.diagonal().mean()
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


class _Turned(Motion):
    """A linear motion, rebuilt at any time."""

    def __init__(self, linear: Motion, kernel: RotationCoordinates) -> None:
        self._linear, self._kernel = linear, kernel
        self.points, self.cells = linear.points, linear.cells
        #: Where the motion is zero: hung.
        self._rest = kernel.points - linear.points

    def at(self, time: float) -> Floats:
        moved, rate, second = self._linear.at(time)
        moved = moved - self._rest
        shape = self._rest + self._kernel.displacement(moved)
        speed = self._kernel.velocity(moved, rate)
        return np.stack([shape, speed, self._kernel.acceleration(moved, rate, second)])

    def history(self, weights: Floats, times: Floats) -> Floats:
        return np.stack([weights @ self.at(float(time)) for time in times], axis=1)

    def energies(self, times: Floats) -> Floats:
        return self._linear.energies(times)

    def potential(self, times: Floats) -> Floats:
        return self._linear.potential(times)


class _System:
    """The nearest positions of nodes, of which some are held."""

    def __init__(self, springs: csr_matrix, basis: csc_matrix, anchor: Floats) -> None:
        self._springs, self._basis, self._anchor = springs, basis, anchor
        if basis.shape[1]:
            rows = basis[: len(anchor)]
            fixed = rows.T.multiply(anchor) @ rows
            self._solve = _solver((basis.T @ springs @ basis + fixed).tocsr())

    def solved(self, load: Floats, given: Floats) -> Floats:
        """Return the positions of all nodes, (V, m), or along three axes that hang together."""
        basis, shape = self._basis, given.shape
        load, given = (part.reshape(basis.shape[0], -1) for part in (load, given))
        kept = given - basis @ (basis.T @ given)
        if not basis.shape[1]:
            return kept.reshape(shape)
        pushed = load - self._springs @ kept
        pushed[: len(self._anchor)] += self._anchor[:, None] * (given - kept)[: len(self._anchor)]
        return (kept + basis @ self._solve(basis.T @ pushed)).reshape(shape)


def _of_tetrahedra(points: Floats, cells: Ints) -> tuple[csr_matrix, Floats]:
    """Return the gradients of tetrahedra as a matrix, (3 n, V), and the volume of each row."""
    from scipy.sparse import csr_matrix

    slopes, weights = sampled_slopes(points, cells)
    values = slopes.swapaxes(2, 3)
    count, nodes = values.size // cells.shape[1], cells.shape[1]
    columns = np.repeat(cells, 3 * slopes.shape[1], axis=0)
    parts = values.ravel(), columns.ravel(), nodes * np.arange(count + 1)
    return csr_matrix(parts, shape=(count, len(points))), np.repeat(weights.ravel(), 3)


def _axial(gradients: Floats) -> Floats:
    """Return the axial vectors of their skew parts, (n, 3)."""
    turned = [gradients[:, j, i] - gradients[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(turned, axis=1) / 2


def _cross(vectors: Floats) -> Floats:
    """Return the matrices [v]×, (n, 3, 3)."""
    result = np.zeros((len(vectors), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[:, k, j], result[:, j, k] = vectors[:, i], -vectors[:, i]
    return result


def _parts(gradients: Floats) -> tuple[Floats, Floats]:
    """Return exp([ω]×) and I + ε of each gradient."""
    omega = _axial(gradients)
    angle = np.linalg.norm(omega, axis=1)[:, None, None]
    cross = _cross(omega)
    # sin θ/θ and (1 - cos θ)/θ², which is sin²(θ/2)/2 over (θ/2)².
    half = np.sinc(angle / (2 * np.pi))
    turn = np.eye(3) + np.sinc(angle / np.pi) * cross + half**2 / 2 * (cross @ cross)
    return turn, np.eye(3) + (gradients + gradients.swapaxes(1, 2)) / 2


def _spin(omega: Floats, rate: Floats) -> Floats:
    """Return the angular velocity of exp([ω]×) where ω has a rate, (n, 3)."""
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


def _solver(matrix: csr_matrix) -> Callable[[Floats], Floats]:
    """Return what solves a definite system for some right-hand sides."""
    if matrix.shape[0] <= _DENSE:
        inverse = np.linalg.inv(matrix.toarray())
        return lambda right: inverse @ right
    from spacemap_vtk.mechanics.factors import factorise
    from spacemap_vtk.mechanics.multifrontal import Analysis

    return factorise(matrix, lambda: Analysis(matrix, np.arange(matrix.shape[0]))).solve
