"""Job for a printed draft."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_output
from spacemap_vtk.io.provenance import attach_order
from spacemap_vtk.io.registry import writer, writer_endings
from spacemap_vtk.jobs.job import Context, Job, register, require_placeholder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from spacemap_vtk.scenes.scene import Scene


@register()
@dataclass
class PrintJob(Job):
    """A draft for the loom, as a document or as a file for each page."""

    output: Path
    #: Values of `spacemap_vtk.draw.draft_print.settings.PrintSettings` by name.
    settings: Mapping[str, Any] = field(default_factory=dict)

    kind = "print"
    command = "print"

    def __post_init__(self) -> None:
        from spacemap_vtk.draw.draft_print.settings import PrintSettings

        self._checked = PrintSettings(**self.settings)
        single = dict.fromkeys(writer_endings("plot"), "single pages, as in page-%02d")
        check_output(self.output, {**single, **writer_endings("pages")}, self.is_numbered)
        if self._is_single and not (self._checked.pages or "").isdecimal():
            require_placeholder(self.output)

    @property
    def _is_single(self) -> bool:
        """Whether a file has one page."""
        return self.output.suffix.lower() not in writer_endings("pages")

    @property
    def is_numbered(self) -> bool:
        """Whether each page is written into a separate file."""
        return self._is_single and "%" in self.output.name

    @property
    def needs_folder(self) -> bool:
        """Whether other files may appear next to the output."""
        return self.is_numbered

    def write(self, context: Context) -> str:
        """Draw the pages and write them; return their number."""
        from spacemap_vtk.draw.draft_print.sheet import DraftSheet

        scene = context.scene
        if scene.woven is None:
            raise InputError(
                f"{scene.title}: this scene is not woven", cure="Only drafts can be printed."
            )
        draft = scene.woven.make_draft()
        assert draft is not None  # of anything woven
        sheet = DraftSheet(draft, self._checked, scene.title, list(_remarks(scene)))

        count = len(sheet.numbers)
        done = itertools.count()

        def pages() -> Iterator[tuple[int, Figure]]:
            for number, page in sheet.pages():
                context.progress(next(done), count)
                yield number, page

        if self._is_single:
            with self.open_output(context.atomic) as file:
                for number, page in pages():
                    name = file.name % number if self.is_numbered else file.name
                    # "spacemap again" repeats a page by itself.
                    with attach_order(settings={**self.settings, "pages": str(number)}):
                        writer(file, "plot").write(file.with_name(name), page)
        else:
            self.write_output(context, "pages", (page for _, page in pages()))
        context.progress(count, count)
        return f"{count} page{'s' if count > 1 else ''}"


def _remarks(scene: Scene) -> Iterator[str]:
    """Yield what a weaver must know about how the draft was read."""
    assert scene.woven is not None
    if scene.woven.source.loom is None:
        yield "The source has no threading: this is the smallest one that weaves it."
    if scene.woven.cloth.layers is not None:
        yield "A double weave: floats between its two cloths are counted like those on a face."
