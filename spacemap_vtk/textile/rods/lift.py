"""Heights of yarns that are drawn flat, from which of them is above at each crossing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.textile.rods.crossings import Crossings
from spacemap_vtk.textile.rods.yarns import Yarn, basis_functions

#: Weight of a crossing against that of a bend.
_WEIGHT = 30.0
#: Rounds in which crossings with too little distance are pushed apart.
_ROUNDS = 8


def lift_yarns(yarns: Sequence[Yarn], crossings: Crossings, above: Bools) -> list[Yarn]:
    """Give flat yarns smooth heights, so that the given ones are above at the crossings."""
    # `above` (c,) says whether the first yarn of each crossing shall be above the second one. Yarns
    # are bent as little as possible, with about a mean diameter between two that cross.
    from scipy.sparse import block_diag, csr_matrix, vstack
    from scipy.sparse.linalg import spsolve

    counts = np.array([len(yarn.points) for yarn in yarns])
    firsts = np.concatenate([[0], np.cumsum(counts)])
    total = int(firsts[-1])
    bends = []
    for yarn, count in zip(yarns, counts, strict=True):
        middle = np.arange(count) if yarn.periods is not None else np.arange(1, count - 1)
        rows = np.tile(np.arange(len(middle)), 3)
        columns = np.concatenate([middle - 1, middle, middle + 1]) % count
        values = np.repeat([1.0, -2.0, 1.0], len(middle))
        bends.append(csr_matrix((values, (rows, columns)), shape=(len(middle), count)))
    bend = block_diag(bends)

    def heights(side: int) -> csr_matrix:
        span, t = np.divmod(crossings.parameters[:, side], 1.0)
        who = crossings.yarns[:, side]
        columns = firsts[who, None] + (span[:, None].astype(int) + np.arange(4)) % counts[who, None]
        starts = np.arange(0, 4 * len(who) + 1, 4)
        shape = len(who), total
        return csr_matrix((basis_functions(t)[0].ravel(), columns.ravel(), starts), shape=shape)

    apart = heights(0) - heights(1)
    diameter = np.array([yarn.diameter for yarn in yarns])
    wanted = diameter[crossings.yarns].mean(axis=1) * np.where(above, 1.0, -1.0)
    # Pushed further apart where they are too close, not pulled together where they are far.
    target, z = wanted.copy(), np.zeros(total)
    free = 1e-6 * csr_matrix((np.ones(total), (np.arange(total),) * 2))
    matrix = vstack([bend, _WEIGHT * apart, free]).tocsc()
    square = (matrix.T @ matrix).tocsc()
    for _ in range(_ROUNDS):
        z = spsolve(square, _WEIGHT**2 * (apart.T @ target))
        found = apart @ z * np.sign(wanted)
        if (found > 0.9 * abs(wanted)).all():
            break
        target = np.sign(wanted) * np.maximum(abs(wanted), found)
        target += wanted - np.sign(wanted) * np.minimum(found, abs(wanted))
    return [
        yarn._replace(points=np.column_stack([yarn.points[:, :2], part]))
        for yarn, part in zip(yarns, np.split(z, firsts[1:-1]), strict=True)
    ]
