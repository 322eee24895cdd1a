"""Editor of loads: a card for each load, made from its declared parameters."""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.app.fields.first_values import FirstValues
from spacemap_vtk.app.fields.record_cards import RecordCards
from spacemap_vtk.filters.load import ACTIONS, Load, Loads
from spacemap_vtk.filters.time_keys import TIME_KEYS

#: First values of the required parameters of time functions.
TIME_DEFAULTS: dict[str, Any] = {
    "length": "100 ms",
    "rise": "100 ms",
    "times": [0.0, 0.1],
    "values": [1.0, 0.0],
    "frequency": "10 Hz",
}


class LoadsEditor(RecordCards):
    """Cards of the loads, each with its action, place and time function."""

    def __init__(self, parameter: Loads) -> None:
        super().__init__(parameter, parameter.actions, parameter.record.noun)
        self._timed = parameter.timed
        #: The shown cage, which new loads bend a little; None without one.
        self.cage: vtkUnstructuredGrid | None = None

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new load."""
        return FirstValues.from_cage(self.cage).of_load(kind)

    def kind_of(self, record: Load) -> str:
        """Return the action of a load."""
        return str(record.action)

    def change_kind(self, record: Load, kind: str) -> dict[str, Any]:
        """Return the changes for another action."""
        cleared = dict.fromkeys([record.action, "on", "at", "follower"])
        return {**cleared, **self.first_values(kind)}

    def change_value(self, record: Load, name: str, value: Any) -> dict[str, Any]:
        """Return the changes; another time function has other keys."""
        changes: dict[str, Any] = {name: value}
        if name == "time":
            needed, possible = TIME_KEYS[str(value)]
            others = {key for pair in TIME_KEYS.values() for keys in pair for key in keys}
            changes |= dict.fromkeys(others - set(needed) - set(possible))
            changes |= {key: TIME_DEFAULTS[key] for key in needed if key not in record._values}
        return changes

    def is_optional(self, record: Load, name: str) -> bool:
        """Return whether the time function may do without this key."""
        return name in TIME_KEYS[record.time][1]

    def row_names(self, record: Load) -> list[str]:
        """Return the keys of the rows of a load, starting with its action."""
        place = ACTIONS[record.action]
        needed, possible = TIME_KEYS[record.time]
        times = ["time", *needed, *possible] if self._timed else []
        follower = ["follower"] if record.action == "pressure" and self._timed else []
        return [record.action, *([place] if place else []), *follower, *times]
