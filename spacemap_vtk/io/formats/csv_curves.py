"""Write the axes of yarns as a table (.csv), for spreadsheets and for curves in other programs.

No kind of comment in a table is skipped by every program. The record of how the table was made is
therefore in a second file, as the W3C's "CSV on the Web" describes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import YarnCurves

_COLUMNS = "yarn,point,x [m],y [m],z [m],width [m],red,green,blue"


@writes(".csv", label="Table", holds=("yarns",))
def write_csv(file: Path, curves: YarnCurves | None) -> None:
    """Write a row for each control point of the joined cubic Bézier curves of each yarn."""

    if curves is None:
        raise InputError("the scene has no yarns", key="what", cure="Write a .vtu.")
    write_parts(file, (f"{text}\n".encode() for text in _table_lines(curves)))
    if record_text():
        about = {"@context": "http://www.w3.org/ns/csvw", "url": file.name, NAME: record_text()}
        write_parts(_metadata_file(file), [json.dumps(about, indent=1).encode()])


def _table_lines(curves: YarnCurves) -> Iterator[str]:
    """Yield the lines of the table, all lines of a yarn together."""
    yield _COLUMNS
    begin = 0
    for yarn, count in enumerate(curves.counts.tolist()):
        style = f"{curves.widths[yarn]:.6g},{','.join(map(str, curves.colors[yarn].tolist()))}"
        places = curves.points[0, begin : begin + count].tolist()
        yield "\n".join(
            f"{yarn},{place},{x:.9g},{y:.9g},{z:.9g},{style}"
            for place, (x, y, z) in enumerate(places)
        )
        begin += count


def _metadata_file(file: Path) -> Path:
    return file.with_name(f"{file.name}-metadata.json")


@finds_record(".csv")
def find_record_in_metadata(path: Path) -> str | None:
    """Find the record in the file that describes a table."""
    found = json.loads(_metadata_file(path).read_text(encoding="utf-8"))[NAME]
    return found if isinstance(found, str) else None
