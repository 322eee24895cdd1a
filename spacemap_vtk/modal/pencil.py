"""The free part of K and M, cut into pieces that no element joins, and static solutions of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csgraph

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.modal import lanczos, threads
from spacemap_vtk.modal.factors import Factors, factorise
from spacemap_vtk.modal.multifrontal import Analysis

FloatArray = NDArray[np.float64]

#: Share of |φ|ᵀ |K| |φ| below which a rigid motion's energy is rounding. The least that a support
#: can hold is one vertex of a million.
_NO_ENERGY = 1e-12

#: A static solution is done when a correction would change it by this share, in energy's norm.
_CORRECTION = 1e-14

#: Steps that are tried. Few eigenvalues lie below σ, and each costs about one.
_STEPS = 200


class Piece:
    """A connected part of a mesh.

    Parameters
    ----------
    rows : ndarray of int64, shape (n,)
        Its components among the free ones.
    stiffness, mass : scipy.sparse.csr_matrix of float64, shape (n, n)
        Its K and M.
    vertices : ndarray of int64, shape (n,)
        The vertex of each component.
    """

    def __init__(
        self,
        rows: NDArray[np.int64],
        stiffness: sp.csr_matrix,
        mass: sp.csr_matrix,
        vertices: NDArray[np.int64],
    ) -> None:
        self.rows = rows
        self.stiffness = stiffness
        self.mass = mass
        self.vertices = vertices
        self._factors: Factors | None = None

    @cached_property
    def shift(self) -> float:
        """The σ of the kept factors."""
        if not (self.stiffness.diagonal() > 0).all():
            raise SolverError(
                "the stiffness matrix is not positive semidefinite",
                cure="Check the material and the supports of the cage",
            )
        return lanczos.shift(self.stiffness, self.mass)

    @cached_property
    def analysis(self) -> Analysis:
        """Symbolic factorisation of the pattern of K and M, made once."""
        return Analysis(abs(self.stiffness) + abs(self.mass), self.vertices)

    @property
    def factors(self) -> Factors:
        """Factors of K + σM, made once."""
        return self.factorised(None)

    def factorised(self, progress: Callable[[float], object] | None) -> Factors:
        """Return the factors, and report while they are made.

        Parameters
        ----------
        progress : callable or None
            Called with a fraction from 0 to 1; may raise.

        Returns
        -------
        Factors
            Of K + σM.

        Raises
        ------
        SizeError
            If they do not fit into memory.
        SolverError
            If K has no positive diagonal, or K + σM is not positive definite.
        """
        if self._factors is None:
            matrix = self.stiffness + self.shift * self.mass
            if progress is not None:
                progress(0.0)  # it may have been stopped by now
            self._factors = factorise(matrix, lambda: self.analysis, progress)
        return self._factors


class Pencil:
    """K and M on what is free.

    Parameters
    ----------
    stiffness, mass : scipy.sparse.csr_matrix of float64, shape (3V, 3V)
        K and M; component c of vertex v is row 3 v + c.
    free : array_like of bool, shape (3V,)
        Which components can move.
    points : ndarray of float64, shape (V, 3), optional
        Vertices [m], for rigid motions.

    Raises
    ------
    InputError
        If the shapes do not fit, nothing is free, or a free component has no mass.
    """

    def __init__(
        self,
        stiffness: sp.csr_matrix,
        mass: sp.csr_matrix,
        free: ArrayLike,
        points: FloatArray | None = None,
    ) -> None:
        self.where = _checked(stiffness, mass, free)
        self.size = stiffness.shape[0]
        self.points = points
        self.stiffness = stiffness[self.where][:, self.where]
        self.mass = mass[self.where][:, self.where]
        massless = self.mass.diagonal() <= 0
        if massless.any():
            raise InputError(
                f"{massless.sum()} free components have no mass, the first is index "
                f"{self.where[massless.argmax()]}",
                cure="Remove the points that belong to no tetrahedron",
            )

    @cached_property
    def pieces(self) -> list[Piece]:
        """The connected parts, in the order of their first components."""
        vertices = self.where // 3
        graph = abs(self.stiffness) + abs(self.mass)
        count, piece_of = csgraph.connected_components(graph, directed=False)
        if count == 1:
            return [Piece(np.arange(len(self.where)), self.stiffness, self.mass, vertices)]
        pieces = []
        for piece in range(count):
            rows = np.flatnonzero(piece_of == piece)
            k, m = self.stiffness[rows][:, rows], self.mass[rows][:, rows]
            pieces.append(Piece(rows, k, m, vertices[rows]))
        return pieces

    @cached_property
    def rigid(self) -> FloatArray:
        """The motions without strain, mass-normalised, shape (N, r)."""
        blocks = []
        for piece in self.pieces:
            motions = self._motions(piece)
            whole = np.zeros((len(self.where), motions.shape[1]))
            whole[piece.rows] = motions
            blocks.append(whole)
        return np.concatenate(blocks, axis=1)

    def solve(self, forces: FloatArray) -> FloatArray:
        """Return static displacements, as `spacemap_vtk.modal.model.Model.solve` does.

        Parameters
        ----------
        forces : ndarray of float64, shape (N, m)
            Right-hand sides.

        Returns
        -------
        ndarray of float64, shape (N, m)
            Solutions of K u = f.

        Raises
        ------
        SolverError
            If they do not settle.
        """
        result = np.empty_like(forces)
        with threads.for_size(len(forces)):
            rigid = self.rigid
            for piece in self.pieces:
                mine = rigid[piece.rows]
                mine = mine[:, np.abs(mine).max(axis=0, initial=0.0) > 0.0]
                result[piece.rows] = _solved(piece, forces[piece.rows], mine)
        return result

    def _motions(self, piece: Piece) -> FloatArray:
        """Return what of the six rigid motions costs a piece no energy."""
        if self.points is None:
            raise InputError("rigid motions need the vertices", key="points")
        away = self.points[piece.vertices]
        away = away - away.mean(axis=0)
        away /= max(float(np.abs(away).max()), np.finfo(float).tiny)
        component = self.where[piece.rows] % 3
        six = np.zeros((len(away), 6))
        for axis in range(3):
            six[component == axis, axis] = 1.0
            turn = np.cross(np.eye(3)[axis], away)
            six[:, 3 + axis] = turn[np.arange(len(turn)), component]
        basis = la.orth(six)
        noise = np.abs(basis).T @ (abs(piece.stiffness) @ np.abs(basis))
        energy, turn = la.eigh(basis.T @ (piece.stiffness @ basis))
        motions = basis @ turn[:, energy <= _NO_ENERGY * np.linalg.norm(noise)]
        if motions.shape[1] == 0:  # LAPACK as of scipy 1.10 takes no empty matrices
            return motions
        factor = np.linalg.cholesky(motions.T @ (piece.mass @ motions))
        return la.solve_triangular(factor, motions.T, lower=True).T


def _solved(piece: Piece, forces: FloatArray, rigid: FloatArray) -> FloatArray:
    """Conjugate gradients on K, with (K + σM)⁻¹ as preconditioner.

    With it the eigenvalues are λ/(λ + σ): all but the few below σ lie at one, so that a handful of
    steps do, and no factors are needed beside those that the modes come from. Columns are worked
    on side by side.
    """
    stiffness, solve = piece.stiffness, piece.factors.solve
    pushed = piece.mass @ rigid
    residual = forces - pushed @ (rigid.T @ forces)
    # What rounding leaves of a force that only accelerates the body is no load.
    floor = np.einsum("nm,nm->m", forces, solve(forces)) if rigid.size else 0.0
    u = np.zeros_like(residual)
    direction, before = None, np.ones(residual.shape[1])
    for _ in range(_STEPS):
        better = solve(residual)
        better -= rigid @ (pushed.T @ better)
        missing = np.einsum("nm,nm->m", residual, better)
        enough = np.maximum(np.abs(np.einsum("nm,nm->m", u, forces)), floor)
        open_ = missing > _CORRECTION**2 * enough
        if not open_.any():
            return u
        share = np.divide(missing, before, out=np.zeros_like(before), where=open_)
        direction = better if direction is None else better + share * direction
        before = missing
        work = stiffness @ direction
        energy = np.einsum("nm,nm->m", direction, work)
        step = np.divide(missing, energy, out=np.zeros_like(before), where=open_ & (energy > 0))
        u += step * direction
        residual -= step * work
    raise SolverError(
        "a static solution does not settle",
        cure="Look for badly shaped tetrahedra, or parts of the cage that hang by one vertex",
    )


def _checked(stiffness: sp.csr_matrix, mass: sp.csr_matrix, free: ArrayLike) -> NDArray[np.int64]:
    """Return the indices of the free components, or say what is wrong."""
    mask = np.asarray(free)
    size = len(mask) if mask.ndim == 1 else -1
    if mask.dtype != bool or size % 3 or not stiffness.shape == mass.shape == (size, size):
        raise InputError(
            f"stiffness {stiffness.shape}, mass {mass.shape} and free ({mask.dtype}, "
            f"{mask.shape}) do not fit each other",
            allowed="shapes (3V, 3V), (3V, 3V) and, bool, (3V,)",
        )
    if not mask.any():
        raise InputError(
            "every vertex of the cage is fixed, nothing can vibrate",
            cure="Fix fewer sides, or divide the cage so that some vertices lie off them",
        )
    return np.flatnonzero(mask)
