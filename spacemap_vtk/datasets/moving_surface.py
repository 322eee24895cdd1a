"""A surface with shapes that it takes: what files of animations hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Materials there may be; of more colours than that each point has its own.
_MATERIALS = 32


class Shade(NamedTuple):
    """What some points look like."""

    name: str
    #: Shares of light, red, green and blue; white where each point has its own.
    color: tuple[float, ...]
    points: NDArray[np.bool_]


@dataclass(frozen=True)
class Clip:
    """How much of each target there is over time, linear in between."""

    name: str
    #: In s, ascending from 0, (T,).
    times: NDArray[np.floating]
    #: (T, K).
    weights: NDArray[np.floating]


class YarnCurves(NamedTuple):
    """The middles of yarns as cubic Bézier curves, end to end."""

    #: In m, at each of the first clip's times, (T, R, 3).
    points: NDArray[np.floating]
    #: Points of each curve: three for each part, and one.
    counts: NDArray[np.integer[Any]]
    #: Diameter of a round yarn of the same section [m], and colour, of each curve.
    widths: NDArray[np.floating]
    colors: NDArray[np.uint8]


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
    #: Of woven cloth with its motion.
    curves: YarnCurves | None = None
    #: What is known of it, for people and programs.
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def painted(self) -> bool:
        """Whether there are so many colours that each point has its own."""
        return len(np.unique(self.colors, axis=0)) > _MATERIALS

    @property
    def materials(self) -> list[Shade]:
        """One for each colour of each part."""
        if self.painted:
            every = np.ones(len(self.points), np.bool_)
            return [Shade("colours of points", (1.0, 1.0, 1.0), every)]
        table = np.column_stack([self.parts, self.colors])
        found, own = np.unique(table, axis=0, return_inverse=True)
        return [
            Shade(
                f"{self.part_names[part]} #{bytes(rgb).hex()}",
                tuple(linear(np.array(rgb, np.uint8)).tolist()),
                own.reshape(-1) == number,
            )
            for number, (part, *rgb) in enumerate(found.tolist())
        ]


def linear(colors: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return colours of screens as shares of light, which renderers add up (IEC 61966-2-1)."""
    shares = colors / 255.0
    found: NDArray[np.float64] = np.where(
        shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4
    )
    return found
