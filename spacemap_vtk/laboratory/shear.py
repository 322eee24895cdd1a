"""Shear as by KES-FB1: shear force per width against the angle, under a constant pretension.

One clamp moves sideways until the yarns between the clamps are turned by φ = ±8°, while a weight
keeps W = 10 gf/cm on them. A clamped side keeps its width, and the other yarns reach from clamp to
clamp: a state of uniform strain. With the place (u, v) of the end of a yarn of unit length,

    e11 = 0,  e22 = (u² + v² - 1)/2,  2 e12 = u,  S22 v = W,  F = W tan φ + S12.

So a pretension adds W tan φ to the force of the cloth, exactly. The instrument prints the slope G
between 0.5° and 2.5°, and the width of the loop at 0.5° and 5°, 2HG and 2HG5.

Source: S. Kawabata, "Standardization and Analysis of Hand Evaluation", 2nd ed., Textile Machinery
Society of Japan (1980).
"""

from __future__ import annotations

from functools import partial

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
)
from spacemap_vtk.ndarrays import Floats, Progress

#: Pretension W [N/m]: 10 gf/cm.
PRETENSION = 10.0 * GF_PER_CM.size
#: Largest angle, those between which the slope is measured, and those of 2HG and 2HG5 [°].
LARGEST, SLOPE_FROM, SLOPE_TO, HYSTERESIS, HYSTERESIS_5 = 8.0, 0.5, 2.5, 0.5, 5.0
#: Size of the specimen across and along the pretension [m].
WIDTH, LENGTH = 0.20, 0.05
#: First and largest stretch at which the pretension is sought, and steps that bisect its range.
_FIRST, _LARGEST_STRETCH, _BISECTIONS = 1e-3, 2.0, 45
_NO_HYSTERESIS = "the friction of crossings is not given"


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Shear a specimen along the warp and one along the weft."""
    angles = np.linspace(-LARGEST, LARGEST, 161)
    readings, curves = [], []
    for name, axis in DIRECTIONS:
        force = shear_forces(fabric, np.radians(angles), axis)
        curves.append(Curve(name, np.radians(angles), force))
        ends = np.interp([-SLOPE_TO, -SLOPE_FROM, SLOPE_FROM, SLOPE_TO], angles, force)
        slope = (ends[1] - ends[0] + ends[3] - ends[2]) / 2
        slope /= np.radians(SLOPE_TO - SLOPE_FROM)
        readings += [
            Reading("G", "shear rigidity", name, float(slope), GF_PER_CM_DEGREE),
            Reading("2HG", "hysteresis at 0.5°", name, None, GF_PER_CM, note=_NO_HYSTERESIS),
            Reading("2HG5", "hysteresis at 5°", name, None, GF_PER_CM, note=_NO_HYSTERESIS),
        ]
    progress(1.0)
    share = PRETENSION / GF_PER_CM_DEGREE.size
    return Measurement(
        readings,
        curves,
        Axis("shear angle", DEGREE),
        Axis("shear force per width", GF_PER_CM),
        notes=[
            f"G includes {share:.3f} gf/(cm·°) of the pretension of 10 gf/cm",
            f"2HG and 2HG5 are not modelled: {_NO_HYSTERESIS}",
        ],
        states=_shear_specimen(fabric, curves[0]),
    )


def shear_forces(fabric: Fabric, angles: Floats, axis: int = 1) -> Floats:
    """Compute the shear force of a specimen under pretension."""
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
                cure="Give the yarns a larger tension or modulus in [yarns]",
            )
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        slack = tension(middle) < PRETENSION
        low, high = np.where(slack, middle, low), np.where(slack, high, middle)
    tension(high)
    forces: Floats = PRETENSION * np.tan(angles) + fabric.stress(strain)[:, 2]
    return forces


def _shear_specimen(fabric: Fabric, curve: Curve, count: int = 61) -> States:
    """Compute the states of a specimen whose warp reaches from clamp to clamp."""
    angles = np.radians(LARGEST) * np.sin(np.linspace(0.0, 2 * np.pi, count))
    return map_sheet(
        (0.4 * LENGTH, LENGTH),  # a tenth of its width
        fabric.thickness,
        (4, 4),
        [partial(_sheared, angle=angle) for angle in angles],
        np.stack([angles, np.interp(angles, curve.x, curve.y)], axis=1),
        "front",
    )


def _sheared(flat: Floats, angle: float) -> tuple[Floats, Floats]:
    places = np.zeros((len(flat), 3))
    along = flat[:, 1] - flat[:, 1].min()
    places[:, 0] = flat[:, 0] + along * np.sin(angle)
    places[:, 1] = flat[:, 1].min() + along * np.cos(angle)
    return places, np.broadcast_to([0.0, 0.0, 1.0], places.shape)
