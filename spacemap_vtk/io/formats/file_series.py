"""Read and write series of files, one or several for each time, as ParaView lists them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import check_folder, write_parts
from spacemap_vtk.io.provenance import (
    attach_record_at,
    find_record_in_comments,
    finds_record,
    record_comments,
)
from spacemap_vtk.io.registry import lazy_function, reads, writer, writes

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkDataSet

    from spacemap_vtk.io.series import MeshSeries


@reads(
    ".pvd",
    label="ParaView collection",
    holds="motion",
    names=lazy_function("file_references", "names_in_xml"),
)
def open_collection(file: Path) -> MeshSeries:
    """Open the files that a ParaView collection names."""
    from xml.etree import ElementTree

    from spacemap_vtk.io.series import FileSeries

    try:
        root = ElementTree.parse(file).getroot()
        steps: dict[float, list[Path]] = {}
        for entry in root.iter("DataSet"):
            time = float(entry.get("timestep", "0"))
            steps.setdefault(time, []).append(file.parent / entry.attrib["file"])
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise InputError(f"{file}: not a ParaView collection: {error}", key="file") from None
    return FileSeries(file, list(steps.items()))


@writes(
    ".pvd",
    label="ParaView collection",
    holds=("surface", "patches", "cage"),
    times=True,
    require=check_folder,
)
def write_collection(file: Path, steps: Iterable[tuple[float, vtkDataSet]]) -> None:
    """Write the list, and a file for each time into a folder next to it."""
    from xml.sax.saxutils import quoteattr

    folder = file.with_suffix("")
    folder.mkdir()
    lines = []
    for number, (time, data) in enumerate(steps):
        ending = ".vtp" if data.IsA("vtkPolyData") else ".vtu"
        step_file = folder / f"{folder.name}_{number:04d}{ending}"
        with attach_record_at(time):
            writer(step_file).write(step_file, data)
        name = quoteattr(f"{folder.name}/{step_file.name}")
        lines.append(f'    <DataSet timestep="{time!r}" group="" part="0" file={name}/>\n')
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
    record = record_comments("    ")
    lines += ["  <!--\n", *(f"{line}\n" for line in record), "  -->\n"] if record else []
    write_parts(file, [f"{head}{''.join(lines)}  </Collection>\n</VTKFile>\n".encode()])


finds_record(".pvd")(find_record_in_comments)


def _file_names(file: Path) -> list[str]:
    with suppress(InputError):
        return [name for _, name in _read_entries(file)]
    return []


@reads(".series", label="ParaView file series", holds="motion", names=_file_names)
def open_file_series(file: Path) -> MeshSeries:
    """Open the files that a ParaView file series names."""
    from spacemap_vtk.io.series import FileSeries

    return FileSeries(file, [(time, [file.parent / name]) for time, name in _read_entries(file)])


def _read_entries(file: Path) -> list[tuple[float, str]]:

    try:
        entries = json.loads(file.read_text(encoding="utf-8"))["files"]
        return [(float(entry["time"]), str(entry["name"])) for entry in entries]
    except (ArithmeticError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise InputError(f"{file}: not a ParaView file series: {error}", key="file") from None
