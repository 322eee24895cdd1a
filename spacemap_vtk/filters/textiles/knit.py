"""Weft knits."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk import cache
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.filters.textiles.kind import Rest, TextileKind, keep_recent, recent
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import AnyInts, Bools, Floats, Ints, Progress
from spacemap_vtk.parameters import Choice, Integer, Parameter, Real
from spacemap_vtk.textile.rods.knit import (
    POINTS,
    Selvedges,
    relax_knit,
    relax_selvedges,
    repeat_knit,
    strip_wales,
)
from spacemap_vtk.textile.rods.stitches import GRAMMAR, STRUCTURES, parse_rows
from spacemap_vtk.textile.rods.tubes import PARTS
from spacemap_vtk.textile.rods.yarns import Yarn

#: Length of yarn in a stitch, in diameters, if none is given.
STITCH = 16.0
#: The selvedges that were relaxed last, by digest.
_selvedges: dict[str, Selvedges] = {}


class Stitches(Parameter[Any]):
    """Rows of stitches: a structure's name, or letters."""

    kind = "stitches"
    annotation = "str or sequence of str"
    expected = GRAMMAR

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to rows of equal length."""
        return parse_rows(value)

    def text(self, value: Any) -> str:
        """Format as a structure's name, or as rows with commas."""
        names = [name for name, rows in STRUCTURES.items() if rows == value]
        return f'"{names[0]}"' if names else f'"{", ".join(value)}"'


class Knit(TextileKind):
    """Loops of courses along x and wales along y, whose face looks along z."""

    name = "knit"
    family_names = ("courses",)

    rows = Stitches("stockinette", "Stitches of a repeat, seen from the face.")
    wales = Integer(8, "Number of stitches in a course.", minimum=1, maximum=10_000)
    courses = Integer(8, "Number of courses.", minimum=1, maximum=10_000)
    stitch_length = Real(
        None,
        "Length of yarn in a stitch.",
        unit="m",
        above=0.0,
        plausible=(1e-5, 1.0),
        usual_units="mm",
        automatic="16 diameters",
    )
    edges = Choice(
        "cut",
        "Sides of the piece. cut: each course is a yarn of its own; turned: the yarn turns at the "
        "selvedges and knits the next course, except where the colour changes. Selvedges take some "
        "seconds to relax, and need 3 wales.",
        ["cut", "turned"],
    )

    set_share = Real(
        0.0,
        "Share of the bending of the loops that is set, as by washing or steaming. Edges curl by "
        "what is not: 0 yarns are straight if free; 1 edges do not curl.",
        minimum=0.0,
        maximum=1.0,
    )

    springs = True

    @property
    def set_in_use(self) -> float:
        """Share of the yarns' bending that is set."""
        return float(self.set_share)

    def rest(self, progress: Progress | None = None) -> Rest:
        """Relax a repeat, in diameters."""
        length = self._stitch_diameters
        key = digest_of("knit", *self.rows, length)
        if (rest := recent(key)) is not None:
            return rest
        shape = (len(self.rows), POINTS * len(self.rows[0]), 3)
        found = cache.load(key, points=shape, cell=(2, 3), overlap=(1,))
        if found is None:
            made = relax_knit(self.rows, length, progress)
            points = np.stack([yarn.points for yarn in made.yarns])
            found = {"points": points, "cell": made.cell, "overlap": np.array([made.overlap])}
            cache.store(key, **found)
        yarns = [Yarn(points, (1, 0)) for points in found["points"]]
        return keep_recent(key, Rest(yarns, found["cell"], float(found["overlap"][0])))

    @property
    def _stitch_diameters(self) -> float:
        return STITCH if self.stitch_length is None else self.stitch_length / self.size

    def sides(self, progress: Progress | None = None) -> Selvedges | None:
        """Return the relaxed selvedges, in diameters; None if the courses are cut."""
        if self.edges == "cut" or self.wales < 3:
            return None
        yarns, cell, _ = self.rest(progress)
        strip = strip_wales(len(self.rows[0]), self.wales)
        key = digest_of("selvedges", *self.rows, self._stitch_diameters, strip)
        if key not in _selvedges:
            sides = (-1, -1, 3)
            found = cache.load(key, left=sides, right=sides, turns=sides, overlap=(1,))
            if found is None:
                made = relax_selvedges(yarns, cell, self._stitch_diameters, self.wales, progress)
                found = {"left": made.left, "right": made.right, "turns": made.turns}
                found["overlap"] = np.array([made.overlap])
                cache.store(key, **found)
            overlap = float(found.pop("overlap")[0])
            _selvedges.clear()
            _selvedges[key] = Selvedges(**found, wales=strip, overlap=overlap)
        return _selvedges[key]

    def _courses(self) -> tuple[AnyInts, Bools]:
        """Return the colour of each course, and whether its yarn is that of the course below."""
        colors = self.palette[np.arange(self.courses) % len(self.palette)]
        alike = (colors[1:] == colors[:-1]).all(axis=1)
        return colors, alike & (self.edges == "turned" and self.wales >= 3)

    @property
    def line_families(self) -> Ints:
        """All yarns are courses."""
        return np.zeros(self.courses - int(self._courses()[1].sum()), dtype=np.int64)

    @property
    def line_diameters(self) -> Floats:
        """All yarns are equal [m]."""
        return np.full(len(self.line_families), self.size)

    @property
    def line_colors(self) -> AnyInts:
        """Colours repeated over the courses."""
        colors, joined = self._courses()
        return colors[np.append(True, ~joined)]

    @property
    def parts(self) -> int:
        """Number of parts of all tubes."""
        return self.wales * self.courses * POINTS * PARTS

    def lines(self, progress: Progress | None = None) -> list[Floats]:
        """Repeat the relaxed loops, between selvedges or cut."""
        rest, joined = self.rest(progress), self._courses()[1]
        lines = repeat_knit(
            rest.yarns, rest.cell, self.wales, self.courses, self.sides(progress), joined.tolist()
        )
        return [line * self.scale for line in lines]

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return spacings, loop length, and their ratios."""
        wale = float(rest.cell[0, 0]) / len(self.rows[0]) * self.size
        course = float(rest.cell[1, 1]) / len(self.rows) * self.size
        loop = self.stitch_length or STITCH * self.size
        return [
            FabricFigure("course_spacing", "course spacing", course, "m"),
            FabricFigure("wale_spacing", "wale spacing", wale, "m"),
            FabricFigure("loop_length", "loop length", loop, "m"),
            FabricFigure("kc", "loop length over course spacing", loop / course),
            FabricFigure("kw", "loop length over wale spacing", loop / wale),
        ]

    def lengths(self, rest: Rest) -> Floats:
        """Return the given length of each course of a repeat, without its stretch."""
        return np.full(len(self.rows), self._stitch_diameters * len(self.rows[0]))

    def largest_overlap(self, rest: Rest) -> float:
        """Return the largest overlap of the repeat and its selvedges, in diameters."""
        sides = self.sides()
        return rest.overlap if sides is None else max(rest.overlap, sides.overlap)
