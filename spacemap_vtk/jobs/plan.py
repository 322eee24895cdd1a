"""The job for a weaver's plan: a table for spreadsheets, or a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spacemap_vtk.io.output import check_output, write_parts
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.jobs.job import Context, Job, register


@register()
@dataclass
class PlanJob(Job):
    """The plan of a project."""

    output: Path
    #: Values of `spacemap_vtk.scenes.plan_settings.PlanSettings` by name.
    settings: Mapping[str, Any] = field(default_factory=dict)

    kind = "plan"
    command = "plan"

    def __post_init__(self) -> None:
        from spacemap_vtk.scenes.plan_settings import PlanSettings

        check_output(self.output, {**writer_endings("plot"), ".csv": "table"})
        self._checked = PlanSettings(**self.settings)

    def write(self, context: Context) -> str:
        """Plan the project and write it."""
        from spacemap_vtk.scenes.plan import plan_scene
        from spacemap_vtk.scenes.plan_tables import plan_as_csv

        context.progress(0, 1)
        plan = plan_scene(context.scene, self._checked)
        if self.output.suffix.lower() == ".csv":
            with self.open_output(context.atomic) as file:
                write_parts(file, [plan_as_csv(plan).encode()])
        else:
            from spacemap_vtk.draw.figure.plan_page import draw_plan

            self.write_output(context, "plot", draw_plan(plan))
        context.progress(1, 1)
        return ""
