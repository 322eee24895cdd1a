"""The free part of K and M, in components that no element joins, and static solutions of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.supports import six_motions, turned
from spacemap_vtk.ndarrays import Bools, Floats, Ints

# Modes may come from a cache: all of scipy that solves is imported where something is solved.
if TYPE_CHECKING:
    import scipy.sparse as sp

    from spacemap_vtk.mechanics.factors import Factors, Solve
    from spacemap_vtk.mechanics.multifrontal import Analysis


#: Share of a cage's size that a rigid motion moves what is held, at most, by rounding. A clamped
#: sheet that turns about its edge moves the edge by its thickness over its length.
_HELD = 1e-11

#: Weight of the share by which the loads turn with a rigid motion: an equilibrium is one to 1e-6.
_TURNED = 1e-5

#: A static solution is done when a correction would change it by this share, in energy's norm.
_CORRECTION = 1e-14

#: Steps that are tried. Few eigenvalues lie below σ, and each costs about one; so many cost about
#: as much as to factorise K again.
_STEPS = 40

#: Share of the shift by which a sheet is stretched and sheared that is one for its bending.
_SOFT = 1e-3

#: Shifts nearer to zero, as shares of the largest ratio of stiffness and mass.
_SHIFTS = (1e-14, 1e-13, 1e-12)

#: Share of a static solution, in energy's norm, of which it can no longer be told from rounding.
_NO_DIGIT = 0.1

#: Relative error of float64.
_ROUNDING = 2.0**-53


class Nodes(NamedTuple):
    """Where the nodes of a mesh are, and what they are."""

    positions: Floats
    """Those that the stiffness is of [m], (V, 3)."""
    translate: Bools
    """Which are places; of a sheet there are half thicknesses, which only turn, (V,)."""
    forces: Floats | None = None
    """What strains it there, where anything does, (V, 3)."""
    springs: sp.csr_matrix | None = None
    """What springs to the base do to displacements, (3V, 3V), whatever their stiffness."""

    @property
    def groups(self) -> Ints:
        """The nodes that are places: others belong to one each, in their order."""
        return np.flatnonzero(self.translate)

    def rigid(self, near: Ints) -> tuple[Floats, Floats]:
        """Return the six rigid motions of some nodes, (3n, 6), and the loads' turning with them."""
        loads = np.zeros((len(near), 3, 6))
        if self.forces is not None and self.forces.any():
            loads[:, :, 3:] = turned(self.forces[near] / abs(self.forces).max())
        six = six_motions(self.positions[near], self.translate[near])
        return six, loads.reshape(-1, 6)


class Pencil:
    """K and M on what is free. Of a mesh that hangs together it is its own, and only, component."""

    # Displacements are a basis times the coordinates that are free: of tetrahedra, columns of the
    # unit matrix. Of what no vertex is held against, of two vertices where only one is, or of those
    # that move as one, the basis says how they go together; its columns are orthogonal.

    def __init__(
        self,
        stiffness: sp.csr_matrix,
        mass: sp.csr_matrix,
        basis: sp.csc_matrix,
        nodes: Nodes | None = None,
        strain_products: Callable[[Floats], Floats] | None = None,
    ) -> None:
        self.whole_stiffness, self.whole_mass, self.basis = stiffness, mass, basis
        self.nodes: Nodes | None = nodes
        self.strain_products: Callable[[Floats], Floats] | None = strain_products

    _factors: Factors | None = None

    @property
    def size(self) -> int:
        """Degrees of freedom."""
        return int(self.basis.shape[1])

    @cached_property
    def rows(self) -> Ints:
        """Which coordinates of the pencil that it is a component of are its own."""
        return np.arange(self.size)

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """K of what is free."""
        return self._reduced(self.whole_stiffness)

    @cached_property
    def mass(self) -> sp.csr_matrix:
        """M of what is free."""
        mass = self._reduced(self.whole_mass)
        massless = mass.diagonal() <= 0
        if massless.any():
            raise InputError(
                f"{massless.sum()} free components have no mass, the first is index "
                f"{self.basis.indices[self.basis.indptr[massless.argmax()]]}",
                cure="Remove the points that belong to no tetrahedron",
            )
        return mass

    def _reduced(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        basis = self.basis
        if basis.nnz == self.size and (basis.data == 1.0).all():
            return matrix[basis.indices][:, basis.indices]
        return (basis.T @ matrix @ basis).tocsr()

    @cached_property
    def _parts(self) -> list[Pencil]:
        """The parts that hang together; none where it is one, which would hold itself."""
        from scipy.sparse import csgraph

        graph = abs(self.stiffness) + abs(self.mass)
        count, owner = csgraph.connected_components(graph, directed=False)
        parts = []
        for part in range(count) if count > 1 else ():
            rows = np.flatnonzero(owner == part)
            whole = self.whole_stiffness, self.whole_mass, self.basis[:, rows]
            parts.append(Pencil(*whole, self.nodes, self.strain_products))
            parts[-1].rows = rows
        return parts

    @property
    def components(self) -> list[Pencil]:
        """The parts that no element joins, in the order of their first rows."""
        return self._parts or [self]

    @cached_property
    def shift(self) -> float:
        """The σ of the kept factors."""
        diagonal = self.stiffness.diagonal()
        if not (diagonal >= 0).all() or not diagonal.any():
            raise SolverError(
                "the stiffness matrix is not positive semidefinite",
                cure="Check the material and the supports of the cage",
            )
        from spacemap_vtk.mechanics.lanczos import shift

        places = self._places
        if len(places) == self.size:
            return shift(self.stiffness, self.mass)
        inner = (matrix[places][:, places] for matrix in (self.stiffness, self.mass))
        return _SOFT * shift(*inner)

    @cached_property
    def _places(self) -> Ints:
        """The coordinates that place a node, and do not turn its half thickness; of none, all."""
        # Half thicknesses are so much stiffer than what they weigh that all else is slow beside
        # them. They move by little where a sheet bends, and a factor is good to each row's size.
        node = self.basis.indices[self.basis.indptr[:-1]] // 3
        alone = np.diff(self.basis.indptr) == 1
        if self.nodes is not None:
            alone &= self.nodes.translate[node]
        return np.flatnonzero(alone) if alone.any() else np.arange(self.size)

    @property
    def _fastest(self) -> float:
        """The largest ratio of stiffness and mass of what places a node."""
        ratio = self.stiffness.diagonal() / self.mass.diagonal()
        return float(ratio[self._places].max())

    def lower_shift(self) -> bool:
        """Bring σ nearer to zero, for modes that do not converge."""
        # A free, very thin sheet bends so far below σ that its modes look alike from there. Of the
        # ratios the least counts: a sheet's largest is of its thickness, (width/thickness)² above.
        least = _SHIFTS[-1] * float((self.stiffness.diagonal() / self.mass.diagonal()).min())
        lower = max(1e-6 * self.shift, least)
        if lower >= 0.5 * self.shift:
            return False
        self.shift, self._factors = lower, None
        return True

    @cached_property
    def analysis(self) -> Analysis:
        """Symbolic factorisation of the pattern of K and M, made once."""
        from spacemap_vtk.mechanics.multifrontal import Analysis

        node = self.basis.indices[self.basis.indptr[:-1]] // 3
        together = node if self.nodes is None else node % len(self.nodes.groups)
        return Analysis(abs(self.stiffness) + abs(self.mass), together)

    @property
    def factors(self) -> Factors:
        """Factors of K + σM, made once."""
        return self.factorised(None)

    def factorised(self, progress: Callable[[float], object] | None) -> Factors:
        """Return the factors, and report while they are made."""
        from spacemap_vtk.mechanics.factors import factorise

        if self._factors is None:
            matrix = self.stiffness + self.shift * self.mass
            if progress is not None:
                progress(0.0)  # it may have been stopped by now
            self._factors = factorise(matrix, lambda: self.analysis, progress)
        return self._factors

    @cached_property
    def rigid(self) -> Floats:
        """The motions without strain, mass-normalised, shape (N, r)."""
        blocks = []
        for component in self.components:
            motions = component.motions
            whole = np.zeros((self.size, motions.shape[1]))
            whole[component.rows] = motions
            blocks.append(whole)
        return np.concatenate(blocks, axis=1)

    def solve(self, forces: Floats) -> tuple[Floats, Floats]:
        """Return static displacements, as `spacemap_vtk.mechanics.model.Model.statics` does."""
        from spacemap_vtk.mechanics import blas_threads

        result, rounding = np.empty_like(forces), np.zeros(forces.shape[1])
        with blas_threads.one():
            rigid = self.rigid
            for component in self.components:
                rows = component.rows
                mine = rigid[rows]
                mine = mine[:, np.abs(mine).max(axis=0, initial=0.0) > 0.0]
                result[rows], share = _solved(component, forces[rows], mine)
                rounding = np.maximum(rounding, share)
        return result, rounding

    @cached_property
    def motions(self) -> Floats:
        """What of the six rigid motions of a component moves nothing that is held."""
        from scipy import linalg as la

        # That is seen from the vertices alone. The energy of such a motion would not tell: that of
        # a thin clamped sheet that turns about its edge is rounding in K.
        if self.nodes is None:
            raise InputError("rigid motions need the vertices", key="points")
        touched = np.unique(self.basis.indices)
        # Within a rigid piece K is zero, and joins no nodes.
        near = np.unique(np.concatenate([touched, self.whole_stiffness[touched].indices]) // 3)
        basis = self.basis[(3 * near[:, None] + np.arange(3)).ravel()]
        six, loads = self.nodes.rigid(near)
        share = (basis.T @ six) / np.asarray(basis.multiply(basis).sum(axis=0)).ravel()[:, None]
        # What is held against it, and what would turn the loads under which it hangs.
        held = six - basis @ share
        if self.nodes.springs is not None:
            rows = (3 * near[:, None] + np.arange(3)).ravel()
            held = np.concatenate([held, self.nodes.springs[:, rows] @ six])
        held = held[abs(held).max(axis=1) > _HELD]
        motions = share
        if len(held) or loads.any():
            # of the triangle, as there may be many rows
            rows = np.concatenate([held, _TURNED * loads, np.zeros((6, 6))])
            triangle = la.qr(rows, mode="r")[0][:6]
            _, moved, turn = la.svd(triangle)
            motions = motions @ turn[moved <= _HELD * np.sqrt(max(len(held), 1))].T
        if motions.shape[1] and len(self._places) == self.size:
            motions = la.orth(motions)
        elif motions.shape[1]:
            # Of small half thicknesses no digit is lost in sums of motions.
            _, length, turn = la.svd(motions, full_matrices=False)
            kept = length > _HELD * length[0]
            motions = motions @ (turn[kept].T / length[kept])
        if motions.shape[1] == 0:  # LAPACK as of scipy 1.10 takes no empty matrices
            return motions
        factor = np.linalg.cholesky(motions.T @ (self.mass @ motions))
        return la.solve_triangular(factor, motions.T, lower=True).T


def _solved(component: Pencil, forces: Floats, rigid: Floats) -> tuple[Floats, Floats]:
    """Return static displacements, (n, m), and the share of each that is rounding, (m,)."""
    # The factors that the modes come from do, unless many eigenvalues lie below σ. So it is with
    # the bending of a thin sheet, for which K is factorised again, closer to zero.
    solve = component.factors.solve
    u, settled = _conjugate_gradients(component, solve, forces, rigid)
    if not settled:
        solve = _near_zero(component).solve
        u, _ = _conjugate_gradients(component, solve, forces, rigid)
    # What is missing still, and what it takes that each entry of K is a rounded one: of random
    # sign, as an honest bound would be a hundred times too pessimistic.
    stiffness = component.stiffness
    residual = forces - component.mass @ (rigid @ (rigid.T @ forces)) - stiffness @ u
    rounding = _ROUNDING * np.sqrt(stiffness.multiply(stiffness).tocsr() @ u**2)
    rounding *= np.random.default_rng(0).choice([-1.0, 1.0], (len(u), 1))
    lost = np.zeros(u.shape[1])
    for force in (residual, rounding):
        moved = solve(force)
        moved -= rigid @ ((component.mass @ rigid).T @ moved)
        lost += np.abs(np.einsum("nm,nm->m", force, moved))
    energy = np.abs(np.einsum("nm,nm->m", u, forces))
    share = np.sqrt(np.divide(lost, energy, out=np.zeros_like(lost), where=energy > 0))
    if rigid.size:  # a force that only accelerates the body leaves nothing but rounding
        share[energy <= _CORRECTION * np.einsum("nm,nm->m", forces, solve(forces))] = 0.0
    if (share > _NO_DIGIT).any():
        raise SolverError(
            "no digit of a static solution is left by rounding",
            cure="Take a coarser cage, or a thicker one; look for badly shaped tetrahedra, and "
            "for parts of the cage that hang by an edge or a vertex alone",
        )
    return u, share


def _near_zero(component: Pencil) -> Factors:
    """Return factors of K + σM for the least σ that keeps it positive definite in float64."""
    from spacemap_vtk.mechanics.factors import factorise

    ratio = component._fastest
    for share in _SHIFTS:
        try:
            return factorise(
                component.stiffness + share * ratio * component.mass, lambda: component.analysis
            )
        except SolverError:
            continue
    return component.factors


def _conjugate_gradients(
    component: Pencil, solve: Solve, forces: Floats, rigid: Floats
) -> tuple[Floats, bool]:
    """Solve on K with (K + σM)⁻¹ as preconditioner; tell whether the solutions settled."""
    # With it the eigenvalues are λ/(λ + σ): all but the few below σ lie at one, so that a handful
    # of steps do. Columns are worked on side by side.
    stiffness = component.stiffness
    pushed = component.mass @ rigid
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
            return u, True
        share = np.divide(missing, before, out=np.zeros_like(before), where=open_)
        direction = better if direction is None else better + share * direction
        before = missing
        work = stiffness @ direction
        energy = np.einsum("nm,nm->m", direction, work)
        step = np.divide(missing, energy, out=np.zeros_like(before), where=open_ & (energy > 0))
        u += step * direction
        residual -= step * work
    return u, False


def selection(free: Bools) -> sp.csc_matrix:
    """Return the columns of the unit matrix for what is free, (3V, N)."""
    import scipy.sparse as sp

    rows = np.flatnonzero(free)
    columns = np.arange(len(rows) + 1)
    shape = len(free), len(rows)
    return some(sp.csc_matrix((np.ones(len(rows)), rows, columns), shape=shape))


def some(basis: sp.csc_matrix) -> sp.csc_matrix:
    """Return a basis, or refuse that of nothing."""
    if basis.shape[1] == 0:
        raise InputError(
            "every vertex of the cage is fixed, nothing can vibrate",
            cure="Fix fewer sides, or divide the cage so that some vertices lie off them",
        )
    return basis
