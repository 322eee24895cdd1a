"""What the walk over pipelines needs: values of parameters, and what fresh stages make of them.

The values are made from what parameters declare; all are small and quick.
"""

from __future__ import annotations

import hashlib
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy

import spacemap_vtk
from spacemap_vtk import connect
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.parameters import Choice, Flag, Integer, Parameter, Real, Series, Vector

STAGES = {name: getattr(spacemap_vtk, name) for name in spacemap_vtk.FILTERS}
#: Number of results that are kept.
KNOWN = 500

#: Typical values by unit, where a parameter has no default.
TYPICAL = {"m": 3e-4, "1/m": 2e3, "Pa": 1e6, "N/m": 1e3, "N.m": 1e-6, "N": 1e-3, "N.m2": 1e-9}
TYPICAL |= {"N.m/kg": 1e6, "kg/m3": 300.0, "kg/m2": 0.1, "kg/m": 2e-5, "s": 1e-4, "deg": 30.0}
#: Values of parameters whose range does not give useful, small and repeatable ones.
VALUES: dict[str, list[Any]] = {
    "pattern": ["plain", "twill 2/1", "satin 5/2", "basket 2", ["10", "01"]],
    "ends": [1, 2, 3],
    "picks": [1, 2, 3],
    "warp_yarn": ["20/2 cotton", ["20/2 cotton", "30 tex silk"]],
    "weft_yarn": ["16/2 linen"],
    "warp_plies": [1, 3, [1, 2]],
    "weft_plies": [1, 3, [1, 2]],
    "trim": [False],
    "method": ["lattice", "carved", "file"],
    "divisions": [(1, 1, 1), (2, 1, 1), (1, 2, 1), (1, 1, 2)],
    "margin": [0, 1],
    "modes": [1, 3, 6, 1000],
    "fixed": ["+y", "-x +y", "-z:z +y", "", "sphere(0, 0, 0, 1)"],
    "held": ["", "-x"],
    "rigid": ["", "-y"],
    "springs": ["", "-z:z 1e5 N/m3"],
    "masses": ["", "-y 1e-6 kg"],
    "stiffness_factors": ["", "no such array"],
    "density_factors": ["", "no such array"],
    "dead_loads": [[], [{"force": (0, 0, -1e-6), "at": (0, 0, 0)}]],
    "loads": [[], [{"pressure": 1.0, "on": "+z"}], [{"force": (1e-6, 0, 0), "at": (0, 0, 0)}]],
    "gravity": [(0, 0, 0), (0, 0, -9.80665), (1, 2, 3)],
    "damping_ratio": [0.02, [0.01, 0.5]],
    "damping_pairs": [[(10, 0.02), (80, 0.03)]],
    "initial_velocity_array": ["", "velocity"],
    "initial_displacement_array": ["", "displacement"],
    "tolerance": [1e-2, 1e-3],
    "max_step": [1e-3, 1e-4],
    "frames": [0, 1, 5],
    "array": ["displacement", "no such array"],
    "carried": ["", "velocity von_mises"],
    "subdivisions": [1, 2, 3],
}
#: Initial values that make every stage small.
SMALL: dict[str, dict[str, Any]] = {
    "WeaveSource": {"ends": 2, "picks": 2},
    "TetraCage": {"divisions": (1, 1, 1)},
    "ModalSolver": {"modes": 3},
    "PatchTessellator": {"subdivisions": 1},
    "TransientResponse": {"tolerance": 1e-2},
}


def write_inputs(folder: Path) -> dict[str, list[Any]]:
    """Write objects, a cage and a moving cage; return paths for each stage, one of them missing."""
    pv.Sphere(radius=1e-3, theta_resolution=4, phi_resolution=4).save(folder / "ball.ply")
    pv.Cube(x_length=2e-3, y_length=1e-3, z_length=1e-3).save(folder / "cube.ply")
    corners = 1e-2 * np.eye(4, 3) - 2e-3
    cell = pv.UnstructuredGrid(np.array([4, 0, 1, 2, 3]), [pv.CellType.TETRA], corners)
    cell.save(folder / "cage.vtu")
    for step in range(3):
        cell["displacement"] = 1e-4 * step * np.arange(12.0).reshape(4, 3)
        cell.field_data["TimeValue"] = [1e-4 * step]
        cell.save(folder / f"step_{step}.vtu")
    return {
        "ObjectSource": [folder / "ball.ply", folder / "cube.ply", folder / "missing"],
        "TetraCage": [folder / "cage.vtu", folder / "missing"],
        "MotionReader": [folder / "step_*.vtu", folder / "missing"],
    }


def in_range(parameter: Parameter[Any]) -> list[Any]:
    """Return values in a declared range: typical ones, and its ends."""
    if isinstance(parameter, Series):
        values = in_range(parameter.component)
        return [*values, values[:2]] if values else []
    if isinstance(parameter, Vector):
        each = in_range(parameter.component)
        size = len(parameter.labels)
        return [tuple(each[(k + shift) % len(each)] for k in range(size)) for shift in (0, 1)]
    if isinstance(parameter, Flag):
        return [False, True]
    if isinstance(parameter, Choice):
        return list(parameter.choices)
    if isinstance(parameter, Real):
        usual = getattr(parameter, "default", None)  # a component has none
        if not usual:
            usual = 1 if isinstance(parameter, Integer) else TYPICAL.get(parameter.unit, 0.3)
        usual = max(usual, parameter.minimum or 0)
        free = parameter.maximum is None and parameter.below is None
        ends = [end for end in (parameter.minimum, parameter.maximum) if end is not None]
        return [usual, (2 if free or isinstance(parameter, Integer) else 0.5) * usual, *ends]
    return ["#102030", (1, 2, 3)] if parameter.kind == "color" else []


def values_of(parameter: Parameter[Any], files: list[Any]) -> list[Any]:
    """Return values that a parameter accepts."""
    values = VALUES.get(parameter.name) or in_range(parameter)
    if parameter.kind == "file":
        values = files if parameter.name == "file" else []
    return values + [None, "auto"] * bool(parameter.automatic)


def wrong_values(parameter: Parameter[Any]) -> list[Any]:
    """Return values that must be refused."""
    wrong: list[Any] = [object(), {"a": 1}]
    if isinstance(parameter, (Series, Vector)):
        wrong += [[], *([value] for value in wrong_values(parameter.component))]
    if isinstance(parameter, Real):
        wrong += [math.nan, -math.inf, True, "many", "1 parsec"]
        wrong += [1.5] if isinstance(parameter, Integer) else []
        wrong += [end for end in (parameter.above, parameter.below) if end is not None]
        wrong += [parameter.minimum - 1] if parameter.minimum is not None else []
        wrong += [parameter.maximum + 1] if parameter.maximum is not None else []
    if isinstance(parameter, (Flag, Choice)):
        wrong += [1, "nothing"]
    return wrong


def digest(data: Any) -> str:
    """Return a digest of all arrays of a data set, bit by bit and in order."""
    parts = [data.GetPoints().GetData()] if data.GetPoints() else []
    if data.IsA("vtkPolyData"):
        tables = [data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()]
    else:
        tables = [data.GetCells()]
        parts += [data.GetCellTypes()] if data.GetNumberOfCells() else []
    for table in tables:
        parts += [table.GetOffsetsArray(), table.GetConnectivityArray()]
    for held in (data.GetPointData(), data.GetCellData(), data.GetFieldData()):
        parts += [held.GetAbstractArray(k) for k in range(held.GetNumberOfArrays())]
    seen = hashlib.blake2b(data.GetClassName().encode(), digest_size=16)
    for part in parts:
        values = vtk_to_numpy(part)
        seen.update(f"{part.GetName()} {values.dtype} {values.shape}".encode())
        seen.update(np.ascontiguousarray(values).data)
    return seen.hexdigest()


def error_text(error: Exception) -> str:
    """Return the text of an error without the addresses in VTK's messages."""
    return f"{type(error).__name__}: " + re.sub(r"(0x|0000)[0-9a-fA-F]+", "", str(error))


#: Kind of stage, settings, the time that it ran at, and what its inputs held; "copy" of data.
Content = tuple[str, tuple[Any, ...], float | None, tuple[Any, ...]]
#: Digests and warnings of all stages of a content, or errors, each with the content that has it.
Made = tuple[dict[str, tuple[str, tuple[str, ...]]], dict[str, str]]


def key(content: Content) -> str:
    return hashlib.blake2b(repr(content).encode(), digest_size=16).hexdigest()


def build(content: Content, made: dict[Content, Any]) -> Any:
    """Return a stage or data that are made and connected for this content only."""
    if content not in made:
        kind, values, _, inputs = content
        above = [build(each, made) for each in inputs]
        if kind == "copy":
            data = above[0].update(inputs[0][2]).output
            stage = data.NewInstance()
            stage.ShallowCopy(data)
        else:
            stage = connect(tuple(above), STAGES[kind](**dict(values)))
        made[content] = stage
    return made[content]


def fresh(content: Content, known: dict[str, Made]) -> Made:
    """Return the results of stages that are made for this content only."""
    if (name := key(content)) in known:
        return known[name]
    made: dict[Content, Any] = {}
    errors: dict[str, str] = {}
    last = build(content, made)
    stages = {part: stage for part, stage in made.items() if isinstance(stage, Stage)}
    one = content[2] is not None or not {part[2] for part in stages} - {None}
    try:
        if one:
            last.update(content[2])
    except SpacemapError:
        one = False
    for part, stage in stages.items():  # each at its own time, or to find all that fail
        try:
            one or stage.update(part[2])
        except SpacemapError as error:
            errors[key(part)] = error_text(error)
    while len(known) >= KNOWN:
        del known[next(iter(known))]
    if not errors:
        found = {key(k): (digest(s.GetOutputDataObject(0)), s.warnings) for k, s in stages.items()}
    known[name] = ({}, errors) if errors else (found, errors)
    return known[name]
