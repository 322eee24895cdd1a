"""How far apart two convex sections are, and in which direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def section_gap(
    first: tuple[Floats, ...],
    second: tuple[Floats, ...],
    start: Floats | None = None,
    turns: int = 0,
) -> tuple[Floats, Floats, Floats]:
    """Return the clearance of sections in the direction in which it is largest."""
    # Two convex sections are as far apart as planes between them can be, so what is looked for is
    # the unit vector q that maximises ``q (b - a)`` less the reach of both sections along q.
    # Between perpendicular sections of round yarns it points from axis to axis; deformed ones turn
    # it, by steps along the gradient, which is the vector between the points that face each other.
    (a, *radii_a), (b, *radii_b) = first, second
    across = b - a
    distance = np.maximum(_norm(across), 1e-300)
    direction = across / distance if start is None else start
    gap, reach, pull = _separation(across, radii_a, radii_b, direction)
    step = np.ones_like(distance)
    for _ in range(turns):
        pull -= direction * np.sum(direction * pull, axis=1, keepdims=True)
        trial = direction + step * pull / distance
        trial /= np.maximum(_norm(trial), 1e-300)
        found = _separation(across, radii_a, radii_b, trial)
        better = (found[0] > gap)[:, None]
        direction = np.where(better, trial, direction)
        gap, reach = np.maximum(gap, found[0]), np.where(better[:, 0], found[1], reach)
        pull = np.where(better, found[2], pull)
        step = np.where(better, 1.5 * step, 0.3 * step)
    return gap, a + direction * (reach + 0.5 * gap)[:, None], direction


def _separation(
    across: Floats, radii_a: list[Floats], radii_b: list[Floats], direction: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return gap, reach of the first section along the direction, and the gap's gradient."""
    gap = np.einsum("nk,nk->n", direction, across)
    pull = across.copy()
    reaches = []
    for normal, lateral in (radii_a, radii_b):
        n = np.einsum("nk,nk->n", direction, normal)
        m = np.einsum("nk,nk->n", direction, lateral)
        reach = np.hypot(n, m)
        share = 1.0 / np.maximum(reach, 1e-300)
        pull -= (share * n)[:, None] * normal + (share * m)[:, None] * lateral
        reaches.append(reach)
    return gap - reaches[0] - reaches[1], reaches[0], pull


def _norm(vectors: Floats) -> Floats:
    result: Floats = np.linalg.norm(vectors, axis=1, keepdims=True)
    return result
