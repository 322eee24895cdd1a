"""Write glTF in one file (.glb): triangles, materials, morph targets and animated weights.

Source: glTF 2.0 specification, Khronos Group. No library is used, because the existing ones
(pygltflib) store the JSON and leave the content of the buffer to their user.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from itertools import chain
from pathlib import Path
from struct import pack
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from spacemap_vtk.datasets.moving_surface import MovingSurface

#: Roughness of yarn, which scatters light and has a faint highlight.
_ROUGHNESS = 0.75
#: Quaternion that turns z up into y up.
_Z_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
#: Codes of glTF: for types of components, and for the use of a part of the buffer.
_COMPONENTS = {"<f4": 5126, "<u4": 5125, "<u2": 5123, "<i2": 5122, "|i1": 5120}
_VERTICES = 34962
_INDICES = 34963


@writes(".glb", label="glTF", holds=("moving", "modes"))
def write_glb(file: Path, moving: MovingSurface) -> None:
    """Write a surface with its targets and their animations."""
    import numpy as np

    from spacemap_vtk.datasets.moving_surface import to_linear_light

    buffer, short = _Buffer(), moving.quantised
    unit, factors = (1.0, 1.0) if short is None else (short.unit, short.factors)
    materials, primitives = [], []
    for number, material in enumerate(moving.materials):
        rows = np.flatnonzero(material.points)
        look = {"baseColorFactor": [*material.color, 1.0], "metallicFactor": 0.0}
        look["roughnessFactor"] = _ROUGHNESS
        materials.append({"name": material.name, "pbrMetallicRoughness": look, "doubleSided": True})
        attributes = {"POSITION": buffer.add(moving.points[rows] / unit, bounds=True)}
        if moving.normals is not None:
            attributes["NORMAL"] = buffer.add(moving.normals[rows])
        if moving.has_point_colors:
            shares = np.hstack([to_linear_light(moving.colors[rows]), np.ones((len(rows), 1))])
            table = np.round(65535 * shares).astype("<u2")
            attributes["COLOR_0"] = buffer.add(table, normalized=True)
        targets = []
        places: Any = moving.targets if short is None else short.targets
        facing: Any = moving.normal_targets if short is None else short.normals
        for k, target in enumerate(places):
            whole = target.dtype.kind == "i"
            part = buffer.add(target, rows=rows, bounds=True, normalized=whole)
            targets.append({"POSITION": part})
            if facing is not None:
                targets[-1]["NORMAL"] = buffer.add(facing[k], rows=rows, normalized=whole)
        place = np.zeros(len(moving.points), "<u4")
        place[rows] = np.arange(len(rows))
        corners = place[moving.triangles[material.points[moving.triangles[:, 0]]]]
        primitive = {"attributes": attributes, "material": number}
        primitive["indices"] = buffer.add(corners.reshape(-1), target=_INDICES)
        primitives.append(primitive | ({"targets": targets} if targets else {}))
    mesh: dict[str, Any] = {"name": moving.title or "surface", "primitives": primitives}
    if len(moving.targets):
        mesh["weights"] = [0.0] * len(moving.targets)
        mesh["extras"] = {"targetNames": list(moving.target_names)}
    node = {"name": moving.title or "surface", "mesh": 0} | (
        {"rotation": _Z_UP} if moving.is_z_up else {}
    )
    if short is not None:
        node["scale"] = [unit] * 3
    content: dict[str, Any] = {
        "asset": {
            "version": "2.0",
            "generator": "spacemap_vtk",
            "extras": {
                **moving.metadata,
                **({NAME: json.loads(record_text())} if record_text() else {}),
            },
        },
        "scene": 0,
        "scenes": [{"name": moving.title or "scene", "nodes": [0]}],
        "nodes": [node],
        "meshes": [mesh],
        "materials": materials,
    }
    animations = []
    for clip in moving.clips if len(moving.targets) else ():  # no animation without targets
        sampler = {"input": buffer.add(clip.times, target=None, bounds=True)}
        sampler["output"] = buffer.add((clip.weights * factors).reshape(-1), target=None)
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        animations.append({"name": clip.name, "samplers": [sampler], "channels": [channel]})
    if animations:
        content["animations"] = animations
    if short is not None:
        names = ["KHR_mesh_quantization"]
        content |= {"extensionsUsed": names, "extensionsRequired": names}
    content |= {"accessors": buffer.accessors, "bufferViews": buffer.views}
    content["buffers"] = [{"byteLength": buffer.size}]
    text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    head = pack("<4s3I4s", b"glTF", 2, 28 + len(text) + buffer.size, len(text), b"JSON")
    chunks = [head, text, pack("<I4s", buffer.size, b"BIN\0")]
    write_parts(file, chain(chunks, (part() for part in buffer.parts)))


class _Buffer:
    """All arrays of a file, one after another, with their descriptions in glTF."""

    def __init__(self) -> None:
        #: Functions that make an array when it is written; all arrays would need as much memory as
        #: the file.
        self.parts: list[Callable[[], NDArray[Any]]] = []
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.size = 0

    def add(
        self,
        values: NDArray[Any],
        target: int | None = _VERTICES,
        rows: NDArray[Any] | None = None,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Add an array, or some of its rows, and return the number of its accessor."""
        part = partial(_aligned_rows, values, rows)
        table = part()
        view = {"buffer": 0, "byteOffset": self.size, "byteLength": table.nbytes}
        columns = table.reshape(len(table), -1)
        if table.dtype.kind == "i":
            view["byteStride"] = table.itemsize * 4
            columns = columns[:, :3]
        accessor: dict[str, Any] = {
            "bufferView": len(self.views),
            "componentType": _COMPONENTS[table.dtype.str],
            "count": len(table),
            "type": "SCALAR" if table.ndim == 1 else f"VEC{columns.shape[1]}",
        }
        if bounds:
            accessor |= {"min": columns.min(axis=0).tolist(), "max": columns.max(axis=0).tolist()}
        self.views.append(view | ({} if target is None else {"target": target}))
        self.accessors.append(accessor | ({"normalized": True} if normalized else {}))
        self.parts.append(part)
        self.size += table.nbytes
        return len(self.accessors) - 1


def _aligned_rows(values: NDArray[Any], rows: NDArray[Any] | None) -> NDArray[Any]:
    """Return an array as it is stored: rows of a multiple of four bytes, so all are aligned."""
    import numpy as np

    kind = "<f4" if values.dtype.kind == "f" else values.dtype.str
    table = np.ascontiguousarray(values if rows is None else values[rows], kind)
    # glTF requires that each row of small integers begins at a multiple of four bytes.
    return np.pad(table, ((0, 0), (0, 1))) if table.dtype.kind == "i" else table


@finds_record(".glb")
def find_record_in_glb(path: Path) -> str | None:
    """Find the record in the extras of the asset."""
    with path.open("rb") as stream:
        head = stream.read(20)
        length = min(int.from_bytes(head[12:16], "little"), path.stat().st_size)
        text = stream.read(length) if head[:4] == b"glTF" else b"{}"
    return json.dumps(json.loads(text)["asset"]["extras"][NAME])
