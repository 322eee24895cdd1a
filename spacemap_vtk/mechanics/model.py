"""A supported mesh of one material: its matrices, its rigid motions, its static states.

Whatever depends on geometry, supports and the *form* of the material alone is kept in a
`spacemap_vtk.mechanics.mesh_pencil.MeshPencil` of unit modulus and density. A model scales it, so
that another modulus or density costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elasticity import nodal_mass
from spacemap_vtk.mechanics.elements import checked_mesh
from spacemap_vtk.mechanics.fittings import NONE, Fittings
from spacemap_vtk.mechanics.materials import check_sizes
from spacemap_vtk.mechanics.mesh_pencil import mesh_pencil
from spacemap_vtk.mechanics.plates import Plate, upright
from spacemap_vtk.mechanics.residual_vectors import movable_mass, moved_by, residual_modes
from spacemap_vtk.mechanics.shell import layer, of_middle, of_quads
from spacemap_vtk.ndarrays import Bools, Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from spacemap_vtk.mechanics.eigen import Modes
    from spacemap_vtk.mechanics.energy_terms import EnergyTerm


class Model:
    """K and M of a mesh of tetrahedra, or of the sheet that its one layer is, held somewhere.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Vertices, undeformed [m].
    cells : array_like of int, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    material : array_like of float, shape (6, 6), or Plate
        Elasticity matrix [Pa], see `spacemap_vtk.mechanics.materials`; or of a one-layer lattice
        what it resists with per width, see `spacemap_vtk.mechanics.plates`.
    density : float
        ρ > 0 [kg/m³].
    held : array_like of bool, shape (V, 3)
        Which components cannot move.
    lumped : bool
        Lumped in place of consistent mass.
    displacement : array_like of float, shape (V, 3), optional
        Of the equilibrium that K is the tangent at [m]; by default nothing is deformed.
    fittings : Fittings, optional
        What is fitted to it: sliders along any direction, rigid bodies, springs, masses, factors.
    terms : sequence of EnergyTerm, optional
        Further terms of its energy [J], of the vertices.

    Raises
    ------
    GeometryError
        If the mesh is none, or a tetrahedron flat, or a plate is given for no one-layer lattice.
    InputError
        If the material is none, or nothing can move.

    Examples
    --------
    >>> from spacemap_vtk.mechanics.materials import isotropic
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> held = np.arange(4)[:, None] < [3, 3, 3]
    >>> model = Model(corners, [[0, 1, 2, 3]], isotropic(1e6, 0.0), 1000.0, held)
    >>> [float(round(u, 9)) for u in model.solve(np.eye(12)[11])[9:]]
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
        fittings: Fittings = NONE,
        terms: Sequence[EnergyTerm] = (),
    ) -> None:
        self.points, self.cells = checked_mesh(points, cells)
        self.density = float(density)
        self.lumped = bool(lumped)
        if isinstance(material, Plate) and (material.shear is None or material.thickness is None):
            sheet = layer(self.points, self.cells)
            # of no sheet the pencil says that it is none
            material = upright(material, 1.0 if sheet is None else sheet.cell)
        self.plate = material if isinstance(material, Plate) else None
        self.parts = parts = _parts(material)
        #: Multiplies the stiffness of the pencil: the largest elasticity [Pa], or of a sheet the
        #: largest resistance to stretching [N/m].
        self.modulus = float(abs(parts[0]).max(initial=0.0)) or 1.0
        check_sizes("density", self.density, "kg/m³")
        self.displacement = None if displacement is None else np.asarray(displacement, np.float64)
        self.fittings = fittings
        #: Terms of the energy beside elements and springs, of the vertices.
        self.terms = tuple(terms)
        self.pencil = mesh_pencil(
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
            self.plate is not None and self.plate.local,
            self.terms,
        )

    @property
    def elasticity(self) -> Floats:
        """Elasticity matrix of a solid [Pa]."""
        return self.parts[0]

    @property
    def digest(self) -> str:
        """Digest of all that the modes depend on but modulus and density, which only scale them."""
        return self.pencil.digest

    @property
    def free(self) -> Bools:
        """Which components of the vertices no support along an axis holds, shape (3V,)."""
        return self.pencil.free

    @property
    def grounded(self) -> bool:
        """Whether anything holds it to its base."""
        normals, springs = self.fittings.normals, self.fittings.springs
        held = not self.free.all() or normals is not None or springs is not None
        return held or bool(self.terms)

    @cached_property
    def stiffness(self) -> csr_matrix:
        """K [N/m] of the vertices, shape (3V, 3V), of free and held components."""
        return self.modulus * self.pencil.of_vertices(self.pencil.whole_stiffness)

    @cached_property
    def mass(self) -> csr_matrix:
        """M [kg] of the vertices, shape (3V, 3V), of free and held components."""
        return self.density * self.pencil.of_vertices(self.pencil.whole_mass)

    @cached_property
    def nodal_mass(self) -> Floats:
        """Row sums of M [kg], shape (V,): gravity's load is their product with g."""
        surface, fitted = self.pencil.surface, self.fittings
        if surface is None:
            mesh = self.points, self.cells, self.density, self.lumped
            found = nodal_mass(*mesh, fitted.mass_factors)
        else:
            places = self.pencil.assembly.lumps[: len(surface.pairs)] * self.density
            found = surface.vertices(np.concatenate([places, 0.0 * places])) / 2
        return found if fitted.masses is None else found + fitted.masses

    @cached_property
    def movable_mass(self) -> Floats:
        """What the effective masses of all modes sum to along x, y and z [kg], shape (3,)."""
        if self.pencil.surface is None and self.pencil.plain and self.fittings.masses is None:
            return movable_mass(self.pencil.assembly, self.density, self.lumped, self.free)
        forces = np.einsum("v,ij->vij", self.nodal_mass, np.eye(3)).reshape(-1, 3)
        loads, mass = self.pencil.gathered(forces), self.density * self.pencil.mass
        return moved_by(lambda x: mass @ x, mass.diagonal(), loads)

    @cached_property
    def rigid(self) -> Floats:
        """The motions without strain that the supports leave, mass-normalised, shape (3V, r)."""
        return self.pencil.spread(self.pencil.rigid) / np.sqrt(self.density)

    @cached_property
    def forces(self) -> Floats:
        """What holds the equilibrium [N], shape (3V,), of free and held components."""
        forces, surface = self.pencil.nodes.forces, self.pencil.surface
        if forces is None:
            return np.zeros(self.points.size)
        result: Floats = surface.vertices(forces) / 2 if surface else forces
        return self.modulus * result.ravel()

    @cached_property
    def strain_energy(self) -> float:
        """What the equilibrium stores [J]."""
        if self.displacement is None:
            return 0.0
        positions = self.pencil.nodes.positions
        return self.modulus * sum(term.energy(positions) for term in self.pencil.terms)

    def solve(self, forces: ArrayLike) -> Floats:
        """Return static displacements, K u = f.

        Where the supports leave rigid motions, forces are freed of the part that accelerates the
        body as a whole (inertia relief), and displacements are M-orthogonal to these motions.

        Parameters
        ----------
        forces : array_like of float, shape (3V,) or (3V, m)
            Forces on the vertices [N]; those on held components go into the supports.

        Returns
        -------
        ndarray of float64, shape of `forces`
            u [m], zero where held.

        Raises
        ------
        InputError
            If the shape is wrong.
        SizeError
            If the factors do not fit into memory.
        SolverError
            If no digit of the answer holds.
        """
        return self.statics(forces)[0]

    def statics(self, forces: ArrayLike) -> tuple[Floats, Floats]:
        """Return static displacements as `solve` does, and how far rounding disturbs them.

        Parameters
        ----------
        forces : array_like of float, shape (3V,) or (3V, m)
            Forces on the vertices [N].

        Returns
        -------
        displacements : ndarray of float64, shape of `forces`
            u [m].
        rounding : ndarray of float64, shape (m,)
            An estimate of the share of u, in energy's norm, that is rounding in K and in the
            solution: 1e-10 means that ten digits hold. A thin sheet resists bending by so much
            less than stretching that float64 cannot tell both in one matrix.

        Raises
        ------
        InputError
            If the shape is wrong.
        SizeError
            If the factors do not fit into memory.
        SolverError
            If no digit of the answer holds.
        """
        given, size = np.asarray(forces, dtype=np.float64), self.points.size
        if given.ndim not in (1, 2) or len(given) != size:
            raise InputError(f"forces of shape {given.shape}", allowed=f"({size},) or ({size}, m)")
        found, rounding = self.unit_statics(given.reshape(size, -1))
        return (found / self.modulus).reshape(given.shape), rounding

    def unit_statics(self, forces: Floats) -> tuple[Floats, Floats]:
        """Return the static displacements of a unit modulus, and how far rounding disturbs them.

        Parameters
        ----------
        forces : ndarray of float64, shape (3V, m)
            Forces on the vertices [N].

        Returns
        -------
        displacements : ndarray of float64, shape (3V, m)
            u [m] where the modulus is 1 Pa.
        rounding : ndarray of float64, shape (m,)
            See `statics`.
        """
        # One after another: of several at once the last digits of each depend on those beside it.
        found, rounding = np.empty(forces.shape), np.empty(forces.shape[1])
        for k, force in enumerate(forces.T):
            solved, rounding[k : k + 1] = self.pencil.solve(self.pencil.gathered(force[:, None]))
            found[:, k] = self.pencil.spread(solved)[:, 0]
        return found, rounding

    def modes(self, count: int, progress: Callable[[float], object] | None = None) -> Modes:
        """Return the lowest modes for unit modulus and density, shapes as the vertices move.

        Parameters
        ----------
        count : int
            Number of modes n; all there are, if more are asked for.
        progress : callable, optional
            Is told the share that is done, 0 to 1; may raise to stop.

        Returns
        -------
        Modes
            Eigenvalues, shapes (n, V, 3) and rounding, see `spacemap_vtk.mechanics.eigen.Modes`.

        Raises
        ------
        SolverError
            If there is no solution to some digits.
        """
        from spacemap_vtk.mechanics.eigen import lowest

        found = lowest(self.pencil, count, progress)
        surface = self.pencil.surface
        if surface is None:
            return found
        shapes = surface.vertices(found.shapes.swapaxes(0, 1)).swapaxes(0, 1)
        return found._replace(shapes=np.ascontiguousarray(shapes))

    def residual_modes(
        self, shapes: Floats, eigenvalues: Floats, loads: Floats, statics: Floats
    ) -> tuple[Floats, Floats]:
        """Return shapes that make the static response to loads exact.

        Parameters
        ----------
        shapes : ndarray of float64, shape (n, 3V)
            Mass-normalised modes.
        eigenvalues : ndarray of float64, shape (n,)
            Of these [1/s²].
        loads : ndarray of float64, shape (3V, m)
            Forces on what is free [N].
        statics : ndarray of float64, shape (3V, m)
            Displacements under them, from `statics` [m].

        Returns
        -------
        eigenvalues : ndarray of float64, shape (k,)
            Ascending [1/s²].
        shapes : ndarray of float64, shape (k, 3V)
            Mass-normalised, and M-orthogonal to the modes.
        """
        if self.pencil.surface is None and self.pencil.plain:
            matrices = self.stiffness, self.mass
            return residual_modes(shapes, eigenvalues, *matrices, loads, statics)
        # In its own coordinates, as K of a sheet's vertices has few digits of bending.
        pencil = self.pencil
        values, found = residual_modes(
            pencil.coordinates(shapes.T).T,
            eigenvalues,
            self.modulus * pencil.stiffness,
            self.density * pencil.mass,
            pencil.gathered(loads),
            pencil.coordinates(statics),
        )
        return values, pencil.spread(found.T).T

    def hung(
        self, forces: Floats, progress: Callable[[float], object] | None = None
    ) -> tuple[Floats, float | None]:
        """Return where the undeformed body comes to rest under dead loads, however far that is.

        Parameters
        ----------
        forces : ndarray of float64, shape (3V,)
            On the vertices [N]; they keep their directions.
        progress : callable, optional
            Is told the share that is done, 0 to 1; may raise to stop.

        Returns
        -------
        displacement : ndarray of float64, shape (V, 3)
            Of the vertices to the stable equilibrium [m].
        critical : float or None
            Share of the load at which it left an unstable state: it has buckled.

        Raises
        ------
        InputError
            If nothing holds it against the load.
        SolverError
            If no stable state was found; it says up to which share of the load there was one.
        """
        from spacemap_vtk.mechanics.energy_terms import DeadLoad
        from spacemap_vtk.mechanics.equilibrium import equilibrium

        if self.fittings.bodies is not None:
            raise InputError(
                "a rigid place turns by small angles only, and what hangs may turn by any",
                key="rigid",
                cure="Fix the place, or leave out modal.gravity and modal.dead_loads.",
            )
        pencil, surface = self.pencil, self.pencil.surface
        load = forces.reshape(-1, 3) / self.modulus
        load = load if surface is None else 2 * surface.nodal(load)
        start = pencil.nodes.positions
        loads = [DeadLoad(load, start)]
        found = equilibrium(pencil.terms, pencil.basis, start, loads, progress=progress)
        moved = found.positions - start
        return (moved if surface is None else surface.vertices(moved)), found.critical

    def estimate_bytes(self, layers: float) -> int:
        """Return the memory that an equilibrium takes.

        Parameters
        ----------
        layers : float
            Cells through the thickness of a slab, see `eigen.estimate_bytes`.

        Returns
        -------
        int
            Bytes: strains, their gradients and tangents, and the factors.
        """
        from spacemap_vtk.mechanics.eigen import estimate_bytes

        # An element's forms, and some of the size of its tangent's rows and columns.
        nodes, strains = (8, 32) if self.pencil.surface else (self.cells.shape[1], 6)
        strains *= 4 if self.cells.shape[1] == 10 else 1
        each = 8 * (strains * (nodes**2 + 6 * nodes) + 5 * (3 * nodes) ** 2)
        cells = len(self.pencil.surface.quads) if self.pencil.surface else len(self.cells)
        return round(1.8 * each * cells) + estimate_bytes(self.pencil.size, 8, layers)

    def strained(self, moved: Floats, large: bool = False) -> tuple[Floats, Floats]:
        """Return strain and stress of each tetrahedron, where vertices move from the equilibrium.

        Parameters
        ----------
        moved : ndarray of float64, shape (V, 3)
            Displacement from the equilibrium [m].
        large : bool, optional
            Whether strains are Green's; by default they are linear in the displacement.

        Returns
        -------
        strain : ndarray of float64, shape (T, 6)
            Mean of each tetrahedron, that of the equilibrium included, as xx, yy, zz, yz, zx, xy,
            shears in engineering measure. Of a sheet that of its middle.
        stress : ndarray of float64, shape (T, 6)
            In Pa; of a sheet the mean over its thickness.
        """
        pencil = self.pencil
        positions, surface = pencil.nodes.positions, pencil.surface
        moved = moved if surface is None else surface.nodal(moved)
        if large:
            positions, moved = positions + moved, np.zeros_like(moved)
        if surface is None:
            solid = pencil.elements[0]
            strain, gradients = solid.strained(positions)
            mean = (strain + solid.changes(gradients, moved)).mean(axis=1)
            return mean, self.stress(mean)
        assert self.plate is not None
        mean, pull = of_middle(pencil.elements, positions, moved, surface, self.plate)
        pull *= surface.taper(self.points, self.plate)[surface.quads].mean(axis=1)[:, None]
        stress = pull / surface.thickness(self.points)[surface.quads].mean(axis=1)[:, None]
        if (factors := of_quads(self.fittings.stiffness_factors)) is not None:
            stress *= factors[:, None]
        return np.repeat(mean, 5, axis=0), np.repeat(stress, 5, axis=0)

    def stress(self, strain: Floats) -> Floats:
        """Return the stress of each tetrahedron of a solid.

        Parameters
        ----------
        strain : ndarray of float64, shape (T, 6)
            As `strained` returns it.

        Returns
        -------
        ndarray of float64, shape (T, 6)
            In Pa.
        """
        stress, factors = strain @ self.elasticity, self.fittings.stiffness_factors
        return stress if factors is None else stress * factors[:, None]


def _parts(material: ArrayLike | Plate) -> list[Floats]:
    """Return what a material's stiffness is made of: one matrix of a solid, four of a plate."""
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
