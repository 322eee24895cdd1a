"""What is fitted to a cage beside supports along its axes and one material.

Sliders along other directions, rigid bodies, springs between the cage and its base, masses, and
factors by which tetrahedra are stiffer or heavier than the material.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError, naming
from spacemap_vtk.mechanics.loads import traction, wall
from spacemap_vtk.mechanics.places import SIDES, Masks, caught, directions, parse
from spacemap_vtk.mechanics.supports import held_components, held_directions, rigid_bodies
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: The units of what is fitted; the second of a spring is per area.
SPRINGS, MASSES = ("N/m", "N/m3"), ("kg",)


class Fittings(NamedTuple):
    """Arrays of what is fitted; None where nothing is."""

    normals: Floats | None = None
    """(V, 3, 3), Σ n nᵀ over the directions n that a vertex is held along."""
    bodies: Ints | None = None
    """(V,), the number of the rigid body that a vertex belongs to, from 1 on; 0 of none."""
    springs: Floats | None = None
    """(V, 3, 3), stiffness against the base [N/m]."""
    masses: Floats | None = None
    """(V,), in kg."""
    stiffness_factors: Floats | None = None
    """(T,), by which the elasticity of each tetrahedron is multiplied."""
    mass_factors: Floats | None = None
    """(T,), by which its density is."""

    @property
    def given(self) -> dict[str, NDArray[Any]]:
        """Those that there are, by name."""
        return {name: array for name, array in self._asdict().items() if array is not None}


#: Nothing is fitted.
NONE = Fittings()


def fitted(
    vertices: Floats,
    cells: Ints,
    fixed: Sequence[str],
    rigid: Sequence[str],
    springs: Sequence[str],
    masses: Sequence[str],
    masks: Masks | None = None,
) -> tuple[Bools, Fittings]:
    """Return what of a cage cannot move, and what is fitted to it besides.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    cells : ndarray of int64, shape (T, 4) or (T, 10)
        Linear or quadratic tetrahedra.
    fixed, rigid, springs, masses : sequence of str
        Places as `spacemap_vtk.mechanics.places.parse` reads them: supports, with components or a
        direction; rigid bodies; springs with a stiffness in N/m of the whole place, or in N/m³ of a
        side's area; masses in kg, which the vertices of each place share alike.
    masks : callable, optional
        Returns the point array of a name, of shape (V,) or, for components, (V, 3).

    Returns
    -------
    held : ndarray of bool, shape (V, 3)
        Components that cannot move.
    fittings : Fittings
        Without factors.

    Raises
    ------
    InputError
        If a place catches no vertex, two bodies share one, a spring per area is not on a side that
        has faces, or nothing could move; its key is the name of the argument.
    """
    with naming("fixed"):
        held = held_components(vertices, fixed, masks)
        normals = held_directions(vertices, fixed, masks)
    with naming("rigid"):
        bodies = rigid_bodies(vertices, rigid, masks)
    with naming("springs"):
        stiffness = spring_stiffness(vertices, cells, springs, masks)
    with naming("masses"):
        return held, Fittings(normals, bodies, stiffness, point_masses(vertices, masses, masks))


def spring_stiffness(
    points: Floats, cells: Ints, springs: Iterable[str], masks: Masks | None = None
) -> Floats | None:
    """Return what springs add to the stiffness of each vertex, (V, 3, 3) [N/m]; None without."""
    # One in N/m is that of the whole place, which its vertices share alike; one in N/m³ is of a
    # side's area, which they share as a constant pressure.
    parsed = [place for text in springs for place in parse(text, SPRINGS, what="spring")]
    if not parsed:
        return None
    total = np.zeros((len(points), 3, 3))
    for place in parsed:
        along = directions(points, place, masks, "spring")
        if place.unit == "N/m":
            share = 1.0 / along.any(axis=(1, 2)).sum()
        elif place.shape in SIDES:
            pressed = wall(points, cells, place.shape)
            share = traction(len(points), pressed, [1.0])[:, 0, None, None]
        else:
            raise InputError(
                f'the spring "{place}" is per area, and only a side has one',
                value=str(place),
                allowed=f"one of {', '.join(SIDES)}, or the place's whole stiffness in N/m",
            )
        total += place.value * share * along
    return total


def point_masses(
    points: Floats, masses: Iterable[str], masks: Masks | None = None
) -> Floats | None:
    """Return the masses fitted to each vertex, (V,) [kg], which those of a place share alike."""
    parsed = [place for text in masses for place in parse(text, MASSES, what="mass", whole=True)]
    if not parsed:
        return None
    total = np.zeros(len(points))
    for place in parsed:
        found = caught(points, place, masks, "mass").reshape(len(points), -1).any(axis=1)
        total[found] += place.value / found.sum()
    return total
