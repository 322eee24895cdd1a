"""Time series of meshes, in one file or in several."""

from __future__ import annotations

import fnmatch
import os
import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPointSet
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from spacemap_vtk.datasets.arrays import shallow_copy
from spacemap_vtk.datasets.vtk_messages import raise_vtk_errors
from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.io.crash_check import check_in_child
from spacemap_vtk.io.reading import merge_blocks, read_blocks


class MeshSeries(ABC):
    """Meshes at ascending times."""

    def __init__(self, file: Path, times: list[float]) -> None:
        if not times:
            raise InputError(f"{file}: the file has no time steps", key="file")
        for before, after in pairwise(times):
            if not before < after:
                raise InputError(
                    f"{file}: the times of the steps must ascend: {before:g} s, {after:g} s",
                    key="file",
                )
        self.file = file
        #: All files that the series is read from.
        self.files = [file]
        self.times = times

    @abstractmethod
    def read(self, step: int) -> vtkPointSet:
        """Return the mesh of a step."""


class FileSeries(MeshSeries):
    """A series with one file, or several, for each step."""

    def __init__(self, file: Path, steps: list[tuple[float, list[Path]]]) -> None:
        steps = sorted(steps)
        super().__init__(file, [time for time, _ in steps])
        self._paths = [paths for _, paths in steps]
        for path in (path for paths in self._paths for path in paths):
            if not os.path.isfile(path):  # also False if no file can have this name
                raise InputError(f"{file} refers to {path}, which does not exist", key="file")
            self.files.append(path)

    def read(self, step: int) -> vtkPointSet:
        paths = self._paths[step]
        if len(paths) == 1:
            return merge_blocks(read_blocks(paths[0]), paths[0])
        blocks = vtkMultiBlockDataSet()
        for number, path in enumerate(paths):
            blocks.SetBlock(number, read_blocks(path))
        return merge_blocks(blocks, paths[0])


class ReaderSeries(MeshSeries):
    """A series in a single file that one of VTK's readers reads."""

    def __init__(self, file: Path, reader: Any, prepare: Callable[[], None] | None = None) -> None:
        self._reader = reader
        check_in_child(file, f"{__name__}:open_series")
        with raise_vtk_errors(file):
            reader.SetFileName(str(file))
            if not reader.CanReadFile(str(file)):
                raise InputError(f"{file}: damaged, or of another format", key="file")
            reader.UpdateInformation()
            if prepare is not None:
                prepare()
                reader.UpdateInformation()
        info = reader.GetOutputInformation(0)
        key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        super().__init__(file, list(info.Get(key)) if info.Has(key) else [0.0])

    def read(self, step: int) -> vtkPointSet:
        check_in_child(self.file, f"{__name__}:read_step", step)
        with raise_vtk_errors(self.file):
            self._reader.UpdateTimeStep(self.times[step])
        return merge_blocks(shallow_copy(self._reader.GetOutputDataObject(0)), self.file)


def describe_motion_files() -> str:
    """Describe in words what a motion can be read from."""
    formats = registry.describe_readers("motion")
    return f"{formats}, a mesh such as a .vtu, or several meshes by a pattern such as step_*.vtu"


def open_series(file: Path) -> MeshSeries:
    """Open a time series: a file, or several by a pattern such as step_*.vtu."""
    if is_pattern(file):
        return _open_pattern(file)
    registry.require_file(file, describe_motion_files())
    reader = registry.reader(file, "motion")
    return FileSeries(file, [(0.0, [file])]) if reader is None else reader.read(file)


def read_step(file: Path, step: int) -> vtkPointSet:
    """Read the mesh of one step of a time series."""
    return open_series(file).read(step)


def is_pattern(file: Path) -> bool:
    """Return whether a name is a pattern for other names, and not itself the name of a file."""
    return any(sign in file.name for sign in "*?[") and not os.path.isfile(file)


def matching_files(file: Path) -> list[Path]:
    """Return the files of a folder whose names match a pattern."""
    try:  # not with glob: its ** would search all folders below
        return [file.parent / name for name in fnmatch.filter(os.listdir(file.parent), file.name)]
    except (OSError, ValueError):  # ValueError: the name has a null character
        return []


def _open_pattern(file: Path) -> MeshSeries:
    paths = sorted(matching_files(file), key=lambda p: _number_sort_key(p.name))
    if not paths:
        raise InputError(f"{file}: no file matches this pattern", key="file")
    steps = []
    for number, path in enumerate(paths):
        # ParaView writes TimeValue into each file. Without it, the steps are counted.
        field = read_blocks(path).GetFieldData()
        array = field.GetArray("TimeValue") if field else None
        time = float(vtk_to_numpy(array)[0]) if array is not None else float(number)
        steps.append((time, [path]))
    return FileSeries(file, steps)


def _number_sort_key(name: str) -> list[Any]:
    """Return a sort key that puts step_9 before step_10."""
    return [(0, int(p), "") if p.isdigit() else (1, 0, p) for p in re.split(r"(\d+)", name) if p]
