"""Symbolic factorisation: in which order vertices are eliminated, and what they leave behind.

A *front* is a run of vertices that are eliminated as one dense block, and the later ones, its
*border*, that this couples. A front hands what it leaves on its border to its parent, the front of
the border's first vertex.

Source: Liu, SIAM Review 34 (1992) 82; amalgamation after Ashcraft and Grimes, ACM TOMS 15 (1989)
291.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.sparse import csgraph

from spacemap_vtk.ndarrays import Ints

#: Subtrees of up to so many vertices are one front: a dense block is quicker than many small ones.
_LEAF = 12

#: A front is merged into its parent while this share of zeros is not passed, for up to so many
#: vertices: small fronts cost calls, large ones multiplications.
_ZEROS = ((4, 0.8), (16, 0.25), (48, 0.1), (1 << 60, 0.05))


@dataclass
class Front:
    """A run of vertices that are eliminated together."""

    #: The run: first <= vertex < last.
    first: int
    last: int
    #: (b,) The later vertices that the run is coupled with, ascending.
    border: Ints
    #: Fronts whose parent this is.
    children: list[int] = field(default_factory=list)


def fronts(graph: sp.csr_matrix, order: Ints) -> tuple[list[Front], Ints]:
    """Return the fronts of an elimination."""
    parent = _tree(graph[order][:, order])
    post = _postorder(parent)
    place = np.empty_like(post)
    place[post] = np.arange(len(post))
    parent = np.where(parent[post] >= 0, place[parent[post]], -1)
    order = order[post]
    ordered = graph[order][:, order].tocsr()
    ordered.sort_indices()
    return _merged(_blocks(ordered, parent)), order


def _tree(graph: sp.csr_matrix) -> Ints:
    """Return the parent of each vertex in the elimination tree, -1 for roots."""
    starts, neighbours = graph.indptr.tolist(), graph.indices.tolist()
    parent, ancestor = [-1] * graph.shape[0], [-1] * graph.shape[0]
    for vertex in range(graph.shape[0]):
        for earlier in neighbours[starts[vertex] : starts[vertex + 1]]:
            while earlier != -1 and earlier < vertex:
                following = ancestor[earlier]
                ancestor[earlier] = vertex
                if following == -1:
                    parent[earlier] = vertex
                earlier = following
    return np.array(parent, dtype=np.int64)


def _postorder(parent: Ints) -> Ints:
    """Return the vertices with each subtree in a run, and its root last."""
    children: list[list[int]] = [[] for _ in parent]
    waiting: list[int] = []
    for vertex, above in enumerate(parent.tolist()):
        (children[above] if above >= 0 else waiting).append(vertex)
    backwards = []
    while waiting:
        vertex = waiting.pop()
        backwards.append(vertex)
        waiting += children[vertex]
    return np.array(backwards[::-1], dtype=np.int64)


def _blocks(graph: sp.csr_matrix, parent: Ints) -> list[Front]:
    """Return the fundamental fronts, small subtrees made one, with their children."""
    count = len(parent)
    size = np.ones(count, dtype=np.int64)
    above = parent.tolist()
    for vertex in range(count):
        if above[vertex] >= 0:
            size[above[vertex]] += size[vertex]
    leaf = (size <= _LEAF) & (np.append(size, _LEAF + 1)[parent] > _LEAF)
    found: list[Front] = []
    of: dict[int, list[int]] = {}  # fronts that wait for a vertex
    vertex = 0
    step = size.tolist()
    small = leaf.tolist()
    starts, neighbours = graph.indptr, graph.indices
    jump = {vertex - step[vertex] + 1: vertex for vertex in np.flatnonzero(leaf).tolist()}
    while vertex < count:
        last = jump.get(vertex, vertex)
        waiting = of.pop(last, []) if not small[last] else []
        parts = [neighbours[starts[vertex] : starts[last + 1]].astype(np.int64)]
        parts += [found[child].border for child in waiting]
        border = np.unique(np.concatenate(parts))
        border = border[np.searchsorted(border, last, side="right") :]
        only = waiting[0] if len(waiting) == 1 else -1
        if only >= 0 and only == len(found) - 1 and len(found[only].border) == len(border) + 1:
            found[only].last = last + 1
            found[only].border = border
            number = only
        else:
            found.append(Front(vertex, last + 1, border, waiting))
            number = len(found) - 1
        if len(border):
            of.setdefault(int(border[0]), []).append(number)
        vertex = last + 1
    return found


def _merged(found: list[Front]) -> list[Front]:
    """Merge fronts into their parents where that costs few zeros."""
    kept: list[Front | None] = list(found)
    for front in found:
        while front.children:
            child = front.children[-1]
            below = kept[child]
            if below is None or below.last != front.first:
                break
            wide, high = below.last - below.first, front.last - front.first
            total = wide + high
            zeros = wide * (high + len(front.border) - len(below.border))
            entries = total * (total + 1) / 2 + total * len(front.border)
            share = next(share for most, share in _ZEROS if total <= most)
            if zeros > share * entries:
                break
            front.first = below.first
            front.children = front.children[:-1] + below.children
            kept[child] = None
    numbers: dict[int, int] = {}
    result: list[Front] = []
    for number, front in enumerate(found):
        if kept[number] is not None:
            numbers[number] = len(result)
            result.append(front)
    for front in result:
        front.children = [numbers[child] for child in front.children]
    return result


#: Parts of this many vertices are not cut further.
_SMALL = 60


def dissection(graph: sp.csr_matrix) -> Ints:
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


def by_levels(graph: sp.csr_matrix) -> Ints:
    """Return such an order without METIS."""
    # A part is cut at the middle one of the levels that breadth-first search finds from a vertex at
    # its far end; what lies to either side is cut likewise.
    backwards: list[Ints] = []
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


def _levels(graph: sp.csr_matrix, start: int) -> Ints:
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
