"""Code shared by the readers of all formats of yarns."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.io.registry import damaged_error, require_file
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.curves import Curve

#: Largest file [bytes], and most points of its yarns.
MAX_BYTES, MAX_POINTS = 2**28, 5_000_000
#: Largest coordinate in a file; larger ones are no lengths.
_LARGEST = 1e9


def read_yarn_bytes(path: Path) -> bytes:
    """Read a file of yarns; refuse one that is too large."""
    require_file(path)
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise SizeError(
            f"{path}: the file is too large for yarns",
            key="file",
            value=f"{size} bytes",
            allowed=f"up to {MAX_BYTES} bytes",
            cure="Cut the textile to one repeat.",
        )
    return path.read_bytes()


def check_curves(path: Path, curves: list[Curve]) -> list[Curve]:
    """Return yarns; refuse a file without any, with too many points, or with no lengths."""
    if not curves:
        raise InputError(
            f"{path}: the file has no yarns", key="file", cure="Choose a file with curves."
        )
    count = sum(len(curve.nodes) for curve in curves)
    if count > MAX_POINTS:
        raise SizeError(
            f"{path}: the yarns have too many points",
            key="file",
            value=count,
            allowed=f"up to {MAX_POINTS}",
            cure="Cut the textile to one repeat.",
        )
    for number, curve in enumerate(curves):
        if len(curve.nodes) < (2 if curve.periods is None else 1):
            raise damaged_error(path, f"yarn {number} has {len(curve.nodes)} points")
        check_numbers(path, curve.nodes, f"a coordinate of yarn {number}")
    return curves


def check_numbers(path: Path, values: Floats, what: str) -> None:
    """Refuse numbers that are no lengths."""
    bad = values[~(abs(values) < _LARGEST)]
    if bad.size:
        raise damaged_error(path, f"{what} is {bad.flat[0]:g}")


def join_ends(nodes: Floats) -> tuple[Floats, tuple[int, int] | None]:
    """Return points and periods of a curve: a loop if its last point is its first one."""
    is_loop = len(nodes) > 3 and bool((nodes[0] == nodes[-1]).all())
    return (nodes[:-1], (0, 0)) if is_loop else (nodes, None)


def text_of(path: Path, data: bytes) -> str:
    """Decode a text file; refuse a binary one."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise damaged_error(path, "not a text") from None


def no_cell() -> Floats:
    """Return the period vectors of a textile that does not repeat itself."""
    return np.zeros((2, 3))
