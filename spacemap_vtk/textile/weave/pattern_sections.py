r"""Places and sections of the picks where a thick pattern weft covers its tabby.

Pattern picks are ρ times as thick as tabby picks, and all are lenses of one aspect. Neighbouring
picks lie as far apart as their widths demand, so that the same share of the room is filled
everywhere. The thick picks thereby take the room that the tabby yields: a pattern pick and a tabby
pick together have the length of cloth g that two picks of the draft have, and with the filling f

    a = f g ρ / (1 + ρ),    a_t = f g / (1 + ρ),    b = a / aspect,    b_t = b / ρ         (1)

are their widths and heights. As a + a_t ≤ g, pattern picks can pass down into the ground between
tabby picks.

Where a pattern pick floats on ends, it covers the tabby. Let both lie on the ends, the pattern pick
on its arc of radius R = (a² + b²) / 4b, which is drawn out sideways, the tabby below its own upper
arc of radius R_t = R / ρ. The centres of both circles are g / 2 apart sideways and R + R_t - b_t in
height. The circles do not overlap, however wide the float is, if

    (g / 2)² + (R + R_t - b_t)² ≥ (R + R_t)²                                               (2)

that is g² / 4 ≥ 2 b_t (R + R_t) - b_t² = (a² + b²) (1 + ρ) / 2ρ² - b² / ρ². With (1) it holds for
all ρ ≥ 1 and b ≤ a. So the floats of neighbouring pattern picks may be drawn out until they touch
each other, and the tabby lies in the groove below them.

For that, ends have the same height over all picks, that over the tabby: the axes of pattern picks
are (b - b_t) / 2 further from the middle of the cloth than those of tabby picks.

Source: derived for this program.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools, Floats

#: Thickness of a pattern weft over that of its tabby, where nothing is known: "usually about twice
#: as thick as the warp" (Handweaving Academy, "Speed Up Overshot with the Double Tabby Technique").
USUAL_RATIO = 2.0


class PatternSections(NamedTuple):
    """Places and sections of picks; lengths in metres."""

    position: Floats
    """(picks,) Axes across the cloth, from its first edge."""
    width: Floats
    """(picks,) Widths of the sections."""
    float_width: Floats
    """(picks,) Widths to which floats on the ends may be drawn out."""
    thickness: Floats
    """(picks,) Heights of the sections over those of pattern picks."""
    rise: Floats
    """(picks,) How far floats lie above level crowns, over the height of pattern picks."""


def close_over_tabby(
    pattern: Bools, length: float, ratio: float = USUAL_RATIO, filling: float = 1.0
) -> PatternSections:
    """Find places and sections of picks that close a cloth of this length with a pattern weft."""
    # `pattern` is False for tabby and for plain borders, whose picks are alike; `ratio` is the
    # thickness of the pattern weft over theirs, `filling` the width of sections over their room.
    if not 1.0 <= ratio < np.inf:
        raise InputError(
            "a pattern weft cannot be thinner than its tabby",
            key="ratio",
            value=ratio,
            allowed="1 or more",
        )
    if not 0.0 < filling <= 1.0:
        raise InputError(
            "the share of the room that is filled is out of range",
            key="filling",
            value=filling,
            allowed="above 0 and up to 1",
        )
    pattern = np.asarray(pattern, dtype=bool)
    share = np.where(pattern, ratio, 1.0)
    room = length * share / share.sum()
    position = np.cumsum(room) - 0.5 * room
    # Half the width of a float: to the axis of the tabby, or half way to another pattern pick.
    gap = np.diff(position)
    free = np.where(pattern[:-1] & pattern[1:], 0.5 * gap, gap)
    reach = np.minimum(np.append(np.inf, free), np.append(free, np.inf))
    pair = length * (1.0 + ratio) / share.sum()
    return PatternSections(
        position=position,
        width=filling * room,
        float_width=np.where(pattern, np.minimum(2.0 * reach, pair), filling * room),
        thickness=share / share.max(),
        rise=np.where(pattern, 0.5 * (1.0 - 1.0 / ratio), 0.0),
    )
