"""Compute the largest overlap of yarns, also between their samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks
from spacemap_vtk.textile.rods.contact import Pairs, find_pairs, mean_diameters
from spacemap_vtk.textile.rods.yarns import Yarn, move_to_image, sample_yarns, unknowns

#: Distances of samples along yarns where overlaps are searched, in diameters: of short yarns, and
#: of long ones, which have about this number of samples.
_SAMPLE, _COARSEST, _MOST_SAMPLES = 0.1, 0.5, 200_000
#: Number of pairs of samples whose nearest points are computed together.
_BLOCK = 2**18
#: Rounds in which the nearest points of two yarns are found.
_ROUNDS = 3
#: Most samples in a span.
_MOST_PARTS = 256


class Overlap(NamedTuple):
    """The place where two yarns overlap most."""

    share: float
    """Overlap over the mean diameter; negative if yarns do not touch."""
    yarns: tuple[int, int]
    place: Floats
    """(3,) Middle between the two centre lines [m]."""


def largest_overlap(yarns: Sequence[Yarn], cell: Floats, turn: float = 0.0) -> float:
    """Compute the largest overlap of yarns over their mean diameter; 0 if there is none."""
    worst = find_largest_overlap(yarns, cell, turn)
    return 0.0 if worst is None else max(worst.share, 0.0)


def find_largest_overlap(yarns: Sequence[Yarn], cell: Floats, turn: float = 0.0) -> Overlap | None:
    """Find where two yarns, images included, or two parts of one overlap most.

    Parameters
    ----------
    yarns : sequence of Yarn
        Centre lines with their diameters.
    cell : ndarray of float64, shape (2, 3)
        Period vectors [m].
    turn : float, optional
        Angle by which the cell is bent in a period along P1 [rad].

    Returns
    -------
    Overlap or None
        The largest overlap; None if no two centre lines are nearer than the largest diameter.
    """
    z = unknowns(yarns, cell)
    chords = [_chords(yarn, cell) for yarn in yarns]
    lengths = np.array([each.mean() for each in chords])
    longest, total = max(each.max() for each in chords), sum(each.sum() for each in chords)
    least, most = (end(yarn.diameter for yarn in yarns) for end in (min, max))
    fine = float(np.clip(total / least / _MOST_SAMPLES, _SAMPLE, _COARSEST))
    count = int(np.clip(np.ceil(longest / (fine * least)), 1, _MOST_PARTS))
    at = (np.arange(count) + 0.5) / count
    samples = sample_yarns(yarns, at, np.full(count, 1.0 / count), turn)
    pairs = find_pairs(samples, z, lengths, (1.0 + fine) * most)
    # Near its sample, a yarn is followed by half the way to the next one, with its bend.
    slope, bend = samples.slopes(z) / (2.0 * count), samples.bends(z) / (8.0 * count**2)
    place = samples.places(z)
    worst: Overlap | None = None
    for part in blocks(len(pairs.first), _BLOCK):
        own = Pairs(*(each[part] for each in pairs))
        i, j = own.first, own.second
        apart = place[i] - move_to_image(place[j], own.shift, cell, samples.turn)
        middle, distance = _nearest_points(apart, slope[i], bend[i], slope[j], bend[j])
        share = 1.0 - distance / mean_diameters(samples, own)
        k = int(share.argmax())
        if worst is None or share[k] > worst.share:
            owners = int(samples.yarn[i[k]]), int(samples.yarn[j[k]])
            worst = Overlap(float(share[k]), owners, place[i[k]] + middle[k])
    return worst


def _nearest_points(
    apart: Floats, slope_i: Floats, bend_i: Floats, slope_j: Floats, bend_j: Floats
) -> tuple[Floats, Floats]:
    """Compute the middle between the nearest points of pairs of short arcs, and their distance."""
    # An arc is s slope + s² bend, s from -1 to 1; the second one begins at -`apart`.
    s, t = np.zeros((2, len(apart)))
    middle, distance = np.zeros_like(apart), np.full(len(apart), np.inf)
    for _ in range(_ROUNDS):
        step = s[:, None] * slope_i + s[:, None] ** 2 * bend_i
        gap = apart + step - t[:, None] * slope_j - t[:, None] ** 2 * bend_j
        found = np.linalg.norm(gap, axis=1)
        better = found < distance
        distance[better], middle[better] = found[better], (step - gap / 2)[better]
        a, b = slope_i + 2 * s[:, None] * bend_i, slope_j + 2 * t[:, None] * bend_j
        aa, bb, ab, ga, gb = (
            np.einsum("ci,ci->c", *two) for two in ((a, a), (b, b), (a, b), (gap, a), (gap, b))
        )
        aa, bb = 1.01 * aa, 1.01 * bb  # for parallel yarns
        area = aa * bb - ab**2
        s = np.clip(s + (ab * gb - bb * ga) / area, -1.0, 1.0)
        t = np.clip(t + (aa * gb - ab * ga) / area, -1.0, 1.0)
    return middle, distance


def _chords(yarn: Yarn, cell: Floats) -> Floats:
    """Compute the distances of the ends of each span, (spans,) [m]."""
    line = drawn_points(yarn, None if yarn.periods is None else np.asarray(yarn.periods) @ cell)
    ends = (line[:-2] + 4.0 * line[1:-1] + line[2:]) / 6.0
    return np.asarray(np.linalg.norm(np.diff(ends, axis=0), axis=1))


def drawn_points(yarn: Yarn, move: Floats | None) -> Floats:
    """Return the control points of one period, with the three that close the last span."""
    return yarn.points if move is None else np.vstack([yarn.points, yarn.points[:3] + move])
