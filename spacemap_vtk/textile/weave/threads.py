"""Warp and weft of a cloth: diameters, spacings, sections, colours and twist of their yarns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.weave.families import FAMILIES, QuantityNames, quantity_name
from spacemap_vtk.textile.weave.lens import face_radius, neighbour_means
from spacemap_vtk.textile.weave.yarn import section_factor, usual_twist
from spacemap_vtk.units import format_length

#: Sections of a yarn, the default first.
SECTIONS = ("circular", "racetrack", "elliptic", "lenticular")

#: One value for all yarns of a family, or one for each.
Lengths = float | Floats
#: Some yarns of a family, by their numbers.
YarnIndices = slice | Ints


class Yarns(NamedTuple):
    """Yarns of one family, with values for each; lengths in metres."""

    diameter: Floats
    """(n,) Heights of the sections."""
    spacing: Floats
    """(n - 1,) Distances between neighbours."""
    aspect: float
    """Width of each section over its height."""
    section: str
    """One of `SECTIONS`; "circular" wherever the aspect is 1."""
    position: Floats
    """(n,) Positions across the whole family."""

    def select(self, which: YarnIndices) -> Yarns:
        """Select some of the yarns; their positions stay unchanged."""
        position = self.position[which]
        return self._replace(
            diameter=self.diameter[which], spacing=np.diff(position), position=position
        )

    @property
    def flat(self) -> Floats:
        """(n,) Length on top of each yarn along which a crossing yarn is straight."""
        return (flat_aspect(self.section, self.aspect) - 1.0) * self.diameter

    @property
    def face_radius(self) -> Floats:
        """(n,) Radius of the arc on which each yarn is crossed."""
        return face_ratio(self.section, self.aspect) * self.diameter


@dataclass(frozen=True, kw_only=True, eq=False)
class Threads:
    """The warp or the weft of a cloth; `spacemap_vtk.textile.weave.cloth.Cloth` checks it.

    Parameters
    ----------
    diameter : float or array_like
        Diameter d of all yarns, or of each, in metres; the height of a flattened section.
    spacing : float or array_like
        Distance p between neighbours, in metres; one value, or n - 1 values for n yarns.
    section : {"circular", "racetrack", "elliptic", "lenticular"}
        A racetrack is a rectangle between two half circles. Axes are exact for circles and
        racetracks: yarns touch along arcs and flats and never overlap. An ellipse has the axis of
        the racetrack of equal size, which contains it. So ellipses touch in the middle of each
        crossing and never overlap, but they leave a gap on both sides that real yarns would close.
        A lens lies between two arcs, on which yarns touch; see
        `spacemap_vtk.textile.weave.lens`.
    aspect : float
        Width of the section over its height, at least 1; 1 for circles.
    crimp : float, optional
        Crimp c = l / p - 1 where yarns change side; it replaces the cloth's crimp height.
    colors : ndarray of uint8
        (n, 3) Red, green and blue of each yarn, or (1, 3) for all; white by default.
    twist : float or array_like, optional
        Turns per metre, positive for Z and negative for S, of all yarns or of each. By default
        `spacemap_vtk.textile.weave.yarn.usual_twist`. It affects appearance only.
    plies : float or array_like
        Number of singles that are twisted together; 1 for singles. It affects appearance only.
    size : {"given", "draft", "assumed"}
        Where the size of the yarns comes from; "assumed" if it is only a plausible default.
    float_width : float or array_like, optional
        Largest width to which the floats of lenticular yarns swell, in metres. By default they
        close up with their neighbours; a pattern weft also covers the tabby beside it.
    """

    diameter: Lengths
    spacing: Lengths
    section: str = SECTIONS[0]
    aspect: float = 1.0
    crimp: float | None = None
    colors: NDArray[np.uint8] = field(default_factory=lambda: np.full((1, 3), 255, np.uint8))
    twist: Lengths | None = None
    plies: Lengths = 1.0
    size: str = "given"
    float_width: Lengths | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "diameter", _freeze(self.diameter))
        object.__setattr__(self, "spacing", _freeze(self.spacing))
        if self.float_width is not None:
            object.__setattr__(self, "float_width", _freeze(self.float_width))

    @property
    def shape(self) -> str:
        """The section; "circular" if the aspect is 1."""
        return self.section if self.aspect > 1.0 else "circular"

    @property
    def flat_aspect(self) -> float:
        """Aspect of the racetrack on whose flat a yarn is crossed; 1 if there is no flat."""
        return flat_aspect(self.shape, self.aspect)

    @property
    def has_flats(self) -> bool:
        """Whether yarns have a flat on top, along which a crossing yarn is straight."""
        return self.flat_aspect > 1.0

    @property
    def face_ratio(self) -> float:
        """Radius of the arc on which a yarn is crossed, over its height."""
        return face_ratio(self.shape, self.aspect)

    @property
    def mean_diameter(self) -> float:
        """Mean height of the sections."""
        return self.diameter if isinstance(self.diameter, float) else float(np.mean(self.diameter))

    def mean_spacing(self, width: float) -> float:
        """Compute the mean spacing.

        Parameters
        ----------
        width : float
            Value for a single yarn, in metres.

        Returns
        -------
        float
            In metres.
        """
        return float(np.mean(self.spacing)) if np.size(self.spacing) else width

    def gaps(self) -> tuple[Floats, Floats]:
        # Room of gaps for yarns that pass, p' (spacing less half the flats on both sides), and the
        # mean diameter of both neighbours.
        mean = neighbour_means(self.diameter)
        if mean.size == 0 or np.size(self.spacing) == 0:
            return np.empty(0), np.empty(0)
        room = np.asarray(self.spacing) - (self.flat_aspect - 1.0) * mean
        return np.atleast_1d(room), np.atleast_1d(mean)

    def select(self, which: Bools) -> Threads:
        # Selects some threads; their positions stay unchanged.
        yarns = self.yarns(len(which)).select(np.flatnonzero(which))
        colors = self.colors if len(self.colors) == 1 else self.colors[which]
        twist, plies, wide = self.twist, self.plies, self.float_width
        return replace(
            self,
            diameter=yarns.diameter,
            spacing=yarns.spacing,
            colors=colors,
            twist=twist[which] if isinstance(twist, np.ndarray) else twist,
            plies=plies[which] if isinstance(plies, np.ndarray) else plies,
            float_width=wide[which] if isinstance(wide, np.ndarray) else wide,
        )

    def strands(self, count: int) -> tuple[Lengths, Lengths, Lengths]:
        """Compute turns per metre, plies, and diameters of round yarns of equal area.

        Parameters
        ----------
        count : int
            Number of yarns.

        Returns
        -------
        tuple of 3 ndarray of float, shape (count,)
            Turns are positive for Z twist.
        """
        round_ = np.sqrt(section_factor(self.aspect, self.shape) / (0.25 * np.pi)) * self.diameter
        usual = usual_twist(np.asarray(round_), np.asarray(self.plies))
        values = usual if self.twist is None else self.twist, self.plies, round_
        turns, plies, diameter = (np.array(np.broadcast_to(v, count)) for v in values)
        return turns, plies, diameter

    def yarns(self, count: int, middle: float = 0.0) -> Yarns:
        # Values of each yarn; positions are centred on `middle`, in m.
        apart = np.array(np.broadcast_to(self.spacing, count - 1))
        return Yarns(
            np.array(np.broadcast_to(self.diameter, count)),
            apart,
            self.aspect,
            self.shape,
            _centre_positions(apart) + middle,
        )

    def check(self, family: int, count: int, names: QuantityNames = quantity_name) -> None:
        """Refuse bad lengths, wrong numbers of values, and impossible sections."""
        for key, values, expected in (
            ("diameter", self.diameter, count),
            ("spacing", self.spacing, count - 1),
        ):
            array = np.asarray(values)
            if array.ndim > 1:
                raise InputError(
                    f"the array has shape {array.shape}",
                    key=names(key, family),
                    allowed="one value, or one for each yarn",
                )
            wrong = ~(np.isfinite(array) & (array > 0.0))
            if wrong.any() or (array.size == 0 and key == "diameter"):
                raise GeometryError(
                    "the length must be positive and finite",
                    key=names(key, family),
                    value=float(array.flat[np.argmax(wrong)]) if array.size else None,
                    allowed="more than 0 m",
                    cure='Write, for example, "0.3 mm"',
                )
            if array.ndim and array.size != expected:
                raise InputError(
                    f"{array.size} values for {count} yarns",
                    key=names(key, family),
                    allowed=f"one value, or {expected}",
                )
        if self.section not in SECTIONS:
            raise InputError(
                "unknown section",
                key=names("section", family),
                value=self.section,
                allowed=" or ".join(f'"{section}"' for section in SECTIONS),
            )
        round_ = self.section == "circular"
        if not (isfinite(self.aspect) and self.aspect >= 1.0) or (round_ and self.aspect != 1.0):
            raise GeometryError(
                f"a {self.section} section cannot have this aspect (width over height)",
                key=names("aspect", family),
                value=self.aspect,
                allowed="1" if round_ else "1 or more",
                cure='Use the section "lenticular" or "racetrack" for flattened yarns'
                if round_
                else "A section must be at least as wide as it is high",
            )

    def check_neighbours(
        self, family: int, grace: float, diameter_sum: float, names: QuantityNames = quantity_name
    ) -> None:
        """Refuse yarns that overlap their neighbours by more than a share of their size."""
        mean = neighbour_means(self.diameter)
        if mean.size == 0 or np.size(self.spacing) == 0:
            return
        width, room = np.broadcast_arrays(self.aspect * mean, np.asarray(self.spacing))
        over = width - room > grace * (diameter_sum + width)
        if over.any():
            worst = int(np.argmax(over))
            which = f" {worst + 1} and {worst + 2}" if over.size > 1 else ""
            thick, apart = float(width.flat[worst]), float(room.flat[worst])
            flat = self.aspect != 1.0
            diameter, spacing, aspect = (
                names(quantity, family) for quantity in ("diameter", "spacing", "aspect")
            )
            raise GeometryError(
                f"neighbouring {FAMILIES[family]} yarns{which} overlap: they are "
                f"{format_length(thick)} {'wide' if flat else 'thick'} and "
                f"{format_length(apart)} apart",
                key=diameter,
                value=thick / self.aspect,
                allowed=f"up to {format_length(apart / self.aspect)} ({spacing}"
                f"{f' over {aspect}' if flat else ''})",
                cure=f"Make {diameter} smaller or {spacing} larger",
            )


def flat_aspect(section: str, aspect: float) -> float:
    """Return the aspect of the racetrack on whose flat a yarn is crossed; 1 if there is no flat."""
    return 1.0 if section == "lenticular" else aspect


def face_ratio(section: str, aspect: float) -> float:
    """Return the radius of the arc on which a yarn is crossed, over its height."""
    return face_radius(aspect) if section == "lenticular" else 0.5


def repeat_values(values: Lengths | tuple[float, ...], count: int) -> Lengths:
    """Repeat values over a number of yarns; equal values become one."""
    if np.ndim(values) == 0:
        return values  # type: ignore[return-value]
    return collapse_equal(np.resize(np.asarray(values, dtype=np.float64), count))


def collapse_equal(values: Floats) -> Lengths:
    """Replace an array of equal values by one value."""
    return float(values[0]) if (values == values[0]).all() else values


def _freeze(value: Lengths) -> Lengths:
    array = np.array(value, dtype=np.float64)
    if array.ndim == 0:
        return float(array)
    array.flags.writeable = False
    return array


def _centre_positions(spacing: Floats) -> Floats:
    """Compute (n + 1,) positions from (n,) distances, centred on 0."""
    count = len(spacing) + 1
    if spacing.size == 0 or np.ptp(spacing) == 0.0:
        # Exactly symmetric, because no rounding errors add up.
        step = spacing[0] if spacing.size else 0.0
        return np.asarray(step * (np.arange(count) - 0.5 * (count - 1)))
    place = np.concatenate([[0.0], np.cumsum(spacing)])
    return place - 0.5 * place[-1]
