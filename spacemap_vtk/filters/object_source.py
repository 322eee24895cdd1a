"""ObjectSource: read any mesh from a file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from vtkmodules.vtkCommonCore import vtkInformationVector
from vtkmodules.vtkCommonDataModel import (
    vtkDataObject,
    vtkImageData,
    vtkPointSet,
    vtkPolyData,
    vtkUnstructuredGrid,
)

from spacemap_vtk.datasets.arrays import add_array, points_of
from spacemap_vtk.datasets.extent import UP, guess_up_axis, store_bounds
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.algorithm import Inputs
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.io.reading import ReadObject, read_blocks, read_object
from spacemap_vtk.parameters import Choice, FilePath, Real, Vector

#: The files that were read, with time of change and size.
_FileStates = tuple[tuple[Path, int, int], ...]


class ObjectSource(Stage):
    """Read an object (surface, volume, lines or points) in any format that pyvista reads.

    Arrays, texture coordinates and colours are kept. Colours and pictures of the materials of .obj
    and .gltf files are kept, too, all pictures in one (`picture`). Blocks are merged, with a cell
    array ``block``. The object is scaled about the origin, then rotated about x, y and z in this
    order, then moved.

    Notes
    -----
    The output is vtkPolyData if the file contains nothing else, and vtkUnstructuredGrid otherwise.
    pyvista is imported for formats that VTK's own readers do not cover.

    Examples
    --------
    >>> from spacemap_vtk.filters.object_source import ObjectSource
    >>> ObjectSource(file="model.ply", scale=0.001, rotate=(90, 0, 0)).rotate
    (90.0, 0.0, 0.0)
    """

    section = "object"
    role = "source"
    output_type = "vtkPointSet"
    provides: ClassVar = {UP: ProvidedArray("field")}

    file = FilePath(None, "Mesh file to read.", automatic="no file")
    texture = FilePath(
        None,
        "Picture to map onto the object by its texture coordinates.",
        automatic="the pictures of an .obj or .gltf file",
    )
    scale = Real(
        1.0, "Factor on all lengths, for example 0.001 for a file in millimetres.", above=0.0
    )
    rotate = Vector(
        (0.0, 0.0, 0.0),
        "Angles of rotation about x, y and z.",
        component=Real(0.0, "", unit="deg"),
    )
    place = Vector(
        (0.0, 0.0, 0.0),
        "Position of the file's origin in the scene.",
        component=Real(0.0, "", unit="m"),
    )

    up = Choice(
        None,
        "Axis of the object that points up. Automatic supports, gravity and camera follow it.",
        ["y", "z"],
        automatic="the axis along which the object is broader at the foot than at the top, else "
        "the longer one",
    )

    _loaded: tuple[_FileStates, ReadObject] | None = None
    _loaded_type: tuple[_FileStates, str] | None = None
    _loaded_piece: tuple[tuple[Any, ...], vtkPointSet] | None = None

    def load(self) -> vtkPointSet:
        """Read the file; it is read again only if it changes.

        Returns
        -------
        vtkPointSet
            The object as it is in the file.

        Raises
        ------
        InputError
            If there is no file, or it cannot be read or has no finite points.
        """
        if self.file is None:
            raise InputError("no file is given", key="file", allowed=type(self).file.allowed)
        if not os.path.isfile(self.file):
            self._loaded = None
            with add_key_to_errors("file"):
                read_blocks(self.file)  # raises the appropriate error
        key = self._file_states()
        if self._loaded is None or self._loaded[0] != key:
            with add_key_to_errors("file"):
                self._loaded = key, read_object(self.file, self.texture)
            self._loaded_type = key, self._loaded[1].data.GetClassName()
        return self._loaded[1].data

    def check(self) -> None:
        """Check that the file can be read."""
        self.load()

    @property
    def picture(self) -> vtkImageData | None:
        """Picture for the object's texture coordinates; None if there is none."""
        self.load()
        return self._loaded[1].picture if self._loaded else None

    def _file_states(self) -> _FileStates:
        files = [
            file for file in (self.file, self.texture) if file is not None and os.path.isfile(file)
        ]
        states = [(file, file.stat()) for file in files]
        return tuple((file, state.st_mtime_ns, state.st_size) for file, state in states)

    def run(self, inputs: list[Any], output: vtkPointSet, time: float) -> None:
        """Scale, rotate and move the object."""
        piece = self.piece
        if piece.total > 1:
            self._run_piece(output, piece)
            return
        self._place(self.load(), output)
        for note in self._loaded[1].notes if self._loaded else []:
            self.warn(note)

    def _run_piece(self, output: vtkPointSet, piece: Piece) -> None:
        """Keep only the requested piece of the object and release the rest."""
        key = (*self.settings.values(), self._file_states(), piece)
        if self._loaded_piece is None or self._loaded_piece[0] != key:
            whole = self.load().NewInstance()
            self._place(self.load(), whole)
            part = _extract_piece(whole, piece)
            store_bounds(part, whole.GetBounds())
            part.GetFieldData().AddArray(whole.GetFieldData().GetArray(UP))
            for note in self._loaded[1].notes if self._loaded else []:
                self.warn(note)
            self._loaded = None
            self._loaded_piece = key, part
        output.ShallowCopy(self._loaded_piece[1])

    def _place(self, data: vtkPointSet, output: vtkPointSet) -> None:
        self._move(data, output)
        axis = guess_up_axis(points_of(output)) if self.up is None else "xyz".index(self.up)
        self.values_in_use = {"up": "xyz"[axis]}
        add_array(output.GetFieldData(), UP, np.eye(3)[axis])

    def _move(self, data: vtkPointSet, output: vtkPointSet) -> None:
        if (self.scale, self.rotate, self.place) == (1.0, (0.0,) * 3, (0.0,) * 3):
            output.ShallowCopy(data)
            return
        # Imported here, because only objects that are moved need it.
        from vtkmodules.vtkCommonTransforms import vtkTransform
        from vtkmodules.vtkFiltersGeneral import vtkTransformFilter

        transform = vtkTransform()
        transform.PostMultiply()
        transform.Scale(self.scale, self.scale, self.scale)
        transform.RotateX(self.rotate[0])
        transform.RotateY(self.rotate[1])
        transform.RotateZ(self.rotate[2])
        transform.Translate(self.place)
        mover = vtkTransformFilter()  # normals and vectors are rotated, too
        mover.SetTransform(transform)
        mover.SetInputData(data)
        mover.Update()
        output.ShallowCopy(mover.GetOutput())

    def _request_data_object(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        kind = "vtkPolyData"
        try:
            if (
                self.file is None
                or self._loaded_type is None
                or self._loaded_type[0] != self._file_states()
            ):
                self.load()
            if self._loaded_type is not None:
                kind = self._loaded_type[1]
        except Exception:  # `run` raises the same error again, where it can be reported
            pass
        info = out_info.GetInformationObject(0)
        made = info.Get(vtkDataObject.DATA_OBJECT())
        if made is None or made.GetClassName() != kind:
            new = vtkPolyData() if kind == "vtkPolyData" else vtkUnstructuredGrid()
            info.Set(vtkDataObject.DATA_OBJECT(), new)


def _extract_piece(whole: vtkPointSet, piece: Piece) -> vtkPointSet:
    """Return a piece of a mesh. A mesh without cells is not divided; piece 0 gets all of it."""
    if whole.GetNumberOfCells() == 0:
        return whole if piece.number == 0 else whole.NewInstance()
    from vtkmodules.vtkFiltersParallel import (
        vtkExtractPolyDataPiece,
        vtkExtractUnstructuredGridPiece,
    )

    is_surface = isinstance(whole, vtkPolyData)
    cutter = vtkExtractPolyDataPiece() if is_surface else vtkExtractUnstructuredGridPiece()
    cutter.SetInputData(whole)
    cutter.UpdatePiece(*piece)
    return cutter.GetOutput()
