"""Least clearance between yarns.

Yarns along arcs touch where they cross, and overlap nowhere (see
`spacemap_vtk.textile.geometry.arcs`); `find_contact` returns such a place. Yarns along splines, and
deformed ones, are measured. The measurement does not use how the axes were laid, so tests apply it
to arcs too.

A flattened yarn is the union of round tubes whose axes lie on its flat, between the two at its
round sides. A circle is one such tube. An ellipse is replaced by the racetrack of equal size, which
contains it. A lens is measured by its support function, whose direction is searched. Trees find the
nearest points among samples of these axes, and the result is refined on the axes themselves. There
is no loop over pairs of yarns: two different numbers differ in some binary digit, so for each digit
samples of yarns with a 1 are searched among those with a 0. The cost is n log(n) log(yarns) for n
samples.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk import cancel
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parallel import blocks
from spacemap_vtk.textile.geometry.cloth_axes import cloth_axes
from spacemap_vtk.textile.geometry.weave import Weave
from spacemap_vtk.textile.patches.bezier import bernstein
from spacemap_vtk.textile.weave.cloth import Cloth

_Result = TypeVar("_Result")

#: Start points of the search on each part of an axis.
_SAMPLES = 4
#: Largest number of places to refine: the worst local minima among the samples.
_MOST = 20_000
#: Number of samples and pairs in one block.
_BLOCK = 2**17
#: Number of reductions of the step between samples: the square of the last step is below rounding.
_REFINEMENTS = 26
#: Share of the places that is refined further after each reduction. A reduction leaves about a
#: third of what a clearance can still lose, so the order of the places settles before many of them
#: are left out.
_KEPT_SHARE = 0.75
#: Up to this number of places, all are refined.
_FEW = 200
#: Steps of the first search for the direction between deformed sections.
_TURNS = 16
_MOVES = np.stack(np.meshgrid([0, -1, 1], [0, -1, 1], indexing="ij"), axis=-1).reshape(-1, 2)


class Clearance(NamedTuple):
    """The place where two yarns are closest to each other."""

    distance: float
    """Distance between their surfaces, in m; negative by the depth of an overlap."""
    yarns: tuple[int, int]
    """Numbers of the yarns; ends are numbered first, then picks."""
    place: Floats
    """(3,) Point between their surfaces, in m."""


class _Tubes(NamedTuple):
    """Yarns as tubes; parts are numbered through all yarns."""

    parts: Ints
    """(yarns,) Number of parts."""
    radius: Floats
    """(yarns,) Approximate radius."""
    flat: Bools
    """(yarns,) Whether the section is flattened."""
    lens: Floats
    """(yarns,) Aspect of a lenticular section; 1 for others."""
    warp_count: int
    """Number of ends."""
    perpendicular: bool
    """Whether sections are round, except for their flat, and perpendicular to the axis."""
    at: Callable[[Ints, Floats], tuple[Floats, Floats, Floats, Floats]]
    """Axis, normal and lateral radius, and half the flat, (n, 3) each, at fractions of parts."""


def find_contact(cloth: Cloth) -> Clearance:
    """Find the place where the first two crossing yarns of a cloth of arcs touch.

    Parameters
    ----------
    cloth : Cloth
        With axes by arcs; in a double weave the place is in one of its cloths.

    Returns
    -------
    Clearance
        The distance is 0: nowhere are yarns closer. Ellipses touch there too.

    Raises
    ------
    InputError
        There is no room for the yarns, or one measure contradicts another.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> find_contact(cloth).yarns, find_contact(cloth).place.round(9).tolist()
    ((0, 2), [-0.1, -0.1, 0.0])
    """
    cloth.check()
    pick, end = 0, 0
    if cloth.layers is not None:
        pick, end = np.argwhere(cloth.layers.same_cloth)[0].tolist()
    one = slice(end, end + 1)
    height = float(cloth.crossing_profile(0, one).height[0, pick])
    radius = 0.5 * float(cloth.yarns[0].diameter[end])
    place = [
        cloth.yarns[0].position[end],
        cloth.yarns[1].position[pick],
        height - radius if cloth.drawdown[pick, end] else height + radius,
    ]
    return Clearance(0.0, (end, cloth.size[0] + pick), np.array(place))


def least_clearance(cloth: Cloth) -> Clearance:
    """Run `measure_in_steps` to its end."""
    return _run_to_end(measure_in_steps(cloth))


def measure_in_steps(cloth: Cloth) -> Generator[None, None, Clearance]:
    """Measure the least clearance between the yarns of a cloth at rest, from its exact axes.

    Parameters
    ----------
    cloth : Cloth
        At rest.

    Returns
    -------
    Clearance
        0 up to rounding for cloth of arcs with any section, because yarns touch at their crossings.
        For ellipses it is a lower bound, which they reach at the crossings.

    Yields
    ------
    None
        At intervals, so that the caller can do something else or cancel.

    Raises
    ------
    InputError
        One measure of the cloth contradicts another.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> found = least_clearance(Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads))
    >>> abs(found.distance) < 1e-16, found.yarns[0] < 2 <= found.yarns[1]
    (True, True)
    """
    return _search_least(_tubes_at_rest(cloth))


def measure_clearance(weave: Weave, points: ArrayLike | None = None) -> Clearance:
    """Measure the least clearance between yarns from their control points, moved or not.

    Parameters
    ----------
    weave : Weave
        Patches as built.
    points : (N, 3) array_like, optional
        Control points after a deformation, in m; by default those before. Extra rows are ignored.

    Returns
    -------
    Clearance
        Exact for undeformed rational cloth; for other cloth the error is up to
        ``weave.radial_error`` of the radii. After a deformation, sections are the ellipses (and
        racetracks) defined by the half diameters of their rings. For a section that is no longer
        convex, the clearance is that of its convex hull.

    Raises
    ------
    GeometryError
        There are too few points, or some are not finite.

    Examples
    --------
    >>> from spacemap_vtk.textile.geometry.weave import build_weave
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> found = measure_clearance(build_weave(cloth))
    >>> abs(found.distance) < 0.1 * 1e-4
    True
    """
    table = np.asarray(weave.points if points is None else points, dtype=np.float64)
    count = len(weave.points)
    if table.ndim != 2 or table.shape[1] != 3 or len(table) < count:
        raise GeometryError(f"the control points have shape {table.shape}", allowed=f"({count}, 3)")
    nets = [_ring_net(table, weave, number) for number in (0, 1)]
    if not all(np.isfinite(net).all() for net in nets):
        raise GeometryError(
            "some control points are not finite numbers",
            cure="Check the stages before: an inverted cage or a solver may have made them",
        )
    rows = [
        3 * np.arange(tubes.parts.sum()) + np.repeat(np.arange(len(tubes.parts)), tubes.parts)
        for tubes in weave.tubes
    ]
    first_ring = np.concatenate([rows[0], len(nets[0]) + rows[1]])
    net = np.concatenate(nets)

    def evaluate(part: Ints, fraction: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        basis = bernstein(3, fraction)
        local = net[first_ring[part][:, None] + np.arange(4)]
        value = np.einsum("ni,nik->nk", basis, local)
        value /= value[:, -1:]
        return value[:, 0:3], value[:, 3:6], value[:, 6:9], value[:, 9:12]

    lens = [t.lens_aspect for t in weave.tubes]
    counts = [len(t.parts) for t in weave.tubes]
    radius = [
        np.linalg.norm(n[:, 3:6], axis=1)[np.cumsum(3 * t.parts + 1) - 1] / n[0, -1]
        for n, t in zip(nets, weave.tubes, strict=True)
    ]
    return _run_to_end(
        _search_least(
            _Tubes(
                np.concatenate([tubes.parts for tubes in weave.tubes]),
                np.concatenate(radius),
                np.repeat([t.aspect > 1.0 and t.lens_aspect == 1.0 for t in weave.tubes], counts),
                np.repeat(lens, counts),
                counts[0],
                points is None and max(lens) == 1.0,
                evaluate,
            )
        )
    )


def _run_to_end(steps: Generator[None, None, _Result]) -> _Result:
    while True:
        cancel.check()
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def _tubes_at_rest(cloth: Cloth) -> _Tubes:
    families = cloth_axes(cloth)
    flats = [threads.flat_aspect for threads in cloth.threads]
    lenses = [t.aspect if t.shape == "lenticular" else 1.0 for t in cloth.threads]
    first = len(families[0].length)
    owners = [family.owner for family in families]

    def evaluate(part: Ints, fraction: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        point, normal, lateral, half = np.zeros((4, len(part), 3))
        for number, family in enumerate(families):
            mine = (part >= first) == bool(number)
            own = part[mine] - first * number
            yarn = owners[number][own]
            along, height, angle = family.evaluate(own, own + yarn, fraction[mine])
            radius = family.radius[yarn]
            point[mine, 1 - number], point[mine, 2] = along, height
            point[mine, number] = family.lateral[yarn]
            normal[mine, 1 - number] = -radius * np.sin(angle)
            normal[mine, 2] = radius * np.cos(angle)
            lateral[mine, number] = lenses[number] * radius
            half[mine, number] = (flats[number] - 1.0) * radius
        return point, normal, lateral, half

    counts = [len(family.parts) for family in families]
    return _Tubes(
        np.concatenate([family.parts for family in families]),
        np.concatenate([family.radius for family in families]),
        np.repeat(np.array(flats) > 1.0, counts),
        np.repeat(lenses, counts),
        counts[0],
        max(lenses) == 1.0,
        evaluate,
    )


def _ring_net(points: Floats, weave: Weave, number: int) -> Floats:
    """Compute centre, normal and lateral radius, half flat and 1 of each ring, times the weight."""
    tubes = weave.tubes[number]
    size = tubes.ring
    count = 3 * int(tubes.parts.sum()) + len(tubes.parts)
    here = slice(tubes.first, tubes.first + count * size)
    ring = points[here].reshape(count, size, 3)
    net = np.empty((count, 13))
    net[:, 12] = 1.0
    if tubes.lens_aspect > 1.0:
        # A lens has swollen away from the yarns that it touches, so its own section is measured.
        net[:, 0:3], net[:, 3:6], net[:, 6:9] = tubes.lens_frames(ring)
        net[:, 9:12] = 0.0
        return net if weave.weights is None else net * weave.weights[here][::size, None]
    left, right = ring[:, size // 2 + 3], ring[:, 3]
    # A racetrack has two points on top, at both ends of its flat; a circle has one.
    top, bottom = (
        0.5 * (ring[:, 0] + ring[:, size - 3 if size > 12 else 0]),
        0.5 * (ring[:, 6] + ring[:, size // 2 if size > 12 else 6]),
    )
    half = 0.5 * (right - left)
    net[:, 0:3] = 0.25 * (left + right + top + bottom)
    net[:, 3:6] = 0.5 * (top - bottom)
    net[:, 6:9] = half / tubes.aspect
    net[:, 9:12] = half * (1.0 - 1.0 / tubes.aspect)
    if weave.weights is not None:
        net *= weave.weights[here].reshape(count, size)[:, :1]
    return net


def _search_least(tubes: _Tubes) -> Generator[None, None, Clearance]:
    total = int(tubes.parts.sum())
    owner = np.repeat(np.arange(len(tubes.parts)), tubes.parts)
    ends = np.stack([np.cumsum(tubes.parts) - tubes.parts, np.cumsum(tubes.parts)])
    # A place is a number: the part, and the fraction after the decimal point.
    count = np.full(total, _SAMPLES)
    count[ends[1] - 1] += 1
    part = np.repeat(np.arange(total), count)
    step = np.arange(len(part)) - (np.cumsum(count) - count)[part]
    lines = (-1.0, 0.0, 1.0) if tubes.flat.any() else (0.0,)
    place = np.tile(part + step / _SAMPLES, len(lines))
    side = np.repeat(lines, len(part))
    yarn = np.tile(owner[part], len(lines))
    keep = tubes.flat[yarn] | (side == 0.0)
    place, side, yarn = place[keep], side[keep], yarn[keep]

    def evaluate_places(place: Floats, yarn: Ints) -> tuple[Floats, ...]:
        within = np.minimum(place.astype(np.int64), ends[1, yarn] - 1)
        return tubes.at(within, place - within)

    def move_to_side(found: tuple[Floats, ...], side: Floats) -> tuple[Floats, ...]:
        point, normal, lateral, half = found
        return point + side[:, None] * half, normal, lateral

    located = np.empty((3, len(place), 3))
    for block in blocks(len(place), _BLOCK):
        yield
        located[:, block] = move_to_side(evaluate_places(place[block], yarn[block]), side[block])
    turns = 0 if tubes.perpendicular else _TURNS
    most = _MOST if tubes.perpendicular else _MOST // 4
    # Work in blocks and keep only the worst: all pairs at once would take most of the memory.
    kept = np.empty((2, 0), dtype=np.int64), np.empty(0), np.empty((0, 3))
    # The nearest axis is that of a crossing yarn, though the nearest edge of a wide lens may be a
    # neighbour's. So neighbours are also searched by themselves.
    groups = [np.arange(len(yarn))]
    if (tubes.lens > 1.0).any():
        groups += [np.flatnonzero((yarn < tubes.warp_count) == warp) for warp in (True, False)]
    for pairs in (
        some[pairs]
        for some in groups
        for pairs in _nearest_pairs(located[0, some], tubes.radius[yarn[some]], yarn[some])
    ):
        yield
        one, other = (tuple(x[mine] for x in located) for mine in pairs)
        gap, _, facing = _section_gap(one, other, tubes.lens[yarn[pairs]], None, turns)
        found = _local_minima(pairs, gap, facing, yarn)
        worst = np.argsort(np.concatenate([kept[1], found[1]]), kind="stable")[:most]
        kept = (
            np.concatenate([kept[0], found[0]], axis=1)[:, worst],
            np.concatenate([kept[1], found[1]])[worst],
            np.concatenate([kept[2], found[2]])[worst],
        )
    (a, b), _, facing = kept
    # Refine both places and both sides by the best of nine moves, with ever smaller steps.
    own = np.stack([yarn[a], yarn[b]])
    moved = np.stack([place[a], place[b]])
    sides = np.stack([side[a], side[b]])
    low, high = ends[0, own], ends[1, own]

    def evaluate_both(moved: Floats) -> list[tuple[Floats, ...]]:
        return [evaluate_places(place, yarn) for place, yarn in zip(moved, own, strict=True)]

    def measure_gap(
        found: list[tuple[Floats, ...]], sides: Floats, few: int
    ) -> tuple[Floats, Floats, Floats]:
        first, second = map(move_to_side, found, sides)
        return _section_gap(first, second, tubes.lens[own], facing if few else None, few)

    best, middle, _ = measure_gap(evaluate_both(moved), sides, turns)
    flattened = bool(tubes.flat[own].any())
    width = 1.0 / _SAMPLES
    for _ in range(_REFINEMENTS):
        for along in (True, False) if flattened else (True,):
            # Each place moves forwards, backwards or not at all: three places of a yarn, not nine.
            reached = [np.clip(moved + width * way, low, high) for way in (0, 1, -1)]
            stood = (
                [evaluate_both(places) for places in reached] if along else [evaluate_both(moved)]
            )
            origin = sides
            for move in _MOVES[1:]:
                yield
                if along:
                    trial = np.stack([reached[way][k] for k, way in enumerate(move)])
                    here = [stood[way][k] for k, way in enumerate(move)]
                    gap, spot, turned = measure_gap(here, sides, turns // 4)
                else:
                    trial = np.clip(origin + width * move[:, None], -1.0, 1.0)
                    trial = np.where(tubes.flat[own], trial, 0.0)
                    gap, spot, turned = measure_gap(stood[0], trial, turns // 4)
                better = gap < best
                best, middle = np.where(better, gap, best), np.where(better[:, None], spot, middle)
                facing = np.where(better[:, None], turned, facing)
                if along:
                    moved = np.where(better, trial, moved)
                else:
                    sides = np.where(better, trial, sides)
        width *= 0.6
        if tubes.perpendicular and len(best) > _FEW:
            kept_rows = np.argsort(best, kind="stable")[: max(_FEW, int(_KEPT_SHARE * len(best)))]
            best, middle, facing = best[kept_rows], middle[kept_rows], facing[kept_rows]
            own, moved, sides = own[:, kept_rows], moved[:, kept_rows], sides[:, kept_rows]
            low, high = low[:, kept_rows], high[:, kept_rows]
    if turns:
        # The direction may not have followed every move, so it is searched again with more steps.
        best, middle, _ = measure_gap(evaluate_both(moved), sides, 4 * turns)
    least = int(np.argmin(best))
    first, second = sorted((int(own[0, least]), int(own[1, least])))
    return Clearance(float(best[least]), (first, second), middle[least])


def _nearest_pairs(points: Floats, radius: Floats, yarn: Ints) -> Iterator[Ints]:
    """Yield pairs of samples of different yarns, (2, n); the closest pair of all is among them."""
    # Distances count from surfaces, not from axes: in a fourth dimension thin yarns are further
    # away.
    from scipy.spatial import cKDTree  # imported here: it takes a tenth of a second

    # With |p - q|**2 - (r + r_q)**2, r the mean radius, a thick yarn is closer by its thickness.
    reach = (radius.mean() + radius) ** 2
    lifted = np.column_stack([points, np.sqrt(reach.max() - reach)])
    level = np.column_stack([points, np.zeros(len(points))])
    for digit in range(int(yarn.max()).bit_length()):
        one = (yarn >> digit) & 1 == 1
        ones, zeros = np.flatnonzero(one), np.flatnonzero(~one)
        if not len(zeros):
            continue
        tree = cKDTree(lifted[zeros])
        for block in blocks(len(ones), _BLOCK):
            few = ones[block]
            yield np.stack([few, zeros[tree.query(level[few])[1]]])


def _local_minima(
    pairs: Ints, gap: Floats, facing: Floats, yarn: Ints
) -> tuple[Ints, Floats, Floats]:
    """Keep pairs that are no further apart than their neighbours along the first yarn."""
    infinite = np.array([np.inf])
    before, after = np.concatenate([infinite, gap[:-1]]), np.concatenate([gap[1:], infinite])
    one = yarn[pairs[0]]
    other = yarn[pairs[1]]
    same = (one[1:] == one[:-1]) & (other[1:] == other[:-1]) & (np.diff(pairs[0]) == 1)
    before[1:][~same] = np.inf
    after[:-1][~same] = np.inf
    keep = (gap <= before) & (gap <= after)
    return pairs[:, keep], gap[keep], facing[keep]


def _section_gap(
    first: tuple[Floats, ...],
    second: tuple[Floats, ...],
    lens: Floats,
    start: Floats | None = None,
    turns: int = 0,
) -> tuple[Floats, Floats, Floats]:
    """Compute the clearance of sections in the direction in which it is largest."""
    # Two convex sections are as far apart as the widest gap between parallel planes. So find the
    # unit vector q that maximises ``q (b - a)`` less the reach of both sections along q. Between
    # perpendicular sections of round yarns, q points from axis to axis. Deformed sections turn it,
    # by steps along the gradient, which is the vector between the points that face each other.
    (a, *radii_a), (b, *radii_b) = first, second
    across = b - a
    distance = np.maximum(_norm(across), 1e-300)
    direction = across / distance if start is None else start
    gap, reach, pull = _separation(across, (radii_a, radii_b), lens, direction)
    step = np.ones_like(distance)
    for _ in range(turns):
        pull -= direction * np.sum(direction * pull, axis=1, keepdims=True)
        trial = direction + step * pull / distance
        trial /= np.maximum(_norm(trial), 1e-300)
        found = _separation(across, (radii_a, radii_b), lens, trial)
        better = (found[0] > gap)[:, None]
        direction = np.where(better, trial, direction)
        gap, reach = np.maximum(gap, found[0]), np.where(better[:, 0], found[1], reach)
        pull = np.where(better, found[2], pull)
        step = np.where(better, 1.5 * step, 0.3 * step)
    return gap, a + direction * (reach + 0.5 * gap)[:, None], direction


def _separation(
    across: Floats, radii: tuple[list[Floats], list[Floats]], lens: Floats, direction: Floats
) -> tuple[Floats, Floats, Floats]:
    """Compute the gap, the first section's reach along the direction, and the gap's gradient."""
    gap = np.einsum("nk,nk->n", direction, across)
    pull = across.copy()
    reaches = []
    for (normal, lateral), aspect in zip(radii, lens, strict=True):
        n = np.einsum("nk,nk->n", direction, normal)
        m = np.einsum("nk,nk->n", direction, lateral) / aspect
        # The arcs of a lens of half height 1 have the radius 1 + more about points `more` beyond
        # its middle. An ellipse is the image of a circle, for which `more` is 0.
        more = 0.5 * (aspect * aspect - 1.0)
        size = np.hypot(n, m)
        reach = (1.0 + more) * size - more * np.abs(n)
        share = (1.0 + more) / np.maximum(size, 1e-300)
        by_n, by_m = share * n - more * np.sign(n), share * m / aspect
        edge = more * np.abs(m) > aspect * np.abs(n)
        reach = np.where(edge, aspect * np.abs(m), reach)
        pull -= np.where(edge, 0.0, by_n)[:, None] * normal
        pull -= np.where(edge, np.sign(m), by_m)[:, None] * lateral
        reaches.append(reach)
    return gap - reaches[0] - reaches[1], reaches[0], pull


def _norm(vectors: Floats) -> Floats:
    return np.linalg.norm(vectors, axis=1, keepdims=True)
