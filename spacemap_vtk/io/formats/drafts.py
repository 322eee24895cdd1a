"""Read and write weavers' drafts: WIF, rows of text, black-and-white pictures (only read)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.io.output import write
from spacemap_vtk.io.provenance import comments, tells, told_in_comments
from spacemap_vtk.io.registry import of, reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.textile.drafts.draft import Draft

_PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".tif", ".tiff")

reads(".wif", ".wifw", ".plm", label="Weaver's draft", holds="draft", rest=True)(
    of("drafts.wif", "read_wif")
)
reads(".csv", ".txt", label="Rows of 0 and 1, or shafts that rise", holds="draft", general=True)(
    of("drafts.draft_file", "read_rows")
)
reads(*_PICTURES, label="Black-and-white picture", holds="draft", general=True)(
    of("drafts.draft_file", "read_picture")
)
tells(".wif")(told_in_comments)


@writes(".wif", label="Weaver's draft", holds=("draft",))
def write_wif(file: Path, draft: Draft) -> None:
    """Write a Weaving Information File."""
    write(
        file,
        [
            of("drafts.wif_writer", "format_wif")(draft),
            *(f"{line}\r\n".encode() for line in comments(";")),
        ],
    )


@writes(
    ".txt", label="Rows of 0 and 1", holds=("draft",), loses=of("drafts.draft_file", "rows_lose")
)
def write_rows(file: Path, draft: Draft) -> None:
    """Write a drawdown as text, with a row for each pick."""
    write(file, [of("drafts.draft_file", "format_rows")(draft)])
