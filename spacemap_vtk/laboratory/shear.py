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
#: Newton steps for the length under pretension.
_STEPS = 30
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
        states=_shear_specimen(fabric),
    )


def shear_forces(fabric: Fabric, angles: Floats, axis: int = 1) -> Floats:
    """Compute the shear force of a specimen under pretension."""
    along = np.cos(angles)
    strain = np.zeros((len(angles), 3))
    stretch = np.ones_like(angles)
    # The stretch under pretension: S22 λ cos φ = W, by the secant method at all angles at once.
    before, last = np.zeros_like(angles), np.zeros_like(angles)
    for step in range(_STEPS):
        strain[:, axis] = (stretch**2 - 1.0) / 2
        strain[:, 2] = stretch * np.sin(angles)
        stress = fabric.stress(strain)
        miss = stress[:, axis] * stretch * along - PRETENSION
        if (abs(miss) < 1e-12 * PRETENSION).all():
            break
        if step == 0:
            slope = np.full_like(miss, fabric.plate.membrane[axis, axis])
        else:
            moved = stretch - before
            slope = np.where(moved, (miss - last) / np.where(moved, moved, 1.0), slope)
        before, last = stretch, miss
        stretch = stretch - miss / slope
    forces: Floats = PRETENSION * np.tan(angles) + stress[:, 2]
    return forces


def _shear_specimen(fabric: Fabric, count: int = 61) -> States:
    """Compute the states of a specimen whose warp reaches from clamp to clamp."""
    angles = LARGEST * np.sin(np.linspace(0.0, 2 * np.pi, count))
    return map_sheet(
        (WIDTH, LENGTH),
        fabric.thickness,
        (4, 4),
        [partial(_sheared, angle=np.radians(angle)) for angle in angles],
        [f"{angle:+.1f}°" for angle in angles],
    )


def _sheared(flat: Floats, angle: float) -> tuple[Floats, Floats]:
    places = np.zeros((len(flat), 3))
    along = flat[:, 1] - flat[:, 1].min()
    places[:, 0] = flat[:, 0] + along * np.sin(angle)
    places[:, 1] = flat[:, 1].min() + along * np.cos(angle)
    return places, np.broadcast_to([0.0, 0.0, 1.0], places.shape)
