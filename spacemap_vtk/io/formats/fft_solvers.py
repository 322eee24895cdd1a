"""Write unit cells of composites for solvers on grids by Fourier transforms: DAMASK and FANS.

Each voxel has the material of the larger share, and directions of fibres are rounded, so that the
list of materials stays short.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.unit_cell import STRAIN
from spacemap_vtk.io.formats.vtk_hdf import ErrorKeepingFile
from spacemap_vtk.io.formats.vtk_xml import write_xml
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import (
    NAME,
    find_record_in_comments,
    finds_record,
    record_comments,
    record_text,
)
from spacemap_vtk.io.registry import require_package, writes

if TYPE_CHECKING:
    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: Endings of the grids next to the materials of DAMASK and FANS.
_GRIDS = {".yaml": ".vti", ".json": ".h5"}
_HDF5 = require_package("h5py", "h5py", "Run: pip install 'spacemap_vtk[hdf5]', or write a .yaml.")
#: FANS numbers phases by unsigned integers of 16 bits.
_MOST_PHASES = 2**16
#: FANS orders the components of strain as xx, yy, zz, xy, xz, yz, in Mandel's notation: shear
#: strains are √2 times those of the tensor.
_MANDEL = (0, 1, 2, 5, 4, 3)


def _require_room(file: Path) -> None:
    """Refuse to replace a file that is not the grid of an earlier output of the same name."""
    grid = file.with_suffix(_GRIDS[file.suffix.lower()])
    if grid.exists() and not file.exists():
        raise InputError(
            f"{file}: its grid belongs in {grid}, which exists", cure="Choose another name."
        )


def _require_room_and_hdf5(file: Path) -> None:
    _HDF5(file)
    _require_room(file)


@writes(".yaml", label="DAMASK", holds=("unit_cell",), require=_require_room)
def write_damask(file: Path, model: UnitCellModel) -> None:
    """Write phases and materials, and the grid of material numbers into a .vti next to them."""
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

    from spacemap_vtk.datasets.arrays import add_array
    from spacemap_vtk.unit_cell.phases import list_materials

    model = _box_of(file, model)
    numbers, areas, axes = list_materials(model)
    image = vtkImageData()
    image.SetDimensions(*(count + 1 for count in reversed(numbers.shape)))
    image.SetSpacing(*model.spacing)
    add_array(image.GetCellData(), "material", numbers.ravel())
    write_xml(file.with_suffix(_GRIDS[".yaml"]), vtkXMLImageDataWriter(), image)
    lines = _damask(model, areas, axes)
    write_parts(file, (f"{line}\n".encode() for line in lines))


finds_record(".yaml")(find_record_in_comments)


def _damask(model: UnitCellModel, areas: Any, axes: Any) -> Iterator[str]:
    """Yield the lines of DAMASK's material configuration."""
    import numpy as np

    yield f"# {' '.join(model.title.split())}: unit cell (spacemap_vtk)"
    yield from record_comments("#")
    yield "homogenization:\n  single:\n    N_constituents: 1\n    mechanical: {type: pass}"
    yield "phase:"
    c = model.matrix.stiffness
    constants = {"C_11": c[0, 0], "C_12": c[0, 1], "C_44": c[3, 3]}
    yield from _damask_phase("matrix", "lattice: cF", constants)
    sections, kinds = np.unique(areas, return_inverse=True)
    for number, section in enumerate(sections.tolist()):
        # A hexagonal lattice is transversely isotropic about its axis c, here that of the fibres.
        c = model.yarn(section).stiffness
        constants = {"C_11": c[1, 1], "C_12": c[1, 2], "C_13": c[0, 1], "C_33": c[0, 0]}
        constants["C_44"] = c[5, 5]
        # DAMASK requires c/a, which elasticity does not use.
        yield from _damask_phase(f"yarn{number}", "lattice: hP\n    c/a: 1.633", constants)
    yield "material:"
    turns = np.stack([1 + axes[:, 2], -axes[:, 1], axes[:, 0], np.zeros(len(axes))], axis=1)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    phases = ["matrix", *(f"yarn{kind}" for kind in kinds.ravel().tolist())]
    for phase, turn in zip(phases, [[1.0, 0.0, 0.0, 0.0], *turns.tolist()], strict=True):
        # The rotation from z, the axis c, to the fibres.
        quaternion = ", ".join(f"{part:.15f}" for part in turn)
        yield "  - homogenization: single\n    constituents:"
        yield f"      - {{phase: {phase}, v: 1.0, O: [{quaternion}]}}"


def _damask_phase(name: str, lattice: str, constants: dict[str, float]) -> Iterator[str]:
    yield f"  {name}:\n    {lattice}\n    mechanical:\n      output: [F, P]"
    values = ", ".join(f"{key}: {value:.15e}" for key, value in constants.items())
    yield f"      elastic: {{type: Hooke, {values}}}\n      plastic: {{type: none}}"


@writes(".json", label="FANS", holds=("unit_cell",), require=_require_room_and_hdf5)
def write_fans(file: Path, model: UnitCellModel) -> None:
    """Write materials and six load cases, and the grid of phases into a .h5 next to them."""
    import h5py
    import numpy as np

    from spacemap_vtk.unit_cell.mixtures import turn_stiffness
    from spacemap_vtk.unit_cell.phases import list_materials
    from spacemap_vtk.unit_cell.voxel_elasticity import symmetric

    model = _box_of(file, model)
    numbers, areas, axes = list_materials(model)
    if len(areas) >= _MOST_PHASES:
        raise InputError(
            f"{file}: {len(areas) + 1} materials are more than FANS can number",
            allowed=f"at most {_MOST_PHASES}",
            cure="Lower unit_cell.voxels.",
        )
    stiffness = np.empty((1 + len(areas), 6, 6))
    stiffness[0] = model.matrix.stiffness
    for area in np.unique(areas):
        own = areas == area
        stiffness[1:][own] = symmetric(turn_stiffness(model.yarn(float(area)), axes[own]).T)
    weight = np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    stiffness = stiffness[:, _MANDEL][:, :, _MANDEL] * np.outer(weight, weight)
    grid = file.with_suffix(_GRIDS[".json"])
    with ErrorKeepingFile(grid, "w+") as sink:
        try:
            with h5py.File(sink, "w") as made:
                made["phases"] = numbers.astype(np.uint16)
                made["phases"].attrs["permute_order"] = "zyx"
        finally:
            sink.check()
    lengths = model.spacing * numbers.shape[::-1]
    content = {
        "title": f"{' '.join(model.title.split())}: unit cell (spacemap_vtk)",
        **({NAME: record_text()} if record_text() else {}),
        "microstructure": {
            "filepath": grid.name,
            "datasetname": "/phases",
            "L": lengths.tolist(),
        },
        "problem_type": "mechanical",
        "strain_type": "small",
        "materials": [
            {
                "phases": list(range(len(stiffness))),
                "matmodel": "LinearElasticTriclinic",
                "material_properties": {
                    f"C_{i + 1}{j + 1}": stiffness[:, i, j].tolist()
                    for i in range(6)
                    for j in range(i, 6)
                },
            }
        ],
        "FE_type": "HEX8",
        "method": "cg",
        "error_parameters": {"measure": "L2", "type": "relative", "tolerance": 1e-6},
        "n_it": 1000,
        "macroscale_loading": [[row] for row in (STRAIN * np.eye(6)).tolist()],
        "results": ["stress_average", "strain_average"],
    }
    write_parts(file, [json.dumps(content, indent=1).encode(), b"\n"])


@finds_record(".json")
def find_record_in_json(file: Path) -> str | None:
    """Find the record among the keys, of which FANS reads only its own."""
    found = json.loads(file.read_text(encoding="utf-8"))[NAME]
    return found if isinstance(found, str) else None


def _box_of(file: Path, model: UnitCellModel) -> UnitCellModel:
    """Return a cell that is at most pressed in a mould, as voxels of its own height."""
    import numpy as np

    if model.gradient is None:
        return model
    factors = np.diagonal(model.gradient)
    if abs(model.gradient - np.diag(factors)).max() > 1e-12:
        raise InputError(
            f"{file}: a grid of this solver has right angles, which the cell has not",
            key="unit_cell.shear",
            allowed="0, and a textile whose repeat has right angles",
            cure="Write a deck (.inp).",
        )
    turned = model.voxels.direction * factors
    length = np.linalg.norm(turned, axis=-1, keepdims=True)
    turned = np.divide(turned, length, out=np.zeros_like(turned), where=length > 0)
    area = model.voxels.area * factors.prod()
    voxels = replace(model.voxels, direction=turned, area=area)
    return replace(model, voxels=voxels, spacing=model.spacing * factors, gradient=None)
