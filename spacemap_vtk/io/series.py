"""Time series of meshes, whatever the files."""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPointSet
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from spacemap_vtk.datasets.quiet import quiet_vtk
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.reading import merged, read_blocks
from spacemap_vtk.io.truncation import CHECKS

#: What a motion can be read from, in words.
KINDS = (
    "a .pvd, .vtkhdf, Exodus (.e, .ex2, .exo) or .series file, one .vtu or .vtk file, or several "
    "by a pattern such as step_*.vtu"
)


class MeshSeries(ABC):
    """Meshes at ascending times."""

    def __init__(self, file: Path, times: list[float]) -> None:
        if not times:
            raise InputError(f"{file}: there are no time steps in it", key="file")
        for before, after in pairwise(times):
            if not before < after:
                raise InputError(
                    f"{file}: the times of the steps do not ascend: {before:g}, {after:g}",
                    key="file",
                )
        self.file = file
        self.times = times

    @abstractmethod
    def read(self, step: int) -> vtkPointSet:
        """Return the mesh of a step."""


class _Files(MeshSeries):
    """A file, or several, for each step."""

    def __init__(self, file: Path, steps: list[tuple[float, list[Path]]]) -> None:
        steps = sorted(steps)
        super().__init__(file, [time for time, _ in steps])
        self._paths = [paths for _, paths in steps]
        for path in (path for paths in self._paths for path in paths):
            if not path.is_file():
                raise InputError(f"{file} names {path}, which is not there", key="file")

    def read(self, step: int) -> vtkPointSet:
        paths = self._paths[step]
        if len(paths) == 1:
            return merged(read_blocks(paths[0]), paths[0])
        blocks = vtkMultiBlockDataSet()
        for number, path in enumerate(paths):
            blocks.SetBlock(number, read_blocks(path))
        return merged(blocks, paths[0])


class _Reader(MeshSeries):
    """One file with all steps, and VTK's reader for it."""

    def __init__(self, file: Path, reader: Any) -> None:
        self._reader = reader
        with quiet_vtk(file):
            reader.SetFileName(str(file))
            if not reader.CanReadFile(str(file)):
                raise InputError(f"{file}: damaged or of another format", key="file")
            reader.UpdateInformation()
            if reader.IsA("vtkExodusIIReader"):
                # It would move the points itself, and calls that array by another name.
                reader.SetApplyDisplacements(0)
                for i in range(reader.GetNumberOfPointResultArrays()):
                    reader.SetPointResultArrayStatus(reader.GetPointResultArrayName(i), 1)
                reader.UpdateInformation()
        info = reader.GetOutputInformation(0)
        key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        super().__init__(file, list(info.Get(key)) if info.Has(key) else [0.0])

    def read(self, step: int) -> vtkPointSet:
        with quiet_vtk(self.file):
            self._reader.UpdateTimeStep(self.times[step])
        made = self._reader.GetOutputDataObject(0)
        copy = made.NewInstance()
        copy.ShallowCopy(made)
        return merged(copy, self.file)


def open_series(file: Path) -> MeshSeries:
    """Open a time series."""
    ending = file.suffix.lower()
    if any(sign in file.name for sign in "*?["):
        return _pattern(file)
    if not file.is_file():
        raise InputError(
            f"{file}: {'a folder' if file.is_dir() else 'no such file'}", key="file", allowed=KINDS
        )
    if file.stat().st_size == 0:
        raise InputError(f"{file}: the file is empty", key="file")
    if ending == ".pvd":
        return _collection(file)
    if ending == ".series":
        return _json(file)
    if ending == ".vtkhdf":
        from vtkmodules.vtkIOHDF import vtkHDFReader

        return _Reader(file, vtkHDFReader())
    if ending in CHECKS:
        CHECKS[ending](file)
    if ending in (".e", ".ex2", ".exo", ".exii"):
        from vtkmodules.vtkIOExodus import vtkExodusIIReader

        return _Reader(file, vtkExodusIIReader())
    return _Files(file, [(0.0, [file])])


def _pattern(file: Path) -> MeshSeries:
    paths = sorted(file.parent.glob(file.name), key=lambda p: _numbers(p.name))
    if not paths:
        raise InputError(f"{file}: no file is named like that", key="file")
    steps = []
    for number, path in enumerate(paths):
        # What ParaView writes into each file; without it the steps are counted.
        field = read_blocks(path).GetFieldData()
        array = field.GetArray("TimeValue") if field else None
        time = float(vtk_to_numpy(array)[0]) if array is not None else float(number)
        steps.append((time, [path]))
    return _Files(file, steps)


def _numbers(name: str) -> list[Any]:
    """Return a key that puts step_9 before step_10."""
    return [(0, int(p), "") if p.isdigit() else (1, 0, p) for p in re.split(r"(\d+)", name) if p]


def _collection(file: Path) -> MeshSeries:
    try:
        root = ElementTree.parse(file).getroot()
        steps: dict[float, list[Path]] = {}
        for entry in root.iter("DataSet"):
            time = float(entry.get("timestep", "0"))
            steps.setdefault(time, []).append(file.parent / entry.attrib["file"])
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise InputError(f"{file}: no ParaView collection: {error}", key="file") from None
    return _Files(file, list(steps.items()))


def _json(file: Path) -> MeshSeries:
    try:
        entries = json.loads(file.read_text(encoding="utf-8"))["files"]
        steps = [(float(entry["time"]), [file.parent / entry["name"]]) for entry in entries]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: no file series: {error}", key="file") from None
    return _Files(file, steps)
