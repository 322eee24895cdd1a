"""Jobs for moving surfaces in one file: a motion over time, or mode shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import writer
from spacemap_vtk.jobs.data import (
    ExportJob,
    check_data_output,
    common_scale,
    format_count,
    format_size,
    series_times,
    write_series,
)
from spacemap_vtk.jobs.job import Context, Job, Times, register, selected_times, to_floats
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import MovingSurface
    from spacemap_vtk.scenes.scene import Scene


@register()
@dataclass
class MovingJob(ExportJob):
    """The surface with its motion, or a separate file for each time."""

    output: Path
    #: In s. Empty: the times of the scene's film.
    times: Sequence[float] = ()
    #: Largest distance between the surface and its motion, in m. None: one that cannot be seen.
    tolerance: float | None = None
    #: Subdivisions of each patch. None: those of the scene, or as many as a player can show.
    subdivisions: int | None = None
    #: What the curves of the yarns are, see `spacemap_vtk.draw.detail.yarn_recorder.STRANDS`.
    curves: str = "yarns"
    irregular: bool = False

    kind = "moving"

    def __post_init__(self) -> None:
        check_data_output(self.output, self.kind)
        self.times = to_floats(self.times)
        self.subdivisions = _check_subdivisions(self.subdivisions)
        if self.tolerance is not None:
            self.tolerance = float(self.tolerance)
            if not 0.0 < self.tolerance < math.inf:
                raise InputError(
                    "tolerance must be a length above 0, for example 0.01mm",
                    key="tolerance",
                    value=self.tolerance,
                )
        if self.curves != "yarns":
            from spacemap_vtk.draw.detail.yarn_recorder import check_strands

            self.curves = check_strands(str(self.curves))

    @property
    def is_series(self) -> bool:
        """Whether data of several times are written."""
        return True

    @property
    def holds_curves(self) -> bool:
        """Whether the file stores yarns as curves."""
        curved = self.output.suffix.lower() in (".usdc", ".usda")
        return curved and not self.is_numbered

    def decide_times(self, scene: Scene) -> Times:
        """Return the requested times; by default those of the scene's film."""
        return series_times(scene, self.times)

    def write(self, context: Context) -> str:
        """Compute and write the motion; return its size and its error in words."""
        from spacemap_vtk.draw.morph_surface import make_moving_surface

        scene, times = context.scene, context.times
        if self.is_numbered:
            span = common_scale(scene, times)

            def make_still_surface(time: float) -> MovingSurface:
                return make_moving_surface(
                    scene, [time], self.tolerance, lambda *_: None, span, sides=0
                )

            return write_series(self, context, make_still_surface)
        format_ = writer(self.output, self.kind)
        surface = make_moving_surface(
            scene,
            times,
            self.tolerance,
            context.progress,
            max_bytes=format_.most,
            numbers=format_.numbers,
            strands=self.curves,
            sides=self.subdivisions or 0,
            warn=context.report_loss,
            shaded=format_.shaded,
        )
        return _write_surface(self, context, surface)


@register()
@dataclass
class ModesJob(ExportJob):
    """The surface in equilibrium, with a shape and an oscillation for each mode."""

    output: Path
    #: Subdivisions of each patch. None: those of the scene, or as many as a player can show.
    subdivisions: int | None = None
    irregular: bool = False

    kind = "modes"

    def __post_init__(self) -> None:
        check_data_output(self.output, self.kind)
        self.subdivisions = _check_subdivisions(self.subdivisions)

    def decide_times(self, scene: Scene) -> Times:
        """Return the scene's time."""
        return selected_times([scene.view.time])

    def write(self, context: Context) -> str:
        """Compute and write the shapes; return their number and their size in words."""
        from spacemap_vtk.draw.morph_surface import make_mode_surface

        format_ = writer(self.output, self.kind)
        surface = make_mode_surface(
            context.scene,
            context.progress,
            format_.most,
            self.subdivisions or 0,
            context.report_loss,
            format_.shaded,
        )
        return _write_surface(self, context, surface)


def _check_subdivisions(count: Any) -> int | None:
    if count is None:
        return None
    from spacemap_vtk.filters.patch_tessellator import PatchTessellator

    try:
        found: int = PatchTessellator.parameters["subdivisions"].check(count)
    except InputError as error:
        error.key = "subdivisions"
        raise
    return found


def _write_surface(job: Job, context: Context, surface: Any) -> str:
    """Write a moving surface; return its targets, error and size in words."""
    with job.open_output(context.atomic) as file:
        writer(file, job.kind).write(file, surface)
        size = file.stat().st_size
    count = len(surface.targets)
    parts = [format_count(count, "target")] if count else []
    if count and "largest_error" in surface.metadata:
        error = format_quantity(surface.metadata["largest_error"], "m", 3)
        frames = format_count(surface.metadata["frames"], "frame")
        parts.append(f"{frames}, largest error {error}")
    return ", ".join([*parts, format_size(size)])
