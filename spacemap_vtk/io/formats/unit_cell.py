"""Write unit cells of composites: VTK's images and grids, and decks of CalculiX and Abaqus."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.formats.vtk_xml import write_xml
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import record_comments
from spacemap_vtk.io.registry import writes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from spacemap_vtk.unit_cell.mixtures import Constituent
    from spacemap_vtk.unit_cell.phases import UnitCellModel

#: Components of a strain as displacements of the driver nodes: pairs of driver and direction.
_DRIVEN = (((0, 0),), ((1, 1),), ((2, 2),), ((1, 2), (2, 1)), ((0, 2), (2, 0)), ((0, 1), (1, 0)))
_NOTES = """
One repeat of a textile in a matrix, in voxels: each has the material of the larger share.
Units: m, N, Pa. Nodes on opposite faces move alike, but for the displacements of three driver
nodes (sets DRIVER_X, DRIVER_Y, DRIVER_Z): that of DRIVER_X is the strain times the first edge of
the cell, and so on. Each of the six steps has one strain of 1e-3; shear strains are the
engineering ones.
How to read the stiffness:
"""
_READ = {
    "calculix": """
All elements have one size, so that the mean of the printed stresses over all of them, divided by
1e-3, is the column of the stiffness for the strain of the step. CalculiX prints stresses in the
order xx, yy, zz, xy, xz, yz, here in the axes of the cell.
""",
    "abaqus": """
The reaction forces of the driver nodes over the areas of the faces of the cell are the mean
stresses (DRIVER_X: xx, xy, xz); divided by 1e-3 they are the column of the stiffness for the
strain of the step.
""",
}
#: Endings of voxels as VTK stores them.
VOXELS = (".vti", ".vtu")
#: Ending of the constants of each cell of a sheet.
MAP = ".vtp"
#: The imposed strain.
STRAIN = 1e-3


@writes(".vti", label="VTK image", holds=("unit_cell",))
def write_vti(file: Path, model: UnitCellModel) -> None:
    """Write the voxels as an image."""
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

    write_xml(file, vtkXMLImageDataWriter(), _image(model))


@writes(".vtu", label="VTK grid", holds=("unit_cell",))
def write_vtu(file: Path, model: UnitCellModel) -> None:
    """Write the voxels as hexahedra."""
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    append = vtkAppendFilter()
    append.SetInputData(_image(model))
    append.Update()
    write_xml(file, vtkXMLUnstructuredGridWriter(), append.GetOutput())


def _image(model: UnitCellModel) -> Any:
    from vtkmodules.vtkCommonDataModel import vtkImageData

    from spacemap_vtk.datasets.arrays import add_array
    from spacemap_vtk.datasets.voxel_image import fill_image

    image = vtkImageData()
    fill_image(image, model.voxels, model.spacing, model.packing, model.gradient)
    for name, values in model.fields.items():
        add_array(image.GetCellData(), name, values)
    return image


@writes(".inp", label="CalculiX and Abaqus", holds=("unit_cell",))
def write_deck(file: Path, model: UnitCellModel) -> None:
    """Write nodes, elements, materials, periodic equations and six load steps."""
    write_parts(file, (f"{line}\n".encode() for line in _deck(model)))


def _deck(model: UnitCellModel) -> Iterator[str]:
    import numpy as np

    from spacemap_vtk.unit_cell.mixtures import COMPONENTS
    from spacemap_vtk.unit_cell.phases import deformed_areas

    depth, rows, width = model.voxels.fraction.shape
    nodes = np.arange((depth + 1) * (rows + 1) * (width + 1)).reshape(
        depth + 1, rows + 1, width + 1
    )
    drivers = [nodes.size + 1 + axis for axis in range(3)]
    yield f"** {' '.join(model.title.split())}: unit cell (spacemap_vtk)"
    yield from record_comments("**")
    text = _NOTES.strip() + _READ[model.solver]
    yield from (f"** {line}" for line in text.strip().splitlines())
    yield "*NODE"
    sizes = (width, rows, depth)
    z, y, x = np.unravel_index(np.arange(nodes.size), nodes.shape)
    gradient = np.eye(3) if model.gradient is None else model.gradient
    places = np.stack([x, y, z], axis=1) * model.spacing @ gradient.T
    yield from (f"{n}, {_numbers(row)}" for n, row in enumerate(places.tolist(), 1))
    for axis, driver in enumerate(drivers):
        place = 1.2 * sizes[axis] * model.spacing[axis] * gradient[:, axis]
        yield f"{driver}, {_numbers(place.tolist())}"
    for name, driver in zip("XYZ", drivers, strict=True):
        yield f"*NSET, NSET=DRIVER_{name}\n{driver}"
    yield "*ELEMENT, TYPE=C3D8, ELSET=CELL"
    corners = ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0))
    order = [*corners, *((1, b, a) for _, b, a in corners)]
    elements = np.stack(
        [nodes[c : depth + c, b : rows + b, a : width + a].ravel() + 1 for c, b, a in order], axis=1
    )
    yield from (f"{n}, {', '.join(map(str, row))}" for n, row in enumerate(elements.tolist(), 1))
    yarn = (model.voxels.fraction >= 0.5).ravel()
    area = model.voxels.area.ravel()
    sections = deformed_areas(area, model.voxels.base, model.gradient)
    sections = np.where(yarn, sections, 0.0)
    for number, section in enumerate(np.unique(sections)):
        name = f"YARN{number}" if section else "MATRIX"
        chosen = np.flatnonzero(sections == section) + 1
        yield f"*ELSET, ELSET={name}"
        for start in range(0, len(chosen), 12):
            yield ", ".join(map(str, chosen[start : start + 12])) + ","
        yield f"*MATERIAL, NAME={name}"
        yield from _elastic(model.yarn(float(section)) if section else model.matrix)
        orientation = ""
        if section:
            orientation = ", ORIENTATION=FIBRES"
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}{orientation}"
    if yarn.any():
        if model.solver == "abaqus":
            yield "*DISTRIBUTION TABLE, NAME=DIRECTIONS\nCOORD3D, COORD3D"
            yield "*DISTRIBUTION, NAME=AXES, LOCATION=ELEMENT, TABLE=DIRECTIONS"
        else:
            yield "*DISTRIBUTION, NAME=AXES"
        yield ", 1., 0., 0., 0., 1., 0."
        axes = model.voxels.direction.reshape(-1, 3) @ gradient.T
        for number in np.flatnonzero(yarn).tolist():
            axis = axes[number] / np.linalg.norm(axes[number])
            other = np.eye(3)[np.argmin(abs(axis))]
            other = other - (other @ axis) * axis
            yield f"{number + 1}, {_numbers([*axis, *other / np.linalg.norm(other)])}"
        turn = "\n3, 0." if model.solver == "abaqus" else ""
        yield f"*ORIENTATION, NAME=FIBRES\nAXES{turn}"
    yield from _equations(nodes, drivers)
    yield f"*BOUNDARY\n{nodes[0, 0, 0] + 1}, 1, 3"
    lengths = [count * size for count, size in zip(sizes, model.spacing.tolist(), strict=True)]
    for number, (name, driven) in enumerate(zip(COMPONENTS, _DRIVEN, strict=True)):
        change = ", OP=NEW" if number else ""
        yield f"*STEP\n** unit strain {name}\n*STATIC\n*BOUNDARY{change}"
        yield f"{nodes[0, 0, 0] + 1}, 1, 3"
        strain = np.zeros((3, 3))
        for row, column in driven:
            strain[row, column] = STRAIN / len(driven)
        moved = strain @ gradient
        for axis, way in product(range(3), repeat=2):
            value = float(moved[way, axis]) * lengths[axis]
            yield f"{drivers[axis]}, {way + 1}, {way + 1}, {value:.13g}"
        if model.solver == "abaqus":
            yield from (f"*NODE PRINT, NSET=DRIVER_{axis}\nRF" for axis in "XYZ")
        else:
            yield "*EL PRINT, ELSET=CELL, GLOBAL=YES\nS"
        yield "*END STEP"


def _elastic(material: Constituent) -> Iterator[str]:
    """Yield the engineering constants; axis 1 runs along the fibres."""
    import numpy as np

    if material.is_isotropic:
        yield "*ELASTIC"
        yield _numbers([material.axial_modulus, material.axial_poisson])
        return
    compliance = np.linalg.inv(material.stiffness)
    e1, e2, e3, g23, g13, g12 = (1 / np.diag(compliance)).tolist()
    nu12, nu13, nu23 = (-compliance[i, j] / compliance[i, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS"
    yield _numbers([e1, e2, e3, nu12, nu13, nu23, g12, g13])
    yield _numbers([g23])


def _equations(nodes: NDArray[Any], drivers: list[int]) -> Iterator[str]:
    """Yield the equations that tie each node of a far face to its image."""
    import numpy as np

    ends = [count - 1 for count in nodes.shape]
    for place in np.argwhere(np.ones(nodes.shape, bool)):
        beyond = [2 - axis for axis in range(3) if place[axis] == ends[axis]]
        if not beyond:
            continue
        image = tuple(int(p) % end for p, end in zip(place, ends, strict=True))
        own, other = nodes[tuple(place)] + 1, nodes[image] + 1
        for way in (1, 2, 3):
            terms = [(own, 1.0), (other, -1.0), *((drivers[axis], -1.0) for axis in beyond)]
            yield f"*EQUATION\n{len(terms)}"
            yield ", ".join(f"{node}, {way}, {size:g}" for node, size in terms)


def _numbers(values: Any) -> str:
    # CalculiX reads no number of more than 20 characters.
    return ", ".join(f"{value:.12g}" for value in values)
