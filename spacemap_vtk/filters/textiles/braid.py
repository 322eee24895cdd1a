"""Braids, tubular and flat."""

from __future__ import annotations

from math import atan, degrees, pi, radians, tan

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.filters.textiles.kind import Crossed, Rest, TextileKind, yarn_lengths
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints, Progress
from spacemap_vtk.parameters import Choice, Flag, Integer, Real
from spacemap_vtk.textile.rods.braid import draw_strip, draw_tube
from spacemap_vtk.textile.rods.guess import Guess

#: Braid angle of a tube, and pick length of a strip in diameters, if none are given.
_ANGLE, _PITCH = 45.0, 2.5
#: Colour of a mandrel.
_GREY = (142, 150, 160)


class Braid(TextileKind):
    """Carriers that pass over and under each other, along y."""

    name = "braid"
    family_names = ("carriers", "mandrel")
    colors = ((196, 62, 58), (238, 226, 200), (52, 84, 122))

    form = Choice("tubular", "Form of a braid: round a mandrel, or a strip.", ["tubular", "flat"])
    carriers = Integer(16, "Number of yarns of a braid.", minimum=3, maximum=400)
    over = Integer(
        1,
        "Yarns that each yarn passes over, and then under: 1 diamond, 2 regular, 3 Hercules.",
        minimum=1,
        maximum=3,
    )
    mandrel = Real(
        None,
        "Diameter of the mandrel.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 1.0),
        usual_units="mm",
        automatic="so that yarns cover most of it",
        when={"form": ("tubular",)},
    )
    draw_mandrel = Flag(
        False,
        "Also draw the mandrel; it has the density of the yarns.",
        when={"form": ("tubular",)},
    )
    pick_length = Real(
        None,
        "Length along a braid from one crossing to the next one in line with it.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 1.0),
        usual_units="mm",
        automatic="of a tube by its braid angle; of a strip 2.5 diameters",
    )
    braid_angle = Real(
        None,
        "Angle of the yarns of a tube to its axis.",
        unit="deg",
        above=0.0,
        below=90.0,
        automatic="45 degrees, or by the pick length",
        when={"form": ("tubular",), "pick_length": (None,)},
    )
    repeats_along = Crossed.repeats_along

    def cell_of_sheet(self, progress: Progress | None = None) -> Rest:
        """Return the yarns of a strip; a tube is no sheet."""
        if self.form == "tubular":
            raise InputError(
                "a tubular braid is no sheet",
                key="material",
                value="yarns",
                cure='Set textile.form = "flat", or choose another material.',
            )
        return super().cell_of_sheet(progress)

    @property
    def _mandrel(self) -> float:
        """Diameter of the mandrel [diameters]."""
        if self.mandrel is not None:
            return float(self.mandrel / self.size)
        return max(1.0, self.carriers * 1.25 / pi - 2.0)

    @property
    def _pitch(self) -> float:
        """Pick length [diameters]."""
        if self.pick_length is not None:
            return float(self.pick_length / self.size)
        if self.form == "flat":
            return _PITCH
        round_ = pi * (self._mandrel + 2.0)
        angle = _ANGLE if self.braid_angle is None else self.braid_angle
        return round_ / tan(radians(angle)) / (self.carriers / 2)

    def guess(self) -> Guess:
        """Draw a cell of one crossing."""
        if self.form == "flat":
            return draw_strip(self.carriers, self.over, self._pitch)
        return draw_tube(self.carriers, self.over, self._mandrel, self._pitch)

    @property
    def cells(self) -> tuple[int, int]:
        """Number of cells; the other period is 0."""
        return self.repeats_along, self.repeats_along

    @property
    def _has_mandrel(self) -> bool:
        return bool(self.draw_mandrel) and self.form == "tubular"

    def lines(self, progress: Progress | None = None) -> list[Floats]:
        """Repeat the carriers, and draw the mandrel from end to end."""
        lines = super().lines(progress)
        if not self._has_mandrel:
            return lines
        along = np.concatenate(lines)[:, 1]
        reach = self._mandrel * self.size
        places = np.linspace(along.min() - reach, along.max() + reach, 4 * self.repeats_along + 4)
        return [*lines, places[:, None] * np.array([0.0, 1.0, 0.0])]

    @property
    def line_families(self) -> Ints:
        """0 for the carriers, 1 for the mandrel."""
        mandrel = np.ones(int(self._has_mandrel), dtype=np.int64)
        return np.concatenate([super().line_families, mandrel])

    @property
    def line_diameters(self) -> Floats:
        """Diameters of the carriers and of the mandrel [m]."""
        return np.append(super().line_diameters, [self._mandrel * self.size] * self._has_mandrel)

    @property
    def line_colors(self) -> AnyInts:
        """Colours repeated over the carriers; the mandrel is grey."""
        carriers = len(super().line_families)
        colors = self.palette[np.arange(carriers) % len(self.palette)]
        return np.concatenate([colors, [_GREY]]).astype(np.uint8) if self._has_mandrel else colors

    @property
    def parts(self) -> int:
        """Number of parts of all tubes."""
        return super().parts // self.repeats_along

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return pick length, width or diameter, angle, and mass per length."""
        unit = self.scale
        pitch = float(abs(rest.cell).max()) * unit
        places = np.concatenate([yarn.points for yarn in rest.yarns])
        lengths = yarn_lengths(rest)
        mass = float(self.mass_per_length(np.array([self.size]))[0] * lengths.sum()) * unit
        found = [FabricFigure("pick_length", "pick length", pitch, "m")]
        if self.form == "flat":
            width = (float(np.ptp(places[:, 0])) + 1.0) * unit
            found.append(FabricFigure("width", "width", width, "m"))
        else:
            radius = float(np.hypot(places[:, 0], places[:, 2]).mean()) * unit
            lay = self.carriers / 2 * pitch
            angle = atan(2 * pi * radius / lay)
            found.append(FabricFigure("mean_diameter", "mean diameter", 2 * radius, "m"))
            found.append(FabricFigure("braid_angle", "braid angle", degrees(angle), "deg"))
            found.append(FabricFigure("lay_length", "length of one turn", lay, "m"))
        found.append(FabricFigure("linear_mass", "mass per length", mass / pitch, "kg/m"))
        return found
