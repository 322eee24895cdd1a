"""The job for a weaver's plan: a table for spreadsheets, or a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output, write_parts
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.jobs.job import Context, Job, register
from spacemap_vtk.scenes.plan_settings import PlanSettings


@register()
@dataclass
class PlanJob(Job):
    """The plan of a project."""

    output: Path
    settings: PlanSettings = field(default_factory=PlanSettings)

    kind = "plan"
    command = "plan"

    def __post_init__(self) -> None:
        check_output(self.output, {**writer_endings("plot"), ".csv": "table"})

    def as_json(self) -> dict[str, Any]:
        """Return the settings that differ from their defaults, in SI."""
        parameters, given = PlanSettings.parameters, {}
        for name, value in self.settings.settings.items():
            if value != parameters[name].default:
                given[name] = list(value) if isinstance(value, tuple) else value
        return {"what": self.kind, "settings": given}

    @classmethod
    def from_json(cls, record: Mapping[str, Any], output: Path) -> Job:
        """Return the job that `as_json` has described."""
        given = record.get("settings", {})
        if not isinstance(given, dict):
            raise InputError("invalid description of a plan")
        return cls(output, PlanSettings(**given))

    def write(self, context: Context) -> str:
        """Plan the project and write it."""
        from spacemap_vtk.scenes.plan import plan_scene
        from spacemap_vtk.scenes.plan_tables import plan_as_csv

        context.progress(0, 1)
        plan = plan_scene(context.scene, self.settings)
        if self.output.suffix.lower() == ".csv":
            with self.open_output(context.atomic) as file:
                write_parts(file, [plan_as_csv(plan).encode()])
        else:
            from spacemap_vtk.draw.figure.plan_page import draw_plan

            self.write_output(context, "plot", draw_plan(plan))
        context.progress(1, 1)
        return ""
