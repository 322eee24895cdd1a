"""Record the axes of yarns or strands of a scene over time, and the numbers that colours show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.moving_surface import MovingSurface, ScaledNumbers, YarnCurves
from spacemap_vtk.draw.actors.color_values import color_values, scale_unit
from spacemap_vtk.draw.actors.surface_actor import RAMP, color_bar_title, natural_span
from spacemap_vtk.draw.detail.far_cloth import FarClothRecorder, make_shading
from spacemap_vtk.embedding.morph_targets import find_morph_targets
from spacemap_vtk.errors import InputError
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Bytes, Singles
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.strand_curves import (
    PointFilter,
    StrandCurves,
    build_strand_curves,
    fibre_count,
)
from spacemap_vtk.textile.geometry.sweep import Tubes
from spacemap_vtk.textile.geometry.weave import Weave, build_weave
from spacemap_vtk.textile.rods.tubes import find_tubes, round_widths

#: Largest error of a number, as a share of its scale: a step between two colours.
_STEP = 1 / 512
#: Kinds of curves; a number of fibres for each yarn is also allowed.
STRANDS = ("yarns", "plies", "fibres")


def check_strands(text: str) -> str:
    """Return the text if it is a kind of curve or a number of fibres; else raise InputError."""
    if text in STRANDS or (text.isdecimal() and 0 < int(text) <= 10_000):
        return text
    raise InputError(
        "unknown kind of curves",
        key="--curves",
        value=text,
        allowed=f"{', '.join(STRANDS)}, or a number of fibres",
    )


class YarnRecorder:
    """The axes of a scene's yarns over time (the centres of control point rings), or strands."""

    def __init__(self, scene: Scene, times: int, strands: str = "yarns") -> None:
        self._scene, self._strands, self._times = scene, strands, times
        self._weave: Weave | None = None
        self._rods: Tubes | None = None
        if scene.woven is None:
            if strands == "yarns" and scene.textile is not None:
                self._rods = find_tubes(vtk_to_numpy(scene.patches.GetCellData().GetArray("yarn")))
        else:
            self._cloth = scene.woven.cloth
            weave = build_weave(self._cloth, kind=np.float32)
            # The patches of a part of a weave have other points, and are not supported.
            if len(weave.points) == scene.patches.GetNumberOfPoints():
                self._weave = weave
        self._points: Singles = np.zeros((times, 0, 3), np.float32)
        self._curves: StrandCurves | None = None

    def record(self, number: int) -> None:
        """Record the curves of the scene's last update as those of time `number`."""
        if self._rods is not None:
            points = self._rods.ring_centres(points_of(self._scene.data("patches")))
        elif self._weave is None:
            return
        elif self._strands == "yarns":
            controls = points_of(self._scene.data("patches"))
            points = np.concatenate([tubes.ring_centres(controls) for tubes in self._weave.tubes])
        else:
            count = int(self._strands) if self._strands.isdecimal() else None
            self._curves = self.strands(0 if self._strands == "plies" else count)
            points = self._curves.points
        if not self._points.size:
            size = 12 * self._times * len(points)
            require_memory(size, f"{self._strands} at {self._times} times", cure="Use fewer times.")
            self._points = np.zeros((self._times, *points.shape), np.float32)
        self._points[number] = points

    def strands(self, fibres: int | None, is_visible: PointFilter | None = None) -> StrandCurves:
        """Return the deformed plies (0), or a number of fibres of each yarn (None: all)."""
        assert self._weave is not None
        patches, cloth = self._scene.data("patches"), self._cloth
        rational = patches.GetPointData().GetRationalWeights()
        weights = None if rational is None else vtk_to_numpy(rational)
        fibres = fibre_count(cloth) if fibres is None else fibres
        weave, points = self._weave, points_of(patches)
        return build_strand_curves(
            cloth, weave.tubes, weave.places, points, weights, fibres, is_visible
        )

    @property
    def colors(self) -> Bytes:
        """Red, green and blue of each yarn."""
        cells = self._scene.patches.GetCellData()
        first = np.unique(vtk_to_numpy(cells.GetArray("yarn")), return_index=True)[1]
        return vtk_to_numpy(cells.GetArray("color"))[first][:, :3]

    @property
    def curves(self) -> YarnCurves | None:
        """The recorded curves; None if there are no yarns."""
        if self._rods is not None:
            widths = round_widths(self._rods, points_of(self._scene.patches))
            return YarnCurves(self._points, 3 * self._rods.parts + 1, widths, self.colors)
        if self._weave is None:
            return None
        if (curves := self._curves) is not None:
            colors = self.colors[curves.yarn]
            return YarnCurves(self._points, curves.counts, 2.0 * curves.radii, colors, "bspline")
        counts = np.concatenate([3 * each.parts + 1 for each in self._weave.tubes])
        return YarnCurves(self._points, counts, self._cloth.strands[2], self.colors)


class SurfaceRecorder(YarnRecorder):
    """The axes of yarns over time, the numbers that a surface's colours show, and its shading."""

    def __init__(
        self,
        scene: Scene,
        rows: AnyInts,
        times: int,
        numbers: bool,
        strands: str,
        shaded: bool = False,
    ) -> None:
        super().__init__(scene, times, strands)
        self._rows, self._shaded = rows, shaded
        self._far = FarClothRecorder(scene, times) if shaded and scene.woven is not None else None
        self._values: Singles | None = None
        if numbers and COLORINGS[scene.view.color].shows_numbers:
            # Single precision for the record, and double precision for its decomposition.
            require_memory(
                28 * times * len(rows), f"numbers of {len(rows)} points at {times} times"
            )
            self._values = np.zeros((times, len(rows)), np.float32)

    def record(self, number: int) -> None:
        """Record the scene's last update as that of time `number`."""
        super().record(number)
        scene = self._scene
        if self._far is not None:
            self._far.record(number, scene.deformed_cage if scene.moves else None)
        if self._values is not None:
            numbers = color_values(scene.polygons, scene.view.color)
            if numbers is None:  # clearances cannot be measured without normals
                self._values = None
            else:
                self._values[number] = numbers[self._rows]

    def complete(self, surface: MovingSurface, weights: AnyFloats) -> MovingSurface:
        """Return a surface together with all that was recorded; weights of its targets, (T, K)."""
        surface = replace(surface, curves=self.curves, numbers=self.numbers)
        if not self._shaded:
            return surface
        far = None if self._far is None else self._far.make(weights, surface)
        shading = make_shading(self._scene, far, self._scene.polygons, self._rows)
        return replace(surface, shading=shading)

    @property
    def numbers(self) -> ScaledNumbers | None:
        """The recorded numbers as a sum of few changes; None if colours show no numbers."""
        if self._values is None:
            return None
        color, span = self._scene.view.color, natural_span(self._values)
        unit, size = scale_unit(color, max(map(abs, span)))
        mean = self._values.mean(axis=0)
        found = find_morph_targets((self._values - mean)[..., None], _STEP * (span[1] - span[0]))
        return ScaledNumbers(
            color_bar_title(color, unit),
            (span[0] / size, span[1] / size),
            RAMP,
            mean / size,
            found.shapes[..., 0] / size,
            found.weights,
        )
