"""Geometry of a woven cloth: yarns of any section along their axes, as bicubic Bézier patches.

Ends (warp yarns) run along y and are spread along x. Picks (weft yarns) run along x and are spread
along y. z is the normal of the cloth, and the cloth is centred on the origin. Axes come from
`spacemap_vtk.textile.geometry.cloth_axes`, and `spacemap_vtk.textile.geometry.sweep` makes tubes
of them.

Source: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from spacemap_vtk import cancel
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats, Ints
from spacemap_vtk.textile.geometry.arcs import FLAT, LONGEST_ARC
from spacemap_vtk.textile.geometry.axis_parts import Axes
from spacemap_vtk.textile.geometry.cloth_axes import (
    ALL_YARNS,
    YarnSelection,
    cloth_axes,
    family_axes,
)
from spacemap_vtk.textile.geometry.section import Section, build_cap, build_section, cubic_error
from spacemap_vtk.textile.geometry.spline import offset_error
from spacemap_vtk.textile.geometry.sweep import CentreLines, Tubes, sweep
from spacemap_vtk.textile.geometry.swelling import float_widening, ring_shares
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import Crimp

#: Working memory of `build_weave` per part by arcs, in bytes, measured and rounded up.
_PART_BYTES = 150
#: The same per part by splines.
_SPLINE_PART_BYTES = 300
#: The same per gap of all yarns.
_GAP_BYTES = 250


@dataclass(frozen=True, eq=False)
class Weave:
    """A cloth as bicubic Bézier patches."""

    #: (N, 3) Control points in metres, 12 per ring (racetracks 18); shared inside a yarn, not
    #: between yarns.
    points: AnyFloats
    #: (P, 16) Control points of each patch; see `spacemap_vtk.textile.geometry.sweep.SweptTubes`.
    #: The tubes of warp and weft come first, then the caps of all cut ends.
    patches: AnyInts
    #: (N,) Rational weights of the control points (VTK's RationalWeights); None where all are 1.
    weights: Floats | None
    #: (P,) Yarn of each patch; ends are numbered first, then picks.
    yarn: NDArray[np.int32]
    #: (P,) Family of each patch: 0 warp, 1 weft.
    family: NDArray[np.uint8]
    #: Number of patches that are not caps.
    tube_patches: int
    #: Positions of the rings of warp and weft in `points`.
    tubes: tuple[Tubes, ...]
    #: Peirce's figures of each family where a yarn changes side, for mean measures.
    warp: Crimp
    weft: Crimp
    #: Bound of the surface's distance from the exact tube, over the yarn's half height: the errors
    #: of the cubics around the yarn and along its arcs together; 0 for exact cloth. For splines,
    #: the largest deviation found along the yarn replaces the bound. Only yarns that were built
    #: count.
    radial_error: float
    #: (parts, 4) For each part of a yarn, in the order of the tubes: positions along the cloth
    #: where it starts and ends [m], its yarn, and the number of that yarn in the whole cloth. Twist
    #: uses these positions, because lengths of yarn are not known if only a part is built.
    places: Floats


def build_weave(
    cloth: Cloth, selection: YarnSelection = ALL_YARNS, kind: DTypeLike = np.float64
) -> Weave:
    """Build the patches of a cloth.

    Parameters
    ----------
    cloth : Cloth
        Drawdown, yarns, and all that shapes them.
    selection : YarnSelection
        Yarns to build, at their positions in the whole cloth; see
        `spacemap_vtk.textile.geometry.partition.select_piece`.
    kind : dtype_like
        Type of the control points, float32 or float64.

    Returns
    -------
    Weave
        Control points and patches.

    Raises
    ------
    GeometryError
        There is no room for the yarns.
    InputError
        A yarn has no length (one crossing and no overhang), or the cloth has measures for a
        different number of yarns.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> weave = build_weave(Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads))
    >>> weave.points.shape, weave.patches.shape
    ((848, 3), (96, 16))
    """
    cloth.check()
    paths, sections, (ends, picks) = (
        cloth_axes(cloth, selection),
        _family_sections(cloth),
        cloth.size,
    )
    numbers = np.arange(ends)[selection.ends], ends + np.arange(picks)[selection.picks]
    lines = [
        _centre_lines(path, number, numbers[number], float_widening(cloth, number)[0][some])
        for number, (path, some) in enumerate(zip(paths, selection, strict=True))
    ]
    warp, weft = cloth.families
    cancel.check()
    return Weave(
        *sweep(list(zip(lines, sections, strict=True)), cloth.caps, cloth.exact, kind),
        warp=warp.crimp,
        weft=weft.crimp,
        radial_error=max(
            _radial_error(path, shape.error, cloth.exact)
            for path, shape in zip(paths, sections, strict=True)
        ),
        places=np.concatenate([_part_places(*each) for each in zip(paths, numbers, strict=True)]),
    )


def _part_places(path: Axes, numbers: Ints) -> Floats:
    """Compute the rows of `Weave.places` of one family."""
    start = np.arange(len(path.length)) + path.owner
    own = numbers[path.owner]
    return np.stack([path.along[start], path.along[start + 1], own, own], axis=1)


def _family_sections(cloth: Cloth) -> tuple[Section, Section]:
    warp, weft = (
        build_section(t.shape, t.aspect, cloth.exact, float_widening(cloth, number)[1])
        for number, t in enumerate(cloth.threads)
    )
    return warp, weft


def _centre_lines(path: Axes, number: int, numbers: Ints, widening: Floats) -> CentreLines:
    """Place axes in space: each yarn in a vertical plane."""
    cos, sin = np.cos(path.angle), np.sin(path.angle)
    aside = np.repeat(path.lateral, path.parts + 1)
    warp = number == 0
    return CentreLines(
        numbers,
        path.radius,
        path.parts,
        place=(aside, path.along, path.height) if warp else (path.along, aside, path.height),
        tangent=(0.0, cos, sin) if warp else (cos, 0.0, sin),
        normal=(0.0, -sin, cos) if warp else (-sin, 0.0, cos),
        lateral=(-1.0, 0.0, 0.0) if warp else (0.0, 1.0, 0.0),
        curvature=path.curvature,
        reach=path.reach,
        weight=path.weight,
        swelling=ring_shares(path, widening),
    )


class PatchCounts(NamedTuple):
    """Numbers of control points, patches and parts of a cloth."""

    points: int
    """Control points."""
    patches: int
    parts: int
    """Parts of the axes of all yarns."""

    def estimate_bytes(self, exact: bool = False, single: bool = False) -> int:
        """Estimate the memory of built patches, as `filters.WeaveSource` stores them.

        Parameters
        ----------
        exact : bool
            Whether there are rational weights.
        single : bool
            Whether positions are in single precision.

        Returns
        -------
        int
            Bytes of points, connectivity with offsets, yarn, family, colour, and `Weave.places`.
        """
        number = 8 if self.points >= 2**31 else 4
        size = self.points * (3 * (4 if single else 8) + 8 * exact)
        return size + self.patches * (17 * number + 4 + 4 + 3) + 32 * self.parts


def estimate_counts(cloth: Cloth) -> PatchCounts:
    """Compute upper bounds of the numbers of control points, patches and parts of a cloth.

    Parameters
    ----------
    cloth : Cloth
        As for `build_weave`.

    Returns
    -------
    PatchCounts
        Equal to what `build_weave` makes if all yarns of a family are equal, except for parts of
        zero length, which `build_weave` leaves out.

    Raises
    ------
    GeometryError
        There is no room for the yarns.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> estimate_counts(cloth)[:2]
    (848, 96)
    """
    cloth.check()
    parts = []
    for number, yarns in enumerate(cloth.size):
        crossings, crossed = cloth.size[1 - number], cloth.threads[1 - number]
        if cloth.axis == "spline":
            parts.append(yarns * cloth.parts_per_gap * (crossings + 1))
            continue
        passed = yarns * crossings
        if cloth.layers is not None:
            passed = int(np.count_nonzero(cloth.layers.bends(number)))
        changes = passed - yarns
        # Floats over yarns of unequal diameters bend too, and yarns that change cloths.
        if not np.ndim(crossed.diameter) and cloth.layers is None:
            changes = int(np.count_nonzero(np.diff(cloth.drawdown, axis=number)))
        straight = yarns + passed * (1 + crossed.has_flats)
        parts.append(straight + 2 * _cubics_per_arc(cloth, number) * changes)
    return _counts_from_parts(cloth, parts)


def count_patches(cloth: Cloth) -> tuple[PatchCounts, float]:
    """Count what `build_weave` makes of a cloth, from one yarn of each group of equal yarns.

    Parameters
    ----------
    cloth : Cloth
        As for `build_weave`.

    Returns
    -------
    counts : PatchCounts
        For all yarns.
    radial_error : float
        As in `Weave`: the largest of all yarns.

    Raises
    ------
    GeometryError, InputError
        As for `build_weave`.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> count_patches(Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads))[0]
    PatchCounts(points=848, patches=96, parts=20)
    """
    parts, worst = [0, 0], 0.0
    for number, shape in enumerate(_family_sections(cloth)):
        chosen, which = cloth.yarn_groups[number]
        yarns = np.bincount(which)
        for some in cloth.yarn_blocks(number, len(chosen)):
            path = family_axes(cloth, number, chosen[some])
            parts[number] += int(path.parts @ yarns[some])
            worst = max(worst, _radial_error(path, shape.error, cloth.exact))
    return _counts_from_parts(cloth, parts), worst


def _counts_from_parts(cloth: Cloth, parts: Sequence[int]) -> PatchCounts:
    """Compute the numbers for given numbers of parts of both families."""
    points = patches = 0
    for yarns, own, shape in zip(cloth.size, parts, _family_sections(cloth), strict=True):
        points += (3 * own + yarns) * shape.size
        patches += own * (shape.size // 3)
        if cloth.caps:
            closing = build_cap(shape.size)
            points += 2 * yarns * closing.new_points
            patches += 2 * yarns * len(closing.table)
    return PatchCounts(points, patches, sum(parts))


def _cubics_per_arc(cloth: Cloth, number: int) -> int:
    """Compute the number of cubics for an arc of a family."""
    crossed = cloth.threads[1 - number]
    varied = any(np.ndim(v) for v in (cloth.warp.diameter, cloth.weft.diameter, crossed.spacing))
    if varied or cloth.layers is not None:
        steep = cloth.layers is not None or max(cloth.shares) > 0.5 + 1e-9
        return 2 if steep and not cloth.exact else 1
    theta = float(cloth.families[number].crimp.theta)
    if theta < FLAT:
        return 0
    return ceil(theta / (2.0 * LONGEST_ARC if cloth.exact else LONGEST_ARC) - 1e-9)


def estimate_bytes(cloth: Cloth, single: bool = False) -> int:
    """Compute an upper bound of the memory that `build_weave` needs, before any is allocated.

    Parameters
    ----------
    cloth : Cloth
        As for `build_weave`.
    single : bool
        Whether positions are in single precision.

    Returns
    -------
    int
        Bytes at the peak: the result and the temporary arrays of one family.

    Raises
    ------
    GeometryError
        There is no room for the yarns.
    """
    counts, (ends, picks) = estimate_counts(cloth), cloth.size
    return (
        counts.estimate_bytes(cloth.exact, single)
        + (_SPLINE_PART_BYTES if cloth.axis == "spline" else _PART_BYTES) * counts.parts
        + _GAP_BYTES * 2 * (ends + 1) * (picks + 1)
    )


def _radial_error(path: Axes, error: float, exact: bool) -> float:
    """Compute the largest error of tubes along these axes from the error of their sections."""
    if not len(path.parts):
        return 0.0
    if path.cubic:
        return error + offset_error(path)
    turn = np.abs(path.curvature[0])
    if not exact and turn.any():
        # Along an arc the error is a share of the distance from the arc's axis, at most radius + r.
        reach = 1.0 / turn[turn > 0.0].min() + path.radius.max()
        error += cubic_error(float((turn * path.length).max())) * reach / path.radius.min()
    return float(error)
