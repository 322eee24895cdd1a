"""The job of the laboratory: tests of a scene's cloth, as a table, a plot or a film."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output, write_parts
from spacemap_vtk.io.registry import writer, writer_endings
from spacemap_vtk.jobs.job import Context, Job, register, to_size
from spacemap_vtk.laboratory.catalogue import find_test

if TYPE_CHECKING:
    from spacemap_vtk.scenes.laboratory import TestResult

#: Size of a film in pixels.
FILM_SIZE = 1280, 720
#: Steps of the progress of one job.
_STEPS = 100


@register()
@dataclass
class MeasureJob(Job):
    """Curves and figures of a test, or of all tests."""

    output: Path
    #: Name of a test, or ``"all"``.
    test: str = "all"
    #: Size of a film in pixels. None: `FILM_SIZE`.
    size: tuple[int, int] | None = None

    kind = "measurement"
    command = "measure"

    def __post_init__(self) -> None:
        endings = {**writer_endings("plot"), **writer_endings("film"), ".csv": "table"}
        check_output(self.output, endings)
        self.size = to_size(self.size)
        if self.test != "all":
            find_test(self.test)
        elif self._is_film:
            raise InputError(
                "a film shows one test", key="test", value=self.test, cure="Name the test."
            )
        if self._is_film:
            writer(self.output, "film").check(self.output)

    @property
    def _is_film(self) -> bool:
        return self.output.suffix.lower() in writer_endings("film")

    def write(self, context: Context) -> str:
        """Run the tests and write what they gave."""
        from spacemap_vtk.scenes.laboratory import curves_as_csv, figures_as_csv, measure_scene

        def report(share: float) -> None:
            context.progress(round(_STEPS * share), _STEPS)

        results = measure_scene(context.scene, self.test, report)
        if self._is_film:
            self._write_film(context, results[0])
        elif self.output.suffix.lower() == ".csv":
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

    def _write_film(self, context: Context, result: TestResult) -> None:
        from spacemap_vtk.draw.figure.measurement_film import write_film

        assert result.measurement is not None
        with self.open_output(context.atomic) as file:
            size = self.size or FILM_SIZE
            write_film(file, context.scene, result.test, result.measurement, size, context.progress)
