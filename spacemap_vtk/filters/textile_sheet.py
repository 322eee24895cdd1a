"""The sheet that the relaxed yarns of a textile form: its stiffness, its curl, and its law.

A data set states its textile by a text in its field data: the kind and its parameters. So the
solver of a cage makes the sheet of the textile inside, as it does of a weave's cloth. What was
computed is kept in memory and on disk.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataObject

from spacemap_vtk import cache
from spacemap_vtk.datasets.arrays import add_text, text_of
from spacemap_vtk.datasets.cloth_data import cloth_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textiles import KINDS
from spacemap_vtk.filters.textiles.kind import Rest, TextileKind
from spacemap_vtk.mechanics.elements.plates import Plate, apply_measurements
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.cell_law import (
    CellLaw,
    SetCellLaw,
    tabulate_cell,
    tabulate_strip,
)
from spacemap_vtk.textile.rods.stiffness import (
    LEAST_MOMENT,
    SIDES,
    SOFTEST,
    CellStiffness,
    cell_area,
    cell_stiffness,
    raise_to_floor,
    set_stiffness,
    settle_springs,
)
from spacemap_vtk.textile.rods.yarns import unknowns
from spacemap_vtk.textile.weave.cloth import Cloth

#: Name of the field array; those of a cloth begin so, and cages pass them on.
_TEXTILE = "cloth_textile"
#: Largest component of a period along the other axis, over its length.
_SQUARE = 1e-3
#: Poisson's ratio of a strip, as a sheet that is equally stiff along and across.
_RATIO = 0.3
#: What was computed last, by digest.
_recent: dict[str, dict[str, Floats]] = {}


class TextileSheet(NamedTuple):
    """Stiffness of a textile as a sheet."""

    plate: Plate
    """Axis 1 is x, the courses or picks; axis 2 is y, the wales, ends or the braid's axis."""
    notes: list[str]
    """Sentences on what was assumed."""


def add_textile(data: vtkDataObject, kind: TextileKind) -> None:
    """State in field data which textile a data set is; colours do not belong to it."""
    given = {name: value for name, value in kind.given_values.items() if name != "color"}
    text = json.dumps({"kind": kind.name, **given}, default=str)
    add_text(data.GetFieldData(), _TEXTILE, text)


def textile_of(data: vtkDataObject) -> TextileKind | None:
    """Return the textile that a data set states; None without one."""
    text = text_of(data.GetFieldData(), _TEXTILE)
    if text is None:
        return None
    values: Mapping[str, Any] = json.loads(text)
    return KINDS[values["kind"]](**{k: v for k, v in values.items() if k != "kind"})


def content_of(data: vtkDataObject) -> Cloth | TextileKind | None:
    """Return the weave or textile that a data set states; None without one."""
    return textile_of(data) or cloth_of(data)


def sheet_of_textile(kind: TextileKind, progress: Progress | None = None) -> TextileSheet:
    """Compute the stiffness of a textile as a sheet, or load it."""
    rest = _require_sheet(kind, progress)
    found, floors = _cell_stiffness(kind, rest, progress)
    unit, force = kind.scale, kind.require_bending() / kind.scale**2
    membrane, bending = found.membrane * force / unit, found.bending * force * unit
    if kind.is_strip(rest):
        plate = apply_measurements(
            Plate(np.eye(3), np.eye(3)),
            tensile=(float(membrane[1, 1]),) * 2,
            bending=(float(bending[1, 1]),) * 2,
            ratio=_RATIO,
        )
        note = (
            "a strip has one period: across it the sheet is as stiff as along it, with a Poisson's "
            f"ratio of {_RATIO:g}; give shear_rigidity if it matters"
        )
        return TextileSheet(plate, [note])
    notes = [
        f"yarns without friction let this textile deform {where} almost without force; its "
        "stiffness there is raised to the least that is assumed"
        for where, raised in zip(("in its plane", "in bending"), floors, strict=True)
        if raised
    ]
    rigid = np.zeros((3, 3))
    rigid[:2, :2] = bending
    rigid[2, 2] = np.sqrt(bending[0, 0] * bending[1, 1]) / 2.0
    curvature = None
    if found.moment.any() and kind.set_in_use < 1.0:
        moment = found.moment * force * (1.0 - kind.set_in_use)
        curvature = np.append(np.linalg.solve(bending, moment), 0.0)
    return TextileSheet(Plate(membrane, rigid, curvature=curvature), notes)


def _require_sheet(kind: TextileKind, progress: Progress | None) -> Rest:
    """Return the yarns of a cell that is a sheet; refuse those that are none."""
    rest = kind.cell_of_sheet(progress)
    lengths, leaning = np.linalg.norm(rest.cell, axis=1), abs(rest.cell)
    leaning[[0, 1], [0, 1]] = 0.0
    if not lengths.any() or leaning.max() > _SQUARE * lengths.max():
        why, cure = "their cell is not a rectangle along x and y", ""
        if not lengths.any():
            why = "they do not repeat themselves"
            cure = ", or give textile.period" if "period" in kind.parameters else ""
        raise InputError(
            f"these yarns are no sheet: {why} ({kind.name})",
            key="material",
            value="yarns",
            cure=f"Choose another material, with the figures of the sheet{cure}.",
        )
    return rest


def law_of_textile(kind: TextileKind, progress: Progress | None = None) -> CellLaw:
    """Compute the law of a textile's membrane from its strained cell, or load it."""
    rest = _require_sheet(kind, None)
    unit, force = kind.scale, kind.require_bending() / kind.scale**2
    membrane = _cell_stiffness(kind, rest, progress)[0].membrane
    key = _digest(kind, rest, "law beside snaps")
    found = _recent.get(key) or cache.load(key, values=(-1, -1), constants=(2,))
    if found is None:
        mechanics, (yarns, cell) = kind.mechanics_of_sheet(rest), rest[:2]
        if kind.springs:
            yarns, cell = settle_springs(yarns, cell, mechanics)
        else:
            mechanics = mechanics._replace(set_in=unknowns(yarns, cell))
        if kind.is_strip(rest):
            width = cell_area(yarns, cell) / float(np.linalg.norm(cell))
            along = float(membrane[1, 1])
            made = tabulate_strip(yarns, cell, mechanics, width, along, progress)
        else:
            made = tabulate_cell(yarns, cell, mechanics, membrane, progress)
        found = {"values": made.values, "constants": np.array([made.scale, made.beyond])}
        cache.store(key, **found)
    _keep(key, found)
    constants = np.append(found["constants"], membrane[2, 2]) * force / unit
    return (CellLaw if kind.springs else SetCellLaw)(found["values"], constants)


def _digest(kind: TextileKind, rest: Rest, what: str) -> str:
    return digest_of(
        f"{what} of a textile",
        str(kind.springs),
        *(str(yarn.periods) for yarn in rest.yarns),
        *(yarn.diameter for yarn in rest.yarns),
        np.concatenate([yarn.points for yarn in rest.yarns]),
        rest.cell,
        *kind.mechanics_of_sheet(rest)[:-1],
    )


def _cell_stiffness(
    kind: TextileKind, rest: Rest, progress: Progress | None
) -> tuple[CellStiffness, list[bool]]:
    """Return a positive stiffness, and whether that of membrane and bending had to be raised."""
    mechanics, key = (
        kind.mechanics_of_sheet(rest),
        _digest(kind, rest, "sheet" + ", shear of 1 %" * kind.springs),
    )
    shapes = {"membrane": (3, 3), "bending": (2, 2), "moment": (2,), "raised": (2,)}
    found = _recent.get(key) or cache.load(key, **shapes)
    if found is None:
        made, least = set_stiffness(rest.yarns, rest.cell, mechanics), 0.0
        if kind.springs:
            least = SOFTEST * float(np.diag(made.bending).min())
            yarns, cell = settle_springs(rest.yarns, rest.cell, mechanics)
            made = cell_stiffness(yarns, cell, mechanics, SIDES, progress)
        if kind.is_strip(rest):
            raised = [False, False]
        else:
            membrane, stretched = raise_to_floor(made.membrane)
            bending, bent = raise_to_floor(made.bending, least)
            made, raised = made._replace(membrane=membrane, bending=bending), [stretched, bent]
        moment = np.where(abs(made.moment) < LEAST_MOMENT, 0.0, made.moment)
        found = {**made._replace(moment=moment)._asdict(), "raised": np.array(raised, np.float64)}
        cache.store(key, **found)
    _keep(key, found)
    floors = (found["raised"] > 0.0).tolist()
    return CellStiffness(*(found[name] for name in CellStiffness._fields)), floors


def _keep(key: str, found: dict[str, Floats]) -> None:
    """Keep a result in memory, and forget an old one."""
    if len(_recent) > 8:
        _recent.pop(next(iter(_recent)))
    _recent[key] = found
