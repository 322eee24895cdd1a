"""Slight irregularity of drawn yarns: of their position, width and brightness.

It varies smoothly along each yarn, over a few crossings. It depends only on the seed, the number of
the yarn in the whole cloth, and the position along it. So all pieces, levels of detail and times
show the same yarn. Figures and measurements do not have it, and files only on request.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats

#: Largest change of a yarn's position, as a share of the spacing of its family.
POSITION = 0.012
#: Largest relative change of its width.
WIDTH = 0.08
#: Largest relative change of its brightness, and the part of it that is the same all along.
BRIGHTNESS = 0.07
_OF_YARN = 0.6
#: Distance between two independent values, in spacings of the crossing yarns.
_CORRELATION = 2.0
#: Steps per octave to which this distance is rounded: a crop of a cloth with unequal spacings,
#: whose mean differs slightly, shows the same yarns as the whole.
_STEPS = 2
#: Numbers that make the three changes independent.
_POSITION, _WIDTH, _ALONG, _WHOLE = range(4)


class Irregularity(NamedTuple):
    """How irregular yarns are."""

    amount: float
    """0: regular; 1: as a good yarn is."""
    seed: int = 0


class YarnPlaces(NamedTuple):
    """Places on yarns; arrays have any shape, equal for all."""

    yarn: AnyInts
    """Number of the yarn in the whole cloth."""
    along: AnyFloats
    """Position along the yarn, in metres."""
    spacing: AnyFloats
    """Spacing of the yarn's family, in metres."""
    crossed: AnyFloats
    """Spacing of the yarns that it crosses, in metres."""


def lateral_changes(irregularity: Irregularity, places: YarnPlaces) -> tuple[Floats, Floats]:
    """Compute how far yarns are moved sideways [m], and relative changes of their width."""
    step = _steps_along(places)
    shift = smooth_noise(irregularity.seed, _POSITION, places.yarn, step)
    widening = smooth_noise(irregularity.seed, _WIDTH, places.yarn, step)
    amount = irregularity.amount
    return POSITION * amount * places.spacing * shift, WIDTH * amount * widening


def relative_brightness(irregularity: Irregularity, places: YarnPlaces) -> Floats:
    """Compute the relative brightness of yarns at some places, about 1."""
    whole = smooth_noise(irregularity.seed, _WHOLE, places.yarn, np.zeros_like(places.along))
    step = _steps_along(places)
    varying = smooth_noise(irregularity.seed, _ALONG, places.yarn, step)
    mixed = _OF_YARN * whole + (1.0 - _OF_YARN) * varying
    return np.asarray(1.0 + BRIGHTNESS * irregularity.amount * mixed)


def _steps_along(places: YarnPlaces) -> Floats:
    octave = np.rint(_STEPS * np.log2(_CORRELATION * places.crossed)) / _STEPS
    return np.asarray(places.along / 2.0**octave)


def smooth_noise(seed: int, channel: int, yarn: AnyInts, place: AnyFloats) -> Floats:
    """Compute noise from -1 to 1, C2; values at a distance of 4 are independent."""
    first = np.floor(place)
    knots = first[..., None].astype(np.int64) + np.arange(-1, 3)
    key = np.asarray(yarn)[..., None].astype(np.int64)
    values = _random(seed, channel, key, knots)
    t = place - first
    # The uniform cubic B-spline.
    weights = [(1.0 - t) ** 3, 3.0 * t**3 - 6.0 * t**2 + 4.0, 3.0 * t * (1.0 + t - t * t) + 1.0]
    return np.einsum("...k,...k->...", np.stack([*weights, t**3], axis=-1) / 6.0, values)


def _random(seed: int, channel: int, yarn: AnyInts, knot: AnyInts) -> Floats:
    """Return a number between -1 and 1 for each combination, by the mixing of SplitMix64."""
    # Source: G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators",
    # OOPSLA 2014.
    with np.errstate(over="ignore"):
        state = np.array(4 * seed + channel, np.uint64)
        for part in (yarn, knot):
            state = _mix(state + part.astype(np.uint64))
    return np.asarray((state >> np.uint64(11)).astype(np.float64) / 2**52 - 1.0)


def _mix(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    state = state + np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        state = (state ^ (state >> np.uint64(shift))) * np.uint64(factor)
    return state ^ (state >> np.uint64(31))
