"""Stitches of weft knits: named structures, rows of letters, and charts of colours.

A row is knitted in one pass of each yarn that it needs. In each pass the yarn knits, purls, tucks
or misses on every needle; in a row of several colours it misses the stitches of the others.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import lcm
from typing import NamedTuple

from spacemap_vtk.errors import InputError

#: Rows of one repeat of each structure, the lowest first: k for knit, p for purl.
STRUCTURES: dict[str, tuple[str, ...]] = {
    "stockinette": ("k",),
    "reverse stockinette": ("p",),
    "garter": ("k", "p"),
    "rib 1x1": ("kp",),
    "rib 2x2": ("kkpp",),
    "seed": ("kp", "pk"),
    "moss": ("kp", "kp", "pk", "pk"),
    "basket": ("kkpp", "kkpp", "ppkk", "ppkk"),
}
#: Description of what `parse_rows` accepts.
GRAMMAR = (
    "a structure out of "
    + ", ".join(f'"{name}"' for name in STRUCTURES)
    + ', or the rows of a repeat, the lowest first, as ["kkp", "kpk"] '
    "(k: knit, p: purl, t: tuck, m: miss; c4f, c4b: 4 stitches crossed to the left, to the right)"
)
#: Description of what `parse_chart` accepts.
CHART_GRAMMAR = (
    'the rows of a repeat, the lowest first, with a letter for each stitch, as ["AABB", "ABBA"]: '
    "A is the first colour, B the second one, up to Z; a number repeats a letter: A3 is AAA"
)
#: Largest number of stitches in a repeat, and of colours in a row.
_MOST, MOST_COLORS = 400, 4
#: A cable: its number of stitches, and whether those that move to the left are in front.
_CABLE = r"c(\d{1,2})([fb])"
#: Largest number of stitches of a cable.
_LARGEST_CABLE = 12
#: Largest number of courses over which a loop is held.
MOST_HELD = 4


class Cable(NamedTuple):
    """Stitches that change places before they are knitted."""

    first: int
    """The needle at the left."""
    size: int
    """Number of stitches, half of which move to either side."""
    is_left: bool
    """Whether those that move to the left are in front (f), or those that move to the right (b)."""


class Pass(NamedTuple):
    """One yarn that is laid across all needles in a row."""

    letters: str
    """What it does on each needle of the repeat: k, p, t or m."""
    row: int
    """The row to which it belongs."""
    color: int
    """Number of its colour: 0 for A."""
    cables: tuple[Cable, ...] = ()
    """Stitches that are crossed before this pass."""
    moves: tuple[int, ...] = ()
    """How many needles each loop moves to the right before it is cast off; none without cables."""


def parse_rows(value: object) -> tuple[str, ...]:
    """Convert a structure's name, a text of rows, or a list of rows to rows of equal length.

    Parameters
    ----------
    value : object
        Name, rows separated by commas, or rows. A row may repeat letters by a number: ``k3p``; a
        cable is written as ``c4f`` or ``c4b``, for 4 stitches.

    Returns
    -------
    tuple of str
        Rows of one repeat, the lowest first, of the letters k, p, t and m, and of cables.

    Raises
    ------
    InputError
        If it is none of these.

    Examples
    --------
    >>> parse_rows("rib 1x1"), parse_rows("k2 p, p k2")
    (('kp',), ('kkp', 'pkk'))
    """
    if isinstance(value, str):
        name = " ".join(value.lower().split())
        if name in STRUCTURES:
            return STRUCTURES[name]
    rows = _parse_grid(value, "kptm", "the stitches of a knit")
    for row, below in zip(rows, (*rows[-1:], *rows), strict=False):
        for first, size, is_left in _cables_of(row):
            for needle in range(first, first + size):
                if (other := letters_of(below)[needle]) != "k":
                    raise InputError(
                        f"c{size}{'f' if is_left else 'b'} crosses stitches {first + 1} to "
                        f"{first + size} of the row below, but stitch {needle + 1} is {other}",
                        cure="Write k below each stitch of a cable.",
                    )
    return rows


def letters_of(row: str) -> str:
    """Return the letters of a row, with k for each stitch of a cable."""
    return re.sub(_CABLE, lambda found: int(found[1]) * "k", row)


def _cables_of(row: str) -> tuple[Cable, ...]:
    """Return the cables of a row."""
    return tuple(
        Cable(len(letters_of(row[: found.start()])), int(found[1]), found[2] == "f")
        for found in re.finditer(_CABLE, row)
    )


def parse_chart(value: object) -> tuple[str, ...]:
    """Convert a chart of colours, as a text of rows or a list of rows, to rows of equal length.

    Parameters
    ----------
    value : object
        Rows, or rows separated by commas, the lowest first. Each stitch is a letter: A for the
        first colour, B for the second one. A number repeats a letter: ``A3B``.

    Returns
    -------
    tuple of str
        Rows of one repeat, the lowest first, of capital letters.

    Raises
    ------
    InputError
        If it is none of these, or if a row has more than 4 colours.

    Examples
    --------
    >>> parse_chart("A2 B2, abba")
    ('AABB', 'ABBA')
    """
    rows = _parse_grid(value, "ABCDEFGHIJKLMNOPQRSTUVWXYZ", "a chart of colours")
    for row in rows:
        if len(set(row)) > MOST_COLORS:
            raise InputError(
                f'the row "{row}" of the chart has {len(set(row))} colours; knit at most '
                f"{MOST_COLORS} in a row"
            )
    return rows


def plan_passes(rows: Sequence[str], chart: Sequence[str] = ()) -> list[Pass]:
    """List the passes that knit a repeat of rows and chart, in the order in which they are laid.

    Parameters
    ----------
    rows : sequence of str
        Stitches of a repeat, as `parse_rows` returns them.
    chart : sequence of str, optional
        Colours of a repeat, as `parse_chart` returns them; all stitches are A without it. Its size
        may differ from that of the rows: both are repeated until they fit.

    Returns
    -------
    list of Pass
        From the lowest row up. Yarns of a row are laid in the order of their letters, so that the
        floats of A are below those of B.

    Raises
    ------
    InputError
        If the repeat becomes too large; if a yarn holds no stitch; or if a loop is never cast off,
        or held over more than 4 rows.

    Examples
    --------
    >>> [each.letters for each in plan_passes(["k"], ["AAB"])]
    ['kkm', 'mmk']
    """
    chart = chart or ("A",)
    letters = [letters_of(row) for row in rows]
    width, height = lcm(len(letters[0]), len(chart[0])), lcm(len(rows), len(chart))
    if width * height > _MOST:
        raise InputError(
            f"rows and chart repeat themselves only after {width} x {height} stitches; a repeat "
            f"has at most {_MOST}. Choose a chart whose size is a multiple of that of the rows"
        )
    spelled = [rows[row % len(rows)] * (width // len(letters[0])) for row in range(height)]
    passes = []
    for row in range(height):
        stitches, colors = (
            each[row % len(each)] * (width // len(each[0])) for each in (letters, chart)
        )
        cables, moves = _cables_of(spelled[row]), _moves_of(spelled[(row + 1) % height])
        for color in sorted(set(colors)):
            own = "".join(
                stitch if its == color else "m"
                for stitch, its in zip(stitches, colors, strict=True)
            )
            passes.append(Pass(own, row, ord(color) - ord("A"), cables, moves))
            cables = ()
    _require_knittable(passes)
    return passes


def _require_knittable(passes: Sequence[Pass]) -> None:
    """Refuse yarns that nothing holds, and loops that are never or too late cast off."""
    for each in passes:
        if set(each.letters) == {"m"}:
            raise InputError(
                f"row {each.row + 1} only misses, so that nothing holds its yarn",
                cure="Knit, purl or tuck at least one of its stitches.",
            )
    height = passes[-1].row + 1
    for needle, column in enumerate(zip(*(each.letters for each in passes), strict=True), 1):
        rows = [each.row for each, letter in zip(passes, column, strict=True) if letter in "kp"]
        if not rows:
            raise InputError(
                f"stitch {needle} is neither knitted nor purled in any row, so that its loops are "
                "never cast off",
                cure="Write k or p there in at least one row.",
            )
        held = max(b - a for a, b in pairwise([*rows, rows[0] + height]))
        if held > MOST_HELD:
            raise InputError(
                f"a loop of stitch {needle} is held over {held} rows; a loop is long enough for "
                f"{MOST_HELD}",
                cure="Write k or p there in more rows.",
            )


def _moves_of(row: str) -> tuple[int, ...]:
    """Return how far the cables of a row move each stitch to the right; nothing without cables."""
    cables, moves = _cables_of(row), [0] * len(letters_of(row))
    for first, size, _ in cables:
        half = size // 2
        moves[first : first + size] = [half] * half + [-half] * half
    return tuple(moves) if cables else ()


def _parse_grid(value: object, letters: str, what: str) -> tuple[str, ...]:
    """Convert a text with commas, or texts, to rows of equal length of the given letters."""
    if isinstance(value, str):
        value = value.split(",")
    if not isinstance(value, Iterable):
        raise InputError(f"must be {what}")
    rows = tuple(_spell_out(str(row), letters) for row in value)
    if not rows or len({len(letters_of(row)) for row in rows}) > 1:
        raise InputError("all rows need the same number of stitches")
    if len(rows) * len(letters_of(rows[0])) > _MOST:
        raise InputError(f"a repeat has at most {_MOST} stitches")
    return rows


def _spell_out(row: str, letters: str) -> str:
    """Replace ``k3`` by ``kkk``."""
    is_rows = letters == letters.lower()
    text = "".join(row.split())
    text = text.lower() if is_rows else text.upper()
    tokens = rf"([{letters}])(\d{{0,3}})" + (f"|({_CABLE})" if is_rows else "")
    spelled, end = "", 0
    for found in re.finditer(tokens, text):
        if found.start() != end:
            break
        end = found.end()
        spelled += found[1] * int(found[2] or 1) if found[1] else found[0]
        if not found[1] and not (2 <= int(found[4]) <= _LARGEST_CABLE and int(found[4]) % 2 == 0):
            raise InputError(
                f"{found[0]} crosses {int(found[4])} stitches; a cable has an even number of them, "
                f"2 to {_LARGEST_CABLE}"
            )
    if end != len(text):
        allowed = "k, p, t, m, and cables as c4f and c4b" if is_rows else "letters from A to Z"
        raise InputError(f'the row "{row}" has "{text[end]}"; allowed are {allowed}')
    if not spelled:
        raise InputError("a row has no stitches")
    return spelled
