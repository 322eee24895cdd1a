"""Nested dissection: an order of vertices in which the factors of their matrix stay sparse."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse import csgraph

IntArray = NDArray[np.int64]

#: Parts of this many vertices are not cut further.
_SMALL = 60


def dissection(graph: sp.csr_matrix) -> IntArray:
    """Return vertices in an order in which elimination fills little."""
    try:
        import pymetis
    except ImportError:  # no wheel on Windows, and none in ParaView's own Python
        return by_levels(graph)
    if graph.nnz == 0:
        return np.arange(graph.shape[0])
    starts, neighbours = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
    if hasattr(pymetis, "CSRAdjacency"):
        found = pymetis.nested_dissection(pymetis.CSRAdjacency(starts, neighbours))
    else:
        found = pymetis.nested_dissection(xadj=starts, adjncy=neighbours)
    return np.asarray(found[0], dtype=np.int64)


def by_levels(graph: sp.csr_matrix) -> IntArray:
    """Return such an order without METIS."""
    # A part is cut at the middle one of the levels that breadth-first search finds from a vertex at
    # its far end; what lies to either side is cut likewise.
    backwards: list[IntArray] = []
    waiting = [np.arange(graph.shape[0])]
    while waiting:
        part = waiting.pop()
        if len(part) <= _SMALL:
            backwards.append(part)
            continue
        inner = graph[part][:, part]
        level = _levels(inner, int(_levels(inner, 0).argmax()))
        reached = level >= 0
        if not reached.all():
            waiting += [part[reached], part[~reached]]
            continue
        middle = int(np.searchsorted(np.cumsum(np.bincount(level)), len(part) / 2))
        before, after = level < middle, level > middle
        if not before.any() or not after.any():
            backwards.append(part)
            continue
        # Of the middle level only what touches the next one separates.
        touches = (inner @ after.astype(np.int8)) > 0
        separator = (level == middle) & touches
        backwards.append(part[separator])
        waiting += [part[~separator & ~after], part[after]]
    return np.concatenate(backwards[::-1])


def _levels(graph: sp.csr_matrix, start: int) -> IntArray:
    """Return each vertex's distance from a start in steps, -1 where there is no way."""
    order, before = csgraph.breadth_first_order(graph, start, directed=False)
    level = np.full(graph.shape[0], -1)
    level[start] = 0
    # A vertex comes after its predecessor: whole levels at a time.
    first = 1
    while first < len(order):
        known = level[before[order[first:]]] >= 0
        last = first + (int(np.argmin(known)) if not known.all() else len(known))
        level[order[first:last]] = level[before[order[first:last]]] + 1
        first = last
    return level
