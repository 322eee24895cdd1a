"""Jobs for sheets of several pictures: a motion over time, or the mode shapes of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.jobs.job import (
    Context,
    Job,
    Times,
    register,
    selected_times,
    to_floats,
    to_size,
    to_texts,
)

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene


@register()
@dataclass
class StoryboardJob(Job):
    """A picture of a motion: time to the right, the cage above the fabric, or a row per motion."""

    output: Path
    #: In s. Empty: times within the period of the first mode.
    times: Sequence[float] = ()
    #: In pixels. None: wide enough for the columns.
    size: tuple[int, int] | None = None
    #: Keys of `spacemap_vtk.scenes.motions.MOTIONS`, a row for each. Empty: the cage above the
    #: fabric, moved as in the scene.
    motions: Sequence[str] = ()

    kind = "storyboard"
    command = "storyboard"

    def __post_init__(self) -> None:
        check_output(self.output, writer_endings("picture"))
        self.times = to_floats(self.times)
        self.size = to_size(self.size)
        self.motions = to_texts(self.motions)
        if self.motions:
            self._check_motions()

    def _check_motions(self) -> None:
        from spacemap_vtk.scenes.motions import MOTIONS

        if unknown := [name for name in self.motions if name not in MOTIONS]:
            raise InputError(
                "unknown motion", key="motions", value=unknown[0], allowed=", ".join(MOTIONS)
            )

    def decide_times(self, scene: Scene) -> Times:
        """Return the requested times; by default those of one oscillation."""
        if not scene.moves:
            raise InputError(
                f"{scene.file or scene.title}: a storyboard needs a scene that moves",
                cure="Add a section [response].",
            )
        if self.times:
            return selected_times(self.times)
        from spacemap_vtk.draw.figure.sheets import period_times

        return Times(period_times(scene))

    def write(self, context: Context) -> str:
        """Draw the board and write it."""
        from spacemap_vtk.draw.figure.sheets import motions_board, storyboard

        scene, times, progress = context.scene, context.times, context.progress
        if self.motions:
            image = motions_board(scene, self.motions, times, self.size, progress)
        else:
            image = storyboard(scene, times, self.size, progress)
        self.write_output(context, "picture", image)
        return ""


@register()
@dataclass
class ShapesJob(Job):
    """A sheet of the first mode shapes."""

    output: Path

    kind = "shapes"
    command = "modes"

    def __post_init__(self) -> None:
        check_output(self.output, writer_endings("picture"))

    def write(self, context: Context) -> str:
        """Draw the sheet and write it."""
        from spacemap_vtk.draw.figure.sheets import mode_sheet

        self.write_output(context, "picture", mode_sheet(context.scene, context.progress))
        return ""
