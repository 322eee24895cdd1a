"""Weft knits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from spacemap_vtk import cache
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.filters.textiles.kind import CONTACT, Rest, TextileKind, keep_recent, recent
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import AnyInts, Bools, Floats, Ints, Progress
from spacemap_vtk.parameters import Choice, Integer, Parameter, Real
from spacemap_vtk.textile.rods.bound_piece import BoundPiece, relax_bound_piece
from spacemap_vtk.textile.rods.ends import FREE, HELD, Ends, relax_ends
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.knit import (
    Selvedges,
    courses_and_passes,
    relax_knit,
    relax_selvedges,
    repeat_knit,
    strip_wales,
)
from spacemap_vtk.textile.rods.loops import POINTS, column_starts
from spacemap_vtk.textile.rods.relax import SEARCH
from spacemap_vtk.textile.rods.rolled import Rolled, repeat_round, roll_yarns
from spacemap_vtk.textile.rods.stitches import (
    CHART_GRAMMAR,
    GRAMMAR,
    STRUCTURES,
    Pass,
    parse_chart,
    parse_rows,
    plan_passes,
)
from spacemap_vtk.textile.rods.tubes import PARTS
from spacemap_vtk.textile.rods.yarns import Yarn

#: Length of yarn in a stitch, in diameters, if none is given.
STITCH = 16.0
#: Least number of stitches round a tube.
LEAST_ROUND = 8
#: Most stitches of a piece of one yarn, of which all edges relax at once, in two minutes.
MOST_BOUND = 256
#: The tube that was relaxed last, by digest.
_tubes: dict[str, Rolled] = {}
#: The selvedges that were relaxed last, by digest.
_selvedges: dict[str, Selvedges] = {}
#: The ends that were relaxed last, by digest.
_ends: dict[str, Ends] = {}
#: The piece of one yarn that was relaxed last, by digest.
_pieces: dict[str, BoundPiece] = {}


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


class Chart(Parameter[Any]):
    """Rows of letters of colours."""

    kind = "chart"
    annotation = "str or sequence of str"
    expected = CHART_GRAMMAR

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to rows of equal length."""
        return parse_chart(value)

    def text(self, value: Any) -> str:
        """Format as rows with commas."""
        return f'"{", ".join(value)}"'


class Knit(TextileKind):
    """Loops of courses along x and wales along y, whose face looks along z."""

    name = "knit"
    family_names = ("courses",)

    rows = Stitches("stockinette", "Stitches of a repeat, seen from the face.")
    chart = Chart(
        None,
        "Colours of the stitches of a repeat, a letter each: A is the first colour of color.",
        automatic="colours are repeated over the courses",
    )
    back = Choice(
        "floats",
        "Back of a chart. floats: yarns float behind the stitches of others; knitted: a second bed "
        "of needles knits them there, in turns (jacquard with a bird's-eye back). Its stitches are "
        "not counted as wales.",
        ["floats", "knitted"],
    )
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
    wale_spacing = Real(
        None,
        "Width of a stitch; a given one is that to which the knit is blocked or stretched.",
        unit="m",
        above=0.0,
        plausible=(1e-5, 0.1),
        usual_units="mm",
        automatic="as the yarns come to rest; 5 or 7 diameters in a warp knit whose wales no "
        "underlap joins",
    )
    course_spacing = Real(
        None,
        "Height of a stitch; a given one is that to which the knit is blocked or stretched.",
        unit="m",
        above=0.0,
        plausible=(1e-5, 0.1),
        usual_units="mm",
        automatic="as the yarns come to rest",
    )
    edges = Choice(
        "cut",
        "Sides of the piece. cut: each course is a yarn of its own; turned: the yarn turns at the "
        "selvedges and knits the next course, except where the colour changes. Selvedges take some "
        "seconds to relax, and need 3 wales, of which the outermost are knit or purl, in rows of "
        "one colour. "
        "joined: a tube, as a sleeve, whose face is outside; each course is a ring of all wales.",
        ["cut", "turned", "joined"],
    )

    ends = Choice(
        "cut",
        "Lower and upper end of the piece. cut: loops are open, and the knit ravels; bound: closed "
        "loops are cast on, and a chain binds the last loops off. Bound ends take some seconds to "
        "relax, and need 4 courses, of which the first and last four are of knit and purl "
        "stitches, in rows of one colour. With turned sides, the yarn runs from the cast-on to the "
        f"chain, where it is fastened off; such a piece has up to {MOST_BOUND} stitches, only knit "
        "and purl ones, and takes longer.",
        ["cut", "bound"],
    )

    set_share = Real(
        0.0,
        "Share of the bending of the loops that is set, as by washing or steaming. Edges curl by "
        "what is not: 0 yarns are straight if free; 1 edges do not curl.",
        minimum=0.0,
        maximum=1.0,
    )

    loops = True

    @property
    def springs(self) -> bool:
        """Whether yarns are straight if free; those of a blocked knit are set."""
        return self.wale_spacing is None and self.course_spacing is None

    def cell_of_sheet(self, progress: Progress | None = None) -> Rest:
        """Return the yarns of a flat knit; a tube is no sheet."""
        if self.edges == "joined":
            raise InputError(
                "a knitted tube is no sheet",
                key="material",
                value="yarns",
                cure="Choose other edges, or another material.",
            )
        return super().cell_of_sheet(progress)

    @property
    def set_in_use(self) -> float:
        """Share of the yarns' bending that is set."""
        return float(self.set_share)

    @property
    def _has_second_bed(self) -> bool:
        """Whether needles of a second bed are between those of the first one."""
        return bool(self.back == "knitted")

    @property
    def _beds(self) -> int:
        """Number of beds of needles."""
        return 2 if self._has_second_bed else 1

    @property
    def _repeat(self) -> int:
        """Number of wales of a repeat."""
        return len(self._passes[0].letters) // self._beds

    @property
    def _passes(self) -> list[Pass]:
        """The passes of a repeat."""
        if self._has_second_bed and self.chart is None:
            raise InputError(
                "a knitted back needs a chart of colours",
                key="back",
                value=self.back,
                cure='Give a chart, or set back = "floats".',
            )
        passes = plan_passes(self.rows, self.chart or (), self._has_second_bed)
        if self.chart is not None and (most := max(each.color for each in passes)) >= (
            count := len(self.palette)
        ):
            raise InputError(
                f"the chart has the letter {chr(ord('A') + most)}, but there "
                f"{'is' if count == 1 else 'are'} {count} colour{'s' if count > 1 else ''}",
                key="chart",
                cure="Give a colour for each letter: A is the first one, B the second one.",
            )
        return passes

    def rest(self, progress: Progress | None = None) -> Rest:
        """Relax a repeat, in diameters."""
        length, passes = self._stitch_diameters, self._passes
        key = self._key("loops")
        if (rest := recent(key)) is not None:
            return rest
        counts = np.cumsum([column_starts(each)[-1] for each in passes])
        found = cache.load(key, points=(int(counts[-1]), 3), cell=(2, 3), overlap=(1,))
        if found is None:
            made = relax_knit(
                self.rows, length, self.chart or (), self._spacings, progress, self._has_second_bed
            )
            points = np.concatenate([yarn.points for yarn in made.yarns])
            found = {"points": points, "cell": made.cell, "overlap": np.array([made.overlap])}
            cache.store(key, **found)
        yarns = [Yarn(points, (1, 0)) for points in np.split(found["points"], counts[:-1])]
        return keep_recent(key, Rest(yarns, found["cell"], float(found["overlap"][0])))

    def _key(self, what: str) -> str:
        """Return the digest of all on which yarns at rest depend."""
        given = (self._stitch_diameters, *(each or 0.0 for each in self._spacings))
        return digest_of(what, SEARCH, *map(str, self._passes), *given, CONTACT)

    @property
    def _spacings(self) -> tuple[float | None, float | None]:
        """Given wale and course spacing [diameters]."""
        wale, course = self.wale_spacing, self.course_spacing
        return wale and wale / self.size, course and course / self.size

    @property
    def _stitch_diameters(self) -> float:
        return STITCH if self.stitch_length is None else self.stitch_length / self.size

    @property
    def _is_plain(self) -> bool:
        """Whether there are knit and purl stitches only, of one colour in a row."""
        passes = self._passes
        stitches = {letter for each in passes for letter in each.letters}
        is_moved = any(each.cables or each.decreases for each in passes)
        is_single = len(passes) == passes[-1].row + 1 and not self._has_second_bed
        return stitches <= set("kp") and not is_moved and is_single

    def _are_plain(self, rows: Iterable[int], wales: Iterable[int]) -> bool:
        """Whether some stitches are knit or purl and no part of a cable, and rows of one colour."""
        passes, columns = self._passes, tuple(wales)
        if len(passes) > passes[-1].row + 1:
            return False
        return all(
            each.letters[wale % len(each.letters)] in "kp"
            and not (each.moves and each.moves[wale % len(each.letters)])
            for each in (passes[row % len(passes)] for row in rows)
            for wale in columns
        )

    @property
    def _turns(self) -> bool:
        """Whether yarns turn at the sides of the piece."""
        if self.edges != "turned" or self.wales < 3:
            return False
        if not self._are_plain(range(len(self._passes)), (0, self.wales - 1)):
            raise InputError(
                "yarns turn at the sides only where the first and the last stitch of each course "
                "are knit or purl, in rows of one colour: held loops cannot turn",
                key="edges",
                value=self.edges,
                cure='Write k or p at both sides of rows (see wales), or set edges = "cut".',
            )
        return True

    @contextmanager
    def _room_for(self, key: str) -> Iterator[None]:
        """Name the edge of the piece at which yarns have no room beside held loops or cables."""
        try:
            yield
        except GeometryError as error:
            if self._is_plain:
                raise
            raise GeometryError(
                f"held loops, floats or cables leave no room for this edge: {error.message}",
                key=key,
                value=getattr(self, key),
                cure=f'Put more knit and purl stitches there, or set {key} = "cut".',
            ) from error

    def sides(self, progress: Progress | None = None) -> Selvedges | None:
        """Return the relaxed selvedges, in diameters; None if there are none, or ends as well."""
        if not self._turns or self.ends == "bound":
            return None
        (yarns, cell, _), passes = self.rest(progress), self._passes
        length, strip = self._stitch_diameters, strip_wales(len(passes[0].letters), self.wales)
        key = self._key(f"sides of {strip}")
        if key not in _selvedges:
            names = ("left", "right", "turns")
            shapes = dict.fromkeys(names, (-1, 3))
            found = cache.load(key, **shapes, sizes=(3, -1), overlap=(1,))
            if found is None:
                with self._room_for("edges"):
                    made = relax_selvedges(yarns, cell, passes, length, self.wales, progress)
                found = {name: np.concatenate(getattr(made, name)) for name in names}
                found["sizes"] = np.array([[*map(len, getattr(made, name))] for name in names])
                found["overlap"] = np.array([made.overlap])
                cache.store(key, **found)
            parts = {
                name: np.split(found[name], np.cumsum(sizes)[:-1])
                for name, sizes in zip(names, found["sizes"], strict=True)
            }
            _selvedges.clear()
            _selvedges[key] = Selvedges(**parts, wales=strip, overlap=float(found["overlap"][0]))
        return _selvedges[key]

    def tube(self) -> Rolled | None:
        """Return the yarns of a tube, in diameters; None if the sides are not joined."""
        if self.edges != "joined":
            return None
        (yarns, cell, _), count = self.rest(), self._repeat
        if self.wales % count or self.wales < max(LEAST_ROUND, 3 * count):
            raise InputError(
                "repeats do not close a tube",
                key="wales",
                value=self.wales,
                allowed=f"multiples of {count} from {max(LEAST_ROUND, 3 * count)}",
            )
        key = self._key(f"tube of {self.wales}")
        if key not in _tubes:
            sizes = [len(yarn.points) for yarn in yarns]
            found = cache.load(key, points=(sum(sizes), 3), cell=(2, 3), overlap=(1,))
            if found is None:
                ones, mean = np.ones(len(yarns)), self._stitch_diameters / POINTS
                mechanics = RodMechanics(1e3 * ones, ones, CONTACT, mean * ones)
                made = roll_yarns(yarns, cell, mechanics, self.wales // count)
                points = np.concatenate([yarn.points for yarn in made.yarns])
                found = {"points": points, "cell": made.cell, "overlap": np.array([made.overlap])}
                cache.store(key, **found)
            parts = np.split(found["points"], np.cumsum(sizes)[:-1])
            _tubes.clear()
            _tubes[key] = Rolled(
                [yarn._replace(points=part) for yarn, part in zip(yarns, parts, strict=True)],
                found["cell"],
                float(found["overlap"][0]),
            )
        return _tubes[key]

    def bound_piece(self, progress: Progress | None = None) -> BoundPiece | None:
        """Return the piece with turned sides and bound ends, in diameters; None if others."""
        if self.ends == "cut" or not self._turns:
            return None
        if not self._is_plain:
            raise InputError(
                "a piece that is cast on, turns and is bound off has only knit and purl stitches, "
                "of one colour a row",
                key="ends",
                value=self.ends,
                cure='Set ends = "cut", or edges = "cut".',
            )
        self._require_plain_ends()
        if self.wales * self.courses > MOST_BOUND:
            raise InputError(
                "a piece with turned sides is too large to be cast on and bound off",
                key="ends",
                value=f"{self.wales} × {self.courses} stitches",
                allowed=f"{MOST_BOUND} stitches or fewer",
                cure='Set ends = "cut", or edges = "cut".',
            )
        (yarns, cell, _), length = self.rest(progress), self._stitch_diameters
        key = self._key(f"bound piece, {self.wales} wales, {self.courses} courses")
        if key not in _pieces:
            found = cache.load(key, points=(-1, 3), sizes=(self.courses + 2,), overlap=(1,))
            if found is None:
                made = relax_bound_piece(yarns, cell, length, self.wales, self.courses, progress)
                found = {
                    "points": np.concatenate(made.parts),
                    "sizes": np.array([len(part) for part in made.parts]),
                    "overlap": np.array([made.overlap]),
                }
                cache.store(key, **found)
            parts = np.split(found["points"], np.cumsum(found["sizes"])[:-1])
            _pieces.clear()
            _pieces[key] = BoundPiece(parts, float(found["overlap"][0]))
        return _pieces[key]

    def _require_plain_ends(self) -> None:
        """Raise InputError unless the courses can be cast on and bound off."""
        if self.edges == "joined":
            raise InputError(
                "a piece whose sides are joined is not cast on and bound off",
                key="ends",
                value=self.ends,
                cure='Set ends = "cut", or edges = "cut".',
            )
        # The courses that follow an end, those by which they are held, and the one in its place.
        near, last = FREE + HELD, self.courses
        rows = [*range(-1, near), *range(last - near, last + 1)]
        every = range(len(self._passes[0].letters))
        if self.courses < 2 * FREE or not self._are_plain(rows, every):
            raise InputError(
                f"only pieces of {2 * FREE} or more courses are cast on and bound off, whose first "
                f"and last {near} courses, and the next ones of the repeat, have only knit and "
                "purl stitches, in rows of one colour",
                key="ends",
                value=self.ends,
                cure='Begin and end with such courses (see courses), or set ends = "cut".',
            )

    def both_ends(self, progress: Progress | None = None) -> Ends | None:
        """Return the relaxed ends of cut sides, in diameters; None if the loops are open."""
        if self.ends == "cut" or self._turns:
            return None
        self._require_plain_ends()
        (yarns, cell, _), length = self.rest(progress), self._stitch_diameters
        key = self._key(f"ends, {self.courses} courses")
        if key not in _ends:
            count = len(self._passes[0].letters)
            shapes = {"cast_on": (-1, 3), "bind_off": (-1, 3), "overlap": (1,)}
            each = (FREE, POINTS * count, 3)
            found = cache.load(key, **shapes, lower=each, upper=each)
            if found is None:
                with self._room_for("ends"):
                    made = relax_ends(yarns, cell, length, self.courses, progress)
                found = {
                    "cast_on": made.cast_on.points,
                    "bind_off": made.bind_off.points,
                    "lower": np.stack(made.lower),
                    "upper": np.stack(made.upper),
                    "overlap": np.array([made.overlap]),
                }
                cache.store(key, **found)
            _ends.clear()
            _ends[key] = Ends(
                Yarn(found["cast_on"], (1, 0)),
                Yarn(found["bind_off"], (1, 0)),
                list(found["lower"]),
                list(found["upper"]),
                float(found["overlap"][0]),
            )
        return _ends[key]

    def _lines(self) -> tuple[AnyInts, Bools]:
        """Return the colour of each pass, and whether its yarn is that of the pass below."""
        passes = self._passes
        laid = courses_and_passes(passes, self.courses)
        which = [course if self.chart is None else passes[n].color for course, n in laid]
        colors = self.palette[np.array(which) % len(self.palette)]
        joined = (colors[1:] == colors[:-1]).all(axis=1) & self._turns
        if self.ends == "bound":
            colors = np.concatenate([colors[:1], colors, colors[-1:]])
            joined = np.concatenate([[self._turns], joined, [self._turns]])
        return colors, joined

    @property
    def line_families(self) -> Ints:
        """All yarns are courses."""
        colors, joined = self._lines()
        return np.zeros(len(colors) - int(joined.sum()), dtype=np.int64)

    @property
    def line_diameters(self) -> Floats:
        """All yarns are equal [m]."""
        return np.full(len(self.line_families), self.size)

    @property
    def line_colors(self) -> AnyInts:
        """Colours repeated over the courses, or those of the chart."""
        colors, joined = self._lines()
        return colors[np.append(True, ~joined)]

    @property
    def parts(self) -> int:
        """Number of parts of all tubes."""
        passes = self._passes
        points = sum(column_starts(each)[-1] for each in passes)
        return int(points * PARTS * self.wales * self.courses) // (
            self._repeat * (passes[-1].row + 1)
        )

    def lines(self, progress: Progress | None = None) -> list[Floats]:
        """Repeat the relaxed loops, between selvedges or cut."""
        rest, joined = self.rest(progress), self._lines()[1].tolist()
        sides, ends = self.sides(progress), self.both_ends(progress)
        if (tube := self.tube()) is not None:
            passes, rows = self._passes, self._passes[-1].row + 1
            laid = courses_and_passes(passes, self.courses)
            repeats = self.wales // self._repeat
            rings = repeat_round(tube, [(course // rows, n) for course, n in laid], repeats)
            return [ring * self.scale for ring in rings]
        if (piece := self.bound_piece(progress)) is not None:
            begins = np.flatnonzero(~np.append(False, joined))
            ends_at = np.append(begins[1:], len(piece.parts))
            return [
                np.concatenate(piece.parts[begin:end]) * self.scale
                for begin, end in zip(begins, ends_at, strict=True)
            ]
        lines = repeat_knit(
            rest.yarns,
            rest.cell,
            self._passes,
            self.wales * self._beds,
            self.courses,
            sides,
            joined,
            ends,
        )
        return [line * self.scale for line in lines]

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return spacings, loop length, and their ratios."""
        passes = self._passes
        wale = float(rest.cell[0, 0]) / self._repeat * self.size
        course = float(rest.cell[1, 1]) / (passes[-1].row + 1) * self.size
        loop = self.stitch_length or STITCH * self.size
        found = [
            FabricFigure("course_spacing", "course spacing", course, "m"),
            FabricFigure("wale_spacing", "wale spacing", wale, "m"),
            FabricFigure("loop_length", "loop length", loop, "m"),
            FabricFigure("kc", "loop length over course spacing", loop / course),
            FabricFigure("kw", "loop length over wale spacing", loop / wale),
        ]
        if (tube := self.tube()) is not None:
            repeats = self.wales // self._repeat
            mean = float(tube.cell[0, 0]) * repeats / np.pi * self.size
            found.append(FabricFigure("tube_diameter", "diameter of the tube", mean, "m"))
        return found

    def lengths(self, rest: Rest) -> Floats:
        """Return the given length of each yarn of a repeat, without its stretch."""
        points = np.array([column_starts(each)[-1] for each in self._passes])
        return points * (self._stitch_diameters / POINTS)

    def largest_overlap(self, rest: Rest) -> float:
        """Return the largest overlap of the repeat, and of its edges and ends, in diameters."""
        others = (self.sides(), self.tube(), self.both_ends(), self.bound_piece())
        return max([rest.overlap, *(each.overlap for each in others if each is not None)])
