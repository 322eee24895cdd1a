"""K and M of the free coordinates, split into disconnected components, and static solutions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.boundary.supports import largest_arm, rigid_motions, small_rotations
from spacemap_vtk.ndarrays import Bools, Floats, Ints

# Modes may come from a cache, so the solvers of scipy are imported only where something is solved.
if TYPE_CHECKING:
    import scipy.sparse as sp

    from spacemap_vtk.mechanics.linalg.factors import Factors, Solve
    from spacemap_vtk.mechanics.linalg.fronts import Analysis


#: A rigid motion moves a held component by rounding alone if it moves it by at most this share of
#: the cage's size. If a clamped sheet turns about its edge, the edge moves by the sheet's thickness
#: over its length, which has to be more.
_HELD = 1e-11

#: Weight of the turning of loads in a rigid motion: an equilibrium only has to balance to 1e-6.
_LOAD_ROTATION_WEIGHT = 1e-5

#: A static solution is complete when a correction changes it by less than this share, in the energy
#: norm.
_CORRECTION = 1e-14

#: Largest number of conjugate gradient steps. Few eigenvalues lie below σ, and each costs about one
#: step. More steps than this would cost about as much as factorising K again.
_MAX_STEPS = 40

#: Share of the shift for stretching and shearing a sheet that is suitable for its bending.
_BENDING_SHARE = 1e-3

#: Shifts closer to zero, as shares of the largest ratio of stiffness to mass.
_SHIFTS = (1e-14, 1e-13, 1e-12)

#: If rounding is more than this share of a static solution, in the energy norm, no digit of it is
#: correct.
_MAX_ROUNDING = 0.1

#: Relative error of float64.
_ROUNDING = 2.0**-53


class Nodes(NamedTuple):
    """Positions of a mesh's nodes, their kinds, and what acts on them."""

    positions: Floats
    """Positions at which the stiffness is the tangent [m], (V, 3)."""
    translate: Bools
    """Whether a node is a position; half thicknesses of a sheet are not, and only turn, (V,)."""
    forces: Floats | None = None
    """Forces that hold the equilibrium, if it is strained, (V, 3)."""
    strain_forces: Floats | None = None
    """Share of these forces that holds the strains of the elements, (V, 3)."""
    tangent: sp.csr_matrix | None = None
    """Tangent of what else acts on a strained mesh, (3V, 3V)."""
    springs: sp.csr_matrix | None = None
    """Matrix of the springs to the base, scaled to ignore their stiffness, (3V, 3V)."""

    @property
    def groups(self) -> Ints:
        """Numbers of the nodes with a position; each other node belongs to one, in their order."""
        return np.flatnonzero(self.translate)

    def rigid_motions(self, near: Ints) -> tuple[Floats, Floats]:
        """Compute the six rigid motions of given nodes, (3n, 6), and how they unbalance them."""
        # Forces of the elements turn with a motion; those of other terms change by their tangent.
        loads = np.zeros((3 * len(near), 6))
        six = rigid_motions(self.positions[near], self.translate[near])
        if self.strain_forces is None or not self.strain_forces.any():
            return six, loads
        size = abs(self.strain_forces).max()
        loads[:, 3:] = small_rotations(self.strain_forces[near] / size).reshape(-1, 3)
        if self.tangent is not None:
            rows = (3 * near[:, None] + np.arange(3)).ravel()
            arm = largest_arm(self.positions[near], self.translate[near])
            loads += self.tangent[rows][:, rows] @ six * (arm / size)
        return six, loads


class Pencil:
    """K and M of the free coordinates. A pencil of a connected mesh is its only component."""

    # Displacements are the basis times the free coordinates. For tetrahedra held along axes, its
    # columns are columns of the unit matrix. For supports in other directions, for a pair of which
    # only one vertex is held, and for rigid bodies it describes how components move together; its
    # columns are orthogonal.

    def __init__(
        self,
        stiffness: sp.csr_matrix,
        mass: sp.csr_matrix,
        basis: sp.csc_matrix,
        nodes: Nodes | None = None,
        strain_products: Callable[[Floats], Floats] | None = None,
    ) -> None:
        self.full_stiffness, self.full_mass, self.basis = stiffness, mass, basis
        self.nodes: Nodes | None = nodes
        self.strain_products: Callable[[Floats], Floats] | None = strain_products

    _factors: Factors | None = None

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return int(self.basis.shape[1])

    @cached_property
    def rows(self) -> Ints:
        """Numbers of this component's coordinates in the pencil to which it belongs."""
        return np.arange(self.size)

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """K of the free coordinates."""
        return self._reduce(self.full_stiffness)

    @cached_property
    def mass(self) -> sp.csr_matrix:
        """M of the free coordinates."""
        mass = self._reduce(self.full_mass)
        massless = mass.diagonal() <= 0
        if massless.any():
            raise InputError(
                f"{massless.sum()} free components have no mass, the first is index "
                f"{self.basis.indices[self.basis.indptr[massless.argmax()]]}",
                cure="Remove the points that belong to no tetrahedron",
            )
        return mass

    def _reduce(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        basis = self.basis
        if basis.nnz == self.size and (basis.data == 1.0).all():
            return matrix[basis.indices][:, basis.indices]
        return (basis.T @ matrix @ basis).tocsr()

    @cached_property
    def _connected_parts(self) -> list[Pencil]:
        """Connected parts; empty if there is only one, as a pencil must not refer to itself."""
        from scipy.sparse import csgraph

        graph = abs(self.stiffness) + abs(self.mass)
        count, owner = csgraph.connected_components(graph, directed=False)
        parts = []
        for part in range(count) if count > 1 else ():
            rows = np.flatnonzero(owner == part)
            whole = self.full_stiffness, self.full_mass, self.basis[:, rows]
            parts.append(Pencil(*whole, self.nodes, self.strain_products))
            parts[-1].rows = rows
        return parts

    @property
    def components(self) -> list[Pencil]:
        """Parts that no element connects, in the order of their first rows."""
        return self._connected_parts or [self]

    @cached_property
    def shift(self) -> float:
        """Shift σ of the kept factors."""
        diagonal = self.stiffness.diagonal()
        if not (diagonal >= 0).all() or not diagonal.any():
            raise SolverError(
                "the stiffness matrix is not positive semidefinite",
                cure="Check the material and the supports of the cage",
            )
        from spacemap_vtk.mechanics.linalg.lanczos import choose_shift

        places = self._position_coordinates
        if len(places) == self.size:
            return choose_shift(self.stiffness, self.mass)
        inner = (matrix[places][:, places] for matrix in (self.stiffness, self.mass))
        return _BENDING_SHARE * choose_shift(*inner)

    @cached_property
    def _position_coordinates(self) -> Ints:
        """Coordinates of positions, not of half thicknesses; all coordinates if there are none."""
        # Half thicknesses are so stiff for their mass that everything else is slow in comparison.
        # They hardly move if a sheet bends, and a factor is accurate relative to each row's size.
        node = self.basis.indices[self.basis.indptr[:-1]] // 3
        alone = np.diff(self.basis.indptr) == 1
        if self.nodes is not None:
            alone &= self.nodes.translate[node]
        return np.flatnonzero(alone) if alone.any() else np.arange(self.size)

    @property
    def _largest_ratio(self) -> float:
        """Largest ratio of stiffness to mass among the coordinates of positions."""
        ratio = self.stiffness.diagonal() / self.mass.diagonal()
        return float(ratio[self._position_coordinates].max())

    def lower_shift(self) -> bool:
        """Move σ closer to zero, for modes that do not converge; return whether it has moved."""
        # A free, very thin sheet bends at eigenvalues so far below σ that its modes look alike from
        # there. The least ratio counts, because the largest ratio of a sheet belongs to its
        # thickness and is higher by (width/thickness)².
        least = _SHIFTS[-1] * float((self.stiffness.diagonal() / self.mass.diagonal()).min())
        lower = max(1e-6 * self.shift, least)
        if lower >= 0.5 * self.shift:
            return False
        self.shift, self._factors = lower, None
        return True

    @cached_property
    def analysis(self) -> Analysis:
        """Symbolic factorisation of the pattern of K and M, computed once."""
        from spacemap_vtk.mechanics.linalg.fronts import Analysis

        node = self.basis.indices[self.basis.indptr[:-1]] // 3
        together = node if self.nodes is None else node % len(self.nodes.groups)
        return Analysis(abs(self.stiffness) + abs(self.mass), together)

    @property
    def factors(self) -> Factors:
        """Factors of K + σM, computed once."""
        return self.factorise(None)

    def factorise(self, progress: Callable[[float], object] | None) -> Factors:
        """Factorise K + σM if necessary, and report the progress."""
        from spacemap_vtk.mechanics.linalg.factors import factorise

        if self._factors is None:
            matrix = self.stiffness + self.shift * self.mass
            if progress is not None:
                progress(0.0)  # the callback may stop the work by an exception
            self._factors = factorise(matrix, lambda: self.analysis, progress)
        return self._factors

    @cached_property
    def rigid_modes(self) -> Floats:
        """Mass-normalised motions without strain, shape (N, r)."""
        blocks = []
        for component in self.components:
            motions = component.rigid_motions
            whole = np.zeros((self.size, motions.shape[1]))
            whole[component.rows] = motions
            blocks.append(whole)
        return np.concatenate(blocks, axis=1)

    def solve(self, forces: Floats) -> tuple[Floats, Floats]:
        """Solve for static displacements, see `spacemap_vtk.mechanics.modal.model.Model`."""
        from spacemap_vtk.mechanics.linalg import blas_threads

        result, rounding = np.empty_like(forces), np.zeros(forces.shape[1])
        with blas_threads.use_one_thread():
            rigid = self.rigid_modes
            for component in self.components:
                rows = component.rows
                mine = rigid[rows]
                mine = mine[:, np.abs(mine).max(axis=0, initial=0.0) > 0.0]
                result[rows], share = _solve_component(component, forces[rows], mine)
                rounding = np.maximum(rounding, share)
        return result, rounding

    @cached_property
    def rigid_motions(self) -> Floats:
        """Rigid motions of a component in which nothing moves that is held."""
        from scipy import linalg as la

        # The vertices alone decide this. Energy cannot: if a thin clamped sheet turns about its
        # edge, the energy is below rounding in K.
        if self.nodes is None:
            raise InputError("rigid motions cannot be computed without the vertices", key="points")
        touched = np.unique(self.basis.indices)
        # Within a rigid body K is zero and connects no nodes.
        near = np.unique(np.concatenate([touched, self.full_stiffness[touched].indices]) // 3)
        basis = self.basis[(3 * near[:, None] + np.arange(3)).ravel()]
        six, loads = self.nodes.rigid_motions(near)
        share = (basis.T @ six) / np.asarray(basis.multiply(basis).sum(axis=0)).ravel()[:, None]
        # The part of the motions that the supports prevent; turning loads are added below.
        held = six - basis @ share
        if self.nodes.springs is not None:
            rows = (3 * near[:, None] + np.arange(3)).ravel()
            held = np.concatenate([held, self.nodes.springs[:, rows] @ six])
        held = held[abs(held).max(axis=1) > _HELD]
        motions = share
        if len(held) or loads.any():
            # the SVD is of the small triangle, as there may be many rows
            rows = np.concatenate([held, _LOAD_ROTATION_WEIGHT * loads, np.zeros((6, 6))])
            triangle = la.qr(rows, mode="r")[0][:6]
            _, moved, turn = la.svd(triangle)
            motions = motions @ turn[moved <= _HELD * np.sqrt(max(len(held), 1))].T
        if motions.shape[1] and len(self._position_coordinates) == self.size:
            motions = la.orth(motions)
        elif motions.shape[1]:
            # Linear combinations of the motions lose no digit of small half thicknesses.
            _, length, turn = la.svd(motions, full_matrices=False)
            kept = length > _HELD * length[0]
            motions = motions @ (turn[kept].T / length[kept])
        if motions.shape[1] == 0:  # LAPACK rejects empty matrices as of scipy 1.10
            return motions
        factor = np.linalg.cholesky(motions.T @ (self.mass @ motions))
        return la.solve_triangular(factor, motions.T, lower=True).T


def _solve_component(component: Pencil, forces: Floats, rigid: Floats) -> tuple[Floats, Floats]:
    """Solve for static displacements, (n, m), and estimate their shares of rounding, (m,)."""
    # The factors computed for the modes suffice unless many eigenvalues lie below σ. In the bending
    # of a thin sheet many do, and K is factorised again with a shift closer to zero.
    solve = component.factors.solve
    u, settled = _conjugate_gradients(component, solve, forces, rigid)
    if not settled:
        solve = _factorise_near_zero(component).solve
        u, _ = _conjugate_gradients(component, solve, forces, rigid)
    # Errors are the remaining residual, and the rounding of each entry of K. Rounding is given
    # random signs, as a strict bound would be a hundred times too pessimistic.
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
    if rigid.size:  # under a force that only accelerates the body the solution is rounding
        share[energy <= _CORRECTION * np.einsum("nm,nm->m", forces, solve(forces))] = 0.0
    if (share > _MAX_ROUNDING).any():
        raise SolverError(
            "no digit of a static solution is correct, due to rounding",
            cure="Use a coarser or thicker cage; look for badly shaped tetrahedra, and for parts "
            "of the cage that are connected only by an edge or a vertex",
        )
    return u, share


def _factorise_near_zero(component: Pencil) -> Factors:
    """Factorise K + σM with the least σ that keeps it positive definite in float64."""
    from spacemap_vtk.mechanics.linalg.factors import factorise

    ratio = component._largest_ratio
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
    """Solve K u = f with (K + σM)⁻¹ as preconditioner; return whether all columns converged."""
    # The preconditioned eigenvalues are λ/(λ + σ). All but the few below σ are close to one, so a
    # handful of steps suffice. All columns are processed together.
    stiffness = component.stiffness
    pushed = component.mass @ rigid
    residual = forces - pushed @ (rigid.T @ forces)
    # The remainder of a force that only accelerates the body is rounding, not a load.
    floor = np.einsum("nm,nm->m", forces, solve(forces)) if rigid.size else 0.0
    u = np.zeros_like(residual)
    direction, before = None, np.ones(residual.shape[1])
    for _ in range(_MAX_STEPS):
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


def free_columns(free: Bools) -> sp.csc_matrix:
    """Select the columns of the unit matrix for the free components, (3V, N)."""
    import scipy.sparse as sp

    rows = np.flatnonzero(free)
    columns = np.arange(len(rows) + 1)
    shape = len(free), len(rows)
    return require_columns(sp.csc_matrix((np.ones(len(rows)), rows, columns), shape=shape))


def require_columns(basis: sp.csc_matrix) -> sp.csc_matrix:
    """Return the basis; raise InputError if it has no columns."""
    if basis.shape[1] == 0:
        raise InputError(
            "all vertices of the cage are fixed, so nothing can vibrate",
            cure="Fix fewer sides, or divide the cage so that some vertices lie off them",
        )
    return basis
