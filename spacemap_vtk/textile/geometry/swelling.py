"""Swelling of lenticular yarns in floats, where only one side touches other yarns.

In a float a yarn is free on its outer side. There its section swells: the outer side rises and
becomes rounder, and the section becomes wider along the circle on which it touches other yarns, so
that neighbouring floats close up. On that circle nothing overlaps (see
`spacemap_vtk.textile.weave.lens`), as long as the yarns are no wider than their spacing. A pattern
weft is wider: it covers the tabby beside it (`spacemap_vtk.textile.weave.pattern_sections`).

Swelling is described by a share s from 0 (a lens) to 1. It is 0 where the arc begins that leads
into a float, and 1 in the middle of the float; it is negative where the outer side is below.

On that arc the outer side leaves the yarn that is crossed before the float, whose arc of contact
has the radius R. Let s' be the length of the straight part before the arc, r the distance of the
lens' outer side from the centre of the arc, phi the angle along it, and u how far the outer side
has risen. It stays outside of that yarn if

    (r sin phi + s')**2 + (R - u + r (1 - cos phi))**2 >= R**2

for which it is enough that

    u <= (r sin phi + s')**2 / (2 R) + r (1 - cos phi)                                      (1)

At a fraction t of the arc's length along the cloth, the right side is at least t**2 times its value
for sin phi = sin theta and 1 - cos phi = sin(theta)**2 / 2, theta being the angle of the whole arc.
So a share of at most q t**2 never meets the other yarn, with a number q that depends on the shape
of the gap alone.
"""

from __future__ import annotations

from math import asin, atan
from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.geometry.axis_parts import Axes
from spacemap_vtk.textile.patches.bezier import rational_handles
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.lens import edge_angle, face_radius

#: Largest width over that of the lens, unless the widths of floats are given.
_WIDEST = 1.15
#: Largest width as a share of the spacing.
_FILLED = 0.985
#: Largest rise of the outer side, as a share of the height.
RISE = 0.35
#: Share of a half ellipse in the outer side; the rest is an arc.
_ROUND = 0.8
#: Least height of the outer side over the edges of a wide float, over half the lens' height.
_CROWN = 0.4
#: Half the largest width over the radius of the circle of contact; beyond, edges would be steep.
_STEEPEST = 0.97
#: How far full swelling moves the outer side at most, over the height of the lens.
_FULL_RISE = 0.46


class Growth(NamedTuple):
    """How fast and how far floats swell."""

    rise: float = 2.0
    """Largest number q, see the top of this module."""
    short: float = 1.0
    """Largest share in floats of two crossings."""


USUAL_GROWTH = Growth()
#: Growth of floats of a pattern weft, which cover the tabby beside them. They widen much more than
#: other floats and need a longer way for it, which short floats do not have.
_PATTERN_GROWTH = Growth(rise=0.7, short=0.5)


def float_growth(cloth: Cloth, number: int) -> Growth:
    """Return how fast and how far floats of ends (0) or picks (1) swell."""
    return USUAL_GROWTH if cloth.threads[number].float_width is None else _PATTERN_GROWTH


class FloatEnds(NamedTuple):
    """Arcs at one end of each gap, (yarns, gaps), on which floats may begin to swell."""

    length: Floats
    """Length along the cloth, in metres."""
    rise: Floats
    """Largest share at a fraction t of that length, over t squared."""


def measure_float_ends(
    near: Floats, far: Floats, straight: Floats, theta: Floats, height: Floats, rise: float
) -> FloatEnds:
    """Measure the arcs into floats, and how soon floats may swell on them, by (1)."""
    # `near` and `far` are the radii of the axis on this arc and on that at the other end of the
    # gap, `straight` is the length of the straight part between them, `height` the lens' height,
    # `rise` the largest q.
    sine, outer, face = np.sin(theta), near + 0.5 * height, far - 0.5 * height
    room = (outer * sine + straight) ** 2 / (2.0 * face) + 0.5 * outer * sine**2
    return FloatEnds(near * sine, np.minimum(room / (_FULL_RISE * height), rise))


def share_along_floats(
    upper: Bools, spacing: Floats, before: FloatEnds, after: FloatEnds, short: float = 1.0
) -> tuple[Floats, Floats]:
    """Compute the share of swelling at crossings."""
    # `upper` (yarns, n) says whether yarns lie over those that they cross; `before` and `after`,
    # (yarns, n - 1), are the arcs at the start and the end of each gap; `short` is the largest
    # share in floats of two crossings. The results are s and its derivative along the yarn,
    # (yarns, n). A yarn that floats at its first or last crossing is fully swollen there, because
    # the float may go on.
    same = upper[:, 1:] == upper[:, :-1]
    spacing = np.broadcast_to(spacing, same.shape)
    goes_on = np.concatenate([same, same[:, -1:]], axis=1)
    came = np.concatenate([same[:, :1], same], axis=1)
    share = (goes_on & came).astype(np.float64)
    slope = np.zeros(upper.shape)
    # A cubic with the control values 0, 0, q / 3 and s leads into a float; from there on, another
    # one reaches 1 in the next crossing, or in the middle of a float of two crossings.
    for starts, gap, arc, way, beyond in (
        (goes_on[:, 1:] & ~came[:, 1:], spacing, after, 1.0, goes_on[:, 1:]),
        (came[:, :-1] & ~goes_on[:, :-1], spacing, before, -1.0, came[:, :-1]),
    ):
        inside = slice(1, None) if way > 0.0 else slice(None, -1)
        # The float's next gap, and whether the float goes on past it.
        following = np.roll(gap, -int(way), axis=1)
        long_ = np.roll(beyond, -int(way), axis=1)
        reach = np.where(starts, arc.length, 1.0)
        rest = np.where(long_, 3.0, 4.0) * reach / following
        value = np.minimum((arc.rise + rest) / (3.0 + rest), arc.rise)
        grown = way * (3.0 * value - arc.rise) / reach
        most = np.where(long_, 1.0, short)
        share[:, inside] = np.where(starts, most * value, share[:, inside])
        slope[:, inside] = np.where(starts, most * grown, slope[:, inside])
    sign = np.where(upper, 1.0, -1.0)
    return sign * share, sign * slope


def ring_shares(path: Axes, widening: Floats) -> Floats | None:
    """Compute the shares of `swollen_changes` at the rings of control points of a family."""
    # (rings, 4); None if no yarn swells.
    if path.swelling is None or not path.swelling[0].any():
        return None
    start = np.arange(len(path.length)) + path.owner
    share, slope = path.swelling
    third = (path.along[start + 1] - path.along[start]) / 3.0
    rings = np.empty(3 * len(start) + len(path.parts))
    first = 3 * np.arange(len(start)) + path.owner
    rings[first] = share[start]
    rings[first + 1] = share[start] + slope[start] * third
    rings[first + 2] = share[start + 1] - slope[start + 1] * third
    rings[3 * np.cumsum(path.parts) + np.arange(len(path.parts))] = share[path.last]
    return swelling_shares(rings, np.repeat(widening, 3 * path.parts + 1))


def swelling_shares(share: Floats, widening: Floats) -> Floats:
    """Compute the shares of `swollen_changes`, (n, 4), for shares s and widenings (n,)."""
    above, below = np.maximum(share, 0.0), np.maximum(-share, 0.0)
    return np.stack([above, widening * above, below, widening * below], axis=1)


def float_widening(cloth: Cloth, number: int) -> tuple[Floats, float]:
    """Compute how much wider the floats of ends (0) or picks (1) get."""
    # Shares (yarns,) of the largest widening, from 0 to 1, and the largest width of a float over
    # that of its lens.
    yarns, given = cloth.yarns[number], cloth.threads[number].float_width
    width = yarns.aspect * yarns.diameter
    if given is not None:
        most = _FILLED * given / width
    else:
        room = _FILLED * yarns.spacing / (0.5 * (width[1:] + width[:-1]))
        most = np.full(len(width), _WIDEST)
        most[1:] = np.minimum(most[1:], room)
        most[:-1] = np.minimum(most[:-1], room)
    most = np.maximum(most, 1.0)
    widest = _WIDEST if given is None else max(_WIDEST, float(most.max()))
    return (most - 1.0) / (widest - 1.0), widest


def swollen_changes(aspect: float, exact: bool, widest: float) -> tuple[Floats, Floats]:
    """Compute the changes of a lens' control points for full swelling."""
    # Lateral and normal, (4, 12) each, for a half height of 1: changes without widening, and those
    # of the largest widening, where the outer side is above; the same where it is below. Any share
    # of them keeps the contact face inside the circle of contact, because chords lie inside it.
    weight = float(rational_handles(edge_angle(aspect))[1]) if exact else 1.0
    # The largest width must leave an edge on the circle of contact.
    most = max(min(widest * aspect, _STEEPEST * 2.0 * face_radius(aspect)), aspect)
    lens = _swollen_ring(aspect, aspect, 0.0, 0.0, weight)
    narrow = _swollen_ring(aspect, aspect, 2.0 * RISE, _ROUND, weight)
    wide = _swollen_ring(aspect, most, 2.0 * RISE, _ROUND, weight)
    above = np.stack([narrow - lens, wide - narrow])
    below = above[:, :, (6 - np.arange(12)) % 12] * np.array([1.0, -1.0])[:, None]
    lateral, normal = np.moveaxis(np.concatenate([above, below]), 1, 0)
    return lateral, normal


def _swollen_ring(aspect: float, half: float, rise: float, share: float, weight: float) -> Floats:
    """Compute control points (2, 12) of a section of a half width, with its outer side above."""
    radius = 2.0 * face_radius(aspect)
    angle = asin(min(half / radius, 1.0))
    edge = radius * (1.0 - np.cos(angle)) - 1.0
    top = max(1.0 + rise, edge + _CROWN)
    # Both from the middle to the edge; the lower face lies on the circle of contact.
    face = _arc(radius, angle, weight)
    face[1] -= 1.0
    high = top - edge
    outer = 2.0 * atan(high / half)
    arc = _arc((half * half + high * high) / (2.0 * high), outer, weight)
    ellipse = _arc(1.0, 0.5 * np.pi, weight) * [[half], [high]]
    crown = (1.0 - share) * arc + share * ellipse
    crown = np.stack([crown[0], top - crown[1]])
    right = np.concatenate([crown[:, :3], face[:, :0:-1]], axis=1)
    left = np.concatenate([face, crown[:, 2:0:-1]], axis=1)
    return np.concatenate([right, left * [[-1.0], [1.0]]], axis=1)


def _arc(radius: float, angle: float, weight: float) -> Floats:
    """Compute a cubic (2, 4) with given inner weights that meets an arc in its middle."""
    begin, end = np.zeros(2), radius * np.array([np.sin(angle), 1.0 - np.cos(angle)])
    middle = radius * np.array([np.sin(0.5 * angle), 1.0 - np.cos(0.5 * angle)])
    out, back = np.array([1.0, 0.0]), np.array([np.cos(angle), np.sin(angle)])
    lack = (2.0 + 6.0 * weight) * middle - (1.0 + 3.0 * weight) * (begin + end)
    way = out - back
    handle = lack @ way / (3.0 * weight * (way @ way))
    return np.stack([begin, begin + handle * out, end - handle * back, end], axis=1)
