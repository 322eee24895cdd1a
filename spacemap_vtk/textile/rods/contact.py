"""Pairs of samples of yarns that touch, images in neighbouring cells included."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.rods.yarns import Samples, image_matrices

#: Samples of one yarn that are nearer than this along it, in diameters, do not touch each other.
NEIGHBOURS = 1.6


class Pairs(NamedTuple):
    """Pairs of samples that may touch; the second one is an image of a sample."""

    first: Ints
    """(C,) Number of the first sample."""
    second: Ints
    """(C,) Number of the second sample."""
    shift: Ints
    """(C, 2) Periods by which the second one is moved."""


def move_to_image(place: Floats, shift: Ints, cell: Floats, turn: float) -> Floats:
    """Move points (C, 3) to the cells at whole numbers (C, 2) of periods."""
    turned, along, across = image_matrices(shift, turn)
    moved = np.einsum("...ij,...j->...i", turned, place)
    return np.asarray(moved + along @ cell[0] + across @ cell[1])


def separate(samples: Samples, pairs: Pairs, z: Floats) -> Floats:
    """Compute the vectors from the second to the first samples of pairs, (C, 3)."""
    place = samples.places(z)
    second = move_to_image(place[pairs.second], pairs.shift, z[-2:], samples.turn)
    return np.asarray(place[pairs.first] - second)


def find_pairs(samples: Samples, z: Floats, length: Floats, reach: float) -> Pairs:
    """Find the pairs of samples, images included, that are nearer than a distance."""
    # `length` is that of a span of each yarn. Samples of one yarn that are nearer than `NEIGHBOURS`
    # diameters along it are left out.
    from scipy.spatial import cKDTree

    place, cell = samples.places(z), z[-2:]
    tree = cKDTree(place)
    first, second = tree.query_pairs(reach, output_type="ndarray").T
    found = [Pairs(first, second, np.zeros((len(first), 2), dtype=np.int64))]
    for move in neighbouring_cells(place, cell, reach):
        near = tree.sparse_distance_matrix(
            cKDTree(move_to_image(place, move, cell, samples.turn)),
            reach,
            output_type="coo_matrix",
        )
        found.append(Pairs(near.row, near.col, np.tile(move, (near.nnz, 1))))
    pairs = Pairs(*(np.concatenate(each).astype(np.int64) for each in zip(*found, strict=True)))
    keep = ~_are_neighbours(samples, pairs, length)
    return Pairs(*(each[keep] for each in pairs))


def neighbouring_cells(place: Floats, cell: Floats, reach: float) -> list[Ints]:
    """List the moves of the cell, one of each opposite two, that may bring samples together."""
    gram = cell @ cell.T
    most = np.zeros(2, dtype=np.int64)
    for axis in np.flatnonzero(np.diag(gram)):
        other = 1 - axis
        across = cell[axis].copy()
        if gram[other, other]:
            across -= gram[0, 1] / gram[other, other] * cell[other]
        height = float(np.linalg.norm(across))
        most[axis] = int((float(np.ptp(place @ across)) / height + reach) / height)
    steps = [np.arange(-n, n + 1) for n in most]
    moves = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
    return list(moves[len(moves) // 2 + 1 :])


def _are_neighbours(samples: Samples, pairs: Pairs, length: Floats) -> Bools:
    """Check which pairs are close to each other along one yarn."""
    yarn = samples.yarn[pairs.first]
    periods, spans = samples.periods[yarn], samples.spans[yarn]
    # How often the yarn has repeated itself at the image; only then are both on one yarn.
    turns = (pairs.shift * periods).sum(axis=1) // np.maximum((periods**2).sum(axis=1), 1)
    same = (yarn == samples.yarn[pairs.second]) & (turns[:, None] * periods == pairs.shift).all(
        axis=1
    )
    apart = samples.parameter[pairs.first] - samples.parameter[pairs.second] - turns * spans
    is_loop = samples.has_no_ends[yarn] & ~periods.any(axis=1)
    apart -= np.where(is_loop, spans * np.round(apart / spans), 0.0)
    return np.asarray(same & (abs(apart) * length[yarn] < NEIGHBOURS * samples.diameter[yarn]))


def relative_distances(samples: Samples, pairs: Pairs, z: Floats) -> Floats:
    """Compute distances of the pairs over the mean diameter of their yarns, (C,)."""
    distance = np.linalg.norm(separate(samples, pairs, z), axis=1)
    return distance / mean_diameters(samples, pairs)


def mean_diameters(samples: Samples, pairs: Pairs) -> Floats:
    """Compute the mean diameter of the two yarns of each pair [m], (C,)."""
    own = samples.diameter[samples.yarn]
    return (own[pairs.first] + own[pairs.second]) / 2
