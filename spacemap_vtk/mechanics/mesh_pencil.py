"""K and M of a supported mesh of unit modulus and density, found again by content.

Pencils and assemblies are kept while anyone holds them: ModalResponse comes upon the factors that
ModalSolver made, though only arrays pass between the two. Nothing is assembled before it is asked
for.
"""

from __future__ import annotations

import hashlib
import weakref
from collections.abc import Callable
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.mechanics.elasticity import Assembly, assemble, mass, stiffness
from spacemap_vtk.mechanics.kinematics import strain_products
from spacemap_vtk.mechanics.pencil import Nodes, Pencil, selection
from spacemap_vtk.mechanics.plates import Plate
from spacemap_vtk.mechanics.shell import held_pairs, mid_surface, of_pairs, of_sheet
from spacemap_vtk.mechanics.strains import Strains, of_tetrahedra, tangent

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix, csr_matrix

FloatArray = NDArray[np.float64]

#: Digits of a material that count: two moduli in a fixed ratio leave the last ones to rounding.
_DIGITS = 14


V = TypeVar("V")


class WeakValues(Generic[V]):
    """A `weakref.WeakValueDictionary` that runs no Python when a value dies."""

    # A value may die with its stage within VTK's collector, which holds a lock of all threads.
    # There any line of Python may hand Python's own lock to a thread that then waits for VTK's, and
    # both stand for ever. So the dead are dropped when the next value comes.

    def __init__(self) -> None:
        self.entries: dict[str, weakref.ref[V]] = {}

    def get(self, key: str) -> V | None:
        """Return a value, or None where there is none any more."""
        kept = self.entries.get(key)
        return None if kept is None else kept()

    def __contains__(self, key: str) -> bool:
        return self.get(key) is not None

    def __setitem__(self, key: str, value: V) -> None:
        alive = {k: kept for k, kept in list(self.entries.items()) if kept() is not None}
        self.entries = alive | {key: weakref.ref(value)}


class MeshPencil(Pencil):
    """K and M of a supported mesh of unit modulus and density."""

    # Nothing is assembled before it is asked for: modes may come from a cache.

    def __init__(
        self,
        digest: str,
        mesh: str,
        points: FloatArray,
        cells: NDArray[np.int64],
        material: list[FloatArray],
        free: NDArray[np.bool_],
        lumped: bool,
        displacement: FloatArray | None,
    ) -> None:
        self.digest, self.free, self.material = digest, free, material
        self.surface = mid_surface(points, cells) if len(material) > 1 else None
        if len(material) > 1 and self.surface is None:
            raise GeometryError(
                "a sheet is what a one-layer lattice is: the cage is none",
                key="elements",
                value="sheet",
                cure='Set [cage] divisions such as [20, 20, 1] and order = 1, or elements = "auto"',
            )
        self._mesh, self._points, self._cells, self._lumped = mesh, points, cells, lumped
        self._displacement = displacement
        # Held from now on, so that a solver's last model hands it to the next.
        if (kept := _assemblies.get(mesh)) is not None:
            self.assembly = kept

    @cached_property
    def assembly(self) -> Assembly:
        found = _assemblies.get(self._mesh)
        if found is None:
            if self.surface is None:
                found = assemble(self._points, self._cells)
            else:
                found = of_pairs(self._points, self.surface)
            _assemblies[self._mesh] = found
        return found

    @cached_property
    def strains(self) -> list[Strains]:
        if self.surface is None:
            return [of_tetrahedra(self._points, self._cells, self.material[0])]
        membrane, bending, shear, thickness = self.material
        plate = Plate(membrane, bending, shear, float(thickness))
        return of_sheet(self._points, self.surface, plate)

    @cached_property
    def nodes(self) -> Nodes:  # type: ignore[override]
        moved = 0.0 if self._displacement is None else self._displacement
        positions, places = self._points + moved, np.ones(len(self._points), dtype=bool)
        if self.surface is not None:
            positions = self.surface.nodal(positions)
            places[len(self.surface.pairs) :] = False
        if self._displacement is None:
            return Nodes(positions, places)
        forces = np.sum([part.forces(positions) for part in self.strains], axis=0)
        return Nodes(positions, places, forces)

    @cached_property
    def basis(self) -> csc_matrix:
        if self.surface is None:
            return selection(self.free)
        return held_pairs(~self.free.reshape(-1, 3), self.surface)

    @cached_property
    def whole_stiffness(self) -> csr_matrix:
        if self.surface is None and self._displacement is None:
            return stiffness(self.assembly, self.material[0])
        return tangent(self.strains, self.nodes.positions)

    @cached_property
    def whole_mass(self) -> csr_matrix:
        return mass(self.assembly, 1.0, self._lumped)

    @cached_property
    def strain_products(self) -> Callable[[FloatArray], FloatArray]:  # type: ignore[override]
        if self.surface is None and self._displacement is None:
            return partial(strain_products, self._points, self._cells, self.material[0])
        return partial(_products, self.strains, self.nodes.positions)

    def gathered(self, forces: FloatArray) -> FloatArray:
        """Return forces on the vertices (3V, m) as those on what is free (N, m)."""
        if self.surface is None:
            return forces[self.free]
        gathered: FloatArray = self.basis.T @ (2 * self._nodal(forces))
        return gathered

    def coordinates(self, moved: FloatArray) -> FloatArray:
        """Return displacements of the vertices (3V, m) as coordinates of what is free (N, m)."""
        if self.surface is None:
            return moved[self.free]
        found: FloatArray = self.basis.T @ self._nodal(moved)
        return found

    def spread(self, coordinates: FloatArray) -> FloatArray:
        """Return the displacements of the vertices (3V, m) that coordinates (N, m) stand for."""
        if self.surface is None:
            result = np.zeros((len(self.free), coordinates.shape[1]))
            result[self.free] = coordinates
            return result
        nodal = (self.basis @ coordinates).reshape(-1, 3, coordinates.shape[1])
        return self.surface.vertices(nodal).reshape(len(self.free), -1)

    def of_vertices(self, matrix: csr_matrix) -> csr_matrix:
        """Return a matrix of the nodes' vectors as one of the vertices."""
        if self.surface is None:
            return matrix
        turn = self.surface.matrix()
        return (turn.T @ matrix @ turn).tocsr()

    def _nodal(self, table: FloatArray) -> FloatArray:
        assert self.surface is not None
        whole = table.reshape(-1, 3, table.shape[1])
        return self.surface.nodal(whole).reshape(table.shape)


_assemblies: WeakValues[Assembly] = WeakValues()
_pencils: WeakValues[MeshPencil] = WeakValues()


def digest_of(*parts: Any) -> str:
    """Return a digest of arrays and other values.

    Parameters
    ----------
    *parts : ndarray, str, int or bool
        What to digest, types and shapes included.

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        if isinstance(part, np.ndarray):
            state.update(f"{part.dtype.str}{part.shape}".encode())
            state.update(np.ascontiguousarray(part).data)
        else:
            state.update(f"{type(part).__name__}:{part};".encode())
    return state.hexdigest()


def mesh_pencil(
    points: FloatArray,
    cells: NDArray[np.int64],
    parts: list[FloatArray],
    modulus: float,
    held: NDArray[np.bool_],
    lumped: bool,
    displacement: FloatArray | None,
) -> MeshPencil:
    """Return the pencil of a mesh: the one that there is already, where anyone holds it."""
    material = [_rounded(part / modulus) for part in parts]
    for what, given in (("held", held), ("displacement", displacement)):
        if given is not None and given.shape != points.shape:
            raise InputError(f"{what} of shape {given.shape}", allowed=f"{points.shape}")
    mesh = digest_of(points, cells, len(material))
    where = [] if displacement is None else [displacement]
    whole = digest_of(mesh, *material, held, lumped, *where)
    found = _pencils.get(whole)
    if found is None:
        free = ~held.ravel()
        found = MeshPencil(whole, mesh, points, cells, material, free, lumped, displacement)
        _pencils[whole] = found
    return found


def _products(strains: list[Strains], positions: FloatArray, fields: FloatArray) -> FloatArray:
    total: FloatArray = np.sum([part.products(positions, fields) for part in strains], axis=0)
    return total


def _rounded(matrix: FloatArray) -> FloatArray:
    text = [f"{value:.{_DIGITS - 1}e}" for value in np.ravel(matrix)]
    return np.array(text, dtype=np.float64).reshape(np.shape(matrix)) + 0.0  # no -0.0
