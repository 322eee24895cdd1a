"""Editor of obstacles: a card for each obstacle, made from its declared parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from PySide6.QtWidgets import QFileDialog

from spacemap_vtk.app.fields.loads_editor import TIME_DEFAULTS
from spacemap_vtk.app.fields.record_cards import RecordCards
from spacemap_vtk.filters.obstacle import SHAPES, Obstacle, Obstacles
from spacemap_vtk.filters.time_keys import TIME_KEYS

#: First values of a new obstacle, over the size of the cloth.
_SIZES: dict[str, dict[str, Any]] = {
    "plane": {},
    "sphere": {"radius": 0.25},
    "cylinder": {"radius": 0.1, "axis": [1.0, 0.0, 0.0]},
    "box": {"size": [0.5, 0.5, 0.3]},
    "disc": {"radius": 0.3},
    "mesh": {},
}
#: Distance of a new obstacle below the cloth, over the cloth's size.
_BELOW = 0.3
#: Keys of a motion.
_MOTION = ("time", "start", "rise", "times", "values", "frequency")
assert set(_SIZES) == set(SHAPES)


class ObstaclesEditor(RecordCards):
    """Cards of the obstacles, each with its shape, place, friction and motion."""

    def __init__(self, parameter: Obstacles) -> None:
        super().__init__(parameter, SHAPES)
        #: Size of the cloth [m], of which new obstacles are made, and its middle.
        self.size, self.middle = 0.1, (0.0, 0.0, 0.0)

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new obstacle: below the cloth, and smaller."""
        x, y, z = self.middle
        reach = _SIZES[kind].get("radius", 0.0) if kind in ("sphere", "cylinder") else 0.0
        center = [x, y, z - self.size * (_BELOW if kind == "plane" else 0.1 + reach)]
        return {"shape": kind, "center": [_rounded(c) for c in center], **self._sized(kind)}

    def set_bounds(self, bounds: Sequence[float]) -> None:
        """Set the bounds of the cloth [m], to which new obstacles are fitted."""
        low, high = np.reshape(bounds, (3, 2)).T
        self.size = float((high - low).max()) or self.size
        x, y, z = ((low + high) / 2).tolist()
        self.middle = x, y, z

    def kind_of(self, record: Obstacle) -> str:
        """Return the shape of an obstacle."""
        return str(record.shape)

    def change_kind(self, record: Obstacle, kind: str) -> dict[str, Any]:
        """Return the changes for another shape."""
        cleared = {key for pair in SHAPES.values() for keys in pair for key in keys}
        return {**dict.fromkeys(sorted(cleared)), "shape": kind, **self._sized(kind)}

    def change_value(self, record: Obstacle, name: str, value: Any) -> dict[str, Any]:
        """Return the changes; a displacement needs a time function, which has keys of its own."""
        changes: dict[str, Any] = {name: value}
        if name == "displacement" and value is None:
            changes |= dict.fromkeys(_MOTION)
        elif name == "displacement" and record.displacement is None:
            changes |= {"time": "ramp", "rise": TIME_DEFAULTS["rise"]}
        elif name == "time":
            needed, possible = TIME_KEYS[str(value)]
            changes |= dict.fromkeys(set(_MOTION) - {"time", *needed, *possible})
            defaults = {**TIME_DEFAULTS, "values": [0.0, 1.0]}
            changes |= {key: defaults[key] for key in needed if key not in record._values}
        return changes

    def is_optional(self, record: Obstacle, name: str) -> bool:
        """Return whether an obstacle may do without this key."""
        needed = SHAPES[record.shape][0]
        return name not in needed and name not in TIME_KEYS[record.time][0]

    def row_names(self, record: Obstacle) -> list[str]:
        """Return the keys of the rows of an obstacle."""
        needed, possible = SHAPES[record.shape]
        moves: list[str] = []
        if record.displacement is not None:
            own = TIME_KEYS[record.time]
            moves = ["time", *(key for keys in own for key in keys if key in _MOTION)]
        return ["center", *needed, *possible, "friction", "displacement", *moves]

    def _sized(self, kind: str) -> dict[str, Any]:
        if kind == "mesh":
            return {"file": QFileDialog.getOpenFileName(self, "Closed mesh of an obstacle")[0]}
        scaled = dict(_SIZES[kind])
        if "radius" in scaled:
            scaled["radius"] = _rounded(self.size * scaled["radius"])
        if "size" in scaled:
            scaled["size"] = [_rounded(self.size * side) for side in scaled["size"]]
        return scaled


def _rounded(length: float) -> float:
    """Round a length to two digits, as a person would write it."""
    return float(f"{length:.2g}")
