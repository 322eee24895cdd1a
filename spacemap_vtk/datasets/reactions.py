"""Write what holds a cage, and its reactions, into arrays of its grid, and read them back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, add_text, array_of, text_of
from spacemap_vtk.mechanics.boundary.reactions import Reaction
from spacemap_vtk.ndarrays import Floats

#: Name of the point array of the forces of supports and grips on held vertices [N].
REACTION = "reaction"
#: Names of the field arrays that have a row for each body that holds the cage: its force [N] and
#: moment [N m] on the cage, and the point of the moment [m].
_PARTS = ("reaction_force", "reaction_moment", "reaction_point")
#: Name of the field array of the names of these bodies.
_NAMES = "reaction_body"
#: Names of the field arrays that have a row for each place of a path: force and moment of each
#: body, three columns each, move [m] and rotation vector [rad] of each grip, and move of each
#: obstacle [m].
_PATH = (
    "path_reaction_force",
    "path_reaction_moment",
    "path_grip_move",
    "path_grip_turn",
    "path_obstacle_move",
)
#: Name of the field array of what `filters.grip.bearings_of` reads, as JSON.
_BEARINGS = "bearings"

_OWNER = "the cage's reactions (put a ModalSolver before it)"


class PathReactions(NamedTuple):
    """Reactions along a path, and how grips and obstacles moved on it."""

    forces: Floats
    """(S, n, 3), force of each of n bodies on the cage at each of S places [N]."""
    moments: Floats
    """(S, n, 3), their moments [N m]."""
    moves: Floats
    """(S, g, 3), move of each of g grips [m]."""
    turns: Floats
    """(S, g, 3), rotation vector of each grip [rad]."""
    obstacle_moves: Floats
    """(S, m, 3), displacement of each of m obstacles [m]."""


def add_reactions(
    grid: vtkUnstructuredGrid,
    holding: Floats,
    reactions: Sequence[Reaction],
    path: PathReactions | None = None,
) -> None:
    """Write forces on held vertices, the reactions of all bodies, and those along a path."""
    remove_reactions(grid)
    add_array(grid.GetPointData(), REACTION, holding)
    set_reactions(grid, reactions)
    if path is not None:
        for name, table in zip(_PATH, path, strict=True):
            if table.size:
                add_array(grid.GetFieldData(), name, table.reshape(len(table), -1))


def set_reactions(grid: vtkUnstructuredGrid, reactions: Sequence[Reaction]) -> None:
    """Write name, force, moment and point of each body that holds the cage."""
    field = grid.GetFieldData()
    for name in (_NAMES, *_PARTS):
        field.RemoveArray(name)
    if not reactions:
        return
    add_text(field, _NAMES, json.dumps([(each.kind, each.name) for each in reactions]))
    for name, part in zip(_PARTS, ("force", "moment", "about"), strict=True):
        add_array(field, name, np.array([getattr(each, part) for each in reactions]))


def held_forces(grid: vtkUnstructuredGrid) -> Floats | None:
    """Return the forces of supports and grips on vertices at rest [N], (V, 3), if known."""
    data = grid.GetPointData()
    return array_of(data, REACTION, _OWNER) if data.HasArray(REACTION) else None


def remove_reactions(grid: vtkUnstructuredGrid) -> None:
    """Remove the arrays that `add_reactions` writes."""
    grid.GetPointData().RemoveArray(REACTION)
    for name in (_NAMES, *_PARTS, *_PATH):
        grid.GetFieldData().RemoveArray(name)


def reactions_of(grid: vtkUnstructuredGrid) -> list[Reaction]:
    """Return the reactions of all bodies that hold a cage at rest; empty without an equilibrium."""
    field = grid.GetFieldData()
    names = text_of(field, _NAMES)
    if names is None:
        return []
    parts = [array_of(field, name, _OWNER).reshape(-1, 3) for name in _PARTS]
    return [
        Reaction(kind, name, *(part[k] for part in parts))
        for k, (kind, name) in enumerate(json.loads(names))
    ]


def path_reactions_of(grid: vtkUnstructuredGrid) -> PathReactions | None:
    """Return the reactions along the path to a cage's equilibrium; None without a path."""
    field = grid.GetFieldData()
    if not field.HasArray(_PATH[0]):
        return None
    tables: list[Floats] = []
    for name in _PATH:
        has = field.HasArray(name)
        table = array_of(field, name, _OWNER) if has else np.empty((len(tables[0]), 0))
        tables.append(table.reshape(len(table), table.size // len(table) // 3, 3))
    return PathReactions(*tables)


def add_bearings(grid: vtkUnstructuredGrid, recipe: Mapping[str, Any]) -> None:
    """Write the places of supports and grips, numbers and texts only, as JSON."""
    add_text(grid.GetFieldData(), _BEARINGS, json.dumps(recipe))


def bearings_recipe(grid: vtkUnstructuredGrid) -> dict[str, Any]:
    """Return what `add_bearings` has written; empty if nothing."""
    text = text_of(grid.GetFieldData(), _BEARINGS)
    return {} if text is None else json.loads(text)
