"""What is printed of a draft, and how."""

from __future__ import annotations

import locale
import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.units import parse_quantity

if TYPE_CHECKING:
    from spacemap_vtk.textile.drafts.draft import Draft
    from spacemap_vtk.textile.drafts.floats import FloatLimits

#: Width and height of each paper, upright, in mm.
PAPERS = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
#: Countries whose usual paper is Letter.
_LETTER_COUNTRIES = {"US", "CA", "MX", "CL", "CO", "CR", "GT", "PA", "PH", "PR", "SV", "VE"}
#: Directions of the paper by name; None: whichever needs fewer pages.
ORIENTATIONS = {"auto": None, "portrait": False, "landscape": True}
#: Faces that can be printed, by name: True is the face, False the reverse.
FACES = {"both": (True, False), "face": (True,), "reverse": (False,)}
#: Where end 1 and pick 1 are.
STARTS = ("bottom-left", "top-right")
#: Least side of a cell, and the largest that can be asked for, in mm.
LEAST_CELL, _MOST_CELL = 2.0, 10.0
_FLOATS_ALLOWED = "a number of threads, for example 7, or a length, for example 10mm"


@dataclass(frozen=True)
class PrintSettings:
    """What is printed of a draft, and how."""

    #: A key of `PAPERS`.
    paper: str = "a4"
    #: A key of `ORIENTATIONS`.
    orientation: str = "auto"
    #: A key of `FACES`.
    faces: str = "both"
    #: Floats over more threads than this, or longer than this, are marked: ``"7"``, ``"10mm"``.
    floats: str = "7"
    #: Least side of a cell.
    cell: str = f"{LEAST_CELL:g}mm"
    #: Ranges of threads, such as ``"1-200"``; empty: all.
    ends: str = ""
    picks: str = ""
    #: Number of a page, or a range; empty: all.
    pages: str = ""
    #: One of `STARTS`.
    start: str = STARTS[0]
    #: Whether without colours.
    mono: bool = False

    def __post_init__(self) -> None:
        for key, known in (
            ("paper", PAPERS),
            ("orientation", ORIENTATIONS),
            ("faces", FACES),
            ("start", STARTS),
        ):
            if (value := getattr(self, key)) not in known:
                raise InputError("unknown value", key=key, value=value, allowed=", ".join(known))
        _ = self.least_cell, self.float_limit

    @property
    def least_cell(self) -> float:
        """Least side of a cell in mm."""
        refused = InputError(
            "cells must be legible and fit on the paper",
            key="cell",
            value=self.cell,
            allowed=f"{LEAST_CELL:g}mm to {_MOST_CELL:g}mm",
        )
        try:
            size = 1e3 * parse_quantity(self.cell, "m")
        except InputError as error:
            raise refused from error
        if not LEAST_CELL <= round(size, 9) <= _MOST_CELL:
            raise refused
        return size

    @property
    def float_limit(self) -> int | float:
        """The longest float that is not marked: a number of threads, or a length in m."""
        refused = InputError(
            "must be the longest float that is not marked",
            key="floats",
            value=self.floats,
            allowed=_FLOATS_ALLOWED,
        )
        text = self.floats.strip()
        if text.isdecimal() and len(text) < 9 and int(text) > 0:
            return int(text)
        try:
            length = parse_quantity(text, "m")
        except InputError as error:
            raise refused from error
        if text.isdecimal() or not 0.0 < length < 1.0:
            raise refused
        return length

    def select(self, draft: Draft) -> tuple[Draft, tuple[int, int]]:
        """Return the printed part of a draft, and the numbers of its first end and pick."""
        ends, picks = (
            _parse_range(name, text, count, "threads")
            for name, text, count in zip(
                ("ends", "picks"), (self.ends, self.picks), draft.size, strict=True
            )
        )
        return draft.crop(ends, picks), (ends.start + 1, picks.start + 1)

    def select_pages(self, count: int) -> range:
        """Return the numbers of the pages that are written, of so many."""
        pages = _parse_range("pages", self.pages, count, "pages")
        return range(pages.start + 1, pages.stop + 1)

    def limits(self, draft: Draft) -> FloatLimits:
        """Return the most threads that ends and picks of a draft may pass unmarked."""
        # Imported here, because the command's help needs no arrays.
        from spacemap_vtk.textile.drafts.floats import float_limits

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


def local_paper() -> str:
    """Return the usual paper of the user's country, a key of `PAPERS`."""
    words = [os.environ.get(name) for name in ("LC_ALL", "LC_PAPER", "LANG")]
    name = next((word for word in words if word), None) or locale.getlocale()[0] or ""
    country = re.match(r"[a-zA-Z]+_([A-Z]{2})", name)
    return "letter" if country and country[1] in _LETTER_COUNTRIES else "a4"


def _parse_range(key: str, text: str, count: int, what: str) -> slice:
    """Parse a range such as 1-200, counted from 1, both included; all if it is empty."""
    if not text:
        return slice(0, count)
    first, _, last = text.replace("–", "-").partition("-")
    words = [first.strip(), (last or first).strip()]
    if all(word.isdecimal() and len(word) < 9 for word in words):
        begin, end = map(int, words)
        if 1 <= begin <= end <= count:
            return slice(begin - 1, end)
    raise InputError(
        f"must be a range of {what}", key=key, value=text, allowed=f"1-{count} or a part of it"
    )
