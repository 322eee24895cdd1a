"""Editor of springs, masses and rigid bodies: a card for each place of the cage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.app.fields.first_values import FirstValues, round_value
from spacemap_vtk.app.fields.record_cards import RecordCards
from spacemap_vtk.filters.cage_fittings import Masses, Places, RigidPlaces, Springs
from spacemap_vtk.filters.records import Record
from spacemap_vtk.mechanics.boundary.places import SIDES, Place
from spacemap_vtk.parameters import Choice, Real, Text, Vector

_BOX, _SPHERE, _MASK = "box", "sphere", "mask"
_ALL, _DIRECTION = "all", "a direction"
#: Sets of components along which a spring can act.
_COMPONENTS = ("x", "y", "z", "xy", "xz", "yz")
#: Radius of a new sphere, over the size of the object.
_RADIUS = 0.3


class PlaceRecord(Record):
    """A place of the cage with its quantity, as the rows of a card."""

    section = "modal"
    #: Quantities, with their units in the text of a place.
    quantities: Mapping[str, str] = {}
    #: Whether components can be chosen.
    has_components = False

    shape = Choice("-z", "Place of the cage.", choices=[*SIDES, _BOX, _SPHERE, _MASK])
    low = Text("0, 0, 0", "Smallest x, y and z of the box, as in 0, 1 mm, -inf.")
    high = Text("0, 0, 0", "Largest x, y and z of the box, as in inf, 1 mm, inf.")
    center = Vector((0.0, 0.0, 0.0), "Centre of the sphere.", component=Real(0.0, "", unit="m"))
    radius = Real(1e-3, "Radius of the sphere.", unit="m", above=0.0)
    name = Text("mask", "Name of a point array of the cage: vertices where it is not zero.")
    along = Choice(
        _ALL, "Components along which it acts.", choices=[_ALL, *_COMPONENTS, _DIRECTION]
    )
    direction = Vector(
        (0.0, 0.0, 1.0), "Direction along which it acts, of any length.", component=Real(0.0, "")
    )

    @classmethod
    def from_place(cls, place: Place) -> PlaceRecord:
        """Make the record of a place."""
        values: dict[str, Any] = {"shape": place.shape}
        if place.shape == _BOX:
            values["low"], values["high"] = (
                ", ".join(f"{n:.9g}" for n in place.numbers[k::2]) for k in (0, 1)
            )
        elif place.shape == _SPHERE:
            values |= {"center": list(place.numbers[:3]), "radius": place.numbers[3]}
        elif place.shape == _MASK:
            values["name"] = place.name
        if place.direction:
            values |= {"along": _DIRECTION, "direction": list(place.direction)}
        elif place.components != "xyz":
            values["along"] = place.components
        values |= {name: place.value for name, unit in cls.quantities.items() if unit == place.unit}
        return cls(**values)

    @property
    def text(self) -> str:
        """The place as in a scene file."""
        text = str(self.shape)
        if self.shape == _BOX:
            low, high = (corner.split(",") for corner in (self.low, self.high))
            ends = [end.strip() for pair in zip(low, high, strict=False) for end in pair]
            text = f"box({', '.join(ends)})"
        elif self.shape == _SPHERE:
            numbers = (*self.center, self.radius)
            text = f"sphere({', '.join(f'{n:.9g}' for n in numbers)})"
        elif self.shape == _MASK:
            text = f"mask({self.name})"
        if self.has_components and self.along == _DIRECTION:
            text += f":({', '.join(f'{n:.9g}' for n in self.direction)})"
        elif self.has_components and self.along != _ALL:
            text += f":{self.along}"
        for name, unit in self.quantities.items():
            if (value := getattr(self, name)) is not None:
                return f"{text} {value:.9g} {unit}"
        return text


class SpringRecord(PlaceRecord):
    """A spring between a place of the cage and its base."""

    noun, nouns = "spring", "springs"
    quantities: Mapping[str, str] = {"stiffness": "N/m", "foundation": "N/m3"}
    has_components = True

    stiffness = Real(
        None, "Stiffness, shared equally by the vertices of the place.", unit="N/m", above=0.0
    )
    foundation = Real(
        None, "Stiffness of a side per area (an elastic foundation).", unit="N/m3", above=0.0
    )


class MassRecord(PlaceRecord):
    """A mass, spread evenly over a place of the cage."""

    noun, nouns = "mass", "masses"
    quantities: Mapping[str, str] = {"mass": "kg"}

    mass = Real(1e-3, "Mass, spread evenly over the place.", unit="kg", above=0.0)


class RigidRecord(PlaceRecord):
    """A place of the cage that moves as one rigid body."""

    noun, nouns = "rigid body", "rigid bodies"


_RECORDS: dict[type[Places], type[PlaceRecord]] = {
    Springs: SpringRecord,
    Masses: MassRecord,
    RigidPlaces: RigidRecord,
}
#: The parameters that this editor is for.
PLACES = (Springs, Masses, RigidPlaces)


class PlacesEditor(RecordCards):
    """Cards of the places, each with its shape, components and quantity."""

    def __init__(self, parameter: Places) -> None:
        self._record = _RECORDS[type(parameter)]
        self._places = parameter
        super().__init__(parameter, [*SIDES, _SPHERE, _BOX, _MASK], self._record.noun)
        self._low, self._high = np.zeros(3), np.full(3, 0.01)
        #: The shown cage, whose mass and stiffness new cards change a little; None without one.
        self.cage: vtkUnstructuredGrid | None = None

    def set_bounds(self, bounds: Sequence[float]) -> None:
        """Set the bounds [m] of the object: new spheres and boxes are at its corner."""
        self._low, self._high = np.reshape(bounds, (3, 2)).T

    def show_value(self, value: Sequence[str]) -> None:
        """Show the places on cards."""
        places = [place for text in value for place in self._places.read(text)]
        super().show_value([self._record.from_place(place) for place in places])

    def as_value(self, tables: list[dict[str, Any]]) -> list[str]:
        """Return the texts of the places."""
        return [self._record(**table).text for table in tables]

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new card."""
        return {"shape": kind, **self._sized(kind), **self._first_quantity()}

    def kind_of(self, record: PlaceRecord) -> str:
        """Return the shape of a place."""
        return str(record.shape)

    def change_kind(self, record: PlaceRecord, kind: str) -> dict[str, Any]:
        """Return the changes for another shape."""
        cleared = dict.fromkeys(("low", "high", "center", "radius", "name"))
        changes = {**cleared, "shape": kind, **self._sized(kind)}
        if kind not in SIDES and record._values.get("foundation") is not None:
            changes |= {"foundation": None, **self._first_quantity()}
        return changes

    def change_value(self, record: PlaceRecord, name: str, value: Any) -> dict[str, Any]:
        """Return the changes; a spring has either of two kinds of stiffness."""
        changes = {name: value}
        if name in record.quantities:
            others = [other for other in record.quantities if other != name]
            changes |= dict.fromkeys(others) if value is not None else {}
        return changes

    def is_optional(self, record: PlaceRecord, name: str) -> bool:
        """Return whether a place may do without this value."""
        return name == "along"

    def row_names(self, record: PlaceRecord) -> list[str]:
        """Return the keys of the rows of a place."""
        shape = {_BOX: ["low", "high"], _SPHERE: ["center", "radius"], _MASK: ["name"]}
        names = list(shape.get(record.shape, ()))
        if record.has_components:
            names += ["along", *(["direction"] if record.along == _DIRECTION else [])]
        quantities = list(record.quantities)
        if record.shape not in SIDES:
            quantities = quantities[:1]
        return names + quantities

    def _first_quantity(self) -> dict[str, float]:
        """Return the quantity of a new card."""
        values = FirstValues.from_cage(self.cage)
        found = {"stiffness": values.stiffness, "mass": values.mass}
        return {n: round_value(found[n]) for n in self._record.quantities if n in found}

    def _sized(self, kind: str) -> dict[str, Any]:
        """Return a sphere or box at a corner of the object, where the cage has a vertex."""
        size = float((self._high - self._low).max())
        if kind == _SPHERE:
            center = [float(f"{c:.3g}") for c in self._low]
            return {"center": center, "radius": float(f"{_RADIUS * size:.2g}")}
        if kind == _BOX:
            ends = (float(f"{c + _RADIUS * size:.3g}") for c in self._low)
            return {"low": "-inf, -inf, -inf", "high": ", ".join(f"{end:g}" for end in ends)}
        return {}
