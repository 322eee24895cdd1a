"""Drafts in files: WIF, rows of text, black-and-white pictures."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError, MissingLibraryError, SizeError
from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.loom import Loom
from spacemap_vtk.io import registry
from spacemap_vtk.io.wif import MAX_CROSSINGS, read_wif
from spacemap_vtk.io.wif_text import MAX_LENGTH

#: Characters of a row.
_CELLS = {**dict.fromkeys("1#Xx", True), **dict.fromkeys("0.-", False)}
_APART = str.maketrans("", "", " \t,;")


def read_draft(path: str | os.PathLike[str]) -> Draft:
    """Read a draft, of the kind that the file's ending tells."""
    path = Path(path)
    try:
        draft: Draft = registry.read(path, "draft")
    except InputError as error:
        error.file = error.file or str(path)
        raise
    if draft.loom is None:
        return replace(draft, loom=Loom.from_drawdown(draft.drawdown))
    return draft


def read_rows(path: Path) -> Draft:
    """Read a drawdown from rows of text, unless it has the sections of a WIF."""
    text = _text(path)
    if any(line.lstrip().startswith("[") for line in text.splitlines()):
        return read_wif(path)
    return Draft(parse_rows(text), title=path.stem)


def parse_rows(text: str) -> NDArray[np.bool_]:
    """Read a drawdown that is written as text."""
    rows: list[str] = []
    first = 0
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.translate(_APART)
        if unknown := set(cells) - _CELLS.keys():
            raise InputError(
                f'line {number}: "{min(unknown, key=cells.index)}" is no crossing',
                allowed="1, # or X (end over pick), 0, . or - (end under pick)",
            )
        if not cells:
            continue
        if rows and len(cells) != len(rows[0]):
            raise InputError(
                f"line {number} has {len(cells)} ends, but line {first} has {len(rows[0])}",
                cure="Give every line as many characters",
            )
        first = first or number
        rows.append(cells)
    if not rows:
        raise InputError("the file is empty", allowed="a line of 0 and 1 for each pick")
    _check_size(len(rows[0]), len(rows))
    return np.array([[_CELLS[cell] for cell in row] for row in rows])


def read_picture(path: Path) -> Draft:
    """Read a drawdown from a black-and-white picture, a pixel for each crossing."""
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError:
        raise MissingLibraryError(
            f"{path}: pictures need Pillow, which is not installed", cure='Try "pip install pillow"'
        ) from None
    try:
        with Image.open(path) as picture:
            _check_size(*picture.size)
            seen = picture.convert("RGBA")
    except UnidentifiedImageError:
        raise InputError("not a picture", cure="Save it as PNG") from None
    except OSError as error:
        raise _unreadable(error) from None
    white = Image.new("RGBA", seen.size, "white")
    gray = np.asarray(Image.alpha_composite(white, seen).convert("L"))
    between = np.count_nonzero((gray > 16) & (gray < 239))
    warnings: list[str] = []
    if between:
        warnings.append(
            f"{path.name}: {between} of {gray.size} pixels are neither black nor white; those "
            "darker than middle grey are taken for black"
        )
    return Draft(gray[::-1] < 128, title=path.stem, warnings=tuple(warnings))


def _check_size(ends: int, picks: int) -> None:
    if ends * picks > MAX_CROSSINGS:
        raise SizeError(
            f"a cloth of {ends} x {picks} yarns is too large",
            allowed=f"up to {MAX_CROSSINGS} crossings",
            cure="Cut it to one repeat",
        )


def _text(path: Path) -> str:
    try:
        with open(path, "rb") as stream:
            data = stream.read(MAX_LENGTH + 1)
    except (OSError, ValueError) as error:
        raise _unreadable(error) from None
    if len(data) > MAX_LENGTH:
        raise SizeError("the file is too long", allowed=f"up to {MAX_LENGTH} bytes")
    # latin-1 reads any byte; what it makes of those that no row may have is refused by its line
    return data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def _unreadable(error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"the draft can't be read ({reason})", cure="Check the name of the file")
