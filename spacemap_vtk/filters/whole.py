"""Whether a file is whole, asked where VTK's own reader would crash or take what is there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.paint import read_picture


def truncated(path: Path) -> InputError:
    """Return the error for a file that ends too early.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    InputError
        To be raised.
    """
    return InputError(
        f"{path}: truncated: it holds less than its header promises",
        key="file",
        cure="Write the file again, whole.",
    )


def check_ply(path: Path) -> None:
    """Refuse a PLY file that is shorter than its header says: VTK's reader crashes on it.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    InputError
        If it has no header, or too few bytes or lines.
    """
    content = path.read_bytes()
    header, end, body = content.partition(b"end_header")
    lines = [line.split() for line in header.decode("latin-1").splitlines()]
    if not content.startswith(b"ply") or not end:
        raise InputError(f"{path}: no PLY file: it does not begin with a PLY header", key="file")
    sizes: list[list[int]] = []  # count of elements, least bytes of one
    for words in lines:
        if words[:1] == ["element"] and words[-1].isdigit():
            sizes.append([int(words[-1]), 0])
        elif words[:1] == ["property"] and sizes:
            # of a list, its count alone is certain
            kind = words[2] if words[1] == "list" else words[1]
            sizes[-1][1] += _PLY_BYTES.get(kind, 1)
    if ["format", "ascii", "1.0"] in lines:
        short = body.count(b"\n") - 1 + (not body.endswith(b"\n")) < sum(n for n, _ in sizes)
    else:
        short = len(body) < sum(count * size for count, size in sizes)
        # faces of a surface have at least three corners of a byte each
        faces = [n for n, _ in sizes[1:2]]
        short |= len(body) < sum(n * s for n, s in sizes) + 3 * sum(faces)
    if short:
        raise truncated(path)


_PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def check_gltf(path: Path) -> None:
    """Refuse a glTF file that is not whole, or whose parts beside it are not.

    Parameters
    ----------
    path : Path
        A .gltf or .glb file.

    Raises
    ------
    InputError
        If it, or a buffer or picture that it names, is missing or shorter than it says.
    """
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
    """Refuse a binary STL file that has fewer triangles than it says.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    InputError
        If it is truncated.
    """
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


#: For each ending the check of its files.
CHECKS = {".ply": check_ply, ".stl": check_stl, ".gltf": check_gltf, ".glb": check_gltf}
