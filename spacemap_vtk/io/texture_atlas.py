"""Combine the pictures and colours of an object's materials into one picture.

A mesh is drawn with one texture. If a file has several materials, their pictures are stacked into
one, with a tile of plain colour for a material without a picture, and the texture coordinates are
changed accordingly.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData

from spacemap_vtk.datasets.arrays import add_array, color_array_name, to_array, to_image
from spacemap_vtk.datasets.vtk_messages import raise_vtk_errors
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.pictures import decode_picture
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Bytes

Pixels = Bytes  # (height, width, 3 or 4), bottom row first

#: Name of the texture coordinates that belong to the combined picture.
COORDINATES = "texture coordinates"
#: Rows and columns around a tile that repeat its edge; without them, colours of the neighbouring
#: tile would show at the edge.
_GUTTER = 4
#: Most repetitions of a picture in each direction.
_MOST_REPEATS = 16
#: Most pixels along a side of a picture.
_LARGEST = 8192


@dataclass
class Material:
    """Picture and colour of a block of a mesh."""

    #: Pixels, shape (height, width, 3 or 4), bottom row first.
    picture: Pixels | None = None
    #: Colour that multiplies the picture, from 0 to 1.
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    #: Name of the block's texture coordinates.
    coordinates: str = ""


@dataclass
class MaterialSet:
    """Materials of the blocks, and messages about pictures that were not found."""

    #: One material for each block.
    materials: list[Material]
    #: Messages about pictures that are missing or cannot be read.
    notes: list[str] = field(default_factory=list)


class TexturedMesh(NamedTuple):
    """A mesh as read from a file that names materials."""

    data: Any
    """Any data object of VTK's."""
    materials: Callable[[], tuple[list[vtkPolyData], MaterialSet]]
    """Reads them; returns the mesh cut into blocks, each of one material."""


def read_picture(path: Path) -> Pixels:
    """Read a picture file as pixels, bottom row first."""
    if not os.path.isfile(path):
        raise InputError(f"{path}: no such file", key="texture")
    if find_spec("PIL") is None:  # in ParaView's Python
        return _read_with_vtk(path)
    try:
        image = decode_picture(path.read_bytes(), _check_size)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}", key="texture") from None
    except InputError as error:
        error.key, error.message = "texture", f"{path}: {error.message}"
        raise
    kind = "RGBA" if "A" in image.getbands() or "transparency" in image.info else "RGB"
    return np.asarray(image.convert(kind))[::-1]


def _check_size(width: int, height: int) -> None:
    # Four bytes a pixel, twice: for the decoder and for the result.
    require_memory(
        8 * width * height, f"a picture of {width} x {height} pixels", cure="Reduce its size."
    )


def _read_with_vtk(path: Path) -> Pixels:
    from vtkmodules.vtkIOImage import vtkImageReader2Factory

    # VTK's reader crashes on a truncated PNG, so it is used only where Pillow is missing.
    with raise_vtk_errors(path):
        reader = vtkImageReader2Factory.CreateImageReader2(str(path))
        if reader is None:
            raise InputError(
                f"{path}: not a picture that VTK can read", allowed=".png, .jpg, .bmp, .tif"
            )
        reader.SetFileName(str(path))
        reader.Update()
    return pixels_of(reader.GetOutput())


def pixels_of(image: vtkImageData) -> Pixels:
    """Return the pixels of a VTK image as bytes, with at least three channels."""
    width, height, _ = image.GetDimensions()
    values = vtk_to_numpy(image.GetPointData().GetScalars())
    if values.dtype == np.uint16:
        values = (values >> 8).astype(np.uint8)
    values = values.astype(np.uint8).reshape(height, width, -1)
    grey, count = values[:, :, :1], values.shape[2]
    if count < 3:
        values = np.concatenate((np.repeat(grey, 3, axis=2), values[:, :, 1:]), axis=2)
    return np.ascontiguousarray(values)


def apply_materials(blocks: list[vtkPolyData], materials: list[Material]) -> vtkImageData | None:
    """Give blocks texture coordinates in one combined picture, or else plain colours."""
    painted = [
        m.picture is not None and block.GetPointData().HasArray(m.coordinates)
        for block, m in zip(blocks, materials, strict=True)
    ]
    if not any(painted):
        # Colours of single points are more detailed than a material's colour, so they are kept.
        if any(m.color != (1.0, 1.0, 1.0) for m in materials) and not any(
            color_array_name(block.GetPointData()) for block in blocks
        ):
            for block, material in zip(blocks, materials, strict=True):
                colors = np.tile(_color_bytes(material.color), (block.GetNumberOfCells(), 1))
                add_array(block.GetCellData(), "color", colors)
        return None
    if len(blocks) == 1:
        blocks[0].GetPointData().SetActiveTCoords(materials[0].coordinates)
        return to_image(_tint(materials[0]))
    tiles: dict[tuple[int, tuple[float, ...], int, int], Pixels] = {}
    used, places = [], []
    for block, material, is_painted in zip(blocks, materials, painted, strict=True):
        if is_painted:
            given = vtk_to_numpy(block.GetPointData().GetArray(material.coordinates))
            at = given.astype(np.float64)
            first = np.floor(at.min(axis=0))
            at -= first
            repeats = [int(np.clip(ceil(high), 1, _MOST_REPEATS)) for high in at.max(axis=0)]
            at /= repeats
        else:
            at, repeats = np.full((block.GetNumberOfPoints(), 2), 0.5), [1, 1]
        key = (id(material.picture) if is_painted else 0, material.color, repeats[0], repeats[1])
        if key not in tiles:
            tile = (
                _tint(material) if is_painted else np.full((8, 8, 3), _color_bytes(material.color))
            )
            tiles[key] = _repeat_tile(tile, repeats)
        used.append(key)
        places.append(at)
    atlas, boxes = _stack_tiles(list(tiles.values()))
    for block, key, at in zip(blocks, used, places, strict=True):
        low, size = boxes[list(tiles).index(key)]
        at = low + np.clip(at, 0.0, 1.0) * size
        data = block.GetPointData()
        for other in materials:
            data.RemoveArray(other.coordinates)  # they belong to the separate pictures
        data.SetTCoords(to_array(at.astype(np.float32), COORDINATES))
    return to_image(atlas)


def _color_bytes(color: tuple[float, ...]) -> Bytes:
    return np.round(255 * np.clip(color, 0.0, 1.0)).astype(np.uint8)


def _tint(material: Material) -> Pixels:
    picture: Any = material.picture
    if material.color == (1.0, 1.0, 1.0):
        return picture
    result = picture.copy()
    result[:, :, :3] = np.round(picture[:, :, :3] * np.clip(material.color, 0.0, 1.0))
    return result


def _repeat_tile(tile: Pixels, repeats: list[int]) -> Pixels:
    across, up = repeats
    # If the repeated picture would get too large, some of its rows and columns are left out.
    thin = ceil(max(tile.shape[1] * across, tile.shape[0] * up) / _LARGEST)
    return np.tile(tile[::thin, ::thin], (up, across, 1))


def _stack_tiles(tiles: list[Pixels]) -> tuple[Pixels, list[tuple[NDArray[Any], NDArray[Any]]]]:
    """Stack tiles into one picture; return it, and each tile's lowest corner and size (0 to 1)."""
    thin = ceil(sum(t.shape[0] + 2 * _GUTTER for t in tiles) / (2 * _LARGEST))
    tiles = [tile[::thin, ::thin] for tile in tiles]
    parts = 4 if any(tile.shape[2] == 4 for tile in tiles) else 3
    width = max(tile.shape[1] for tile in tiles) + 2 * _GUTTER
    height = sum(tile.shape[0] + 2 * _GUTTER for tile in tiles)
    atlas = np.full((height, width, parts), 255, dtype=np.uint8)
    boxes, row = [], 0
    for tile in tiles:
        frame = np.pad(tile, ((_GUTTER, _GUTTER), (_GUTTER, _GUTTER), (0, 0)), mode="edge")
        atlas[row : row + frame.shape[0], : frame.shape[1], : tile.shape[2]] = frame
        low = np.array([_GUTTER / width, (row + _GUTTER) / height])
        boxes.append((low, np.array([tile.shape[1] / width, tile.shape[0] / height])))
        row += frame.shape[0]
    return atlas, boxes
