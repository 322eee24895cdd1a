"""A load on a cage as a user writes it: one action and its time function."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import vectors_of
from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.records import Record, Records
from spacemap_vtk.filters.time_keys import TIME_KEYS, check_time_keys, make_time_function
from spacemap_vtk.io import registry
from spacemap_vtk.io.formats.toml import format_value
from spacemap_vtk.mechanics.boundary.places import SIDES
from spacemap_vtk.mechanics.boundary.time_functions import TimeFunction
from spacemap_vtk.mechanics.modal.cage_modes import CageModes, LoadVector
from spacemap_vtk.parameters import (
    Choice,
    FilePath,
    Flag,
    Parameter,
    Real,
    Text,
    Vector,
)

#: The actions, of which a load has exactly one, each with the key of the place where it acts.
ACTIONS = {
    "pressure": "on",
    "traction": "on",
    "force": "at",
    "array": "",
    "gravity": "",
    "base_acceleration": "",
    "base_displacement": "",
}
#: Actions that may act for ever: those that neither move the base nor are gravity.
DEAD_ACTIONS = ("pressure", "traction", "force", "array")
#: Keys of a time function besides its points.
_FUNCTION = ("time", "start", "length", "rise", "frequency", "phase", "steady")


class Numbers(Parameter[Any]):
    """A list of numbers.

    Parameters
    ----------
    help : str
        One sentence, shown wherever the parameter is shown.
    component : Real
        Parameter that checks each number.
    """

    kind = "numbers"
    annotation = "sequence of float"

    def __init__(self, help: str, *, component: Real) -> None:
        super().__init__(None, help, unit=component.unit)
        self.component = component

    def convert(self, value: Any) -> tuple[float, ...]:
        """Convert to a tuple of checked numbers."""
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise InputError("must be a list of numbers")
        return tuple(self.component.convert(component) for component in value)

    def text(self, value: Any) -> str:
        """Format the numbers as in TOML, in SI."""
        return format_value(tuple(float(f"{v:.6g}") for v in value))

    @property
    def expected(self) -> str:
        """The components in words."""
        return f"a list, each {self.component.expected}"


class Load(Record):
    """Act on a cage with a pressure, a force, a moving base …, multiplied by a time function.

    A load has exactly one of ``pressure``, ``traction``, ``force``, ``array``, ``gravity``,
    ``base_acceleration`` and ``base_displacement``. The first two act ``on`` a side, a force acts
    ``at`` a point.

    Examples
    --------
    >>> from spacemap_vtk.filters.load import Load
    >>> load = Load(pressure="20 Pa", on="+z", time="ramp", rise="0.1 s")
    >>> load.function.value(0.05)
    0.5
    """

    section = "response.loads"

    pressure = Real(None, "Pressure on a side; a positive value pushes into the cage.", unit="Pa")
    follower = Flag(
        False, "Keep a pressure normal to its side as the side turns; needs [transient]."
    )
    traction = Vector(None, "Force per area of a side.", component=Real(0.0, "", unit="Pa"))
    force = Vector(None, "Force at a point.", component=Real(0.0, "", unit="N"))
    array = Text("", "Name of a point array of the cage: a force in N on each vertex.")
    gravity = Vector(
        None,
        "Acceleration of gravity, in addition to that of the response.",
        component=Real(0.0, "", unit="m/s2"),
    )
    base_acceleration = Vector(
        None,
        "Common acceleration of all supports; displacements are relative to the supports.",
        component=Real(0.0, "", unit="m/s2"),
    )
    base_displacement = Vector(
        None,
        "Common displacement of all supports; displacements include it.",
        component=Real(0.0, "", unit="m"),
    )
    on = Choice("", "Side of the cage's bounding box.", ["", *SIDES])
    at = Vector(
        None,
        "Point of a force, which acts on the nearest vertex; equally near ones share it.",
        component=Real(0.0, "", unit="m"),
    )
    time = Choice(
        "step",
        "Factor over time. step: 1 from start on; pulse: 1 for a length; ramp: from 0 to 1; table: "
        "linear between points; harmonic: sin(2πft + phase); periodic: a repeated table.",
        list(TIME_KEYS),
    )
    start = Real(None, "Time at which the load begins.", unit="s", minimum=0.0)
    length = Real(None, "Duration of a pulse.", unit="s", above=0.0)
    rise = Real(None, "Rise time of a ramp.", unit="s", above=0.0)
    times = Numbers(
        "Times of a table, relative to start; a time given twice is a jump. If the first time is "
        "above 0, the first value also holds from start to that time. The last time of a periodic "
        "load is its period.",
        component=Real(0.0, "", unit="s", minimum=0.0),
    )
    values = Numbers(
        "Factor at each time; after the last time, a table keeps its last value.",
        component=Real(0.0, ""),
    )
    file = FilePath(
        None,
        "Text file (.csv) with two columns, times in s and factors; replaces times and values.",
    )
    frequency = Real(None, "Frequency of a harmonic load.", unit="1/s", above=0.0)
    phase = Real(
        None,
        "Phase of a harmonic load, in degrees unless it has a unit; 90 degrees give a cosine.",
        unit="deg",
    )
    steady = Flag(
        False, "Let a harmonic or periodic load act for ever, so that the response is steady."
    )

    noun, nouns = "load", "loads"

    def complete(self) -> None:
        """Check action, place and time function, and read the table of a file."""
        given = [name for name in ACTIONS if getattr(self, name) not in (None, "")]
        if len(given) != 1:
            raise InputError(
                f"the load has {' and '.join(given) or 'no action'}",
                allowed="exactly one of " + ", ".join(ACTIONS),
            )
        self._action = given[0]
        if self.follower and self.action != "pressure":
            raise InputError(
                "only a pressure can follow its side",
                key="follower",
                value=True,
                cure="Leave out follower, or give a pressure.",
            )
        self._check_place()
        check_time_keys(self, self.file is not None)
        self._points = (
            (self.times, self.values) if self.file is None else registry.read(self.file, "table")
        )
        try:
            times, values = self._points
            keys: dict[str, Any] = {name: getattr(self, name) for name in _FUNCTION}
            self._function = make_time_function(keys | {"times": times, "values": values})
        except InputError as error:
            if self.file is not None:
                error.key, error.message = "file", f"{error.message}, in {self.file}"
            raise

    @property
    def identity(self) -> Any:
        """The points of the time function: the file may have changed since it was read."""
        return self._points

    @property
    def action(self) -> str:
        """The load's action, a key of `ACTIONS`."""
        return self._action

    @property
    def function(self) -> TimeFunction:
        """The load's factor as a function of time."""
        return self._function

    def _check_place(self) -> None:
        wanted = ACTIONS[self.action]
        for key in ("on", "at"):
            there = getattr(self, key) not in (None, "")
            if key == wanted and not there:
                raise InputError(
                    f"a {self.action} needs a place", key=key, allowed=self.parameter(key).allowed
                )
            if key != wanted and there:
                place = f'needs "{wanted}"' if wanted else "acts on the whole cage"
                raise InputError(f'a {self.action} cannot have "{key}": it {place}', key=key)


class Loads(Records):
    """Any number of loads, given as `Load`, as tables of its keys, or as a text in TOML.

    A scene file writes them as ``[[response.loads]]``.
    """

    kind = "loads"
    annotation = "sequence of Load or dict"
    record = Load
    #: Actions that are allowed, and whether a load may have a time function.
    actions: Sequence[str] = tuple(ACTIONS)
    timed = True

    @property
    def item_allowed(self) -> str:
        """The actions of a load, in words."""
        return f"a table with one of {', '.join(ACTIONS)}"

    @property
    def expected(self) -> str:
        """The keys of a load, in words."""
        others = {*ACTIONS.values(), *(Load.parameters.keys() if self.timed else ())}
        names = [name for name in Load.parameters if name in others - ACTIONS.keys()]
        # Phase is the only number that is not in SI without a unit.
        words = ["phase (in degrees unless it has a unit)" if n == "phase" else n for n in names]
        return (
            f"a list of tables, each with one of {', '.join(self.actions)}, and any of "
            + ", ".join(words)
        )


class DeadLoads(Loads):
    """Loads that are constant in time."""

    actions = DEAD_ACTIONS
    timed = False

    def convert(self, value: Any) -> tuple[Load, ...]:
        """Convert to checked loads, none of which has a time function."""
        loads = super().convert(value)
        for number, load in enumerate(loads):
            if load.follower:
                raise InputError(
                    "a dead load cannot follow its side",
                    key=f"[{number}].follower",
                    value=True,
                    cure="Leave out follower, or move the load to [[transient.loads]].",
                )
            if load.action not in DEAD_ACTIONS or load.time != "step" or load.start is not None:
                raise InputError(
                    "a dead load must be constant and cannot move the base",
                    key=f"[{number}]",
                    value=load.action if load.action not in DEAD_ACTIONS else load.time,
                    allowed=f"one of {', '.join(DEAD_ACTIONS)}, without time or start",
                    cure="Use [[response.loads]] for other loads, and modal.gravity for gravity.",
                )
        return loads


def load_vectors(
    modes: CageModes, grid: vtkUnstructuredGrid, loads: Iterable[Load], key: str
) -> list[LoadVector]:
    """Compute the vectors of loads on a cage.

    Parameters
    ----------
    modes : CageModes
        Modes of the cage.
    grid : vtkUnstructuredGrid
        The cage, with the point arrays that loads name.
    loads : iterable of Load
        The loads.
    key : str
        Name of the parameter that contains the loads, for messages.

    Returns
    -------
    list of LoadVector
        One for each load.

    Raises
    ------
    InputError
        If a load has no place on the cage; the error's key names the load.
    """
    vectors = []
    for number, load in enumerate(loads):
        value, place = getattr(load, load.action), load.on or load.at
        try:
            if load.action == "array":
                place, count = load.array, grid.GetNumberOfPoints()
                with add_key_to_errors("loads.array"):
                    value = vectors_of(grid.GetPointData(), place, count, "the loads")
            vectors.append(
                modes.load_vector(load.action, value, load.function, place, load.follower)
            )
        except InputError as error:
            error.key = (error.key or "loads").replace("loads", f"{key}[{number}]", 1)
            raise
    return vectors
