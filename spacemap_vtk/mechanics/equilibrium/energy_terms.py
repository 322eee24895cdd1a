"""Potential energy of a body as a list of terms, each a function of its nodes' positions.

The equilibrium, the modes about it, the time steps and the cache of modes use a body only through
its `EnergyTerm` objects: elements, springs, dead loads, pressures, and any kind that is registered
with `energy_term`. A new kind of term defines a sparsity (`nodes`), an energy, its first two
derivatives and a digest; everything else has a general default.

Sign: `forces` is the gradient ∂W/∂z, which are the forces that hold the shape. The term itself
pushes with -∂W/∂z.
"""

from __future__ import annotations

import hashlib
import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


class PairedNodes(Protocol):
    """Nodes of a sheet in place of pairs of vertices: `elements.shell.MidSurface`."""

    def to_nodes(self, vertices: Floats) -> Floats:
        """Convert vectors of the vertices to mid-points and half thicknesses."""

    def to_vertices(self, nodes: Floats) -> Floats:
        """Convert mid-points and half thicknesses to vectors of the vertices."""

    def vertex_nodes(self) -> tuple[Ints, Floats]:
        """Return the two nodes of each vertex, and their signs."""


class EnergyTerm(ABC):
    """One term of a body's energy: a sum over elements, each of which depends on a few nodes."""

    #: (E, n) Nodes of each of the E elements, as row numbers of the positions.
    nodes: Ints

    #: Whether `forces` is the gradient of `energy`. If not, the term does external work.
    conservative = True

    @property
    @abstractmethod
    def digest(self) -> str:
        """Text that differs between terms of different energy; part of the cache key."""

    @abstractmethod
    def energy(self, positions: Floats) -> float:
        """Compute the energy W.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        float
            W [J].
        """

    @abstractmethod
    def forces(self, positions: Floats) -> Floats:
        """Compute the gradient of the energy: the forces that hold the nodes in place.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        ndarray of float64, shape (V, 3)
            ∂W/∂z [N].
        """

    @abstractmethod
    def tangent(self, positions: Floats) -> Floats:
        """Compute the second derivatives of the energy of each element.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        ndarray of float64, shape (E, 3 n, 3 n)
            Matrices [N/m], ordered node by node.
        """

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Compute the largest multiple of a Newton step that may be made at once.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].
        move : ndarray of float64, shape (V, 3)
            Newton step from these positions [m].

        Returns
        -------
        float
            Largest multiple; infinite (the default) if there is no limit.
        """
        return math.inf

    def admits(self, start: Floats, positions: Floats) -> bool:
        """Check whether positions can be reached from the start, whatever their energy.

        Parameters
        ----------
        start : ndarray of float64, shape (V, 3)
            Positions of all nodes at the start [m].
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        bool
            True by default.
        """
        return True

    def passes(self, before: Floats, after: Floats) -> bool:
        """Check whether the nodes may move straight from one place to another in a time step.

        Parameters
        ----------
        before, after : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        bool
            By default, whether the second place can be reached from the first, see `admits`.
        """
        return self.admits(before, after)

    def follow(self, positions: Floats) -> bool:
        """Let `nodes` follow the positions, if which nodes affect each other depends on them.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        bool
            Whether `nodes` changed; False by default.
        """
        return False

    def resistance_matrices(self) -> Floats:
        """Compute matrices that are zero for motions which the term never resists.

        Returns
        -------
        ndarray of float64, shape (E, 3 n, 3 n)
            Unit matrices by default: the term resists every motion.
        """
        size = 3 * self.nodes.shape[1]
        return np.broadcast_to(np.eye(size), (len(self.nodes), size, size))

    def evaluate(self, positions: Floats) -> TermState:
        """Evaluate the term at the given positions.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        TermState
            Energy, forces and tangent there. By default each is computed by this term.
        """
        return TermState(self, positions)

    def begin_step(self, positions: Floats, time: float, span: float) -> TermStep | None:
        """Begin a time step, in which the term computes its own mean forces.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes at the start of the step [m].
        time : float
            Start of the step [s].
        span : float
            Length of the step [s].

        Returns
        -------
        TermStep or None
            None by default: the forces are integrated by a quadrature over the step.
        """
        return None

    def in_model_nodes(self, surface: PairedNodes | None, factor: float) -> EnergyTerm:
        """Convert a term of a cage's vertices to one of its model's nodes, times a factor.

        Parameters
        ----------
        surface : PairedNodes or None
            Mid-surface of a sheet, whose nodes are mid-points and half thicknesses of pairs of
            vertices. The nodes of a solid are the vertices.
        factor : float
            Factor of the energy.

        Returns
        -------
        EnergyTerm
            By default a `VertexTerm`, which converts positions, forces and tangent.
        """
        return VertexTerm(self, surface, factor)

    def stiffness_products(self, positions: Floats, fields: Floats) -> Floats:
        """Compute φᵀ K φ for each pair of displacement fields.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].
        fields : ndarray of float64, shape (m, V, 3)
            The fields φ.

        Returns
        -------
        ndarray of float64, shape (m, m)
            Products [J] if the fields are in m.
        """
        moved = fields[:, self.nodes].reshape(len(fields), len(self.nodes), -1)
        blocks = self.evaluate(positions).tangent_at_rest()
        return np.asarray(np.einsum("mei,eij,nej->mn", moved, blocks, moved, optimize=True))


class FinishedStep(NamedTuple):
    """An energy term at the end of a time step."""

    term: EnergyTerm
    """The term, as it is from now on."""
    dissipated: float
    """Energy that it dissipated in the step [J]."""
    work: float
    """Work that it did on the body from outside [J]."""


class TermStep(ABC):
    """Energy term over one time step; the work of its forces is the change of its energy."""

    @abstractmethod
    def admits(self, shares: Floats, places: list[Floats]) -> bool:
        """Check whether the nodes may pass through places (V, 3) at shares of the step."""

    @abstractmethod
    def forces(self, end: Floats) -> Floats:
        """Compute the mean forces that hold the nodes, from their positions at the end, (V, 3)."""

    @abstractmethod
    def tangent(self, end: Floats) -> Floats:
        """Compute the derivatives of the forces by the positions at the end, (E, 3 n, 3 n)."""

    @abstractmethod
    def finish(self, end: Floats) -> FinishedStep:
        """End the step at the given positions."""


class TermState:
    """Energy term at fixed positions; each expensive result is computed only once."""

    def __init__(self, term: EnergyTerm, positions: Floats) -> None:
        self.term, self._positions = term, positions

    @cached_property
    def energy(self) -> float:
        """Energy W [J]."""
        return self.term.energy(self._positions)

    @cached_property
    def forces(self) -> Floats:
        """Gradient ∂W/∂z [N], (V, 3)."""
        return self.term.forces(self._positions)

    def tangent(self, removed: float = 0.0, predicted: Any = None) -> Floats:
        """Compute the second derivatives of each element, (E, 3 n, 3 n)."""
        # `removed` is the share of the negative curvature that is removed: with 1 no matrix is
        # indefinite. `predicted` is the result of `predict` in the step before.
        blocks = self.term.tangent(self._positions)
        if removed == 0.0 or not blocks.size:
            return blocks
        values, vectors = np.linalg.eigh(blocks)
        negative = (vectors * np.minimum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2)
        return np.asarray(blocks - removed * negative)

    def tangent_at_rest(self, removed: float = 0.0) -> Floats:
        """Compute the tangent for vibrations about a state at rest, whose contacts stay closed."""
        return self.tangent(removed)

    def predict(self, move: Floats, curve: Floats | None = None) -> Any:
        """Predict data for the tangent after a move and a curve; None: it uses the new state."""
        return None

    def predict_unstressed(self) -> Any:
        """Predict data for a tangent without stresses; None: it uses the state."""
        return None


class DeadLoad(EnergyTerm):
    """Forces (V, 3) [N] of constant direction: W = -f · (z - z₀)."""

    def __init__(self, load: Floats, origin: Floats) -> None:
        self.load, self._origin = load, origin
        self.nodes = np.empty((0, 1), dtype=np.int64)

    @property
    def digest(self) -> str:
        """Digest of the forces; the origin only shifts the energy."""
        return digest_of("dead load", self.load)

    def energy(self, positions: Floats) -> float:
        """Compute the potential energy of the forces [J], zero at the origin."""
        return -float(np.vdot(self.load, positions - self._origin))

    def forces(self, positions: Floats) -> Floats:
        """Return the forces that hold the body against the load [N], (V, 3)."""
        return -self.load

    def tangent(self, positions: Floats) -> Floats:
        """Return no matrices, as the forces do not depend on the positions."""
        return np.empty((0, 3, 3))


class VertexTerm(EnergyTerm):
    """Term of a cage's vertices as a term of its model's nodes, multiplied by a factor."""

    # The nodes of a sheet are mid-points and half thicknesses of pairs of vertices, see
    # `spacemap_vtk.mechanics.elements.shell.MidSurface`. The nodes of a solid are the vertices.

    def __init__(self, term: EnergyTerm, surface: PairedNodes | None, factor: float = 1.0) -> None:
        self._term, self._surface, self._factor = term, surface, factor
        self.nodes = term.nodes
        self.conservative = term.conservative
        if surface is not None:
            ends, signs = surface.vertex_nodes()
            self.nodes = ends[term.nodes].reshape(len(term.nodes), -1)
            #: (E, n, 2) Signs of the mid-point and the half thickness of each vertex.
            self._signs = signs[term.nodes]

    @property
    def digest(self) -> str:
        """Digest of the term and the factor; the mesh determines the surface."""
        return digest_of(self._term.digest, self._factor)

    def energy(self, positions: Floats) -> float:
        """Compute the energy times the factor."""
        return self._factor * self._term.energy(self._vertices(positions))

    def forces(self, positions: Floats) -> Floats:
        """Compute the gradient of the energy by the nodes."""
        forces = self._factor * self._term.forces(self._vertices(positions))
        return forces if self._surface is None else 2 * self._surface.to_nodes(forces)

    def tangent(self, positions: Floats) -> Floats:
        """Compute the second derivatives of the energy by the nodes."""
        return self._factor * self._of_nodes(self._term.tangent(self._vertices(positions)))

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Compute the largest step that the wrapped term admits."""
        return self._term.largest_step(self._vertices(positions), self._vertices(move))

    def admits(self, start: Floats, positions: Floats) -> bool:
        """Check whether the wrapped term admits the positions."""
        return self._term.admits(self._vertices(start), self._vertices(positions))

    def resistance_matrices(self) -> Floats:
        """Compute the matrices of the wrapped term by the nodes."""
        return self._of_nodes(self._term.resistance_matrices())

    def _vertices(self, nodal: Floats) -> Floats:
        return nodal if self._surface is None else self._surface.to_vertices(nodal)

    def _of_nodes(self, blocks: Floats) -> Floats:
        if self._surface is None:
            return blocks
        count, size = self._term.nodes.shape
        parts = blocks.reshape(count, size, 3, size, 3)
        parts = np.einsum("eaikj,eap,ekq->eapikqj", parts, self._signs, self._signs)
        return np.asarray(parts.reshape(count, 6 * size, 6 * size))


def assemble_tangent(terms: Sequence[EnergyTerm], positions: Floats) -> csr_matrix:
    """Assemble the second derivatives of all terms at the given positions, (3V, 3V)."""
    for term in terms:
        term.follow(positions)
    return assemble_blocks(
        [(term.nodes, term.tangent(positions)) for term in terms], positions.size
    )


def assemble_blocks(parts: Sequence[tuple[Ints, Floats]], size: int) -> csr_matrix:
    """Sum matrices (E, 3 n, 3 n) of elements with nodes (E, n) into one of shape (size, size)."""
    from scipy.sparse import coo_matrix

    values, rows, columns = [], [], []
    for nodes, blocks in parts:
        dof = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])
        each = dof.shape[1]
        values.append(blocks.ravel())
        rows.append(np.repeat(dof, each, axis=1).ravel())
        columns.append(np.tile(dof, each).ravel())
    data = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return coo_matrix(data, shape=(size, size)).tocsr()


def sum_at_nodes(nodes: Ints, forces: Floats, count: int) -> Floats:
    """Sum forces (E, n, 3) of elements with nodes (E, n) at each of `count` nodes, (count, 3)."""
    rows, forces = nodes.ravel(), forces.reshape(-1, 3)
    return np.stack([np.bincount(rows, forces[:, i], count) for i in range(3)], axis=1)


#: Function that makes a term on a cage from vertices (V, 3) [m], tetrahedra and keyword arguments.
TermFactory = Callable[..., EnergyTerm]

#: Functions that `energy_term` has registered, by kind.
_MAKERS: dict[str, TermFactory] = {}


def energy_term(kind: str) -> Callable[[TermFactory], TermFactory]:
    """Register a function that makes a term, under the kind by which recipes name it.

    Parameters
    ----------
    kind : str
        The kind.

    Returns
    -------
    callable
        Decorator of the function, which it returns unchanged.
    """
    # The function is called with the undeformed vertices (V, 3) of the cage and its tetrahedra
    # (T, 4) or (T, 10); the other entries of the recipe are its keyword arguments.

    def register(maker: TermFactory) -> TermFactory:
        _MAKERS[kind] = maker
        return maker

    return register


def check_recipe(recipe: Mapping[str, Any]) -> None:
    """Refuse a recipe of an unregistered kind, or with wrong arguments.

    Parameters
    ----------
    recipe : mapping of str to object
        The kind, and the arguments of the registered function.

    Raises
    ------
    InputError
        If the kind is not registered, or an argument is unknown or missing.
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
            f'a term of kind "{kind}" cannot be made: {error}',
            value=dict(recipe),
            allowed=", ".join(["kind", *list(signature.parameters)[2:]]),
        ) from None


def make_term(recipe: Mapping[str, Any], points: Floats, cells: Ints) -> EnergyTerm:
    """Make the term that a recipe describes on a cage.

    Parameters
    ----------
    recipe : mapping of str to object
        The kind, and the arguments of the registered function.
    points : ndarray of float64, shape (V, 3)
        Undeformed vertices [m].
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Tetrahedra.

    Returns
    -------
    EnergyTerm
        The term, whose nodes are the vertices of the cage.
    """
    check_recipe(recipe)
    values = {name: value for name, value in recipe.items() if name != "kind"}
    return _MAKERS[recipe["kind"]](points, cells, **values)


def digest_of(*parts: Any) -> str:
    """Compute a digest of arrays and other values.

    Parameters
    ----------
    *parts : ndarray, str, int, float or bool
        Values to digest; their types and shapes count, too.

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
