"""A surface with shapes that it takes: what files of animations hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import AnyInts, Bools, Floats
from spacemap_vtk.parallel import blocks

#: Materials there may be; of more colours than that each point has its own.
_MATERIALS = 32
#: Points that are worked on together.
_TOGETHER = 2**14


class Shade(NamedTuple):
    """What some points look like."""

    name: str
    #: Shares of light, red, green and blue; white where each point has its own.
    color: tuple[float, ...]
    points: Bools


@dataclass(frozen=True)
class Clip:
    """How much of each target there is over time, linear in between."""

    name: str
    #: In s, ascending from 0, as a film shows it, (T,).
    times: NDArray[np.floating]
    #: (T, K).
    weights: NDArray[np.floating]
    #: What time it is at the first of them [s], and seconds of motion in a second.
    start: float = 0.0
    speed: float = 1.0


class ScaledNumbers(NamedTuple):
    """What colours show that stand for numbers, in the unit that their scale has."""

    #: What stands over the scale, in lines.
    title: str
    span: tuple[float, float]
    #: Colours of the scale as ``"#rrggbb"``, from low on, evenly apart.
    ramp: Sequence[str]
    #: At each point, (N,), and what each of L changes adds there at full weight, (L, N).
    values: NDArray[np.floating]
    changes: NDArray[np.floating]
    #: At the first clip's times, (T, L).
    weights: NDArray[np.floating]


class Sight(NamedTuple):
    """How it is looked at, before anybody turns it."""

    #: Where one can stand, seen from the middle, and what is up there, by name; the one to begin
    #: with, and how much nearer it is.
    cameras: Mapping[str, Sequence[Sequence[float]]]
    camera: str
    zoom: float
    #: Colours behind it as ``"#rrggbb"``, at the bottom and at the top; of a usual one none.
    background: tuple[str, str] | None
    #: Depth of its folds [m], and whether it is darker in them.
    relief: float
    shadows: bool


class YarnCurves(NamedTuple):
    """The middles of yarns as cubic Bézier curves, or plies or fibres as B-splines, end to end."""

    #: In m, at each of the first clip's times, (T, R, 3).
    points: NDArray[np.floating]
    #: Points of each curve: three for each part, and one.
    counts: AnyInts
    #: Diameter of a round yarn of the same section [m], and colour, of each curve.
    widths: NDArray[np.floating]
    colors: NDArray[np.uint8]
    #: USD's word for the kind: ``"bezier"`` or ``"bspline"``.
    basis: str = "bezier"


class ShortTargets(NamedTuple):
    """Targets in few bits: whole numbers, of which each target has its own step."""

    #: What is 1 in the file [m], and what a target's weights are multiplied by there, (K,).
    unit: float
    factors: Floats
    #: In 32767ths of the unit, (K, N, 3), and normals in 127ths.
    targets: NDArray[np.int16]
    normals: NDArray[np.int8] | None


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
    triangles: AnyInts
    #: Red, green and blue as screens have them, (N, 3).
    colors: NDArray[np.uint8]
    #: What part each point is of, by its place in `part_names`.
    parts: AnyInts
    part_names: Sequence[str]
    sight: Sight
    #: How far points may be from where they should be [m].
    tolerance: float
    target_names: Sequence[str] = ()
    clips: Sequence[Clip] = ()
    #: Of woven cloth with its motion.
    curves: YarnCurves | None = None
    numbers: ScaledNumbers | None = None
    #: The targets once more, where there are so many that their size counts.
    short: ShortTargets | None = None
    #: What is known of it, for people and programs.
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def lying(self) -> bool:
        """Whether z is up, and not y."""
        return tuple(self.sight.cameras[self.sight.camera][1]) == (0.0, 0.0, 1.0)

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


def shortened(
    targets: NDArray[np.float32], normals: NDArray[np.float32] | None, weights: NDArray[np.floating]
) -> tuple[ShortTargets, float]:
    """Return targets in few bits, and how far any point gets from its place by that [m]."""
    sizes = np.array([np.abs(target).max() for target in targets], np.float64)
    turns = 0.0 if normals is None else np.array([np.abs(each).max() for each in normals])
    # The smaller the unit, the finer the places, and the coarser the normals: at this one normals
    # of the largest target have steps of less than a degree.
    unit = sizes.max() / 2
    factors = np.maximum(sizes / unit, turns)
    places = np.empty(targets.shape, np.int16)
    facing = None if normals is None else np.empty(normals.shape, np.int8)
    for k, factor in enumerate(factors):
        places[k] = np.rint(targets[k] * (32767 / (unit * factor)))
        if facing is not None and normals is not None:
            facing[k] = np.rint(normals[k] * (127 / factor))
    error, steps = 0.0, unit * factors / 32767
    for part in blocks(targets.shape[1], _TOGETHER):
        off = targets[:, part] - places[:, part] * steps[:, None, None]
        sums = np.tensordot(weights, off, 1)
        error = max(error, float(np.sqrt(np.einsum("tnk,tnk->tn", sums, sums).max())))
    return ShortTargets(unit, factors, places, facing), error


def linear(colors: NDArray[np.uint8]) -> Floats:
    """Return colours of screens as shares of light, which renderers add up (IEC 61966-2-1)."""
    shares = colors / 255.0
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
