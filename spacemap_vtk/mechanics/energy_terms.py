"""The energy of a body as a list of terms, each a function of the positions of its nodes.

Equilibrium, the modes about it, the steps of its motion and the cache of its modes know a body only
as a list of `EnergyTerm`: elements, springs, dead loads, pressures, and whatever else is registered
with `energy_term`. A term of one's own has a sparsity (`nodes`), an energy, its first two
derivatives, and a digest; everything else has a general default.

Sign: `forces` are the gradient ∂W/∂z. They hold the shape; the term itself pushes with -∂W/∂z.
"""

from __future__ import annotations

import hashlib
import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


class EnergyTerm(ABC):
    """One term of a body's energy: a sum over elements that each depend on a few nodes."""

    #: (E, n) The nodes that each of E elements depends on, as rows of the positions.
    nodes: Ints

    #: Whether `forces` are the gradient of `energy`. If not, the work of the term is external work.
    conservative = True

    @property
    @abstractmethod
    def digest(self) -> str:
        """A text that differs between any two terms of different energy, a key of the cache."""

    @abstractmethod
    def energy(self, positions: Floats) -> float:
        """Return the energy W.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].

        Returns
        -------
        float
            In J.
        """

    @abstractmethod
    def forces(self, positions: Floats) -> Floats:
        """Return the gradient of the energy: the forces that hold the term where it is.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].

        Returns
        -------
        ndarray of float64, shape (V, 3)
            ∂W/∂z [N].
        """

    @abstractmethod
    def tangent(self, positions: Floats) -> Floats:
        """Return the second derivatives of the energy of each element.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].

        Returns
        -------
        ndarray of float64, shape (E, 3 n, 3 n)
            In N/m, node by node.
        """

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Return which multiple of a Newton step may be made at once.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].
        move : ndarray of float64, shape (V, 3)
            The step from there [m].

        Returns
        -------
        float
            Infinite, the default, where any may.
        """
        return math.inf

    def admits(self, start: Floats, positions: Floats) -> bool:
        """Return whether positions can be reached from the start, whatever their energy.

        Parameters
        ----------
        start : ndarray of float64, shape (V, 3)
            Of all nodes [m].
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].

        Returns
        -------
        bool
            True by default.
        """
        return True

    def resisted(self) -> Floats:
        """Return matrices that are zero for motions which the term never resists.

        Returns
        -------
        ndarray of float64, shape (E, 3 n, 3 n)
            By default unit matrices: there is no such motion.
        """
        size = 3 * self.nodes.shape[1]
        return np.broadcast_to(np.eye(size), (len(self.nodes), size, size))

    def at(self, positions: Floats) -> TermState:
        """Return the term at some positions, to be asked for energy, forces and tangent.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].

        Returns
        -------
        TermState
            By default one that asks this term.
        """
        return TermState(self, positions)

    def products(self, positions: Floats, fields: Floats) -> Floats:
        """Return φᵀ K φ of each two of some fields.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Of all nodes [m].
        fields : ndarray of float64, shape (m, V, 3)
            The fields φ.

        Returns
        -------
        ndarray of float64, shape (m, m)
            In J, where the fields are in m.
        """
        moved = fields[:, self.nodes].reshape(len(fields), len(self.nodes), -1)
        return np.asarray(
            np.einsum("mei,eij,nej->mn", moved, self.tangent(positions), moved, optimize=True)
        )


class TermState:
    """A term at some positions. What is expensive is computed once."""

    def __init__(self, term: EnergyTerm, positions: Floats) -> None:
        self.term, self._positions = term, positions

    @cached_property
    def energy(self) -> float:
        """W [J]."""
        return self.term.energy(self._positions)

    @cached_property
    def forces(self) -> Floats:
        """∂W/∂z [N], (V, 3)."""
        return self.term.forces(self._positions)

    def tangent(self, firm: float = 0.0, carried: Any = None) -> Floats:
        """Return the second derivatives of each element, (E, 3 n, 3 n)."""
        # Without the share `firm` of its negative curvature: with 1 no matrix is indefinite.
        # `carried` is what `predicted` returned one step earlier.
        blocks = self.term.tangent(self._positions)
        if firm == 0.0 or not blocks.size:
            return blocks
        values, vectors = np.linalg.eigh(blocks)
        negative = (vectors * np.minimum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2)
        return np.asarray(blocks - firm * negative)

    def predicted(self, move: Floats, curve: Floats | None = None) -> Any:
        """Return what the tangent after a move, and a curve, may use in place of its own state."""
        return None


class DeadLoad(EnergyTerm):
    """Forces (V, 3) [N] that keep their directions: W = -f · (z - z₀)."""

    def __init__(self, load: Floats, origin: Floats) -> None:
        self.load, self._origin = load, origin
        self.nodes = np.empty((0, 1), dtype=np.int64)

    @property
    def digest(self) -> str:
        """Digest of the forces; the origin only shifts the energy."""
        return digest_of("dead load", self.load)

    def energy(self, positions: Floats) -> float:
        """Return what the forces have still to give [J], zero at the origin."""
        return -float(np.vdot(self.load, positions - self._origin))

    def forces(self, positions: Floats) -> Floats:
        """Return what would hold the body against them [N], (V, 3)."""
        return -self.load

    def tangent(self, positions: Floats) -> Floats:
        """Return no matrices: they do not change with the positions."""
        return np.empty((0, 3, 3))


def tangent(terms: Sequence[EnergyTerm], positions: Floats) -> csr_matrix:
    """Return the second derivatives of all terms at some positions, (3V, 3V)."""
    return assembled([(term.nodes, term.tangent(positions)) for term in terms], positions.size)


def assembled(parts: Sequence[tuple[Ints, Floats]], size: int) -> csr_matrix:
    """Return the sum of matrices (E, 3 n, 3 n) of elements with nodes (E, n), (size, size)."""
    from scipy.sparse import coo_matrix

    values, rows, columns = [], [], []
    for nodes, blocks in parts:
        dof = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)
        each = dof.shape[1]
        values.append(blocks.ravel())
        rows.append(np.repeat(dof, each, axis=1).ravel())
        columns.append(np.tile(dof, each).ravel())
    data = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return coo_matrix(data, shape=(size, size)).tocsr()


#: A maker of a term on a cage: called with vertices (V, 3) [m], tetrahedra, and keyword arguments.
Maker = Callable[..., EnergyTerm]

#: What `energy_term` has registered, by kind.
_MAKERS: dict[str, Maker] = {}


def energy_term(kind: str) -> Callable[[Maker], Maker]:
    """Register a function that makes a term, under the kind that recipes name."""
    # It takes the undeformed vertices (V, 3) of the cage, its tetrahedra (T, 4) or (T, 10), and as
    # keyword arguments what else the recipe has.

    def register(maker: Maker) -> Maker:
        _MAKERS[kind] = maker
        return maker

    return register


def check_recipe(recipe: Mapping[str, Any]) -> None:
    """Refuse a recipe of no registered kind, or with other keys than its maker takes.

    Parameters
    ----------
    recipe : mapping of str to object
        A kind, and the arguments of its maker.

    Raises
    ------
    InputError
        If a name is unknown or missing.
    """
    kind = recipe.get("kind")
    if kind not in _MAKERS:
        raise InputError(
            "no energy term of this kind is registered",
            key="kind",
            value=kind,
            allowed=", ".join(sorted(_MAKERS)) or "none so far",
            cure="Import the module that registers it with energy_term",
        )
    signature = inspect.signature(_MAKERS[kind])
    values = {name: value for name, value in recipe.items() if name != "kind"}
    try:
        signature.bind(None, None, **values)
    except TypeError as error:
        raise InputError(
            f'a term of the kind "{kind}" cannot be made: {error}',
            value=dict(recipe),
            allowed=", ".join(["kind", *list(signature.parameters)[2:]]),
        ) from None


def made(recipe: Mapping[str, Any], points: Floats, cells: Ints) -> EnergyTerm:
    """Return the term of a recipe on a cage.

    Parameters
    ----------
    recipe : mapping of str to object
        A kind, and the arguments of its maker.
    points : ndarray of float64, shape (V, 3)
        Undeformed vertices [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.

    Returns
    -------
    EnergyTerm
        Of the vertices.
    """
    check_recipe(recipe)
    values = {name: value for name, value in recipe.items() if name != "kind"}
    return _MAKERS[recipe["kind"]](points, cells, **values)


def digest_of(*parts: Any) -> str:
    """Return a digest of arrays and other values.

    Parameters
    ----------
    *parts : ndarray, str, int, float or bool
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
