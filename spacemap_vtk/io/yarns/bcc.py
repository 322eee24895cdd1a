"""Binary curve collections (.bcc): Catmull-Rom curves in single precision, of Cem Yuksel.

A header of 64 bytes, then for each curve its number of points, negative for a loop, and its points.
The format has neither a unit nor a diameter; both are written into the header's 40 free bytes, and
read from there. A longer form (.bccx) appends a radius and states of a simulation.

Described by C. Yuksel, "Using Binary Curve Collection (BCC) files", cyCodeBase.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import damaged_error, truncated_error
from spacemap_vtk.io.yarns.file_bytes import check_curves, join_ends, no_cell, read_yarn_bytes
from spacemap_vtk.textile.rods.curves import Curve, CurveSet

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import YarnCurves

_HEADER = struct.Struct("<3sB2sBBQQ40s")
#: Sizes of integers and of numbers in bytes: 4 and 4.
_SIZES = 0x44
#: Catmull-Rom curves whose parameter grows by 1 from point to point.
_UNIFORM = b"C0"
_NOTE = "spacemap_vtk: unit m"
_DIAMETER = re.compile(rb"diameter ([0-9.e+-]+)")


def read_bcc(path: Path) -> CurveSet:
    """Read a binary curve collection."""
    data = read_yarn_bytes(path)
    if data[:3] != b"BCC":
        raise damaged_error(path, "not a binary curve collection: it does not begin with BCC")
    if len(data) < _HEADER.size:
        raise truncated_error(path)
    _, sizes, kind, dimensions, up, count, total, note = _HEADER.unpack_from(data)
    for what, found, wanted in (
        ("sizes of numbers", f"0x{sizes:x}", "0x44"),
        ("kind of curves", kind.decode("latin-1"), "C0"),
        ("number of dimensions", str(dimensions), "3"),
    ):
        if found != wanted:
            raise InputError(
                f"{path}: {what} in the header is not supported",
                key="file",
                value=found,
                allowed=wanted,
                cure="Write uniform Catmull-Rom curves in 3D with 4-byte numbers.",
            )
    diameter = _DIAMETER.search(note)
    width = float(diameter.group(1)) if diameter else 0.0
    curves, place, seen = [], _HEADER.size, 0
    for _ in range(count):
        if place + 4 > len(data):
            raise truncated_error(path)
        signed = int(np.frombuffer(data, "<i4", 1, place)[0])
        size = abs(signed)
        place += 4
        if place + 12 * size > len(data):
            raise truncated_error(path)
        points = np.frombuffer(data, "<f4", 3 * size, place).reshape(-1, 3).astype(np.float64)
        place, seen = place + 12 * size, seen + size
        if up in (0, 1):  # z is up here
            points = np.roll(points, 2 - up, axis=1)
        nodes, periods = (points, (0, 0)) if signed < 0 else join_ends(points)
        curves.append(Curve(nodes, periods, width))
    if seen != total:
        raise damaged_error(path, f"its curves have {seen} points, and its header says {total}")
    unit = 1.0 if note.startswith(_NOTE.encode()) else None
    return CurveSet(check_curves(path, curves), no_cell(), True, unit)


def format_bcc(curves: YarnCurves) -> Iterator[bytes]:
    """Yield the bytes of a collection: points at the ends of the Bézier curves, in metres."""
    parts = list(split_curves(curves))
    total = sum(len(nodes) for nodes, _ in parts)
    widths = np.unique(np.round(curves.widths, 12))
    note = f"{_NOTE}, diameter {widths[0]:.4g}" if len(widths) == 1 else _NOTE
    yield _HEADER.pack(b"BCC", _SIZES, _UNIFORM, 3, 2, len(parts), total, note.encode())
    for nodes, is_loop in parts:
        yield struct.pack("<i", -len(nodes) if is_loop else len(nodes))
        yield nodes.astype("<f4").tobytes()


def split_curves(curves: YarnCurves) -> Iterator[tuple[np.ndarray, bool]]:
    """Yield the points of each yarn at the ends of its Bézier curves, and whether it is a loop."""
    begin = 0
    for count in curves.counts.tolist():
        nodes = np.asarray(curves.points[0, begin : begin + count : 3], dtype=np.float64)
        begin += count
        size = float(np.abs(nodes).max(initial=0.0))
        is_loop = len(nodes) > 3 and bool((abs(nodes[0] - nodes[-1]) <= 1e-6 * size).all())
        yield (nodes[:-1], True) if is_loop else (nodes, False)


def bcc_losses(curves: YarnCurves | None) -> list[str]:
    """Return sentences about what a .bcc cannot store of yarns."""
    if curves is None:
        return []
    found = ["a .bcc stores no colours, and positions in single precision"]
    if len(np.unique(np.round(curves.widths, 12))) > 1:
        found.append("a .bcc stores no diameters that differ from yarn to yarn")
    return found
