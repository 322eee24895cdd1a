"""Yarns of the Textiles Lab at Carnegie Mellon (.yarns).

Chunks of a name of 4 letters, a length and numbers: points, the lines of their source, and for each
yarn its points, radius and colour. A yarn is drawn through the middles of its polyline's pieces, as
a quadratic B-spline. Further chunks, on slack, are not needed for its shape.

Described in the README of github.com/textiles-lab/smobj.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from spacemap_vtk.io.registry import damaged_error, truncated_error
from spacemap_vtk.io.yarns.file_bytes import check_curves, join_ends, no_cell, read_yarn_bytes
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.rods.curves import Curve, CurveSet

_YARN = np.dtype(
    [("begin", "<u4"), ("end", "<u4"), ("radius", "<f4"), ("color", "u1", (4,))], align=False
)


def read_yarns(path: Path) -> CurveSet:
    """Read the yarns of a .yarns file."""
    data = read_yarn_bytes(path)
    if data[:4] != b"f3..":
        raise damaged_error(path, "not a file of yarns: it does not begin with f3..")
    chunks, place = {}, 0
    while place < len(data):
        if place + 8 > len(data):
            raise truncated_error(path)
        name, size = struct.unpack_from("<4sI", data, place)
        place += 8
        if place + size > len(data):
            raise truncated_error(path)
        chunks[name] = data[place : place + size]
        place += size
    if b"yarn" not in chunks:
        raise truncated_error(path)
    for name, size in ((b"f3..", 12), (b"yarn", _YARN.itemsize)):
        if len(chunks[name]) % size:
            raise damaged_error(path, f"the length of its chunk {name.decode()} is wrong")
    points = np.frombuffer(chunks[b"f3.."], "<f4").reshape(-1, 3).astype(np.float64)
    curves = []
    for number, each in enumerate(np.frombuffer(chunks[b"yarn"], _YARN)):
        begin, end = int(each["begin"]), int(each["end"])
        if not begin <= end <= len(points):
            raise damaged_error(path, f"yarn {number} has points {begin} to {end}")
        if end - begin < 2:
            continue
        nodes, periods = join_ends(smooth_polyline(points[begin:end]))
        red, green, blue, _ = each["color"].tolist()
        curves.append(Curve(nodes, periods, 2.0 * float(each["radius"]), color=(red, green, blue)))
    return CurveSet(check_curves(path, curves), no_cell(), False, None)


def smooth_polyline(points: Floats) -> Floats:
    """Return the middles of a polyline's pieces, the points between them, and its ends."""
    middle = (points[:-1] + points[1:]) / 2
    found = np.empty((2 * len(middle) + 1, 3))
    found[1::2] = middle
    found[2:-1:2] = (middle[:-1] + 2 * points[1:-1] + middle[1:]) / 4
    found[0], found[-1] = points[0], points[-1]
    return found
