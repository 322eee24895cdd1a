"""Keys of a time function, as loads, moving obstacles and grips declare them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.records import Record
from spacemap_vtk.mechanics.boundary import time_functions
from spacemap_vtk.mechanics.boundary.time_functions import TimeFunction

#: For each time function, the keys that it needs and the keys that it may have.
TIME_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "step": ((), ("start",)),
    "pulse": (("length",), ("start",)),
    "ramp": (("rise",), ("start",)),
    "table": (("times", "values"), ("start", "file")),
    "harmonic": (("frequency",), ("phase", "steady")),
    "periodic": (("times", "values"), ("steady", "file")),
}

#: Time functions of obstacles and grips, and their keys.
MOTIONS = ("ramp", "table", "harmonic", "periodic")
_MOTION_KEYS = ("start", "rise", "times", "values", "frequency")


def check_time_keys(record: Record, from_file: bool = False) -> None:
    """Check that a record has the values that its time function needs, and no others."""
    # `from_file` tells that a file has the points of a table. Keys that the record does not declare
    # are left out.
    kind = str(record.settings["time"])
    needed, possible = TIME_KEYS[kind]
    every = {key for pair in TIME_KEYS.values() for keys in pair for key in keys}
    for key in sorted(every & {*record.parameters, "file"}):
        if key == "file" and not from_file:
            continue
        given = getattr(record, key) not in (None, False)
        if key in needed and from_file:
            if given:
                raise InputError("is already given by file", key=key)
        elif key in needed and not given:
            raise InputError(
                f'time = "{kind}" needs this value',
                key=key,
                allowed=record.parameter(key).allowed,
            )
        if given and key not in needed + possible:
            raise InputError(
                f'time = "{kind}" does not use this value',
                key=key,
                allowed=", ".join(needed + possible),
            )


def check_motion(record: Record, moves: Sequence[str]) -> None:
    """Check the time function of a record whose motion is given by any of the keys `moves`."""
    if all(getattr(record, key) is None for key in moves):
        for key in ("time", *_MOTION_KEYS):
            if key in record.given_values:
                article = "an" if record.noun[0] in "aeiou" else "a"
                raise InputError(
                    f"{article} {record.noun} without a {' or '.join(moves)} does not use this "
                    "value",
                    key=key,
                    value=getattr(record, key),
                    cure=f"Give the {' or the '.join(moves)} of the {record.noun}, or leave this "
                    "out.",
                )
        return
    check_time_keys(record)
    if not time_functions.is_continuous(make_time_function(motion_values(record))):
        values = record.settings
        key = "values" if values["values"] is not None else "start"
        raise InputError(
            f"the motion of {'an' if record.noun[0] in 'aeiou' else 'a'} {record.noun} must begin "
            "with 0 and must not jump",
            key=key,
            value=values[key],
            cure="Begin the values with 0, and give no time twice.",
        )


def motion_values(record: Record) -> dict[str, Any]:
    """Return the values of a record's time function as numbers, texts and lists."""
    given = {key: getattr(record, key) for key in ("time", *_MOTION_KEYS)}
    return {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in given.items()
        if value is not None
    }


def make_time_function(values: Mapping[str, Any]) -> TimeFunction:
    """Make a time function from the values of its keys, in SI, angles in degrees."""
    kind, start = values["time"], values.get("start") or 0.0
    steady = bool(values.get("steady"))
    if kind == "periodic":
        return time_functions.periodic(values["times"], values["values"], steady=steady)
    if kind == "harmonic":
        phase = math.radians(values.get("phase") or 0.0)
        return time_functions.harmonic(values["frequency"], phase, steady=steady)
    if kind == "table":
        return time_functions.table(values["times"], values["values"], start)
    if kind == "ramp":
        return time_functions.table((0.0, values["rise"]), (0.0, 1.0), start)
    if kind == "pulse":
        length = values["length"]
        return time_functions.table((0.0, length, length), (1.0, 1.0, 0.0), start)
    return time_functions.table((0.0,), (1.0,), start)
