"""Read drafts from files of any format; read and write rows of text, and read pictures."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from spacemap_vtk.errors import InfoMessage, InputError, MissingLibraryError
from spacemap_vtk.io import registry
from spacemap_vtk.io.drafts.draft_bytes import (
    LOOSE_THREAD,
    check_size,
    loose_thread_warnings,
    read_draft_bytes,
)
from spacemap_vtk.io.drafts.wif import read_wif
from spacemap_vtk.io.formats.pictures import decode_picture
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.drawdown import to_rows
from spacemap_vtk.textile.drafts.loom import Loom

#: Characters that mean a crossing in a row: True where the end lies over the pick.
_CELLS = {**dict.fromkeys("1#Xx", True), **dict.fromkeys("0.-", False)}
#: A line of a liftplan, such as "1,3" or "2: 1 3 5"; 0 or a dash lifts nothing.
_SHAFT_LIST = re.compile(r"(?:([0-9]{1,6})\s*[:.)]\s*)?(-|[0-9]{1,3}(?:[\s,;+]+[0-9]{1,3})*)")
_LIST_CURE = "Write one line for each pick, with commas between the shafts."
#: Most shafts of a dobby loom.
_MOST_SHAFTS = 64
#: Characters that may separate the crossings of a row.
_SEPARATORS = str.maketrans("", "", " \t,;")


def read_draft(path: str | os.PathLike[str], trim: bool = False) -> Draft:
    """Read a draft by its file's ending; if `trim`, cut off edges that are not woven."""
    path = Path(path)
    try:
        draft: Draft = registry.read(path, "draft")
    except InputError as error:
        error.file = error.file or str(path)
        raise
    if draft.loom is None:
        return replace(draft, loom=Loom.from_drawdown(draft.drawdown))
    small = draft.trim()
    if small is draft:
        return draft
    (ends, picks), (more_ends, more_picks) = small.size, draft.size
    # The offer below covers the threads that can be cut off; others within the cloth may float too.
    assert small.loom is not None
    kept = [text for text in draft.warnings if LOOSE_THREAD not in text]
    within = loose_thread_warnings(small.loom)
    if trim:
        return replace(small, warnings=(*kept, *within))
    offer = (
        f"only {ends} x {picks} of {more_ends} x {more_picks} yarns are woven; the other ends are "
        "in no heddle, the other picks in no shed. --set weave.trim=true leaves them out"
    )
    return replace(draft, warnings=(*kept, *within, offer))


def read_rows(path: Path) -> Draft:
    """Read a drawdown from rows of text; a text that is a liftplan or a WIF is read as such."""
    # Latin-1 decodes any byte; characters that no row may have are refused later, with their line.
    text = read_draft_bytes(path).removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    if any(line.lstrip().startswith("[") for line in text.splitlines()):
        return read_wif(path)
    # A liftplan: each line is a list of shafts, and not all lines are rows of 0 and 1.
    if re.search("[2-9]", text) and all(
        _SHAFT_LIST.fullmatch(line) for _, line in _numbered_lines(text)
    ):
        return parse_liftplan(text, path.stem)
    return Draft(parse_rows(text), title=path.stem)


def parse_rows(text: str) -> Bools:
    """Read a drawdown from text, with a row of characters for each pick."""
    rows: list[str] = []
    first = 0
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.translate(_SEPARATORS)
        if unknown := set(cells) - _CELLS.keys():
            raise InputError(
                f'line {number}: "{min(unknown, key=cells.index)}" is not a crossing',
                allowed="1, # or X (end over pick), 0, . or - (end under pick)",
            )
        if not cells:
            continue
        if rows and len(cells) != len(rows[0]):
            raise InputError(
                f"line {number} has {len(cells)} ends, but line {first} has {len(rows[0])}",
                cure="Give every line the same number of characters.",
            )
        first = first or number
        rows.append(cells)
    if not rows:
        raise InputError("the file is empty", allowed="a line of 0 and 1 for each pick")
    check_size(len(rows[0]), len(rows))
    return np.array([[_CELLS[cell] for cell in row] for row in rows])


def parse_liftplan(text: str, title: str = "") -> Draft:
    """Read a liftplan as people type it; its threading is assumed to be a straight draw."""
    picks: list[tuple[int, ...]] = []
    for number, line in _numbered_lines(text):
        match = _SHAFT_LIST.fullmatch(line)
        assert match is not None
        pick, shafts = match.groups()
        if pick is not None and int(pick) != len(picks) + 1:
            raise InputError(
                f"line {number}: pick {int(pick)} comes after pick {len(picks)}", cure=_LIST_CURE
            )
        picks.append(tuple(sorted({int(word) for word in re.findall("[0-9]+", shafts)} - {0})))
    most = max((shaft for lifted in picks for shaft in lifted), default=0)
    if most > _MOST_SHAFTS or (most > 9 and all(len(lifted) < 2 for lifted in picks)):
        raise InputError(
            f"{most} may mean shaft {most}, or shafts {', '.join(str(most))}",
            allowed=f"shafts from 1 to {_MOST_SHAFTS}",
            cure=_LIST_CURE,
        )
    check_size(most, len(picks))
    loom = Loom(tuple((shaft,) for shaft in range(1, most + 1)), liftplan=tuple(picks))
    remark = InfoMessage(
        f"a liftplan has no threading: a straight draw over its {most} shafts is assumed"
    )
    return Draft(loom.drawdown(), loom, title=title, warnings=(remark,))


def _numbered_lines(text: str) -> list[tuple[int, str]]:
    found = ((number, line.strip()) for number, line in enumerate(text.splitlines(), 1))
    return [(number, line) for number, line in found if line]


def read_picture(path: Path) -> Draft:
    """Read a drawdown from a black-and-white picture, one pixel for each crossing."""
    try:
        from PIL import Image
    except ImportError:
        raise MissingLibraryError(
            f"{path}: pictures need Pillow, which is not installed",
            cure='Run "pip install pillow".',
        ) from None
    picture = decode_picture(read_draft_bytes(path), check_size).convert("RGBA")
    white = Image.new("RGBA", picture.size, "white")
    gray = np.asarray(Image.alpha_composite(white, picture).convert("L"))
    between = np.count_nonzero((gray > 16) & (gray < 239))
    warning = (
        f"{path.name}: {between} of {gray.size} pixels are neither black nor white; those darker "
        "than middle grey are read as black"
    )
    return Draft(gray[::-1] < 128, title=path.stem, warnings=(warning,) if between else ())


def format_rows(draft: Draft) -> bytes:
    """Return a drawdown as rows of 0 and 1, the first pick first."""
    return "".join(f"{row}\n" for row in to_rows(draft.drawdown)).encode()


def row_losses(draft: Draft) -> list[str]:
    """Return sentences about what rows of 0 and 1 cannot store of a draft."""
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
    return [f"rows of 0 and 1 store only the drawdown: no {', no '.join(lost)}"] if lost else []
