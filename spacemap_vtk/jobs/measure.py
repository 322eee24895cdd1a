"""The job of the laboratory: tests of a scene's cloth, as a table or a plot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from spacemap_vtk.io.output import check_output, write_parts
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.jobs.job import Context, Job, register
from spacemap_vtk.laboratory.catalogue import find_test

#: Steps of the progress of one job.
_STEPS = 100


@register()
@dataclass
class MeasureJob(Job):
    """Curves and figures of a test, or of all tests."""

    output: Path
    #: Name of a test, or ``"all"``.
    test: str = "all"

    kind = "measurement"
    command = "measure"

    def __post_init__(self) -> None:
        check_output(self.output, {**writer_endings("plot"), ".csv": "table"})
        if self.test != "all":
            find_test(self.test)

    def write(self, context: Context) -> str:
        """Run the tests and write what they gave."""
        from spacemap_vtk.scenes.laboratory import curves_as_csv, figures_as_csv, measure_scene

        def report(share: float) -> None:
            context.progress(round(_STEPS * share), _STEPS)

        results = measure_scene(context.scene, self.test, report)
        if self.output.suffix.lower() == ".csv":
            first = results[0].measurement
            text = figures_as_csv(results)
            if self.test != "all" and first is not None and first.curves:
                text = curves_as_csv(first)
            with self.open_output(context.atomic) as file:
                write_parts(file, [text.encode()])
        else:
            from spacemap_vtk.draw.figure.measurement_plot import measurement_plot

            figure = measurement_plot(context.scene.title, results)
            self.write_output(context, "plot", figure)
        context.progress(_STEPS, _STEPS)
        return ""
