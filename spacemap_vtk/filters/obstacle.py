"""Obstacles that a cage can touch, as a user writes them, and their terms of energy."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from spacemap_vtk import cache
from spacemap_vtk.datasets.mesh_distance import sample_distance
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.load import Numbers
from spacemap_vtk.filters.records import Record, Records
from spacemap_vtk.filters.time_keys import (
    MOTIONS,
    check_motion,
    make_time_function,
    motion_values,
)
from spacemap_vtk.io import registry
from spacemap_vtk.io.formats.toml import format_value
from spacemap_vtk.io.reading import read_object
from spacemap_vtk.mechanics.contact import obstacles as bodies
from spacemap_vtk.mechanics.contact.layer_friction import LayerFriction
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm
from spacemap_vtk.mechanics.contact.samples import sample_faces, sample_sheet
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.equilibrium.energy_terms import energy_term
from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parameters import Choice, FilePath, Parameter, Real, Vector

#: For each shape, the keys that it needs and the keys that it may have.
SHAPES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "plane": ((), ("normal",)),
    "sphere": (("radius",), ()),
    "cylinder": (("radius",), ("axis", "height", "rounding")),
    "box": (("size",), ("axis", "rounding")),
    "disc": (("radius",), ("axis", "height", "rounding")),
    "mesh": (("file",), ("axis",)),
}
#: Height of a disc over its radius, unless it is given.
_DISC_HEIGHT = 0.1
#: Radius of edges over half of the least thickness, unless it is given.
_ROUNDING = 0.5

#: Keys that an obstacle of any shape may have.
_ALWAYS = ("gap", "friction", "path", "displacement")

_SIZED = ("box",)
_ROUND = ("sphere", "cylinder", "disc")


class Vectors(Parameter[Any]):
    """A list of vectors.

    Parameters
    ----------
    help : str
        One sentence, shown wherever the parameter is shown.
    component : Real
        Parameter that checks each component.
    """

    kind = "vectors"
    annotation = "sequence of sequence of 3 float"

    def __init__(self, help: str, *, component: Real) -> None:
        super().__init__(None, help, unit=component.unit)
        self._vector = Vector(None, help, component=component)

    def convert(self, value: Any) -> tuple[tuple[float, ...], ...]:
        """Convert to a tuple of checked vectors."""
        if isinstance(value, str) or not isinstance(value, Iterable) or not (given := list(value)):
            raise InputError("must be a list of vectors")
        return tuple(self._vector.convert(each) for each in given)

    def text(self, value: Any) -> str:
        """Format the vectors as in TOML, in SI."""
        return format_value(tuple(tuple(float(f"{x:.6g}") for x in each) for each in value))

    @property
    def expected(self) -> str:
        """The vectors in words."""
        return f"a list, each {self._vector.expected}"


class Obstacle(Record):
    """Put a rigid body in the way of a cage: a plane, sphere, cylinder, box, disc or closed mesh.

    Points of the cage's surface meet the obstacle, at the distance `gap`; for a sheet those of its
    mid-surface, half of its thickness further away. Edges that are sharper than the distance
    between these points, a quarter of a cell, are not resolved.

    Examples
    --------
    >>> from spacemap_vtk.filters.obstacle import Obstacle
    >>> Obstacle(shape="disc", radius="90 mm", friction=0.3).radius
    0.09
    """

    section = "modal.obstacles"
    noun, nouns = "obstacle", "obstacles"

    shape = Choice(
        "plane",
        "Shape of the obstacle. A cylinder without a height has no ends; a disc is a low cylinder, "
        "such as the top of a table; mesh is a closed surface from a file.",
        list(SHAPES),
    )
    center = Vector(
        (0.0, 0.0, 0.0),
        "Centre of the body; of a disc, the centre of its upper face; of a plane, any of its "
        "points; of a mesh, where the origin of the file is put.",
        component=Real(0.0, "", unit="m"),
    )
    normal = Vector(
        (0.0, 0.0, 1.0),
        "Direction that leads out of the half-space below a plane.",
        component=Real(0.0, ""),
        when={"shape": ("plane",)},
    )
    axis = Vector(
        (0.0, 0.0, 1.0),
        "Direction of the axis of a cylinder, disc, box or mesh; what is along z by itself is "
        "turned into this direction.",
        component=Real(0.0, ""),
        when={"shape": ("cylinder", "box", "disc", "mesh")},
    )
    radius = Real(
        None,
        "Outer radius of a sphere, cylinder or disc.",
        unit="m",
        above=0.0,
        when={"shape": _ROUND},
    )
    size = Vector(
        None,
        "Lengths of the sides of a box.",
        component=Real(1.0, "", unit="m", above=0.0),
        when={"shape": _SIZED},
    )
    height = Real(
        None,
        "Length of a cylinder along its axis, or thickness of a disc.",
        unit="m",
        above=0.0,
        automatic=f"infinite for a cylinder; {_DISC_HEIGHT:g} times the radius for a disc",
        when={"shape": ("cylinder", "disc")},
    )
    rounding = Real(
        None,
        "Radius of the rounded edges.",
        unit="m",
        minimum=0.0,
        automatic="a quarter of the least thickness",
        when={"shape": ("cylinder", "box", "disc")},
    )
    file = FilePath(
        None, "File of a closed surface, of any mesh format.", when={"shape": ("mesh",)}
    )
    path = Vectors(
        "Displacements from its place through which the obstacle is moved slowly, along straight "
        "lines, before anything moves in time; it stays at the last. All obstacles and grips move "
        "along their first lines at the same time, then along their second ones.",
        component=Real(0.0, "", unit="m"),
    )
    displacement = Vector(
        None,
        "Displacement in time steps, multiplied by a time function.",
        component=Real(0.0, "", unit="m"),
    )
    time = Choice(
        "ramp",
        "Factor of the motion over time. ramp: from 0 to 1; table: linear between points; "
        "harmonic: sin(2πft); periodic: a repeated table.",
        list(MOTIONS),
    )
    start = Real(None, "Time at which the motion begins.", unit="s", minimum=0.0)
    rise = Real(None, "Rise time of a ramp.", unit="s", above=0.0)
    times = Numbers(
        "Times of a table, relative to start. The last time of a periodic motion is its period.",
        component=Real(0.0, "", unit="s", minimum=0.0),
    )
    values = Numbers(
        "Factor at each time, the first 0; after the last time, a table keeps its last value.",
        component=Real(0.0, ""),
    )
    frequency = Real(None, "Frequency of a harmonic motion.", unit="1/s", above=0.0)
    gap = Real(
        0.0,
        "Distance that the cage keeps from the obstacle; for a sheet, in addition to half of its "
        "thickness. With it, pictures do not show that springs of contact give way a little.",
        unit="m",
        minimum=0.0,
    )
    friction = Real(
        0.0,
        "Coefficient of Coulomb friction. With friction the equilibrium depends on the path: the "
        "cage sticks where it first touches, until it is moved.",
        minimum=0.0,
    )

    def complete(self) -> None:
        """Check that the shape has the values that it needs, and no others."""
        needed, possible = SHAPES[self.shape]
        for key in ("normal", "axis", "radius", "size", "height", "rounding", "file"):
            given = key in self.given_values
            if key in needed and not given:
                raise InputError(
                    f'shape = "{self.shape}" needs this value',
                    key=key,
                    allowed=self.parameter(key).allowed,
                )
            if given and key not in needed + possible:
                raise InputError(
                    f'shape = "{self.shape}" does not use this value',
                    key=key,
                    value=getattr(self, key),
                    allowed=", ".join(("center", *needed, *possible, *_ALWAYS)),
                )
        for key in ("normal", "axis"):
            if not any(getattr(self, key)):
                raise InputError("a direction must not be zero", key=key, value=getattr(self, key))
        if (rounding := self.rounding) is not None and rounding > self._half_thickness:
            raise InputError(
                "the edges must not be rounder than the body is thick",
                key="rounding",
                value=rounding,
                allowed=f"at most {self._half_thickness:.4g} m",
            )
        check_motion(self, ("displacement",))
        self._state = None
        if self.file is not None:
            state = registry.require_file(self.file).stat()
            self._state = (state.st_mtime_ns, state.st_size)

    @property
    def motion(self) -> dict[str, Any] | None:
        """Displacement and time function as numbers and texts; None if the obstacle stays."""
        if self.displacement is None:
            return None
        return {"displacement": list(self.displacement), **motion_values(self)}

    @property
    def identity(self) -> Any:
        """Time and size of the file."""
        return self._state

    @property
    def _height(self) -> float:
        if self.height is not None:
            return float(self.height)
        return _DISC_HEIGHT * self.radius if self.shape == "disc" else np.inf

    @property
    def _half_thickness(self) -> float:
        """Half of the least thickness [m]: the largest radius of edges."""
        if self.shape == "box":
            return min(self.size) / 2
        return min(self.radius, self._height / 2)

    @property
    def radius_of_curvature(self) -> float | None:
        """Least radius to which it bends a sheet [m]; None for planes and surfaces from files."""
        if self.shape in ("disc", "box"):
            return float(self.body["rounding"])
        return None if self.radius is None else float(self.radius)

    @property
    def body(self) -> dict[str, Any]:
        """Shape and last place as keyword arguments of `make_body`: numbers and texts."""
        moved = self.path[-1] if self.path else (0.0, 0.0, 0.0)
        center = [x + dx for x, dx in zip(self.center, moved, strict=True)]
        values: dict[str, Any] = {"shape": self.shape, "center": center}
        values["axis"] = list(self.normal if self.shape == "plane" else self.axis)
        if self.shape in ("cylinder", "disc", "box"):
            own = self.rounding
            values["rounding"] = _ROUNDING * self._half_thickness if own is None else own
        if self.radius is not None:
            values["radius"] = self.radius
        if self.size is not None:
            values["size"] = list(self.size)
        if self.shape in ("cylinder", "disc") and np.isfinite(self._height):
            values["height"] = self._height
        if self.file is not None:
            values |= {"file": str(self.file), "state": list(self._state or ())}
        return values


class Obstacles(Records):
    """Any number of obstacles, given as `Obstacle`, as tables of its keys, or as a text in TOML.

    A scene file writes them as ``[[modal.obstacles]]``.
    """

    kind = "obstacles"
    annotation = "sequence of Obstacle or dict"
    record = Obstacle

    @property
    def expected(self) -> str:
        """The keys of an obstacle, in words."""
        others = ", ".join(name for name in Obstacle.parameters if name != "shape")
        return f"a list of tables, each with a shape ({', '.join(SHAPES)}), and any of {others}"


def make_body(
    shape: str,
    center: Any,
    axis: Any,
    radius: float = 0.0,
    size: Any = (),
    height: float = np.inf,
    rounding: float = 0.0,
    file: str = "",
    state: Any = (),
) -> bodies.Obstacle:
    """Make the kernel's body of an obstacle from `Obstacle.body`.

    Parameters
    ----------
    shape : str
        As in scene files.
    center : (3,) float
        Centre; of a disc, that of its upper face [m].
    axis : (3,) float
        Direction of the axis, or the normal of a plane.
    radius : float
        Of a sphere, cylinder or disc [m].
    size : (3,) float
        Sides of a box [m].
    height : float
        Of a cylinder or disc [m].
    rounding : float
        Radius of the rims [m].
    file : str
        Name of the file of a mesh.
    state : sequence of int
        What tells one state of this file from another.

    Returns
    -------
    spacemap_vtk.mechanics.contact.obstacles.Obstacle
        The body at its place.
    """
    if shape == "plane":
        return bodies.Plane(center, axis)
    if shape == "sphere":
        return bodies.Sphere(radius, center)
    if shape == "box":
        return bodies.RoundedBox(size, rounding, center, axis)
    if shape == "cylinder":
        return bodies.Cylinder(radius, height, rounding, center, axis)
    if shape == "disc":
        frame = bodies.frame_along(axis)
        middle = np.asarray(center) - height / 2 * frame[2]
        return bodies.Cylinder(radius, height, rounding, middle, axis)
    return bodies.SampledBody(*_read_distance(file, tuple(state)), center, axis)


@lru_cache(8)
def _read_distance(file: str, state: tuple[int, ...]) -> tuple[Floats, Floats, float]:
    """Read a mesh and sample its distance, or load that from the cache."""
    path = registry.require_file(Path(file))
    key = f"distance-{hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()}"
    entry = cache.load(key, values=(-1, -1, -1), origin=(3,), spacing=(1,))
    if entry is None:
        values, origin, spacing = sample_distance(read_object(path).data)
        cache.store(key, values=values, origin=origin, spacing=np.array([spacing]))
        return values, origin, spacing
    return entry["values"], entry["origin"], float(entry["spacing"][0])


@energy_term("self-contact")
def _make_self_contact(
    points: Floats, cells: Ints, *, thickness: float, stiffness: float
) -> SelfContact:
    """Make the term of a sheet that touches itself."""
    surface = find_mid_surface(points, cells)
    assert surface is not None
    return SelfContact(points, surface, thickness, stiffness)


@energy_term("layer-friction")
def _make_layer_friction(
    points: Floats, cells: Ints, *, friction: float, thickness: float, stiffness: float
) -> LayerFriction:
    """Make the term of friction between layers of a sheet."""
    surface = find_mid_surface(points, cells)
    assert surface is not None
    return LayerFriction(SelfContact(points, surface, thickness, stiffness), friction)


@energy_term("obstacle")
def _make_obstacle_term(
    points: Floats,
    cells: Ints,
    *,
    body: Mapping[str, Any],
    stiffness: float,
    offset: float,
    friction: float,
    sheet: bool,
    motion: Mapping[str, Any] | None = None,
) -> ObstacleTerm:
    """Make the term of an obstacle on a cage: a sheet, or a solid."""
    surface = find_mid_surface(points, cells) if sheet else None
    samples = sample_faces(points, cells) if surface is None else sample_sheet(points, surface)
    found = None
    if motion is not None:
        displacement = np.asarray(motion["displacement"], dtype=np.float64)
        found = bodies.BodyMotion(displacement, make_time_function(motion))
    return ObstacleTerm(
        make_body(**body), samples, stiffness, offset, friction, surface=surface, motion=found
    )
