"""What a test returns: figures with units, curves, and states of the specimen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.contact.surfaces import Surface
from spacemap_vtk.mechanics.modal.convergence import SHEET_ORDER, estimate_error
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.units import GRAVITY, format_quantity, format_uncertain, typeset_units

_GF = 1e-3 * GRAVITY
#: Text for a figure that the model does not give; its note says why.
NOT_MODELLED = "not modelled"
#: An error below this share of its figure is rounding.
_ROUNDING = 1e-8


class Unit(NamedTuple):
    """Unit of an instrument."""

    name: str
    """As the instrument prints it."""
    size: float
    """Size in SI."""
    si: str
    """The unit in SI, a key of `spacemap_vtk.units.UNITS` where there is one."""


GF_PER_CM = Unit("gf/cm", 100.0 * _GF, "N/m")
GF_PER_CM_DEGREE = Unit("gf/(cm·°)", float(np.degrees(100.0 * _GF)), "N/m")
GF_CM2_PER_CM = Unit("gf·cm²/cm", 1e-2 * _GF, "N.m")
GF_CM_PER_CM = Unit("gf·cm/cm", _GF, "N")
GF_CM_PER_CM2 = Unit("gf·cm/cm²", 100.0 * _GF, "J/m2")
GF_PER_CM2 = Unit("gf/cm²", 1e4 * _GF, "Pa")
N_PER_M = Unit("N/m", 1.0, "N/m")
MICRONEWTON_METRE = Unit("µN·m", 1e-6, "N.m")
PER_CM = Unit("1/cm", 100.0, "1/m")
MILLIMETRE = Unit("mm", 1e-3, "m")
PERCENT = Unit("%", 1e-2, "")
DEGREE = Unit("°", float(np.radians(1.0)), "rad")
PURE = Unit("", 1.0, "")


class Reading(NamedTuple):
    """A figure that an instrument prints."""

    symbol: str
    """As on the instrument's sheet, for example ``2HG5``."""
    name: str
    """Name in words."""
    direction: str
    """For example ``warp``; empty if the figure has none."""
    value: float | None
    """In SI; None if it is not modelled, and the note says why."""
    unit: Unit
    error: float | None = None
    """Estimated error in SI that is due to cells; None if it is not known, or there is none."""
    note: str = ""
    exact: bool = False
    """Whether it is a closed form or a solution to rounding, so that no cells are to blame."""

    @property
    def text(self) -> str:
        """The figure in the instrument's unit, with its error."""
        if self.value is None:
            return NOT_MODELLED
        value, unit = self.value / self.unit.size, self.unit.name
        if self.error is not None:
            return f"{format_uncertain(value, self.error / self.unit.size)} {unit}".rstrip()
        return f"{value:.4g} {unit}".rstrip() + " (exact)" * self.exact

    @property
    def si_text(self) -> str:
        """The figure in SI; empty if that is the same."""
        si = self.unit.si
        if self.value is None or si in ("", "rad"):
            return ""
        text = typeset_units(format_quantity(self.value, si, 4))
        return "" if text == f"{self.value / self.unit.size:.4g} {self.unit.name}" else text

    def as_json(self) -> dict[str, object]:
        """Return the figure for programs."""
        return {
            "symbol": self.symbol,
            "name": self.name,
            "direction": self.direction,
            "value": None if self.value is None else self.value / self.unit.size,
            "unit": self.unit.name,
            "si_value": self.value,
            "si_unit": self.unit.si,
            "error": None if self.error is None else self.error / self.unit.size,
            "exact": self.exact,
            "note": self.note,
        }


def mark_exact(readings: Iterable[Reading]) -> list[Reading]:
    """Mark figures that are closed forms, or solutions to rounding."""
    return [each._replace(exact=each.value is not None) for each in readings]


def add_errors(
    readings: Sequence[Reading],
    *wider: Sequence[Reading],
    ratios: tuple[float, float] = (2.0, 2.0),
    order: float = SHEET_ORDER,
) -> tuple[list[Reading], list[str]]:
    """Add errors to figures from those in wider cells, with notes on figures not converged."""
    # `ratios` are widths over that of the next narrower cells, `order` the largest power of the
    # width with which errors fall. A figure that does not depend on the cells is exact.
    found, rough = [], []
    others = [{each[:3]: each.value for each in figures} for figures in wider]
    for reading in readings:
        values = [each.get(reading[:3]) for each in others]
        known = [value for value in values if value is not None]
        if reading.value is None or reading.exact or len(known) < len(values):
            found.append(reading)
            continue
        error, converged = estimate_error(
            reading.value,
            known[0],
            ratios[0],
            coarsest=known[1] if len(known) > 1 else None,
            coarsest_ratio=ratios[1],
            order=order,
        )
        if error <= _ROUNDING * abs(reading.value):
            found.append(reading._replace(exact=True))
            continue
        found.append(reading._replace(error=error))
        if not converged:
            rough.append(f"{reading.symbol} {reading.direction}".rstrip())
    notes = [f"the cells are too wide for {', '.join(rough)} (± above 5 %)"] if rough else []
    return found, notes


class Axis(NamedTuple):
    """Quantity along an axis of a curve."""

    name: str
    unit: Unit

    @property
    def label(self) -> str:
        """Name and the instrument's unit."""
        return f"{self.name} [{self.unit.name}]" if self.unit.name else self.name


_NO_AXIS = Axis("", PURE)


class Curve(NamedTuple):
    """A curve of n points as the instrument draws it."""

    name: str
    x: Floats
    """(n,) In SI."""
    y: Floats
    """(n,) In SI."""


@dataclass(frozen=True, eq=False)
class States:
    """States of a specimen, in a cage of one layer in which its yarns can be drawn."""

    #: (V, 3) Undeformed vertices [m]; x along the weft, y along the warp, the middle at the origin.
    points: Floats
    #: (T, 4) Tetrahedra.
    cells: Ints
    #: (n, V, 3) Displacement in each state [m].
    displacements: Floats
    #: (n, 2) Place of each state in the plot [SI].
    marks: Floats
    #: Camera that shows the test well, as in a scene's view.
    camera: str = "lying"
    #: Middle of the undeformed specimen, if it is not a rectangle along its yarns.
    surface: Surface | None = None
    #: Parts of the instrument that do not move.
    fixtures: Sequence[Surface] = ()
    #: (n, k, 2) Line in the plot in each state [SI], instead of a mark.
    lines: Floats | None = None
    #: What the plot says beside a line in each state.
    captions: Sequence[str] = ()

    @property
    def size(self) -> tuple[float, float]:
        """Size of the specimen along weft and warp [m]."""
        width, length = np.ptp(self.points[:, :2], axis=0)
        return float(width), float(length)


@dataclass(frozen=True, eq=False)
class Measurement:
    """Result of a test."""

    readings: Sequence[Reading]
    curves: Sequence[Curve] = ()
    x_axis: Axis = _NO_AXIS
    y_axis: Axis = _NO_AXIS
    #: Sentences about the test and its figures.
    notes: Sequence[str] = ()
    states: States | None = None
    #: Finds the states, where that takes long and only a film needs them.
    find_states: Callable[[Progress], States] | None = None

    @property
    def has_film(self) -> bool:
        """Whether the specimen can be filmed."""
        return self.states is not None or self.find_states is not None

    def reading(self, symbol: str, direction: str = "") -> Reading:
        """Return a figure by its symbol and direction.

        Parameters
        ----------
        symbol, direction : str
            As in the reading.

        Returns
        -------
        Reading
            The first one.
        """
        return next(r for r in self.readings if (r.symbol, r.direction) == (symbol, direction))


def map_sheet(
    size: tuple[float, float],
    thickness: float,
    divisions: tuple[int, int],
    shapes: Sequence[Callable[[Floats], tuple[Floats, Floats]]],
    marks: Floats,
    camera: str = "lying",
) -> States:
    """Compute states of a rectangular specimen from maps of its mid-surface."""
    width, length = size
    bounds = (-width / 2, width / 2, -length / 2, length / 2, -thickness / 2, thickness / 2)
    points, cells = build_lattice(bounds, (*divisions, 1))
    moved = []
    for shape in shapes:
        middle, normal = shape(points[:, :2])
        moved.append(middle + points[:, 2:] * normal - points)
    return States(points, cells, np.array(moved), marks, camera)
