"""What comparisons with CalculiX (Debian's calculix-ccx) need: its program, its cards, its mass.

Its mass is under-integrated: with one point in linear tetrahedra (a sixteenth of the mass in all
sixteen entries), with four in quadratic ones.
"""

from __future__ import annotations

import shutil

import numpy as np
import scipy.sparse as sp

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints, shape_functions, volumes

CCX = shutil.which("ccx")
ABSENT = 'CalculiX is not installed ("apt-get install calculix-ccx")'


def mesh(divisions, order, bounds):
    """Return a lattice whose tetrahedra have a positive determinant, as CalculiX wants it."""
    points, cells = build_lattice(bounds, divisions)
    corners = points[cells]
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    cells[turned] = cells[turned][:, [1, 0, 2, 3]]
    return add_midpoints(points, cells) if order == 2 else (points, cells)


def cards(points, cells, held, elastic, density):
    """Return the lines of an input file that say mesh, material and supports, in fewest words."""
    kind = "C3D4" if cells.shape[1] == 4 else "C3D10"
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in enumerate(points.tolist(), 1)]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=CAGE")
    lines += [f"{n}, " + ", ".join(map(str, cell + 1)) for n, cell in enumerate(cells, 1)]
    lines += ["*MATERIAL, NAME=M", elastic, f"*DENSITY\n{density}"]
    lines += ["*SOLID SECTION, ELSET=CAGE, MATERIAL=M", "*BOUNDARY"]
    return lines + [f"{n + 1}, 1, 3" for n in np.flatnonzero(held)]


def their_mass(points, cells, density):
    """Return M as CalculiX integrates it."""
    if cells.shape[1] == 4:
        element = np.full((4, 4), 1 / 16)
    else:
        near, far = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
        shapes = shape_functions(np.full((4, 4), far) + (near - far) * np.eye(4))
        element = shapes.T @ shapes / 4
    nodes = cells.shape[1]
    rows, columns = np.repeat(cells, nodes, axis=1).ravel(), np.tile(cells, nodes).ravel()
    values = density * np.outer(volumes(points, cells), element).ravel()
    scalar = sp.csr_matrix((values, (rows, columns)), shape=(len(points),) * 2)
    return sp.kron(scalar, np.eye(3), format="csr")
