"""Write input files of CalculiX and Abaqus (.inp): modes of a cage, and its state under loads.

CalculiX integrates the consistent mass of linear tetrahedra with one point, and of quadratic ones
with four. These are too few, so its frequencies approach ours only as the cage is refined. A lumped
mass is written as point masses; then the frequencies are equal. CalculiX reads no number of more
than 20 characters.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import find_record_in_comments, finds_record, record_comments
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from spacemap_vtk.datasets.modal_model import InputDeck
    from spacemap_vtk.mechanics.modal.model import Model

#: Node order that swaps the first two corners of a tetrahedron, which turns it inside out.
_SWAPPED_NODES = {4: [1, 0, 2, 3], 10: [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]}
#: Share of the density that tetrahedra keep if their mass is at the vertices; CalculiX refuses a
#: density of zero.
_TINY_DENSITY = 1e-12
_ORIENTATION = "*ORIENTATION, NAME=FABRIC\n1., 0., 0., 0., 1., 0."


_MASS_NOTE = (
    "CalculiX integrates a consistent mass with few points, so its frequencies differ for a coarse "
    'cage; with [modal] mass = "lumped" they are equal'
)


def _mode_count(analysis: InputDeck) -> int:
    # CalculiX computes with five times as many vectors as modes, and a small cage has too few.
    return min(analysis.modes, max(1, int(analysis.model.free.sum()) // 6))


def _losses(analysis: InputDeck) -> list[str]:
    found, modes = list(analysis.left_out), _mode_count(analysis)
    if modes < analysis.modes:
        found.append(
            f"only {modes} of {analysis.modes} modes: CalculiX finds no more in so small a cage"
        )
    return [*found, *([] if analysis.model.lumped else [_MASS_NOTE])]


@writes(".inp", label="CalculiX and Abaqus", holds=("analysis",), loses=_losses)
def write_inp(file: Path, analysis: InputDeck) -> None:
    """Write mesh, materials, supports and loads, and the steps that compute modes and statics."""

    write_parts(file, (f"{line}\n".encode() for line in _deck_lines(analysis)))


def _deck_lines(analysis: InputDeck) -> Iterator[str]:
    import numpy as np

    model = analysis.model
    yield f"** {' '.join(analysis.title.split())} (spacemap_vtk)"
    yield from record_comments("**")
    yield "** Units: m, kg, s, N, Pa; frequencies in 1/s. x is the weft, y the warp, z upwards."
    yield from (f"** Note: {text}." for text in _losses(analysis))
    yield "*NODE, NSET=ALL"
    yield from _numbered_rows(model.points)
    yield from _element_lines(model)
    yield "*BOUNDARY"
    held = ~model.free.reshape(-1, 3)
    for node in np.flatnonzero(held.any(axis=1)):
        yield from (f"{node + 1}, {axis + 1}" for axis in np.flatnonzero(held[node]))
    yield f"*STEP\n*FREQUENCY\n{_mode_count(analysis)}\n*NODE FILE\nU\n*END STEP"
    gravity, forces = analysis.gravity, analysis.forces
    if gravity.any() and model.lumped:
        forces = forces + np.outer(model.nodal_mass, gravity)
    loaded = np.argwhere(np.where(held, 0.0, forces) != 0)
    heavy = gravity.any() and not model.lumped
    if not heavy and not len(loaded):
        return
    yield "*STEP\n*STATIC"
    if heavy:
        size = float(np.linalg.norm(gravity))
        yield f"*DLOAD\nCAGE, GRAV, {_format_row([size, *gravity / size])}"
    if len(loaded):
        yield "*CLOAD"
        yield from (f"{node + 1}, {axis + 1}, {forces[node, axis]:.13g}" for node, axis in loaded)
    yield "*NODE FILE\nU\n*EL FILE\nS\n*END STEP"


def _element_lines(model: Model) -> Iterator[str]:
    """Yield tetrahedra, and a material for each pair of factors of stiffness and density."""
    import numpy as np

    cells, nodes = model.cells.copy(), model.cells.shape[1]
    edges = model.points[cells[:, 1:4]] - model.points[cells[:, :1]]
    turned = np.linalg.det(edges) < 0
    cells[turned] = cells[turned][:, _SWAPPED_NODES[nodes]]
    ones = np.ones(len(cells))
    given = model.fittings.stiffness_factors, model.fittings.mass_factors
    factors = np.stack([ones if each is None else each for each in given], axis=1)
    kinds, which = np.unique(factors, axis=0, return_inverse=True)
    which = which.reshape(-1)
    density = model.density * (_TINY_DENSITY if model.lumped else 1.0)
    for kind in range(1, len(kinds) + 1):
        yield f"*ELEMENT, TYPE=C3D{nodes}, ELSET=PART{kind}"
        for number in np.flatnonzero(which == kind - 1):
            yield f"{number + 1}, " + ", ".join(map(str, cells[number] + 1))
    yield "*ELSET, ELSET=CAGE\n" + "\n".join(f"PART{k}," for k in range(1, len(kinds) + 1))
    yield _ORIENTATION
    for kind, (stiff, heavy) in enumerate(kinds, 1):
        yield f"*MATERIAL, NAME=MATERIAL{kind}"
        yield from _elastic_lines(stiff * model.elasticity)
        yield f"*DENSITY\n{heavy * density:.13g}"
        yield f"*SOLID SECTION, ELSET=PART{kind}, MATERIAL=MATERIAL{kind}, ORIENTATION=FABRIC"
    if model.lumped:
        # Equal masses share a set, because CalculiX searches all sets for each one.
        sizes, which = np.unique([f"{mass:.13g}" for mass in model.nodal_mass], return_inverse=True)
        for kind, size in enumerate(sizes, 1):
            yield f"*ELEMENT, TYPE=MASS, ELSET=MASS{kind}"
            for node in np.flatnonzero(which.reshape(-1) == kind - 1) + 1:
                yield f"{len(cells) + node}, {node}"
            yield f"*MASS, ELSET=MASS{kind}\n{size}"


def _elastic_lines(elasticity: NDArray[Any]) -> Iterator[str]:
    """Yield a material's constants: E and ν, or three of each and three shear moduli."""
    import numpy as np

    from spacemap_vtk.mechanics.elements.materials import isotropic

    compliance = np.linalg.inv(elasticity)
    young = 1 / np.diag(compliance)[:3]
    ratios = [-compliance[i, j] * young[i] for i, j in ((0, 1), (0, 2), (1, 2))]
    if np.allclose(elasticity, isotropic(young[0], ratios[0]), rtol=1e-10, atol=0):
        yield f"*ELASTIC\n{_format_row([young[0], ratios[0]])}"
    else:
        shear = elasticity[[5, 4, 3], [5, 4, 3]]
        yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS"
        yield f"{_format_row([*young, *ratios, *shear[:2]])}\n{_format_row(shear[2:])}"


def _numbered_rows(rows: NDArray[Any]) -> Iterator[str]:
    return (f"{number}, {_format_row(row)}" for number, row in enumerate(rows.tolist(), 1))


def _format_row(values: Any) -> str:
    return ", ".join(f"{value:.13g}" for value in values)


finds_record(".inp")(find_record_in_comments)
