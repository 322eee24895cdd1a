"""Drafts of weaving programs: Fiberworks (.dtx), WeavePoint (.wpo) and TempoWeave (.twa)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import ZipFile

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.registry import lazy_function, reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.textile.drafts.draft import Draft

#: Name of the file with the WIF in a .twa, which is a ZIP archive.
_WIF_IN_TWA = "twamain.waf"

reads(".dtx", label="Draft of Fiberworks", holds="draft")(lazy_function("drafts.dtx", "read_dtx"))
reads(".wpo", label="Draft of WeavePoint", holds="draft")(lazy_function("drafts.wpo", "read_wpo"))


@writes(
    ".dtx",
    label="Draft of Fiberworks",
    holds=("draft",),
    loses=lazy_function("drafts.dtx", "losses"),
)
def write_dtx(file: Path, draft: Draft) -> None:
    """Write a Fiberworks draft."""
    write_parts(file, [lazy_function("drafts.dtx", "format_dtx")(draft)])


@reads(".twa", label="Draft of TempoWeave", holds="draft")
def read_twa(path: Path) -> Draft:
    """Read the WIF in a TempoWeave draft."""
    from spacemap_vtk.io.drafts.draft_bytes import unreadable_error
    from spacemap_vtk.io.drafts.wif import parse_wif
    from spacemap_vtk.io.drafts.wif_text import MAX_LENGTH

    try:
        with ZipFile(path) as archive:
            name = next(name for name in archive.namelist() if name.lower() == _WIF_IN_TWA)
            with archive.open(name) as stream:
                return parse_wif(stream.read(MAX_LENGTH + 1))
    except InputError:
        raise
    except OSError as error:
        raise unreadable_error(error) from None
    except Exception as error:  # zipfile and its decoders do not document what they raise
        raise InputError(
            f"the archive has no {_WIF_IN_TWA}",
            allowed="a .twa file of TempoWeave",
            cure="Export it as WIF.",
        ) from error
