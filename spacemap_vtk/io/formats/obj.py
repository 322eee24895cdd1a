"""Read and write Wavefront OBJ: polygons, with materials in a second file."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io import file_references
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import find_record_in_comments, finds_record, record_comments
from spacemap_vtk.io.registry import reads, writes

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    from spacemap_vtk.datasets.moving_surface import MovingSurface, SurfaceMaterial
    from spacemap_vtk.io.texture_atlas import Material, MaterialSet, TexturedMesh

#: Rows whose text is made at once.
_BLOCK_ROWS = 2**14


def _referenced_names(path: Path) -> list[str]:
    """Return the material libraries of a file, and the pictures that these name."""
    from spacemap_vtk.parameters import require_local_file

    found = file_references.pattern_names(rb"(?:\A|[\r\n])mtllib([^\r\n]*)")(path)
    for library in list(found):
        require_local_file(library, path)
        file = path.parent / library
        if os.path.isfile(file):
            maps = (line for line in _library_lines(file) if line[:1] == ["map_Kd"] and line[1:])
            found += [str(Path(library).parent / _picture_name(line[1:])) for line in maps]
    return found


def _library_lines(library: Path) -> list[list[str]]:
    text = library.read_text(encoding="utf-8", errors="replace")
    return [line.split() for line in text.splitlines()]


@reads(".obj", label="Wavefront OBJ", holds="mesh", names=_referenced_names)
def read_obj(path: Path) -> TexturedMesh:
    """Read a file; its materials are read when they are requested."""
    from spacemap_vtk.io.reading import read_with_vtk
    from spacemap_vtk.io.texture_atlas import TexturedMesh

    data = read_with_vtk(path, "vtkIOGeometry", "vtkOBJReader")
    return TexturedMesh(data, lambda: _read_materials(data, path))


def _read_materials(data: vtkPolyData, path: Path) -> tuple[list[vtkPolyData], MaterialSet]:
    """Return a file's mesh, cut into one block per material, and the materials."""
    import numpy as np

    from spacemap_vtk.io.polygons import extract_polygons
    from spacemap_vtk.io.texture_atlas import Material, MaterialSet

    libraries, faces = _used_materials(path)
    paint = MaterialSet([])
    known: dict[str, Material] = {}
    for library in libraries:
        known |= _read_library(path.parent / library, paint)
    names = list(dict.fromkeys(faces))
    mismatch = len(faces) != data.GetNumberOfPolys() or data.GetNumberOfLines()
    if not known or mismatch or not faces:
        return [data], MaterialSet([Material()], paint.notes)
    order = {name: i for i, name in enumerate(names)}
    of_face = np.array([order[name] for name in faces])
    blocks = (
        [data]
        if len(names) == 1
        else [extract_polygons(data, of_face == i) for i in range(len(names))]
    )
    for name, block in zip(names, blocks, strict=True):
        made, table = known.get(name, Material()), block.GetPointData()
        # VTK names the texture coordinates after the material.
        found = table.GetArray(name) or table.GetTCoords()
        made.coordinates = found.GetName() if found is not None else ""
        paint.materials.append(made)
    return blocks, paint


def _used_materials(path: Path) -> tuple[list[str], list[str]]:
    """Return the material libraries that a file names, and the material of each face."""
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


def _picture_name(words: list[str]) -> str:
    # Options such as "-s 1 1 1" come before the name.
    name = " ".join(words) if not words[0].startswith("-") else words[-1]
    return name.replace("\\", "/")


def _read_library(path: Path, paint: MaterialSet) -> dict[str, Material]:
    from spacemap_vtk.io.texture_atlas import Material, read_picture

    if not os.path.isfile(path):
        paint.notes.append(f"{path} does not exist: the object is drawn without materials")
        return {}
    found: dict[str, Material] = {}
    pictures: dict[Path, Any] = {}
    made = Material()
    for words in _library_lines(path):
        if words[:1] == ["newmtl"]:
            made = found[" ".join(words[1:])] = Material()
        elif words[:1] == ["Kd"] and len(words) >= 4:
            red = green = blue = math.nan
            with suppress(ValueError):
                red, green, blue = map(float, words[1:4])
            if math.isfinite(red + green + blue):
                made.color = red, green, blue
            else:
                paint.notes.append(f'{path}: "{" ".join(words)}" is not a colour')
        elif words[:1] == ["map_Kd"] and len(words) > 1:
            file = path.parent / _picture_name(words[1:])
            try:
                if file not in pictures:
                    pictures[file] = read_picture(file)
                made.picture = pictures[file]
            except InputError as error:
                paint.notes.append(f"{error}: the object is drawn without it")
    for material in found.values():
        # Many programs write a black or grey Kd with a picture, and mean the picture only.
        if material.picture is not None:
            material.color = (1.0, 1.0, 1.0)
    return found


@writes(".obj", label="Wavefront OBJ", holds=("painted",))
def write_obj(file: Path, surface: MovingSurface) -> None:
    """Write triangles, in a group for each part, and a second file with the materials."""
    library, lines = file.with_suffix(".mtl"), []
    for shade in surface.materials:
        color = surface.colors[shade.points][0] / 255.0
        shares = [1.0, 1.0, 1.0] if surface.has_point_colors else color.tolist()
        lines += [
            f"newmtl {_material_name(shade)}",
            "Kd " + " ".join(f"{x:.6g}" for x in shares),
            "",
        ]
    write_parts(library, ["\n".join(lines).encode()])
    write_parts(file, (f"{text}\n".encode() for text in _obj_lines(surface, library.name)))


def _obj_lines(surface: MovingSurface, library: str) -> Iterator[str]:
    """Yield lines, many at once; all at once would need ten times the memory of the surface."""
    import numpy as np

    from spacemap_vtk.parallel import blocks

    yield "\n".join(["# by spacemap_vtk; lengths in m", *record_comments("#"), f"mtllib {library}"])
    if "colors" in surface.metadata:
        yield f"# colours: {surface.metadata['colors']}"
    points = len(surface.points)
    for part in blocks(points, _BLOCK_ROWS):
        rows = surface.points[part]
        if surface.has_point_colors:  # in the form that MeshLab and Blender read
            rows = np.hstack([rows, surface.colors[part] / 255.0])
        yield "\n".join("v " + " ".join(f"{x:.9g}" for x in row) for row in rows.tolist())
    corner = "{0}"
    if surface.normals is not None:
        corner = "{0}//{0}"
        for part in blocks(points, _BLOCK_ROWS):
            rows = surface.normals[part]
            yield "\n".join(f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in rows.tolist())
    for shade in surface.materials:
        yield f"g {shade.name.partition(' #')[0]}\nusemtl {_material_name(shade)}"
        faces = surface.triangles[shade.points[surface.triangles[:, 0]]]
        for part in blocks(len(faces), _BLOCK_ROWS):
            rows = (faces[part] + 1).tolist()
            yield "\n".join("f " + " ".join(corner.format(at) for at in row) for row in rows)


def _material_name(shade: SurfaceMaterial) -> str:
    return shade.name.replace(" ", "_").replace("#", "")  # a "#" begins a comment


finds_record(".obj")(find_record_in_comments)
