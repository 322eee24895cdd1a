"""Weavers' drafts: WIF, those of other programs, rows of text, black-and-white pictures."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.provenance import comments, tells, told_in_comments
from spacemap_vtk.io.registry import reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.fabric.draft import Draft

_PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".tif", ".tiff")


def _of(module: str, name: str) -> Callable[[Any], Any]:
    """Return a function of a module of `io`, which is imported when it is called."""
    return lambda given: getattr(import_module(f"spacemap_vtk.io.{module}"), name)(given)


reads(".wif", ".wifw", ".plm", label="Weaver's draft", holds="draft", rest=True)(
    _of("wif", "read_wif")
)
reads(".dtx", label="Draft of Fiberworks", holds="draft")(_of("dtx", "read_dtx"))
reads(".wpo", label="Draft of WeavePoint", holds="draft")(_of("wpo", "read_wpo"))
reads(".twa", label="Draft of TempoWeave", holds="draft")(_of("draft_file", "read_zipped"))
reads(".csv", ".txt", label="Rows of 0 and 1, or shafts that rise", holds="draft", general=True)(
    _of("draft_file", "read_rows")
)
reads(*_PICTURES, label="Black-and-white picture", holds="draft", general=True)(
    _of("draft_file", "read_picture")
)
tells(".wif")(told_in_comments)


@writes(".wif", label="Weaver's draft", holds=("draft",))
def write_wif(file: Path, draft: Draft) -> None:
    """Write a Weaving Information File."""
    from spacemap_vtk.io.output import write
    from spacemap_vtk.io.wif_writer import format_wif

    write(file, [format_wif(draft), *(f"{line}\r\n".encode() for line in comments(";"))])


@writes(".dtx", label="Draft of Fiberworks", holds=("draft",), loses=_of("dtx", "losses"))
def write_dtx(file: Path, draft: Draft) -> None:
    """Write a draft of Fiberworks."""
    from spacemap_vtk.io.dtx import format_dtx
    from spacemap_vtk.io.output import write

    write(file, [format_dtx(draft)])


@writes(".txt", label="Rows of 0 and 1", holds=("draft",), loses=_of("draft_file", "rows_lose"))
def write_rows(file: Path, draft: Draft) -> None:
    """Write a row for each pick."""
    from spacemap_vtk.io.draft_file import format_rows
    from spacemap_vtk.io.output import write

    write(file, [format_rows(draft)])
