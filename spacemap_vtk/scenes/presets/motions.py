"""Motions that presets give to cloth: a cage, supports, gravity, and what the cloth meets."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from spacemap_vtk.scenes.presets.sheet import MOST_CELLS, Sheet, rounded
from spacemap_vtk.units import GRAVITY, format_quantity

#: Width of a cell over the bending length on a table, at whose rim the cloth bends most.
CELL_ON_TABLE = 0.5
#: Most cells of a curtain.
_MOST_OF_CURTAIN = 4096
#: Most cells of cloth that falls, in time steps.
_STEPPED_CELLS = 324
#: Width of a cell over the bending length where cloth falls onto a ball, with sharper folds.
CELL_ON_BALL = 0.5
#: Width of a cell over the bending length where heavy cloth falls. Air hardly brakes it, so that
#: its folds are sharper as it lands.
CELL_OF_HEAVY = 0.35
#: Most cells of heavy cloth that falls.
_CELLS_OF_HEAVY = 676
#: Drag of the air over (g/c)^½ below which cloth is heavy; knits are.
_HEAVY = 0.15
#: Gap between cloth that falls and the ball over the width of a cell: where it is drawn taut, the
#: springs of contact let it sink in by that much.
_FALLING_GAP = 0.05
#: Distance between the rings of a curtain before it is drawn together, over the bending length.
_RING = 2.8
#: Fewest cells across a pleat.
CELLS_OF_PLEAT = 6
#: Share by which a curtain is drawn together.
_CLOSER = 0.22
#: Force that pushes each pleat to its side, over the weight of the cloth.
_PUSH = 0.01
#: Stiffness of the springs that hold its rings, over the weight of a unit width [1/m].
_PULL = 14.0
#: Radius of its rail over the longer side of the cloth.
_RAIL = 0.012
#: Pressure of the draught that moves it, over its weight per area.
_DRAUGHT = 0.08
#: Radius of the pinned middle of a cloth on a table, in cells.
_PINNED = 2.1
#: Distance of cloth from the table, in cells: springs of contact let it in by up to that much.
_GAP = 0.035
#: A textile that is longer than this multiple of its width is a strip.
_STRIP = 2.2


class Motion(NamedTuple):
    """How a preset moves cloth, and how large that may be."""

    prepare: Callable[[dict[str, Any], Sheet], None]
    """Adds cage, supports, loads and what the cloth meets to the values of a scene."""
    side: float
    """Side of the cloth over its bending length, unless its size is given."""
    most_cells: int
    """Most cells of its cage."""
    widest_cell: float
    """Width over the bending length; in wider cells sharp folds turn inside out."""
    verb: str
    """What cloth that is too large cannot do, in an error."""
    alternative: str = ""
    """What it can do."""


def _hang(values: dict[str, Any], sheet: Sheet) -> None:
    """Hang cloth from rings that slide along a rail and are drawn together; strips from a line."""
    modal = values["modal"] | {"gravity": [0.0, "-1 g", 0.0], "modes": 50}
    cells, pleats = _cells_and_pleats(sheet)
    modal |= _rings(sheet, pleats) if pleats else {"fixed": "+y"}
    values["modal"] = modal | {"obstacles": [_rail(sheet)]}
    values["cage"] = {"divisions": cells}
    values["response"] = {
        "damping_ratio": 0.08,
        "loads": [
            {
                "pressure": rounded(_DRAUGHT * sheet.weight, "Pa"),
                "on": "-z",
                "time": "table",
                "times": ["0 s", "0.2 s", "0.5 s"],
                "values": [0.0, 1.0, 0.0],
            }
        ],
    }
    values["rotation"] = {}
    values["view"] |= {"camera": "three-quarter"}
    values["animation"] = {"stop": "3 s"}


def _cells_and_pleats(sheet: Sheet) -> tuple[list[int], int]:
    """Return numbers of cells of a curtain along x, y and z, and of its pleats: even, or 0."""
    width, height = map(float, sheet.sides)
    cells = sheet.cells()
    most = math.sqrt(_MOST_OF_CURTAIN / 0.6 * width / height) / CELLS_OF_PLEAT
    pleats = 2 * round(0.5 * min(width / (_RING * sheet.bending_length), most))
    if pleats:
        across = pleats * max(CELLS_OF_PLEAT, round(cells[0] / pleats))
        cells = [across, max(3, round(across * height / width * 0.6)), 1]
    return cells, pleats


def _rings(sheet: Sheet, pleats: int) -> dict[str, Any]:
    """Return what holds a curtain at its rings and draws these together."""
    # Each ring is drawn towards the middle by a spring and a force, which together move it by a
    # share of its distance. Only one face is held along z, so that pleats turn about the rings.
    width, height = map(float, sheet.sides)
    spring, push = (
        share * sheet.weight * height * length for share, length in ((_PULL, 1.0), (_PUSH, width))
    )
    top, faces = float(sheet.high[1]), (float(sheet.low[2]), float(sheet.high[2]))
    places = np.linspace(sheet.low[0], sheet.high[0], pleats + 1).tolist()
    between = [0.5 * sum(pair) for pair in itertools.pairwise(places)]
    middle = places[pleats // 2]
    others = [x for x in places if x != middle]

    # Finer than the cloth is thick, so that each ring still holds its vertices.
    fine = 10.0 ** math.floor(math.log10(0.1 * sheet.thickness))

    def place(value: float) -> str:
        return format_quantity(float(f"{round(value / fine) * fine:.12g}"), "m")

    def ring(x: float, z: float, radius: float) -> str:
        return f"sphere({', '.join(map(place, (x, top, z, radius)))})"

    both = {x: ring(x, 0.5 * sum(faces), 0.6 * sheet.thickness) for x in places}
    one = {x: ring(x, faces[0], 0.5 * sheet.thickness) for x in places}
    drawn = spring * _CLOSER
    loads = [(x, (drawn * (middle - x), 0.0, 0.0)) for x in others]
    # Pleats go to the front and to the back in turn.
    loads += [(x, (0.0, 0.0, (-1) ** n * push)) for n, x in enumerate(between)]
    return {
        "fixed": [f"{both[x]}:y {one[x]}:{'z' if x in others else 'xz'}" for x in places],
        "springs": [f"{both[x]}:x {rounded(spring, 'N/m')}" for x in others],
        # In the middle between both faces, which share a force: at one of them it would turn it.
        "dead_loads": [
            {
                "force": [rounded(each, "N") if each else 0.0 for each in force],
                "at": [place(x), place(top), 0.0],
            }
            for x, force in loads
        ],
    }


def _rail(sheet: Sheet) -> dict[str, Any]:
    """Return the rail, which shows what holds the cloth; this hangs below and does not touch it."""
    radius, gap = _RAIL * float(max(sheet.sides)), 0.7 * sheet.thickness
    middle = 0.5 * (sheet.low + sheet.high)
    return {
        "shape": "cylinder",
        "radius": _length(radius),
        "height": _length(float(sheet.sides[0]) + 8.0 * radius),
        "axis": [1.0, 0.0, 0.0],
        "center": _lengths(middle[0], sheet.high[1] + gap + radius, middle[2], digits=4),
    }


def _drape(values: dict[str, Any], sheet: Sheet) -> None:
    """Lay cloth on a round table, or a strip over a rod."""
    is_strip = max(sheet.sides) > _STRIP * min(sheet.sides)
    cells, fixed, obstacles = (_lay_over_rod if is_strip else _lay_on_table)(sheet)
    values["modal"] |= {
        "gravity": [0.0, 0.0, "-1 g"],
        "fixed": fixed,
        "modes": 12,
        "obstacles": obstacles,
    }
    values["cage"] = {"divisions": cells}
    values["response"] = {"damping_ratio": 0.08}
    values["animation"] = {"stop": "8 s", "orbit": 360.0}  # it lies still


def _lay_over_rod(sheet: Sheet) -> tuple[list[int], str, list[dict[str, Any]]]:
    """Return cells, supports and obstacles of a strip that hangs over a rod on both sides."""
    length, long = float(max(sheet.sides)), int(np.argmax(sheet.sides))
    x, y, _ = 0.5 * (sheet.low + sheet.high)
    # A row of pins along the top of the rod, which needs vertices in the middle.
    cells = sheet.cells(MOST_CELLS, CELL_ON_TABLE)
    cells[long] += cells[long] % 2
    near = 0.3 * length / cells[long]
    span = f"{_length(-near)}, {_length(near)}"
    fixed = f"box(-inf, inf, {span}, -inf, inf)" if long else f"box({span}, -inf, inf, -inf, inf)"
    radius = 0.08 * length
    rod = {
        "shape": "cylinder",
        "radius": _length(radius),
        "height": _length(1.5 * float(min(sheet.sides))),
        "axis": [1.0, 0.0, 0.0] if long else [0.0, 1.0, 0.0],
        "center": _lengths(x, y, float(sheet.low[2]) - radius),
    }
    return cells, fixed, [rod]


def _lay_on_table(sheet: Sheet) -> tuple[list[int], str, list[dict[str, Any]]]:
    """Return cells, supports and obstacles of cloth on a round table."""
    # Pins around the middle hold the cloth, as its symmetry would: with friction alone the search
    # stops where a corner happens to stick. There are pins in cells twice as wide, too, in which
    # the search begins.
    cells = sheet.cells(MOST_CELLS, CELL_ON_TABLE, multiple=4)
    cell = float(max(sheet.sides / cells[:2]))
    x, y, _ = 0.5 * (sheet.low + sheet.high)
    middle = _lengths(x, y, float(sheet.low[2]), _PINNED * cell + sheet.thickness)
    return cells, f"sphere({', '.join(map(str, middle))})", _table(sheet, cell)


def _table(sheet: Sheet, cell: float) -> list[dict[str, Any]]:
    """Return top, leg and foot of a table, and the floor."""
    side, gap = float(min(sheet.sides)), _GAP * cell
    x, y, _ = 0.5 * (sheet.low + sheet.high)
    z = float(sheet.low[2]) - gap
    # A sharper rim would turn the cloth by too much within a cell.
    thick = max(0.08 * side, 2.8 * cell)
    # A corner hangs lower than the table's top by half a diagonal less the radius, at most.
    leg = 0.5 * float(math.hypot(*sheet.sides)) - 0.2 * side
    return [
        {
            "shape": "disc",
            "radius": _length(0.3 * side),
            "height": _length(thick),
            "rounding": _length(0.43 * thick),
            "center": _lengths(x, y, z),
            "gap": _length(gap),
        },
        {
            "shape": "cylinder",
            "radius": _length(0.043 * side),
            "height": _length(leg + 0.06 * side),  # its round ends are inside the others
            "center": _lengths(x, y, z - thick - 0.5 * leg),
        },
        {
            "shape": "disc",
            "radius": _length(0.2 * side),
            "height": _length(0.045 * side),
            "center": _lengths(x, y, z - thick - leg),
        },
        {"shape": "plane", "center": _lengths(0.0, 0.0, z - thick - leg - 0.045 * side)},
    ]


def _drop(values: dict[str, Any], sheet: Sheet) -> None:
    """Let cloth fall onto a ball on a stand, in time steps."""
    side = float(min(sheet.sides))
    x, y, z = 0.5 * (sheet.low + sheet.high)
    heavy = sheet.drag < _HEAVY * math.sqrt(GRAVITY / sheet.bending_length)
    fineness = (_CELLS_OF_HEAVY, CELL_OF_HEAVY) if heavy else (_STEPPED_CELLS, CELL_ON_BALL)
    radius, cells = 0.27 * side, sheet.cells(*fineness)
    # Off the middle by a fiftieth, as nothing falls exactly onto the middle.
    x, y, z = x + 0.02 * side, y - 0.013 * side, float(sheet.low[2]) - 0.1 * side - radius
    values["modal"] |= {
        "fixed": "",
        "hang": False,
        "modes": 6,
        "obstacles": [
            {
                "shape": "sphere",
                "radius": _length(radius),
                "center": _lengths(x, y, z),
                "friction": 0.3,
                "gap": _length(_FALLING_GAP * side / min(cells[:2])),
            },
            {
                "shape": "cylinder",
                "radius": _length(0.07 * side),
                "height": _length(0.5 * side),
                "center": _lengths(x, y, z - radius - 0.23 * side),
            },
        ],
    }
    values["cage"] = {"divisions": cells}
    # The cloth embraces the ball after 1.1 of these units, rises a little and comes to rest.
    span = _tidy(3.9 * math.sqrt(side / GRAVITY))
    values["transient"] = {
        "gravity": [0.0, 0.0, "-1 g"],
        "alpha": float(f"{sheet.drag:.2g}"),
        "beta": f"{_tidy(1e3 * sheet.damping)} ms",
        "tolerance": 1.0,
        "duration": f"{span} s",
    }
    values["view"] |= {"time": f"{_tidy(0.45 * span)} s"}
    values["animation"] = {"stop": f"{span} s", "speed": 0.2}


def _swing(values: dict[str, Any], sheet: Sheet) -> None:
    """Let level cloth fall that is held by one edge, in time steps."""
    period = 2.0 * math.pi * math.sqrt(2.0 * float(sheet.sides[1]) / (3.0 * GRAVITY))
    # One face of the edge is held: a hinge.
    top = float(sheet.high[1]) - 0.01 * float(sheet.sides[1])
    middle = float(sheet.low[2] + sheet.high[2]) / 2
    fixed = f"box(-inf, inf, {_length(top)}, inf, {_length(middle)}, inf)"
    values["modal"] |= {"fixed": fixed, "modes": 6}
    # No fold is sharp: the cells of a twill turn by 28° at most.
    values["cage"] = {"divisions": sheet.cells(_STEPPED_CELLS)}
    span = _tidy(2.0 * period)
    values["transient"] = {
        "gravity": [0.0, 0.0, "-1 g"],
        "alpha": 1.5,
        "beta": "3 ms",
        "tolerance": 1.0,
        "duration": f"{span} s",
    }
    values["view"] |= {"time": f"{_tidy(0.2 * period)} s"}
    values["animation"] = {"stop": f"{span} s", "speed": 0.5}


def _lengths(*values: float, digits: int = 6) -> list[Any]:
    """Format lengths [m] as in a scene file."""
    # With more digits than sizes, as supports must meet vertices of the cage; the middle of a cloth
    # is zero up to rounding.
    return [format_quantity(value, "m", digits) if abs(value) > 1e-12 else 0.0 for value in values]


def _length(value: float) -> str:
    return rounded(value, "m")


def _tidy(value: float) -> float:
    """Round to two digits."""
    return float(f"{value:.2g}")


#: What is the same for all motions in time steps.
_STEPPED: Any = {
    "most_cells": _STEPPED_CELLS,
    "widest_cell": 0.978,  # a side of 17.6 bending lengths in 18 cells
    "verb": "move in time steps",
    "alternative": "hang or drape",
}
#: The motions by the names of the presets.
MOTION_OF_PRESET = {
    "hang": Motion(_hang, side=14.0, most_cells=_MOST_OF_CURTAIN, widest_cell=1.5, verb="hang"),
    "drape": Motion(
        _drape,
        side=14.0,
        most_cells=MOST_CELLS,
        widest_cell=0.8,
        verb="drape",
        alternative="hang",
    ),
    "drop": Motion(_drop, side=9.0, **_STEPPED),
    "swing": Motion(_swing, side=10.0, **_STEPPED),
}
