"""Divide a cloth among processes: which yarns each one builds, and what it knows of the others.

A piece is a run of neighbouring yarns, counted ends first, then picks. Yarns share no control
points, so pieces need no layer of neighbours. In a large cloth a few crops that contain each local
weave represent the whole.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.swelling import RISE
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

#: Crossings along both sides of a local weave: the crossing and its neighbours decide where a yarn
#: bends.
_LOCAL = 3
#: Largest number of codes of local weaves for which a table numbers them.
_MOST_CODES = 2**22
#: Crossings along both sides of a crop: this multiple of the square root of the number of weaves
#: that are still missing, so that a crop of a cloth without order contains nearly all of them.
_PER_WEAVE = 3.0
#: Least number of crossings along both sides of a crop.
_LEAST = 12


def select_piece(cloth: Cloth, piece: int, pieces: int) -> YarnSelection:
    """Choose the yarns of a piece; all pieces take about the same work.

    Parameters
    ----------
    cloth : Cloth
        The whole cloth.
    piece, pieces : int
        Number of the piece, from 0, and number of pieces. Each yarn belongs to one piece. The first
        piece is never empty; others are if there are more pieces than yarns.

    Returns
    -------
    YarnSelection
        Slices of ends and picks.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> over = [[1, 0, 1], [0, 1, 0], [1, 0, 1]]
    >>> select_piece(Cloth(drawdown=over, warp=threads, weft=threads), 1, 3)
    YarnSelection(ends=slice(2, 3, None), picks=slice(0, 1, None))
    """
    parts = np.concatenate([_estimate_patches(cloth, 0), _estimate_patches(cloth, 1)])
    middle = np.cumsum(parts) - 0.5 * parts
    owner = np.floor(pieces * middle / parts.sum())
    owner -= owner[0]
    start, stop = np.searchsorted(owner, [piece, piece + 1]).tolist()
    ends = cloth.size[0]
    return YarnSelection(
        slice(min(start, ends), min(stop, ends)),
        slice(max(start - ends, 0), max(stop - ends, 0)),
    )


def crop_cloth(cloth: Cloth, part: YarnSelection) -> Cloth:
    """Crop a cloth to some ends and picks, in place.

    Parameters
    ----------
    cloth : Cloth
        The whole cloth.
    part : YarnSelection
        Slices of neighbouring yarns, at least one of each family.

    Returns
    -------
    Cloth
        Its yarns lie as in the whole cloth, except splines near the cut.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0, 1], [0, 1, 0]], warp=threads, weft=threads)
    >>> part = crop_cloth(cloth, YarnSelection(slice(1, 3), slice(0, 1)))
    >>> part.drawdown.tolist(), part.yarns[0].position.round(9).tolist()
    ([[False, True]], [0.0, 0.2])
    """
    threads, middle = [], []
    for number, (whole, some) in enumerate(zip(cloth.threads, part, strict=True)):
        assert isinstance(some, slice)
        first, last, _ = some.indices(cloth.size[number])
        place = cloth.yarns[number].position
        middle.append(0.5 * float(place[first] + place[last - 1]))
        colors = whole.colors if len(whole.colors) == 1 else whole.colors[some]
        apart = whole.spacing
        own: dict[str, Any] = {
            name: value[some]
            for name in ("diameter", "twist", "plies", "float_width")
            if isinstance(value := getattr(whole, name), np.ndarray)
        }
        threads.append(
            replace(
                whole,
                spacing=apart[first : last - 1] if isinstance(apart, np.ndarray) else apart,
                colors=colors,
                **own,
            )
        )
    warp, weft = threads
    drawdown, layers = cloth.drawdown[part.picks, part.ends], None
    if cloth.layers is not None:
        layers = cloth.layers.crop(part.ends, part.picks)
    cropped = replace(
        cloth,
        drawdown=drawdown,
        warp=warp,
        weft=weft,
        # The height is divided as in the whole cloth, whose mean diameters may differ.
        crimp_height=_height_for_lean(cloth, warp, weft),
        middle=(middle[0], middle[1]),
        layers=layers,
    )
    if layers is None:
        return cropped
    return replace(cropped, layer_gap=2.0 * cloth.level - cropped.sheet_thickness)


def _height_for_lean(cloth: Cloth, warp: Threads, weft: Threads) -> float:
    """Compute the crimp height of some threads that are bent as in the whole cloth."""
    level = weft.mean_diameter if cloth.is_lenticular else 0.0
    return level + cloth.lean * (warp.mean_diameter + weft.mean_diameter)


def cloth_bounds(cloth: Cloth) -> Floats:
    """Compute the bounds of all control points of a cloth from a few of its yarns.

    Peirce's axes are highest and lowest at crossings. So the yarns that are highest, lowest and
    outermost there bound the cloth. A spline overshoots between crossings; so one yarn of each
    course is built.

    Parameters
    ----------
    cloth : Cloth
        The whole cloth.

    Returns
    -------
    (6,) float64
        Least and largest x, y and z, in m, as VTK orders them.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> cloth_bounds(cloth).round(9).tolist()
    [-0.2, 0.2, -0.2, 0.2, -0.1, 0.1]
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    nothing = np.empty(0, dtype=np.int64)
    for number in (0, 1):
        chosen = _outermost_yarns(cloth, number)
        for block in cloth.yarn_blocks(number, len(chosen)):
            some = chosen[block]
            share = YarnSelection(nothing, some) if number else YarnSelection(some, nothing)
            points = build_weave(cloth, share).points
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    return np.stack([low, high], axis=1).ravel()


def representative_parts(cloth: Cloth, most: int) -> tuple[list[tuple[slice, slice]], Ints]:
    """Find parts of a cloth that contain each of its local weaves.

    A local weave is a crossing with the crossings around it; some are missing at the cloth's edges.

    Parameters
    ----------
    cloth : Cloth
        The whole cloth.
    most : int
        Largest number of crossings in all parts.

    Returns
    -------
    parts : list of (slice, slice)
        Ends and picks of each part.
    weaves : (picks, ends) int64
        Number of the local weave of each crossing, including the measures of its yarns.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> over = np.indices((40, 40)).sum(axis=0) % 2
    >>> cloth = Cloth(drawdown=over, warp=threads, weft=threads)
    >>> parts, weaves = representative_parts(cloth, 2000)
    >>> len(parts), int(weaves.max()) + 1
    (4, 14)
    """
    first, weaves = _number_codes(_encode_crossings(cloth))
    left = first.copy()
    found: list[tuple[slice, slice]] = []
    while len(left):
        side = max(_LEAST, ceil(_PER_WEAVE * len(left) ** 0.5))
        picks, ends = (
            slice(start, min(start + side, size))
            for at, size in zip(
                divmod(int(left.min()), cloth.size[0]), cloth.drawdown.shape, strict=True
            )
            for start in [max(min(at - side // 2, size - side), 0)]
        )
        most -= (picks.stop - picks.start) * (ends.stop - ends.start)
        if most < 0 and found:
            break
        found.append((ends, picks))
        # At the border of a crop some of the surrounding crossings are missing.
        whole = (
            slice(part.start + (part.start > 0), part.stop - (part.stop < size))
            for part, size in zip((picks, ends), cloth.drawdown.shape, strict=True)
        )
        first[weaves[tuple(whole)]] = -1
        left = first[first >= 0]
    return found, weaves


def _estimate_patches(cloth: Cloth, number: int) -> Floats:
    """Estimate the number of patches of each yarn of a family."""
    upper, threads = cloth.is_over(number), cloth.threads[number]
    ring = build_section(threads.shape, threads.aspect, cloth.exact).size
    gaps = upper.shape[1] + 1
    if cloth.axis == "spline":
        return np.full(len(upper), float(ring * gaps))
    changes = np.count_nonzero(upper[:, 1:] != upper[:, :-1], axis=1)
    return ring * (gaps + (cloth.parts_per_gap - 1.0) * changes)


def _outermost_yarns(cloth: Cloth, number: int) -> Ints:
    """Find the yarns that bound a family."""
    own, upper = cloth.yarns[number], cloth.is_over(number)
    radius = 0.5 * own.diameter
    wide = own.aspect * radius
    chosen = {int(np.argmin(own.position - wide)), int(np.argmax(own.position + wide))}
    if cloth.axis == "spline":
        chosen |= set(cloth.yarn_groups[number][0].tolist())
        return np.array(sorted(chosen))
    top, bottom = np.empty(len(upper)), np.empty(len(upper))
    for some in cloth.yarn_blocks(number, len(upper)):
        height = cloth.crossing_profile(number, some).height
        top[some], bottom[some] = height.max(axis=1), height.min(axis=1)
    chosen |= {int(np.argmax(top + radius)), int(np.argmin(bottom - radius))}
    # Swollen floats are higher than other crowns.
    for side, reach in ((upper, top + radius), (~upper, radius - bottom)):
        floats = (side[:, 1:] & side[:, :-1]).any(axis=1)
        chosen.add(int(np.argmax(np.where(floats, reach + 2.0 * RISE * radius, reach))))
    return np.array(sorted(chosen))


def _number_codes(codes: Ints) -> tuple[Ints, Ints]:
    """Number the codes; also return the first place of each code, in ascending order of codes."""
    flat = codes.ravel()
    bound = int(flat.max()) + 1
    if bound > _MOST_CODES:
        first, numbers = np.unique(flat, return_index=True, return_inverse=True)[1:]
        return first, numbers.reshape(codes.shape)
    # A table of all codes is faster than sorting those of four million crossings (half a second).
    places = np.full(bound, -1)
    places[flat[::-1]] = np.arange(flat.size)[::-1]
    used = places >= 0
    return places[used], (np.cumsum(used) - 1)[codes]


def _encode_crossings(cloth: Cloth) -> Ints:
    """Encode the yarns and the local weave of each crossing in one number."""
    state, states = cloth.drawdown + 1, 3
    if cloth.layers is not None:
        state, states = state + 2 * cloth.layers.same_cloth + 4 * cloth.layers.in_upper_cloth, 9
    state = np.pad(state, 1)  # 0: past the edge
    rows, columns = cloth.drawdown.shape
    codes = np.zeros((rows, columns), np.int64)
    for i in range(_LOCAL):
        for j in range(_LOCAL):
            codes *= states
            codes += state[i : i + rows, j : j + columns]
    for number in (0, 1):
        kinds = _number_yarn_kinds(cloth, number)
        codes *= int(kinds.max()) + 1
        codes += kinds[:, None] if number else kinds
    return codes


def _number_yarn_kinds(cloth: Cloth, number: int) -> Ints:
    """Number the yarns of a family by their measures and those of their neighbours."""
    own = cloth.yarns[number]
    apart = np.diff(own.position, prepend=np.nan, append=np.nan)
    thick = np.pad(np.broadcast_to(own.diameter, len(own.position)), 1, mode="edge")
    widest = cloth.threads[number].float_width
    wide = np.broadcast_to(0.0 if widest is None else widest, len(own.position))
    measures = [thick[:-2], thick[1:-1], thick[2:], apart[:-1], apart[1:], wide]
    size = float(np.mean(own.diameter))
    rounded = np.rint(np.nan_to_num(np.stack(measures, axis=1)) / (1e-6 * size)).astype(np.int64)
    kinds = np.unique(rounded, axis=0, return_inverse=True)[1]
    return np.asarray(kinds, np.int64).ravel()
