"""The middles of yarns as a table (.csv), for spreadsheets and other programs' curves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import MovingSurface

_COLUMNS = "yarn,point,x [m],y [m],z [m],width [m],red,green,blue"


@writes(".csv", label="Table", holds=("yarns",))
def write_csv(file: Path, surface: MovingSurface) -> None:
    """Write a row for each control point of each yarn's cubic Bézier curves, end to end."""
    from spacemap_vtk.io.output import write

    curves = surface.curves
    if curves is None:
        raise InputError("there are no yarns to write", key="what", cure="Write a .vtu.")
    rows, points = [_COLUMNS], iter(curves.points[0].tolist())
    for yarn, count in enumerate(curves.counts.tolist()):
        look = f"{curves.widths[yarn]:.6g},{','.join(map(str, curves.colors[yarn].tolist()))}"
        for place in range(count):
            x, y, z = next(points)
            rows.append(f"{yarn},{place},{x:.9g},{y:.9g},{z:.9g},{look}")
    write(file, ["\n".join(rows).encode(), b"\n"])
