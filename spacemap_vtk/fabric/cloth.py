"""The measures of a cloth: yarns, spacings, sections and crimp, checked before anything is built.

Every yarn may have its own diameter and every pair of neighbours its own spacing. The section of a
yarn is a circle, a racetrack (Kemp) or an ellipse; its height along z is the diameter, its width
along the cloth is the aspect times that. What follows holds for all of them:

- At the crossing of end j and pick i the axes are (d_j + d_i) / 2 apart, which warp and weft share
  in one ratio h1 : h2 all over the cloth. So crimp heights follow the diameters.
- A flattened yarn is crossed on its flat, which is the width less the diameter long: between two
  crossings Peirce's formulas hold over p' = p less half the flats of both (Kemp).
- A gap between two crossings whose arcs have radii that sum up to D has room for the warp where
  ``h1 / (h1 + h2) <= 1 - sqrt(1 - (p'/D)**2)``, and for the weft likewise. So the tightest gap of
  each family alone decides what is feasible.

Sources: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45; A. Kemp,
"An Extension of Peirce's Cloth Geometry to the Treatment of Non-circular Threads", J. Textile Inst.
49 (1958) T44.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.fabric.peirce import (
    JAM,
    Crimp,
    balanced_height,
    check_height,
    feasible_height,
    solve,
)
from spacemap_vtk.units import format_quantity

#: Sections of a yarn, the commonest first.
SECTIONS = ("circular", "racetrack", "elliptic")
#: Shapes of a yarn's axis, the commonest first.
AXES = ("arcs", "spline")


class Family(NamedTuple):
    """The measures of warp or weft, seen from its own yarns: means, lengths in metres."""

    diameter: float
    """Height of the section, along z."""
    spacing: float
    """Distance between the yarns of the family itself."""
    crossed: float
    """Distance between the yarns that it crosses."""
    height: float
    """Crimp height."""
    overhang: float
    """Length of each yarn past its last crossing."""
    crimp: Crimp
    """Peirce's figures where a yarn changes side; with flats, their length is counted in."""
    width: float
    """Width of the section, along the cloth."""


class Yarns(NamedTuple):
    """The yarns of one family, one by one; lengths in metres."""

    diameter: NDArray[np.float64]
    """(n,) Heights of the sections."""
    spacing: NDArray[np.float64]
    """(n - 1,) Distances between neighbours."""
    aspect: float
    """Width of each section over its height."""
    section: str
    """One of `SECTIONS`; "circular" wherever the aspect is 1."""
    position: NDArray[np.float64]
    """(n,) Places across the whole family, the middle of its first and its last yarn at 0."""

    def chosen(self, which: slice | NDArray[np.int64]) -> Yarns:
        """Return some of the yarns, in their places."""
        position = self.position[which]
        return self._replace(
            diameter=self.diameter[which], spacing=np.diff(position), position=position
        )

    @property
    def flat(self) -> NDArray[np.float64]:
        """(n,) Length on top of each yarn along which a crossing yarn stays straight."""
        return (self.aspect - 1.0) * self.diameter


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloth:
    """The measures of a cloth, checked."""

    #: Diameters d1 and d2 of the yarns, in metres: of all, or one by one. Of a flattened section
    #: the height.
    warp_diameter: float | NDArray[np.float64]
    weft_diameter: float | NDArray[np.float64]
    #: Distances p1 between neighbouring ends and p2 between neighbouring picks, in metres.
    warp_spacing: float | NDArray[np.float64]
    weft_spacing: float | NDArray[np.float64]
    #: Crimp height h1 of the warp, in metres, for yarns of mean diameters; those of the single
    #: crossings follow in proportion to theirs. By default the middle of the feasible interval.
    warp_crimp_height: float | None = None
    #: How far each yarn reaches past its last crossing, in metres; by default half the mean
    #: spacing that it crosses.
    overhang: float | None = None
    #: Section of the yarns. A racetrack is a rectangle between two half circles. Axes are exact
    #: for circles and racetracks: yarns touch along their arcs and flats and never overlap. An
    #: ellipse is laid along the axis of the racetrack of its size, which holds it: ellipses touch
    #: in the middle of each crossing and never overlap, but leave a gap on both sides of it that
    #: real yarns would close.
    warp_section: str = "circular"
    weft_section: str = "circular"
    #: Width of the section over its height, at least 1; 1 for circles.
    warp_aspect: float = 1.0
    weft_aspect: float = 1.0
    #: Whether cut ends are closed.
    caps: bool = True
    #: Whether surfaces are rational, so that round yarns and arcs are exact to rounding.
    exact: bool = False
    #: Shape of a yarn's axis: Peirce's arc - straight - arc, or the cubic spline through the
    #: crossings, which bends without jumps in curvature but holds no distance between yarns.
    axis: str = "arcs"

    def __post_init__(self) -> None:
        for name in ("warp_diameter", "weft_diameter", "warp_spacing", "weft_spacing"):
            object.__setattr__(self, name, _lengths(name, getattr(self, name)))
        for family in ("warp", "weft"):
            self._check_section(family)
        for family in ("warp", "weft"):
            self._check_neighbours(family)
        if self.axis not in AXES:
            raise InputError("no such shape", key="axis", value=self.axis, allowed=_words(AXES))
        check_height(*self._tightest, self.diameter_sum, self.height)
        if self.overhang is not None and not 0.0 <= self.overhang < inf:
            raise GeometryError(
                "a yarn cannot end before its last crossing",
                key="overhang",
                value=self.overhang,
                allowed="a length from 0 m on",
            )

    @cached_property
    def diameter_sum(self) -> float:
        """Sum D of the mean diameters of warp and weft, in metres."""
        return _average(self.warp_diameter) + _average(self.weft_diameter)

    @cached_property
    def height(self) -> float:
        """Crimp height h1 of the warp, in metres; that of the weft is D - h1."""
        if self.warp_crimp_height is not None:
            return self.warp_crimp_height
        return balanced_height(*self._tightest, self.diameter_sum)

    @property
    def feasible_heights(self) -> tuple[float, float]:
        """Interval of the warp's crimp height h1, in metres, that leaves room for all yarns."""
        return feasible_height(*self._tightest, self.diameter_sum)

    @property
    def share(self) -> float:
        """Share h1 / (h1 + h2) that the warp has in the distance of the axes at a crossing."""
        # h1 may pass 0 or D by rounding
        return min(max(self.height / self.diameter_sum, 0.0), 1.0)

    @property
    def parts_per_gap(self) -> int:
        """Most parts of an axis between neighbouring crossings, for estimates of memory."""
        if self.axis == "spline":
            return 4
        shares = self.share, 1.0 - self.share
        # an arc of 60 degrees needs a height of at least half the sum of its radii
        arcs = 1 if self.exact or max(shares) <= 0.5 + 1e-9 else 2
        return 2 * arcs + 1 + (max(self.warp_aspect, self.weft_aspect) > 1.0)

    @property
    def families(self) -> tuple[Family, Family]:
        """Mean measures of warp and weft, Peirce's figures among them."""
        share = self.share
        return self._family("warp", share), self._family("weft", 1.0 - share)

    def yarns(self, family: str, count: int) -> Yarns:
        """Return the yarns of a family one by one."""
        diameter, spacing, aspect, section = self._of(family)
        for key, values, wanted in (("diameter", diameter, count), ("spacing", spacing, count - 1)):
            if np.ndim(values) and np.size(values) != wanted:
                raise InputError(
                    f"{np.size(values)} values for {count} yarns",
                    key=f"{family}_{key}",
                    allowed=f"one value, or {wanted}",
                )
        apart = np.array(np.broadcast_to(spacing, count - 1))
        return Yarns(
            np.array(np.broadcast_to(diameter, count)),
            apart,
            aspect,
            section if aspect > 1.0 else "circular",
            _places(apart),
        )

    def _of(
        self, family: str
    ) -> tuple[float | NDArray[np.float64], float | NDArray[np.float64], float, str]:
        return (
            getattr(self, f"{family}_diameter"),
            getattr(self, f"{family}_spacing"),
            getattr(self, f"{family}_aspect"),
            getattr(self, f"{family}_section"),
        )

    @cached_property
    def _tightest(self) -> tuple[float, float]:
        """Spacings p1 and p2 at which yarns of mean diameters would be as tight as the worst."""
        # Feasible heights over D depend on p'/D alone.
        result = []
        for family, other in (("warp", "weft"), ("weft", "warp")):
            room, diameters = self._gaps(family)
            sums = diameters + np.max(self._of(other)[0])
            ratio = np.min(room / sums, initial=inf)
            # without a second yarn there is nothing to bend between
            result.append(float(ratio * self.diameter_sum) if ratio < inf else self.diameter_sum)
        return result[0], result[1]

    def _gaps(self, family: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return p' and the mean diameter of both neighbours, for each gap of a family."""
        diameter, spacing, aspect, _ = self._of(family)
        mean = _between(diameter)
        if mean.size == 0 or np.size(spacing) == 0:
            return np.empty(0), np.empty(0)
        room = np.asarray(spacing) - (aspect - 1.0) * mean
        return np.atleast_1d(room), np.atleast_1d(mean)

    def _family(self, family: str, share: float) -> Family:
        """Return mean measures; a mean gap has room wherever every gap has."""
        diameter, spacing, aspect, _ = self._of(family)
        other = "weft" if family == "warp" else "warp"
        crossed_diameter, crossed_spacing, crossed_aspect, _ = self._of(other)
        own, across = float(np.mean(diameter)), float(np.mean(crossed_diameter))
        crossed = _mean(crossed_spacing, crossed_aspect * across)
        room, between = self._gaps(other)
        arcs = own + (float(np.mean(between)) if room.size else across)
        # a lone crossed yarn has no neighbour to bend towards: nothing is tight
        gap = float(np.mean(room)) if room.size else max(crossed, arcs)
        theta, straight, length, crimp = solve(gap, share * arcs, arcs)
        if room.size:
            length, crimp = length + (crossed - gap), crimp * gap / crossed
        return Family(
            diameter=own,
            spacing=_mean(spacing, aspect * own),
            crossed=crossed,
            height=share * self.diameter_sum,
            overhang=0.5 * crossed if self.overhang is None else self.overhang,
            crimp=Crimp(theta, straight, length, crimp),
            width=aspect * own,
        )

    def _check_section(self, family: str) -> None:
        _, _, aspect, section = self._of(family)
        if section not in SECTIONS:
            raise InputError(
                "no such section",
                key=f"{family}_section",
                value=section,
                allowed=_words(SECTIONS),
            )
        if not (isfinite(aspect) and aspect >= 1.0) or (section == "circular" and aspect != 1.0):
            raise GeometryError(
                f"a {section} section cannot have this width over its height",
                key=f"{family}_aspect",
                value=aspect,
                allowed="1" if section == "circular" else "from 1 on",
                cure='Make the section "racetrack" or "elliptic" for a flattened yarn'
                if section == "circular"
                else "A yarn lies flat on the cloth, not on edge",
            )

    def _check_neighbours(self, family: str) -> None:
        """Refuse measures that do not fit each other, and yarns that overlap their neighbours."""
        diameter, spacing, aspect, _ = self._of(family)
        if np.ndim(diameter) and np.ndim(spacing) and np.size(spacing) != np.size(diameter) - 1:
            raise InputError(
                f"{np.size(spacing)} distances between {np.size(diameter)} yarns",
                key=f"{family}_spacing",
                allowed=f"one value, or {np.size(diameter) - 1}",
            )
        mean = _between(diameter)
        if mean.size == 0 or np.size(spacing) == 0:
            return
        width, room = np.broadcast_arrays(aspect * mean, np.asarray(spacing))
        over = width - room > JAM * (self.diameter_sum + width)
        if over.any():
            worst = int(np.argmax(over))
            which = f" {worst + 1} and {worst + 2}" if over.size > 1 else ""
            thick, apart = float(width.flat[worst]), float(room.flat[worst])
            raise GeometryError(
                f"neighbouring {family} yarns{which} overlap: they are {_metres(thick)} "
                f"{'thick' if aspect == 1.0 else 'wide'} and {_metres(apart)} apart",
                key=f"{family}_diameter",
                value=thick / aspect,
                allowed=f"up to {_metres(apart / aspect)} ({family}_spacing"
                f"{'' if aspect == 1.0 else f' over {family}_aspect'})",
                cure=f"Make {family}_diameter smaller or {family}_spacing larger",
            )


def _lengths(key: str, value: ArrayLike) -> float | NDArray[np.float64]:
    """Return a positive length, or a row of them that nobody can change."""
    array = np.array(value, dtype=np.float64)
    if array.ndim > 1:
        raise InputError(
            f"a table of shape {array.shape}", key=key, allowed="one value, or one for each"
        )
    wrong = ~(np.isfinite(array) & (array > 0.0))
    if wrong.any() or (array.size == 0 and key.endswith("diameter")):
        raise GeometryError(
            "a fabric needs a length here",
            key=key,
            value=float(array.flat[np.argmax(wrong)]) if array.size else None,
            allowed="more than 0 m",
            cure='Write, for example, "0.3 mm"',
        )
    if array.ndim == 0:
        return float(array)
    array.flags.writeable = False
    return array


def _places(spacing: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n + 1,) places that are (n,) distances apart, the middle of the ends at 0."""
    count = len(spacing) + 1
    if spacing.size == 0 or np.ptp(spacing) == 0.0:
        # exactly symmetric, and no sum of roundings
        step = spacing[0] if spacing.size else 0.0
        return np.asarray(step * (np.arange(count) - 0.5 * (count - 1)))
    place = np.concatenate([[0.0], np.cumsum(spacing)])
    return place - 0.5 * place[-1]


def _between(diameter: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the means of neighbours: (n - 1,) of n values, a scalar of one for all."""
    values = np.asarray(diameter)
    return values if values.ndim == 0 else 0.5 * (values[1:] + values[:-1])


def _average(lengths: float | NDArray[np.float64]) -> float:
    return lengths if isinstance(lengths, float) else float(np.mean(lengths))


def _mean(spacing: float | NDArray[np.float64], width: float) -> float:
    return float(np.mean(spacing)) if np.size(spacing) else width


def _words(choices: tuple[str, ...]) -> str:
    return " or ".join(f'"{choice}"' for choice in choices)


def _metres(value: float) -> str:
    return format_quantity(value, "m")
