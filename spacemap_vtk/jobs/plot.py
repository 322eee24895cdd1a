"""Jobs for plots: the motion of a point, reactions, the tensile tests of a cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from spacemap_vtk.io.output import check_output, write_parts
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.jobs.job import Context, Job, register, to_floats


@register()
@dataclass
class PlotJob(Job):
    """The motion of a point over time, and its frequency response or its energies."""

    output: Path
    #: Position at rest, in m. Empty: the point that the first mode moves most.
    point: Sequence[float] = ()
    #: A key of `spacemap_vtk.draw.figure.plots.QUANTITIES`.
    quantity: str = "displacement"

    kind = "plot"
    command = "plot"

    def __post_init__(self) -> None:
        check_output(self.output, writer_endings("plot"))
        self.point = to_floats(self.point)

    def write(self, context: Context) -> str:
        """Draw the curves and write them."""
        from spacemap_vtk.draw.figure.plots import motion_plot

        context.progress(0, 1)
        figure = motion_plot(context.scene, self.point or None, self.quantity)
        self.write_output(context, "plot", figure)
        context.progress(1, 1)
        return ""


@register()
@dataclass
class BiaxialJob(Job):
    """The tensile tests of the cloth: a plot, or a table as .csv."""

    output: Path

    kind = "biaxial"
    command = "plot --biaxial"

    def __post_init__(self) -> None:
        check_output(self.output, {**writer_endings("plot"), ".csv": "table"})

    def write(self, context: Context) -> str:
        """Compute the tests and write them."""
        from spacemap_vtk.draw.figure.plots import tensile_plot, tensile_table, tensile_tests_of

        context.progress(0, 1)
        tests = tensile_tests_of(context.scene)
        if self.output.suffix.lower() == ".csv":
            with self.open_output(context.atomic) as file:
                write_parts(file, [tensile_table(tests).encode()])
        else:
            self.write_output(context, "plot", tensile_plot(context.scene.title, tests))
        context.progress(1, 1)
        return ""


@register()
@dataclass
class ReactionsJob(Job):
    """Force and moment of supports, grips and obstacles: a plot, or a table as .csv."""

    output: Path
    #: "stroke" or "time"; None: over time if the scene has time steps.
    over: str | None = None

    kind = "reactions"
    command = "plot --reactions"

    def __post_init__(self) -> None:
        check_output(self.output, {**writer_endings("plot"), ".csv": "table"})

    def write(self, context: Context) -> str:
        """Compute the curves and write them."""
        from spacemap_vtk.draw.figure.reaction_plot import (
            reaction_curves,
            reaction_plot,
            reaction_table,
        )

        context.progress(0, 1)
        curves = reaction_curves(context.scene, self.over)
        if self.output.suffix.lower() == ".csv":
            with self.open_output(context.atomic) as file:
                write_parts(file, [reaction_table(curves).encode()])
        else:
            self.write_output(context, "plot", reaction_plot(context.scene.title, curves))
        context.progress(1, 1)
        return ""
