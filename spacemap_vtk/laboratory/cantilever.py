"""Cantilever test: a strip that bends over an edge by its own weight.

The strip is pushed over the edge of a level table until the line from the edge to its tip slopes by
41.5°. Half of the overhang is Peirce's bending length c, and B = w c³ with the weight w of a unit
area. Here the strip is an elastica: with the slope θ and the distance τ from the tip in units of
(B/w)^(1/3),

    θ'' = -τ cos θ,  θ'(0) = 0 at the tip,  θ = 0 at the edge.

The chord has 41.5° at an overhang of 2.00035 (B/w)^(1/3), so that the instruments' rule reads B too
high by 0.05 %. Peirce's own formula for any angle of the chord is `peirce_length`.

Sources: F. T. Peirce, "The handle of cloth as a measurable quantity", J. Textile Inst. 21 (1930)
T377; ASTM D1388, option A; N. G. Ly, D. H. Tester, P. Buckenham, A. F. Roczniok, A. L. Adriaansen,
F. Scaysbrook, S. De Jong, "Simple instruments for quality control by finishers and tailors", Int.
J. Clothing Sci. Tech. 3 (1991) 14, for FAST-2.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from spacemap_vtk.laboratory.fabric import DIRECTIONS, Fabric
from spacemap_vtk.laboratory.records import (
    DEGREE,
    MICRONEWTON_METRE,
    MILLIMETRE,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    map_sheet,
    mark_exact,
)
from spacemap_vtk.mechanics.elements.plates import bending_length, strip_stiffness
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.units import GRAVITY

#: Slope of the chord at which the overhang is read [rad].
CHORD = float(np.radians(41.5))
#: Width of the strip, and the part of it that stays on the table at the end [m].
WIDTH, LYING = 0.025, 0.04
#: Slopes of the tip in the states of the test, as shares of the last one. The overhang grows with
#: the cube root of the slope at first.
_SHARES = np.linspace(0.0, 1.0, 31) ** 3
#: Tolerances of the elastica.
_TOLERANCE = 1e-11


class Elastica(NamedTuple):
    """A strip that hangs over an edge; lengths in units of (B/w)^(1/3)."""

    length: float
    """Length of the overhang."""
    chord: float
    """Slope of the line from the edge to the tip [rad]."""
    arc: Floats
    """(n,) Distance from the edge along the strip."""
    places: Floats
    """(n, 2) Distance from the edge, and depth below it."""
    slope: Floats
    """(n,) Slope θ, downwards [rad]."""


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Let a strip along the warp and one along the weft bend over an edge."""
    mass = fabric.require_areal_mass()
    rigidities = dict(zip(("warp", "weft"), strip_stiffness(fabric.plate.bending), strict=True))
    last = find_strip(CHORD)
    strips = [*(hang_strip(tip) for tip in last.slope[-1] * _SHARES[1:-1]), last]
    progress(0.9)
    readings, curves, measured = [], [], []
    for name, _ in DIRECTIONS:
        unit = bending_length(rigidities[name], mass)
        length = strips[-1].length * unit / 2
        measured.append(mass * GRAVITY * length**3)
        readings += [
            Reading("c", "bending length", name, length, MILLIMETRE),
            Reading("B", "bending rigidity, w c³", name, measured[-1], MICRONEWTON_METRE),
        ]
        overhang = np.array([0.0, *(strip.length * unit for strip in strips)])
        curves.append(Curve(name, overhang, np.array([0.0, *(strip.chord for strip in strips)])))
    overall = float(np.sqrt(measured[0] * measured[1]))
    readings.append(Reading("B", "bending rigidity, w c³", "overall", overall, MICRONEWTON_METRE))
    states = _push_strip(fabric, bending_length(rigidities["warp"], mass), strips)
    progress(1.0)
    return Measurement(
        mark_exact(readings),
        curves,
        Axis("overhang", MILLIMETRE),
        Axis("slope of the chord", DEGREE),
        notes=[
            f"the rule of the instrument, half of the overhang at 41.5°, reads B too high by "
            f"{(strips[-1].length / 2) ** 3 - 1:.2%} for a strip of this constant B"
        ],
        states=states,
    )


@lru_cache(maxsize=8)
def find_strip(chord: float) -> Elastica:
    """Find the strip whose chord has a given slope."""
    from scipy.optimize import brentq

    def miss(tip: float) -> float:
        return hang_strip(tip).chord - chord

    # A chord slopes by less than the tip, and by more than half of it.
    return hang_strip(brentq(miss, chord, min(2.0 * chord, 1.57), xtol=1e-12))


def hang_strip(tip: float) -> Elastica:
    """Compute the strip whose tip has a given slope."""
    from scipy.integrate import solve_ivp

    def derivatives(tau: float, state: Floats) -> list[float]:
        slope, bend, *_ = state
        return [bend, -tau * np.cos(slope), np.cos(slope), np.sin(slope)]

    def is_at_edge(tau: float, state: Floats) -> float:
        return float(state[0])

    is_at_edge.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        derivatives,
        (0.0, 50.0),
        [tip, 0.0, 0.0, 0.0],
        method="DOP853",
        rtol=_TOLERANCE,
        atol=_TOLERANCE,
        events=is_at_edge,
        dense_output=True,
    )
    length = float(found.t_events[0][0])
    arc = np.linspace(0.0, length, 101)
    slope, _, run, fall = found.sol(length - arc)
    places = np.stack([run[0] - run, fall[0] - fall], axis=1)
    return Elastica(length, float(np.arctan2(*places[-1, ::-1])), arc, places, slope)


def peirce_length(overhang: float, chord: float) -> float:
    """Compute the bending length by Peirce's formula."""
    return float(overhang * np.cbrt(np.cos(chord / 2) / (8 * np.tan(chord))))


def _push_strip(fabric: Fabric, unit: float, strips: list[Elastica]) -> States:
    """Compute the states of a strip of warp that is pushed over the edge at x = 0."""
    longest = strips[-1].length * unit
    size = (WIDTH, LYING + longest)
    return map_sheet(
        size,
        fabric.thickness,
        (3, max(20, round(size[1] / (unit / 10)))),
        [partial(_hanging, unit=unit, strip=strip) for strip in (None, *strips)],
        np.array([(0.0, 0.0), *((strip.length * unit, strip.chord) for strip in strips)]),
    )


def _hanging(flat: Floats, unit: float, strip: Elastica | None) -> tuple[Floats, Floats]:
    """Lay a strip on the table, y < 0, so that its overhang is that of an elastica."""
    x, along = flat.T
    overhang = 0.0 if strip is None else strip.length * unit
    arc = along - along.max() + overhang
    slope, run, fall = np.zeros_like(arc), np.minimum(arc, 0.0), np.zeros_like(arc)
    if strip is not None:
        over = np.maximum(arc, 0.0)
        slope = np.interp(over, unit * strip.arc, strip.slope)
        run = run + np.interp(over, unit * strip.arc, unit * strip.places[:, 0])
        fall = np.interp(over, unit * strip.arc, unit * strip.places[:, 1])
    # Turned so that the camera sees the strip from the side.
    places = np.stack([run, -x, -fall], axis=1)
    return places, np.stack([np.sin(slope), np.zeros_like(x), np.cos(slope)], axis=1)
