"""Read glTF: surfaces with materials, as a text with further files or as one binary file."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import damaged_error, reads, truncated_error

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    from spacemap_vtk.io.texture_atlas import MaterialSet, TexturedMesh


def _external_parts(path: Path) -> list[dict[str, Any]]:
    """Return the descriptions of parts that are stored in other files."""
    content = path.read_bytes()
    if path.suffix.lower() == ".glb":
        if content[:4] != b"glTF":
            raise InputError(f'{path}: not a binary glTF file: it does not begin with "glTF"')
        if len(content) < 20 or len(content) < int.from_bytes(content[8:12], "little"):
            raise truncated_error(path)
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    try:
        described: dict[str, Any] = json.loads(content)
        named = [*described.get("buffers", []), *described.get("images", [])]
        return [part for part in named if not str(part.get("uri", "data:")).startswith("data:")]
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise damaged_error(path, f"not glTF, or truncated: {error}") from None


def _external_names(path: Path) -> list[str]:
    return [unquote(str(part["uri"])) for part in _external_parts(path)]


def _byte_length(value: Any) -> float:
    return value if isinstance(value, int) else math.inf


def _check(path: Path) -> None:
    """Refuse a file if it, or another file that it names, is not whole."""
    for part, name in zip(_external_parts(path), _external_names(path), strict=True):
        file = path.parent / name
        if not os.path.isfile(file):
            raise InputError(f"{path} refers to {part['uri']}, which does not exist", key="file")
        if "byteLength" not in part:
            from spacemap_vtk.io.texture_atlas import read_picture

            read_picture(file)
        elif file.stat().st_size < _byte_length(part["byteLength"]):
            raise truncated_error(file)


@reads(".gltf", ".glb", label="glTF", holds="mesh", check=_check, names=_external_names)
def read_gltf(path: Path) -> TexturedMesh:
    """Read a file; its materials are read when they are requested."""
    from spacemap_vtk.io.reading import leaf_blocks, vtk_reader
    from spacemap_vtk.io.texture_atlas import TexturedMesh

    reader = vtk_reader(path, "vtkIOGeometry", "vtkGLTFReader")
    data = reader.GetOutputDataObject(0)

    def materials() -> tuple[list[vtkPolyData], MaterialSet]:
        blocks: Any = [block for block in leaf_blocks(data) if block.GetNumberOfPoints()]
        return blocks, _read_materials(blocks, reader)

    return TexturedMesh(data, materials)


def _read_materials(blocks: list[vtkPolyData], reader: Any) -> MaterialSet:
    """Return the materials of a file's blocks."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.io.texture_atlas import Material, MaterialSet, pixels_of

    # glTF counts v downwards, VTK upwards.
    pictures = [
        pixels_of(reader.GetTexture(i).GetVTKTexture().GetInput())[::-1]
        for i in range(reader.GetNumberOfTextures() if hasattr(reader, "GetTexture") else 0)
    ]
    materials = []
    for block in blocks:
        made, data = Material(), block.GetFieldData()
        color = data.GetArray("BaseColorMultiplier")
        if color is not None:
            red, green, blue = (float(x) for x in vtk_to_numpy(color).ravel()[:3])
            made.color = red, green, blue
        index = data.GetArray("BaseColorTextureIndex")
        if index is not None and 0 <= int(index.GetComponent(0, 0)) < len(pictures):
            made.picture = pictures[int(index.GetComponent(0, 0))]
            where = data.GetArray("BaseColorTexCoordIndex")
            number = 0 if where is None else int(where.GetComponent(0, 0))
            made.coordinates = f"TEXCOORD_{number}"
        _color_points(block, made.color)
        materials.append(made)
    return MaterialSet(materials)


def _color_points(block: vtkPolyData, factor: tuple[float, float, float]) -> None:
    """Convert glTF's point colours to bytes, which VTK draws without a colour map."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    from spacemap_vtk.datasets.arrays import add_array

    array = block.GetPointData().GetArray("COLOR_0")
    if array is None:
        return
    values = vtk_to_numpy(array)
    largest = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
    share = np.clip(values / largest, 0.0, 1.0)
    share[:, :3] *= np.clip(factor, 0.0, 1.0)
    add_array(block.GetPointData(), "COLOR_0", np.round(255 * share).astype(np.uint8))
