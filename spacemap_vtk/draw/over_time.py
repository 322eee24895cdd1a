"""What a scene is at some times beside its surface: middles of yarns, and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.moving_surface import ScaledNumbers, YarnCurves
from spacemap_vtk.draw.coloring import measure, unit_of
from spacemap_vtk.draw.surface_actor import RAMP, natural_span, scale_title
from spacemap_vtk.embedding.morph_targets import morph_targets
from spacemap_vtk.fabric.sweep import Tubes
from spacemap_vtk.fabric.weave import build
from spacemap_vtk.memory import require
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene

#: Share of a scale by which a number may be off: a step of its colours.
_STEP = 1 / 512


class SeenOverTime:
    """The middles of yarns at some times, and what colours stand for at the points of a surface."""

    def __init__(
        self, scene: Scene, rows: NDArray[np.integer[Any]], times: int, numbers: bool
    ) -> None:
        self._scene, self._rows, self._tubes = scene, rows, tuple[Tubes, ...]()
        if scene.source is scene.weave:
            made = build(scene.weave.cloth, kind=np.float32)
            # a part of a weave has other points
            if len(made.points) == scene.patches.GetNumberOfPoints():
                self._tubes = made.tubes
        # of rings of control points, whose middles they stay if moved
        rings = sum(3 * int(tubes.parts.sum()) + len(tubes.parts) for tubes in self._tubes)
        self._points = np.zeros((times, rings, 3), np.float32)
        self._values: NDArray[np.float32] | None = None
        if numbers and COLORINGS[scene.view.color].numbers:
            # kept, and taken apart in double precision
            require(28 * times * len(rows), f"numbers of {len(rows)} points at {times} times")
            self._values = np.zeros((times, len(rows)), np.float32)

    def see(self, number: int) -> None:
        """Take what the scene's last update has made, for one of the times."""
        if self._tubes:
            points = points_of(self._scene.patches)
            found = [tubes.middles(points) for tubes in self._tubes]
            self._points[number] = np.concatenate(found)
        if self._values is not None:
            numbers = measure(self._scene.polygons, self._scene.view.color)
            if numbers is None:  # no clearance where normals are missing
                self._values = None
            else:
                self._values[number] = numbers[self._rows]

    @property
    def curves(self) -> YarnCurves | None:
        """What was seen; None where there are no yarns."""
        if not self._tubes:
            return None
        cloth, cells = self._scene.weave.cloth, self._scene.patches.GetCellData()
        yarn, first = np.unique(vtk_to_numpy(cells.GetArray("yarn")), return_index=True)
        assert len(yarn) == sum(len(tubes.parts) for tubes in self._tubes)
        widths = [
            np.broadcast_to(yarns.diameter, len(tubes.parts)) * np.sqrt(tubes.aspect)
            for yarns, tubes in zip(cloth.yarns, self._tubes, strict=True)
        ]
        return YarnCurves(
            self._points,
            np.concatenate([3 * tubes.parts + 1 for tubes in self._tubes]),
            np.concatenate(widths),
            vtk_to_numpy(cells.GetArray("color"))[first][:, :3],
        )

    @property
    def numbers(self) -> ScaledNumbers | None:
        """What was seen, few changes of which it is a sum; None where colours are no numbers."""
        if self._values is None:
            return None
        color, span = self._scene.view.color, natural_span(self._values)
        unit, size = unit_of(color, max(map(abs, span)))
        mean = self._values.mean(axis=0)
        found = morph_targets((self._values - mean)[..., None], _STEP * (span[1] - span[0]))
        return ScaledNumbers(
            scale_title(color, unit),
            (span[0] / size, span[1] / size),
            RAMP,
            mean / size,
            found.shapes[..., 0] / size,
            found.weights,
        )
