"""Cells of any kind, out of files too, become tetrahedra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from test_cages import boundary_area, cage_of, check_mesh

import spacemap_vtk.accessor  # noqa: F401
from spacemap_vtk.cage import split
from spacemap_vtk.cage.split_quadratic import HEXAHEDRON, PYRAMID, TETRAHEDRON, WEDGE
from spacemap_vtk.datasets.arrays import tetrahedra_of
from spacemap_vtk.datasets.volume import split_into_tetrahedra
from spacemap_vtk.errors import GeometryError, InputError


def scrambled(grid: pv.UnstructuredGrid, seed: int) -> pv.UnstructuredGrid:
    """The same mesh with its points in another order."""
    order = np.random.default_rng(seed).permutation(grid.n_points)
    place = np.argsort(order)
    cells = grid.cells.copy()
    starts = np.concatenate(([0], np.cumsum(np.diff(grid.cell_offsets) + 1)[:-1]))
    points = np.ones(len(cells), dtype=bool)
    points[starts] = False
    cells[points] = place[cells[points]]
    return pv.UnstructuredGrid(cells, grid.celltypes, grid.points[order])


def box_of(kind: str) -> pv.UnstructuredGrid:
    grid = pv.ImageData(dimensions=(4, 3, 3)).cast_to_unstructured_grid()
    if kind == "voxel":
        return grid
    hexahedra = pv.StructuredGrid(
        *np.meshgrid(np.arange(4.0), np.arange(3.0), np.arange(3.0), indexing="ij")
    ).cast_to_unstructured_grid()
    corners = hexahedra.cells.reshape(-1, 9)[:, 1:]
    if kind == "hexahedron":
        return hexahedra
    if kind == "wedge":
        halves = corners[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
        return pv.UnstructuredGrid({pv.CellType.WEDGE: halves}, hexahedra.points)
    middles = np.arange(len(corners)) + hexahedra.n_points
    points = np.concatenate((hexahedra.points, hexahedra.points[corners].mean(axis=1)))
    faces = [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
    pyramids = np.concatenate(
        (corners[:, faces], np.broadcast_to(middles[:, None, None], (len(corners), 6, 1))), axis=2
    )
    return pv.UnstructuredGrid({pv.CellType.PYRAMID: pyramids.reshape(-1, 5)}, points)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["voxel", "hexahedron", "wedge", "pyramid"])
def test_split_cells_conform_and_fill_the_box(kind: str, seed: int) -> None:
    grid = scrambled(box_of(kind), seed)
    volume = split_into_tetrahedra(grid, "it")
    made = pv.wrap(volume.grid)
    np.testing.assert_array_equal(made.points, grid.points)  # numbers are kept
    tetrahedra = tetrahedra_of(made)
    assert check_mesh(made.points, tetrahedra) == pytest.approx(12.0, rel=1e-12)
    assert boundary_area(made.points, tetrahedra) == pytest.approx(2 * (6 + 6 + 4), rel=1e-12)
    assert volume.notes == []


def with_middles(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """The same cells with a node in the middle of each edge, shared by those that meet there."""
    curved = {10: (24, TETRAHEDRON), 12: (25, HEXAHEDRON), 13: (26, WEDGE), 14: (27, PYRAMID)}
    number: dict[frozenset[int], int] = {}
    points, cells, kinds = list(grid.points), [], []
    for kind, table in grid.cells_dict.items():
        made, shape = curved[kind]
        for corners in table.tolist():
            nodes = list(corners)
            for one, two in shape.edges:
                ends = frozenset((corners[one], corners[two]))
                if ends not in number:
                    number[ends] = len(points)
                    points.append(grid.points[list(ends)].mean(axis=0))
                nodes.append(number[ends])
            cells += [len(nodes), *nodes]
            kinds.append(made)
    return pv.UnstructuredGrid(cells, kinds, np.array(points, dtype=float))


def mixed_box() -> pv.UnstructuredGrid:
    """Hexahedra, wedges and pyramids that share faces."""
    corners = box_of("hexahedron").cells.reshape(-1, 9)[:, 1:]
    grid = box_of("pyramid")
    cells: list[int] = []
    kinds: list[int] = []
    for i, nodes in enumerate(corners.tolist()):
        if i % 3 == 0:
            cells += [8, *nodes]
            kinds.append(12)
        elif i % 3 == 1:
            for half in ([0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]):
                cells += [6, *(nodes[k] for k in half)]
                kinds.append(13)
        else:
            for pyramid in grid.cells_dict[14][6 * i : 6 * i + 6].tolist():
                cells += [5, *pyramid]
                kinds.append(14)
    return pv.UnstructuredGrid(cells, kinds, grid.points).clean()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["tetrahedron", "hexahedron", "wedge", "pyramid", "mixed"])
def test_quadratic_cells_are_split_at_their_middles(kind: str, seed: int) -> None:
    linear = mixed_box() if kind == "mixed" else box_of(kind) if kind != "tetrahedron" else None
    if linear is None:
        linear = pv.wrap(split_into_tetrahedra(box_of("hexahedron"), "it").grid)
    grid = scrambled(with_middles(linear), seed)
    volume = split_into_tetrahedra(grid, "it")
    made = pv.wrap(volume.grid)
    np.testing.assert_array_equal(made.points, grid.points)  # all of them, by their numbers
    tetrahedra = tetrahedra_of(made)
    assert check_mesh(made.points, tetrahedra) == pytest.approx(12.0, rel=1e-12)
    assert boundary_area(made.points, tetrahedra) == pytest.approx(2 * (6 + 6 + 4), rel=1e-12)
    assert volume.notes == []
    per_cell = {"tetrahedron": 8, "hexahedron": 22}
    if kind in per_cell:
        assert made.n_cells == per_cell[kind] * grid.n_cells


@pytest.mark.parametrize("shape", ["QuadraticWedge", "QuadraticPyramid", "QuadraticHexahedron"])
def test_midpoints_are_numbered_as_in_vtk(shape: str) -> None:
    grid = getattr(pv.examples.cells, shape)()
    kind = {"QuadraticWedge": WEDGE, "QuadraticPyramid": PYRAMID}.get(shape, HEXAHEDRON)
    corners = kind.nodes - len(kind.edges)
    cell = grid.GetCell(0)
    found = [
        [cell.GetEdge(i).GetPointId(k) for k in range(3)] for i in range(cell.GetNumberOfEdges())
    ]
    assert {(frozenset(edge[:2]), edge[2]) for edge in found} == {
        (frozenset(edge), corners + i) for i, edge in enumerate(kind.edges)
    }


def test_a_hexahedron_of_27_nodes_becomes_eight() -> None:
    grid = pv.examples.cells.TriQuadraticHexahedron()
    made = pv.wrap(split_into_tetrahedra(grid, "it").grid)
    np.testing.assert_array_equal(made.points, grid.points)
    assert made.n_cells == 48
    assert check_mesh(made.points, tetrahedra_of(made)) == pytest.approx(1.0, rel=1e-12)
    assert boundary_area(made.points, tetrahedra_of(made)) == pytest.approx(6.0, rel=1e-12)


def test_displacements_in_the_middles_of_edges_count() -> None:
    """A bar of two cells that bends: corners alone would miss the arc between them."""
    grid = with_middles(box_of("hexahedron"))
    sag = np.zeros_like(grid.points)
    sag[:, 2] = 0.1 * grid.points[:, 0] ** 2
    probe = pv.PolyData(np.array([[0.5, 1.0, 1.0], [1.5, 1.0, 1.0], [2.5, 2.0, 1.0]]))
    moved = probe.spacemap.deform(grid, sag, outside="error")
    np.testing.assert_allclose(moved["displacement"][:, 2], [0.025, 0.225, 0.625], atol=1e-6)


def test_corners_are_used_next_to_linear_cells() -> None:
    quadratic = pv.examples.cells.QuadraticHexahedron()
    grid = quadratic.merge(pv.examples.cells.Hexahedron().translate((5, 0, 0)))
    grid["number"] = np.arange(28)
    volume = split_into_tetrahedra(grid, "it")
    made = pv.wrap(volume.grid)
    assert (made.n_points, made.n_cells) == (16, 12)
    np.testing.assert_array_equal(made["number"], made["original_point"])
    assert "12 points without a tetrahedron were left out" in volume.notes[0]


def test_a_cage_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "cage.vtu"
    box_of("hexahedron").save(file)
    cage, grid = cage_of(pv.Sphere(), method="file", file=file)
    assert grid.n_cells == 6 * 12
    assert cage.warnings == ()
    with pytest.raises(InputError, match=r"cage.file.*needs a file"):
        cage_of(pv.Sphere(), method="file")
    with pytest.raises(InputError, match="no such file"):
        cage_of(pv.Sphere(), method="file", file=tmp_path / "none.vtu")
    pv.Sphere().save(tmp_path / "surface.vtp")
    with pytest.raises(GeometryError, match=r"is not a volume mesh.*tetwild"):
        cage_of(pv.Sphere(), method="file", file=tmp_path / "surface.vtp")


def test_inverted_and_flat_tetrahedra_are_repaired_and_reported() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [1, 1, 1.0]])
    cells = np.array([[0, 1, 2, 3], [1, 2, 3, 5], [0, 1, 2, 4], [0, 1, 1, 3]])
    cells[1] = cells[1][[1, 0, 2, 3]]
    volume = split_into_tetrahedra(pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points), "it")
    assert volume.grid.GetNumberOfCells() == 2
    assert volume.notes == [
        "it: 1 inverted tetrahedra were corrected",
        "it: 2 flat tetrahedra were left out",
        "it: 1 points without a tetrahedron were left out",
    ]
    with pytest.raises(GeometryError, match="all 1 tetrahedra are flat"):
        split_into_tetrahedra(pv.UnstructuredGrid({pv.CellType.TETRA: cells[2:3]}, points), "it")
    triangle = pv.UnstructuredGrid({pv.CellType.TRIANGLE: cells[:1, :3]}, points)
    with pytest.raises(GeometryError, match="no cells with a volume"):
        split_into_tetrahedra(triangle, "it")
    polyhedron = pv.examples.cells.Polyhedron()
    with pytest.raises(GeometryError, match=r"types \[42\]"):
        split_into_tetrahedra(polyhedron, "it")
    points[3] = np.nan
    with pytest.raises(GeometryError, match="point 3 is not finite"):
        split_into_tetrahedra(pv.UnstructuredGrid({pv.CellType.TETRA: cells[:1]}, points), "it")


def test_orientation_of_every_split() -> None:
    rng = np.random.default_rng(0)
    for corners, cut in split.SPLITS.items():
        assert len(np.unique(cut(rng.permutation(corners)[None]))) == corners
