"""Moves of a sheet along which its quadrilaterals turn, instead of straight moves that stretch it.

A straight move by a rotation θ stretches a line by θ²/2, which costs a thin sheet more energy than
all that it gains from the move. Here each pair of tangents, and each director, is turned by the
finite rotation whose first order the move contains; the mid-points then fit the turned tangents in
least squares. To first order nothing changes. The idea is that of rotation-strain coordinates
(Huang, Tong, Zhou, Bao and Desbrun, IEEE Trans. Vis. Comput. Graph. 17 (2011) 983), about any
deformed shape.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spacemap_vtk.mechanics.elements.shell import MidSurface, frame_matrix
from spacemap_vtk.ndarrays import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Weight of the straight move. Only what the tangents leave free, a translation of a sheet that
#: nothing holds, follows it.
_STRAIGHT = 1e-9


class TurningMoves:
    """Finite moves of p and δ of a sheet, from straight ones."""

    # `points` (V, 3) are the undeformed vertices [m]. Columns of `basis` (3V, N) are the motions of
    # p and δ that the supports allow.
    def __init__(self, points: Floats, surface: MidSurface, basis: csr_matrix) -> None:
        from scipy.sparse import block_diag, csr_matrix, diags, eye, kron
        from scipy.sparse.linalg import splu

        self._count, self._basis = len(surface.pairs), basis
        frames, areas = frame_matrix(points, surface)
        is_tangent = np.arange(len(areas)) % 3 < 2
        self._tangents = frames[is_tangent][:, : self._count].tocsr()
        self._weighted = self._tangents.T.multiply(areas[is_tangent]).tocsr()
        directors = frames[~is_tangent][:, self._count :]
        #: Weights of δ, from those of the directors at the points of the quadrilaterals.
        self._weights = directors.multiply(directors).T @ areas[~is_tangent]
        #: Mean over the points around each pair.
        around = directors.T.astype(bool).astype(np.float64)
        self._mean = csr_matrix(diags(1 / np.asarray(around.sum(axis=1)).ravel()) @ around)
        springs = self._weighted @ self._tangents
        self._straight = _STRAIGHT * springs.diagonal()
        whole = kron(block_diag([springs + diags(self._straight), diags(self._weights)]), eye(3))
        self._solve = splu((basis.T @ whole @ basis).tocsc(), permc_spec="MMD_AT_PLUS_A").solve

    def turn(self, positions: Floats, move: Floats) -> Floats:
        """Replace a straight move from the given positions, (V, 3), by one that turns the sheet."""
        count = self._count
        tangents, changes = (
            np.moveaxis((self._tangents @ each[:count]).reshape(-1, 2, 3), 2, 0)
            for each in (positions, move)
        )
        # With the dual tangents aⁱ, Σ aⁱ × Δa_i is the rotation, but twice its part about the
        # normal.
        across = _cross(tangents[..., 0], tangents[..., 1])
        square = (across**2).sum(axis=0)
        spin = _cross(_cross(tangents[..., 1], across), changes[..., 0])
        spin += _cross(_cross(across, tangents[..., 0]), changes[..., 1])
        spin = (spin - 0.5 * across * ((spin * across).sum(axis=0) / square)) / square
        turned = _turn(tangents, changes, spin[..., None]) - tangents
        half, change = positions[count:].T, move[count:].T
        # A director's change leaves its rotation about itself open, which is that of the sheet.
        around = half * ((half * (self._mean @ spin.T).T).sum(axis=0))
        spin = (_cross(half, change) + around) / (half**2).sum(axis=0)
        load = np.empty_like(move)
        load[:count] = self._weighted @ np.moveaxis(turned, 0, 2).reshape(-1, 3)
        load[:count] += self._straight[:, None] * move[:count]
        load[count:] = (self._weights * (_turn(half, change, spin) - half)).T
        basis = self._basis
        return np.asarray(basis @ self._solve(basis.T @ load.ravel())).reshape(-1, 3)


def _cross(left: Floats, right: Floats) -> Floats:
    """Compute cross products of vectors whose components lie along the first axis."""
    return np.stack([left[i - 2] * right[i - 1] - left[i - 1] * right[i - 2] for i in range(3)])


def _turn(vectors: Floats, changes: Floats, spin: Floats) -> Floats:
    """Turn vectors by finite rotations, and stretch them by what is left of their changes."""
    once = _cross(spin, vectors)
    stretched = vectors + changes - once
    once = _cross(spin, stretched)
    angle = np.sqrt((spin**2).sum(axis=0))
    # sin θ/θ and (1 - cos θ)/θ²; the latter is sin²(θ/2)/2 over (θ/2)².
    half = np.sinc(angle / (2 * np.pi))
    result: Floats = stretched + np.sinc(angle / np.pi) * once + half**2 / 2 * _cross(spin, once)
    return result
