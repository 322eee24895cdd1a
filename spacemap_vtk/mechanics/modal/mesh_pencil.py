"""K and M of a supported mesh of unit modulus and density, shared between users by content.

A pencil or an assembly is found by a digest of its content as long as it is in use anywhere:
ModalResponse finds the factors that ModalSolver made, although only arrays pass between the two.
Nothing is assembled before it is needed.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.mechanics.boundary.fittings import Fittings
from spacemap_vtk.mechanics.boundary.supports import free_motions
from spacemap_vtk.mechanics.elements.elasticity import (
    Assembly,
    assemble,
    mass_matrix,
    stiffness_matrix,
)
from spacemap_vtk.mechanics.elements.kinematics import strain_products
from spacemap_vtk.mechanics.elements.membrane_law import MembraneLaw
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import (
    assemble_sheet_mass,
    average_over_quads,
    find_mid_surface,
    free_sheet_motions,
    sheet_strains,
)
from spacemap_vtk.mechanics.elements.strains import Strains, springs_to_base, tetrahedron_strains
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    assemble_blocks,
    assemble_tangent,
    digest_of,
)
from spacemap_vtk.mechanics.modal.pencil import Nodes, Pencil, free_columns, require_columns
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix, csr_matrix


#: Significant digits of a material: in moduli of a fixed ratio the last digits are rounding.
_DIGITS = 14


V = TypeVar("V")


class WeakValues(Generic[V]):
    """`weakref.WeakValueDictionary` that runs no Python code when a value is deleted."""

    # A value may be deleted with its stage within VTK's garbage collector, which holds a lock of
    # all threads. Any line of Python that ran there could pass Python's lock to a thread that then
    # waits for VTK's: a deadlock. Deleted values are therefore dropped when the next one is added.

    def __init__(self) -> None:
        self.entries: dict[str, weakref.ref[V]] = {}

    def get(self, key: str) -> V | None:
        """Return a value, or None if it does not exist any more."""
        kept = self.entries.get(key)
        return None if kept is None else kept()

    def __contains__(self, key: str) -> bool:
        return self.get(key) is not None

    def __setitem__(self, key: str, value: V) -> None:
        alive = {k: kept for k, kept in list(self.entries.items()) if kept() is not None}
        self.entries = alive | {key: weakref.ref(value)}


class MeshPencil(Pencil):
    """K and M of a supported mesh of unit modulus and density."""

    # Nothing is assembled before it is needed, as modes may come from a cache.

    def __init__(
        self,
        digest: str,
        mesh: str,
        points: Floats,
        cells: Ints,
        material: list[Floats],
        free: Bools,
        lumped: bool,
        displacement: Floats | None,
        fittings: Fittings,
        local: bool,
        added: Sequence[EnergyTerm],
        modulus: float,
        law: MembraneLaw | None = None,
        curvature: Floats | None = None,
    ) -> None:
        self.digest, self.free, self.material = digest, free, material
        self.fittings, self._local, self._law, self._modulus = fittings, local, law, modulus
        self._curvature = curvature
        self.surface = find_mid_surface(points, cells) if len(material) > 1 else None
        #: Terms other than elements and springs.
        self.added = [term.in_model_nodes(self.surface, 1 / modulus) for term in added]
        if len(material) > 1 and self.surface is None:
            raise GeometryError(
                "the cage cannot be a sheet: it is not a lattice of one layer",
                key="elements",
                value="sheet",
                cure='Set [cage] divisions such as [20, 20, 1] and order = 1, or elements = "auto"',
            )
        self._mesh, self._points, self._cells, self._lumped = mesh, points, cells, lumped
        self._displacement = displacement
        # The assembly is held from now on, so that a solver's last model passes it to the next.
        if (kept := _assemblies.get(mesh)) is not None:
            self.assembly = kept

    @cached_property
    def assembly(self) -> Assembly:
        found = _assemblies.get(self._mesh)
        if found is None:
            stiff, heavy = self._stiffness_factors, self.fittings.mass_factors
            if self.surface is None:
                found = assemble(self._points, self._cells, stiff, heavy)
            else:
                found = assemble_sheet_mass(self._points, self.surface, average_over_quads(heavy))
            _assemblies[self._mesh] = found
        return found

    @property
    def _stiffness_factors(self) -> Floats | None:
        """Stiffness factors of the tetrahedra; zero for those within a rigid body."""
        # These would add only rounding to K, which could not be distinguished from soft springs.
        factors, bodies = self.fittings.stiffness_factors, self.fittings.bodies
        if bodies is None:
            return factors
        mine = bodies[self._cells]
        inside = (mine[:, :1] > 0).ravel() & (mine == mine[:, :1]).all(axis=1)
        return np.where(inside, 0.0, 1.0 if factors is None else factors)

    @cached_property
    def elements(self) -> list[Strains]:
        """Strains of the elements; for a sheet those of its quadrilaterals, then of its pairs."""
        return self._make_elements(self._law, self._curvature)

    @cached_property
    def vibrating_elements(self) -> list[Strains]:
        """The same for vibrations: about the undeformed state, a sheet is linear and flat."""
        # Cloth without tension is just becoming taut. It vibrates with the stiffness of taut yarns.
        if (self._law is None and self._curvature is None) or self._displacement is not None:
            return self.elements
        return self._make_elements(None, None)

    def _make_elements(self, law: MembraneLaw | None, curvature: Floats | None) -> list[Strains]:
        factors = self._stiffness_factors
        if self.surface is None:
            return [tetrahedron_strains(self._points, self._cells, self.material[0], factors)]
        membrane, bending, shear, thickness = self.material
        plate = Plate(membrane, bending, shear, float(thickness), self._local, law, curvature)
        factors = average_over_quads(factors)
        return sheet_strains(self._points, self.surface, plate, factors, self._modulus)

    @cached_property
    def other_terms(self) -> list[EnergyTerm]:
        """Springs, if there are any, and added terms."""
        found = self.fittings.springs
        springs = [] if found is None else [self._springs_to_base(found)]
        return [*springs, *self.added]

    @property
    def terms(self) -> list[EnergyTerm]:
        """All terms of the energy."""
        return [*self.elements, *self.other_terms]

    @cached_property
    def nodes(self) -> Nodes:  # type: ignore[override]
        moved = 0.0 if self._displacement is None else self._displacement
        positions, places = self._points + moved, np.ones(len(self._points), dtype=bool)
        if self.surface is not None:
            positions = self.surface.to_nodes(positions)
            places[len(self.surface.pairs) :] = False
        nodes = Nodes(positions, places)
        if self.other_terms:
            # Negative curvature, such as that of an obstacle, holds nothing.
            for term in self.other_terms:
                term.follow(positions)
            states = [term.evaluate(positions) for term in self.other_terms]
            alike = [
                (state.term.nodes, _normalise(state.tangent_at_rest(removed=1.0)))
                for state in states
            ]
            nodes = nodes._replace(springs=assemble_blocks(alike, positions.size))
        if self._displacement is None:
            return nodes
        strains = forces = np.sum([term.forces(positions) for term in self.elements], axis=0)
        if self.other_terms:
            tangent = _assemble_at_rest(self.other_terms, positions)
            forces = strains + np.sum([term.forces(positions) for term in self.other_terms], axis=0)
            nodes = nodes._replace(tangent=tangent)
        return nodes._replace(forces=forces, strain_forces=strains)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return int(self.free.sum()) if self.has_plain_supports else super().size

    @property
    def has_plain_supports(self) -> bool:
        """Whether all supports act along axes, without rigid bodies."""
        return self.fittings.normals is None and self.fittings.bodies is None

    @cached_property
    def basis(self) -> csc_matrix:
        if self.surface is None and self.has_plain_supports:
            return free_columns(self.free)
        held, (normals, bodies) = ~self.free.reshape(-1, 3), self.fittings[:2]
        if self.surface is None:
            found = free_motions(self._points, held, normals, bodies)
        else:
            found = free_sheet_motions(self._points, self.surface, held, normals, bodies)
        return require_columns(found)

    @cached_property
    def full_stiffness(self) -> csr_matrix:
        positions = self.nodes.positions
        if self.surface is not None or self._displacement is not None:
            found = assemble_tangent(self.vibrating_elements, positions)
        else:
            found = stiffness_matrix(self.assembly, self.material[0])
        if not self.other_terms:
            return found
        others = _assemble_at_rest(self.other_terms, positions)
        # A sum drops entries that are zero, which keep the parts of a flat sheet together.
        return found + others if others.count_nonzero() else found

    @cached_property
    def full_mass(self) -> csr_matrix:
        found = mass_matrix(self.assembly, 1.0, self._lumped)
        if self.fittings.masses is None:
            return found
        blocks = self.fittings.masses[:, None, None] * np.eye(3)
        return found + assemble_tangent([self._springs_to_base(blocks)], self.nodes.positions)

    @cached_property
    def strain_products(self) -> Callable[[Floats], Floats]:  # type: ignore[override]
        if self.surface is not None or self._displacement is not None:
            terms = [*self.vibrating_elements, *self.other_terms]
            return partial(_stiffness_products, terms, self.nodes.positions)
        solid = self._points, self._cells, self.material[0]
        found = partial(strain_products, *solid, factors=self._stiffness_factors)
        if not self.other_terms:
            return found
        return lambda fields: (
            found(fields) + _stiffness_products(self.other_terms, self._points, fields)
        )

    def reduce_forces(self, forces: Floats) -> Floats:
        """Convert forces on the vertices (3V, m) to forces on the free coordinates (N, m)."""
        found = self.reduce_displacements(forces)
        return found if self.surface is None else 2 * found

    def reduce_displacements(self, moved: Floats) -> Floats:
        """Convert displacements of the vertices (3V, m) to free coordinates (N, m)."""
        if self.surface is None and self.has_plain_supports:
            return moved[self.free]
        nodal = moved if self.surface is None else self._to_nodes(moved)
        return self.basis.T @ nodal

    def expand(self, coordinates: Floats) -> Floats:
        """Convert free coordinates (N, m) to displacements of the vertices (3V, m)."""
        if self.surface is None and self.has_plain_supports:
            result = np.zeros((len(self.free), coordinates.shape[1]))
            result[self.free] = coordinates
            return result
        nodal: Floats = self.basis @ coordinates
        if self.surface is None:
            return nodal
        nodal = nodal.reshape(len(self._points), 3, coordinates.shape[1])
        return self.surface.to_vertices(nodal).reshape(len(self.free), -1)

    def remove_held(self, moved: Floats) -> Floats:
        """Remove from displacements or forces on the vertices (3V, m) the part that is held."""
        if self.has_plain_supports:
            return moved * self.free[:, None]
        return self.expand(self.reduce_displacements(moved))

    def to_vertices(self, matrix: csr_matrix) -> csr_matrix:
        """Convert a matrix of the nodal vectors to one of the vertices."""
        if self.surface is None:
            return matrix
        turn = self.surface.node_matrix()
        return (turn.T @ matrix @ turn).tocsr()

    def _springs_to_base(self, blocks: Floats) -> Strains:
        """Make the strains of springs (V, 3, 3) between the vertices and the base."""
        where = np.flatnonzero(blocks.any(axis=(1, 2)))
        if self.surface is None:
            return springs_to_base(
                self._points, where[:, None], np.ones((len(where), 1)), blocks[where]
            )
        nodes, signs = self.surface.vertex_nodes()
        rest = self.surface.to_nodes(self._points)
        return springs_to_base(rest, nodes[where], signs[where], blocks[where])

    def _to_nodes(self, table: Floats) -> Floats:
        assert self.surface is not None
        whole = table.reshape(len(self._points), 3, table.shape[1])
        return self.surface.to_nodes(whole).reshape(table.shape)


_assemblies: WeakValues[Assembly] = WeakValues()
_pencils: WeakValues[MeshPencil] = WeakValues()


def find_or_make_pencil(
    points: Floats,
    cells: Ints,
    parts: list[Floats],
    modulus: float,
    held: Bools,
    lumped: bool,
    displacement: Floats | None,
    fittings: Fittings,
    local: bool = False,
    added: Sequence[EnergyTerm] = (),
    law: MembraneLaw | None = None,
    curvature: Floats | None = None,
) -> MeshPencil:
    """Return the pencil of a mesh: the existing one if it is in use, otherwise a new one."""
    material = [_round_digits(part / modulus) for part in parts]
    for what, given in (("held", held), ("displacement", displacement)):
        if given is not None and given.shape != points.shape:
            raise InputError(f"{what} has shape {given.shape}", allowed=f"{points.shape}")
    weights = [
        part
        for name, factors in fittings.given.items()
        if name in ("bodies", "stiffness_factors", "mass_factors")
        for part in (name, factors)
    ]
    mesh = digest_of(points, cells, len(material), *weights)
    where = [] if displacement is None else [displacement]
    fitted = [part for pair in fittings.given.items() for part in pair]
    terms = [part for term in added for part in (term.digest, modulus)]
    terms += [] if law is None else [law.digest, modulus]
    curved = [] if curvature is None else [curvature]
    whole = digest_of(mesh, *material, local, held, lumped, *where, *fitted, *terms, *curved)
    found = _pencils.get(whole)
    if found is None:
        form = points, cells, material, ~held.ravel(), lumped, displacement, fittings, local
        found = _pencils[whole] = MeshPencil(whole, mesh, *form, added, modulus, law, curvature)
    return found


def _normalise(blocks: Floats) -> Floats:
    """Scale matrices so that their largest entry is one; a zero matrix stays zero."""
    sizes = abs(blocks).max(axis=(1, 2), keepdims=True)
    return np.divide(blocks, sizes, out=np.zeros_like(blocks), where=sizes > 0)


def _assemble_at_rest(terms: Sequence[EnergyTerm], positions: Floats) -> csr_matrix:
    """Assemble the tangent of terms for vibrations about a state at rest."""
    for term in terms:
        term.follow(positions)
    parts = [(term.nodes, term.evaluate(positions).tangent_at_rest()) for term in terms]
    return assemble_blocks(parts, positions.size)


def _stiffness_products(terms: Sequence[EnergyTerm], positions: Floats, fields: Floats) -> Floats:
    return np.sum([term.stiffness_products(positions, fields) for term in terms], axis=0)


def _round_digits(matrix: Floats) -> Floats:
    text = [f"{value:.{_DIGITS - 1}e}" for value in np.ravel(matrix)]
    return np.array(text, dtype=np.float64).reshape(np.shape(matrix)) + 0.0  # no -0.0
