"""The ruler: the distance between two picked points, and the angle at the second of three."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCoordinate, vtkPolyDataMapper2D

from spacemap_vtk.app.view.pick import Pick
from spacemap_vtk.datasets.arrays import to_cells, to_points
from spacemap_vtk.draw.actors.surface_actor import rgb
from spacemap_vtk.draw.frame import Frame
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.units import format_quantity

#: Number of points of an angle; the next one begins a new measurement.
_POINTS = 3
_COLOR = "#d9642c"
#: Width of the line in pixels.
_WIDTH = 2.0


class Ruler:
    """The picked points, a line that joins them, and its lengths; they follow the cloth."""

    def __init__(self) -> None:
        self.is_on = False
        self.picks: list[Pick] = []
        #: Positions in the present frame [m], shape (number of picks, 3).
        self.points: Floats = np.zeros((0, 3))
        #: The line, in front of everything.
        self.line = vtkActor2D()
        mapper, world = vtkPolyDataMapper2D(), vtkCoordinate()
        world.SetCoordinateSystemToWorld()
        mapper.SetTransformCoordinate(world)
        mapper.SetInputData(vtkPolyData())
        self.line.SetMapper(mapper)
        self.line.GetProperty().SetColor(*rgb(_COLOR))
        self.line.VisibilityOff()

    def add(self, pick: Pick) -> None:
        """Add a point; after a complete angle, begin again with it."""
        self.picks = [*self.picks, pick] if len(self.picks) < _POINTS else [pick]

    def clear(self) -> None:
        """Remove all points."""
        self.picks = []

    def follow(self, frame: Frame | None, pixels: float) -> None:
        """Move the line to the points of a frame; `pixels` scales its width."""
        picks = self.picks if frame is not None else []
        found = [pick.label(frame, None)[0] for pick in picks] if frame is not None else []
        self.points = np.array(found, dtype=np.float64).reshape(-1, 3)
        data = vtkPolyData()
        if len(self.points) > 1:
            data.SetPoints(to_points(self.points))
            ends = np.arange(len(self.points))
            data.SetLines(to_cells(np.stack([ends[:-1], ends[1:]], axis=1)))
        self.line.GetMapper().SetInputData(data)
        self.line.GetProperty().SetLineWidth(_WIDTH * pixels)
        self.line.SetVisibility(len(self.points) > 1)

    @property
    def lengths(self) -> list[float]:
        """Lengths of the line's parts in the present frame [m]."""
        return [float(d) for d in np.linalg.norm(np.diff(self.points, axis=0), axis=1)]

    @property
    def angle(self) -> float | None:
        """Angle at the second of three points [degree]; None if there is none."""
        if len(self.points) < _POINTS or not all(self.lengths):
            return None
        first, second = (self.points[k] - self.points[1] for k in (0, 2))
        cosine = first @ second / np.prod(self.lengths)
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))

    @property
    def labels(self) -> list[tuple[Floats, str]]:
        """A label for each length, in the middle of its part, and one for the angle."""
        middles = (self.points[:-1] + self.points[1:]) / 2
        texts = [format_quantity(length, "m", 4) for length in self.lengths]
        labels = list(zip(middles, texts, strict=True))
        if self.angle is not None:
            labels.append((self.points[1], f"{self.angle:.1f}°"))
        return labels

    @property
    def text(self) -> str:
        """The measurement as a line for the user, with the lengths of the cloth at rest."""
        if not self.picks:
            return "Click two points to measure their distance, and a third one for an angle."
        if len(self.picks) == 1:
            return "Click the second point."
        rest = np.linalg.norm(np.diff([pick.rest for pick in self.picks], axis=0), axis=1)
        parts = [
            f"{format_quantity(length, 'm', 4)} (at rest {format_quantity(float(before), 'm', 4)})"
            for length, before in zip(self.lengths, rest, strict=True)
        ]
        angle = "" if self.angle is None else f"; angle {self.angle:.1f}°"
        return f"Distance {', then '.join(parts)}{angle}"
