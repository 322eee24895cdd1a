"""Blocks: rectangular parts of a grid of marks or of a strip of colours, and blocks as text.

A block is an array with a row for each thread: (threads, places) bool, True where a shaft or
treadle is marked, or (threads, 1, 3) uint8, the colour of each thread. In this orientation a block
of a threading can be pasted into a treadling, and a block of a tie-up into a liftplan.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.textile.drafts.loom import to_marks

_ROWS = re.compile(r"[.xX#01|]+")
_COLOR = re.compile(r"#[0-9a-fA-F]{6}")
#: Largest number of a shaft or treadle in a list.
_MAX_NUMBER = 4096


def tile_block(block: NDArray, rows: int, columns: int) -> NDArray:
    """Repeat a block over an area, and cut it off there.

    Parameters
    ----------
    block : (m, n, ...) ndarray
        Marks or colours.
    rows, columns : int
        Size of the area.

    Returns
    -------
    (rows, columns, ...) ndarray
    """
    return block[np.arange(rows)[:, None] % len(block), np.arange(columns) % block.shape[1]]


def paste_block(
    grid: NDArray, block: NDArray, row: int, column: int, overlay: bool = False
) -> NDArray:
    """Paste a block into a grid; what would lie outside is cut off.

    Parameters
    ----------
    grid : (m, n, ...) ndarray
        Marks or colours; it is not changed.
    block : (k, l, ...) ndarray
        Of the same kind.
    row, column : int
        Place of the block's first cell, from 0.
    overlay : bool
        Whether present marks stay. Colours are always replaced.

    Returns
    -------
    (m, n, ...) ndarray
    """
    result = grid.copy()
    part = result[row : row + len(block), column : column + block.shape[1]]
    fitting = block[: part.shape[0], : part.shape[1]]
    part[...] = part | fitting if overlay and grid.dtype == bool else fitting
    return result


def write_block(block: NDArray) -> str:
    """Write a block as text: a line for each thread, of X and dots, or its colour as #rrggbb.

    Parameters
    ----------
    block : (threads, places) bool or (threads, 1, 3) uint8
        Marks or colours.

    Returns
    -------
    str
        Read again by `read_block`.

    Examples
    --------
    >>> write_block(np.eye(2, dtype=bool))
    'X.\\n.X'
    """
    if block.dtype == bool:
        return "\n".join("".join(".X"[mark] for mark in row) for row in block.tolist())
    return "\n".join("#{:02x}{:02x}{:02x}".format(*color) for color in block[:, 0].tolist())


def read_block(text: str) -> NDArray:
    """Read a block from text.

    Parameters
    ----------
    text : str
        Rows of X and dots or of 0 and 1, one for each thread; or colours as #rrggbb; or numbers of
        shafts or treadles: in one line the number of each thread, such as ``1 2 3 4 3 2``; in
        several lines the numbers of each thread, such as ``1 3``.

    Returns
    -------
    (threads, places) bool or (threads, 1, 3) uint8
        Marks or colours.

    Raises
    ------
    InputError
        The text is none of these.

    Examples
    --------
    >>> read_block("1 2 3 2").astype(int).tolist()
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0]]
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    words = [re.split(r"[\s,;]+", line.strip(" ,;")) for line in lines]
    flat = [word for row in words for word in row]
    if flat and all(_COLOR.fullmatch(word) for word in flat):
        colors = [[int(word[k : k + 2], 16) for k in (1, 3, 5)] for word in flat]
        return np.array(colors, dtype=np.uint8)[:, None]
    if _is_rows(lines):
        return np.array([[mark not in ".0" for mark in line] for line in lines])
    return _read_numbers(words if len(words) > 1 else [[word] for word in flat])


def _is_rows(lines: list[str]) -> bool:
    """Return whether lines are rows of marks; a single line of digits is a list of numbers."""
    if not lines or len({len(line) for line in lines}) > 1:
        return False
    # One mark a line without dots, such as 1, is the number of a shaft.
    digits = all(line.isdigit() for line in lines) and (len(lines) == 1 or len(lines[0]) == 1)
    return not digits and all(_ROWS.fullmatch(line) for line in lines)


def _read_numbers(rows: list[list[str]]) -> Bools:
    numbers = []
    for row in rows:
        if not all(word.isdecimal() and int(word[:6]) <= _MAX_NUMBER for word in row):
            raise InputError(
                "the text on the clipboard is no part of a draft",
                value=" ".join(row),
                allowed="numbers of shafts or treadles, rows of X and dots, or colours as #rrggbb",
            )
        numbers.append(tuple(int(word) for word in row if int(word)))
    highest = max((max(row, default=0) for row in numbers), default=0)
    if not highest:
        raise InputError("the clipboard contains no part of a draft", cure="Copy a part first")
    return to_marks(numbers, highest)
