"""Pairs of samples of yarns that touch, images in neighbouring cells included."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parallel import blocks
from spacemap_vtk.textile.rods.yarns import Samples, move_to_image

#: Samples of one yarn that are nearer than this along it, in diameters, do not touch each other.
NEIGHBOURS = 1.6
#: Number of distances that are computed together.
_BLOCK = 2**20


class Pairs(NamedTuple):
    """Pairs of samples that may touch; the second one is an image of a sample."""

    # Pairs of the same two spans follow each other.

    first: Ints
    """(C,) Number of the first sample."""
    second: Ints
    """(C,) Number of the second sample."""
    shift: Ints
    """(C, 2) Periods by which the second one is moved."""

    def select(self, which: Bools | Ints | slice) -> Pairs:
        """Return some of the pairs."""
        return Pairs(*(each[which] for each in self))


def separate(samples: Samples, pairs: Pairs, z: Floats) -> Floats:
    """Compute the vectors from the second to the first samples of pairs, (C, 3)."""
    place = samples.places(z)
    found = place[pairs.first] - place[pairs.second]
    (moved,) = np.nonzero(pairs.shift.any(axis=1))
    second = place[pairs.second[moved]]
    found[moved] += second - move_to_image(second, pairs.shift[moved], z[-2:], samples.turn)
    return found


def find_pairs(samples: Samples, z: Floats, length: Floats, reach: float) -> Pairs:
    """Find the pairs of samples, images included, that are nearer than a distance."""
    # `length` is that of a span of each yarn. Samples of one yarn that are nearer than `NEIGHBOURS`
    # diameters along it are left out. Spans that may be near are found first.
    from scipy.spatial import cKDTree

    count, cell = len(samples.basis[0]), z[-2:]
    place = samples.places(z).reshape(-1, count, 3)
    middle = (place.max(axis=1) + place.min(axis=1)) / 2
    radius = np.linalg.norm(place - middle[:, None], axis=2).max(axis=1)
    apart = reach + 2 * float(radius.max())
    tree = cKDTree(middle)
    first, second = tree.query_pairs(apart, output_type="ndarray").T
    own = np.arange(len(middle))
    found = [(own, own, np.zeros((len(own), 2), dtype=np.int64))]
    found.append((first, second, np.zeros((len(first), 2), dtype=np.int64)))
    for move in neighbouring_cells(middle, cell, apart):
        near = tree.sparse_distance_matrix(
            cKDTree(move_to_image(middle, move, cell, samples.turn)),
            apart,
            output_type="coo_matrix",
        )
        found.append((near.row, near.col, np.tile(move, (near.nnz, 1))))
    spans = Pairs(*(np.concatenate(each).astype(np.int64) for each in zip(*found, strict=True)))
    image = move_to_image(middle[spans.second], spans.shift, cell, samples.turn)
    gap = np.linalg.norm(middle[spans.first] - image, axis=1)
    spans = spans.select(gap <= reach + radius[spans.first] + radius[spans.second])
    starts = spans._replace(first=count * spans.first, second=count * spans.second)
    spans = spans.select(~_are_neighbours(samples, starts, length, 1.0))
    parts = [spans.select(slice(0))]
    for part in blocks(len(spans.first), max(1, _BLOCK // count**2)):
        own_spans = spans.select(part)
        one, two = (place[own_spans.first], place[own_spans.second])
        two = move_to_image(two, own_spans.shift[:, None], cell, samples.turn)
        # about the middle of the first span, to lose no digits in the products
        one, two = one - middle[own_spans.first, None], two - middle[own_spans.first, None]
        square = -2 * one @ two.swapaxes(1, 2)
        square += (one**2).sum(axis=2)[:, :, None]
        square += (two**2).sum(axis=2)[:, None]
        pair, i, j = np.nonzero(square < reach**2)
        parts.append(
            Pairs(
                own_spans.first[pair] * count + i,
                own_spans.second[pair] * count + j,
                own_spans.shift[pair],
            )
        )
    pairs = Pairs(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    pairs = pairs.select((pairs.first < pairs.second) | pairs.shift.any(axis=1))
    return pairs.select(~_are_neighbours(samples, pairs, length, 0.0))


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


def _are_neighbours(samples: Samples, pairs: Pairs, length: Floats, slack: float) -> Bools:
    """Check which pairs are close to each other along one yarn, if `slack` spans further apart."""
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
    along = (abs(apart) + slack) * length[yarn]
    return np.asarray(same & (along < NEIGHBOURS * samples.diameter[yarn]))


def mean_diameters(samples: Samples, pairs: Pairs) -> Floats:
    """Compute the mean diameter of the two yarns of each pair [m], (C,)."""
    own = samples.diameter[samples.yarn]
    return np.asarray((own[pairs.first] + own[pairs.second]) / 2)
