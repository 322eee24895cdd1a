"""Editor of grips: a card for each grip, made from its declared parameters."""

from __future__ import annotations

from typing import Any

from spacemap_vtk.app.fields.loads_editor import TIME_DEFAULTS
from spacemap_vtk.app.fields.record_cards import RecordCards
from spacemap_vtk.filters.grip import Grip, Grips
from spacemap_vtk.filters.time_keys import TIME_KEYS
from spacemap_vtk.mechanics.boundary.places import SIDES

#: Keys of a motion in time.
_MOTION = ("time", "start", "rise", "times", "values", "frequency")
_MOVES = ("displacement", "rotation")
#: Kind of a grip whose place is not a side.
_OTHER = "other_place"


class GripsEditor(RecordCards):
    """Cards of the grips, each with its place, path and motion."""

    def __init__(self, parameter: Grips) -> None:
        super().__init__(parameter, [*SIDES, _OTHER], parameter.record.noun)

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new grip: it holds a side, or what lies at the origin."""
        return {"place": "sphere(0, 0, 0, 1 mm)" if kind == _OTHER else kind}

    def kind_of(self, record: Grip) -> str:
        """Return the side that a grip holds, or that it holds another place."""
        place = " ".join(record.place)
        return place if place in SIDES else _OTHER

    def change_kind(self, record: Grip, kind: str) -> dict[str, Any]:
        """Return the changes for another side."""
        return {"place": list(record.place) if kind == _OTHER else kind}

    def change_value(self, record: Grip, name: str, value: Any) -> dict[str, Any]:
        """Return the changes; a motion needs a time function, which has keys of its own."""
        changes: dict[str, Any] = {name: value}
        others = [getattr(record, key) for key in _MOVES if key != name]
        if name in _MOVES and value is None and others == [None]:
            changes |= dict.fromkeys(_MOTION)
        elif name in _MOVES and value is not None and not record.motion:
            changes |= {"time": "ramp", "rise": TIME_DEFAULTS["rise"]}
        elif name == "time":
            needed, possible = TIME_KEYS[str(value)]
            changes |= dict.fromkeys(set(_MOTION) - {"time", *needed, *possible})
            defaults = {**TIME_DEFAULTS, "values": [0.0, 1.0]}
            changes |= {key: defaults[key] for key in needed if key not in record._values}
        return changes

    def is_optional(self, record: Grip, name: str) -> bool:
        """Return whether a grip may do without this key."""
        return name != "place" and name not in TIME_KEYS[record.time][0]

    def row_names(self, record: Grip) -> list[str]:
        """Return the keys of the rows of a grip."""
        moves: list[str] = []
        if record.motion is not None:
            own = TIME_KEYS[record.time]
            moves = ["time", *(key for keys in own for key in keys if key in _MOTION)]
        return ["place", "center", "path", "turns", *_MOVES, *moves]
