"""PLY: polygons with normals and texture coordinates, or triangles with normals and colours.

VTK's writer can write only to a disk, and does not report that it is full; this one makes the file
in memory.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import find_record_in_comments, finds_record, record_comments
from spacemap_vtk.io.registry import damaged_error, lazy_function, reads, truncated_error, writes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    from spacemap_vtk.datasets.moving_surface import MovingSurface

#: Bytes per point that are needed, besides the surface, to make the file: six numbers.
_POINT = 24
#: Bytes per corner of a polygon: its point number in the file, and its point number in the copy
#: whose polygons all have the same orientation.
_CORNER = 14
_SIZES = {"u1": "uchar", "<i4": "int"}
_TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1"},
    **{"short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2"},
    **{"int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}


def _check(path: Path) -> None:
    """Refuse a file that is shorter than its header says; VTK's reader would crash on it."""
    content = path.read_bytes()
    header, end, body = content.partition(b"end_header")
    lines = [line.split() for line in header.decode("latin-1").splitlines()]
    if not content.startswith(b"ply") or not end:
        raise damaged_error(path, "not a PLY file: its header is missing or truncated")
    # For each element: its number, and the types of its properties. A list has two types.
    elements: list[tuple[int, list[list[str]]]] = []
    names: list[tuple[str, ...]] = []
    for words in lines:
        if words[:1] == ["element"]:
            known = len(words) == 3 and re.fullmatch("[0-9]{1,18}", words[2])
            elements.append((int(words[2]) if known else -1, []))
            names.append(tuple(words[1:2]))
        elif words[:1] == ["property"] and elements:
            elements[-1][1].append(words[2:-1] if words[1:2] == ["list"] else words[1:-1])
            names.append((*names[-1][:1], *words[-1:]))
    for count, properties in elements:
        kinds = [len(each) in (1, 2) and _TYPES.keys() >= set(each) for each in properties]
        if count < 0 or not kinds or not all(kinds) or len(set(names)) < len(names):
            why = "its header has an element without count or properties, or one twice"
            raise damaged_error(path, f"not a PLY file: {why}")
    if ["format", "ascii", "1.0"] in lines:
        short = body.count(b"\n") - 1 + (not body.endswith(b"\n")) < sum(
            count for count, _ in elements
        )
    else:
        big = ["format", "binary_big_endian", "1.0"] in lines
        short = _ply_end(body.partition(b"\n")[2], elements, ">" if big else "<") is None
    if short:
        raise truncated_error(path)


def _ply_end(body: bytes, elements: list[tuple[int, list[list[str]]]], order: str) -> int | None:
    """Return where the last element of a binary PLY file ends, or None if the file ends before."""
    import numpy as np

    at = 0
    for count, properties in elements:
        types = [[np.dtype(order + _TYPES[t]) for t in kinds] for kinds in properties]
        left = count
        while left:
            size, counts = _ply_row(body, at, types)
            if at + size > len(body):
                return None
            # Skip all following elements with lists of the same lengths at once.
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
    """Return the bytes of one element, and the place and width of the counts of its lists."""
    import numpy as np

    size, counts = 0, []
    for kinds in types:
        if len(kinds) == 2:
            width = kinds[0].itemsize
            text = body[at + size : at + size + width]
            if len(text) < width:
                return len(body) + 1, []
            length = np.frombuffer(text, kinds[0])[0]
            if not 0 <= length <= len(body):  # also for NaN
                return len(body) + 1, []
            counts.append((size, width))
            size += width + int(length) * kinds[1].itemsize
        else:
            size += kinds[0].itemsize
    return size, counts


reads(".ply", label="PLY", holds="mesh", check=_check)(
    lazy_function("reading", "read_with_vtk", "vtkIOPLY", "vtkPLYReader")
)


@writes(".ply", label="PLY", holds=("surface", "obstacles"))
def write_ply(file: Path, surface: vtkPolyData) -> None:
    """Write a surface in binary."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.io.polygons import corners_of, orient_polygons, require_writer_memory

    corners = surface.GetPolys().GetNumberOfConnectivityIds()
    require_writer_memory(surface, _POINT * surface.GetNumberOfPoints() + _CORNER * corners, ".ply")
    polygons = orient_polygons(surface)
    counts, numbers = corners_of(polygons)
    data, given = polygons.GetPointData(), []
    for names, array in (
        (("x", "y", "z"), polygons.GetPoints().GetData() if polygons.GetPoints() else None),
        (("nx", "ny", "nz"), data.GetNormals()),
        (("u", "v"), data.GetTCoords()),
    ):
        if array is not None:
            given.append((names, vtk_to_numpy(array)))
    columns = [name for names, _ in given for name in names]
    vertices = np.empty((polygons.GetNumberOfPoints(), len(columns)), "<f4")
    for names, values in given:
        at = columns.index(names[0])
        vertices[:, at : at + len(names)] = values[:, : len(names)]
    # A polygon is its number of corners, in one byte if possible, and then the corners.
    size = "u1" if counts.max(initial=0) < 256 else "<i4"
    properties = [f"property float {name}" for name in columns]
    head = _header(len(vertices), properties, len(counts), size)
    write_parts(file, [head, vertices, _face_records(counts, numbers, size)])


# This writer is registered last, so it is used if nothing else is requested.
@writes(".ply", label="PLY", holds=("painted",))
def write_painted_ply(file: Path, surface: MovingSurface) -> None:
    """Write triangles in binary, with a colour for each point."""
    import numpy as np

    kinds: list[Any] = [("point", "<f4", 3), ("normal", "<f4", 3), ("color", "u1", 3)]
    if surface.normals is None:
        del kinds[1]
    vertices = np.empty(len(surface.points), kinds)
    vertices["point"], vertices["color"] = surface.points, surface.colors
    if surface.normals is not None:
        vertices["normal"] = surface.normals
    names = {"point": "float x y z", "normal": "float nx ny nz", "color": "uchar red green blue"}
    properties = []
    for kind in kinds:
        form, *columns = names[kind[0]].split()
        properties += [f"property {form} {name}" for name in columns]
    faces = surface.triangles.astype("<i4")
    words = surface.metadata.get("colors")
    head = _header(
        len(vertices), properties, len(faces), "u1", f"colours: {words}" if words else ""
    )
    write_parts(file, [head, vertices, _uniform_faces(faces, "u1")])


def _header(vertices: int, properties: list[str], faces: int, size: str, note: str = "") -> bytes:
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment by spacemap_vtk",
        *record_comments("comment"),
        *([f"comment {note}"] if note else []),
        f"element vertex {vertices}",
        *properties,
        f"element face {faces}",
        f"property list {_SIZES[size]} int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(lines).encode()


def _face_records(counts: NDArray[Any], corners: NDArray[Any], size: str) -> NDArray[Any]:
    """Return polygons in the layout of .ply: for each the number of corners, then the corners."""
    import numpy as np

    kinds = np.unique(counts)
    if len(kinds) == 1:
        return _uniform_faces(corners.reshape(len(counts), -1), size)
    first = np.cumsum(counts) - counts
    lengths = np.dtype(size).itemsize + 4 * counts
    begin = np.cumsum(lengths) - lengths
    faces = np.empty(lengths.sum(), np.uint8)
    for count in kinds:
        rows = np.flatnonzero(counts == count)[:, None]
        made = _uniform_faces(corners[first[rows] + np.arange(count)], size)
        faces[begin[rows] + np.arange(made.itemsize)] = made.view(np.uint8).reshape(len(rows), -1)
    return faces


def _uniform_faces(corners: NDArray[Any], size: str) -> NDArray[Any]:
    import numpy as np

    faces = np.empty(len(corners), [("count", size), ("corners", "<i4", corners.shape[1:])])
    faces["count"] = corners.shape[1]
    faces["corners"] = corners
    return faces


finds_record(".ply")(find_record_in_comments)
