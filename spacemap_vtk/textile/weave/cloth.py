"""A cloth: yarns, spacings, sections and crimp, checked before anything is built.

Every yarn may have a different diameter, and every pair of neighbours a different spacing. The
section of a yarn is a circle, a racetrack (Kemp), an ellipse or a lens. Its height along z is the
diameter, and its width along the cloth is the aspect times the diameter. For all sections:

- At the crossing of end j and pick i the axes are (d_j + d_i) / 2 apart. Warp and weft share this
  distance in one ratio h1 : h2 in the whole cloth, so crimp heights are proportional to diameters.
  Where a family is lenticular, crowns are level by default: the crimp height of a yarn at each
  crossing is the diameter of the yarn that it crosses. Another h1 adds the same share of d_j + d_i
  at all crossings.
- A flattened yarn is crossed on its flat, whose length is the width less the diameter. Between two
  crossings Peirce's formulas hold over p' = p less half the flats of both yarns (Kemp).
- In a gap whose two arcs have radii with the sum D, there is room for the warp if
  ``h1 / (h1 + h2) <= 1 - sqrt(1 - (p'/D)**2)``; the same holds for the weft. So the tightest gap
  of each family alone decides what is feasible.

Sources: F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45; A. Kemp,
"An Extension of Peirce's Cloth Geometry to the Treatment of Non-circular Threads", J. Textile Inst.
49 (1958) T44.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parallel import blocks
from spacemap_vtk.textile.drafts.drawdown import as_drawdown
from spacemap_vtk.textile.weave.double_weave import LAYER_CLEARANCE, Layers
from spacemap_vtk.textile.weave.families import FAMILIES, QuantityNames, quantity_name
from spacemap_vtk.textile.weave.lens import CrossedGaps, largest_lean, neighbour_means
from spacemap_vtk.textile.weave.peirce import (
    JAM,
    Crimp,
    balanced_height,
    check_height,
    feasible_height,
    solve,
)
from spacemap_vtk.textile.weave.threads import Threads, YarnIndices, Yarns
from spacemap_vtk.units import format_length

#: Shapes of a yarn's axis, the default first.
AXES = ("arcs", "spline")
#: Rounding tolerance: a crimp may exceed its interval by this share of the largest crimp.
_TOLERANCE = 1e-9
#: Number of crossings that are processed in one block, which takes some ten megabytes.
_CROSSINGS = 20_000
#: Default gap between the two cloths of a double weave, as a share of D.
_LAYER_GAP = 0.1
#: First yarn of each course, ascending, and the course of each yarn; see `Cloth.yarn_groups`.
YarnGroups = tuple[Ints, Ints]


class CrossingProfile(NamedTuple):
    """Radii and heights of yarns at the yarns that they cross: arrays (yarns, crossings)."""

    arc: Floats
    """Radii of the arcs; where round yarns touch, the radius is the distance R of the axes."""
    height: Floats
    """Heights of the axes, in z."""
    bends: Bools | None
    """Whether the yarn bends at the crossing; None: it bends at every crossing."""


class Family(NamedTuple):
    """Mean measures of warp or weft, seen from that family; lengths in metres."""

    diameter: float
    """Height of the section, along z."""
    spacing: float
    """Distance between the yarns of this family."""
    crossed: float
    """Distance between the yarns that this family crosses."""
    height: float
    """Crimp height."""
    overhang: float
    """Length of each yarn past its last crossing."""
    crimp: Crimp
    """Peirce's figures where a yarn changes side, with the length of flats included."""
    width: float
    """Width of the section, along the cloth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloth:
    """A cloth: its drawdown, the measures of its yarns, and how the yarns are shaped.

    A cloth may have no room for its yarns; then `check` raises an error, and so does everything
    that computes geometry, so nothing can be built from it.

    Parameters
    ----------
    drawdown : (picks, ends) array_like of bool
        First pick and first end come first; True: the end lies over the pick.
    warp, weft : Threads
        The ends (p1, d1) and the picks (p2, d2).
    crimp_height : float, optional
        Crimp height h1 of the warp, in metres, for yarns of mean diameters. Crimp heights of single
        crossings are proportional to their diameters. By default it follows from the crimp of warp
        or weft. Without these it is the middle of the feasible interval; for lenticular yarns it is
        the height of level crowns.
    overhang : float, optional
        Length of each yarn past its last crossing, in metres; by default half the mean spacing of
        the yarns that it crosses.
    caps : bool
        Whether cut ends are closed.
    exact : bool
        Whether surfaces are rational. Then round yarns and arcs are exact up to rounding.
    axis : {"arcs", "spline"}
        Shape of a yarn's axis: Peirce's arc - straight - arc, or the cubic spline through the
        crossings. A spline has no jumps in curvature, but does not keep yarns at a distance.
    density : float or tuple of 2 float, optional
        Mass per volume of yarn, including the air between its fibres, in kg/m3; one value, or one
        for the warp and one for the weft.
    middle : tuple of 2 float
        Position of the middle between first and last end, and between first and last pick, in
        metres. Used to place a part of a cloth in the whole cloth.
    warnings : tuple of str
        Assumptions and changes that led to this cloth.
    layers : Layers, optional
        Only for a double weave: two cloths, each with the crossings of its own yarns.
    layer_gap : float, optional
        Gap between these two cloths, in metres; by default a tenth of D.
    cure : str
        Advice for error messages about missing room, added to "thinner yarns or wider spacings".
    names : callable
        Names of the quantities of warp and weft in messages.

    Raises
    ------
    InputError
        The drawdown is not a matrix.

    Examples
    --------
    >>> threads = Threads(diameter=0.1, spacing=0.2)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> cloth.height, round(float(cloth.families[0].crimp.crimp), 4)
    (0.1, 0.1435)
    """

    drawdown: Bools
    warp: Threads
    weft: Threads
    crimp_height: float | None = None
    overhang: float | None = None
    caps: bool = True
    exact: bool = False
    axis: str = AXES[0]
    density: float | tuple[float, float] | None = None
    middle: tuple[float, float] = (0.0, 0.0)
    warnings: tuple[str, ...] = ()
    layers: Layers | None = None
    layer_gap: float | None = None
    cure: str = ""
    names: QuantityNames = quantity_name

    def __post_init__(self) -> None:
        object.__setattr__(self, "drawdown", as_drawdown(self.drawdown))

    def check(self) -> None:
        """Refuse a cloth that is jammed or impossible.

        Raises
        ------
        GeometryError
            There is no room for the yarns.
        InputError
            One measure contradicts another.
        """
        _ = self.height

    @property
    def densities(self) -> tuple[float, float] | None:
        """Mass per volume of the warp's and of the weft's yarn, in kg/m3; None if not known."""
        if isinstance(self.density, tuple) or self.density is None:
            return self.density
        return self.density, self.density

    @cached_property
    def diameter_sum(self) -> float:
        """Sum D of the mean diameters of warp and weft, in metres."""
        return self.warp.mean_diameter + self.weft.mean_diameter

    @cached_property
    def height(self) -> float:
        """Crimp height h1 of the warp, in metres; the weft has D - h1."""
        try:
            self._check_measures()
            height = self._choose_height()
            self._check_height(height)
        except GeometryError as error:
            if self.cure:
                error.cure = f"{self.cure} {error.cure}"
            raise
        return height

    @property
    def feasible_heights(self) -> tuple[float, float]:
        """Interval of the warp's crimp height h1, in metres, that leaves room for all yarns."""
        self._check_measures()
        if self.is_lenticular:
            low, high = self._lens_heights
            self._check_height(0.5 * (low + high))
            return low, high
        tightest, sum_ = self._tightest_spacings, self.diameter_sum
        check_height(*tightest, sum_, balanced_height(*tightest, sum_), self.names)
        return feasible_height(*tightest, sum_)

    def feasible_crimps(self, number: int) -> tuple[float, float]:
        # The low and the high end, for warp (0) or weft (1).
        low, high = (self._crimp_for_height(number, height) for height in self.feasible_heights)
        return min(low, high), max(low, high)

    @property
    def share(self) -> float:
        """Share h1 / (h1 + h2) of the warp in the distance of the axes at a crossing."""
        return self._share(self.height)

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of warp and weft."""
        return self.share, 1.0 - self.share

    @property
    def is_lenticular(self) -> bool:
        """Whether a family is lenticular; then crowns are level by default."""
        return "lenticular" in (self.warp.shape, self.weft.shape)

    @property
    def level_height(self) -> float:
        """Crimp height h1 of the warp, in metres, at which crowns are level."""
        return self.weft.mean_diameter

    @property
    def lean(self) -> float:
        """(h1 - `level_height`) / (d1 + d2); without lenticular yarns h1 / (d1 + d2)."""
        return self.share - self._level_shares[0]

    @property
    def _level_shares(self) -> tuple[float, float]:
        if not self.is_lenticular:
            return 0.0, 0.0
        share = self.level_height / self.diameter_sum
        return share, 1.0 - share

    def axis_heights(self, number: int, own: Floats, crossed: Floats) -> Floats:
        """Compute heights of axes over the mid-surface at crossings.

        Parameters
        ----------
        number : {0, 1}
            Warp or weft.
        own, crossed : ndarray of float
            Heights of both yarns, in metres, of shapes that broadcast.

        Returns
        -------
        ndarray of float
            In metres, h/2.
        """
        distance = 0.5 * (own + crossed)
        share, level = self.shares[number], self._level_shares[number]
        if not self.is_lenticular:
            return share * distance
        return np.asarray(0.5 * crossed + (share - level) * distance)

    @property
    def parts_per_gap(self) -> int:
        """Largest number of parts of an axis between neighbouring crossings, to estimate memory."""
        if self.axis == "spline":
            return 4
        # An arc of more than 60 degrees needs a height of more than half the sum of its radii.
        steep = max(self.shares) > 0.5 + 1e-9 or (self.layers and any(self.layers.has_changes))
        arcs = 2 if steep and not self.exact else 1
        return 2 * arcs + 1 + (self.warp.has_flats or self.weft.has_flats)

    @property
    def threads(self) -> tuple[Threads, Threads]:
        """Warp and weft."""
        return self.warp, self.weft

    @cached_property
    def sheets(self) -> tuple[tuple[Threads, Threads], ...]:
        """Warp and weft of the cloth, or of each of the two cloths of a double weave."""
        if self.layers is None:
            return (self.threads,)
        # Threads that change from one cloth to the other count as every other one in each cloth.
        ends, picks = (
            np.arange(count) % 2 == 1 if second is None else second
            for second, count in zip((self.layers.ends, self.layers.picks), self.size, strict=True)
        )
        return tuple(
            (self.warp.select(ends == second), self.weft.select(picks == second))
            for second in (False, True)
        )

    @property
    def sheet_thickness(self) -> float:
        """Thickness of the cloth, or of each cloth of a double weave, in metres."""
        tallest = np.array([float(np.max(threads.diameter)) for threads in self.threads])
        return max(
            2.0 * float(self.axis_heights(number, own, crossed)) + float(own)
            for number, (own, crossed) in enumerate((tallest, tallest[::-1]))
        )

    @property
    def level(self) -> float:
        """Height of the upper cloth of a double weave over the middle, in metres; otherwise 0."""
        if self.layers is None:
            return 0.0
        gap = _LAYER_GAP * self.diameter_sum if self.layer_gap is None else self.layer_gap
        return 0.5 * (self.sheet_thickness + gap)

    @property
    def size(self) -> tuple[int, int]:
        """Numbers of ends and picks."""
        return self.drawdown.shape[1], self.drawdown.shape[0]

    def yarn_blocks(self, number: int, count: int) -> list[slice]:
        # Blocks of `count` ends (0) or picks (1) whose crossings are processed together.
        return blocks(count, max(1, _CROSSINGS // self.size[1 - number]))

    @cached_property
    def strands(self) -> tuple[Floats, Floats, Floats]:
        """Turns per metre, plies and round diameters of all yarns, see `Threads.strands`."""
        own = [threads.strands(n) for threads, n in zip(self.threads, self.size, strict=True)]
        turns, plies, diameter = (np.concatenate(values) for values in zip(*own, strict=True))
        return turns, plies, diameter

    @cached_property
    def yarns(self) -> tuple[Yarns, Yarns]:
        """Ends and picks, each yarn by itself."""
        warp, weft = (
            threads.yarns(count, middle)
            for threads, count, middle in zip(self.threads, self.size, self.middle, strict=True)
        )
        return warp, weft

    def is_over(self, number: int, which: YarnIndices = slice(None)) -> Bools:
        # (yarns, crossings) Whether ends (0) or picks (1) lie over the yarns that they cross.
        return ~self.drawdown[which] if number else self.drawdown.T[which]

    def crossing_profile(self, number: int, which: YarnIndices = slice(None)) -> CrossingProfile:
        # Radii and heights of ends (0) or picks (1) at the yarns that they cross, a row per yarn.
        own, crossed = self.yarns[number].diameter[which][:, None], self.yarns[1 - number]
        arc = 0.5 * own + crossed.face_radius
        height = self.axis_heights(number, own, crossed.diameter)
        upper = self.is_over(number, which)
        height = np.where(upper, height, -height)
        if self.layers is None:
            return CrossingProfile(arc, height, None)
        same, above = (
            (table if number else table.T)[which]
            for table in (self.layers.same_cloth, self.layers.in_upper_cloth)
        )
        height = np.where(
            same,
            np.where(above, self.level, -self.level) + height,
            np.where(upper, self.level, -self.level) - height,
        )
        arc = np.where(same, arc, (1.0 + LAYER_CLEARANCE) * arc)
        return CrossingProfile(arc, height, self.layers.bends(number)[which])

    @cached_property
    def yarn_groups(self) -> tuple[YarnGroups, YarnGroups]:
        """Courses of warp and weft; yarns of one course have equal axes."""
        return self._group_yarns(0), self._group_yarns(1)

    @cached_property
    def rest_heights(self) -> Floats:
        """(2, picks, ends) Distances of warp and weft from the mid-surface, in metres."""
        warp, weft = (yarns.diameter for yarns in self.yarns)
        ends, picks = warp, weft[:, None]
        return np.stack([self.axis_heights(0, ends, picks), self.axis_heights(1, picks, ends)])

    @cached_property
    def arc_ratios(self) -> Floats:
        """(2, picks, ends) Radii of the arcs of warp and weft over the distance of their axes."""
        (warp, weft), shape = self.yarns, (2, *self.drawdown.shape)
        if not self.is_lenticular:
            return np.ones(shape)
        ends, picks = 0.5 * warp.diameter, 0.5 * weft.diameter[:, None]
        faces = weft.face_radius[:, None], warp.face_radius
        return np.stack([(ends + faces[0]), (picks + faces[1])]) / (ends + picks)

    def _group_yarns(self, number: int) -> YarnGroups:
        upper, diameter = self.is_over(number), self.yarns[number].diameter
        sizes = diameter.view(np.uint8).reshape(len(upper), -1)
        keys = [upper]
        if self.layers is not None:
            same, above = (
                self.layers.same_cloth,
                self.layers.same_cloth & self.layers.in_upper_cloth,
            )
            keys += [self.layers.bends(number), *((t if number else t.T) for t in (same, above))]
        table = np.column_stack([*(np.packbits(one, axis=1) for one in keys), sizes])
        _, first, which = np.unique(table, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        return first[order], place[which.reshape(-1)]

    @cached_property
    def families(self) -> tuple[Family, Family]:
        """Mean measures of warp and weft, including Peirce's figures."""
        warp, weft = self.shares
        return self._family(0, warp), self._family(1, weft)

    def _share(self, height: float) -> float:
        # Rounding may put h1 slightly below 0 or above D.
        return min(max(height / self.diameter_sum, 0.0), 1.0)

    @cached_property
    def _tightest_spacings(self) -> tuple[float, float]:
        """Spacings p1 and p2 that make yarns of mean diameters as tight as the tightest gaps."""
        # Feasible heights over D depend on p'/D only.
        result = []
        for number in (0, 1):
            ratio = inf
            for threads in self._neighbours(number):
                room, diameters = threads.gaps()
                sums = diameters + np.max(self.threads[1 - number].diameter)
                ratio = min(ratio, float(np.min(room / sums, initial=inf)))
            # Without a second yarn there is nothing to bend between.
            result.append(ratio * self.diameter_sum if ratio < inf else self.diameter_sum)
        return result[0], result[1]

    def _neighbours(self, number: int) -> list[Threads]:
        """Return the threads of a family, separately for each cloth if none changes its cloth."""
        # Threads that change from one cloth to the other may be neighbours in either cloth.
        fixed = self.layers is None or self.layers.is_fixed
        return [sheet[number] for sheet in self.sheets] if fixed else [self.threads[number]]

    @cached_property
    def _lens_heights(self) -> tuple[float, float]:
        """Interval of h1 for lenticular yarns, in metres; if it is empty, low exceeds high."""
        leans = []
        for number, own in enumerate(self.threads):
            lean = inf
            for crossed in self._neighbours(1 - number):
                gaps = CrossedGaps(*crossed.gaps(), crossed.face_ratio)
                lean = min(lean, largest_lean(gaps, np.asarray(own.diameter)))
            leans.append(lean)
        # No axis may cross the mid-surface.
        sizes = [np.asarray(threads.diameter) for threads in self.threads]
        for number in (0, 1):
            least, most = float(np.min(sizes[1 - number])), float(np.max(sizes[number]))
            leans[1 - number] = min(leans[1 - number], least / (most + least))
        sum_ = self.diameter_sum
        return self.level_height - leans[1] * sum_, self.level_height + leans[0] * sum_

    def _check_height(self, height: float) -> None:
        """Refuse a crimp height h1 that leaves no room for the warp or the weft."""
        if not self.is_lenticular:
            check_height(*self._tightest_spacings, self.diameter_sum, height, self.names)
            return
        low, high = self._lens_heights
        grace = JAM * self.diameter_sum
        if low > high + grace:
            raise GeometryError(
                "the cloth is jammed: lenticular yarns have room only if 2 b1 b2 is at most "
                "p1² - a1² and p2² - a2² (b: height, a: width, p: spacing)",
                key=self.names("diameter", 0),
                value=self.warp.mean_diameter,
                allowed=self._largest_lenses,
                cure="Use thinner or narrower yarns, or a larger spacing",
            )
        if not low - grace <= height <= high + grace:
            raise GeometryError(
                f"the cloth is jammed: no room for the {'warp' if height > high else 'weft'} to "
                f"bend at a height of {format_length(height)}",
                key=self.names("crimp_height", 0),
                value=height,
                allowed=f"{format_length(low)} to {format_length(high)}",
                cure=f"Leave it out for level crowns, {format_length(self.level_height)}",
            )

    @property
    def _largest_lenses(self) -> str:
        """Largest heights of yarns of the present widths, in words."""
        products = []
        for threads in (t for number in (0, 1) for t in self._neighbours(number)):
            mean = neighbour_means(np.asarray(threads.diameter)) * threads.aspect
            if np.size(threads.spacing):
                products.append(float(np.min(np.square(threads.spacing) - mean**2)))
        product = 0.5 * max(min(products, default=inf), 0.0)
        names = self.names("diameter", 0), self.names("diameter", 1)
        equal = format_length(product**0.5) if product < inf else "any"
        return f"{names[0]} times {names[1]} up to {equal} squared at these widths and spacings"

    def _family(self, number: int, share: float) -> Family:
        """Compute mean measures; a mean gap has room if every gap has."""
        threads, other = self.threads[number], self.threads[1 - number]
        own, across = float(np.mean(threads.diameter)), float(np.mean(other.diameter))
        crossed = other.mean_spacing(other.aspect * across)
        found = [sheet[1 - number].gaps() for sheet in self.sheets]
        room, between = (np.concatenate(parts) for parts in zip(*found, strict=True))
        # From crossing to crossing of the same cloth; this distance includes flats.
        apart = crossed
        if self.layers is not None and room.size:
            apart = float(np.mean(room + (other.flat_aspect - 1.0) * between))
        beside = float(np.mean(between)) if room.size else across
        arcs = own + 2.0 * other.face_ratio * beside
        rise = share * arcs
        if self.is_lenticular:
            rise = beside + (share - self._level_shares[number]) * (own + beside)
        # A lone crossed yarn has no neighbour towards which to bend, so nothing is tight.
        gap = float(np.mean(room)) if room.size else max(crossed, arcs)
        theta, straight, length, crimp = solve(gap, rise, arcs)
        if room.size:
            length, crimp = length + (apart - gap), crimp * gap / apart
        return Family(
            diameter=own,
            spacing=threads.mean_spacing(threads.aspect * own),
            crossed=crossed,
            height=share * self.diameter_sum,
            overhang=0.5 * crossed if self.overhang is None else self.overhang,
            crimp=Crimp(theta, straight, length, crimp),
            width=threads.aspect * own,
        )

    def _crimp_for_height(self, number: int, height: float) -> float:
        """Compute the crimp of a family at a warp crimp height."""
        share = self._share(height)
        return float(self._family(number, 1.0 - share if number else share).crimp.crimp)

    def _choose_height(self) -> float:
        if self.crimp_height is not None:
            return self.crimp_height
        for number, threads in enumerate(self.threads):
            if threads.crimp is not None:
                return self._height_for_crimp(number, threads.crimp)
        if self.is_lenticular:
            low, high = self._lens_heights
            return min(max(self.level_height, low), high)
        return balanced_height(*self._tightest_spacings, self.diameter_sum)

    def _height_for_crimp(self, number: int, crimp: float) -> float:
        """Find the warp crimp height at which a family has a given crimp."""
        low, high = self.feasible_heights
        least, most = self.feasible_crimps(number)
        if not least - _TOLERANCE * most <= crimp <= most * (1.0 + _TOLERANCE):
            raise GeometryError(
                f"the {FAMILIES[number]} cannot have this crimp with these yarns and spacings",
                key=self.names("crimp", number),
                value=crimp,
                allowed=f"{least:.6g} to {most:.6g}",
                cure="Thinner yarns or wider spacings allow a larger range",
            )
        ends = (most, least) if number else (least, most)
        for end, height in zip(ends, (low, high), strict=True):
            if abs(crimp - end) <= _TOLERANCE * most:
                return height

        def remainder(height: float) -> float:
            return self._crimp_for_height(number, height) - crimp

        from scipy.optimize import brentq  # imported here: it takes a tenth of a second

        return float(brentq(remainder, low, high, xtol=1e-15 * self.diameter_sum, rtol=1e-15))

    def _check_measures(self) -> None:
        """Refuse measures that no crimp height can make feasible."""
        for number, threads in enumerate(self.threads):
            threads.check(number, self.size[number], self.names)
        for number in (0, 1):
            # Yarns of two cloths that never change places lie above each other, so they may overlap
            # in plan view.
            apart = self.layers is not None and not self.layers.has_changes[number]
            for threads in [s[number] for s in self.sheets] if apart else [self.threads[number]]:
                threads.check_neighbours(number, JAM, self.diameter_sum, self.names)
        if self.layers is not None:
            self.layers.check_room(self.threads, self.layer_gap, self.axis, self.names)
        if self.axis not in AXES:
            raise InputError(
                "unknown shape of a yarn's axis",
                key="axis",
                value=self.axis,
                allowed=" or ".join(f'"{axis}"' for axis in AXES),
            )
        if self.overhang is not None and not 0.0 <= self.overhang < inf:
            raise GeometryError(
                "a yarn cannot end before its last crossing",
                key="overhang",
                value=self.overhang,
                allowed="0 m or more",
            )
        if self.overhang == 0.0 and min(self.drawdown.shape) == 1:
            raise InputError(
                "a yarn with one crossing needs an overhang",
                key="overhang",
                value=0.0,
                allowed="more than 0 m",
            )
