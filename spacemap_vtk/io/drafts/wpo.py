"""Read drafts of WeavePoint (.wpo), as far as their layout is known.

Numbers are single bytes; where the table says so, they are two bytes with the high byte first:

======  ===========================================================================================
byte    content
======  ===========================================================================================
0       123
1       version; 7 at present
2       100: liftplan, 101: one treadle per pick, 102: several treadles per pick
4, 5    shafts, treadles
7       0: a rising shed
9, 10   ends and picks per length: per centimetre if byte 17 is 1, per inch if it is 0
13, 15  numbers of ends and picks that there is room for (two bytes each)
24 on   threading, warp colours, weft colours: each a count (two bytes), then a byte per thread; the
        tie-up: a mask of shafts for each treadle; the treadling: either as the threading, or the
        number of picks (two bytes), then for each a mask of treadles, or of shafts for a liftplan;
        66 bytes; the number of colours, then their red, green and blue, which reach 255, or 63 up
        to version 3.
======  ===========================================================================================

Ends in no heddle and picks without a shed at the edges of the room are left out, because they are
not part of the cloth. A mask has as many bytes as it needs for one bit each, the low byte first.
The rest of the file (notes, and a list of yarns) is not read.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.draft_bytes import check_size, loose_thread_warnings, read_draft_bytes
from spacemap_vtk.io.registry import truncated_error
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom, Rows

#: First byte of a file.
_ID = 123
#: Values of byte 2.
_LIFTPLAN = 100
_SINGLE = 101
_SEVERAL = 102
#: Bytes of the head.
_HEAD = 24
#: Newest version that is known.
_NEWEST = 7
_CURE = "Export the draft as WIF from WeavePoint."


def read_wpo(path: Path) -> Draft:
    """Read a WeavePoint draft."""
    data = read_draft_bytes(path)
    if data[:1] != bytes([_ID]):
        what = "the file does not begin like a WeavePoint draft"
        raise InputError(what, allowed="a .wpo file", cure=_CURE)
    try:
        return _read_draft(_ByteReader(data), path.stem)
    except IndexError:
        raise truncated_error(path) from None


class _ByteReader:
    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def read(self, count: int) -> bytes:
        if self.at + count > len(self.data):
            raise IndexError
        self.at += count
        return self.data[self.at - count : self.at]

    def read_number(self) -> int:
        return int.from_bytes(self.read(2), "big")

    def read_numbers(self) -> list[int]:
        return list(self.read(self.read_number()))

    def read_masks(self, bits: int, count: int) -> Rows:
        width = -(-bits // 8)
        masks = (int.from_bytes(self.read(width), "little") for _ in range(count))
        return tuple(tuple(k + 1 for k in range(bits) if mask >> k & 1) for mask in masks)


def _read_draft(data: _ByteReader, title: str) -> Draft:
    head = data.read(_HEAD)
    version, kind, shafts, treadles = head[1], head[2], head[4], head[5]
    if kind not in (_LIFTPLAN, _SINGLE, _SEVERAL):
        raise InputError("unknown kind of treadling", value=kind, cure=_CURE)
    warnings = []
    if version > _NEWEST:
        warnings.append(
            f"version {version} of WeavePoint files is unknown; it is read as {_NEWEST}"
        )
    threading = _single_rows(data.read_numbers())
    colors = data.read_numbers(), data.read_numbers()
    tieup: Rows = ()
    if kind != _LIFTPLAN:
        tieup = data.read_masks(shafts, treadles)
    if kind == _SINGLE:
        picks = _single_rows(data.read_numbers())
    else:
        picks = data.read_masks(shafts if kind == _LIFTPLAN else treadles, data.read_number())
    room = int.from_bytes(head[13:15], "big"), int.from_bytes(head[15:17], "big")
    size = max(room[0], len(threading)), max(room[1], len(picks))
    check_size(*size)
    threading, picks = (
        (*rows, *[()] * (count - len(rows)))
        for rows, count in zip((threading, picks), size, strict=True)
    )
    loom = Loom(
        threading=threading,
        tieup=tieup,
        treadling=() if kind == _LIFTPLAN else picks,
        liftplan=picks if kind == _LIFTPLAN else None,
        rising=head[7] == 0,
        shafts=shafts,
        treadles=0 if kind == _LIFTPLAN else treadles,
    )
    data.read(66)
    table = np.frombuffer(data.read(3 * data.read(1)[0]), np.uint8).reshape(-1, 3)
    if version < 4:
        table = np.minimum(table.astype(np.uint16) * 255 // 63, 255).astype(np.uint8)
    length = 0.01 if head[17] == 1 else 0.0254
    warp, weft = (
        DraftThreads(
            spacing=length / sett if sett else None,
            colors=None if not used or max(used) >= len(table) else table[np.resize(used, count)],
        )
        for sett, used, count in zip(head[9:11], colors, size, strict=True)
    )
    # The room is a canvas, 1200 x 1200 at first; edges that are not woven are no part of the cloth.
    draft = Draft(loom.drawdown(), loom, warp, weft, title).trim()
    assert draft.loom is not None
    return replace(draft, warnings=(*warnings, *loose_thread_warnings(draft.loom)))


def _single_rows(numbers: list[int]) -> Rows:
    return tuple((number,) if number else () for number in numbers)
