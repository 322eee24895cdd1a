"""What is printed of a draft, and how; no VTK, so that a command's help is quick."""

from __future__ import annotations

import locale
import os
import re
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Choice, Flag, Parameterised, Real, Text
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.floats import FloatLimits, float_limits
from spacemap_vtk.units import parse_quantity

#: Width and height of each paper, upright, in mm.
PAPERS = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
#: Countries whose usual paper is Letter.
_LETTER_COUNTRIES = {"US", "CA", "MX", "CL", "CO", "CR", "GT", "PA", "PH", "PR", "SV", "VE"}
#: Faces that are printed, by choice: True is the face, False the reverse.
FACES = {"both": (True, False), "face": (True,), "reverse": (False,)}
#: Where end 1 and pick 1 are.
STARTS = ("bottom-left", "top-right")


def _parse_limit(text: str) -> int | float:
    return int(text) if text.isdecimal() else parse_quantity(text, "m")


class FloatLimit(Text):
    """The longest float that is not marked: a number of threads, or a length."""

    expected = "a number of threads, for example 7, or a length, for example 10mm"

    def convert(self, value: Any) -> str:
        """Return the text if it is a number of threads or a length."""
        text = super().convert(value).strip()
        limit = _parse_limit(text)
        if not 0.0 < limit < (1e6 if isinstance(limit, int) else 1.0):
            raise InputError("out of range")
        return text


class Range(Text):
    """A number, or the first and the last number of a range."""

    expected = "a number or a range, for example 1-200"

    def convert(self, value: Any) -> str:
        """Return the text if it is a range."""
        text = super().convert(value).replace("–", "-").replace(" ", "")
        if re.fullmatch(r"\d{1,7}(-\d{1,7})?", text) is None:
            raise InputError("must be a range")
        return text


class PrintSettings(Parameterised):
    """What is printed of a draft, and how."""

    paper = Choice("a4", "Size of the paper.", [*PAPERS])
    orientation = Choice(
        None,
        "Direction of the paper.",
        ["portrait", "landscape"],
        automatic="the one with fewer pages",
    )
    faces = Choice("both", "Faces of the cloth that are drawn.", [*FACES])
    floats = FloatLimit(
        "7", "Mark floats over more threads than this, or longer than this, as 10mm."
    )
    cell = Real(
        0.002,
        "Least side of a cell; larger cells need more pages.",
        unit="m",
        minimum=0.002,
        maximum=0.01,
        usual_units="mm",
        plausible=(0.002, 0.01),
    )
    ends = Range(None, "Ends that are printed, as 1-200.", automatic="all")
    picks = Range(None, "Picks that are printed, as 1-200.", automatic="all")
    pages = Range(None, "Pages that are written, as 3 or 3-5.", automatic="all")
    start = Choice(
        STARTS[0],
        "Where end 1 and pick 1 are: at the bottom left, as in the window and in pictures, or at "
        "the top right, beside the tie-up.",
        STARTS,
    )
    mono = Flag(False, "Draw without colours: black where an end is on top, letters for the yarns.")

    @property
    def float_limit(self) -> int | float:
        """The longest float that is not marked: a number of threads, or a length in m."""
        return _parse_limit(self.floats)

    def select(self, draft: Draft) -> tuple[Draft, tuple[int, int]]:
        """Return the printed part of a draft, and the numbers of its first end and pick."""
        ends = self._select("ends", draft.size[0])
        picks = self._select("picks", draft.size[1])
        return draft.crop(ends, picks), (ends.start + 1, picks.start + 1)

    def select_pages(self, count: int) -> range:
        """Return the numbers of the pages that are written, of so many."""
        pages = self._select("pages", count)
        return range(pages.start + 1, pages.stop + 1)

    def limits(self, draft: Draft) -> FloatLimits:
        """Return the most threads that ends and picks of a draft may pass unmarked."""
        limit = self.float_limit
        if isinstance(limit, int):
            return limit, limit
        found = float_limits(draft, limit)
        if found is None:
            raise InputError(
                "the draft has no sett, so the lengths of its floats are unknown",
                key="floats",
                value=self.floats,
                allowed="a number of threads",
                cure="Or give the sett, for example weave.warp_sett=24epi, weave.weft_sett=24ppi.",
            )
        return found

    def _select(self, name: str, count: int) -> slice:
        """Return a range, counted from 1, as a slice of so many; all if none is given."""
        text = getattr(self, name)
        if text is None:
            return slice(0, count)
        first, _, last = text.partition("-")
        begin, end = int(first), int(last or first)
        if not 1 <= begin <= end <= count:
            raise InputError(
                f"there are {count} {name}", key=name, value=text, allowed=f"1-{count}, or a part"
            )
        return slice(begin - 1, end)


def local_paper() -> str:
    """Return the usual paper of the user's country, a key of `PAPERS`."""
    words = [os.environ.get(name) for name in ("LC_ALL", "LC_PAPER", "LANG")]
    name = next((word for word in words if word), None) or locale.getlocale()[0] or ""
    country = re.match(r"[a-zA-Z]+_([A-Z]{2})", name)
    return "letter" if country and country[1] in _LETTER_COUNTRIES else "a4"
