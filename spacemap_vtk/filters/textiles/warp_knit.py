"""Warp knits."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import lcm
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.filters.textiles.kind import Rest, TextileKind
from spacemap_vtk.filters.textiles.knit import Knit
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parameters import Parameter, Real, Series
from spacemap_vtk.textile.rods.guess import Guess
from spacemap_vtk.textile.rods.warp_knit import Bar, are_open, draw_warp_knit, parse_laps

#: Courses in a rack, by which run-ins are stated.
RACK = 480
#: Most guides in a repeat of the threading.
_MOST = 24


def parse_threading(text: str) -> tuple[bool, ...]:
    """Convert ``1 in 1 out`` to whether each guide of a repeat carries a yarn."""
    found = re.findall(r"(\d{1,2}) *(in|out)", text.lower())
    if text.strip().lower() == "full":
        return (True,)
    if "".join(a + b for a, b in found) != re.sub(r"[\s,]", "", text.lower()):
        raise InputError(f'"{text}" is no threading')
    guides = tuple(word == "in" for count, word in found for _ in range(int(count)))
    if not any(guides) or len(guides) > _MOST:
        raise InputError(f"a repeat of a threading has 1 to {_MOST} guides, some of them in")
    return guides


class Laps(Parameter[Any]):
    """Laps of one or two guide bars."""

    kind = "laps"
    annotation = "str or sequence of str"
    expected = 'one or two texts as "1-0/1-2//": the spaces before and after each overlap'

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to a text for each bar."""
        texts = _texts(value)
        if not 1 <= len(texts) <= 2:
            raise InputError("one or two guide bars have laps")
        return tuple("/".join("-".join(map(str, lap)) for lap in parse_laps(t)) for t in texts)

    def text(self, value: Any) -> str:
        """Format as texts with commas."""
        return f'"{", ".join(value)}"'


class Threading(Parameter[Any]):
    """Threading of guide bars."""

    kind = "threading"
    annotation = "str or sequence of str"
    expected = '"full", or guides with and without a yarn: "1 in 1 out"; one text, or one for a bar'

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to a text for each bar."""
        texts = _texts(value)
        for text in texts:
            parse_threading(text)
        return tuple(" ".join(text.split()) for text in texts)

    def text(self, value: Any) -> str:
        """Format as texts with commas."""
        return f'"{", ".join(value)}"'


def _texts(value: Any) -> list[str]:
    if isinstance(value, str):
        value = value.split(",")
    if not isinstance(value, Iterable):
        raise InputError("must be a text, or one for each guide bar")
    return [str(text) for text in value]


class WarpKnit(TextileKind):
    """Warp knits: each yarn of a guide bar runs along y and knits a loop in each course."""

    name = "warp_knit"
    loops = True
    family_names = ("front bar", "back bar")
    colors = ((222, 214, 198), (186, 84, 70))

    laps = Laps(
        ["1-2/1-0", "1-0/1-2"],
        "Laps of the guide bars in chain notation, the front bar first. Spaces between needles are "
        "numbered from the left, seen from the face.",
    )
    threading = Threading("full", "Guides of each bar that carry a yarn.")
    run_in = Series(
        Real(
            1.0,
            "Yarn that each guide bar takes in a rack of 480 courses.",
            unit="m",
            above=0.0,
            plausible=(1e-3, 100.0),
            usual_units="mm",
        ),
        automatic="as the loops are drawn: 20 to 40 diameters in a course",
    )
    wale_spacing = Knit.wale_spacing
    course_spacing = Knit.course_spacing
    wales = Knit.wales
    courses = Knit.courses

    @property
    def bars(self) -> tuple[Bar, ...]:
        """The guide bars."""
        threads = [parse_threading(text) for text in self.threading]
        return tuple(
            Bar(parse_laps(text), threads[bar % len(threads)]) for bar, text in enumerate(self.laps)
        )

    @property
    def _repeat(self) -> tuple[int, int]:
        """Numbers of wales and courses of a repeat."""
        bars = self.bars
        return lcm(*(len(bar.threads) for bar in bars)), lcm(*(len(bar.laps) for bar in bars))

    @property
    def cells(self) -> tuple[int, int]:
        """Number of repeats, so many that the piece has all wales and courses."""
        width, rows = self._repeat
        return -(-self.wales // width), -(-self.courses // rows)

    def guess(self) -> Guess:
        """Draw a repeat."""
        run_ins = np.reshape(self.run_in, -1) if self.run_in is not None else [None]
        lengths = [
            None if run_in is None else float(run_in) / RACK / self.size for run_in in run_ins
        ]
        given = (self.wale_spacing, self.course_spacing)
        return draw_warp_knit(
            self.bars,
            tuple(lengths[bar % len(lengths)] for bar in range(len(self.bars))),
            tuple(None if one is None else one / self.size for one in given),
        )

    def families_of_cell(self, guess: Guess) -> Ints:
        """Return 0 for yarns of the front bar, and 1 for those of the back bar."""
        width, _ = self._repeat
        counts = [sum(bar.threads) * width // len(bar.threads) for bar in self.bars]
        return np.repeat(np.arange(len(counts)), counts)

    def lengths(self, rest: Rest) -> Floats:
        """Return the given length of each yarn of a repeat, without its stretch."""
        counts = np.array([len(yarn.points) for yarn in rest.yarns])
        return np.asarray(self.guess().mechanics.length * counts)

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return spacings, yarn in a stitch, run-ins, and the number of open laps."""
        width, rows = self._repeat
        wale, course = rest.cell[0, 0] / width * self.size, rest.cell[1, 1] / rows * self.size
        lengths, family = self.lengths(rest), self.families_of_cell(self.guess())
        found = [
            FabricFigure("course_spacing", "course spacing", float(course), "m"),
            FabricFigure("wale_spacing", "wale spacing", float(wale), "m"),
        ]
        for number, bar in enumerate(self.bars):
            which, where = ("", "") if number == 0 else ("back_", " of the back bar")
            loop = float(lengths[family == number][0]) / rows * self.size
            opened = sum(are_open(bar.laps))
            found += [
                FabricFigure(f"{which}loop_length", f"yarn in a stitch{where}", loop, "m"),
                FabricFigure(f"{which}run_in", f"yarn in a rack{where}", loop * RACK, "m"),
                FabricFigure(f"{which}open_laps", f"open laps in a repeat{where}", opened),
            ]
        return found
