"""Write the mechanical model of a cage into arrays of its grid, and read model and modes back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkCommonCore import vtkDataArray, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import (
    add_array,
    add_text,
    array_of,
    elements_of,
    points_of,
    text_of,
)
from spacemap_vtk.mechanics.boundary.fittings import Fittings
from spacemap_vtk.mechanics.contact.obstacle_term import Contact
from spacemap_vtk.mechanics.contact.resting import report_contact, rested_terms
from spacemap_vtk.mechanics.elements.curve_law import CurveLaw
from spacemap_vtk.mechanics.elements.membrane_law import LinearLaw, MembraneLaw
from spacemap_vtk.mechanics.elements.plates import DataSheet, Plate
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, make_term
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.crimp.cloth_law import YarnLaw
from spacemap_vtk.textile.rods.cell_law import CellLaw, SetCellLaw

#: Name of the point array that holds a mode shape.
MODE_NAME = "mode_{:03d}"


#: Names of the field arrays of the material. A solid has its elasticity [Pa]. A sheet has
#: stiffnesses per width: membrane [N/m], bending [N m], transverse shear and thickness [N/m].
_SOLID = ("elasticity",)
_SHEET = ("membrane_stiffness", "bending_stiffness", "shear_stiffness", "thickness_stiffness")

#: Name of the field array that is 1 if a sheet's stiffness follows its local thickness.
_LOCAL = "local_thickness"

#: Name of the field array of a sheet's natural curvature [1/m].
_CURVATURE = "natural_curvature"

#: Names of the field arrays of a sheet's law: its kind, and the prefix of its own arrays.
_LAW, _LAW_ARRAY = "membrane_law", "membrane_law_{}"
#: Laws that can be read again, by kind.
_LAWS = {law.kind: law for law in (LinearLaw, YarnLaw, CurveLaw, CellLaw, SetCellLaw)}

#: Name of the field array of the gravity in the equilibrium, or after the cage's release [m/s²].
GRAVITY_IN_FORCE = "equilibrium_gravity"

#: Name of the field array that holds the recipes of energy terms as JSON.
_TERMS = "energy_terms"

#: Name of the field array of the anchors of friction at samples of obstacles [m].
ANCHORS = "contact_anchors"
#: Name of the field array of the displacements of obstacles [m].
_MOVES = "obstacle_displacement"
#: Names of the field arrays that report on each obstacle: force on it [N], number of samples that
#: touch it, largest penetration [m], and number of touching samples whose friction is at its limit.
_CONTACT = ("contact_force", "contact_points", "contact_penetration", "contact_sliding")

#: Array name of each fitting of a cage, and whether it is a cell array (else a point array).
_FITTING_ARRAYS = {
    "normals": ("fixed_directions", False),
    "bodies": ("rigid_body", False),
    "springs": ("spring_stiffness", False),
    "masses": ("point_mass", False),
    "stiffness_factors": ("stiffness_factor", True),
    "mass_factors": ("density_factor", True),
}

_OWNER = "the cage's motion (put a ModalSolver before it)"


class InputDeck(NamedTuple):
    """A modal and static analysis, written as an input file for another solver."""

    title: str
    model: Model
    #: Number of modes, the lowest first.
    modes: int
    #: Acceleration of gravity of the static step [m/s²], (3,).
    gravity: Floats
    #: Other forces of the static step on the vertices [N], (V, 3).
    forces: Floats
    #: Sentences about parts of the scene that the analysis does not contain.
    left_out: list[str]


def add_model(grid: vtkUnstructuredGrid, model: Model, gravity: Sequence[float]) -> None:
    """Write supports, fittings, material and equilibrium of a model into arrays of its grid."""
    held = (~model.free).reshape(-1, 3).astype(np.uint8)
    data = grid.GetPointData()
    given = model.fittings.given
    inclined = given["normals"].any(axis=(1, 2)) if "normals" in given else False
    add_array(data, "fixed", held.max(axis=1) | inclined)
    for key, (name, of_cells) in _FITTING_ARRAYS.items():
        table = grid.GetCellData() if of_cells else data
        table.RemoveArray(name)  # an earlier ModalSolver in the pipeline may have written it
        if key in given:
            add_array(table, name, given[key].reshape(len(given[key]), -1))
    add_array(data, "fixed_components", held)
    add_array(data, "nodal_mass", model.nodal_mass)
    field = grid.GetFieldData()
    for name, part in zip(_SHEET if model.plate else _SOLID, model.stiffness_parts, strict=True):
        add_array(field, name, np.atleast_1d(part))
    field.RemoveArray(_LOCAL)
    field.RemoveArray(_CURVATURE)
    if model.plate is not None:
        add_array(field, _LOCAL, np.array([model.plate.follows_thickness], dtype=np.uint8))
        if model.plate.curvature is not None:
            add_array(field, _CURVATURE, model.plate.curvature)
    _add_law(grid, None if model.plate is None else model.plate.law)
    add_array(field, "density", np.array([model.density]))
    add_array(field, "lumped", np.array([model.lumped], dtype=np.uint8))
    if model.displacement is not None:
        add_array(data, "equilibrium", model.displacement)
    if model.displacement is not None or any(gravity):
        add_array(field, GRAVITY_IN_FORCE, np.array(gravity, dtype=np.float64))


def _add_law(grid: vtkUnstructuredGrid, law: MembraneLaw | None) -> None:
    """Write the law of a sheet's membrane into field arrays, in place of an earlier one."""
    field, prefix = grid.GetFieldData(), _LAW_ARRAY.format("")
    names = [field.GetArrayName(k) or "" for k in range(field.GetNumberOfArrays())]
    for name in names:
        if name == _LAW or name.startswith(prefix):
            field.RemoveArray(name)
    if law is None:
        return
    add_text(field, _LAW, law.kind)
    for name, values in law.arrays.items():
        # VTK's arrays have at most two dimensions.
        add_array(field, _LAW_ARRAY.format(name), np.atleast_1d(values))


def _law_of(grid: vtkUnstructuredGrid) -> MembraneLaw | None:
    """Return the law of a sheet's membrane; None if it is linear."""
    field, prefix = grid.GetFieldData(), _LAW_ARRAY.format("")
    kind = text_of(field, _LAW)
    if kind is None:
        return None
    names = [field.GetArrayName(k) or "" for k in range(field.GetNumberOfArrays())]
    arrays = {
        name.removeprefix(prefix): array_of(field, name, _OWNER)
        for name in names
        if name.startswith(prefix)
    }
    return _LAWS[kind](**arrays)


def add_terms(
    grid: vtkUnstructuredGrid,
    recipes: Sequence[Mapping[str, Any]],
    anchors: Floats | None = None,
) -> None:
    """Write the recipes of energy terms as JSON, and the anchors of friction."""
    for name in (_TERMS, ANCHORS):
        grid.GetFieldData().RemoveArray(name)
    if anchors is not None and len(anchors):
        add_array(grid.GetFieldData(), ANCHORS, anchors)
    if recipes:
        array = vtkStringArray()
        array.SetName(_TERMS)
        for recipe in recipes:
            array.InsertNextValue(json.dumps(recipe))
        grid.GetFieldData().AddArray(array)


def terms_of(grid: vtkUnstructuredGrid) -> list[EnergyTerm]:
    """Return the additional energy terms with which a cage's modes were computed."""
    array = grid.GetFieldData().GetAbstractArray(_TERMS)
    count = 0 if array is None else array.GetNumberOfValues()
    points, cells = points_of(grid).astype(np.float64, copy=False), elements_of(grid)
    terms = [make_term(json.loads(array.GetValue(k)), points, cells) for k in range(count)]
    moved = grid.GetPointData().GetArray("equilibrium")
    if moved is None or grid.GetFieldData().GetArray(ANCHORS) is None:
        return terms
    positions = points + array_of(grid.GetPointData(), "equilibrium", _OWNER)
    return rested_terms(terms, positions, array_of(grid.GetFieldData(), ANCHORS, _OWNER))


def bodies_of(grid: vtkUnstructuredGrid) -> list[dict[str, Any]]:
    """Return shape and place of each obstacle of a cage, see `filters.obstacle.Obstacle.body`."""
    # Stages that step in time add how far each obstacle has moved.
    array = grid.GetFieldData().GetAbstractArray(_TERMS)
    count = 0 if array is None else array.GetNumberOfValues()
    recipes = [json.loads(array.GetValue(k)) for k in range(count)]
    bodies = [recipe["body"] for recipe in recipes if recipe["kind"] == "obstacle"]
    if bodies and grid.GetFieldData().HasArray(_MOVES):
        moves = array_of(grid.GetFieldData(), _MOVES, _OWNER)
        for body, move in zip(bodies, moves, strict=True):
            body["center"] = (np.array(body["center"]) + move).tolist()
    return bodies


def add_obstacle_moves(grid: vtkUnstructuredGrid, moves: Floats) -> None:
    """Write how far each obstacle has moved [m], (n, 3)."""
    add_array(grid.GetFieldData(), _MOVES, moves)


def add_contact(grid: vtkUnstructuredGrid, model: Model) -> None:
    """Write what each obstacle and the cage do to each other into field arrays."""
    field, found = grid.GetFieldData(), report_contact(model)
    for name in _CONTACT:
        field.RemoveArray(name)
    if found:
        for name, values in zip(_CONTACT, zip(*found, strict=True), strict=True):
            add_array(field, name, np.array(values))


def contact_of(grid: vtkUnstructuredGrid) -> list[Contact]:
    """Return what each obstacle and the cage do to each other, in the order of obstacles."""
    field = grid.GetFieldData()
    if field.GetArray(_CONTACT[0]) is None:
        return []
    columns = [array_of(field, name, _OWNER) for name in _CONTACT]
    return [
        Contact(force, int(points), float(depth), int(sliding))
        for force, points, depth, sliding in zip(*columns, strict=True)
    ]


def add_sheet(grid: vtkUnstructuredGrid, sheet: DataSheet) -> None:
    """Write each figure of a sheet into a field array of the same name."""
    for name, value in sheet._asdict().items():
        add_array(grid.GetFieldData(), name, np.atleast_1d(np.array(value, dtype=np.float64)))


def sheet_of(grid: vtkUnstructuredGrid) -> DataSheet | None:
    """Return the figures of the sheet as which ModalSolver treats a cage; None for tetrahedra."""
    field = grid.GetFieldData()
    if field.GetArray("bending_length") is None:
        return None
    arrays = (array_of(field, name, _OWNER) for name in DataSheet._fields)
    found: list[Any] = [tuple(a.tolist()) if len(a) > 1 else a.item() for a in arrays]
    return DataSheet(*found)


def solver_results(grid: vtkUnstructuredGrid | None) -> dict[str, Any]:
    """Return ModalSolver's choice of elements and sheet figures by parameter; empty if not run."""
    if grid is None or not grid.GetFieldData().HasArray("eigenvalues"):
        return {}
    sheet = sheet_of(grid)
    return {"elements": "tetrahedra"} if sheet is None else {"elements": "sheet", **sheet._asdict()}


def gravity_of(grid: vtkUnstructuredGrid) -> Floats:
    """Return the gravity of a cage's equilibrium [m/s²], (3,); zero without an equilibrium."""
    if not grid.GetPointData().HasArray("equilibrium"):
        return np.zeros(3)
    return array_of(grid.GetFieldData(), GRAVITY_IN_FORCE, _OWNER)


def model_of(grid: vtkUnstructuredGrid) -> Model:
    """Return the mechanical model with which a cage's modes were computed."""
    # The model shares matrices and factors with an equal model that ModalSolver or another owner
    # still holds. Otherwise they are computed at first use.
    field, data = grid.GetFieldData(), grid.GetPointData()
    material: Floats | Plate
    if field.GetArray(_SHEET[0]) is None:
        material = array_of(field, _SOLID[0], _OWNER)
    else:
        membrane, bending, shear, thickness = (array_of(field, name, _OWNER) for name in _SHEET)
        material = Plate(
            membrane.reshape(3, 3),
            bending.reshape(3, 3),
            shear.reshape(2, 2),
            float(thickness[0]),
            bool(array_of(field, _LOCAL, _OWNER)[0]),
            _law_of(grid),
            array_of(field, _CURVATURE, _OWNER) if field.HasArray(_CURVATURE) else None,
        )
    fitted = {
        key: array_of(table, name, _OWNER)
        for key, (name, of_cells) in _FITTING_ARRAYS.items()
        if (table := grid.GetCellData() if of_cells else data).GetArray(name) is not None
    }
    for key in ("normals", "springs"):
        if key in fitted:
            fitted[key] = fitted[key].reshape(-1, 3, 3)
    hung = data.GetArray("equilibrium") is not None
    return Model(
        points_of(grid).astype(np.float64, copy=False),
        elements_of(grid),
        material,
        float(array_of(field, "density", _OWNER)[0]),
        array_of(data, "fixed_components", _OWNER) != 0,
        bool(array_of(field, "lumped", _OWNER)[0]),
        array_of(data, "equilibrium", _OWNER) if hung else None,
        Fittings(**fitted),
        terms_of(grid),
    )


def rounding_of(grid: vtkUnstructuredGrid) -> Floats:
    """Return the relative rounding error of each eigenvalue; zeros if it is not stored."""
    field = grid.GetFieldData()
    if field.GetArray("eigenvalue_rounding") is None:
        return np.zeros(len(array_of(field, "eigenvalues", "the modes")))
    return array_of(field, "eigenvalue_rounding", "the modes")


class ModesReader:
    """Read modes from a grid; shapes are read again only when their arrays change."""

    def __init__(self) -> None:
        self._changed = -1
        self._arrays: list[vtkDataArray] = []
        self._times: list[int] = []
        self._modes: CageModes | None = None

    def read(self, grid: vtkUnstructuredGrid) -> CageModes:
        """Return the modes in ModalSolver's output."""
        if self._modes is None or self._changed != grid.GetMTime():
            data = grid.GetPointData()
            eigenvalues = array_of(grid.GetFieldData(), "eigenvalues", _OWNER)
            names = [MODE_NAME.format(k) for k in range(len(eigenvalues))]
            arrays = [data.GetArray(name) for name in names]
            times = [array.GetMTime() for array in arrays if array is not None]
            if self._modes is not None and times == self._times and self._same(arrays):
                shapes = self._modes.shapes
            else:
                found = [array_of(data, name, _OWNER) for name in names]
                shapes = np.stack(found).reshape(len(found), -1)
            self._changed, self._arrays, self._times = grid.GetMTime(), arrays, times
            self._modes = CageModes(model_of(grid), eigenvalues, shapes, rounding_of(grid))
        return self._modes

    def _same(self, arrays: list[vtkDataArray]) -> bool:
        # `==` on VTK arrays compares element by element like numpy's, so identity is tested.
        return len(arrays) == len(self._arrays) and all(
            a is b for a, b in zip(arrays, self._arrays, strict=True)
        )
