"""Places of a cage as short texts: where it is held, or where something is fitted.

A place is a side of the mesh's bounding box, a box, a sphere, or a mask. After a colon it may name
the components that count there, or a direction; otherwise all three components count:

    +y  -x:yz  -x:(0, 1, 1)       sides; the last along one direction, of any length
    box(0, 1 mm, 0, 1 mm, 0, inf) from and to along x, y and z
    sphere(0, 0, 0, 0.5 mm):z     centre and radius
    mask(glued)                   vertices where the point array of that name is not zero
    -z:z 1e5 N/m3                 with a quantity: a spring, a mass
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.units import UNITS, format_quantity, parse_quantity

#: Sides of a box, each with its axis and its end.
SIDES = {"-x": (0, -1), "+x": (0, 1), "-y": (1, -1), "+y": (1, 1), "-z": (2, -1), "+z": (2, 1)}

#: Description of the places that `parse_places` accepts.
ALLOWED = (
    'sides of the box out of "' + '", "'.join(SIDES) + '", '
    '"box(x0, x1, y0, y1, z0, z1)", "sphere(x, y, z, radius)", "mask(name of a point array)"'
)

#: Units in which a quantity is written, the smallest first, in addition to the SI unit.
_DISPLAY_UNITS = {"kg": ("mg", "g", "kg")}

#: Largest distance of a vertex from its place, as a share of the mesh's diagonal.
_TOLERANCE = 1e-6

_PLACE = re.compile(
    r"([+-][xyz]|(box|sphere|mask)\s*\(([^()]*)\))(?::\s*([xyz]+|\([^()]*\)))?(?=[\s,;]|$)"
)
_QUANTITY = re.compile(r"\s+([-+]?\.?\d[\d.]*(?:[eE][-+]?\d+)?)\s*([^\W\d][^\s,;]*)?(?=[\s,;]|$)")

Masks = Callable[[str], NDArray[np.generic]]


class Place(NamedTuple):
    """Place, the components or direction that count there, and its quantity."""

    shape: str
    """Side, ``"box"``, ``"sphere"`` or ``"mask"``."""
    numbers: tuple[float, ...] = ()
    """Numbers of a box (6) or sphere (4) [m]."""
    name: str = ""
    """Name of a mask."""
    components: str = "xyz"
    """Components in the order "xyz"; empty if there is a direction."""
    direction: tuple[float, ...] = ()
    """Direction of any length."""
    value: float = 0.0
    """Quantity in `unit`."""
    unit: str = ""
    """SI unit; empty if there is no quantity."""

    def __str__(self) -> str:
        return self._format(_format_number)

    def with_units(self) -> str:
        """Format the place with lengths as people write them, such as "0.3 mm".

        Returns
        -------
        str
            A text that `parse_places` reads as this place, within 14 digits.
        """
        return self._format(_format_length)

    def _format(self, format_length: Callable[[float], str]) -> str:
        text = self.shape
        if self.numbers:
            text += f"({', '.join(map(format_length, self.numbers))})"
        elif self.name:
            text += f"({self.name})"
        if self.direction:
            text += ":" + _format_tuple(self.direction)
        elif self.components != "xyz":
            text += ":" + self.components
        if not self.unit:
            return text
        units = _DISPLAY_UNITS.get(self.unit, (self.unit,))
        fitting = [n for n in units if self.value >= UNITS[self.unit][n]]
        unit = fitting[-1] if fitting else units[0]
        return f"{text} {_format_number(self.value / UNITS[self.unit][unit])} {unit}"


def parse_places(
    text: str, units: Sequence[str] = (), *, what: str = "support", whole: bool = False
) -> list[Place]:
    """Parse places.

    Parameters
    ----------
    text : str
        Any number of places, separated by spaces, commas or semicolons.
    units : sequence of str, optional
        Keys of `spacemap_vtk.units.UNITS`. Each place must have a quantity in one of these units;
        without units no place may have one.
    what : str, optional
        Word for a place in messages.
    whole : bool, optional
        Whether a place must not name components or a direction.

    Returns
    -------
    list of Region
        Places in the given order.

    Raises
    ------
    InputError
        If a part of the text is not a place, or its quantity is invalid.
    """
    found: list[Place] = []
    at = 0
    while True:
        at += len(text[at:]) - len(text[at:].lstrip(" \t\n,;"))
        if at == len(text):
            return found
        match = _PLACE.match(text, at)
        if match is None:
            raise InputError(f'"{text[at:].strip()}" is not a {what}')
        side, shape, inner, held = match.groups()
        if held and whole:
            raise InputError(
                f'a {what} cannot name components: "{match[0]}"', cure='Leave out ":…"'
            )
        name, numbers = "", tuple[float, ...]()
        if shape == "mask":
            name = inner.strip()
            if not name:
                raise InputError("mask() must name a point array")
        elif shape is not None:
            numbers = _parse_lengths(shape, inner)
        place = Place(shape or side, numbers, name, *_parse_components(held or "xyz"))
        at = match.end()
        if units:
            quantity = _QUANTITY.match(text, at)
            value, unit = _parse_quantity(match[0], quantity, units)
            place = place._replace(value=value, unit=unit)
            at = at if quantity is None else quantity.end()
        found.append(place)


def find_vertices(
    vertices: Floats, place: Place, masks: Masks | None = None, what: str = "support"
) -> Bools:
    """Find the vertices in a place.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Vertices of the mesh [m].
    place : Place
        Side, box, sphere or mask.
    masks : callable, optional
        Function from the name of a point array to its values.
    what : str, optional
        Word for the place in a message.

    Returns
    -------
    ndarray of bool, shape (V,)
        Whether each vertex is in it.

    Raises
    ------
    InputError
        If none is.
    """
    found = find_components(vertices, place, masks, what)
    return np.asarray(found.reshape(len(vertices), -1).any(axis=1))


def find_components(
    vertices: Floats, place: Place, masks: Masks | None = None, what: str = "support"
) -> Bools:
    """Find the vertices in a place, (V,), or for a mask the components, (V, 3); raise if none."""
    found = _is_inside(vertices, place, masks)
    if not found.any():
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        raise InputError(
            f'the {what} "{place}" contains no vertex of the cage',
            value=str(place),
            allowed="a place with at least one vertex; the cage extends from "
            f"{_format_point(low)} to {_format_point(high)} m",
        )
    return found


def directions(
    vertices: Floats, place: Place, masks: Masks | None = None, what: str = "support"
) -> Floats:
    """Compute Σ n nᵀ over the directions n that count at each vertex, (V, 3, 3)."""
    found = find_components(vertices, place, masks, what)
    if place.direction:
        if found.ndim == 2:
            raise InputError(
                f'the point array "{place.name}" has three components, so "{place}" cannot name a '
                "direction",
                value=str(place),
                cure="Use a point array with one component",
            )
        normal = np.array(place.direction) / np.linalg.norm(place.direction)
        return np.where(found[:, None, None], np.outer(normal, normal), 0.0)
    axes = np.array([axis in place.components for axis in "xyz"])
    return np.einsum("vi,ij->vij", (found.reshape(len(found), -1) & axes) * 1.0, np.eye(3))


def find_spans(
    low: Floats, high: Floats, places: Sequence[Place], normal: int | None = None
) -> list[list[tuple[float, float]]]:
    """Find where boxes and spheres begin and end along each axis of a mesh.

    Parameters
    ----------
    low, high : ndarray of float64, shape (3,)
        Corners of the mesh's box [m].
    places : sequence of Place
        Places; only boxes and spheres have spans.
    normal : int, optional
        Axis across a sheet, in whose middle spheres are cut.

    Returns
    -------
    list of 3 lists of tuple of float
        Begin and end of each place as shares of the mesh's extent, 0 to 1, for each axis.
    """
    found: list[list[tuple[float, float]]] = [[], [], []]
    for place in places:
        if place.shape == "box":
            ends = np.reshape(place.numbers, (3, 2))
        elif place.shape == "sphere":
            center, radius = np.array(place.numbers[:3]), place.numbers[3]
            if normal is not None:
                above = (low[normal] + high[normal]) / 2 - center[normal]
                radius = float(np.sqrt(max(radius**2 - above**2, 0.0)))
            ends = np.stack([center - radius, center + radius], axis=1)
        else:
            continue
        for axis in np.flatnonzero(high > low):
            first, last = np.clip((ends[axis] - low[axis]) / (high[axis] - low[axis]), 0.0, 1.0)
            found[axis].append((float(first), float(last)))
    return found


def ends_between_vertices(vertices: Floats, place: Place) -> bool:
    """Return whether a box ends between vertices, so that it holds less than it contains.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Vertices of the mesh [m].
    place : Place
        Side, box, sphere or mask.

    Returns
    -------
    bool
        False for places that are no boxes.
    """
    if place.shape != "box":
        return False
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    tolerance = _TOLERANCE * float(np.linalg.norm(high - low))
    for axis, edges in enumerate(np.reshape(place.numbers, (3, 2))):
        lines = np.unique(vertices[:, axis])
        inner = edges[(edges > low[axis]) & (edges < high[axis])]
        # A sheet has no vertices between its faces.
        if len(lines) > 2 and (np.abs(lines - inner[:, None]).min(axis=1) > tolerance).any():
            return True
    return False


def _is_inside(vertices: Floats, place: Place, masks: Masks | None) -> Bools:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    # Relative to the mesh, so that the unit of length does not matter.
    tolerance = _TOLERANCE * float(np.linalg.norm(high - low))
    if place.shape in SIDES:
        axis, end = SIDES[place.shape]
        side = high[axis] if end > 0 else low[axis]
        return np.abs(vertices[:, axis] - side) <= tolerance
    if place.shape == "box":
        bounds = np.reshape(place.numbers, (3, 2))
        inside = (vertices >= bounds[:, 0] - tolerance) & (vertices <= bounds[:, 1] + tolerance)
        return np.asarray(inside.all(axis=1))
    if place.shape == "sphere":
        distance = np.linalg.norm(vertices - np.array(place.numbers[:3]), axis=1)
        return np.asarray(distance <= place.numbers[3] + tolerance)
    if masks is None:
        raise InputError("masks need a mesh with point arrays", value=str(place))
    mask = np.asarray(masks(place.name)) != 0
    if mask.shape not in ((len(vertices),), vertices.shape):
        raise InputError(
            f'the point array "{place.name}" has {mask.size // max(len(mask), 1)} components',
            value=str(place),
            allowed="one or three components",
        )
    return mask


def _parse_lengths(shape: str, inner: str) -> tuple[float, ...]:
    parts = inner.split(",")
    names = ("x0", "x1", "y0", "y1", "z0", "z1") if shape == "box" else ("x", "y", "z", "radius")
    if len(parts) != len(names):
        raise InputError(
            f"{shape}({inner}) has {len(parts)} values",
            allowed=f"{shape}({', '.join(names)}), each in m or with its unit",
        )
    try:
        numbers = tuple(parse_quantity(part, "m") for part in parts)
    except InputError as error:
        raise InputError(f"{shape}({inner}): {error.message}", allowed=error.allowed) from None
    bad = (
        any(not a <= b for a, b in zip(numbers[::2], numbers[1::2], strict=True))
        if shape == "box"
        else not (numbers[3] >= 0 and np.isfinite(numbers).all())
    )
    if bad:
        raise InputError(
            f"{shape}({inner}) is empty",
            allowed="x0 <= x1, y0 <= y1, z0 <= z1" if shape == "box" else "a radius of at least 0",
        )
    return numbers


def _parse_components(text: str) -> tuple[str, tuple[float, ...]]:
    """Parse components, or a direction that is not along an axis."""
    if not text.startswith("("):
        return "".join(c for c in "xyz" if c in text), ()
    try:
        direction = tuple(float(part) for part in text[1:-1].split(","))
    except ValueError:
        direction = ()
    if len(direction) != 3 or not np.isfinite(direction).all() or not any(direction):
        raise InputError(f"{text} is not a direction", allowed="(x, y, z), not all 0")
    along = [c for c, share in zip("xyz", direction, strict=True) if share]
    return (along[0], ()) if len(along) == 1 else ("", direction)


def _parse_quantity(
    place: str, match: re.Match[str] | None, units: Sequence[str]
) -> tuple[float, str]:
    """Parse a value above 0 and find its SI unit from the unit in the text."""
    given = "" if match is None else match[0].strip()
    for unit in units:
        try:
            value = parse_quantity(given, unit)
        except InputError:
            continue
        if match is not None and match[2] and 0 < value < float("inf"):
            return value, unit
    raise InputError(
        f'"{place}" has no value' if not given else f'"{place}" has an invalid value: {given}',
        allowed="a number above 0 with one of the units "
        + ", ".join(n for u in units for n in UNITS[u]),
    )


def _format_tuple(numbers: Sequence[float]) -> str:
    return "(" + ", ".join(map(_format_number, numbers)) + ")"


def _format_number(number: float) -> str:
    """Format a number that reads back as the same, except for rounding such as in "0.1 um"."""
    return f"{number:.14g}"


def _format_length(value: float) -> str:
    """Format a length with its unit, or in m where rounding in the unit would change it."""
    number = _format_number(value)
    if not value or not np.isfinite(value):
        return number
    text = format_quantity(value, "m")
    return text if _format_number(parse_quantity(text, "m")) == number else number


def _format_point(values: Floats) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
