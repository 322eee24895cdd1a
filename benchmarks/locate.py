"""Points located in tetrahedra per second: lattice, carved lattice and general mesh.

    python benchmarks/locate.py

Random points inside. The search structure of a general mesh is made once for each mesh, so its time
stands apart, and the next column has both together; vtkProbeFilter makes its own within its run and
also interpolates one array. libigl (in_element) and the volume mesh deformer of pytexgen (TexGen),
which tries one tetrahedron after the other, are measured where they are installed, with
"pip install libigl pytexgen".
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
from scipy.spatial import Delaunay
from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkProbeFilter

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import add_array, to_cells, to_points
from spacemap_vtk.embedding.locate import locate

POINTS, FEW = 4_000_000, 200_000
#: Cross-sections of a yarn, and points on each.
YARN = 20, 20


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


def texgen(vertices: np.ndarray, tetrahedra: np.ndarray) -> float | None:
    """Return the points per second of TexGen's deformer, if it is installed.

    It moves yarns alone: so one goes through the mesh, and the points of its sections count.
    """
    if importlib.util.find_spec("pytexgen") is None:
        return None
    import pytexgen.Core as core  # type: ignore[import-not-found]

    mesh, moves, deformer = core.CMesh(), core.XYZVector(), core.CTextileDeformerVolumeMesh()
    for vertex in vertices.tolist():
        mesh.AddNode(core.XYZ(*vertex))
        moves.append(core.XYZ(*vertex))
    for corners in tetrahedra.tolist():
        mesh.AddElement(core.CMesh.TET, corners)
    deformer.SetYarnMeshDisplacements(0, mesh, moves)
    yarn, textile = core.CYarn(), core.CTextile()
    for x in (0.1, 0.9):
        yarn.AddNode(core.CNode(core.XYZ(x, 0.5, 0.5)))
    yarn.AssignInterpolation(core.CInterpolationCubic(False))
    yarn.AssignSection(core.CYarnSectionConstant(core.CSectionEllipse(0.5, 0.3)))
    yarn.SetResolution(*YARN)
    textile.AddYarn(yarn)
    textile.AssignDomain(core.CDomainPlanes(core.XYZ(0, 0, 0), core.XYZ(1, 1, 1)))
    core.CTexGen.GetInstance().SetMessages(False)
    elapsed = seconds(lambda: deformer.DeformTextile(textile), 1)
    surface = core.CMesh()
    textile.GetYarn(0).AddSurfaceToMesh(surface)
    count = surface.GetNumNodes()
    farthest = max(surface.GetNode(i).x for i in range(count))
    if abs(farthest - 1.8) > 1e-6:
        raise RuntimeError("TexGen did not move the yarn as expected")
    return count / elapsed


def main() -> None:
    """Print the table."""
    rng = np.random.default_rng(0)
    points = rng.random((POINTS, 3))
    coarse, fine = (
        build_lattice((0, 1, 0, 1, 0, 1), (5, 5, 1)),
        build_lattice((0, 1, 0, 1, 0, 1), (28, 28, 26)),
    )
    vertices = rng.random((15_500, 3))
    general = vertices, Delaunay(vertices).simplices.astype(np.int64)
    heads = ("tetrahedra", "set-up", "points/s", "with set-up", "vtkProbe", "libigl", "TexGen")
    print(f"{'mesh':<12}" + "".join(f"{head:>13}" for head in heads))
    for name, mesh in (("the paper's", coarse), ("lattice", fine), ("Delaunay", general)):
        # inside the hull of the Delaunay mesh
        inside = 0.03 + 0.94 * points if mesh is general else points
        setup = seconds(lambda mesh=mesh, some=inside[:1]: locate(some, *mesh))
        whole = seconds(lambda mesh=mesh, all_=inside: locate(all_, *mesh))
        rates = [
            POINTS / (whole - setup),
            POINTS / whole,
            probe(inside[:FEW], *mesh),
            libigl(inside[:FEW], *mesh),
            texgen(*mesh),
        ]
        texts = (f"{rate:.3g}" if rate else "absent" for rate in rates)
        print(
            f"{name:<12}{len(mesh[1]):>13}{setup:>12.2f}s"
            + "".join(f"{text:>13}" for text in texts)
        )


if __name__ == "__main__":
    main()
