"""Drafts in files: of any format, and those in rows of text and black-and-white pictures."""

from __future__ import annotations

import os
import zlib
from dataclasses import replace
from pathlib import Path
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError, MissingLibraryError
from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.drawdown import rows
from spacemap_vtk.fabric.loom import Loom
from spacemap_vtk.io import registry
from spacemap_vtk.io.draft_bytes import LOOSE, check_size, content, loose_notes, unreadable
from spacemap_vtk.io.wif import parse_wif, read_wif
from spacemap_vtk.io.wif_text import MAX_LENGTH

#: Characters of a row.
_CELLS = {**dict.fromkeys("1#Xx", True), **dict.fromkeys("0.-", False)}
#: The WIF in a draft of TempoWeave.
_INSIDE = "twamain.waf"
_APART = str.maketrans("", "", " \t,;")


def read_draft(path: str | os.PathLike[str], trim: bool = False) -> Draft:
    """Read a draft, of the kind that the file's ending tells; trimmed, if that is wanted."""
    path = Path(path)
    try:
        draft: Draft = registry.read(path, "draft")
    except InputError as error:
        error.file = error.file or str(path)
        raise
    if draft.loom is None:
        return replace(draft, loom=Loom.from_drawdown(draft.drawdown))
    small = draft.trimmed()
    if small is draft:
        return draft
    (ends, picks), (more_ends, more_picks) = small.size, draft.size
    if trim:
        assert small.loom is not None
        told = [text for text in draft.warnings if LOOSE not in text] + loose_notes(small.loom)
        return replace(small, warnings=tuple(told))
    offer = (
        f"of {more_ends} x {more_picks} yarns {ends} x {picks} are woven, beyond them are ends in "
        "no heddle and picks without a shed: weave.trim (convert --trim) cuts them off"
    )
    return replace(draft, warnings=(*draft.warnings, offer))


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
    check_size(len(rows[0]), len(rows))
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
            check_size(*picture.size)
            seen = picture.convert("RGBA")
    except UnidentifiedImageError:
        raise InputError("not a picture", cure="Save it as PNG") from None
    except OSError as error:
        raise unreadable(error) from None
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


def _text(path: Path) -> str:
    # latin-1 reads any byte; what it makes of those that no row may have is refused by its line
    return content(path).removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def read_zipped(path: Path) -> Draft:
    """Read the WIF in a draft of TempoWeave, which is an archive."""
    try:
        with ZipFile(path) as archive:
            name = next(name for name in archive.namelist() if name.lower() == _INSIDE)
            with archive.open(name) as stream:
                return parse_wif(stream.read(MAX_LENGTH + 1))
    except (BadZipFile, StopIteration, NotImplementedError, RuntimeError, zlib.error) as error:
        raise InputError(
            f"there is no {_INSIDE} in it", allowed="a .twa of TempoWeave", cure="Export it as WIF"
        ) from error
    except OSError as error:
        raise unreadable(error) from None


def format_rows(draft: Draft) -> bytes:
    """Write a drawdown as rows of 0 and 1, the first pick first."""
    return "".join(f"{row}\n" for row in rows(draft.drawdown)).encode()


def rows_lose(draft: Draft) -> list[str]:
    """Return what rows of 0 and 1 cannot hold of a draft, in sentences."""
    held = {
        "threading and treadling": draft.loom != Loom.from_drawdown(draft.drawdown),
        "colours": draft.warp.colors is not None or draft.weft.colors is not None,
        "spacings and thicknesses": any(
            length is not None
            for threads in (draft.warp, draft.weft)
            for length in (threads.spacing, threads.thickness)
        ),
    }
    lost = [what for what, there in held.items() if there]
    return [f"rows of 0 and 1 hold the drawdown alone: no {', no '.join(lost)}"] if lost else []
