"""Compression as by KES-FB3: pressure against thickness.

A disc of 2 cm² presses the cloth on a plate, from 0.5 to 50 gf/cm² and back. T0 and Tm are the
thicknesses at these pressures, WC = ∫ P dT is the work, and LC = 2 WC/(P_m (T0 - Tm)) the
linearity. The recovery RC is below 100 % by what fibres lose, which is not modelled.

The pressure is carried by the crossings, each of which has the area of one cell, p1 p2, by the law
of contact of the yarns (`spacemap_vtk.textile.crimp.contact_law`): at D/D0 = x its force is
-2 k u'(x). The yarns flatten towards the plates as they do towards each other, so that the cloth
loses D0 - D. The crowns of warp and weft are taken to be level; where they are not, the higher ones
are pressed first, and the cloth begins softer.

Source: S. Kawabata, "Standardization and Analysis of Hand Evaluation", 2nd ed., Textile Machinery
Society of Japan (1980).
"""

from __future__ import annotations

from functools import partial
from math import isfinite

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.laboratory.records import (
    GF_CM_PER_CM2,
    GF_PER_CM2,
    MILLIMETRE,
    PERCENT,
    PURE,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    map_sheet,
    mark_exact,
)
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.crimp.interchange import YarnMechanics

#: First and largest pressure [Pa].
FIRST, LARGEST = 0.5 * GF_PER_CM2.size, 50.0 * GF_PER_CM2.size
#: Points of the curve, and steps of the search for D.
_POINTS, _BISECTIONS = 201, 60
#: Yarns along the sides of the part that a film shows, and number of its states, there and back.
_PART, _STATES = 8, 41
_NO_LOSS = "what fibres lose when they are pressed is not known"


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Press the cloth."""
    if fabric.cloth is None or fabric.yarns is None:
        raise InputError(
            "compression needs cloth whose yarns are known",
            cure="Give the stiffness of the yarns in [yarns], with a law of their contact",
        )
    yarns = fabric.yarns
    if not (yarns.flattest < 1.0 and yarns.contact > 0.0 and isfinite(yarns.contact)):
        raise InputError(
            "compression needs a law of contact, by which yarns flatten at crossings",
            key="contact",
            cure="Give yarns.contact, yarns.van_wyk or yarns.contact_curve, and leave out "
            "yarns.flattest = 1",
        )
    spacings = [family.spacing for family in fabric.cloth.families]
    pressure = np.linspace(FIRST, LARGEST, _POINTS)
    share = flatten(yarns, pressure * spacings[0] * spacings[1])
    rest = float(fabric.cloth.diameter_sum)
    thickness = fabric.thickness - rest * (1.0 - share)
    lost = thickness[0] - thickness
    work = float(((pressure[1:] + pressure[:-1]) / 2 * np.diff(lost)).sum())
    linearity = 2 * work / (LARGEST * float(lost[-1]))
    progress(1.0)
    notes = [f"RC is not modelled: {_NO_LOSS}"]
    if share[-1] <= yarns.flattest:
        notes.append("the crossings reach their least thickness, yarns.flattest")
    return Measurement(
        mark_exact(
            [
                Reading("T0", "thickness at 0.5 gf/cm²", "", float(thickness[0]), MILLIMETRE),
                Reading("Tm", "thickness at 50 gf/cm²", "", float(thickness[-1]), MILLIMETRE),
                Reading("LC", "linearity", "", linearity, PURE),
                Reading("WC", "work", "", work, GF_CM_PER_CM2),
                Reading("RC", "resilience", "", None, PERCENT, note=_NO_LOSS),
            ]
        ),
        [Curve("loading", thickness, pressure)],
        Axis("thickness", MILLIMETRE),
        Axis("pressure", GF_PER_CM2),
        notes,
        states=_press_part(fabric, thickness, pressure),
    )


def _press_part(fabric: Fabric, thickness: Floats, pressure: Floats) -> States:
    """Compute the states of a part of the cloth, which lies on the plate z = 0."""
    assert fabric.cloth is not None
    phase = np.linspace(0.0, 2.0, _STATES)
    which = np.round((len(thickness) - 1) * (1.0 - abs(phase - 1.0))).astype(int)
    warp, weft = (_PART * family.spacing for family in fabric.cloth.families)
    return map_sheet(
        (warp, weft),
        fabric.thickness,
        (2, 2),
        [partial(_pressed, thickness=t, rest=fabric.thickness) for t in thickness[which]],
        np.stack([thickness, pressure], axis=1)[which],
    )


def _pressed(flat: Floats, thickness: float, rest: float) -> tuple[Floats, Floats]:
    places = np.concatenate([flat, np.full((len(flat), 1), thickness / 2)], axis=1)
    return places, np.broadcast_to([0.0, 0.0, thickness / rest], places.shape)


def flatten(yarns: YarnMechanics, force: Floats) -> Floats:
    """Compute D/D0 of crossings under forces [N], at least the least one."""
    low, high = np.full_like(force, yarns.flattest), np.ones_like(force)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        firm = -2.0 * yarns.contact * yarns.law.evaluate(middle)[1] > force
        low, high = np.where(firm, middle, low), np.where(firm, high, middle)
    return np.asarray((low + high) / 2)
