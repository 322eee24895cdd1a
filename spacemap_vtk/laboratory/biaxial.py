"""Biaxial tension as by KES-G2: force per width against extension, in a uniform state.

A square is pulled along warp and weft by equal stretches ("1:1"), or along one of them while the
other keeps its width, to 500 gf/cm. In a uniform state the force per width of cloth at rest along a
direction is F = S λ, with the stretch λ and the second Piola-Kirchhoff stress S. The figures are
those of KES for tension: EMT is the extension at the largest force F_m, WT = ∫ F dε the work, and
LT = 2 WT/(F_m EMT) the linearity; a linear law has LT = 1, apart from the square of the extension.

Sources: S. Kawabata, M. Niwa, H. Kawai, "The Finite-deformation Theory of Plain-weave Fabrics", J.
Textile Inst. 64 (1973) 21, for the test; S. Kawabata,
"Standardization and Analysis of Hand Evaluation", 2nd ed. (1980), for the figures.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.laboratory.fabric import DIRECTIONS, Fabric
from spacemap_vtk.laboratory.records import (
    GF_CM_PER_CM2,
    GF_PER_CM,
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

#: Force per width at which the test ends [N/m]: 500 gf/cm.
LARGEST = 500.0 * GF_PER_CM.size
#: Side of the part of the square that a film shows [m]; its state is uniform.
SIDE = 0.015
#: Points of a curve.
_POINTS = 201
_NO_LOSS = "the law is elastic; what friction takes in unloading is not known"
#: Stretch up to which the largest force is sought.
_MOST = 2.0


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Pull a square along both directions, and along each with the other held."""
    readings, curves = [], []
    paths = {"1:1": np.array([1.0, 1.0]), "warp": np.array([0.0, 1.0]), "weft": np.array([1.0, 0])}
    for number, (path, way) in enumerate(paths.items()):
        end = find_end(fabric, way)
        steps = np.linspace(0.0, end, _POINTS)
        force = nominal_forces(fabric, 1.0 + steps[:, None] * way)
        for name, axis in DIRECTIONS:
            if not way[axis]:
                continue
            direction = f"{name}, 1:1" if path == "1:1" else f"{name}, held"
            curves.append(Curve(direction, steps, force[:, axis]))
            readings += tensile_readings(direction, steps, force[:, axis])
        progress((number + 1) / len(paths))
    return Measurement(
        mark_exact(readings),
        curves,
        Axis("extension", PERCENT),
        Axis("force per width", GF_PER_CM),
        notes=[f"RT is not modelled: {_NO_LOSS}"],
        states=_pull_square(fabric, curves[0]),
    )


def nominal_forces(fabric: Fabric, stretch: Floats) -> Floats:
    """Compute forces per width of cloth at rest in uniform states without shear."""
    strain = np.zeros((len(stretch), 3))
    strain[:, :2] = (stretch**2 - 1.0) / 2
    forces: Floats = fabric.stress(strain)[:, :2] * stretch
    return forces


def find_end(fabric: Fabric, way: Floats) -> float:
    """Find the extension at which the larger force per width reaches 500 gf/cm."""
    from scipy.optimize import brentq

    def miss(extension: float) -> float:
        pulled = nominal_forces(fabric, 1.0 + extension * way[None])[0]
        return float(pulled[way > 0].max()) - LARGEST

    extension = 1e-3
    while miss(extension) < 0.0:
        extension *= 1.5
        if extension > _MOST - 1.0:
            raise InputError(
                "the cloth stretches by more than 100 % before its force reaches 500 gf/cm",
                cure="Give the yarns a larger tension or modulus, in [yarns] or [textile]",
            )
    return float(brentq(miss, 0.0, extension, xtol=1e-12))


def tensile_readings(direction: str, extension: Floats, force: Floats) -> list[Reading]:
    """Compute the figures of a tensile test."""
    work = float(((force[1:] + force[:-1]) / 2 * np.diff(extension)).sum())
    linearity = 2 * work / float(force[-1] * extension[-1])
    return [
        Reading("EMT", "extension", direction, extension[-1], PERCENT),
        Reading("LT", "linearity", direction, linearity, PURE),
        Reading("WT", "work", direction, work, GF_CM_PER_CM2),
        Reading("RT", "resilience", direction, None, PERCENT, note=_NO_LOSS),
    ]


def _pull_square(fabric: Fabric, curve: Curve, count: int = 41) -> States:
    """Compute the states of the square that is pulled along both directions."""
    steps = curve.x[-1] * np.linspace(0.0, 1.0, count)
    return map_sheet(
        (SIDE, SIDE),
        fabric.thickness,
        (4, 4),
        [partial(_stretched, by=by) for by in steps],
        np.stack([steps, np.interp(steps, curve.x, curve.y)], axis=1),
        "front",
    )


def _stretched(flat: Floats, by: float) -> tuple[Floats, Floats]:
    places = np.zeros((len(flat), 3))
    places[:, :2] = (1.0 + by) * flat
    return places, np.broadcast_to([0.0, 0.0, 1.0], places.shape)
