"""Curves as files."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

from spacemap_vtk.app.plots.curves import Curves
from spacemap_vtk.io.output import whole_file

_ROWS = (("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s2"))


def save_times(curves: Curves, path: Path) -> None:
    """Write what is plotted over time, in SI: a row for each time."""
    head = ["time [s]"]
    columns = [curves.times]
    for number in range(len(curves.points)):
        for row, (name, unit) in enumerate(_ROWS):
            for axis in range(3):
                head.append(f"{name} {'xyz'[axis]} of point {number + 1} [{unit}]")
                columns.append(curves.motion[row, number, :, axis])
    if curves.energies is not None:
        head += [f"{name} energy [J]" for name in ("kinetic", "strain", "dissipated", "total")]
        columns += list(curves.energies.T)
    _write(path, head, zip(*(column.tolist() for column in columns), strict=True))


def save_frequencies(curves: Curves, path: Path) -> None:
    """Write the frequency response, in SI: a row for each frequency."""
    head = ["frequency [Hz]"]
    columns = [curves.frequencies]
    for number in range(len(curves.points)):
        for axis in range(3):
            head.append(f"amplitude {'xyz'[axis]} of point {number + 1} [m]")
            columns.append(curves.response[number, :, axis])
    _write(path, head, zip(*(column.tolist() for column in columns), strict=True))


def _write(path: Path, head: list[str], rows: Iterable[tuple[float, ...]]) -> None:
    with whole_file(path) as file, open(file, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(head)
        writer.writerows(rows)
