"""Stitches of weft knits: named structures, and rows of letters."""

from __future__ import annotations

import re
from collections.abc import Iterable

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
    + ', or the rows of a repeat, the lowest first, as ["kkp", "kpk"] (k: knit, p: purl)'
)
#: Largest number of stitches in a repeat.
_MOST = 400


def parse_rows(value: object) -> tuple[str, ...]:
    """Convert a structure's name, a text of rows, or a list of rows to rows of equal length.

    Parameters
    ----------
    value : object
        Name, rows separated by commas, or rows. A row may repeat letters by a number: ``k3p``.

    Returns
    -------
    tuple of str
        Rows of one repeat, the lowest first, of the letters k and p.

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
        value = value.split(",")
    if not isinstance(value, Iterable):
        raise InputError("must be the stitches of a knit")
    rows = tuple(_spell_out(str(row)) for row in value)
    if not rows or len({len(row) for row in rows}) > 1:
        raise InputError("all rows need the same number of stitches")
    if len(rows) * len(rows[0]) > _MOST:
        raise InputError(f"a repeat has at most {_MOST} stitches")
    return rows


def _spell_out(row: str) -> str:
    """Replace ``k3`` by ``kkk``."""
    found = re.findall(r"([kp])(\d{0,3})", row.lower().replace(" ", ""))
    if "".join(letter + count for letter, count in found) != row.lower().replace(" ", ""):
        raise InputError(f'the row "{row}" has other letters than k and p')
    spelled = "".join(letter * int(count or 1) for letter, count in found)
    if not spelled:
        raise InputError("a row has no stitches")
    return spelled
