"""A surface with shapes that it takes: what files of animations hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Clip:
    """How much of each target there is over time, linear in between."""

    name: str
    #: In s, ascending from 0, (T,).
    times: NDArray[np.floating]
    #: (T, K).
    weights: NDArray[np.floating]


@dataclass(frozen=True)
class MovingSurface:
    """Triangles, and the targets of which their motions are sums."""

    title: str
    #: In m, of N points, and of K targets the displacements at full weight, (K, N, 3).
    points: NDArray[np.float32]
    targets: NDArray[np.float32]
    #: Where it has them, of unit length, and what each target adds before they are made so again.
    normals: NDArray[np.float32] | None
    normal_targets: NDArray[np.float32] | None
    #: Numbers of points, counter-clockwise seen from outside, (M, 3).
    triangles: NDArray[np.integer[Any]]
    #: Red, green and blue as screens have them, (N, 3).
    colors: NDArray[np.uint8]
    #: What part each point is of, by its place in `part_names`.
    parts: NDArray[np.integer[Any]]
    part_names: Sequence[str]
    #: Whether z is up, and not y.
    lying: bool = False
    target_names: Sequence[str] = ()
    clips: Sequence[Clip] = ()
    #: What is known of it, for people and programs.
    about: Mapping[str, Any] = field(default_factory=dict)
