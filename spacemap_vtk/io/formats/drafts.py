"""Weavers' drafts: WIF, rows of text, black-and-white pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.io.registry import reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.fabric.draft import Draft


@reads(".wif", label="Weaver's draft", holds="draft", rest=True)
def read_wif(path: Path) -> Draft:
    """Read a Weaving Information File."""
    from spacemap_vtk.io import wif

    return wif.read_wif(path)


@reads(".csv", ".txt", label="Rows of 0 and 1", holds="draft", general=True)
def read_rows(path: Path) -> Draft:
    """Read a row for each pick."""
    from spacemap_vtk.io import draft_file

    return draft_file.read_rows(path)


@reads(
    *(".bmp", ".gif", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".tif", ".tiff"),
    label="Black-and-white picture",
    holds="draft",
    general=True,
)
def read_picture(path: Path) -> Draft:
    """Read a pixel for each crossing."""
    from spacemap_vtk.io import draft_file

    return draft_file.read_picture(path)


@writes(".wif", label="Weaver's draft", holds=("draft",))
def write_wif(file: Path, draft: Draft) -> None:
    """Write a Weaving Information File."""
    from spacemap_vtk.io.output import write
    from spacemap_vtk.io.wif_writer import format_wif

    write(file, [format_wif(draft)])
