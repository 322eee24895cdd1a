"""Shear as by KES-FB1: shear force per width against the angle, under a constant pretension.

One clamp moves sideways until the yarns between the clamps are turned by φ = ±8°, while a weight
keeps W = 10 gf/cm on them. A clamped side keeps its width, and the other yarns reach from clamp to
clamp: a state of uniform strain. With the place (u, v) of the end of a yarn of unit length,

    e11 = 0,  e22 = (u² + v² - 1)/2,  2 e12 = u,  S22 v = W,  F = W tan φ + S12.

So a pretension adds W tan φ to the force of the cloth, exactly. The instrument prints the slope G
between 0.5° and 2.5°, and the width of the loop at 0.5° and 5°, 2HG and 2HG5.

Friction of crossings acts beside the elastic law. A crossing that is pressed by V and touches over
the radius a resists its twist by k = V D/2 until it slips at the moment M_f = (2/3) µ V a, so that
2HG = 2 M_f/(p1 p2) once it has slipped. V is the contact force under the pretension, which presses
the arcs of the yarns: 2 T (2 theta - sin theta) of yarns without bending stiffness. As for Hertz's
contact of crossed cylinders, a² = D (D0 - D)/8; crossings that do not flatten touch in a point.

Source: S. Kawabata, "Standardization and Analysis of Hand Evaluation", 2nd ed., Textile Machinery
Society of Japan (1980).
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.laboratory.fabric import DIRECTIONS, Fabric
from spacemap_vtk.laboratory.records import (
    DEGREE,
    GF_PER_CM,
    GF_PER_CM_DEGREE,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    map_sheet,
    mark_exact,
)
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.crimp.interchange import Interchange

#: Pretension W [N/m]: 10 gf/cm.
PRETENSION = 10.0 * GF_PER_CM.size
#: Largest angle, those between which the slope is measured, and those of 2HG and 2HG5 [°].
LARGEST, SLOPE_FROM, SLOPE_TO, HYSTERESIS, HYSTERESIS_5 = 8.0, 0.5, 2.5, 0.5, 5.0
#: Size of the specimen across and along the pretension [m].
WIDTH, LENGTH = 0.20, 0.05
#: Side of the part that a film shows [m]; its state is uniform.
PART = 0.015
#: First and largest stretch at which the pretension is sought, and steps that bisect its range.
_FIRST, _LARGEST_STRETCH, _BISECTIONS = 1e-3, 2.0, 45
_NO_FRICTION = "the friction of crossings is not given (yarns.friction)"
_NO_CONTACT = "crossings that do not flatten touch in a point (yarns.contact)"


class CrossingFriction(NamedTuple):
    """Friction of crossings in shear, per area of cloth."""

    limit: float
    """M_f/(p1 p2), the stress at which crossings slip [N/m]."""
    stiffness: float = 0.0
    """k/(p1 p2), stress over angle before they slip [N/m]."""
    missing: str = ""
    """Why there is no hysteresis; empty if there is."""

    def loop(self, turns: Floats) -> Floats:
        """Compute the stress when the cloth is turned there and back, (2, n) [N/m]."""
        if not self.limit:
            return np.zeros((2, len(turns)))
        there = np.minimum(self.limit, self.stiffness * (turns - turns[0]) - self.limit)
        back = np.maximum(-self.limit, self.limit - self.stiffness * (turns[-1] - turns))
        return np.stack([there, back])


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Shear a specimen along the warp and one along the weft."""
    angles = np.linspace(-LARGEST, LARGEST, 161)
    readings, curves = [], []
    for name, axis in DIRECTIONS:
        turns = np.radians(angles)
        elastic = shear_forces(fabric, turns, axis)
        friction = crossing_friction(fabric, axis)
        loading, unloading = elastic + friction.loop(turns)
        force = loading
        curves.append(Curve(name, *_join(turns, loading, unloading, friction.limit > 0.0)))
        ends = np.interp([-SLOPE_TO, -SLOPE_FROM, SLOPE_FROM, SLOPE_TO], angles, force)
        slope = (ends[1] - ends[0] + ends[3] - ends[2]) / 2
        slope /= np.radians(SLOPE_TO - SLOPE_FROM)
        readings += [
            Reading("G", "shear rigidity", name, float(slope), GF_PER_CM_DEGREE),
        ]
        for symbol, at in (("2HG", HYSTERESIS), ("2HG5", HYSTERESIS_5)):
            width = np.interp([-at, at], angles, loading - unloading).mean()
            value = None if friction.missing else float(width)
            what = f"hysteresis at {at:g}°"
            readings.append(Reading(symbol, what, name, value, GF_PER_CM, note=friction.missing))
    progress(1.0)
    missing = crossing_friction(fabric, 1).missing
    share = PRETENSION / GF_PER_CM_DEGREE.size
    return Measurement(
        mark_exact(readings),
        curves,
        Axis("shear angle", DEGREE),
        Axis("shear force per width", GF_PER_CM),
        notes=[
            f"G includes {share:.3f} gf/(cm·°) of the pretension of 10 gf/cm",
            *([f"2HG and 2HG5 are not modelled: {missing}"] if missing else []),
        ],
        states=_shear_specimen(fabric, curves[0]),
    )


def shear_forces(fabric: Fabric, angles: Floats, axis: int = 1) -> Floats:
    """Compute the shear force of a specimen under pretension, without friction."""
    strain = _upper_ends(fabric, angles, axis)
    forces: Floats = PRETENSION * np.tan(angles) + fabric.stress(strain)[:, 2]
    return forces


def _upper_ends(fabric: Fabric, angles: Floats, axis: int) -> Floats:
    """Compute the strain at which the pretension is balanced at each angle, (n, 3)."""
    strain = np.zeros((len(angles), 3))

    def tension(stretch: Floats) -> Floats:
        strain[:, axis] = (stretch**2 - 1.0) / 2
        strain[:, 2] = stretch * np.sin(angles)
        return fabric.stress(strain)[:, axis] * stretch * np.cos(angles)

    # The stretch under pretension: S22 v = W.
    low, high = np.ones_like(angles), np.full_like(angles, 1.0 + _FIRST)
    while (slack := tension(high) < PRETENSION).any():
        low, high = np.where(slack, high, low), np.where(slack, 2.0 * high - 1.0, high)
        if high.max() > _LARGEST_STRETCH:
            raise InputError(
                "the cloth stretches by more than 100 % under the pretension of 10 gf/cm",
                cure="Give the yarns a larger tension or modulus, in [yarns] or [textile]",
            )
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        slack = tension(middle) < PRETENSION
        low, high = np.where(slack, middle, low), np.where(slack, high, middle)
    tension(high)
    return strain


def crossing_friction(fabric: Fabric, axis: int) -> CrossingFriction:
    """Compute the friction of a cloth's crossings under pretension along an axis."""
    if fabric.cloth is None or fabric.yarns is None or fabric.friction is None:
        return CrossingFriction(0.0, missing=_NO_FRICTION)
    cloth = fabric.cloth
    stretch = np.ones(2)
    stretch[1 - axis] = 1.0 + _pretension_stretch(fabric, axis)  # warp and weft, axes 2 and 1
    state = Interchange(cloth, fabric.yarns).solve(
        np.broadcast_to(stretch[:, None, None], (2, *cloth.drawdown.shape))
    )
    area = cloth.families[0].spacing * cloth.families[1].spacing
    rest = float(cloth.diameter_sum)
    radius = np.sqrt(state.distance * np.maximum(rest - state.distance, 0.0) / 8)
    if not radius.any():
        return CrossingFriction(0.0, missing=_NO_CONTACT)
    moment = float((2 / 3 * fabric.friction * state.contact * radius).mean())
    mean = float((state.contact * state.distance / 2).mean())
    return CrossingFriction(moment / area, mean / area)


def _pretension_stretch(fabric: Fabric, axis: int) -> float:
    """Compute the extension under the pretension, without shear."""
    place = _upper_ends(fabric, np.zeros(1), axis)
    return float(np.sqrt(1.0 + 2.0 * place[0, axis])) - 1.0


def _join(x: Floats, there: Floats, back: Floats, is_loop: bool) -> tuple[Floats, Floats]:
    """Join both ways of a loop to a curve; without a loop, return one way."""
    if not is_loop:
        return x, there
    return np.concatenate([x, x[::-1]]), np.concatenate([there, back[::-1]])


def _shear_specimen(fabric: Fabric, curve: Curve, count: int = 61) -> States:
    """Compute the states of a specimen whose warp reaches from clamp to clamp."""
    phase = np.linspace(0.0, 2 * np.pi, count)
    angles, rises = np.radians(LARGEST) * np.sin(phase), np.cos(phase) >= 0.0
    half = (len(curve.x) + 1) // 2 if curve.x[-1] < 0.0 else len(curve.x)
    there = np.interp(angles, curve.x[:half], curve.y[:half])
    back = np.interp(angles, curve.x[: -half - 1 : -1], curve.y[: -half - 1 : -1])
    back = there if half == len(curve.x) else back
    return map_sheet(
        (PART, PART),
        fabric.thickness,
        (4, 4),
        [partial(_sheared, angle=angle) for angle in angles],
        np.stack([angles, np.where(rises, there, back)], axis=1),
        "front",
    )


def _sheared(flat: Floats, angle: float) -> tuple[Floats, Floats]:
    places = np.zeros((len(flat), 3))
    along = flat[:, 1] - flat[:, 1].min()
    places[:, 0] = flat[:, 0] + along * np.sin(angle)
    places[:, 1] = flat[:, 1].min() + along * np.cos(angle)
    return places, np.broadcast_to([0.0, 0.0, 1.0], places.shape)
