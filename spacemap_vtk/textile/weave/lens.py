"""Geometry of lenticular yarns: their sections lie between two equal arcs and close a cloth.

A lens of width a and height b lies between two arcs of radius ``R = (a**2 + b**2) / (4 b)``. A yarn
i that bends over a yarn j touches it on one of these arcs, so its axis is an arc of radius
``R_j + b_i / 2`` about that arc's centre. Peirce's formulas then hold with D, the sum of the radii
of the two arcs of a gap, while the axes are ``(b_i + b_j) / 2`` apart at each crossing.

The crowns of both families are level if each yarn has the height of the yarns that it crosses:
``h1 = b2`` and ``h2 = b1``. Then a gap of spacing p between yarns of width a and height b has room
for a yarn of height c if

    2 b c <= p**2 - a**2                                                                    (1)

Yarns do not overlap: the arcs on which they touch lie in tubes of radii R1 and R2, whose centre
lines are those of round yarns in Peirce's geometry and nowhere closer than R1 + R2. This needs
widths up to the spacing.

Source: derived for this program. Lenticular yarns are usually attributed to J. W. S. Hearle and
W. J. Shanahan, "An Energy Method for Calculations in Fabric Mechanics", J. Textile Inst. 69 (1978)
81, which was not at hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan, inf, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.weave.peirce import jam_height

#: Height of the yarns of a draft as a share of the largest that can be woven.
HEIGHT_SHARE = 0.92
#: Largest width over height of a yarn of known count; a thin yarn leaves the cloth open.
_FLATTEST = 4.0
#: Number of bisections for the width at which yarns of known count fit.
_BISECTIONS = 50


def face_radius(aspect: float) -> float:
    """Compute the radius R of a lens' arcs over its height."""
    return 0.25 * (aspect * aspect + 1.0)


def edge_angle(aspect: float) -> float:
    """Compute the angle of a lens' arc from its top to its edge, in radians."""
    return 2.0 * atan(1.0 / aspect)


def lens_area(aspect: float) -> float:
    """Compute the area of a lens over the square of its height, about 2/3 of the aspect."""
    angle = edge_angle(aspect)
    return face_radius(aspect) ** 2 * (2.0 * angle - sin(2.0 * angle))


class CrossedGaps(NamedTuple):
    """The gaps between the yarns of a family, as the other family sees them."""

    room: Floats
    """(n,) Spacing p, less the flats of racetracks, in metres."""
    height: Floats
    """(n,) Mean height of the two yarns, in metres."""
    face: float
    """Radius of the arcs on which these yarns are touched, over their height."""


def largest_lean(gaps: CrossedGaps, own: Floats) -> float:
    """Compute how much higher than level crowns a family can be."""
    # Crimp height less that of level crowns, over the sum of the heights of warp and weft: below 0
    # if level crowns have no room, infinite without a gap. `own` are the family's own heights.
    if not gaps.room.size:
        return inf
    high, low = float(np.max(own)), float(np.min(own))
    distance = 2.0 * gaps.face * gaps.height + high
    excess = jam_height(gaps.room, distance) - gaps.height
    # The thickest yarn leaves the least excess. Where there is too little room, the thinnest one
    # has the largest share, which is a safe bound if both are one cloth.
    return float(np.min(excess / (np.where(excess < 0.0, low, high) + gaps.height)))


class DraftFamily(NamedTuple):
    """A family of yarns whose sections are to be found."""

    width: Floats
    """(n,) Largest width of each yarn, in metres."""
    spacing: Floats
    """(n - 1,) In metres."""
    area: Floats | None
    """(n,) Areas of the sections, in m2, if yarn counts are known."""


class LensShape(NamedTuple):
    """Sections of a family of lenticular yarns."""

    height: Floats
    """(n,) In metres."""
    aspect: float
    """Width over height, the same for all yarns, at least 1."""


def fit_lenses(warp: DraftFamily, weft: DraftFamily) -> tuple[LensShape, LensShape]:
    """Find lenticular sections that close a cloth and can be woven."""
    # The product of the heights is at most 0.92**2 of that in (1). Without areas, yarns have the
    # given widths and the largest heights, in the ratio of the square roots of the widths. Yarns of
    # known area have the given widths too, but an aspect of at most 4, which leaves the cloth open.
    # If they are then too high, both families are made narrower and rounder until they fit. If not
    # even round yarns fit, they are round.
    largest = _solve_product((warp, weft))
    if warp.area is None and weft.area is None:
        return largest
    families, aspects = [], []
    for number, (own, other) in enumerate(((warp, weft), (weft, warp))):
        if own.area is None:
            # The height that belongs to the other family's, in the ratio of the square roots.
            ratio = sqrt(float(np.mean(own.width)) / float(np.mean(other.width)))
            assert other.area is not None
            aspect = _aspect_for_area(other)
            height = ratio * float(np.mean(_widths(other.area, aspect))) / aspect
            aspect = max(float(np.mean(own.width)) / height, largest[number].aspect)
            own = own._replace(area=lens_area(aspect) * (own.width / aspect) ** 2)
        aspect = _aspect_for_area(own)
        families.append(own)
        aspects.append(min(aspect, _FLATTEST))

    def shapes(share: float) -> list[LensShape]:
        """Build sections between round ones (0) and those of the aspects above (1)."""
        result = []
        for own, most in zip(families, aspects, strict=True):
            aspect = 1.0 + share * (most - 1.0)
            assert own.area is not None
            result.append(LensShape(_widths(own.area, aspect) / aspect, aspect))
        return result

    low, high = 0.0, 1.0
    if not _fits(families, shapes(high)):
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _fits(families, shapes(middle)) else (low, middle)
        high = low
    first, second = shapes(high)
    return first, second


def _solve_product(families: tuple[DraftFamily, DraftFamily]) -> tuple[LensShape, LensShape]:
    """Find the highest lenses of given widths."""
    widths = [family.width for family in families]
    # (1) bounds the product of the aspects from below; their ratio follows from the widths.
    product = max(_least_aspects(families, widths)) / HEIGHT_SHARE**2
    ratio = sqrt(float(np.mean(widths[0])) / float(np.mean(widths[1])))
    aspects = max(1.0, sqrt(product * ratio)), max(1.0, sqrt(product / ratio))
    first, second = (LensShape(w / a, a) for w, a in zip(widths, aspects, strict=True))
    return first, second


def _least_aspects(families: Sequence[DraftFamily], widths: Sequence[Floats]) -> list[float]:
    """Compute the least product of both aspects that (1) allows in the gaps of each family."""
    result = []
    for number, family in enumerate(families):
        mean = neighbour_means(widths[number])
        room = np.square(family.spacing) - mean * mean
        if not np.size(room):
            result.append(0.0)
            continue
        if np.min(room) <= 0.0:
            return [inf]
        result.append(float(np.max(2.0 * mean * np.max(widths[1 - number]) / room)))
    return result


def _fits(families: Sequence[DraftFamily], shapes: Sequence[LensShape]) -> bool:
    product = max(_least_aspects(families, [shape.aspect * shape.height for shape in shapes]))
    return product / HEIGHT_SHARE**2 <= shapes[0].aspect * shapes[1].aspect


def _aspect_for_area(family: DraftFamily) -> float:
    """Find the aspect of yarns of known area that reach their largest widths; at least 1."""
    assert family.area is not None
    # One aspect for all yarns: the one that fills its width most decides.
    share = float(np.max(family.area / np.square(family.width)))
    if share >= lens_area(1.0):
        return 1.0
    low, high = 1.0, 2.0 / share  # a lens has an area of about 2/3 of width times height
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if lens_area(middle) / middle**2 > share else (low, middle)
    return low


def _widths(area: Floats, aspect: float) -> Floats:
    return np.asarray(aspect * np.sqrt(area / lens_area(aspect)))


def neighbour_means(values: ArrayLike) -> Floats:
    """Compute means of neighbouring yarns, (n,) to (n - 1,); return a scalar unchanged."""
    table = np.asarray(values, dtype=np.float64)
    return table if table.ndim == 0 else 0.5 * (table[1:] + table[:-1])
