"""A unit cell by a conformal mesh in CalculiX, against the same cell in voxels.

    pip install gmsh
    python benchmarks/conformal_cell.py [size in mm]    # 0.3 by default

Gmsh (GPL) meshes yarns and matrix with quadratic tetrahedra, whose faces are curved as the yarns
are; opposite faces of the cell have the same nodes. CalculiX (`ccx`) solves six unit strains with
its direct solver, which takes a minute or more for each; its iterative solver stops so early that
C12 is 1 % off. Only the materials come from spacemap_vtk: geometry, mesh, periodic equations and
solver do not.

A plain weave with pitches of 1.6 mm in a cell of 3.2 × 3.2 × 0.8 mm: sections are ellipses of
1.2 × 0.36 mm in planes across the cloth. The axis is level at a crown for 0.8 mm, then
z = ±A cos(π u / 2), with A = 0.2 mm and u from 0 to 2 over 0.8 mm. Glass (72 GPa, ν 0.22) in a
matrix (3.5 GPa, ν 0.35), packing 0.65, yarns by Chamis's formulas with the same packing everywhere.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from spacemap_vtk.unit_cell.homogenise import homogenise
from spacemap_vtk.unit_cell.mixtures import Constituent, chamis
from spacemap_vtk.unit_cell.phases import assign_materials
from spacemap_vtk.unit_cell.rasterise import rasterise

#: Pitch, half width and half height of a section, crimp amplitude, half length of a level crown,
#: size of the cell, all in mm.
PITCH, HALF_WIDTH, HALF_HEIGHT, AMPLITUDE, CROWN = 1.6, 0.6, 0.18, 0.2, 0.4
SIZE = np.array([3.2, 3.2, 0.8])
CORNER = np.array([-PITCH / 2, -PITCH / 2, -0.4])
MATRIX = Constituent.isotropic(3.5e9, 0.35, 0.0, 1200.0)
YARN = chamis(Constituent.isotropic(72e9, 0.22, 0.0, 2540.0), MATRIX, 0.65)
#: Direction across which it lies, and sign, of each yarn: wefts along x, then warps along y.
YARNS = [(family, number) for family in (0, 1) for number in (0, 1)]
#: Elliptic sections between which Gmsh interpolates one pitch.
SECTIONS = 16
STRAIN = 1e-3
#: Corners of the edges of a tetrahedron, in Gmsh's order of their middles.
EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1))
#: Entries of the stiffness that are printed.
SHOWN = ((0, 0), (0, 1), (0, 2), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5))
PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def axis_of(along: Any, family: int, number: int) -> tuple[Any, Any]:
    """Return height and slope of the axis of a yarn at a coordinate along it."""
    place = np.mod(np.asarray(along) + PITCH / 2, 2 * PITCH) - PITCH / 2
    is_first = place < PITCH / 2
    place = np.where(is_first, place, place - PITCH)
    ramp = PITCH / 2 - CROWN
    u = np.clip((abs(place) - CROWN) / ramp, 0.0, 1.0)
    sign = np.where(is_first, 1.0, -1.0) * (-1) ** (family + number)
    slope = -np.sin(np.pi / 2 * u) * np.pi / 2 / ramp * np.sign(place)
    return sign * AMPLITUDE * np.cos(np.pi / 2 * u), sign * AMPLITUDE * slope


def make_mesh(size: float) -> tuple[Any, Any, Any]:
    """Mesh the cell: nodes [mm], quadratic tetrahedra, and the yarn of each (−1: matrix)."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    shapes = gmsh.model.occ
    yarns = []
    for family, number in YARNS:
        loops = []
        for along in np.linspace(-PITCH / 2, 3 * PITCH / 2, 2 * SECTIONS + 1):
            height = float(axis_of(along, family, number)[0])
            across = number * PITCH
            centre = (along, across, height) if family == 0 else (across, along, height)
            # The ellipse's own axes: x across the yarn, z along it.
            normal, major = ((1, 0, 0), (0, 1, 0)) if family == 0 else ((0, 1, 0), (1, 0, 0))
            curve = shapes.addEllipse(
                *centre, HALF_WIDTH, HALF_HEIGHT, zAxis=list(normal), xAxis=list(major)
            )
            loops.append(shapes.addCurveLoop([curve]))
        made = shapes.addThruSections(loops, makeSolid=True, continuity="C2")
        yarns.append(next(one for one in made if one[0] == 3))
    box = (3, shapes.addBox(*CORNER, *SIZE))
    _, parts = shapes.fragment([box], yarns)
    shapes.synchronize()
    yarn_of = {tag: number for number, part in enumerate(parts[1:]) for _, tag in part}
    # Opposite faces, each with its image on the near side.
    for axis in range(3):
        low, high = CORNER.copy(), CORNER + SIZE
        high[axis] = low[axis]
        near = gmsh.model.getEntitiesInBoundingBox(*(low - 1e-4), *(high + 1e-4), dim=2)
        shift = np.zeros(3)
        shift[axis] = SIZE[axis]
        for face in near:
            ends = np.array(gmsh.model.getBoundingBox(*face)).reshape(2, 3) + shift
            far = gmsh.model.getEntitiesInBoundingBox(*(ends[0] - 1e-4), *(ends[1] + 1e-4), dim=2)
            far = [other for other in far if same_bounds(gmsh, other, ends)]
            move = np.eye(4)
            move[:3, 3] = shift
            gmsh.model.mesh.setPeriodic(2, [far[0][1]], [face[1]], move.ravel().tolist())
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.4 * size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", round(2.0 / size))
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.model.mesh.generate(3)
    tags, places, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, np.int64)
    number[tags] = np.arange(len(tags))
    places = places.reshape(-1, 3)
    outer = (abs(places - CORNER) < 1e-6) | (abs(places - CORNER - SIZE) < 1e-6)
    cells, owner, straightened = [], [], 0
    for _, tag in gmsh.model.getEntities(3):
        _, elements, nodes = gmsh.model.mesh.getElements(3, tag)
        cells.append(number[nodes[0]].reshape(-1, 10))
        # Elements that their curved sides turn inside out get straight ones.
        folded = np.array(gmsh.model.mesh.getElementQualities(elements[0], "minSJ")) < 0.05
        for cell in cells[-1][folded]:
            for edge, (a, b) in enumerate(EDGES, 4):
                if not outer[cell[edge]].any():
                    places[cell[edge]] = (places[cell[a]] + places[cell[b]]) / 2
        straightened += int(folded.sum())
        owner.append(np.full(len(cells[-1]), yarn_of.get(tag, -1)))
    gmsh.finalize()
    print(f"{straightened} elements with straight sides")
    cell = np.concatenate(cells)
    used, back = np.unique(cell, return_inverse=True)
    # Gmsh numbers the middles of the last two edges the other way round.
    cell = back.reshape(cell.shape)[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    return places[used], cell, np.concatenate(owner)


def same_bounds(gmsh: Any, face: tuple[int, int], ends: Any) -> bool:
    """Return whether a face has a bounding box."""
    own = np.array(gmsh.model.getBoundingBox(*face)).reshape(2, 3)
    return bool(np.allclose(own, ends, atol=1e-4))


def write_deck(file: Path, nodes: Any, cells: Any, owner: Any) -> None:
    """Write the deck of six unit strains, in m."""
    with file.open("w") as deck:
        deck.writelines(f"{line}\n" for line in deck_lines(nodes, cells, owner))


def deck_lines(nodes: Any, cells: Any, owner: Any) -> Iterator[str]:
    """Yield the lines of the deck."""
    count = len(nodes)
    yield "*NODE, NSET=ALL"
    for n, place in enumerate((1e-3 * nodes).tolist(), 1):
        yield f"{n}, {place[0]:.12g}, {place[1]:.12g}, {place[2]:.12g}"
    yield "*NODE, NSET=DRIVERS"
    yield from (f"{count + 1 + axis}, {axis + 1}e-2, 0, 0" for axis in range(3))
    for name, chosen in (("YARN", owner >= 0), ("MATRIX", owner < 0)):
        yield f"*ELEMENT, TYPE=C3D10, ELSET={name}"
        for n in np.flatnonzero(chosen):
            yield f"{n + 1}, {', '.join(map(str, cells[n] + 1))}"
    compliance = np.linalg.inv(YARN.stiffness)
    moduli = 1 / np.diag(compliance)
    ratio = [-compliance[i, j] / compliance[i, i] for i, j in ((0, 1), (0, 2), (1, 2))]
    yield "*MATERIAL, NAME=YARN\n*ELASTIC, TYPE=ENGINEERING CONSTANTS"
    first = [*moduli[:3], *ratio, moduli[5], moduli[4]]
    yield f"{', '.join(f'{value:.12g}' for value in first)}\n{moduli[3]:.12g}"
    yield f"*MATERIAL, NAME=MATRIX\n*ELASTIC\n{MATRIX.axial_modulus}, {MATRIX.axial_poisson}"
    yield "*DISTRIBUTION, NAME=AXES\n, 1., 0., 0., 0., 1., 0."
    middle = nodes[cells[:, :4]].mean(axis=1)
    for n in np.flatnonzero(owner >= 0):
        family, number = YARNS[owner[n]]
        _, slope = axis_of(middle[n, family], family, number)
        axis = np.array([1.0 - family, family, slope])
        other = np.array([-family, 1.0 - family, 0.0])
        yield f"{n + 1}, {', '.join(f'{value:.12g}' for value in (*axis, *other))}"
    yield "*ORIENTATION, NAME=FIBRES\nAXES"
    yield "*SOLID SECTION, ELSET=YARN, MATERIAL=YARN, ORIENTATION=FIBRES"
    yield "*SOLID SECTION, ELSET=MATRIX, MATERIAL=MATRIX"
    # A node on far faces moves as its image, but for the displacements of the drivers.
    far = abs(nodes - CORNER - SIZE) < 1e-6
    away, image_of = cKDTree(nodes).query(nodes - far * SIZE)
    assert away.max() < 1e-5, f"nodes of opposite faces differ by {away.max():.1e} mm"
    for n in np.flatnonzero(far.any(axis=1)):
        beyond = np.flatnonzero(far[n])
        for way in (1, 2, 3):
            terms = [
                (n + 1, 1),
                (image_of[n] + 1, -1),
                *((count + 1 + axis, -1) for axis in beyond),
            ]
            yield f"*EQUATION\n{len(terms)}"
            yield ", ".join(f"{node}, {way}, {size}" for node, size in terms)
    fixed = int(np.flatnonzero((abs(nodes - CORNER) < 1e-6).all(axis=1))[0]) + 1
    for i, j in PAIRS:
        strain = np.zeros((3, 3))
        strain[i, j] += STRAIN / 2
        strain[j, i] += STRAIN / 2
        yield f"*STEP\n*STATIC\n*BOUNDARY, OP=NEW\n{fixed}, 1, 3"
        for axis, way in product(range(3), repeat=2):
            moved = strain[way, axis] * 1e-3 * SIZE[axis]
            yield f"{count + 1 + axis}, {way + 1}, {way + 1}, {moved:.13g}"
        yield "*NODE PRINT, NSET=ALL\nRF\n*END STEP"


def read_stiffness(file: Path, nodes: Any) -> Any:
    """Compute the stiffness from the nodal forces: ∫ σ dV = Σ f x."""
    columns, rows = [], []
    for line in [*file.read_text().splitlines(), "forces"]:
        if "forces" in line:
            if rows:
                table = np.array(rows)
                force = table[:, 1:]
                place = 1e-3 * nodes[table[:, 0].astype(int) - 1]
                stress = force.T @ place / (1e-9 * SIZE.prod())
                columns.append([(stress[i, j] + stress[j, i]) / 2 for i, j in PAIRS])
            rows = []
        elif line.strip():
            rows.append([float(word) for word in line.split()])
    return np.array(columns).T / STRAIN


def voxel_stiffness(count: int) -> tuple[Any, float]:
    """Return the stiffness of the cell in voxels, and the share of yarn."""
    shape = (count, count, 5 * count // 8)
    s = np.linspace(-PITCH, 2 * PITCH, 12 * SECTIONS + 1)
    turn = np.linspace(0, 2 * np.pi, 129)
    points, tangents = [], []
    for family, number in YARNS:
        height, slope = axis_of(s, family, number)
        along = np.broadcast_to(s, (len(turn), len(s)))
        across = number * PITCH + HALF_WIDTH * np.cos(turn)[:, None] + 0 * along
        up = height + HALF_HEIGHT * np.sin(turn)[:, None]
        tangent = np.broadcast_to(np.stack([0 * s + 1, 0 * s, slope], -1), (*up.shape, 3))
        order = slice(None, None, -1) if family else slice(None)
        swap = [1, 0, 2] if family else [0, 1, 2]
        points.append(np.stack([along, across, up], -1)[order][..., swap])
        tangents.append(tangent[order][..., swap])
    spacing = SIZE / shape
    voxels = rasterise(
        (np.array(points) - CORNER) / spacing,
        np.array(tangents),
        np.ones((4, len(turn), len(s))),
        np.arange(4),
        shape,
    )
    phases = assign_materials(voxels, spacing, lambda _: YARN, MATRIX)
    return homogenise(phases, spacing)[0].stiffness, float(voxels.fraction.mean())


def main() -> None:
    """Print the stiffness of both, and the share of yarn."""
    size = float(sys.argv[1]) if len(sys.argv) > 1 else 0.3

    def show(name: str, stiffness: Any) -> None:
        print(
            f"{name}: "
            + ", ".join(f"C{i + 1}{j + 1} {stiffness[i, j] / 1e9:.4f}" for i, j in SHOWN)
        )

    for count in (64, 128):
        voxels, share = voxel_stiffness(count)
        show(f"{count} voxels, share of yarn {share:.5f}", voxels)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        nodes, cells, owner = make_mesh(size)
        corners = nodes[cells[:, :4]]
        volume = abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
        share = volume[owner >= 0].sum() / SIZE.prod()
        print(
            f"mesh of {size} mm: {len(nodes)} nodes, {len(cells)} tetrahedra, straight-sided share "
            f"of yarn {share:.5f}, {time.perf_counter() - start:.0f} s",
            flush=True,
        )
        write_deck(Path(folder) / "cell.inp", nodes, cells, owner)
        done = subprocess.run(
            ["ccx", "cell"], cwd=folder, capture_output=True, text=True, check=True
        )
        if "Job finished" not in done.stdout:
            sys.exit(done.stdout[-3000:])
        mesh = read_stiffness(Path(folder) / "cell.dat", nodes)
        show(f"CalculiX, {time.perf_counter() - start:.0f} s", mesh)
        print(
            "voxels over mesh: "
            + ", ".join(f"{100 * (voxels[i, j] / mesh[i, j] - 1):+.2f} %" for i, j in SHOWN)
        )


if __name__ == "__main__":
    main()
