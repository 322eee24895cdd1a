"""Picture frame: a square of cloth, clamped on all sides along its yarns, is sheared to 45°.

The frame has four rigid bars of length L, hinged at its corners, and is pulled along a diagonal.
Its bars turn by ±γ/2 and keep their lengths, so that the cloth is sheared alike everywhere without
being stretched. With the force F on the corner and half the angle between the bars φ = 45° - γ/2,
each bar carries the shear force F_s = F/(2 cos φ) (benchmark of picture frame tests: Cao et al.,
Composites A 39 (2008) 1037). F follows from the work of all bars on the cloth, as the frame itself
needs none.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.laboratory.records import (
    DEGREE,
    N_PER_M,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
    add_errors,
)
from spacemap_vtk.mechanics.boundary.grips import Grip, held_by
from spacemap_vtk.mechanics.boundary.reactions import Reaction, find_bearings
from spacemap_vtk.mechanics.contact.path import states_on_path
from spacemap_vtk.mechanics.contact.reactions import list_reactions
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Progress

#: Length of the bars [m].
SIDE = 0.2
#: Cells along each bar; the cloth is sheared alike in all of them.
_CELLS = 6
#: Shear angle at the end, and those at which the force is printed [rad].
LARGEST = np.radians(45.0)
_PRINTED = np.radians([10.0, 20.0, 40.0])
_STEPS = 45
#: Mass per volume that the model needs, but no state at rest [kg/m³].
_DENSITY = 1.0


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Shear a square in a frame."""
    if fabric.loops:
        raise InputError(
            "a picture frame shears cloth whose yarns lie along its bars; the loops of a knit do "
            "not",
            key="test",
            value="frame",
            cure="Measure shear or bias",
        )
    angles = np.linspace(0.0, LARGEST, _STEPS + 1)
    force, states = shear_in_frame(fabric, angles, progress)
    printed = np.concatenate([[0.0], _PRINTED])
    # The cloth is sheared alike everywhere unless its law lets it localise; two cells show it.
    wider, _ = shear_in_frame(fabric, printed, cells=_CELLS // 3)
    readings, doubts = add_errors(
        _readings(angles, force), _readings(printed, wider), ratios=(3.0, 3.0)
    )
    return Measurement(
        readings,
        [Curve("loading", angles, force)],
        Axis("shear angle", DEGREE),
        Axis("shear force per length", N_PER_M),
        ("yarns keep their lengths; the work of friction between them is not contained", *doubts),
        states,
    )


def _readings(angles: Floats, force: Floats) -> list[Reading]:
    """Return the forces per length of a bar at the printed angles."""
    return [
        Reading("Fs", f"shear force per length at {np.degrees(angle):.0f}°", "", value, N_PER_M)
        for angle, value in zip(_PRINTED, np.interp(_PRINTED, angles, force), strict=True)
    ]


def shear_in_frame(
    fabric: Fabric,
    angles: Floats,
    progress: Progress = lambda share: None,
    cells: int = _CELLS,
) -> tuple[Floats, States]:
    """Return shear forces per length of a bar [N/m] at angles from 0 on, (n,), and the states."""
    half, thick = SIDE / 2, fabric.thickness / 2
    box = (-half, half, -half, half, -thick, thick)
    points, tetrahedra = build_lattice(box, (cells, cells, 1))
    bars = [_bar(points, axis, end, angles) for axis in (0, 1) for end in (-half, half)]
    held = held_by(bars, points.shape)
    held[:, 2] = True  # flat
    model = Model(points, tetrahedra, fabric.plate, _DENSITY, held)
    bearings = find_bearings(points, (), bars)
    power, moved = [], []
    for number, state in enumerate(states_on_path(model, grips=bars)):
        moves = [bar.moves[number] for bar in bars]
        found = list_reactions(model, state.displacement, state.holding, bearings, moves)
        power.append(_power(found, bars, angles[number]))
        moved.append(state.displacement)
        progress((number + 1) / len(angles))
    # The diagonal is 2 L cos φ, and dφ = -dγ/2.
    phi = np.pi / 4 - angles / 2
    force = np.array(power) / (SIDE * np.sin(phi)) / (2 * np.cos(phi)) / SIDE
    return force, States(
        points, tetrahedra, np.array(moved), np.stack([angles, force], axis=1), "front"
    )


def _bar(points: Floats, axis: int, end: float, angles: Floats) -> Grip:
    """Make the grip of a bar at `end` along an axis; the frame stays centred."""
    held = np.repeat(points[:, axis, None] == end, 3, axis=1)
    center = np.eye(3)[axis] * end
    # Yarns along x turn by γ/2, those along y by -γ/2; a bar lies along the other axis.
    turn = (angles / 2) * (-1.0 if axis == 0 else 1.0)
    moves = np.zeros((len(angles), 3))
    moves[:, axis] = end * (np.cos(angles / 2) - 1.0)
    moves[:, 1 - axis] = end * np.sin(angles / 2)
    return Grip(held, center, moves, np.outer(turn, (0.0, 0.0, 1.0)), f"bar {'xy'[axis]}")


def _power(found: list[Reaction], bars: list[Grip], angle: float) -> float:
    """Compute the work of all bars per unit of shear angle [N m]."""
    total = 0.0
    for reaction, bar in zip(found, bars, strict=True):
        axis = int(bar.center[1] != 0.0)
        end = bar.center[axis]
        speed = np.zeros(3)
        speed[axis] = -end * np.sin(angle / 2) / 2
        speed[1 - axis] = end * np.cos(angle / 2) / 2
        total += float(reaction.force @ speed)
        total += reaction.moment[2] * (-0.5 if axis == 0 else 0.5)
    return total
