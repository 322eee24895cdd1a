"""Points located in tetrahedra per second: lattice, carved lattice and general mesh.

    python benchmarks/locate.py

Random points inside. The search structure of a general mesh is made once for each mesh, so its time
stands apart; vtkProbeFilter makes its own within its run and also interpolates one array. libigl
(in_element) is measured where it is installed.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
from scipy.spatial import Delaunay
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkProbeFilter

from spacemap_vtk.cage.lattice import lattice
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.filters.arrays import add_array, to_cells, to_points

POINTS, FEW = 4_000_000, 200_000


def seconds(run: Callable[[], object], repeats: int = 2) -> float:
    """Return the least time of a few calls."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def probe(points: np.ndarray, vertices: np.ndarray, tetrahedra: np.ndarray) -> float:
    """Return vtkProbeFilter's points per second."""
    grid, cloud, filter_ = vtkUnstructuredGrid(), vtkPolyData(), vtkProbeFilter()
    grid.SetPoints(to_points(vertices))
    grid.SetCells(VTK_TETRA, to_cells(tetrahedra))
    add_array(grid.GetPointData(), "displacement", vertices)
    cloud.SetPoints(to_points(points))
    filter_.SetInputData(cloud)
    filter_.SetSourceData(grid)
    return len(points) / seconds(filter_.Update, 1)


def libigl(points: np.ndarray, vertices: np.ndarray, tetrahedra: np.ndarray) -> float | None:
    """Return the points per second of libigl's AABB tree, if it is installed."""
    if importlib.util.find_spec("igl") is None:
        return None
    import igl  # type: ignore[import-not-found]

    tree = igl.AABB()
    tree.init(vertices, tetrahedra)
    return len(points) / seconds(lambda: igl.in_element(vertices, tetrahedra, points, tree), 1)


def main() -> None:
    """Print the table."""
    rng = np.random.default_rng(0)
    points = rng.random((POINTS, 3))
    coarse, fine = lattice((0, 1, 0, 1, 0, 1), (5, 5, 1)), lattice((0, 1, 0, 1, 0, 1), (28, 28, 26))
    vertices = rng.random((15_500, 3))
    general = vertices, Delaunay(vertices).simplices.astype(np.int64)
    print(
        f"{'mesh':<22}{'tetrahedra':>11}{'set-up':>9}{'points/s':>11}{'vtkProbe':>11}{'libigl':>11}"
    )
    for name, mesh in (("the paper's", coarse), ("lattice", fine), ("Delaunay", general)):
        # inside the hull of the Delaunay mesh
        inside = 0.03 + 0.94 * points if mesh is general else points
        setup = seconds(lambda mesh=mesh, some=inside[:1]: locate(some, *mesh))
        rate = POINTS / (seconds(lambda mesh=mesh, all_=inside: locate(all_, *mesh)) - setup)
        theirs = probe(inside[:FEW], *mesh)
        other = libigl(inside[:FEW], *mesh)
        print(
            f"{name:<22}{len(mesh[1]):>11}{setup:>8.2f}s{rate:>11.3g}{theirs:>11.3g}"
            + (f"{other:>11.3g}" if other else f"{'-':>11}")
        )


if __name__ == "__main__":
    main()
