"""Contact of a sheet with itself: a barrier between the triangles of its mid-surface.

Parts of the mid-surface that come nearer than the thickness T plus the reach r push each other
apart, with an energy that is infinite at the distance T (Li and others, Incremental potential
contact, ACM Trans. Graph. 39 (2020) 49; library ``ipctk``). Nothing gets nearer than T: no move is
made beyond the place where that would happen, as computed along the move.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError, MissingLibraryError
from spacemap_vtk.mechanics.elements.shell import MidSurface
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    PairedNodes,
    TermState,
    digest_of,
    sum_at_nodes,
)
from spacemap_vtk.ndarrays import Floats, Ints

#: Distance over which the barrier acts, as a share of the thickness.
REACH = 0.5
#: Shifts of the mid-points, as a share of a cell: without them, edges of layers that lie on each
#: other can be parallel up to rounding, where ipctk's derivatives are not finite.
_JITTER = 1e-7
#: How far nodes may move, as a share of a cell, before pairs that may touch are searched again.
_MARGIN = 0.125


class PressingPairs(NamedTuple):
    """Pairs of points of a sheet that press on each other, such as a vertex and a face."""

    nodes: Ints
    """(m, 4), mid-points that the two points of each pair depend on; some may be equal."""
    weights: Floats
    """(m, 4), their weights in the difference of the first point and the second."""
    normals: Floats
    """(m, 3), direction from the second point to the first."""
    forces: Floats
    """(m,), forces with which they press [N]."""


class SelfContact(EnergyTerm):
    """Contact of a sheet with itself.

    Parameters
    ----------
    points : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    surface : MidSurface
        Mid-surface of the sheet.
    thickness : float
        Least distance between the mid-surfaces of layers [m].
    stiffness : float
        Stiffness of contact per area [N/m³].

    Raises
    ------
    MissingLibraryError
        If ``ipctk`` is not installed.
    InputError
        If the cells are not wider than the reach of contact.
    """

    def __init__(
        self, points: Floats, surface: MidSurface, thickness: float, stiffness: float
    ) -> None:
        ipctk = load_library()
        self._given = points, surface, thickness, stiffness
        self._thickness, self.stiffness = thickness, stiffness
        #: Pairs of vertices as which positions are given; None if these are mid-points.
        self._pairs: Ints | None = surface.pairs
        self._count = len(surface.pairs)
        rest = np.asfortranarray(surface.to_nodes(points)[: self._count])
        quads = surface.quads
        faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        edges: Ints = np.asarray(ipctk.edges(faces.astype(np.int32)), dtype=np.int64)
        self._mesh = ipctk.CollisionMesh(rest, edges.astype(np.int32), faces.astype(np.int32))
        self._edges, self._faces = edges, faces
        self._reach = REACH * thickness
        sides = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
        # Parts of a flat sheet that do not meet must be out of reach: a corner, and the diagonal.
        doubled = np.linalg.norm(_face_normals(rest, faces), axis=1)
        corners = rest[faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        nearest = float((doubled / longest).min())
        if nearest <= thickness + self._reach:
            raise InputError(
                "cells are too narrow for contact of layers: a corner is "
                f"{nearest:.3g} m away from the diagonal",
                allowed=f"above {thickness + self._reach:.3g} m",
                cure="Use fewer divisions of the cage",
            )
        self._margin = _MARGIN * float(np.median(sides))
        random = np.random.default_rng(0)
        self._jitter = _JITTER * float(sides.min()) * random.uniform(-1, 1, rest.shape)
        self._barrier = ipctk.BarrierPotential(self._reach, stiffness * self._reach, True)
        #: Positions and candidates of the last broad search.
        self._near: tuple[Floats, Any] | None = None
        self._keys = np.empty(0, dtype=np.int64)
        self.nodes = np.empty((0, 4), dtype=np.int64)

    @property
    def digest(self) -> str:
        """Digest of thickness and stiffness; the mesh determines the rest."""
        return digest_of("self-contact", self._thickness, self.stiffness)

    def in_model_nodes(self, surface: PairedNodes | None, factor: float) -> SelfContact:
        """Return the term of the sheet's mid-points, times a factor."""
        points, own, thickness, stiffness = self._given
        found = SelfContact(points, own, thickness, factor * stiffness)
        found._pairs = None
        found.nodes = np.empty((0, 2), dtype=np.int64)
        return found

    def evaluate(self, positions: Floats) -> _SelfContactState:
        """Evaluate the collisions at the given positions."""
        return _SelfContactState(self, positions)

    def energy(self, positions: Floats) -> float:
        """Compute the energy of the barrier [J]."""
        middle = self.to_middle(positions)
        return float(self._barrier(self._find_collisions(middle), self._mesh, middle))

    def forces(self, positions: Floats) -> Floats:
        """Compute the gradient of the energy [N], (V, 3)."""
        return self.evaluate(positions).forces

    def tangent(self, positions: Floats) -> Floats:
        """Compute the second derivatives of the energy at the pairs of the pattern [N/m]."""
        return self.evaluate(positions).tangent()

    def follow(self, positions: Floats) -> bool:
        """Add the pairs of nodes that may come near to the pattern of the tangent."""
        return self.follow_middle(self.to_middle(positions))

    def follow_middle(self, middle: Floats) -> bool:
        """Follow mid-points, see `follow`.

        Parameters
        ----------
        middle : ndarray of float64, shape (n, 3), in columns
            Mid-points [m].

        Returns
        -------
        bool
            Whether `nodes` changed.
        """
        if self._is_near(middle):
            return False
        candidates = self._candidates(middle)
        corners = [(each.vertex_id, each.face_id) for each in candidates.fv_candidates]
        sides = [(each.edge0_id, each.edge1_id) for each in candidates.ee_candidates]
        vertex, face = np.reshape(corners, (-1, 2)).astype(np.int64).T
        one, other = np.reshape(sides, (-1, 2)).astype(np.int64).T
        meeting = [
            np.column_stack([vertex, self._faces[face]]),
            np.hstack([self._edges[one], self._edges[other]]),
        ]
        keys = np.unique(np.concatenate([self._keys, self._pair_keys(np.concatenate(meeting))]))
        if len(keys) == len(self._keys):
            return False
        self._keys = keys
        nodes = np.column_stack(np.divmod(keys, self._count))
        self.nodes = nodes if self._pairs is None else self._pairs[nodes].reshape(len(nodes), -1)
        return True

    def largest_step(self, positions: Floats, move: Floats) -> float:
        """Compute the largest step that leaves all layers farther apart than the thickness."""
        start = self.to_middle(positions)
        end = self.to_middle(positions + move)
        free = self._free_share(start, end)
        return np.inf if free >= 1.0 else 0.9 * free

    def admits(self, start: Floats, positions: Floats) -> bool:
        """Check that no layers cross."""
        return not load_library().has_intersections(self._mesh, self.to_middle(positions))

    def passes(self, before: Floats, after: Floats) -> bool:
        """Check that layers stay farther apart than the thickness along a straight move."""
        return self._free_share(self.to_middle(before), self.to_middle(after)) >= 1.0

    def resistance_matrices(self) -> Floats:
        """Return zeros: contact does not hold a sheet."""
        size = 3 * self.nodes.shape[1]
        return np.zeros((len(self.nodes), size, size))

    def stiffness_products(self, positions: Floats, fields: Floats) -> Floats:
        """Compute φᵀ K φ for each pair of fields."""
        self.follow(positions)
        return super().stiffness_products(positions, fields)

    def check_start(self, positions: Floats) -> None:
        """Refuse positions (V, 3) in which the sheet is nearer to itself than its thickness."""
        middle = self.to_middle(positions)
        ipctk = load_library()
        collisions = ipctk.NormalCollisions()
        collisions.build(self._mesh, middle, self._thickness)
        worst, where = self._thickness, None
        for k in range(len(collisions)):
            each = collisions[k]
            ids = [i for i in each.vertex_ids(self._edges, self._faces) if i >= 0]
            dof = middle[ids].ravel()
            distance = float(np.sqrt(each.compute_distance(dof)))
            if distance < worst:
                worst, where = distance, middle[ids].mean(axis=0)
        if where is None and ipctk.has_intersections(self._mesh, middle):
            raise InputError(
                "the cage passes through itself",
                cure="Start from a state in which no layers cross, or leave out [contact]",
            )
        if where is not None:
            place = ", ".join(f"{x:.4g}" for x in where)
            raise InputError(
                f"the cage overlaps itself at ({place}) m: its layers are {worst:.3g} m apart",
                allowed=f"at least {self._thickness:.3g} m between mid-surfaces",
                cure="Start from a state in which no layers overlap, or leave out [contact]",
            )

    @property
    def areas(self) -> Floats:
        """Area of the sheet at rest that belongs to each mid-point [m²], (n,)."""
        rest = self._mesh.rest_positions
        sizes = np.linalg.norm(_face_normals(rest, self._faces), axis=1) / 6
        return np.bincount(self._faces.ravel(), np.repeat(sizes, 3), len(rest)).astype(np.float64)

    def pressing_pairs(self, middle: Floats) -> PressingPairs:
        """Find what presses on what.

        Parameters
        ----------
        middle : ndarray of float64, shape (n, 3), in columns
            Mid-points [m].

        Returns
        -------
        PressingPairs
            All pairs within reach. The gradient of the barrier is the sum of their forces, up to
            those that turn nearly parallel edges.
        """
        edges = self._edges.tolist()
        found = self._find_collisions(middle)
        lines, faced = [], []
        for each in found.vv_collisions:
            first, second = each.vertex0_id, each.vertex1_id
            lines.append((first, first, second, second, each.weight, 0.0))
        for each in found.ev_collisions:
            end = each.vertex_id
            lines.append((end, end, *edges[each.edge_id], each.weight, 0.0))
        for each in found.ee_collisions:
            ends = *edges[each.edge0_id], *edges[each.edge1_id]
            lines.append((*ends, each.weight, each.eps_x))
        for each in found.fv_collisions:
            faced.append((each.vertex_id, *self._faces[each.face_id], each.weight, 0.0))
        table = np.reshape([*lines, *faced], (-1, 6))
        nodes = table[:, :4].astype(np.int64)
        corners = middle[nodes]
        weights = np.concatenate(
            [_between_lines(corners[: len(lines)]), _to_face(corners[len(lines) :])]
        )
        apart = (weights[..., None] * corners).sum(axis=1)
        square = (apart**2).sum(axis=1)
        magnitude = self._barrier.force_magnitude
        forces = np.array([magnitude(each, self._thickness) for each in square.tolist()])
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 2])
        share = np.minimum((crossed**2).sum(axis=1) / np.maximum(table[:, 5], 1e-300), 1.0)
        share[table[:, 5] == 0.0] = 1.0
        forces = forces * table[:, 4] * share * (2.0 - share)
        return PressingPairs(nodes, weights, apart / np.sqrt(square)[:, None], forces)

    def facings(self, middle: Floats) -> Floats:
        """Compute the normal of the sheet at each mid-point.

        Parameters
        ----------
        middle : ndarray of float64, shape (n, 3)
            Mid-points [m].

        Returns
        -------
        ndarray of float64, shape (n, 3)
            Normals, not of unit length.
        """
        normals = _face_normals(middle, self._faces)
        return sum_at_nodes(self._faces, np.repeat(normals, 3, axis=0), len(middle))

    def blocks_at_pairs(self, matrix: Any) -> Floats:
        """Distribute a matrix of the mid-points to the pairs of the pattern.

        Parameters
        ----------
        matrix : scipy.sparse.spmatrix, shape (3 n, 3 n)
            A symmetric matrix [N/m].

        Returns
        -------
        ndarray of float64, shape (E, 3 m, 3 m)
            Matrices at the pairs `nodes`, (E, m).
        """
        found = matrix.tobsr((3, 3))
        found.sum_duplicates()
        rows = np.repeat(np.arange(self._count), np.diff(found.indptr))
        upper = rows <= found.indices
        keys = rows[upper] * self._count + found.indices[upper]
        slots = np.searchsorted(self._keys, keys).clip(max=len(self._keys) - 1)
        # What is outside of the pattern is left out: the forces remain exact.
        known = self._keys[slots] == keys
        data, slots = found.data[upper][known], slots[known]
        diagonal = (rows[upper] == found.indices[upper])[known]
        pair = np.zeros((len(self.nodes), 2, 3, 2, 3))
        pair[slots[diagonal], 0, :, 0] = data[diagonal]
        pair[slots[~diagonal], 0, :, 1] = data[~diagonal]
        pair[slots[~diagonal], 1, :, 0] = data[~diagonal].swapaxes(1, 2)
        if self._pairs is not None:
            pair = np.repeat(np.repeat(pair, 2, axis=1), 2, axis=3) / 4
        return pair.reshape(len(pair), 3 * self.nodes.shape[1], -1)

    def to_nodes(self, forces: Floats, count: int) -> Floats:
        """Convert forces on the mid-points to forces on all nodes.

        Parameters
        ----------
        forces : ndarray of float64, shape (n, 3)
            Forces on the mid-points [N].
        count : int
            Number V of all nodes.

        Returns
        -------
        ndarray of float64, shape (V, 3)
            Forces on the nodes [N].
        """
        result = np.zeros((count, 3))
        if self._pairs is None:
            result[: len(forces)] = forces
        else:
            result[self._pairs] = forces[:, None] / 2
        return result

    def to_middle(self, positions: Floats) -> Floats:
        """Return the mid-points of positions of the nodes.

        Parameters
        ----------
        positions : ndarray of float64, shape (V, 3)
            Positions of all nodes [m].

        Returns
        -------
        ndarray of float64, shape (n, 3), in columns
            Mid-points [m].
        """
        middle = positions[: self._count]
        if self._pairs is not None:
            middle = positions[self._pairs].mean(axis=1)
        return np.asfortranarray(middle + self._jitter)

    def _find_collisions(self, middle: Floats) -> Any:
        """Return the collisions at mid-points (n, 3)."""
        found = load_library().NormalCollisions()
        found.use_area_weighting = True
        if self._near is not None and self._is_near(middle):
            found.build(self._near[1], self._mesh, middle, self._reach, self._thickness)
        else:
            found.build(self._mesh, middle, self._reach, self._thickness)
        return found

    def _is_near(self, middle: Floats) -> bool:
        """Check that what can come into reach is among the candidates of the last search."""
        if self._near is None:
            return False
        moved = middle - self._near[0]
        # A translation brings nothing nearer.
        return bool(np.linalg.norm(moved - moved.mean(axis=0), axis=1).max() <= self._margin)

    def _candidates(self, middle: Floats) -> Any:
        """Search for all that can come into reach within the margin, and keep it."""
        found = load_library().Candidates()
        found.build(self._mesh, middle, (self._reach + self._thickness) / 2 + self._margin)
        self._near = middle.copy(order="F"), found
        return found

    def _free_share(self, start: Floats, end: Floats) -> float:
        ipctk = load_library()
        if self._near is not None and self._is_near(start) and self._is_near(end):
            given = self._mesh, start, end, self._thickness, ipctk.AdditiveCCD()
            return float(self._near[1].compute_collision_free_stepsize(*given))
        return float(
            ipctk.compute_collision_free_stepsize(
                self._mesh, start, end, self._thickness, None, ipctk.AdditiveCCD()
            )
        )

    def _pair_keys(self, nodes: Ints) -> Ints:
        """Number the pairs among the four nodes in each row."""
        first, second = np.triu_indices(4)
        given = np.sort(nodes, axis=1)
        return (given[:, first] * self._count + given[:, second]).ravel()


class _SelfContactState(TermState):
    """Contact of a sheet with itself at fixed positions."""

    def __init__(self, term: SelfContact, positions: Floats) -> None:
        super().__init__(term, positions)
        self._contact = term
        self._middle = term.to_middle(positions)
        self._collisions = term._find_collisions(self._middle)

    @property
    def energy(self) -> float:
        """Energy of the barrier [J]."""
        return float(self._contact._barrier(self._collisions, self._contact._mesh, self._middle))

    @property
    def forces(self) -> Floats:
        """Gradient of the energy [N], (V, 3)."""
        term = self._contact
        pull = term._barrier.gradient(self._collisions, term._mesh, self._middle).reshape(-1, 3)
        if not np.isfinite(pull).all():  # beyond the barrier, where the energy is infinite
            return np.zeros_like(self._positions)
        return term.to_nodes(pull, len(self._positions))

    def tangent(self, removed: float = 0.0, predicted: Any = None) -> Floats:
        """Compute the second derivatives at the pairs of nodes in the pattern."""
        ipctk, term = load_library(), self._contact
        given = self._collisions, term._mesh, self._middle
        size = term.nodes.shape[1] * 3
        blocks = np.zeros((len(term.nodes), size, size))
        if not len(self._collisions) or not len(blocks):
            return blocks
        methods = ipctk.PSDProjectionMethod
        matrix = term._barrier.hessian(*given, methods.CLAMP if removed else methods.NONE)
        if 0.0 < removed < 1.0:
            own = term._barrier.hessian(*given, methods.NONE)
            matrix = removed * matrix + (1.0 - removed) * own
        return term.blocks_at_pairs(matrix)


def _face_normals(places: Floats, faces: Ints) -> Floats:
    """Compute the normals of triangles, whose length is twice the area, (T, 3)."""
    corners = places[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _between_lines(corners: Floats) -> Floats:
    """Compute the weights of the ends (m, 4, 3) of two lines in their shortest connection."""
    # A line may be a point. Ericson, Real-Time Collision Detection (2005), section 5.1.9.
    first, second = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 2]
    between = corners[:, 0] - corners[:, 2]
    squares = [np.maximum((way**2).sum(axis=1), 1e-300) for way in (first, second)]
    along, ahead, behind = (
        (one * other).sum(axis=1)
        for one, other in ((first, second), (first, between), (second, between))
    )
    area = squares[0] * squares[1] - along**2
    apart = area > 1e-12 * squares[0] * squares[1]
    s = np.where(apart, along * behind - ahead * squares[1], 0.0) / np.where(apart, area, 1.0)
    t = (along * np.clip(s, 0.0, 1.0) + behind) / squares[1]
    t = np.clip(t, 0.0, 1.0)
    s = np.clip((along * t - ahead) / squares[0], 0.0, 1.0)
    return np.stack([1.0 - s, s, t - 1.0, -t], axis=1)


def _to_face(corners: Floats) -> Floats:
    """Compute the weights of a point and the corners of the face below it, (m, 4, 3)."""
    sides = corners[:, 2:] - corners[:, 1:2]
    from_corner = corners[:, 0] - corners[:, 1]
    products = sides @ sides.swapaxes(1, 2)
    shares = np.linalg.solve(products, sides @ from_corner[..., None])[..., 0]
    ones = np.ones(len(corners))
    return np.column_stack([ones, shares.sum(axis=1) - 1.0, -shares])


def load_library() -> Any:
    """Import ipctk, or raise MissingLibraryError."""
    try:
        import ipctk
    except ImportError as error:
        raise MissingLibraryError(
            "contact of a sheet with itself needs ipctk",
            cure="Install it with: pip install 'spacemap_vtk[contact]'",
        ) from error
    return ipctk
