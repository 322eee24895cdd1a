"""Tubes along relaxed yarns: parts of their splines with frames that do not twist."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import AnyInts, Floats
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.sweep import CentreLines, SweptTubes, Tubes, sweep
from spacemap_vtk.textile.rods.yarns import basis_functions

#: Parts of each span: shorter parts miss the radius by less where a yarn bends sharply.
PARTS = 2


def sweep_yarns(
    points: Sequence[Floats], diameters: Floats, aspects: Floats | None = None
) -> SweptTubes:
    """Sweep yarns along uniform cubic B-splines.

    Parameters
    ----------
    points : sequence of ndarray of float64, shape (n, 3)
        Control points of each yarn [m]; it reaches from the second to the last but one.
    diameters : ndarray of float64, shape (Y,)
        Diameters, or heights of flat sections [m].
    aspects : ndarray of float64, shape (Y,), optional
        Width of each elliptic section over its height, in ascending order; by default 1.

    Returns
    -------
    SweptTubes
        Bézier patches of tubes with closed ends.

    Notes
    -----
    Frames that do not twist: W. Wang, B. Jüttler, D. Zheng, Y. Liu, ACM Trans. Graph. 27 (2008) 2.
    """
    shares = np.ones(len(points)) if aspects is None else aspects
    kinds, begins = np.unique(shares, return_index=True)
    bundles = []
    for aspect, begin, end in zip(kinds, begins, [*begins[1:], len(points)], strict=True):
        lines = spline_lines(points[begin:end], diameters[begin:end])
        lines = lines._replace(numbers=lines.numbers + begin)
        bundles.append((lines, build_section("circular", float(aspect), False)))
    return sweep(bundles, caps=True, exact=False)


def find_tubes(line: AnyInts) -> Tubes:
    """Find the tubes of `sweep_yarns` among its patches.

    Parameters
    ----------
    line : ndarray of int, shape (P,)
        Number of each patch's line.

    Returns
    -------
    Tubes
        Positions of the rings among the control points.
    """
    own, ends = 4, 4  # patches around a part, and of the two caps of a line
    parts = (np.bincount(line) - ends) // own
    return Tubes(0, build_section("circular", 1.0, False).size, parts, 1.0)


def round_widths(tubes: Tubes, points: NDArray[Any]) -> Floats:
    """Compute the diameter of a round yarn with the area of each line's first section.

    Parameters
    ----------
    tubes : Tubes
        From `find_tubes`.
    points : ndarray of float, shape (N, 3)
        Control points [m].

    Returns
    -------
    ndarray of float64, shape (lines,)
        Diameters [m].
    """
    first = points[tubes.first + tubes.ring * tubes.ends[::2, None] + np.array([0, 3, 6, 9])]
    height, width = (np.linalg.norm(first[:, k] - first[:, k + 2], axis=1) for k in (0, 1))
    return np.sqrt(height * width, dtype=np.float64)


def spline_lines(
    points: Sequence[Floats], diameters: Floats, up: Floats | None = None
) -> CentreLines:
    """Convert uniform cubic B-splines to the centre lines of tubes, `PARTS` for each span."""
    # Frames are carried along by double reflection: W. Wang, B. Jüttler, D. Zheng, Y. Liu, ACM
    # Trans. Graph. 27 (2008) 2. They begin to look towards `up`, by default z.
    places, slopes, bends, parts = [], [], [], []
    for line in points:
        count = len(line) - 3
        at = np.append(np.tile(np.arange(PARTS) / PARTS, count), 1.0)
        span = np.append(np.repeat(np.arange(count), PARTS), count - 1)
        corners = line[span[:, None] + np.arange(4)]
        place, slope, bend = (np.einsum("sk,skc->sc", n, corners) for n in basis_functions(at))
        places.append(place)
        slopes.append(slope / PARTS)
        bends.append(bend / PARTS**2)
        parts.append(count * PARTS)
    speeds = [np.linalg.norm(slope, axis=1) for slope in slopes]
    tangents = [slope / speed[:, None] for slope, speed in zip(slopes, speeds, strict=True)]
    normals = [
        _carry_frames(place, tangent, np.array([0.0, 0.0, 1.0]) if up is None else up)
        for place, tangent in zip(places, tangents, strict=True)
    ]
    place, slope, bend, speed, tangent, normal = (
        np.concatenate(each) for each in (places, slopes, bends, speeds, tangents, normals)
    )
    lateral = np.cross(normal, tangent)
    curved = (bend - tangent * (bend * tangent).sum(axis=1)[:, None]) / speed[:, None] ** 2
    number = np.array(parts)
    first = np.arange(number.sum()) + np.repeat(np.arange(len(number)), number)

    def at_ends(values: Floats) -> Floats:
        return np.stack([values[first], values[first + 1]])

    return CentreLines(
        np.arange(len(points)),
        np.asarray(diameters, dtype=np.float64) / 2,
        number,
        tuple(place.T),
        tuple(tangent.T),
        tuple(normal.T),
        tuple(lateral.T),
        at_ends((curved * normal).sum(axis=1)),
        at_ends(speed) / 3.0,
        np.ones(1),
        at_ends((curved * lateral).sum(axis=1)),
    )


def _carry_frames(place: Floats, tangent: Floats, up: Floats) -> Floats:
    """Carry a normal along a line without twisting it about the line, (n, 3)."""
    # Start from arbitrary normals, and subtract the twist that accumulates along the line.
    other = np.eye(3)[abs(tangent).argmin(axis=1)]
    normal = np.cross(tangent, other)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    side = np.cross(tangent, normal)
    chord = np.diff(place, axis=0)
    moved = _reflect(normal[:-1], chord)
    moved = _reflect(moved, tangent[1:] - _reflect(tangent[:-1], chord))
    twist = np.arctan2((moved * side[1:]).sum(axis=1), (moved * normal[1:]).sum(axis=1))
    start = np.arctan2(side[0] @ up, normal[0] @ up)
    angle = start + np.concatenate([[0.0], np.cumsum(twist)])
    return np.asarray(np.cos(angle)[:, None] * normal + np.sin(angle)[:, None] * side)


def _reflect(vectors: Floats, normals: Floats) -> Floats:
    """Reflect vectors in the planes across normals of any length; zero normals change nothing."""
    size = (normals * normals).sum(axis=1)
    share = 2.0 * (normals * vectors).sum(axis=1) / np.where(size > 0.0, size, 1.0)
    return np.asarray(vectors - share[:, None] * normals)
