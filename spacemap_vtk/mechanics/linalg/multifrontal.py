"""Multifrontal Cholesky factorisation in numpy, and the inertia of an indefinite matrix.

Why not SuperLU, which scipy brings: it stores both triangles, factorises a cube of 95,000 rows in
11 s, and gives the signs of its pivots only with a copy of everything. For a symmetric matrix in
nested-dissection order, dense LAPACK on fronts is better. It stores one triangle, is several times
as fast, solves for many right-hand sides at once, and finds the inertia without keeping factors.

A *front* is a run of vertices that are eliminated as one dense block. The later vertices that it
couples are its *border*. A front passes the update of its border to its parent, which is the front
of the border's first vertex.

Sources: Duff and Reid, ACM TOMS 9 (1983) 302; Liu, SIAM Review 34 (1992) 82; amalgamation after
Ashcraft and Grimes, ACM TOMS 15 (1989) 291.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack
from scipy.sparse import csgraph

from spacemap_vtk import cancel
from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Floats, Ints, Progress

#: Number of columns that are eliminated at once when eigenvalues are counted. Most fronts have
#: fewer, and several times a second the progress is reported and the work can be stopped.
PANEL = 384

#: A subtree of at most this many vertices is one front: a dense block is faster than many small
#: ones.
_LEAF = 12

#: A front is merged into its parent if, for at most the first number of vertices, the share of
#: zeros is at most the second number. Small fronts cost calls, large ones multiplications.
_ZEROS = ((4, 0.8), (16, 0.25), (48, 0.1), (1 << 60, 0.05))


class Analysis:
    """Fronts of a sparse symmetric pattern."""

    def __init__(self, matrix: sp.csr_matrix, vertices: Ints) -> None:
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

    @property
    def entries(self) -> int:
        """Number of entries of the factors."""
        return sum(
            (last - first) * (last - first + len(border))
            for (first, last), border in zip(self.runs, self.borders, strict=True)
        )

    @property
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

    def assemble_fronts(
        self, matrix: sp.csr_matrix, left: list[Floats | None]
    ) -> Iterator[tuple[int, Floats, Floats, Floats]]:
        """Yield each front, with the updates of its children added."""
        lower = self.reorder(matrix, lower=True)
        starts, rows, values = lower.indptr, lower.indices, lower.data
        place = np.empty(matrix.shape[0], np.int64)
        for number, ((first, last), border) in enumerate(zip(self.runs, self.borders, strict=True)):
            wide, high = last - first, len(border)
            pivot = np.zeros((wide, wide), order="F")
            side = np.zeros((high, wide), order="F")
            rest = np.zeros((high, high), order="F")
            place[first:last] = np.arange(wide)
            place[border] = np.arange(high)
            part = slice(starts[first], starts[last])
            row = rows[part]
            column = np.repeat(np.arange(wide), np.diff(starts[first : last + 1]))
            inner = row < last
            pivot[place[row[inner]], column[inner]] = values[part][inner]
            side[place[row[~inner]], column[~inner]] = values[part][~inner]
            for child in self.children[number]:
                update, left[child] = left[child], None
                where = self.borders[child]
                cut = int(np.searchsorted(where, last))
                at = place[where]
                assert update is not None
                _add_at(pivot, at[:cut], at[:cut], update[:cut, :cut])
                _add_at(side, at[cut:], at[:cut], update[cut:, :cut])
                _add_at(rest, at[cut:], at[cut:], update[cut:, cut:])
            yield number, pivot, side, rest


class Cholesky:
    """Factors of a sparse, symmetric, positive definite matrix."""

    def __init__(
        self, matrix: sp.csr_matrix, analysis: Analysis, progress: Progress | None = None
    ) -> None:
        require_memory(
            14 * analysis.entries,
            f"factorising {matrix.shape[0]} degrees of freedom",
            cure="Use a coarser cage.",
        )
        self._analysis = analysis
        self._fundamental_fronts: list[tuple[Floats, Floats]] = []
        left: list[Floats | None] = [None] * len(analysis.runs)
        share = analysis.work
        for number, pivot, side, rest in analysis.assemble_fronts(matrix, left):
            triangle, failed = lapack.dpotrf(pivot, lower=1, clean=1, overwrite_a=1)
            if failed:
                raise SolverError(
                    "the stiffness matrix cannot be factorised: it is not positive definite",
                    cure="Look for badly shaped tetrahedra in the cage",
                )
            if len(side):
                with blas_threads.use_threads_for(side.size * len(side)):
                    side = blas.dtrsm(1, triangle, side, side=1, lower=1, trans_a=1, overwrite_b=1)
                    left[number] = blas.dsyrk(-1.0, side, beta=1.0, c=rest, lower=1, overwrite_c=1)
            self._fundamental_fronts.append((triangle, side))
            if progress is not None:
                progress(float(share[number]))

    def solve(self, right: Floats) -> Floats:
        """Solve for many right-hand sides at once."""
        cancel.check()
        analysis = self._analysis
        x = np.ascontiguousarray(right[analysis.order])
        for (first, last), border, (triangle, side) in zip(
            analysis.runs, analysis.borders, self._fundamental_fronts, strict=True
        ):
            mine = _solve_triangle(triangle, x[first:last], 1)
            x[first:last] = mine
            if len(border):
                x[border] -= _multiply(side, mine)
        for (first, last), border, (triangle, side) in zip(
            reversed(analysis.runs),
            reversed(analysis.borders),
            reversed(self._fundamental_fronts),
            strict=True,
        ):
            mine = x[first:last]
            if len(border):
                mine = mine - _multiply(side, x[border], 1)
            x[first:last] = _solve_triangle(triangle, mine, 0)
        solution = np.empty_like(x)
        solution[analysis.order] = x
        return solution


def count_negative_eigenvalues(
    matrix: sp.csr_matrix, analysis: Analysis, progress: Progress | None = None
) -> int:
    """Count the negative eigenvalues of a sparse symmetric matrix."""
    # By Sylvester's law of inertia their number is that of the negative pivots, for any congruence.
    # Bunch and Kaufman's pivoting is confined to a panel of a front; no factors are kept.
    left: list[Floats | None] = [None] * len(analysis.runs)
    count, share = 0, np.append(0.0, analysis.work)
    for number, pivot, side, rest in analysis.assemble_fronts(matrix, left):
        before, after = share[number : number + 2]
        for first in range(0, len(pivot), PANEL):
            count += _eliminate_panel(pivot[first:, first:], side[:, first:], rest)
            if progress is not None:
                done = min(1.0, (first + PANEL) / len(pivot))
                progress(float(before + done * (after - before)))
        left[number] = rest
    return count


def _eliminate_panel(pivot: Floats, side: Floats, rest: Floats) -> int:
    """Eliminate the first panel of a front in place, and count its negative eigenvalues."""
    size, whole = min(PANEL, len(pivot)), len(pivot) <= PANEL
    below = side if whole else np.concatenate([pivot[size:, :size], side[:, :size]])
    factors, swaps, solved, failed = lapack.dsysv(
        pivot[:size, :size], below.T if len(below) else np.zeros((size, 1)), lower=1
    )
    if failed:
        raise SolverError("the eigenvalues cannot be counted at this shift")
    inside = len(pivot) - size
    for first in range(0, inside, PANEL):
        strip = slice(first, min(first + PANEL, inside))
        with blas_threads.use_threads_for(below[first:].size * PANEL):
            change = _multiply(below[first:], solved[:, strip])
        pivot[size + first :, size:][:, strip] -= change[: inside - first]
        side[:, size:][:, strip] -= change[inside - first :]
    if len(side):
        with blas_threads.use_threads_for(below[inside:].size * len(side)):
            blas.dgemm(-1.0, below[inside:], solved[:, inside:], beta=1.0, c=rest, overwrite_c=1)
    # A pivot block of two rows has one eigenvalue of each sign; otherwise it is not chosen.
    single = swaps >= 0
    return int((factors.diagonal()[single] < 0).sum()) + int((~single).sum()) // 2


def _multiply(block: Floats, right: Floats, transposed: int = 0) -> Floats:
    """Compute A b, or Aᵀ b; for a large block in half the time of NumPy's product."""
    return blas.dgemm(1.0, block, right, trans_a=transposed)


def _solve_triangle(triangle: Floats, right: Floats, transposed: int) -> Floats:
    """Compute L⁻¹ b, or L⁻ᵀ b, from the transpose of b, which is in LAPACK's order."""
    return blas.dtrsm(1.0, triangle, right.T, side=1, lower=1, trans_a=transposed).T


def _add_at(block: Floats, rows: Ints, columns: Ints, values: Floats) -> None:
    """Add values at the crossings of rows and columns, by slices if both are contiguous."""
    if len(rows) == 0 or len(columns) == 0:
        return
    if rows[-1] - rows[0] == len(rows) - 1 and columns[-1] - columns[0] == len(columns) - 1:
        block[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += values
    else:
        # Transposed, so that memory is accessed contiguously.
        block.T[columns[:, None], rows] += values.T


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
