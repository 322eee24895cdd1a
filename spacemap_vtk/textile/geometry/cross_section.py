"""Cross sections of a cloth along the axis of a yarn: axis, outlines and measures for a drawing.

The curves are those of the cloth: axes from `spacemap_vtk.textile.geometry.cloth_axes`, which the
patches follow, and sections from `spacemap_vtk.textile.geometry.section`, which are swept along
the axes. So cloths that Peirce's circles do not describe (flattened, jammed, splines, double
weaves) are cut correctly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.drafts.drawdown import repeat_size
from spacemap_vtk.textile.geometry.axis_parts import Axes, sample_places
from spacemap_vtk.textile.geometry.cloth_axes import family_axes
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.sweep import swell_section
from spacemap_vtk.textile.geometry.swelling import RISE, float_widening, swelling_shares
from spacemap_vtk.textile.patches.bezier import bernstein
from spacemap_vtk.textile.weave.cloth import Cloth

#: Number of points on each part of an axis, and on each cubic of a section.
_SAMPLES = 48
#: Least number of crossings in view by default.
_FEWEST = 5
#: Largest number of crossings in view by default.
_MOST = 9


class Bend(NamedTuple):
    """A part of a yarn that changes side between two neighbouring yarns that it touches."""

    begin: int
    """Crossing at the start, counted from the first in view."""
    end: int
    """Crossing at the end; in a double weave yarns of the other cloth may lie between."""
    spacing: float
    """Distance p between the two crossed yarns, in metres."""
    height: float
    """Rise or fall h of the axis, in metres."""
    length: float
    """Length l of the axis, in metres."""
    angle: float
    """Steepest slope θ of the axis, in radians."""

    @property
    def crimp(self) -> float:
        """Crimp c = l / p - 1."""
        return self.length / self.spacing - 1.0


@dataclass(frozen=True)
class CrossSection:
    """A cut in the plane of a yarn's axis; lengths in metres, along the yarn and in z."""

    #: 0: along an end, 1: along a pick.
    family: int
    #: Number of the yarn, and of the first crossed yarn in view, both counted from 0.
    yarn: int
    first: int
    #: Height of the yarn's section.
    diameter: float
    #: (n, 2) Axis and outline of the yarn.
    axis: Floats
    outline: Floats
    #: (n,) Slope of the axis, in radians.
    slope: Floats
    #: (crossings, 2) Centres of the crossed yarns; (crossings, 2) their widths and heights.
    centres: Floats
    sizes: Floats
    #: (crossings, m, 2) Outlines of the crossed yarns.
    sections: Floats
    #: (crossings,) Height of the yarn's own axis there.
    passes: Floats
    #: (crossings,) Whether the yarns touch; in a double weave those of one cloth do.
    touching: Bools
    #: Parts in view where the yarn changes side.
    bends: tuple[Bend, ...]

    @property
    def bottom_and_top(self) -> tuple[float, float]:
        """Lowest and highest point."""
        heights = np.concatenate([self.outline[:, 1], self.sections[..., 1].ravel()])
        return float(heights.min()), float(heights.max())


def cut_cloth(cloth: Cloth, family: int, yarn: int | None = None) -> CrossSection:
    """Cut a cloth along one of its yarns.

    The view contains one repeat and one more crossing, at least 5 and at most 9 crossings. It is
    the part near the middle that ends with a change of side, if there is one.

    Parameters
    ----------
    cloth : Cloth
        There must be room for its yarns.
    family : {0, 1}
        Along an end, or along a pick.
    yarn : int, optional
        Number of the yarn, from 0; by default the yarn in the middle.

    Returns
    -------
    CrossSection
        The exact curves of the patches' axes and sections.

    Raises
    ------
    GeometryError
        There is no room for the yarns.
    InputError
        There is no such yarn.
    """
    cloth.check()
    count, crossed = cloth.size[family], cloth.size[1 - family]
    yarn = count // 2 if yarn is None else yarn
    if not 0 <= yarn < count:
        name = ("end", "pick")[family]
        raise InputError(
            f"the cloth has {count} {name}s", key=name, value=yarn + 1, allowed=f"1 to {count}"
        )
    crossings = min(max(repeat_size(cloth.drawdown)[1 - family] + 1, _FEWEST), _MOST)
    first, last = _choose_view(cloth, family, yarn, min(crossings, crossed))
    window = np.arange(first, last + 1)
    own, across = cloth.yarns[family], cloth.yarns[1 - family].select(window)

    path = family_axes(cloth, family, np.array([yarn]))
    part, station, fraction = sample_places(path, _SAMPLES)
    along, height, slope = path.evaluate(part, station, fraction)
    share = path.evaluate_swelling(part, station, fraction)
    lengths_along = np.cumsum(path.length)[part] - path.length[part] * (1.0 - fraction)
    place = across.position
    passes, lengths = np.interp(place, along, height), np.interp(place, along, lengths_along)
    low, high = _view_ends(cloth, family, first, last)
    inner = (along > low) & (along < high)
    ends = (low, high)
    columns = along, height, slope, share
    line = np.stack(columns, axis=1)[inner]
    cut = np.stack([np.interp(ends, along, values) for values in columns], axis=1)
    line = np.concatenate([cut[:1], line, cut[1:]])
    half, normal = path.radius[0], np.stack([-np.sin(line[:, 2]), np.cos(line[:, 2])], axis=1)
    # A swollen yarn rises on the side on which it floats.
    above, below = (
        half * (1.0 + 2.0 * RISE * np.maximum(side * line[:, 3:], 0.0)) for side in (1, -1)
    )
    upper, lower = line[:, :2] + above * normal, line[:, :2] - below * normal

    other = family_axes(cloth, 1 - family, window)
    centres, tilts, swollen = _crossed_centres(other, own.position[yarn], place)
    widening, widest = float_widening(cloth, 1 - family)
    shares = swelling_shares(swollen, widening[window])
    outlines = _section_outlines(cloth, 1 - family, widest, shares) * other.radius[:, None, None]
    # A plane that cuts a tube obliquely makes the section higher.
    outlines[..., 1] /= np.cos(tilts)[:, None]
    return CrossSection(
        family,
        yarn,
        int(first),
        float(own.diameter[yarn]),
        line[:, :2],
        np.concatenate([upper, lower[::-1]]),
        line[:, 2],
        centres,
        np.stack([across.aspect * across.diameter, across.diameter], axis=1),
        outlines + centres[:, None],
        passes,
        _find_touched(cloth, family, yarn)[window],
        _measure_bends(
            _find_changes(cloth, family, yarn, slice(first, last + 1)),
            (place, passes, lengths),
            (along, slope),
        ),
    )


def _find_touched(cloth: Cloth, family: int, yarn: int) -> Bools:
    """Find the crossed yarns that a yarn touches."""
    if cloth.layers is None:
        return np.ones(cloth.size[1 - family], bool)
    own = cloth.layers.same_cloth
    return np.array(own[yarn] if family else own[:, yarn], bool)


def _find_changes(cloth: Cloth, family: int, yarn: int, window: slice = slice(None)) -> Ints:
    """Find the pairs of touching crossings between which a yarn changes side, (n, 2)."""
    upper = cloth.is_over(family, np.array([yarn]))[0, window]
    places = np.flatnonzero(_find_touched(cloth, family, yarn)[window])
    changed = np.flatnonzero(np.diff(upper[places].astype(np.int8)))
    return np.stack([places[changed], places[changed + 1]], axis=1)


def _choose_view(cloth: Cloth, family: int, yarn: int, count: int) -> tuple[int, int]:
    """Choose the first and the last crossing in view."""
    crossed = cloth.size[1 - family]
    middle = (crossed + count) // 2 - 1
    changes = _find_changes(cloth, family, yarn)[:, 1]
    if len(changes):
        middle = int(changes[np.argmin(np.abs(changes - middle))])
    last = min(max(middle, count - 1), crossed - 1)
    return last - count + 1, last


def _view_ends(cloth: Cloth, family: int, first: int, last: int) -> tuple[float, float]:
    """Return both ends of the cut: half a spacing past the crossings, or where the yarn ends."""
    yarns, past = cloth.yarns[1 - family], cloth.families[family].overhang
    place, apart = yarns.position, yarns.spacing
    before = past if first == 0 else min(past, 0.5 * apart[first - 1])
    after = past if last == len(place) - 1 else min(past, 0.5 * apart[last])
    return float(place[first] - before), float(place[last] + after)


def _crossed_centres(other: Axes, where: float, place: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute centres, slopes and swelling of the crossed yarns in the cutting plane."""
    part, station, fraction = sample_places(other, _SAMPLES)
    along, height, slope = other.evaluate(part, station, fraction)
    share = other.evaluate_swelling(part, station, fraction)
    owner = station - part
    found = np.array(
        [
            [np.interp(where, along[mine], values[mine]) for values in (height, slope, share)]
            for mine in (owner == number for number in range(len(place)))
        ]
    )
    return np.stack([place, found[:, 0]], axis=1), found[:, 1], found[:, 2]


def _section_outlines(cloth: Cloth, family: int, widest: float, shares: Floats) -> Floats:
    """Compute points (yarns, m, 2) on sections of half height 1 with given swelling."""
    threads = cloth.threads[family]
    shape = build_section(threads.shape, threads.aspect, cloth.exact, widest)
    swollen = swell_section(shape, shares)
    lateral, normal = (shape.lateral, shape.normal) if swollen is None else swollen
    points = np.empty((len(shares), shape.size, 3))
    points[..., 0], points[..., 1], points[..., 2] = lateral, normal, 1.0
    points *= shape.weight[:, None]
    cubics = points[:, (3 * np.arange(shape.size // 3)[:, None] + np.arange(4)) % shape.size]
    curves = np.einsum("tk,ynkc->yntc", bernstein(3, np.arange(_SAMPLES) / _SAMPLES), cubics)
    flat = curves.reshape(len(shares), -1, 3)
    return np.asarray(flat[..., :2] / flat[..., 2:])


def _measure_bends(
    changes: Ints, crossings: tuple[Floats, Floats, Floats], curve: tuple[Floats, ...]
) -> tuple[Bend, ...]:
    (place, heights, lengths), (along, slope) = crossings, curve
    found = []
    for begin, end in changes.tolist():
        inside = (along >= place[begin]) & (along <= place[end])
        spacing, height, length = (float(abs(v[end] - v[begin])) for v in (place, heights, lengths))
        found.append(Bend(begin, end, spacing, height, length, float(np.abs(slope[inside]).max())))
    return tuple(found)
