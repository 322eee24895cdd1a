"""A supported mesh of one material: its matrices, its rigid motions, and static solutions.

Whatever depends on geometry, supports and the *form* of the material alone is kept in a
`MeshPencil` of unit modulus and density. A model scales it, so that another modulus or density
costs nothing. Pencils and assemblies are found again by content while anyone holds them:
ModalResponse comes upon the factors that ModalSolver made, though only arrays pass between the two.
"""

from __future__ import annotations

import hashlib
import weakref
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elasticity import Assembly, assemble, mass, nodal_mass, stiffness
from spacemap_vtk.mechanics.kinematics import strain_products
from spacemap_vtk.mechanics.materials import check_sizes
from spacemap_vtk.mechanics.pencil import Pencil
from spacemap_vtk.mechanics.residual_vectors import movable_mass
from spacemap_vtk.mechanics.tetrahedra import checked_mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


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


class Model:
    """K and M of a mesh of tetrahedra, of which some components are held.

    Parameters
    ----------
    points : array_like of float, shape (V, 3)
        Vertices [m].
    cells : array_like of int, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    elasticity : array_like of float, shape (6, 6)
        Elasticity matrix [Pa], see `spacemap_vtk.mechanics.materials`.
    density : float
        ρ > 0 [kg/m³].
    held : array_like of bool, shape (V, 3)
        Which components cannot move.
    lumped : bool
        Lumped in place of consistent mass.

    Raises
    ------
    GeometryError
        If the mesh is none, or a tetrahedron flat.
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
        elasticity: ArrayLike,
        density: float,
        held: ArrayLike,
        lumped: bool = False,
    ) -> None:
        self.points, self.cells = checked_mesh(points, cells)
        self.elasticity = np.array(elasticity, dtype=np.float64)
        self.density = float(density)
        self.lumped = bool(lumped)
        #: Multiplies the stiffness of the pencil: the largest elasticity [Pa].
        self.modulus = float(abs(self.elasticity).max(initial=0.0)) or 1.0
        if not (np.isfinite(self.density) and self.density > 0):
            raise InputError(
                "the material has no mass", key="density", value=density, allowed="above 0 kg/m³"
            )
        check_sizes("density", self.density, "kg/m³")
        _check_elasticity(self.elasticity)
        self.pencil = _pencil(
            self.points,
            self.cells,
            _rounded(self.elasticity / self.modulus),
            np.asarray(held, dtype=bool),
            self.lumped,
        )

    @property
    def digest(self) -> str:
        """Digest of all that the modes depend on but modulus and density, which only scale them."""
        return self.pencil.digest

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which components can move, shape (3V,)."""
        return self.pencil.free

    @cached_property
    def stiffness(self) -> csr_matrix:
        """K [N/m], shape (3V, 3V), of free and held components."""
        return self.modulus * self.pencil.whole_stiffness

    @cached_property
    def mass(self) -> csr_matrix:
        """M [kg], shape (3V, 3V), of free and held components."""
        return self.density * self.pencil.whole_mass

    @cached_property
    def nodal_mass(self) -> FloatArray:
        """Row sums of M [kg], shape (V,): gravity's load is their product with g."""
        return nodal_mass(self.points, self.cells, self.density, self.lumped)

    @cached_property
    def movable_mass(self) -> FloatArray:
        """What the effective masses of all modes sum to along x, y and z [kg], shape (3,)."""
        return movable_mass(self.pencil.assembly, self.density, self.lumped, self.free)

    @cached_property
    def rigid(self) -> FloatArray:
        """The motions without strain that the supports leave, mass-normalised, shape (3V, r)."""
        motions = np.zeros((len(self.pencil.free), self.pencil.rigid.shape[1]))
        motions[self.pencil.free] = self.pencil.rigid / np.sqrt(self.density)
        return motions

    def solve(self, forces: ArrayLike) -> FloatArray:
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

    def statics(self, forces: ArrayLike) -> tuple[FloatArray, FloatArray]:
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
        given = np.asarray(forces, dtype=np.float64)
        free = self.pencil.free
        if given.ndim not in (1, 2) or len(given) != len(free):
            raise InputError(
                f"forces of shape {given.shape}", allowed=f"({len(free)},) or ({len(free)}, m)"
            )
        table = given.reshape(len(free), -1)
        result = np.zeros_like(table)
        found, rounding = self.pencil.solve(table[free])
        result[free] = found / self.modulus
        return result.reshape(given.shape), rounding


class MeshPencil(Pencil):
    """K and M of a supported mesh of unit modulus and density."""

    # Nothing is assembled before it is asked for: modes may come from a cache.

    def __init__(
        self,
        digest: str,
        mesh: str,
        points: FloatArray,
        cells: NDArray[np.int64],
        elasticity: FloatArray,
        free: NDArray[np.bool_],
        lumped: bool,
    ) -> None:
        self.digest, self.free, self.points = digest, free, points
        self.strain_products = partial(strain_products, points, cells, elasticity)
        self._mesh, self._cells, self._elasticity, self._lumped = mesh, cells, elasticity, lumped
        # Held from now on, so that a solver's last model hands it to the next.
        if (kept := _assemblies.get(mesh)) is not None:
            self.assembly = kept

    @cached_property
    def assembly(self) -> Assembly:
        found = _assemblies.get(self._mesh)
        if found is None:
            assert self.points is not None
            found = assemble(self.points, self._cells)
            _assemblies[self._mesh] = found
        return found

    @cached_property
    def whole_stiffness(self) -> csr_matrix:
        return stiffness(self.assembly, self._elasticity)

    @cached_property
    def whole_mass(self) -> csr_matrix:
        return mass(self.assembly, 1.0, self._lumped)


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


def _pencil(
    points: FloatArray,
    cells: NDArray[np.int64],
    elasticity: FloatArray,
    held: NDArray[np.bool_],
    lumped: bool,
) -> MeshPencil:
    if held.shape != points.shape:
        raise InputError(f"held of shape {held.shape}", allowed=f"{points.shape}")
    mesh = digest_of(points, cells)
    whole = digest_of(mesh, elasticity, held, lumped)
    found = _pencils.get(whole)
    if found is None:
        found = MeshPencil(whole, mesh, points, cells, elasticity, ~held.ravel(), lumped)
        _pencils[whole] = found
    return found


def _check_elasticity(matrix: FloatArray) -> None:
    if matrix.shape != (6, 6) or not np.isfinite(matrix).all():
        raise InputError(
            "this is not an elasticity matrix",
            key="elasticity",
            value=f"array of shape {matrix.shape}",
            allowed="a finite, symmetric matrix of shape (6, 6)",
        )


def _rounded(matrix: FloatArray) -> FloatArray:
    text = [f"{value:.{_DIGITS - 1}e}" for value in np.ravel(matrix)]
    return np.array(text, dtype=np.float64).reshape(np.shape(matrix)) + 0.0  # no -0.0
