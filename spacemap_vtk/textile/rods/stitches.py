"""Stitches of weft knits: named structures, rows of letters, and charts of colours.

A row is knitted in one pass of each yarn that it needs. In each pass the yarn knits, purls, tucks
or misses on every needle; in a row of several colours it misses the stitches of the others.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from math import lcm
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Ints

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
    "(k: knit, p: purl, t: tuck, m, f: miss with the yarn behind, in front; c4f, c4b: 4 stitches "
    "crossed to the left, to the right; yo: yarn over; k2tog, ssk, sk2p, s2kp: decreases)"
)
#: Description of what `parse_chart` accepts.
CHART_GRAMMAR = (
    'the rows of a repeat, the lowest first, with a letter for each stitch, as ["AABB", "ABBA"]: '
    "A is the first colour, B the second one, up to Z; a number repeats a letter: A3 is AAA"
)
#: Largest number of stitches in a repeat, and of colours in a row.
MOST_STITCHES, MOST_COLORS = 400, 4
#: A cable: its number of stitches, and whether those that move to the left are in front.
_CABLE = r"c(\d{1,2})([fb])"
#: Decreases: the loops that are knitted together, from the left, in the order from front to back.
DECREASES: dict[str, tuple[int, ...]] = {
    "k2tog": (0, 1),
    "ssk": (1, 0),
    "sk2p": (2, 0, 1),
    "s2kp": (1, 2, 0),
}
#: What is laid on a needle: a letter of a row, or y for a yarn over.
_LETTERS = "kptmf"
#: A word of a row: lace, a cable, or a letter.
_LACE = "|".join(["yo", *DECREASES])
_WORD = re.compile(rf"{_LACE}|c\d{{1,2}}[fb]|[{_LETTERS}]")
#: Largest number of stitches of a cable.
_LARGEST_CABLE = 12
#: Largest number of courses over which a loop is held.
MOST_HELD = 4


class Cable(NamedTuple):
    """Stitches that change places before they are knitted."""

    first: int
    """The loop at the left, as it was numbered in the row below."""
    size: int
    """Number of stitches, half of which move to either side."""
    is_left: bool
    """Whether those that move to the left are in front (f), or those that move to the right (b)."""


class Decrease(NamedTuple):
    """Loops that are knitted together."""

    first: int
    """The loop at the left, as it was numbered in the row below."""
    order: tuple[int, ...]
    """The loops, counted from the left one, from front to back."""


class Pass(NamedTuple):
    """One yarn that is laid across all needles in a row."""

    letters: str
    """What it does on each needle of the repeat: k, p, t, m or f, and y for a yarn over."""
    row: int
    """The row to which it belongs."""
    color: int
    """Number of its colour: 0 for A."""
    cables: tuple[Cable, ...] = ()
    """Stitches that are crossed before this pass."""
    moves: tuple[int, ...] = ()
    """How many needles each loop moves to the right before it is cast off; none without cables."""
    decreases: tuple[Decrease, ...] = ()
    """Loops that are put together before this pass."""
    shifts: tuple[int, ...] = ()
    """How many needles to the right the loop above each loop is numbered, because of yarn overs
    and decreases between; none without them."""


def parse_rows(value: object) -> tuple[str, ...]:
    """Convert a structure's name, a text of rows, or a list of rows to rows of equal length.

    Parameters
    ----------
    value : object
        Name, rows separated by commas, or rows. A row may repeat letters by a number: ``k3p``; a
        cable is written as ``c4f`` or ``c4b``, for 4 stitches, a yarn over as ``yo``, and decreases
        as ``k2tog``, ``ssk``, ``sk2p`` and ``s2kp``.

    Returns
    -------
    tuple of str
        Rows of one repeat, the lowest first, of the letters k, p, t, m and f, of cables, yarn overs
        and decreases.

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
    rows = _parse_grid(value, _LETTERS, "the stitches of a knit")
    for row, below in zip(rows, (*rows[-1:], *rows), strict=False):
        made, used = len(letters_of(row)), sum(len(loops) for _, _, loops in _walk(row))
        if made != used:
            raise InputError(
                f'the row "{row}" uses {used} stitches of the row below and makes {made}',
                cure="Write as many yarn overs as decreases take away: k2tog and ssk need one yo, "
                "sk2p and s2kp two.",
            )
        for first, size, is_left in _cables_of(row):
            for needle in range(first, first + size):
                if (other := letters_of(below)[needle]) != "k":
                    raise InputError(
                        f"c{size}{'f' if is_left else 'b'} crosses stitches {first + 1} to "
                        f"{first + size} of the row below, but stitch {needle + 1} is {other}",
                        cure="Write k below each stitch of a cable.",
                    )
    return rows


def words_of(row: str) -> list[str]:
    """Return the words of a row.

    Parameters
    ----------
    row : str
        A row, as `parse_rows` returns it.

    Returns
    -------
    list of str
        Letters, cables, yarn overs and decreases.
    """
    return _WORD.findall(row)


def loops_used(word: str) -> int:
    """Return how many loops of the row below a word of a row uses.

    Parameters
    ----------
    word : str
        A word, as `words_of` returns it.

    Returns
    -------
    int
        Number of loops: 0 for a yarn over, several for a decrease or a cable.
    """
    return 0 if word == "yo" else len(DECREASES.get(word, ())) or stitches_made(word)


def stitches_made(word: str) -> int:
    """Return how many stitches a word of a row makes.

    Parameters
    ----------
    word : str
        A word, as `words_of` returns it.

    Returns
    -------
    int
        Number of stitches: several for a cable, else 1.
    """
    return int(word[1:-1]) if word.startswith("c") else 1


def letters_of(row: str) -> str:
    """Return what a row lays on each needle: k for cables and decreases, y for a yarn over."""
    return "".join(
        "y" if word == "yo" else word if len(word) == 1 else "k" * stitches_made(word)
        for word in words_of(row)
    )


def _walk(row: str) -> Iterator[tuple[str, int, range]]:
    """Yield each word of a row, its first needle, and the loops of the row below that it uses."""
    needle = loop = 0
    for word in words_of(row):
        used = loops_used(word)
        yield word, needle, range(loop, loop + used)
        needle, loop = needle + stitches_made(word), loop + used


def _cables_of(row: str) -> tuple[Cable, ...]:
    """Return the cables of a row."""
    return tuple(
        Cable(loops.start, len(loops), word.endswith("f"))
        for word, _, loops in _walk(row)
        if word.startswith("c")
    )


def _decreases_of(row: str) -> tuple[Decrease, ...]:
    """Return the decreases of a row."""
    return tuple(
        Decrease(loops.start, DECREASES[word]) for word, _, loops in _walk(row) if word in DECREASES
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


def plan_passes(
    rows: Sequence[str], chart: Sequence[str] = (), knitted_back: bool = False
) -> list[Pass]:
    """List the passes that knit a repeat of rows and chart, in the order in which they are laid.

    Parameters
    ----------
    rows : sequence of str
        Stitches of a repeat, as `parse_rows` returns them.
    chart : sequence of str, optional
        Colours of a repeat, as `parse_chart` returns them; all stitches are A without it. Its size
        may differ from that of the rows: both are repeated until they fit.
    knitted_back : bool, optional
        Whether a second bed of needles, one to the right of each of the first, knits the back of a
        chart: in each row, the colours take turns on its needles (bird's-eye back). By default
        yarns float behind the stitches of others.

    Returns
    -------
    list of Pass
        From the lowest row up. Yarns of a row are laid in the order of their letters, so that the
        floats of A are below those of B. With a second bed, letters are those of both beds in
        turn.

    Raises
    ------
    InputError
        If the repeat becomes too large; if a yarn holds no stitch; if a loop is never cast off,
        or held over more than 4 rows; or if the face of a knitted back has other stitches than
        knit ones.

    Examples
    --------
    >>> [each.letters for each in plan_passes(["k"], ["AAB"])]
    ['kkm', 'mmk']
    """
    chart = chart or ("A",)
    letters = [letters_of(row) for row in rows]
    width, height = lcm(len(letters[0]), len(chart[0])), lcm(len(rows), len(chart))
    if knitted_back and set("".join(rows)) != {"k"}:
        raise InputError(
            "a chart with a knitted back has knit stitches only on its face",
            cure='Set rows = "stockinette", or back = "floats".',
        )
    if width * height > MOST_STITCHES:
        raise InputError(
            f"rows and chart repeat themselves only after {width} x {height} stitches; a repeat "
            f"has at most {MOST_STITCHES}. Choose a chart whose size is a multiple of that of the "
            "rows"
        )
    spelled = [rows[row % len(rows)] * (width // len(letters[0])) for row in range(height)]
    passes = []
    for row in range(height):
        stitches, colors = (
            each[row % len(each)] * (width // len(each[0])) for each in (letters, chart)
        )
        cables, decreases = _cables_of(spelled[row]), _decreases_of(spelled[row])
        above = spelled[(row + 1) % height]
        moves, shifts = _moves_of(above), _shifts_of(above)
        used = sorted(set(colors))
        for turn, color in enumerate(used):
            own = "".join(
                stitch if its == color else "m"
                for stitch, its in zip(stitches, colors, strict=True)
            )
            if knitted_back:
                # The yarn passes between the beds: before the loops of the second one.
                own = "".join(
                    letter + ("p" if (row + needle) % len(used) == turn else "f")
                    for needle, letter in enumerate(own)
                )
            number = ord(color) - ord("A")
            passes.append(Pass(own, row, number, cables, moves, decreases, shifts))
            cables, decreases = (), ()
    _require_knittable(passes)
    return passes


def _require_knittable(passes: Sequence[Pass]) -> None:
    """Refuse yarns that nothing holds, and loops that are never or too late cast off."""
    for each in passes:
        if set(each.letters) <= {"m", "f"}:
            raise InputError(
                f"row {each.row + 1} only misses, so that nothing holds its yarn",
                cure="Knit, purl or tuck at least one of its stitches.",
            )
    height = passes[-1].row + 1
    casts_off = np.zeros((height, len(passes[0].letters)), dtype=bool)
    makes = casts_off.copy()
    for each in passes:
        casts_off[each.row] |= [letter in "kp" for letter in each.letters]
        makes[each.row] |= [letter in "kpy" for letter in each.letters]
    targets = {each.row: needles_above(each) for each in passes}
    for row, needle in np.ndindex(casts_off.shape):
        held, at = 1, targets[row][needle]
        while not casts_off[(row + held) % height, at] and held <= casts_off.size:
            at = targets[(row + held) % height][at]
            held += 1
        if held > casts_off.size:
            raise InputError(
                f"stitch {needle + 1} is neither knitted nor purled in any row, so that its loops "
                "are never cast off",
                cure="Write k or p there in at least one row.",
            )
        if makes[row, needle] and held > MOST_HELD:
            raise InputError(
                f"a loop of stitch {needle + 1} is held over {held} rows; a loop is long enough "
                f"for {MOST_HELD}",
                cure="Write k or p there in more rows.",
            )


def needles_above(each: Pass) -> Ints:
    """Return the needles of the next row that hold the loops of a pass, (wales,)."""
    needles = np.arange(len(each.letters))
    for moves in (each.moves, each.shifts):
        needles = needles + np.array(moves or 0)
    return needles


def _shifts_of(row: str) -> tuple[int, ...]:
    """Return how far yarn overs and decreases of a row shift each loop to the right."""
    shifts = []
    for word, needle, loops in _walk(row):
        at = needle - loops.start
        shifts += [needle - k for k in loops] if word in DECREASES else [at] * len(loops)
    return tuple(shifts) if any(shifts) else ()


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
    counts = {len(letters_of(row) if letters == _LETTERS else row) for row in rows}
    if len(counts) != 1:
        raise InputError("all rows need the same number of stitches")
    if len(rows) * counts.pop() > MOST_STITCHES:
        raise InputError(f"a repeat has at most {MOST_STITCHES} stitches")
    return rows


def _spell_out(row: str, letters: str) -> str:
    """Replace ``k3`` by ``kkk``."""
    is_rows = letters == _LETTERS
    text = "".join(row.split())
    text = text.lower() if is_rows else text.upper()
    tokens = rf"([{letters}])(\d{{0,3}})"
    if is_rows:
        tokens = rf"{_LACE}|{_CABLE}|{tokens}"
    spelled, end = "", 0
    for found in re.finditer(tokens, text):
        if found.start() != end:
            break
        end = found.end()
        letter, count = found.groups()[-2:]
        spelled += letter * int(count or 1) if letter else found[0]
        if is_rows and found[1] and not _is_cable_size(int(found[1])):
            raise InputError(
                f"{found[0]} crosses {int(found[1])} stitches; a cable has an even number of them, "
                f"2 to {_LARGEST_CABLE}"
            )
    if end != len(text):
        allowed = (
            f"{', '.join(_LETTERS)}, yo, {', '.join(DECREASES)}, and cables as c4f and c4b"
            if is_rows
            else "letters from A to Z"
        )
        raise InputError(f'the row "{row}" has "{text[end]}"; allowed are {allowed}')
    if not spelled:
        raise InputError("a row has no stitches")
    return spelled


def _is_cable_size(count: int) -> bool:
    return 2 <= count <= _LARGEST_CABLE and count % 2 == 0
