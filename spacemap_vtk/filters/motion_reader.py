"""MotionReader: a cage whose motion another program has computed."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, ClassVar

import numpy as np
from vtkmodules.vtkCommonCore import vtkInformation
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkPointSet, vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import (
    add_array,
    array_of,
    points_of,
    tetrahedra_of,
    to_cells,
    to_points,
)
from spacemap_vtk.datasets.geometry_snapshot import ConnectivitySnapshot
from spacemap_vtk.datasets.volume import Volume, split_into_tetrahedra
from spacemap_vtk.errors import GeometryError, InputError, add_key_to_errors
from spacemap_vtk.filters.base import ProvidedArray, Stage, modification_time
from spacemap_vtk.io.series import MeshSeries, describe_motion_files, open_series
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import FilePath, Flag, Real, Text

#: Steps whose displacement is kept. Interpolation needs two; more help when time goes back.
_MAX_STEPS = 8


class MotionReader(Stage):
    """Read a mesh that moves over time, in place of ModalSolver and ModalResponse.

    The mesh is that of the first step; other cells are split into tetrahedra. The motion is linear
    in time between steps, and constant before the first and after the last.

    Notes
    -----
    The file may be a .pvd collection, a series of .vtu or .vtk files (``step_*.vtu``, with times
    from a field ``TimeValue`` or from a ParaView ``.series`` file), a .vtkhdf file, or Exodus.
    ccx2paraview converts CalculiX's results to .pvd, with the array ``U``.

    Examples
    --------
    >>> from spacemap_vtk.filters.motion_reader import MotionReader
    >>> MotionReader(file="results.pvd", array="U", scale=0.001).array
    'U'
    """

    section = "motion"
    role = "mover"
    makes = "cage"
    provides: ClassVar = {"displacement": ProvidedArray("point", "m")}

    file = FilePath(
        None,
        "Time series of a volume mesh: one file, or several, as in step_*.vtu.",
        automatic="no file",
    )
    array = Text(
        "displacement",
        "Name of the point array with the displacement.",
        when={"moving_points": (False,)},
    )
    moving_points = Flag(
        False, "Read the displacement from the coordinates of the points instead of an array."
    )
    scale = Real(1.0, "Factor on all lengths: 0.001 for a result in millimetres.", above=0.0)

    _opened: tuple[Any, MeshSeries] | None = None
    _first: tuple[Any, Volume, ConnectivitySnapshot, Floats] | None = None
    _steps: dict[int, Floats]

    def __init__(self, **values: Any) -> None:
        self._steps = {}
        super().__init__(**values)

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float] | None:
        """Return the times of the first and the last step."""
        if self.file is None:
            return None  # ParaView asks before its user can choose a file; `run` refuses
        times = self._open_series().times
        return times[0], times[-1]

    def time_steps(self, inputs: list[vtkInformation]) -> list[float]:
        """Return the times of all steps."""
        return [] if self.file is None else self._open_series().times

    def run(self, inputs: list[Any], output: vtkUnstructuredGrid, time: float) -> None:
        """Interpolate between the two steps around `time`."""
        series = self._open_series()
        volume = self._read_mesh(series)
        times = series.times
        after = bisect_right(times, time)
        if after == 0 or after == len(times) or times[after - 1] == time:
            displacement = self._step_displacement(series, max(after - 1, 0))
        else:
            share = (time - times[after - 1]) / (times[after] - times[after - 1])
            displacement = (1.0 - share) * self._step_displacement(series, after - 1)
            displacement += share * self._step_displacement(series, after)
        for note in volume.notes:
            self.warn(note)
        # Do not pass on arrays of the first step: at any other time they would be stale.
        output.SetPoints(volume.grid.GetPoints())
        output.SetCells(VTK_TETRA, volume.grid.GetCells())
        add_array(output.GetPointData(), "displacement", displacement)

    def _open_series(self) -> MeshSeries:
        if self.file is None:
            raise InputError("no file is given", key="file", allowed=describe_motion_files())
        state = self.file, modification_time(self.file)
        if self._opened is None or self._opened[0] != state:
            self._first = None
            with add_key_to_errors("file"):
                self._opened = state, open_series(self.file)
        return self._opened[1]

    def _read_mesh(self, series: MeshSeries) -> Volume:
        key = self.array, self.moving_points, self.scale
        if self._first is None or self._first[0] != key:
            self._steps.clear()
            with add_key_to_errors("file"):
                data = series.read(0)
                volume = split_into_tetrahedra(data, str(series.file))
            rest = self.scale * points_of(volume.grid)
            cells = tetrahedra_of(volume.grid)
            volume.grid.SetPoints(to_points(rest))
            volume.grid.SetCells(VTK_TETRA, to_cells(cells))
            self._first = key, volume, ConnectivitySnapshot(data), rest
        return self._first[1]

    def _step_displacement(self, series: MeshSeries, step: int) -> Floats:
        if step not in self._steps:
            if len(self._steps) >= _MAX_STEPS:
                del self._steps[next(iter(self._steps))]
            self._steps[step] = self._read_displacement(series, step)
        return self._steps[step]

    def _read_displacement(self, series: MeshSeries, step: int) -> Floats:
        assert self._first is not None
        _, volume, cells, rest = self._first
        where = f"{series.file}, step {step} (t = {series.times[step]:g} s)"
        data: vtkPointSet = series.read(step)
        if not isinstance(data, vtkUnstructuredGrid) or not cells.matches(data):
            raise GeometryError(
                f"{where}: its cells differ from those of the first step",
                cure="Use a series whose mesh does not change, or cut the series.",
            )
        if self.moving_points:
            moved = points_of(data).astype(np.float64)
            if len(moved) <= volume.points.max(initial=0):
                raise GeometryError(f"{where}: it has only {len(moved)} points")
            result = self.scale * moved[volume.points] - rest
        else:
            values = array_of(data.GetPointData(), self.array, f"MotionReader, in {where},")
            if values.ndim != 2 or values.shape[1] != 3:
                raise InputError(
                    f'{where}: the array "{self.array}" has shape {values.shape}',
                    key="array",
                    allowed="three components for each point",
                )
            result = self.scale * values.astype(np.float64)[volume.points]
        if not np.isfinite(result).all():
            bad = int(np.argmin(np.isfinite(result).all(axis=1)))
            raise InputError(f"{where}: the displacement of point {bad} is not finite")
        return result
