"""The materials that a Wavefront OBJ or a glTF file names, block by block."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import add_array, points_of, take_arrays, to_points, to_ragged
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.texture_atlas import Material, Paint, pixels_of, read_picture


def of_gltf(blocks: list[vtkPolyData], reader: Any) -> Paint:
    """Return the materials of a glTF file's blocks."""
    # glTF counts v downwards, VTK upwards
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
    return Paint(materials)


def _color_points(block: vtkPolyData, factor: tuple[float, float, float]) -> None:
    """Turn glTF's colours of points into bytes, which are drawn as they are."""
    array = block.GetPointData().GetArray("COLOR_0")
    if array is None:
        return
    values = vtk_to_numpy(array)
    largest = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
    share = np.clip(values / largest, 0.0, 1.0)
    share[:, :3] *= np.clip(factor, 0.0, 1.0)
    add_array(block.GetPointData(), "COLOR_0", np.round(255 * share).astype(np.uint8))


def of_obj(data: vtkPolyData, path: Path) -> tuple[list[vtkPolyData], Paint]:
    """Return an OBJ file's mesh cut by its materials, and these."""
    libraries, faces = _used(path)
    paint = Paint([])
    known: dict[str, Material] = {}
    for library in libraries:
        known |= _library(path.parent / library, paint)
    names = list(dict.fromkeys(faces))
    whole = len(faces) != data.GetNumberOfPolys() or data.GetNumberOfLines()
    if not known or whole or not faces:
        return [data], Paint([Material()], paint.notes)
    order = {name: i for i, name in enumerate(names)}
    of_face = np.array([order[name] for name in faces])
    blocks = [data] if len(names) == 1 else [_part(data, of_face == i) for i in range(len(names))]
    for name, block in zip(names, blocks, strict=True):
        made, table = known.get(name, Material()), block.GetPointData()
        # VTK calls the coordinates by the material
        found = table.GetArray(name) or table.GetTCoords()
        made.coordinates = found.GetName() if found is not None else ""
        paint.materials.append(made)
    return blocks, paint


def _used(path: Path) -> tuple[list[str], list[str]]:
    """Return the libraries that a file names, and the material of each face."""
    libraries, faces, current = [], [], ""
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            if line.startswith("f "):
                faces.append(current)
            elif line.startswith("usemtl"):
                current = line[6:].strip()
            elif line.startswith("mtllib"):
                libraries.append(line[6:].strip())
    return libraries, faces


def _library(path: Path, paint: Paint) -> dict[str, Material]:
    if not path.is_file():
        paint.notes.append(f"{path}, which has the materials, is not there: drawn without")
        return {}
    found: dict[str, Material] = {}
    pictures: dict[Path, Any] = {}
    made = Material()
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split()
        if words[:1] == ["newmtl"]:
            made = found[" ".join(words[1:])] = Material()
        elif words[:1] == ["Kd"] and len(words) >= 4:
            try:
                made.color = float(words[1]), float(words[2]), float(words[3])
            except ValueError:
                paint.notes.append(f'{path}: "{line.strip()}" is no colour')
        elif words[:1] == ["map_Kd"] and len(words) > 1:
            # options such as "-s 1 1 1" stand before the name
            name = " ".join(words[1:]) if not words[1].startswith("-") else words[-1]
            file = path.parent / name.replace("\\", "/")
            try:
                if file not in pictures:
                    pictures[file] = read_picture(file)
                made.picture = pictures[file]
            except InputError as error:
                paint.notes.append(f"{error}: drawn without")
    for material in found.values():
        # many programs write a black or grey Kd beside a picture, and mean the picture
        if material.picture is not None:
            material.color = (1.0, 1.0, 1.0)
    return found


def _part(data: vtkPolyData, chosen: NDArray[np.bool_]) -> vtkPolyData:
    """Return some faces of a mesh, with their points alone."""
    polys = data.GetPolys()
    starts = vtk_to_numpy(polys.GetOffsetsArray()).astype(np.int64)
    numbers = vtk_to_numpy(polys.GetConnectivityArray()).astype(np.int64)
    sizes = np.diff(starts)
    used, local = np.unique(numbers[np.repeat(chosen, sizes)], return_inverse=True)
    offsets = np.concatenate(([0], np.cumsum(sizes[chosen])))
    result = vtkPolyData()
    result.SetPoints(to_points(points_of(data)[used]))
    result.SetPolys(to_ragged(offsets, local.ravel()))
    for source, target, rows in (
        (data.GetPointData(), result.GetPointData(), used),
        (data.GetCellData(), result.GetCellData(), np.flatnonzero(chosen)),
    ):
        take_arrays(source, target, rows)
    return result
