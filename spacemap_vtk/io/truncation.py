"""Whether a file is whole, asked where VTK's own reader would crash or take what is there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io import truncation_legacy, truncation_netcdf
from spacemap_vtk.io.texture_atlas import read_picture


def truncated(path: Path) -> InputError:
    """Return the error for a file that ends too early."""
    return InputError(
        f"{path}: truncated: it holds less than its header promises",
        key="file",
        cure="Write the file again, whole.",
    )


def check_ply(path: Path) -> None:
    """Refuse a PLY file that is shorter than its header says: VTK's reader crashes on it."""
    content = path.read_bytes()
    header, end, body = content.partition(b"end_header")
    lines = [line.split() for line in header.decode("latin-1").splitlines()]
    if not content.startswith(b"ply") or not end:
        raise InputError(
            f"{path}: no PLY file: its header is missing or cut off",
            key="file",
            cure="Write the file again, whole.",
        )
    # how many of each, and the types of its properties: of a list two
    elements: list[tuple[int, list[list[str]]]] = []
    for words in lines:
        if words[:1] == ["element"] and words[-1].isdigit():
            elements.append((int(words[-1]), []))
        elif words[:1] == ["property"] and elements:
            elements[-1][1].append(words[2:4] if words[1] == "list" else words[1:2])
    if ["format", "ascii", "1.0"] in lines:
        short = body.count(b"\n") - 1 + (not body.endswith(b"\n")) < sum(
            count for count, _ in elements
        )
    else:
        big = ["format", "binary_big_endian", "1.0"] in lines
        short = _ply_end(body.partition(b"\n")[2], elements, ">" if big else "<") is None
    if short:
        raise truncated(path)


_PLY_TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1"},
    **{"short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2"},
    **{"int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}


def _ply_end(body: bytes, elements: list[tuple[int, list[list[str]]]], order: str) -> int | None:
    """Return where the last element of a binary PLY file ends; None if the file ends before."""
    at = 0
    for count, properties in elements:
        types = [[np.dtype(order + _PLY_TYPES.get(t, "u1")) for t in kinds] for kinds in properties]
        left = count
        while left:
            size, counts = _ply_row(body, at, types)
            if at + size > len(body):
                return None
            # all that follow with lists of the same lengths at once
            rows = min(left, (len(body) - at) // size)
            if counts:
                table = np.frombuffer(body, np.uint8, rows * size, at).reshape(rows, size)
                same = np.ones(rows, dtype=np.bool_)
                for place, width in counts:
                    part = table[:, place : place + width]
                    same &= (part == part[0]).all(axis=1)
                rows = rows if same.all() else int(np.argmin(same))
            at, left = at + rows * size, left - rows
    return at


def _ply_row(
    body: bytes, at: int, types: list[list[np.dtype[Any]]]
) -> tuple[int, list[tuple[int, int]]]:
    """Return the bytes of one element, and place and width of the counts of its lists."""
    size, counts = 0, []
    for kinds in types:
        if len(kinds) == 2:
            width = kinds[0].itemsize
            text = body[at + size : at + size + width]
            if len(text) < width:
                return len(body) + 1, []
            counts.append((size, width))
            size += width + int(np.frombuffer(text, kinds[0])[0]) * kinds[1].itemsize
        else:
            size += kinds[0].itemsize
    return size, counts


def check_gltf(path: Path) -> None:
    """Refuse a glTF file that is not whole, or whose parts beside it are not."""
    content = path.read_bytes()
    if path.suffix.lower() == ".glb":
        if content[:4] != b"glTF":
            raise InputError(f"{path}: no binary glTF: it does not begin with that word")
        if len(content) < 20 or len(content) < int.from_bytes(content[8:12], "little"):
            raise truncated(path)
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    try:
        described: dict[str, Any] = json.loads(content)
        named = [*described.get("buffers", []), *described.get("images", [])]
        files = [(path.parent / unquote(part["uri"]), part) for part in named if "uri" in part]
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: no glTF, or cut off: {error}", key="file", cure="Write the file again, whole."
        ) from None
    for file, part in files:
        if str(part["uri"]).startswith("data:"):
            continue
        if not file.is_file():
            raise InputError(f"{path} names {part['uri']}, which is not there", key="file")
        if "byteLength" not in part:
            read_picture(file)
        elif file.stat().st_size < part["byteLength"]:
            raise truncated(file)


def check_stl(path: Path) -> None:
    """Refuse a binary STL file that has fewer triangles than it says."""
    with path.open("rb") as file:
        head = file.read(84)
        if head[:5].lower() == b"solid":
            begin = head + file.read(1000)
            if b"facet" in begin:  # text
                file.seek(max(0, path.stat().st_size - 1000))
                if b"endsolid" not in file.read():
                    raise truncated(path)
                return
    if len(head) < 84 or path.stat().st_size < 84 + 50 * int.from_bytes(head[80:84], "little"):
        raise truncated(path)


def check_legacy(path: Path) -> None:
    """Refuse a legacy .vtk file that is truncated."""
    if truncation_legacy.is_cut_off(path):
        raise truncated(path)


def check_exodus(path: Path) -> None:
    """Refuse an Exodus file that is truncated, or none: its library prints at length."""
    with path.open("rb") as file:
        magic = file.read(4)
    if magic[:3] != b"CDF" and magic != b"\x89HDF":
        raise InputError(f"{path}: no Exodus file: neither netCDF nor HDF5", key="file")
    if truncation_netcdf.is_cut_off(path):
        raise truncated(path)


#: For each ending the check of its files.
CHECKS = {
    **{".ply": check_ply, ".stl": check_stl, ".gltf": check_gltf, ".glb": check_gltf},
    **{".vtk": check_legacy, **dict.fromkeys((".e", ".ex2", ".exo", ".exii"), check_exodus)},
}
