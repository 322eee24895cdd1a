"""Sums over spans: derivatives by their control points become derivatives by z.

A span that is moved by some periods depends on them, too: its four control points are

    c_k = R(a_k φ) q_k + a_k B(a_k φ) P1 + b_k P2

so that derivatives by c_k give those by q_k, P1 and P2.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.rods.yarns import Samples, image_matrices

if TYPE_CHECKING:
    from scipy.sparse import bsr_matrix, csr_matrix


class Blocks(NamedTuple):
    """Second derivatives by the control points of pairs of spans."""

    first: Ints
    """(n,) Spans of the rows."""
    second: Ints
    """(n,) Spans of the columns."""
    values: Floats
    """(n, 4, 3, 4, 3) Derivatives by both."""


def add_gradients(samples: Samples, values: Floats, count: int) -> Floats:
    """Sum derivatives by control points of spans, (E, 4, 3), to those by z, (count, 3)."""
    moved = np.asarray(samples.wraps.any(axis=(1, 2)))
    nodes, matrices = _expand(samples, moved, count)
    wide = matrices @ values[moved].reshape(-1, 12, 1)
    where = np.concatenate([samples.nodes[~moved].ravel(), nodes.ravel()])
    given = np.concatenate([values[~moved].reshape(-1, 3), wide.reshape(-1, 3)])
    return np.stack([np.bincount(where, each, count) for each in given.T], axis=1)


def add_blocks(samples: Samples, parts: Iterable[Blocks], count: int) -> bsr_matrix:
    """Sum second derivatives by control points to those by z, (3 count, 3 count)."""
    from scipy.sparse import bsr_matrix

    wrapped = np.asarray(samples.wraps.any(axis=(1, 2)))
    keys, values = [], []
    for part in parts:
        moved = wrapped[part.first] | wrapped[part.second]
        (first, left), (second, right) = (
            _expand(samples, side[moved], count) for side in (part.first, part.second)
        )
        wide = left @ part.values[moved].reshape(-1, 12, 12) @ right.swapaxes(1, 2)
        plain = (samples.nodes[side[~moved]] for side in (part.first, part.second))
        for rows, columns, each in ((*plain, part.values[~moved]), (first, second, wide)):
            size = rows.shape[1]
            keys.append((rows[:, :, None] * count + columns[:, None]).ravel())
            own = each.reshape(-1, size, 3, size, 3).swapaxes(2, 3)
            values.append(own.reshape(-1, 9))
    found, slots = np.unique(np.concatenate(keys), return_inverse=True)
    whole = np.concatenate(values)
    blocks = np.stack([np.bincount(slots, each, len(found)) for each in whole.T], axis=1)
    rows, columns = np.divmod(found, count)
    starts = np.searchsorted(rows, np.arange(count + 1))
    return bsr_matrix((blocks.reshape(-1, 3, 3), columns, starts), shape=(3 * count,) * 2)


def place_matrix(samples: Samples, order: int, count: int) -> csr_matrix:
    """Make the matrix (3 S, 3 count) from z to derivatives of places by the parameter."""
    from scipy.sparse import bsr_matrix

    nodes, matrices = _expand(samples, slice(None), count)
    wide = matrices.reshape(-1, 6, 3, 4, 3)
    blocks = np.einsum("gk,etckj->egtjc", samples.basis[order], wide)
    rows = len(nodes) * len(samples.basis[order])
    columns = np.repeat(nodes, len(samples.basis[order]), axis=0).ravel()
    starts = np.arange(0, 6 * rows + 1, 6)
    parts = blocks.reshape(-1, 3, 3), columns, starts
    return bsr_matrix(parts, shape=(3 * rows, 3 * count)).tocsr()


def _expand(samples: Samples, which: Ints | Bools | slice, count: int) -> tuple[Ints, Floats]:
    """Return the rows of z on which spans depend, (n, 6), and the matrices (n, 18, 12) to them."""
    wraps = samples.wraps[which]
    periods = np.broadcast_to([count - 2, count - 1], (len(wraps), 2))
    turned, along, across = (m.swapaxes(2, 3) for m in image_matrices(wraps, samples.turn))
    matrices = np.zeros((len(wraps), 6, 3, 4, 3))
    for k in range(4):
        matrices[:, k, :, k] = turned[:, k]
        matrices[:, 4, :, k] = along[:, k]
        matrices[:, 5, :, k] = across[:, k]
    return np.concatenate([samples.nodes[which], periods], axis=1), matrices.reshape(-1, 18, 12)
