"""Jobs for figures: pages for publications."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.jobs.job import Context, Job, Times, register, selected_times, to_floats, to_texts

if TYPE_CHECKING:
    from spacemap_vtk.draw.figure.figure_page import FigurePage
    from spacemap_vtk.scenes.scene import Scene

#: Fields of `FigurePage` that a record stores, in this order.
_RECORDED = (
    *("lists", "paired", "cage", "columns", "end", "pick"),
    *("width", "dpi", "dark", "transparent"),
)


@register()
@dataclass
class FigureJob(Job):
    """A page of pictures, draft, cloth and sections."""

    output: Path
    page: FigurePage

    kind = "figure"
    command = "figure"

    def __post_init__(self) -> None:
        check_output(self.output, writer_endings("plot"))
        if self.page.transparent and self.output.suffix.lower() in (".jpg", ".jpeg"):
            raise InputError(
                f"{self.output.suffix} files cannot be transparent",
                key="--transparent",
                allowed=".png, .svg, .pdf",
            )

    def as_json(self) -> dict[str, Any]:
        """Return the content of the page."""
        record: dict[str, Any] = {"what": self.kind}
        for name in ("times", "panels"):
            if value := list(getattr(self.page, name)):
                record[name] = value
        page = {name: getattr(self.page, name) for name in _RECORDED}
        page["lists"] = list(page["lists"])
        # A zero must be stored, because it is refused later.
        record["page"] = {k: v for k, v in page.items() if v not in (None, []) and v is not False}
        return record

    @classmethod
    def from_json(cls, record: Mapping[str, Any], output: Path) -> Job:
        """Return the job that `as_json` has described."""
        from spacemap_vtk.draw.figure.figure_page import FigurePage

        try:
            page = FigurePage(
                panels=to_texts(record.get("panels", ())),
                times=to_floats(record.get("times", ())),
                **record.get("page", {}),
            )
        except TypeError as error:
            raise InputError(f"invalid description of a figure: {error}") from None
        return cls(output, page)

    def decide_times(self, scene: Scene) -> Times:
        """Return the requested times; by default the page chooses its times."""
        return selected_times(self.page.times)

    def write(self, context: Context) -> str:
        """Lay out the page and write it."""
        from spacemap_vtk.draw.figure.figure_page import make_figure

        context.progress(0, 1)
        self.write_output(context, "plot", make_figure(context.scene, self.page, context.progress))
        context.progress(1, 1)
        return ""
