"""Centre lines of yarns in a periodic cell: uniform cubic B-splines of their control points.

Everything is linear in the unknowns z: the control points of all yarns, (n, 3), followed by the
two period vectors of the cell, (2, 3). A yarn that leaves the cell comes back one or more periods
away, so its points depend on the periods, too:

    r(u) = Σ_k N_k(u) (q_k + m_k · P)

with whole numbers m_k of periods.

A cell may be bent, too: then each period along P1 turns what follows by an angle φ about y, towards
z, and the neighbours of a cell lie on an arc. With the turn R(φ) and the chord B(φ) of an arc,

    r(u) = Σ_k N_k(u) (R(a φ) q_k + a B(a φ) P1 + b P2),  m_k = (a, b)

which is linear in z, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Bools, Floats, Ints

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
    """Points along all yarns at which energies are summed; places are linear in z."""

    nodes: Ints
    """(E, 4) Control points of each span, as rows of z."""
    wraps: Ints
    """(E, 4, 2) Periods by which each of them is moved."""
    basis: tuple[Floats, Floats, Floats]
    """(g, 4) B-splines at the samples of a span, and their two derivatives."""
    weight: Floats
    """(S,) Weights of the quadrature over the parameter; S = E g."""
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

    def resample(self, at: Floats, weights: Floats) -> Samples:
        """Return other samples of the same yarns, as for `sample_yarns`."""
        old, new = len(self.basis[0]), len(at)
        span = np.floor(self.parameter[::old])
        return self._replace(
            basis=basis_functions(at),
            weight=np.tile(weights, len(self.nodes)),
            yarn=np.repeat(self.yarn[::old], new),
            parameter=(span[:, None] + at).ravel(),
        )

    def corners(self, z: Floats) -> Floats:
        """Compute the control points of each span where its yarn runs, (E, 4, 3) [m]."""
        found = z[self.nodes]
        wrapped = self.wraps.any(axis=2)
        found[wrapped] = move_to_image(found[wrapped], self.wraps[wrapped], z[-2:], self.turn)
        return found

    def places(self, z: Floats) -> Floats:
        """Compute the positions r of the samples, (S, 3) [m]."""
        return self.combine(self.corners(z), 0)

    def slopes(self, z: Floats) -> Floats:
        """Compute the derivatives r′ by the parameter, 1 per span, (S, 3) [m]."""
        return self.combine(self.corners(z), 1)

    def bends(self, z: Floats) -> Floats:
        """Compute the second derivatives r″, (S, 3) [m]."""
        return self.combine(self.corners(z), 2)

    def combine(self, corners: Floats, order: int) -> Floats:
        """Compute the derivatives of an order from the control points of spans, (S, 3)."""
        wide = corners.swapaxes(1, 2).reshape(-1, 4) @ self.basis[order].T
        return wide.reshape(len(corners), 3, -1).swapaxes(1, 2).reshape(-1, 3)

    def gather(self, values: Floats, order: int) -> Floats:
        """Sum derivatives by samples (S, 3) to those by the control points of spans, (E, 4, 3)."""
        wide = values.reshape(len(self.nodes), -1, 3).swapaxes(1, 2)
        found = wide.reshape(-1, len(self.basis[order])) @ self.basis[order]
        return found.reshape(-1, 3, 4).swapaxes(1, 2)


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
    """Place samples on yarns, whose places, slopes and bends follow from z.

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
    return Samples(
        np.concatenate(nodes),
        np.concatenate(wraps),
        basis_functions(np.asarray(at, dtype=np.float64)),
        np.tile(weights, sum(spans)),
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


def move_to_image(place: Floats, shift: Ints, cell: Floats, turn: float) -> Floats:
    """Move points (…, 3) to the cells at whole numbers (…, 2) of periods."""
    if not turn:
        return np.asarray(place + shift @ cell)
    rotation, along, across = image_matrices(shift, turn)
    moved = np.einsum("...ij,...j->...i", rotation, place)
    return np.asarray(moved + along @ cell[0] + across @ cell[1])
