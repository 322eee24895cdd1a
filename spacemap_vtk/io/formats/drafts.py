"""Read and write weavers' drafts: WIF, rows of text, black-and-white pictures (only read)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import find_record_in_comments, finds_record, record_comments
from spacemap_vtk.io.registry import lazy_function, reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.textile.drafts.draft import Draft

_PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".tif", ".tiff")

reads(".wif", ".wifw", ".plm", label="Weaver's draft", holds="draft", rest=True)(
    lazy_function("drafts.wif", "read_wif")
)
reads(
    ".csv", ".txt", label="Rows of 0 and 1, or lists of raised shafts", holds="draft", general=True
)(lazy_function("drafts.draft_file", "read_rows"))
reads(*_PICTURES, label="Black-and-white picture", holds="draft", general=True)(
    lazy_function("drafts.draft_file", "read_picture")
)
finds_record(".wif")(find_record_in_comments)


@writes(".wif", label="Weaver's draft", holds=("draft",))
def write_wif(file: Path, draft: Draft) -> None:
    """Write a Weaving Information File."""
    write_parts(
        file,
        [
            lazy_function("drafts.wif_writer", "format_wif")(draft),
            *(f"{line}\r\n".encode() for line in record_comments(";")),
        ],
    )


@writes(
    ".txt",
    label="Rows of 0 and 1",
    holds=("draft",),
    loses=lazy_function("drafts.draft_file", "row_losses"),
)
def write_rows(file: Path, draft: Draft) -> None:
    """Write a drawdown as text, with a row for each pick."""
    write_parts(file, [lazy_function("drafts.draft_file", "format_rows")(draft)])
