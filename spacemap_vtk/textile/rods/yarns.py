"""Centre lines of yarns in a periodic cell: uniform cubic B-splines of their control points.

Everything is linear in the unknowns z: the control points of all yarns, (n, 3), followed by the
two period vectors of the cell, (2, 3). A yarn that leaves the cell comes back one or more periods
away, so its points depend on the periods, too:

    r(u) = Σ_k N_k(u) (q_k + m_k · P)

with whole numbers m_k of periods. A sparse matrix of three rows per sample holds all of this.

A cell may be bent, too: then each period along P1 turns what follows by an angle φ about y, towards
z, and the neighbours of a cell lie on an arc. With the turn R(φ) and the chord B(φ) of an arc,

    r(u) = Σ_k N_k(u) (R(a φ) q_k + a B(a φ) P1 + b P2),  m_k = (a, b)

which is linear in z, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Samples in each span, Gauss points, and their weights.
PER_SPAN = 5
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(PER_SPAN)
_NODES, _WEIGHTS = (1.0 + _NODES) / 2.0, _WEIGHTS / 2.0


class Yarn(NamedTuple):
    """Centre line of a yarn as control points of a uniform cubic B-spline."""

    points: Floats
    """(n, 3) Control points, at least 4 [m]."""
    periods: tuple[int, int] | None = (0, 0)
    """Whole periods of the cell after which the yarn repeats itself; (0, 0) for a closed loop,
    None for a yarn with two ends."""
    diameter: float = 1.0
    """Diameter [m]."""


class Samples(NamedTuple):
    """Points along all yarns at which energies are summed; values are linear in z."""

    place: csr_matrix
    """(3 S, 3 n + 6) Positions r from z."""
    slope: csr_matrix
    """(3 S, 3 n + 6) Derivatives r′ by the parameter, 1 per span."""
    bend: csr_matrix
    """(3 S, 3 n + 6) Second derivatives r″."""
    weight: Floats
    """(S,) Weights of the quadrature over the parameter."""
    yarn: Ints
    """(S,) Yarn of each sample."""
    parameter: Floats
    """(S,) Parameter of each sample on its yarn, in spans."""
    spans: Ints
    """(Y,) Number of spans of each yarn."""
    periods: Ints
    """(Y, 2) Periods after which each yarn repeats itself; (0, 0) for loops and ends."""
    has_no_ends: Bools
    """(Y,) Whether a yarn is a loop or repeats itself."""
    diameter: Floats
    """(Y,) Diameters [m]."""
    turn: float
    """Angle by which the cell is bent in a period along P1 [rad]."""

    def places(self, z: Floats) -> Floats:
        """Compute the positions of the samples, (S, 3) [m]."""
        return np.asarray(self.place @ z.ravel()).reshape(-1, 3)


def basis_functions(t: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute the four B-splines of a span and two derivatives at t from 0 to 1, (…, 4) each."""
    one = 1.0 - t
    value = np.stack([one**3, 3 * t**3 - 6 * t**2 + 4, 3 * one**3 - 6 * one**2 + 4, t**3], -1) / 6
    slope = np.stack([-(one**2), 3 * t**2 - 4 * t, 4 * one - 3 * one**2, t**2], -1) / 2
    bend = np.stack([one, 3 * t - 2, 3 * one - 2, t], -1)
    return value, slope, bend


def unknowns(yarns: Sequence[Yarn], cell: Floats) -> Floats:
    """Stack all control points and the two period vectors: the unknowns z.

    Parameters
    ----------
    yarns : sequence of Yarn
        The yarns.
    cell : ndarray of float64, shape (2, 3)
        Period vectors [m].

    Returns
    -------
    ndarray of float64, shape (n + 2, 3)
        z [m].
    """
    return np.concatenate([*(yarn.points for yarn in yarns), np.asarray(cell, dtype=np.float64)])


def sample_yarns(
    yarns: Sequence[Yarn], at: Floats = _NODES, weights: Floats = _WEIGHTS, turn: float = 0.0
) -> Samples:
    """Make the sparse matrices that give places, slopes and bends of yarns from z.

    Parameters
    ----------
    yarns : sequence of Yarn
        The yarns.
    at, weights : ndarray of float64, shape (g,), optional
        Places of the samples in each span, from 0 to 1, and their weights; by default Gauss points.
    turn : float, optional
        Angle by which the cell is bent in a period along P1 [rad].

    Returns
    -------
    Samples
        g samples on each span.

    Raises
    ------
    GeometryError
        If a yarn has less than 4 control points.
    """
    total = sum(len(yarn.points) for yarn in yarns)
    nodes, wraps, owner, where, spans = [], [], [], [], []
    first = 0
    for number, yarn in enumerate(yarns):
        count = len(yarn.points)
        if count < 4:
            raise GeometryError(
                f"yarn {number} has too few control points", value=count, allowed="4 or more"
            )
        lengths = count if yarn.periods is not None else count - 3
        round_, index = np.divmod(np.arange(lengths)[:, None] + np.arange(4), count)
        nodes.append(first + index)
        wraps.append(round_[..., None] * np.array(yarn.periods or (0, 0)))
        owner.append(np.full(lengths * len(at), number))
        where.append((np.arange(lengths)[:, None] + at).ravel())
        spans.append(lengths)
        first += count
    node, wrap = np.concatenate(nodes), np.concatenate(wraps)
    columns = np.concatenate([node, np.tile([total, total + 1], (len(node), 1))], axis=1)
    columns = np.repeat(columns, len(at), axis=0)
    turned, along, across = image_matrices(wrap, turn)

    def matrix(shape: Floats) -> csr_matrix:
        own = np.einsum("gk,ekij->egkij", shape, turned)
        first, second = (
            np.einsum("gk,ekij->egij", shape, each)[:, :, None] for each in (along, across)
        )
        return _from_blocks(np.concatenate([own, first, second], axis=2), columns, total + 2)

    place, slope, bend = map(matrix, basis_functions(np.asarray(at, dtype=np.float64)))
    return Samples(
        place,
        slope,
        bend,
        np.tile(weights, len(node)),
        np.concatenate(owner),
        np.concatenate(where),
        np.array(spans),
        np.array([yarn.periods or (0, 0) for yarn in yarns]),
        np.array([yarn.periods is not None for yarn in yarns]),
        np.array([yarn.diameter for yarn in yarns], dtype=np.float64),
        turn,
    )


def measure_thickness(yarns: Sequence[Yarn], cell: Floats) -> float:
    """Compute the thickness of a textile.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns of a cell.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, across z [m].

    Returns
    -------
    float
        Distance from its lowest to its highest point along z [m].
    """
    samples = sample_yarns(yarns)
    height = samples.places(unknowns(yarns, cell))[:, 2]
    radius = samples.diameter[samples.yarn] / 2
    return float((height + radius).max() - (height - radius).min())


def image_matrices(shift: Ints, turn: float) -> tuple[Floats, Floats, Floats]:
    """Compute the matrices of R, a B and b of images (…, 2), each of shape (…, 3, 3)."""
    a, b = shift[..., 0], shift[..., 1]
    angle = a * turn
    rotation, chord = np.zeros((2, *shift.shape[:-1], 3, 3))
    rotation[..., 0, 0] = rotation[..., 2, 2] = np.cos(angle)
    rotation[..., 2, 0] = np.sin(angle)
    rotation[..., 0, 2] = -np.sin(angle)
    rotation[..., 1, 1] = 1.0
    # (1 - cos φ)/φ without a division by zero
    run, rise = np.sinc(angle / np.pi), np.sin(angle / 2) * np.sinc(angle / (2 * np.pi))
    chord[..., 0, 0] = chord[..., 2, 2] = a * run
    chord[..., 2, 0] = a * rise
    chord[..., 0, 2] = -a * rise
    chord[..., 1, 1] = a
    return rotation, chord, b[..., None, None] * np.eye(3)


def _from_blocks(blocks: Floats, columns: Ints, count: int) -> csr_matrix:
    """Build a matrix of 3 x 3 blocks, (e, g, k, 3, 3), in given columns, (e g, k)."""
    from scipy.sparse import bsr_matrix

    rows, each = columns.shape
    starts = np.arange(0, each * rows + 1, each)
    found = bsr_matrix(
        (blocks.reshape(-1, 3, 3), columns.ravel(), starts), shape=(3 * rows, 3 * count)
    )
    return found.tocsr()
