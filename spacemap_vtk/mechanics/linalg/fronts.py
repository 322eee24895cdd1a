"""Fronts of a sparse matrix: in which order its unknowns are eliminated, and in which blocks.

A *front* is a run of vertices that are eliminated as one dense block. The later vertices that it
couples are its *border*. A front passes the update of its border to its parent, which is the front
of the border's first vertex.

Sources: Liu, SIAM Review 34 (1992) 82; amalgamation after Ashcraft and Grimes, ACM TOMS 15 (1989)
291.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType

import numpy as np
import scipy.sparse as sp
from scipy.sparse import csgraph

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parallel import load_loops

#: Number of entries of factors, over all factorisations, from which compiled loops are loaded: a
#: search of many steps saves more time than that takes, and pictures load their compiler, too.
MANY_ENTRIES = 4_000_000

#: A subtree of at most this many vertices is one front: a dense block is faster than many small
#: ones.
_LEAF = 12

#: A front is merged into its parent if, for at most the first number of vertices, the share of
#: zeros is at most the second number. Small fronts cost calls, large ones multiplications.
_ZEROS = ((4, 0.8), (16, 0.25), (48, 0.1), (1 << 60, 0.05))


@dataclass
class Work:
    """How much has been factorised so far, which decides when compiled loops are loaded."""

    #: Number of entries of all factors so far.
    entries: int = 0

    def count(self, entries: int) -> ModuleType | None:
        """Count one more factorisation; return the compiled loops if there were enough of them."""
        # At the same number in every run, so that a repeated run gives the same bits.
        self.entries += entries
        return load_loops("spacemap_vtk.mechanics.linalg.front_loops", self.entries > MANY_ENTRIES)


class Analysis:
    """Fronts of a sparse symmetric pattern."""

    def __init__(self, matrix: sp.csr_matrix, vertices: Ints, work: Work | None = None) -> None:
        node = np.unique(vertices, return_inverse=True)[1].ravel()
        count = int(node.max()) + 1
        pairs = matrix.tocoo()
        row, column = node[pairs.row], node[pairs.col]
        apart = row != column
        graph = sp.csr_matrix(
            (np.ones(int(apart.sum()), np.int32), (row[apart], column[apart])), shape=(count, count)
        )
        found, order = find_fronts(graph, nested_dissection(graph))
        place = np.empty(count, np.int64)
        place[order] = np.arange(count)
        #: Rows in the order of elimination.
        self.order = np.argsort(place[node], kind="stable")
        start = np.concatenate([[0], np.cumsum(np.bincount(place[node], minlength=count))])
        #: First row and end of each front; the rows of its border; and its children.
        self.runs = [(int(start[f.first]), int(start[f.last])) for f in found]
        self.borders = [_list_ranges(start[f.border], start[f.border + 1]) for f in found]
        self.children = [f.children for f in found]
        #: Patterns that were ordered last, and the positions of their entries in that order.
        self._ordered: dict[bool, tuple[Ints, Ints, sp.csc_matrix]] = {}
        #: Pattern of the lower triangle that was assembled last, and the places of its entries.
        self._places: tuple[sp.csc_matrix, Ints] | None = None
        #: Whether factors fitted into memory before; checking the free memory takes milliseconds.
        self.fits_in_memory = False
        #: Factorisations so far; a repeated analysis counts together with this one.
        self.past_work = work or Work()

    @cached_property
    def entries(self) -> int:
        """Number of entries of the factors."""
        return sum(
            (last - first) * (last - first + len(border))
            for (first, last), border in zip(self.runs, self.borders, strict=True)
        )

    @cached_property
    def work(self) -> Floats:
        """Multiplications up to the end of each front, as a share of the total."""
        sizes = [(b - a, len(c)) for (a, b), c in zip(self.runs, self.borders, strict=True)]
        done = np.cumsum([w * (w * w / 3 + w * h + h * h) for w, h in sizes])
        return done / done[-1]

    def reorder(self, matrix: sp.csr_matrix, lower: bool = False) -> sp.csc_matrix:
        """Put a matrix, or its lower triangle, into the order of elimination."""
        # Time steps and searches order one pattern a thousand times. Without keeping the positions
        # of its entries, this took as long as the elimination.
        if not matrix.has_canonical_format:
            matrix = matrix.copy()
            matrix.sum_duplicates()
        kept = self._ordered.get(lower)
        if kept is None or not (
            np.array_equal(kept[0], matrix.indptr) and np.array_equal(kept[1], matrix.indices)
        ):
            numbers = np.arange(1, matrix.nnz + 1)
            made = sp.csr_matrix((numbers, matrix.indices, matrix.indptr), shape=matrix.shape)
            made = made[self.order][:, self.order]
            made = sp.tril(made, format="csc") if lower else made.tocsc()
            made.data -= 1
            kept = self._ordered[lower] = matrix.indptr, matrix.indices, made
        entries = kept[2]
        values = matrix.data[entries.data]
        return sp.csc_matrix((values, entries.indices, entries.indptr), shape=matrix.shape)

    def repeat(self, count: int) -> Analysis:
        """Replace each row by `count` neighbours, whose numbers lie a whole matrix apart."""
        made = copy(self)
        for name in ("entries", "work", "_parent_places"):
            made.__dict__.pop(name, None)
        rows = np.arange(count)
        made.order = (self.order[:, None] + rows * len(self.order)).ravel()
        made.runs = [(count * first, count * last) for first, last in self.runs]
        made.borders = [(count * border[:, None] + rows).ravel() for border in self.borders]
        made._ordered, made._places, made.fits_in_memory = {}, None, False
        return made

    def assemble_fronts(
        self, matrix: sp.csr_matrix, left: list[Floats | None]
    ) -> Iterator[tuple[int, Floats, Floats, Floats]]:
        """Yield each front of a symmetric matrix, with the updates of its children added."""
        # Only the lower triangles of blocks are filled.
        lower = self.reorder(matrix, lower=True)
        places, starts, values = self._find_places(), lower.indptr.tolist(), lower.data
        loops = self.past_work.count(self.entries)
        add = _add_triangle if loops is None else loops.add_triangle
        for number, ((first, last), border) in enumerate(zip(self.runs, self.borders, strict=True)):
            wide, high = last - first, len(border)
            block, part = np.zeros(wide * (wide + high)), slice(starts[first], starts[last])
            block[places[part]] = values[part]
            pivot = block[: wide * wide].reshape(wide, wide, order="F")
            side = block[wide * wide :].reshape(high, wide, order="F")
            rest = np.zeros((high, high), order="F")
            for child in self.children[number]:
                update, left[child] = left[child], None
                assert update is not None
                at, cut = self._parent_places[child]
                add(update.T, at, cut, pivot.T, side.T, rest.T)
            yield number, pivot, side, rest

    def _find_places(self) -> Ints:
        """Find where each entry of the lower triangle lies in its front: pivots, then the side."""
        lower = self._ordered[True][2]
        if self._places is None or self._places[0] is not lower:
            first, last = np.array(self.runs).T
            wide, high = last - first, np.array([len(border) for border in self.borders])
            column = np.repeat(np.arange(lower.shape[0]), np.diff(lower.indptr))
            front = np.repeat(np.arange(len(wide)), lower.indptr[last] - lower.indptr[first])
            # Row of each entry in the border of its front: all borders are searched at once, by
            # keys that number front and row.
            fronts = np.repeat(np.arange(len(high)), high)
            keys = fronts * lower.shape[0] + np.concatenate(self.borders)
            row = np.searchsorted(keys, front * lower.shape[0] + lower.indices)
            row -= (np.cumsum(high) - high)[front]
            column -= first[front]
            inside = lower.indices < last[front]
            pivots = column * wide[front] + lower.indices - first[front]
            below = wide[front] ** 2 + column * high[front] + row
            self._places = lower, np.where(inside, pivots, below)
        return self._places[1]

    @cached_property
    def _parent_places(self) -> list[tuple[Ints, int]]:
        """Places of each front's border in its parent's run, up to a number, or in its border."""
        found = [(border, 0) for border in self.borders]
        for (first, last), border, children in zip(
            self.runs, self.borders, self.children, strict=True
        ):
            for child in children:
                cut = int(np.searchsorted(self.borders[child], last))
                inner, outer = np.split(self.borders[child], [cut])
                found[child] = np.append(inner - first, np.searchsorted(border, outer)), cut
        return found


def _add_triangle(
    update: Floats, at: Ints, cut: int, pivot: Floats, side: Floats, rest: Floats
) -> None:
    """Do what `front_loops.add_triangle` does; add the upper triangles as well."""
    _add_at(pivot, at[:cut], at[:cut], update[:cut, :cut])
    _add_at(side, at[:cut], at[cut:], update[:cut, cut:])
    _add_at(rest, at[cut:], at[cut:], update[cut:, cut:])


def _add_at(block: Floats, rows: Ints, columns: Ints, values: Floats) -> None:
    """Add values at the crossings of rows and columns, by slices if both are contiguous."""
    if len(rows) == 0 or len(columns) == 0:
        return
    if rows[-1] - rows[0] == len(rows) - 1 and columns[-1] - columns[0] == len(columns) - 1:
        block[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += values
    else:
        block[rows[:, None], columns] += values


def _list_ranges(starts: Ints, ends: Ints) -> Ints:
    """List the numbers from each start up to its end, in one array."""
    sizes = ends - starts
    return np.repeat(ends - np.cumsum(sizes), sizes) + np.arange(sizes.sum())


@dataclass
class Front:
    """Run of vertices that are eliminated together."""

    #: The run consists of the vertices with first <= vertex < last.
    first: int
    last: int
    #: (b,) Later vertices that the run is coupled with, ascending.
    border: Ints
    #: Numbers of the fronts whose parent this is.
    children: list[int] = field(default_factory=list)


def find_fronts(graph: sp.csr_matrix, order: Ints) -> tuple[list[Front], Ints]:
    """Compute the fronts of an elimination, and its final order."""
    parent = _elimination_tree(graph[order][:, order])
    post = _postorder(parent)
    place = np.empty_like(post)
    place[post] = np.arange(len(post))
    parent = np.where(parent[post] >= 0, place[parent[post]], -1)
    order = order[post]
    ordered = graph[order][:, order].tocsr()
    ordered.sort_indices()
    return _merge_fronts(_fundamental_fronts(ordered, parent)), order


def _elimination_tree(graph: sp.csr_matrix) -> Ints:
    """Compute the parent of each vertex in the elimination tree, -1 for roots."""
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
    """Order the vertices so that each subtree is contiguous, with its root last."""
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


def _fundamental_fronts(graph: sp.csr_matrix, parent: Ints) -> list[Front]:
    """Find the fundamental fronts and their children; each small subtree becomes one front."""
    count = len(parent)
    size = np.ones(count, dtype=np.int64)
    above = parent.tolist()
    for vertex in range(count):
        if above[vertex] >= 0:
            size[above[vertex]] += size[vertex]
    leaf = (size <= _LEAF) & (np.append(size, _LEAF + 1)[parent] > _LEAF)
    found: list[Front] = []
    of: dict[int, list[int]] = {}  # fronts whose border starts at a vertex
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


def _merge_fronts(found: list[Front]) -> list[Front]:
    """Merge fronts into their parents if that adds few zeros."""
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


#: Parts of at most this many vertices are not cut further.
_MIN_CUT = 60


def nested_dissection(graph: sp.csr_matrix) -> Ints:
    """Order vertices so that elimination causes little fill."""
    try:
        import pymetis
    except ImportError:  # there is no wheel for Windows, and none for ParaView's Python
        return dissect_by_levels(graph)
    if graph.nnz == 0:
        return np.arange(graph.shape[0])
    starts, neighbours = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
    if hasattr(pymetis, "CSRAdjacency"):
        found = pymetis.nested_dissection(pymetis.CSRAdjacency(starts, neighbours))
    else:
        found = pymetis.nested_dissection(xadj=starts, adjncy=neighbours)
    return np.asarray(found[0], dtype=np.int64)


def dissect_by_levels(graph: sp.csr_matrix) -> Ints:
    """Order vertices by nested dissection without METIS."""
    # A part is cut at the middle level of a breadth-first search that starts at its far end. Both
    # sides are cut in the same way.
    backwards: list[Ints] = []
    waiting = [np.arange(graph.shape[0])]
    while waiting:
        part = waiting.pop()
        if len(part) <= _MIN_CUT:
            backwards.append(part)
            continue
        inner = graph[part][:, part]
        level = _distances(inner, int(_distances(inner, 0).argmax()))
        reached = level >= 0
        if not reached.all():
            waiting += [part[reached], part[~reached]]
            continue
        middle = int(np.searchsorted(np.cumsum(np.bincount(level)), len(part) / 2))
        before, after = level < middle, level > middle
        if not before.any() or not after.any():
            backwards.append(part)
            continue
        # Of the middle level, only vertices that touch the next level separate the two sides.
        touches = (inner @ after.astype(np.int8)) > 0
        separator = (level == middle) & touches
        backwards.append(part[separator])
        waiting += [part[~separator & ~after], part[after]]
    return np.concatenate(backwards[::-1])


def _distances(graph: sp.csr_matrix, start: int) -> Ints:
    """Compute each vertex's distance from a start in steps, -1 if it cannot be reached."""
    order, before = csgraph.breadth_first_order(graph, start, directed=False)
    level = np.full(graph.shape[0], -1)
    level[start] = 0
    # A vertex follows its predecessor in the order, so whole levels are computed at a time.
    first = 1
    while first < len(order):
        known = level[before[order[first:]]] >= 0
        last = first + (int(np.argmin(known)) if not known.all() else len(known))
        level[order[first:last]] = level[before[order[first:last]]] + 1
        first = last
    return level
