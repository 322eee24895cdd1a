"""Sections of a yarn as closed cubic Bézier curves, and the patches that close its cut ends.

A section is given for a half height of 1: lateral coordinates across the yarn, normal ones along z.
It starts at the top and runs towards positive lateral. A ring of a tube consists of the section's
control points, three for each cubic; neighbouring cubics share their ends.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.geometry.swelling import swollen_changes
from spacemap_vtk.textile.patches.bezier import arc_handle, quadrilateral_order, rational_handles
from spacemap_vtk.textile.weave.lens import edge_angle, face_radius


class Section(NamedTuple):
    """Control points of a section of half height 1."""

    lateral: Floats
    """(m,) Across the yarn, along the cloth."""
    normal: Floats
    """(m,) Along the normal of the yarn's axis, upwards."""
    weight: Floats
    """(m,) Rational weights; 1 where cubics meet, and everywhere in polynomial sections."""
    error: float
    """Largest distance from the exact section."""
    aspect: float
    """Width over height."""
    lens_aspect: float = 1.0
    """The same for a lens; 1 for other sections."""

    changes: tuple[Floats, Floats] | None = None
    """Changes of lateral and normal, (k, m) each, that rings may have shares of."""

    @property
    def size(self) -> int:
        """Number m of control points: three for each patch around the yarn."""
        return len(self.lateral)


def build_section(kind: str, aspect: float, exact: bool, widest: float = 1.0) -> Section:
    """Build a section of half height 1; `widest` is the widening of the floats of a lens."""
    if kind == "lenticular":
        return _build_lens(aspect, exact, widest)
    if exact:
        handle, weight = map(float, rational_handles(0.5 * pi))
    else:
        handle, weight = arc_handle(0.5 * pi), 1.0
    up = np.array([1, 1, handle, 0, -handle, -1, -1, -1, -handle, 0, handle, 1], dtype=np.float64)
    across = np.roll(up, 3)
    weights = np.tile([1.0, weight, weight], 4)
    error = 0.0 if exact else cubic_error(0.5 * pi)
    if kind != "racetrack":
        return Section(aspect * across, up, weights, aspect * error, aspect)
    half, third = aspect - 1.0, (aspect - 1.0) / 3.0
    closed = np.append(across, across[0]), np.append(up, up[0]), np.append(weights, 1.0)
    ones = np.ones(2)
    return Section(
        np.concatenate(
            [closed[0][:7] + half, [third, -third], closed[0][6:] - half, [-third, third]]
        ),
        np.concatenate([closed[1][:7], -ones, closed[1][6:], ones]),
        np.concatenate([closed[2][:7], ones, closed[2][6:], ones]),
        error,
        aspect,
    )


def _build_lens(aspect: float, exact: bool, widest: float) -> Section:
    """Build a lens: four arcs, with an edge where the upper two meet the lower two."""
    angle, radius = edge_angle(aspect), 2.0 * face_radius(aspect)
    if exact:
        handle, weight = map(float, rational_handles(angle))
    else:
        handle, weight = arc_handle(angle), 1.0
    reach = handle * radius
    near, low = aspect - reach * cos(angle), reach * sin(angle)
    side = np.array([0.0, reach, near, aspect, near, reach])
    up = np.array([1.0, 1.0, low, 0.0, -low, -1.0])
    return Section(
        np.concatenate([side, -side]),
        np.concatenate([up, -up]),
        np.tile([1.0, weight, weight], 4),
        0.0 if exact else radius * cubic_error(angle),
        aspect,
        aspect,
        swollen_changes(aspect, exact, widest),
    )


def cubic_error(angle: float) -> float:
    """Compute the largest radial error of one cubic for an arc, over its radius."""
    s, c = np.sin(0.25 * angle), cos(0.25 * angle)
    return float(np.sqrt(1.0 + 4.0 / 27.0 * s**6 / c**2) - 1.0)


def number_tube_points(size: int) -> Ints:
    """Number the control points of the patches around a part of a tube."""
    segment, j, i = np.ogrid[: size // 3, :4, :4]
    return _to_vtk_order(size * i + (3 * segment + j) % size)


class Cap(NamedTuple):
    """Cap of a cut end: cubics across it, between facing points of its ring."""

    # Both poles of the section are edges of zero length. The surface is still smooth there, and
    # exact for rational sections.

    lower: Ints
    """(c,) Lower points of the ring, from pole to pole, without the poles."""
    upper: Ints
    """(c,) Upper points of the ring."""
    table: Ints
    """(size / 6, 16) Patches in VTK's order, with the normal along the yarn. Numbers below `size`
    are points of the ring, the others are new points."""

    @property
    def new_points(self) -> int:
        """Number of points that do not belong to the ring."""
        return 2 * len(self.lower)


def build_cap(size: int) -> Cap:
    """Build the cap of a ring of `size` points."""
    step = np.arange(size // 2 + 1)
    # The section is symmetric and starts at the top, so one pole is point 3 and the other is
    # opposite.
    lower, upper = (size // 2 + 3 - step) % size, (size // 2 + 3 + step) % size
    inner = np.arange(len(step) - 2)
    grid = np.empty((4, len(step)), dtype=np.int64)
    grid[0], grid[3] = lower, upper
    grid[1:3, [0, -1]] = lower[[0, -1]]
    grid[1, 1:-1] = size + inner
    grid[2, 1:-1] = size + len(inner) + inner
    segment, j, i = np.ogrid[: size // 6, :4, :4]
    return Cap(lower[1:-1], upper[1:-1], _to_vtk_order(grid[j, 3 * segment + i]))


def _to_vtk_order(tensor: Ints) -> Ints:
    flat = tensor.reshape(len(tensor), 16)
    table = np.empty_like(flat)
    table[:, quadrilateral_order(3, 3)] = flat
    return table
