"""What a scene is at some times beside its surface: middles of yarns, and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.datasets.moving_surface import ScaledNumbers, YarnCurves
from spacemap_vtk.draw.coloring import measure, unit_of
from spacemap_vtk.draw.seen_yarns import SeenYarns
from spacemap_vtk.draw.surface_actor import RAMP, natural_span, scale_title
from spacemap_vtk.embedding.morph_targets import morph_targets
from spacemap_vtk.memory import require
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene

#: Share of a scale by which a number may be off: a step of its colours.
_STEP = 1 / 512


class SeenOverTime:
    """The middles of yarns at some times, and what colours stand for at the points of a surface."""

    def __init__(
        self,
        scene: Scene,
        rows: NDArray[np.integer[Any]],
        times: int,
        numbers: bool,
        strands: str,
    ) -> None:
        self._scene, self._rows = scene, rows
        self._yarns = SeenYarns(scene, times, strands)
        self._values: NDArray[np.float32] | None = None
        if numbers and COLORINGS[scene.view.color].numbers:
            # kept, and taken apart in double precision
            require(28 * times * len(rows), f"numbers of {len(rows)} points at {times} times")
            self._values = np.zeros((times, len(rows)), np.float32)

    def see(self, number: int) -> None:
        """Take what the scene's last update has made, for one of the times."""
        self._yarns.see(number)
        if self._values is not None:
            numbers = measure(self._scene.polygons, self._scene.view.color)
            if numbers is None:  # no clearance where normals are missing
                self._values = None
            else:
                self._values[number] = numbers[self._rows]

    @property
    def curves(self) -> YarnCurves | None:
        """What was seen of yarns; None where there are none."""
        return self._yarns.curves

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
