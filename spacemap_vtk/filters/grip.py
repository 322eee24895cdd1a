"""Grips that hold, move and turn places of a cage, as a user writes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.filters.cage_fittings import GripPlaces
from spacemap_vtk.filters.obstacle import Obstacle, Vectors
from spacemap_vtk.filters.records import Record, Records
from spacemap_vtk.filters.time_keys import check_motion, make_time_function, motion_values
from spacemap_vtk.mechanics.boundary.grips import Grip as GripKernel
from spacemap_vtk.mechanics.boundary.grips import GripMotion, held_by, make_grip
from spacemap_vtk.mechanics.boundary.places import Masks
from spacemap_vtk.mechanics.boundary.reactions import Bearing, find_bearings
from spacemap_vtk.mechanics.contact.path import divide_path
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.parameters import Real, Vector


class Grip(Record):
    """Hold a place of a cage, and move and turn it.

    The vertices of the place move as a rigid body: they turn about the centre of the grip, and are
    displaced with it. First the grip follows its `path` and `turns` slowly, through states at rest;
    then, in [transient], its `displacement` and `rotation` in time.

    Examples
    --------
    >>> from spacemap_vtk.filters.grip import Grip
    >>> Grip(place="+x", path=[["5 mm", 0, 0]], turns=[["90 deg", 0, 0]]).turns
    ((90.0, 0.0, 0.0),)
    """

    section = "modal.grips"
    noun, nouns = "grip", "grips"

    place = GripPlaces(
        None,
        "Place that the grip holds; several places move together. A colon and components, "
        '"+x:x", hold only these.',
    )
    center = Vector(
        None,
        "Centre about which the grip turns, before it is displaced; also the point to which the "
        "moment of its reaction refers.",
        component=Real(0.0, "", unit="m"),
        automatic="the mean of its vertices",
    )
    path = Vectors(
        "Displacements through which the grip is moved slowly, along straight lines, before "
        "anything moves in time; it stays at the last. All grips and obstacles move along their "
        "first lines at the same time, then along their second ones.",
        component=Real(0.0, "", unit="m"),
    )
    turns = Vectors(
        "Angles about x, y and z (a rotation vector) through which the grip is turned slowly, one "
        "for each line of the path; it stays at the last.",
        component=Real(0.0, "", unit="deg"),
    )
    displacement = Obstacle.displacement
    rotation = Vector(
        None,
        "Angles about x, y and z (a rotation vector) by which the grip is turned in time steps, "
        "multiplied by the time function.",
        component=Real(0.0, "", unit="deg"),
    )
    time = Obstacle.time
    start = Obstacle.start
    rise = Obstacle.rise
    times = Obstacle.times
    values = Obstacle.values
    frequency = Obstacle.frequency

    def complete(self) -> None:
        """Check the place, and that what turns is held wholly."""
        if not self.place:
            raise InputError("a grip needs a place", key="place", allowed=GripPlaces.expected)
        for key in ("turns", "rotation"):
            value = getattr(self, key)
            if value is not None and any(place.components != "xyz" for place in self._places):
                raise InputError(
                    "a grip that leaves components free cannot turn",
                    key=key,
                    value=value,
                    cure='Let it hold all components: leave out ":…" behind its place.',
                )
        check_motion(self, ("displacement", "rotation"))

    @property
    def _places(self) -> Sequence[Any]:
        parameter = self.parameter("place")
        assert isinstance(parameter, GripPlaces)
        return [place for text in self.place for place in parameter.read(text)]

    @property
    def motion(self) -> dict[str, Any] | None:
        """Displacement [m], rotation [deg] and time function; None without a motion in time."""
        if self.displacement is None and self.rotation is None:
            return None
        nothing = (0.0, 0.0, 0.0)
        return {
            "displacement": list(self.displacement or nothing),
            "rotation": list(self.rotation or nothing),
            **motion_values(self),
        }


class Grips(Records):
    """Any number of grips, given as `Grip`, as tables of its keys, or as a text in TOML.

    A scene file writes them as ``[[modal.grips]]``.
    """

    kind = "grips"
    annotation = "sequence of Grip or dict"
    record = Grip

    @property
    def expected(self) -> str:
        """The keys of a grip, in words."""
        others = ", ".join(name for name in Grip.parameters if name != "place")
        return f"a list of tables, each with a place, and any of {others}"


def make_grips(
    grips: Sequence[Grip], points: Floats, steps: int, lines: int, masks: Masks | None = None
) -> list[GripKernel]:
    """Make the kernel's grips.

    Parameters
    ----------
    grips : sequence of Grip
        The grips as a user writes them.
    points : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    steps : int
        Number of steps along each straight line of a path.
    lines : int
        Number of lines of the longest path; without lines a grip stays where it is.
    masks : callable, optional
        Function from the name of a point array to its values.

    Returns
    -------
    list of spacemap_vtk.mechanics.boundary.grips.Grip
        Grips with 1 + `steps` · `lines` places.

    Raises
    ------
    InputError
        If a place contains no vertex.
    """
    found = []
    for number, grip in enumerate(grips):
        places = []
        for corners in (grip.path, grip.turns):
            ends = list(corners or [(0.0, 0.0, 0.0)])
            ends += [ends[-1]] * (lines - len(ends))
            path = divide_path([ends[:lines]], steps)[:, 0]
            places.append(path - path[0])
        with add_key_to_errors(f"grips[{number}]"):
            found.append(
                make_grip(
                    points,
                    " ".join(grip.place),
                    moves=places[0],
                    turns=np.radians(places[1]),
                    center=grip.center,
                    masks=masks,
                )
            )
    return found


def bearing_recipe(fixed: Sequence[str], grips: Sequence[Grip]) -> dict[str, Any]:
    """Describe supports and grips as numbers and texts.

    Parameters
    ----------
    fixed : sequence of str
        Places of the supports.
    grips : sequence of Grip
        The grips.

    Returns
    -------
    dict
        For `read_bearings`.
    """
    nothing = (0.0, 0.0, 0.0)
    return {
        "supports": list(fixed),
        "grips": [
            {
                "place": " ".join(grip.place),
                "center": None if grip.center is None else list(grip.center),
                "move": list((grip.path or [nothing])[-1]),
                "turn": list((grip.turns or [nothing])[-1]),
                "motion": grip.motion,
            }
            for grip in grips
        ],
    }


def read_bearings(
    recipe: Mapping[str, Any], points: Floats, masks: Masks | None = None
) -> tuple[list[GripKernel], list[Bearing]]:
    """Make grips, in their last places, and bearings from their description.

    Parameters
    ----------
    recipe : mapping
        From `bearing_recipe`; may be empty.
    points : ndarray of float64, shape (V, 3)
        Vertices at rest [m].
    masks : callable, optional
        Function from the name of a point array to its values.

    Returns
    -------
    grips : list of spacemap_vtk.mechanics.boundary.grips.Grip
        Grips with one place, and with their motion in time.
    bearings : list of Bearing
        Supports and grips.
    """
    grips = []
    for given in recipe.get("grips", ()):
        grip = make_grip(
            points,
            given["place"],
            moves=[given["move"]],
            turns=np.radians([given["turn"]]),
            center=given["center"],
            masks=masks,
        )
        if (motion := given["motion"]) is not None:
            turn = np.radians(motion["rotation"])
            moved = np.array(motion["displacement"], dtype=np.float64)
            grip = grip._replace(motion=GripMotion(moved, turn, make_time_function(motion)))
        grips.append(grip)
    return grips, find_bearings(points, recipe.get("supports", ()), grips, masks)


def hold_with_grips(held: Bools, grips: Sequence[GripKernel]) -> Bools:
    """Add what grips hold to what supports hold.

    Parameters
    ----------
    held : ndarray of bool, shape (V, 3)
        Components that supports hold.
    grips : sequence of spacemap_vtk.mechanics.boundary.grips.Grip
        Grips.

    Returns
    -------
    ndarray of bool, shape (V, 3)
        Components that either of them holds.

    Raises
    ------
    InputError
        If two of them hold the same component.
    """
    taken, owner = held, "a support"
    for number, grip in enumerate(grips):
        if (both := taken & grip.held).any():
            vertex, axis = np.argwhere(both)[0].tolist()
            raise InputError(
                f'the grip "{grip.name}" and {owner} hold the same component of a vertex',
                key=f"grips[{number}].place",
                value=f"{'xyz'[axis]} of vertex {vertex}",
                cure='Let each hold its own part, for example with a box; fixed = "" is no '
                "support at all.",
            )
        taken, owner = taken | grip.held, "another grip"
    return held | held_by(grips, held.shape)
