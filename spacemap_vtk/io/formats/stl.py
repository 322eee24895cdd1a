"""Read and write STL: triangles, of which only the corners are stored.

VTK's writer can write only to a disk; this one makes the file in memory.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.registry import lazy_function, reads, truncated_error, writes

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

#: Triangles that are processed together; more would need more memory, and no less time.
_BLOCK_TRIANGLES = 2**16
#: Bytes per point that making the file needs besides the surface.
_POINT = 20
#: Bytes per triangle. VTK needs more to orient the triangles alike than their records take, which
#: have 50 bytes each.
_TRIANGLE = 117


def _check(path: Path) -> None:
    """Refuse a binary file with fewer triangles than it states, or a text without its end."""
    with path.open("rb") as file:
        head = file.read(84)
        if head[:5].lower() == b"solid":
            begin = head + file.read(1000)
            if b"facet" in begin:  # text
                file.seek(max(0, path.stat().st_size - 1000))
                if b"endsolid" not in file.read():
                    raise truncated_error(path)
                return
    if len(head) < 84 or path.stat().st_size < 84 + 50 * int.from_bytes(head[80:84], "little"):
        raise truncated_error(path)


reads(".stl", label="STL", holds="mesh", check=_check)(
    lazy_function("reading", "read_with_vtk", "vtkIOGeometry", "vtkSTLReader")
)


@writes(".stl", label="STL", holds=("surface", "obstacles"))
def write_stl(file: Path, surface: vtkPolyData) -> None:
    """Write a surface as binary triangles."""
    import numpy as np

    from spacemap_vtk.datasets.arrays import points_of
    from spacemap_vtk.io.polygons import (
        corners_of,
        orient_polygons,
        require_writer_memory,
        triangle_count,
        triangulate,
    )

    size = _POINT * surface.GetNumberOfPoints() + _TRIANGLE * triangle_count(surface)
    require_writer_memory(surface, size, ".stl")
    triangles = orient_polygons(triangulate(surface))
    _, numbers = corners_of(triangles)
    kinds: Any = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
    records = np.zeros(len(numbers) // 3, kinds)
    for begin in range(0, len(records), _BLOCK_TRIANGLES):
        part = records[begin : begin + _BLOCK_TRIANGLES]
        corners = points_of(triangles)[numbers[3 * begin :][: 3 * len(part)]].reshape(-1, 3, 3)
        part["corners"] = corners
        first, second, third = np.moveaxis(corners.astype(np.float64), 1, 0)
        normals = np.cross(second - first, third - first)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        part["normal"] = np.divide(normals, lengths, out=normals, where=lengths > 0)
    head = b"Binary STL by spacemap_vtk".ljust(80, b"\0")  # "solid" would mean a text file
    write_parts(file, [head, np.array(len(records), "<u4"), records])
