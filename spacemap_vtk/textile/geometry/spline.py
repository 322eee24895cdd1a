"""Axes of yarns as cubic splines through the crossings: C2, so the curvature has no jumps.

Most textile geometry programs, such as TexGen, lay yarns like this. At each crossing yarns have
touching distance, but nowhere else is a distance guaranteed: compare
`spacemap_vtk.textile.geometry.yarn_clearance.least_clearance`.
"""

from __future__ import annotations

from math import inf

import numpy as np

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.geometry.axis_parts import Axes
from spacemap_vtk.textile.weave.threads import Yarns

#: Number of parts of an axis between two crossings. The tube's surface is a cubic along each part;
#: shorter parts miss the radius by less. The axis is exact for any number.
PARTS = 4
#: Nodes and weights of Gauss quadrature over [0, 1], for lengths.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


def build_spline_axes(own: Yarns, crossed: Yarns, height: Floats, overhang: float) -> Axes:
    """Build axes as splines z(y) that are horizontal at both ends."""
    knots = crossed.position
    if overhang > 0.0:
        height = np.pad(height, ((0, 0), (1, 1)), mode="edge")
        knots = np.concatenate([[knots[0] - overhang], knots, [knots[-1] + overhang]])
    # In units of the cloth, so that rounding does not depend on the size.
    unit = knots[-1] - knots[0]
    from scipy.interpolate import CubicSpline  # imported here: it takes a tenth of a second

    curve = CubicSpline(knots / unit, height.T / unit, bc_type="clamped")
    fraction = np.arange(PARTS) / PARTS
    stations = np.append((knots[:-1, None] + np.diff(knots)[:, None] * fraction).ravel(), knots[-1])
    step = np.diff(stations)
    slope, bend = curve(stations / unit, 1).T, curve(stations / unit, 2).T
    secant = np.sqrt(1.0 + slope**2)
    curvature = bend / secant**3 / unit
    within = stations[:-1, None] + step[:, None] * _NODES
    speed = np.sqrt(1.0 + curve(within / unit, 1) ** 2)
    count = len(height)
    return Axes(
        radius=0.5 * own.diameter,
        lateral=own.position,
        parts=np.full(count, len(step)),
        along=np.tile(stations, count),
        height=(curve(stations / unit).T * unit).ravel(),
        angle=np.arctan(slope).ravel(),
        length=(step * np.einsum("sgy,g->ys", speed, _WEIGHTS)).ravel(),
        curvature=np.stack([curvature[:, :-1].ravel(), curvature[:, 1:].ravel()]),
        reach=np.stack(
            [(step / 3.0 * secant[:, :-1]).ravel(), (step / 3.0 * secant[:, 1:]).ravel()]
        ),
        weight=np.ones(1),
        cubic=True,
    )


def offset_error(family: Axes) -> float:
    """Estimate by which share of the radius the cubics along a tube's top and bottom miss it."""
    part = np.arange(len(family.length))
    station = part + family.owner
    radius = family.radius[family.owner]
    if np.any(np.abs(family.curvature) * radius >= 1.0):
        return inf
    ends = []
    for end, inwards in ((0, 1.0), (1, -1.0)):
        angle = family.angle[station + end]
        tangent = np.stack([np.cos(angle), np.sin(angle)])
        normal = np.stack([-tangent[1], tangent[0]])
        place = np.stack([family.along[station + end], family.height[station + end]])
        ends.append((place, normal, inwards * family.reach[end] * tangent, family.curvature[end]))
    (a, na, ha, ka), (b, nb, hb, kb) = ends
    worst = 0.0
    for t in (0.25, 0.5, 0.75):
        w0, w1, w2, w3 = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
        for r in (radius, -radius):
            qa, qb = a + r * na, b + r * nb
            point = (
                (w0 + w1) * qa + w1 * (1 - r * ka) * ha + (w2 + w3) * qb + w2 * (1 - r * kb) * hb
            )
            nearest = np.full(len(part), t)
            for _ in range(4):
                along, height, angle = family.evaluate(part, station, nearest)
                ahead = (point[0] - along) * np.cos(angle) + (point[1] - height) * np.sin(angle)
                nearest = np.clip(nearest + ahead / family.length, 0.0, 1.0)
            along, height, _ = family.evaluate(part, station, nearest)
            distance = np.hypot(point[0] - along, point[1] - height)
            worst = max(worst, float(np.max(np.abs(distance / radius - 1.0))))
    return worst
