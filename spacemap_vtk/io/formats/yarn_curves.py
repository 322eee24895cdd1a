"""Read yarns as curves: TexGen (.tg3), .bcc, .yarns, .smobj, .csv, .vtp; write .tg3 and .bcc."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import find_record_in_comments, finds_record
from spacemap_vtk.io.registry import lazy_function, reads, writes

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import YarnCurves

reads(".tg3", label="Textile of TexGen", holds="yarns")(lazy_function("yarns.texgen", "read_tg3"))
reads(".bcc", ".bccx", label="Binary curve collection", holds="yarns")(
    lazy_function("yarns.bcc", "read_bcc")
)
reads(".yarns", label="Yarns of a stitch mesh", holds="yarns")(
    lazy_function("yarns.stitch_mesh", "read_yarns")
)
reads(".smobj", label="Stitch mesh with a library of faces", holds="yarns")(
    lazy_function("yarns.stitch_faces", "read_smobj")
)
reads(".csv", label="Points of yarns", holds="yarns", general=True)(
    lazy_function("yarns.tables", "read_csv")
)
reads(".vtp", label="Lines of VTK", holds="yarns", general=True)(
    lazy_function("yarns.tables", "read_vtp")
)


@writes(
    ".bcc",
    label="Binary curve collection",
    holds=("yarns",),
    loses=lazy_function("yarns.bcc", "bcc_losses"),
)
def write_bcc(file: Path, curves: YarnCurves | None) -> None:
    """Write the centre lines of yarns as Catmull-Rom curves."""
    from spacemap_vtk.io.yarns.bcc import format_bcc

    write_parts(file, format_bcc(_require_yarns(curves)))


@writes(
    ".tg3",
    label="Textile of TexGen",
    holds=("yarns",),
    loses=lazy_function("yarns.texgen", "tg3_losses"),
)
def write_tg3(file: Path, curves: YarnCurves | None) -> None:
    """Write the centre lines of yarns as a textile without repeats."""
    from spacemap_vtk.io.yarns.texgen import format_tg3

    lines = format_tg3(_require_yarns(curves), file.stem)
    write_parts(file, (f"{line}\n".encode() for line in lines))


def _require_yarns(curves: YarnCurves | None) -> YarnCurves:
    if curves is None:
        raise InputError("the scene has no yarns", key="what", cure="Write a .vtu.")
    return curves


finds_record(".tg3")(find_record_in_comments)
