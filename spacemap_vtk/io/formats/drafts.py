"""Weavers' drafts: WIF, those of other programs, rows of text, black-and-white pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.io.provenance import comments, tells, told_in_comments
from spacemap_vtk.io.registry import reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.fabric.draft import Draft


@reads(".wif", ".wifw", ".plm", label="Weaver's draft", holds="draft", rest=True)
def read_wif(path: Path) -> Draft:
    """Read a Weaving Information File."""
    from spacemap_vtk.io import wif

    return wif.read_wif(path)


@reads(".dtx", label="Draft of Fiberworks", holds="draft")
def read_dtx(path: Path) -> Draft:
    """Read a draft of Fiberworks."""
    from spacemap_vtk.io import dtx

    return dtx.read_dtx(path)


@reads(".wpo", label="Draft of WeavePoint", holds="draft")
def read_wpo(path: Path) -> Draft:
    """Read a draft of WeavePoint."""
    from spacemap_vtk.io import wpo

    return wpo.read_wpo(path)


@reads(".twa", label="Draft of TempoWeave", holds="draft")
def read_twa(path: Path) -> Draft:
    """Read a draft of TempoWeave."""
    from spacemap_vtk.io import draft_file

    return draft_file.read_zipped(path)


@reads(".csv", ".txt", label="Rows of 0 and 1, or shafts that rise", holds="draft", general=True)
def read_rows(path: Path) -> Draft:
    """Read a row for each pick: its crossings, or the shafts that rise."""
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

    write(file, [format_wif(draft), *(f"{line}\r\n".encode() for line in comments(";"))])


tells(".wif")(told_in_comments)


def _dtx_loses(draft: Draft) -> list[str]:
    from spacemap_vtk.io import dtx

    return dtx.losses(draft)


@writes(".dtx", label="Draft of Fiberworks", holds=("draft",), loses=_dtx_loses)
def write_dtx(file: Path, draft: Draft) -> None:
    """Write a draft of Fiberworks."""
    from spacemap_vtk.io.dtx import format_dtx
    from spacemap_vtk.io.output import write

    write(file, [format_dtx(draft)])


def _rows_lose(draft: Draft) -> list[str]:
    from spacemap_vtk.io import draft_file

    return draft_file.rows_lose(draft)


@writes(".txt", label="Rows of 0 and 1", holds=("draft",), loses=_rows_lose)
def write_rows(file: Path, draft: Draft) -> None:
    """Write a row for each pick."""
    from spacemap_vtk.io.draft_file import format_rows
    from spacemap_vtk.io.output import write

    write(file, [format_rows(draft)])
