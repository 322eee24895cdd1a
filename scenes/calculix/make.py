"""Compute the motion of scenes/calculix_fabric.toml with CalculiX, and keep it as .pvd.

    python scenes/calculix/make.py

Needs the program ccx (Debian: calculix-ccx) and the package ccx2paraview. The sheet is the box
round that scene's fabric, of soft rubber, held by its top edge, and let go under gravity at t = 0
with geometric nonlinearity: it swings by more than a linear model can follow. Units are SI.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from ccx2paraview import Converter

HERE = Path(__file__).parent
HALF = np.array([1.8e-3, 1.8e-3, 0.3e-3])
DIVISIONS = np.array([8, 8, 2])
STEP, EVERY, COUNT = 1e-3, 2, 40


def deck() -> str:
    """Return CalculiX's input."""
    nx, ny, nz = DIVISIONS + 1
    axes = [np.linspace(a, b, n) for a, b, n in zip(-HALF, HALF, (nx, ny, nz), strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack((x, y, z), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(nz, ny, nx) + 1
    k, j, i = (a.ravel() for a in np.mgrid[: nz - 1, : ny - 1, : nx - 1])
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    cells = np.stack([number[k + c, j + b, i + a] for c in (0, 1) for a, b in corners], axis=1)
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{n}, {p[0]:.9g}, {p[1]:.9g}, {p[2]:.9g}" for n, p in enumerate(points, 1)]
    lines += ["*ELEMENT, TYPE=C3D8I, ELSET=SHEET"]
    lines += [f"{n}, {', '.join(map(str, cell))}" for n, cell in enumerate(cells, 1)]
    lines += ["*NSET, NSET=TOP"] + [f"{n}," for n in number[:, -1].ravel()]
    lines += [
        *("*BOUNDARY", "TOP, 1, 3"),
        *("*MATERIAL, NAME=RUBBER", "*ELASTIC", "1300., 0.3", "*DENSITY", "300."),
        *("*DAMPING, ALPHA=10.", "*SOLID SECTION, ELSET=SHEET, MATERIAL=RUBBER"),
        f"*STEP, NLGEOM, INC={COUNT + 1}",
        *("*DYNAMIC, DIRECT", f"{STEP}, {STEP * COUNT}"),
        *("*DLOAD", "SHEET, GRAV, 9.81, 0., -0.70711, 0.70711"),
        *(f"*NODE FILE, FREQUENCY={EVERY}", "U", "*END STEP"),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run CalculiX and keep what a scene needs of its result."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "sheet.inp").write_text(deck())
        subprocess.run(["ccx", "sheet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        Converter(str(folder / "sheet.frd"), ["vtu"]).run()
        reader = pv.get_reader(folder / "sheet.pvd")
        for old in HERE.glob("sheet*.vtu"):
            old.unlink()
        rest = reader.read()[0].copy()
        rest["U"] = np.zeros((rest.n_points, 3), dtype=np.float32)
        steps = [(0.0, rest)]
        for time in reader.time_values:
            reader.set_active_time_value(time)
            steps.append((time, reader.read()[0]))
        entries = []
        for count, (time, grid) in enumerate(steps):
            bare = pv.UnstructuredGrid(grid.cells, grid.celltypes, grid.points.astype(np.float32))
            bare["U"] = np.asarray(grid["U"], dtype=np.float32)
            bare.save(HERE / f"sheet_{count:02d}.vtu")
            entries.append(f'<DataSet timestep="{time:g}" file="sheet_{count:02d}.vtu"/>')
        text = "\n".join(entries)
        (HERE / "sheet.pvd").write_text(
            f'<VTKFile type="Collection" version="0.1">\n<Collection>\n{text}\n'
            "</Collection>\n</VTKFile>\n"
        )


if __name__ == "__main__":
    main()
