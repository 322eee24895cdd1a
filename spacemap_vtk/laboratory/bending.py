"""Pure bending as by KES-FB2: moment against curvature.

The instrument bends a specimen between two clamps, 1 cm apart, along arcs of equal curvature up to
2.5 per cm to both sides. It prints the bending rigidity B, the mean slope between 0.5 and 1.5 per
cm, and the hysteresis 2HB, the width of the loop at 1 per cm.

The stiffness of the cloth is that of its sheet. Of cloth from yarns, B is the least value, of yarns
that bend along their whole length, unless yarns.bending_arcs says otherwise; B_rigid is the
largest, of yarns that stick to the yarns they cross.

2HB is not modelled: a published model of the loop takes its parameters from the measured loop
itself (T. J. Lahey, G. R. Heppler, doi:10.1115/1.1629757), so that it cannot predict it.

Source: S. Kawabata, "Standardization and Analysis of Hand Evaluation", 2nd ed., Textile Machinery
Society of Japan (1980).
"""

from __future__ import annotations

from functools import partial
from math import isfinite

import numpy as np

from spacemap_vtk.laboratory.fabric import DIRECTIONS, Fabric
from spacemap_vtk.laboratory.records import (
    GF_CM2_PER_CM,
    GF_CM_PER_CM,
    PER_CM,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    map_sheet,
    mark_exact,
)
from spacemap_vtk.mechanics.elements.plates import strip_stiffness
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.crimp.stiffness import bending_bounds

#: Largest curvature, and those between which the slope is measured [1/m].
LARGEST, SLOPE_FROM, SLOPE_TO = 250.0, 50.0, 150.0
#: Size of the specimen across and along the bent yarns [m].
WIDTH, LENGTH = 0.20, 0.01
_NO_HYSTERESIS = "it comes from fibres that slide in the yarns, whose friction is not known"


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Bend a specimen along the warp and one along the weft."""
    curvature = np.linspace(-LARGEST, LARGEST, 101)
    rigidities = dict(zip(("warp", "weft"), strip_stiffness(fabric.plate.bending), strict=True))
    bounds: dict[str, float] = {}
    if fabric.cloth is not None and fabric.yarns is not None and any(fabric.yarns.bending):
        rigid = bending_bounds(fabric.cloth, fabric.yarns).rigid
        bounds = dict(zip(("warp", "weft"), rigid, strict=True))
    readings, curves = [], []
    for name, _ in DIRECTIONS:
        moment = rigidities[name] * curvature
        curves.append(Curve(name, curvature, moment))
        readings += [
            Reading("B", "bending rigidity", name, mean_slope(curvature, moment), GF_CM2_PER_CM),
            *_bound_reading(name, bounds.get(name)),
            Reading("2HB", "hysteresis at 1/cm", name, None, GF_CM_PER_CM, note=_NO_HYSTERESIS),
        ]
    progress(1.0)
    return Measurement(
        mark_exact(readings),
        curves,
        Axis("curvature", PER_CM),
        Axis("moment per width", GF_CM_PER_CM),
        notes=[f"2HB is not modelled: {_NO_HYSTERESIS}"],
        states=_bend_specimen(fabric, rigidities["warp"]),
    )


def _bound_reading(name: str, rigidity: float | None) -> list[Reading]:
    """Return the rigidity if crossings stick, where it is known and finite."""
    if rigidity is None or not isfinite(rigidity):
        return []
    return [Reading("B_rigid", "if crossings stick", name, rigidity, GF_CM2_PER_CM)]


def mean_slope(curvature: Floats, moment: Floats) -> float:
    """Compute the slope that the instrument prints, the mean of both sides."""
    ends = np.interp([-SLOPE_TO, -SLOPE_FROM, SLOPE_FROM, SLOPE_TO], curvature, moment)
    return float((ends[1] - ends[0] + ends[3] - ends[2]) / (2 * (SLOPE_TO - SLOPE_FROM)))


def _bend_specimen(fabric: Fabric, rigidity: float, count: int = 61) -> States:
    """Compute the states of a specimen whose warp is bent: up, down, and back."""
    strokes = LARGEST * np.sin(np.linspace(0.0, 2 * np.pi, count))
    return map_sheet(
        (LENGTH, LENGTH),  # a twentieth of its width
        fabric.thickness,
        (4, 24),
        [partial(_arc, curvature=curvature) for curvature in strokes],
        np.stack([strokes, rigidity * strokes], axis=1),
    )


def _arc(flat: Floats, curvature: float) -> tuple[Floats, Floats]:
    """Bend the mid-surface along y to an arc; its end at -y stays where it is."""
    x, along = flat.T
    start = along.min()
    angle = curvature * (along - start)
    # sin(a)/a and (1 - cos(a))/a, which need no division by a curvature of zero
    half = np.sinc(angle / 2 / np.pi)
    run = (along - start) * np.sinc(angle / np.pi)
    rise = (along - start) * half * np.sin(angle / 2)
    zero = np.zeros_like(x)
    # Turned so that the camera sees the arc from the side.
    places = np.stack([start + run, -x, rise], axis=1)
    return places, np.stack([-np.sin(angle), zero, np.cos(angle)], axis=1)
