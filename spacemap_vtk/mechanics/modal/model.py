"""A supported mesh of one material: its matrices, rigid motions and static solutions.

Everything that depends only on geometry, supports and the *form* of the material is kept in a
`spacemap_vtk.mechanics.modal.mesh_pencil.MeshPencil` of unit modulus and density. A model scales
its results, so another modulus or density costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.fittings import NO_FITTINGS, Fittings
from spacemap_vtk.mechanics.elements.elasticity import nodal_mass
from spacemap_vtk.mechanics.elements.materials import check_limits
from spacemap_vtk.mechanics.elements.plates import Plate, keep_normals_upright
from spacemap_vtk.mechanics.elements.shell import (
    average_over_quads,
    find_layer,
    mid_surface_strains,
)
from spacemap_vtk.mechanics.elements.tetrahedra import check_mesh
from spacemap_vtk.mechanics.modal.mesh_pencil import find_or_make_pencil
from spacemap_vtk.mechanics.modal.residual_vectors import (
    inverse_mass_products,
    movable_mass,
    residual_modes,
)
from spacemap_vtk.ndarrays import Bools, Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm
    from spacemap_vtk.mechanics.modal.eigen import Modes


class Model:
    """K and M of a supported mesh of tetrahedra, or of the sheet that its single layer forms.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Undeformed vertices [m].
    cells : array_like of int, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    material : array_like of float, shape (6, 6), or Plate
        Elasticity matrix [Pa], see `spacemap_vtk.mechanics.elements.materials`; for a one-layer
        lattice also stiffnesses per width, see `spacemap_vtk.mechanics.elements.plates`.
    density : float
        ρ > 0 [kg/m³].
    held : array_like of bool, shape (V, 3)
        Components that cannot move.
    lumped : bool
        Whether the mass is lumped; otherwise it is consistent.
    displacement : array_like of float, shape (V, 3), optional
        Displacement of the equilibrium at which K is the tangent [m]; by default nothing is
        deformed.
    fittings : Fittings, optional
        Sliders along any direction, rigid bodies, springs, masses and factors.
    terms : sequence of EnergyTerm, optional
        Further terms of the energy [J], whose nodes are the vertices.

    Raises
    ------
    GeometryError
        If the mesh is invalid, a tetrahedron is flat, or a plate is given for a mesh that is not a
        one-layer lattice.
    InputError
        If the material is invalid, or nothing can move.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.elements.materials import isotropic
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> held = np.arange(4)[:, None] < [3, 3, 3]
    >>> model = Model(corners, [[0, 1, 2, 3]], isotropic(1e6, 0.0), 1000.0, held)
    >>> [float(round(u, 9)) for u in model.statics(np.eye(12)[11])[0][9:]]
    [0.0, 0.0, 6e-06]
    """

    def __init__(
        self,
        points: ArrayLike,
        cells: ArrayLike,
        material: ArrayLike | Plate,
        density: float,
        held: ArrayLike,
        lumped: bool = False,
        displacement: ArrayLike | None = None,
        fittings: Fittings = NO_FITTINGS,
        terms: Sequence[EnergyTerm] = (),
    ) -> None:
        self.points, self.cells = check_mesh(points, cells)
        self.density = float(density)
        self.lumped = bool(lumped)
        if isinstance(material, Plate) and (material.shear is None or material.thickness is None):
            sheet = find_layer(self.points, self.cells)
            # for a mesh that is not a sheet the pencil raises the error
            material = keep_normals_upright(material, 1.0 if sheet is None else sheet.cell)
        self.plate = material if isinstance(material, Plate) else None
        self.stiffness_parts = parts = _stiffness_parts(material)
        #: Factor of the pencil's stiffness: the largest elasticity [Pa], or for a sheet the largest
        #: membrane stiffness [N/m].
        self.modulus = float(abs(parts[0]).max(initial=0.0)) or 1.0
        check_limits("density", self.density, "kg/m³")
        self.displacement = None if displacement is None else np.asarray(displacement, np.float64)
        self.fittings = fittings
        #: Energy terms other than elements and springs; their nodes are the vertices.
        self.terms = tuple(terms)
        self.pencil = find_or_make_pencil(
            self.points,
            self.cells,
            parts,
            self.modulus,
            np.asarray(held, dtype=bool),
            self.lumped,
            self.displacement,
            fittings._replace(
                springs=None if fittings.springs is None else fittings.springs / self.modulus,
                masses=None if fittings.masses is None else fittings.masses / self.density,
            ),
            self.plate is not None and self.plate.follows_thickness,
            self.terms,
            None if self.plate is None else self.plate.law,
            None if self.plate is None else self.plate.curvature,
        )

    @property
    def elasticity(self) -> Floats:
        """Elasticity matrix of a solid [Pa]."""
        return self.stiffness_parts[0]

    @property
    def digest(self) -> str:
        """Digest of all that the modes depend on, except modulus and density, which scale them."""
        return self.pencil.digest

    @property
    def free(self) -> Bools:
        """Components of the vertices that no support along an axis holds, shape (3V,)."""
        return self.pencil.free

    @property
    def is_grounded(self) -> bool:
        """Whether anything connects the body to its base."""
        normals, springs = self.fittings.normals, self.fittings.springs
        held = not self.free.all() or normals is not None or springs is not None
        return held or bool(self.terms)

    @cached_property
    def stiffness(self) -> csr_matrix:
        """Stiffness K [N/m] of the vertices, shape (3V, 3V), with free and held components."""
        return self.modulus * self.pencil.to_vertices(self.pencil.full_stiffness)

    @cached_property
    def mass(self) -> csr_matrix:
        """Mass M [kg] of the vertices, shape (3V, 3V), with free and held components."""
        return self.density * self.pencil.to_vertices(self.pencil.full_mass)

    @cached_property
    def nodal_mass(self) -> Floats:
        """Row sums of M [kg], shape (V,); multiplied by g they are the load of gravity."""
        surface, fitted = self.pencil.surface, self.fittings
        if surface is None:
            mesh = self.points, self.cells, self.density, self.lumped
            found = nodal_mass(*mesh, fitted.mass_factors)
        else:
            places = self.pencil.assembly.lumps[: len(surface.pairs)] * self.density
            found = surface.to_vertices(np.concatenate([places, 0.0 * places])) / 2
        return found if fitted.masses is None else found + fitted.masses

    @cached_property
    def movable_mass(self) -> Floats:
        """Sum of the effective masses of all modes along x, y and z [kg], shape (3,)."""
        if (
            self.pencil.surface is None
            and self.pencil.has_plain_supports
            and self.fittings.masses is None
        ):
            return movable_mass(self.pencil.assembly, self.density, self.lumped, self.free)
        forces = np.einsum("v,ij->vij", self.nodal_mass, np.eye(3)).reshape(-1, 3)
        loads, mass = self.pencil.reduce_forces(forces), self.density * self.pencil.mass
        return inverse_mass_products(lambda x: mass @ x, mass.diagonal(), loads)

    @cached_property
    def rigid_modes(self) -> Floats:
        """Mass-normalised motions without strain that the supports allow, shape (3V, r)."""
        return self.pencil.expand(self.pencil.rigid_modes) / np.sqrt(self.density)

    @cached_property
    def forces(self) -> Floats:
        """Forces that hold the equilibrium [N], shape (3V,), on free and held components."""
        forces, surface = self.pencil.nodes.forces, self.pencil.surface
        if forces is None:
            return np.zeros(self.points.size)
        result: Floats = surface.to_vertices(forces) / 2 if surface else forces
        return self.modulus * result.ravel()

    @cached_property
    def strain_energy(self) -> float:
        """Energy that is stored in the equilibrium [J]."""
        if self.displacement is None:
            return 0.0
        positions = self.pencil.nodes.positions
        return self.modulus * sum(term.energy(positions) for term in self.pencil.terms)

    def statics(self, forces: ArrayLike) -> tuple[Floats, Floats]:
        """Solve K u = f for static displacements, and estimate their rounding errors.

        If the supports allow rigid motions, the part of the forces that accelerates the body as a
        whole is removed (inertia relief), and displacements are M-orthogonal to these motions.

        Parameters
        ----------
        forces : array_like of float, shape (3V,) or (3V, m)
            Forces on the vertices [N]; those on held components act on the supports.

        Returns
        -------
        displacements : ndarray of float64, shape of `forces`
            Displacements u [m], zero where held.
        rounding : ndarray of float64, shape (m,)
            Estimated share of u, in the energy norm, that is rounding in K and in the solution:
            1e-10 means that ten digits are correct. The bending stiffness of a thin sheet is so
            much smaller than its membrane stiffness that float64 cannot hold both in one matrix.

        Raises
        ------
        InputError
            If the shape is wrong.
        SizeError
            If the factors do not fit into memory.
        SolverError
            If no digit of the result is correct.
        """
        given, size = np.asarray(forces, dtype=np.float64), self.points.size
        if given.ndim not in (1, 2) or len(given) != size:
            raise InputError(
                f"forces have shape {given.shape}", allowed=f"({size},) or ({size}, m)"
            )
        found, rounding = self.unit_statics(given.reshape(size, -1))
        return (found / self.modulus).reshape(given.shape), rounding

    def unit_statics(self, forces: Floats) -> tuple[Floats, Floats]:
        """Solve for static displacements at unit modulus, and estimate their rounding errors.

        Parameters
        ----------
        forces : ndarray of float64, shape (3V, m)
            Forces on the vertices [N].

        Returns
        -------
        displacements : ndarray of float64, shape (3V, m)
            Displacements u [m] for a modulus of 1 Pa.
        rounding : ndarray of float64, shape (m,)
            See `statics`.
        """
        # One at a time: in a joint solution the last digits of each depend on the others.
        found, rounding = np.empty(forces.shape), np.empty(forces.shape[1])
        for k, force in enumerate(forces.T):
            solved, rounding[k : k + 1] = self.pencil.solve(
                self.pencil.reduce_forces(force[:, None])
            )
            found[:, k] = self.pencil.expand(solved)[:, 0]
        return found, rounding

    def modes(self, count: int, progress: Callable[[float], object] | None = None) -> Modes:
        """Compute the lowest modes at unit modulus and density, with shapes of the vertices.

        Parameters
        ----------
        count : int
            Number of modes n; if there are fewer, all of them.
        progress : callable, optional
            Called with the share that is done, 0 to 1; may raise to stop.

        Returns
        -------
        Modes
            Eigenvalues, shapes (n, V, 3) and rounding (`spacemap_vtk.mechanics.modal.eigen`).

        Raises
        ------
        SolverError
            If no digit of the result is correct.
        """
        from spacemap_vtk.mechanics.modal.eigen import solve_modes

        found = solve_modes(self.pencil, count, progress)
        surface = self.pencil.surface
        if surface is None:
            return found
        shapes = surface.to_vertices(found.shapes.swapaxes(0, 1)).swapaxes(0, 1)
        return found._replace(shapes=np.ascontiguousarray(shapes))

    def residual_modes(
        self, shapes: Floats, eigenvalues: Floats, loads: Floats, statics: Floats
    ) -> tuple[Floats, Floats]:
        """Compute shapes that make the static response to the loads exact.

        Parameters
        ----------
        shapes : ndarray of float64, shape (n, 3V)
            Mass-normalised modes.
        eigenvalues : ndarray of float64, shape (n,)
            Eigenvalues of these modes [1/s²].
        loads : ndarray of float64, shape (3V, m)
            Forces on free components [N].
        statics : ndarray of float64, shape (3V, m)
            Displacements under these forces, from `statics` [m].

        Returns
        -------
        eigenvalues : ndarray of float64, shape (k,)
            Ascending [1/s²].
        shapes : ndarray of float64, shape (k, 3V)
            Mass-normalised shapes, M-orthogonal to the modes.
        """
        if self.pencil.surface is None and self.pencil.has_plain_supports:
            matrices = self.stiffness, self.mass
            return residual_modes(shapes, eigenvalues, *matrices, loads, statics)
        # In the pencil's coordinates, as K of a sheet's vertices has few correct digits of bending.
        pencil = self.pencil
        values, found = residual_modes(
            pencil.reduce_displacements(shapes.T).T,
            eigenvalues,
            self.modulus * pencil.stiffness,
            self.density * pencil.mass,
            pencil.reduce_forces(loads),
            pencil.reduce_displacements(statics),
        )
        return values, pencil.expand(found.T).T

    def solve_equilibrium(
        self,
        forces: Floats,
        progress: Callable[[float], object] | None = None,
        guess: Floats | None = None,
    ) -> tuple[Floats, float | None]:
        """Compute the equilibrium of the undeformed body under dead loads, at any displacement.

        Parameters
        ----------
        forces : ndarray of float64, shape (3V,)
            Forces on the vertices [N] of constant direction.
        progress : callable, optional
            Called with the share that is done, 0 to 1; may raise to stop.
        guess : ndarray of float64, shape (V, 3), optional
            Displacement of the vertices near which the equilibrium is expected [m].

        Returns
        -------
        displacement : ndarray of float64, shape (V, 3)
            Displacement of the vertices to the stable equilibrium [m].
        critical : float or None
            Share of the load at which the body buckled (left an unstable state), if it did. It is
            not known if the equilibrium is found near a guess.

        Raises
        ------
        InputError
            If nothing holds the body against the load, or a part of it is rigid.
        SolverError
            If no stable state was found; the message gives the share of the load up to which there
            was one.
        """
        from spacemap_vtk.mechanics.elements.turning import TurningMoves
        from spacemap_vtk.mechanics.equilibrium.energy_terms import DeadLoad
        from spacemap_vtk.mechanics.equilibrium.newton import find_equilibrium

        self.require_no_rigid_places()
        pencil, surface = self.pencil, self.pencil.surface
        load = forces.reshape(-1, 3) / self.modulus
        load = load if surface is None else 2 * surface.to_nodes(load)
        start = pencil.nodes.positions
        loads = [DeadLoad(load, start)]
        turn, near = None, None
        if guess is not None:
            near = start + (guess if surface is None else surface.to_nodes(guess))
            if surface is not None:
                turn = TurningMoves(self.points, surface, pencil.basis.tocsr()).turn
        found = find_equilibrium(
            pencil.terms, pencil.basis, start, loads, progress=progress, turn=turn, guess=near
        )
        moved = found.positions - start
        return (moved if surface is None else surface.to_vertices(moved)), found.critical

    def require_no_rigid_places(self) -> None:
        """Refuse an equilibrium under large rotations of a body with rigid places.

        Raises
        ------
        InputError
            If there are rigid places, whose constraints are those of small rotations.
        """
        if self.fittings.bodies is not None:
            raise InputError(
                "a cage with a rigid place cannot hang, lie on obstacles or follow grips: the "
                "place can turn by small angles only",
                key="rigid",
                cure="Fix the place, or hold it with a grip, which moves as a rigid body; "
                "stiffness_factors make a place that is free nearly rigid.",
            )

    def holding_forces(
        self, displacement: Floats, forces: Floats, terms: Sequence[EnergyTerm] | None = None
    ) -> Floats:
        """Compute the forces by which supports and grips hold the body in an equilibrium.

        Parameters
        ----------
        displacement : ndarray of float64, shape (V, 3)
            Displacement of the vertices from the undeformed shape [m].
        forces : ndarray of float64, shape (3V,)
            Dead loads on the vertices [N].
        terms : sequence of EnergyTerm, optional
            Terms that replace those of the model: its obstacles, with the friction of the state.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Forces on the held components [N]: what the terms of the energy need less the loads.
            Zero on all others.
        """
        pencil, surface = self.pencil, self.pencil.surface
        place = self.points + displacement
        place = place if surface is None else surface.to_nodes(place)
        every = pencil.terms
        if terms is not None:
            own = every[: len(every) - len(pencil.added)]
            every = [*own, *(term.in_model_nodes(surface, 1 / self.modulus) for term in terms)]
        load = forces.reshape(-1, 3) / self.modulus
        load = load if surface is None else 2 * surface.to_nodes(load)
        total = np.sum([term.forces(place) for term in every], axis=0) - load
        # The columns of the basis are orthonormal.
        basis = pencil.basis
        total = total - (basis @ (basis.T @ total.ravel())).reshape(-1, 3)
        result: Floats = total if surface is None else surface.to_vertices(total) / 2
        return self.modulus * result

    def estimate_bytes(self, layers: float) -> int:
        """Estimate the memory that an equilibrium needs.

        Parameters
        ----------
        layers : float
            Cells through the thickness of a slab, see `eigen.estimate_bytes`.

        Returns
        -------
        int
            Bytes of strains, their gradients and tangents, and of the factors.
        """
        from spacemap_vtk.mechanics.modal.eigen import estimate_bytes

        # Per element: its forms, and about five arrays of the size of its tangent.
        nodes, strains = (8, 32) if self.pencil.surface else (self.cells.shape[1], 6)
        strains *= 4 if self.cells.shape[1] == 10 else 1
        each = 8 * (strains * (nodes**2 + 6 * nodes) + 5 * (3 * nodes) ** 2)
        cells = len(self.pencil.surface.quads) if self.pencil.surface else len(self.cells)
        return round(1.8 * each * cells) + estimate_bytes(self.pencil.size, 8, layers)

    def strain_and_stress(self, moved: Floats, large: bool = False) -> tuple[Floats, Floats]:
        """Compute strain and stress of each tetrahedron for a displacement from the equilibrium.

        Parameters
        ----------
        moved : ndarray of float64, shape (V, 3)
            Displacement from the equilibrium [m].
        large : bool, optional
            Whether strains are Green's; by default they are linear in the displacement.

        Returns
        -------
        strain : ndarray of float64, shape (T, 6)
            Mean over each tetrahedron, including the strain of the equilibrium: xx, yy, zz, yz, zx,
            xy, with engineering shears. For a sheet, the strain of its mid-surface.
        stress : ndarray of float64, shape (T, 6)
            Stress [Pa]; for a sheet the mean over its thickness.
        """
        pencil = self.pencil
        positions, surface = pencil.nodes.positions, pencil.surface
        moved = moved if surface is None else surface.to_nodes(moved)
        if large:
            positions, moved = positions + moved, np.zeros_like(moved)
        if surface is None:
            solid = pencil.elements[0]
            strain, gradients = solid.strains_and_gradients(positions)
            mean = (strain + solid.strain_changes(gradients, moved)).mean(axis=1)
            return mean, self.stress(mean)
        assert self.plate is not None
        mean, pull = mid_surface_strains(pencil.elements, positions, moved, surface, self.plate)
        pull *= surface.relative_thickness(self.points, self.plate)[surface.quads].mean(axis=1)[
            :, None
        ]
        stress = pull / surface.thickness(self.points)[surface.quads].mean(axis=1)[:, None]
        if (factors := average_over_quads(self.fittings.stiffness_factors)) is not None:
            stress *= factors[:, None]
        return np.repeat(mean, 5, axis=0), np.repeat(stress, 5, axis=0)

    def stress(self, strain: Floats) -> Floats:
        """Compute the stress of each tetrahedron of a solid.

        Parameters
        ----------
        strain : ndarray of float64, shape (T, 6)
            Strain as returned by `strained`.

        Returns
        -------
        ndarray of float64, shape (T, 6)
            Stress [Pa].
        """
        stress, factors = strain @ self.elasticity, self.fittings.stiffness_factors
        return stress if factors is None else stress * factors[:, None]


def _stiffness_parts(material: ArrayLike | Plate) -> list[Floats]:
    """Return the stiffness matrices of a material: one for a solid, four for a plate."""
    if isinstance(material, Plate):
        parts = material.membrane, material.bending, material.shear, material.thickness
        return [np.asarray(part, dtype=np.float64) for part in parts]
    matrix = np.array(material, dtype=np.float64)
    square = matrix.shape == (6, 6) and bool(np.isfinite(matrix).all())
    if not square or not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
        raise InputError(
            "this is not an elasticity matrix",
            key="elasticity",
            value=f"array of shape {matrix.shape}",
            allowed="a finite, symmetric matrix of shape (6, 6)",
            cure="Make one with isotropic(youngs_modulus, poissons_ratio)",
        )
    return [matrix]
