"""Axes of yarns, cut into parts.

Invariant on which all modules that use axes rely: part q of a family, on its yarn y, runs from
station q + y to station q + y + 1.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.textile.patches.bezier import bernstein


class Axes(NamedTuple):
    """The axes of one family, cut into parts; stations are the ends of the parts."""

    radius: Floats
    """(yarns,) Half the height of each yarn's section."""
    lateral: Floats
    """(yarns,) Position of the plane that contains each yarn's axis."""
    parts: Ints
    """(yarns,) Number of parts."""
    along: Floats
    """(stations,) Position along the yarn."""
    height: Floats
    """(stations,) Position in z."""
    angle: Floats
    """(stations,) Slope of the axis, in radians."""
    length: Floats
    """(parts,) Length of each part."""
    curvature: Floats
    """(2, parts) Curvature at start and end of each part, positive where the axis turns upwards."""
    reach: Floats
    """(2, parts) Handle lengths of the cubic that approximates each part, at start and end."""
    weight: Floats
    """(parts,) Rational weight of the two inner control points; (1,) where all are 1."""
    cubic: bool
    """Whether the parts are these cubics rather than arcs and straight parts."""
    swelling: Floats | None = None
    """(2, stations) Share of swelling and its slope along the cloth; None if no yarn swells."""

    @property
    def owner(self) -> Ints:
        """(parts,) Yarn of each part."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @property
    def last(self) -> Ints:
        """(yarns,) Last station of each yarn."""
        return np.cumsum(self.parts) + np.arange(len(self.parts))

    def evaluate(
        self, part: Ints, station: Ints, fraction: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Compute position along the yarn, height and slope at fractions of parts."""
        place, slope = (self.along, self.height), self.angle
        if self.cubic:
            weights = bernstein(3, fraction).T
            hodograph = bernstein(2, fraction).T
            found, speed = [], []
            for values, direction in zip(place, (np.cos, np.sin), strict=True):
                a, d = values[station], values[station + 1]
                b = a + self.reach[0, part] * direction(slope[station])
                c = d - self.reach[1, part] * direction(slope[station + 1])
                found.append(sum(w * v for w, v in zip(weights, (a, b, c, d), strict=True)))
                speed.append(
                    sum(w * v for w, v in zip(hodograph, (b - a, c - b, d - c), strict=True))
                )
            return found[0], found[1], np.arctan2(speed[1], speed[0])
        s, k, a = self.length[part] * fraction, self.curvature[0, part], slope[station]
        # The chord of an arc of angle k s has the length 2 sin(k s / 2) / k and the direction of
        # the arc's middle.
        chord, middle = s * np.sinc(0.5 * k * s / pi), a + 0.5 * k * s
        straight = k == 0.0
        along, height = (
            np.where(
                straight,
                (1.0 - fraction) * values[station] + fraction * values[station + 1],
                values[station] + chord * direction(middle),
            )
            for values, direction in zip(place, (np.cos, np.sin), strict=True)
        )
        return along, height, a + k * s

    def evaluate_swelling(self, part: Ints, station: Ints, fraction: Floats) -> Floats:
        """Compute the share of swelling at fractions of parts."""
        if self.swelling is None:
            return np.zeros(len(part))
        share, slope = self.swelling
        width = self.along[station + 1] - self.along[station]
        weights = bernstein(3, fraction).T
        begin, end = share[station], share[station + 1]
        controls = (
            begin,
            begin + slope[station] * width / 3.0,
            end - slope[station + 1] * width / 3.0,
            end,
        )
        return np.asarray(sum(w * c for w, c in zip(weights, controls, strict=True)))


def sample_places(family: Axes, samples: int) -> tuple[Ints, Ints, Floats]:
    """Choose evenly spaced points on the axes of a family, yarn by yarn."""
    count = np.full(len(family.length), samples)
    count[np.cumsum(family.parts) - 1] += 1
    part = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(part)) - (np.cumsum(count) - count)[part]
    return part, (np.arange(len(count)) + family.owner)[part], step / samples
