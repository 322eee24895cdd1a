"""Series of files, one or several for each time, as ParaView lists them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import reads

if TYPE_CHECKING:
    from spacemap_vtk.io.series import MeshSeries


@reads(".pvd", label="ParaView collection", holds="motion")
def open_collection(file: Path) -> MeshSeries:
    """Open the files that a collection names."""
    from xml.etree import ElementTree

    from spacemap_vtk.io.series import FileSeries

    try:
        root = ElementTree.parse(file).getroot()
        steps: dict[float, list[Path]] = {}
        for entry in root.iter("DataSet"):
            time = float(entry.get("timestep", "0"))
            steps.setdefault(time, []).append(file.parent / entry.attrib["file"])
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise InputError(f"{file}: no ParaView collection: {error}", key="file") from None
    return FileSeries(file, list(steps.items()))


@reads(".series", label="ParaView file series", holds="motion")
def open_file_series(file: Path) -> MeshSeries:
    """Open the files that a file series names."""
    import json

    from spacemap_vtk.io.series import FileSeries

    try:
        entries = json.loads(file.read_text(encoding="utf-8"))["files"]
        steps = [(float(entry["time"]), [file.parent / entry["name"]]) for entry in entries]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: no file series: {error}", key="file") from None
    return FileSeries(file, steps)
