"""Supports: which components of which vertices are held, in a small language of their own.

A support is a place, and after a colon the components held there; without them all three are:

    +y  -x:yz                     a side of the mesh's bounding box
    box(0, 1 mm, 0, 1 mm, 0, inf) from and to along x, y and z
    sphere(0, 0, 0, 0.5 mm):z     centre and radius
    mask(glued)                   vertices where the point array of that name is not zero
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.units import parse_quantity

#: The sides of a box, and for each its axis and its end.
SIDES = {"-x": (0, -1), "+x": (0, 1), "-y": (1, -1), "+y": (1, 1), "-z": (2, -1), "+z": (2, 1)}

#: What `parse` takes, in words.
ALLOWED = (
    'sides of the box out of "' + '", "'.join(SIDES) + '", '
    '"box(x0, x1, y0, y1, z0, z1)", "sphere(x, y, z, radius)", "mask(name of a point array)", each '
    'with ":" and the components held where not all are, as in "-x:yz"; as one string or a list; '
    'or "" for none'
)

#: How far from its place a vertex may lie, as a share of the mesh's diagonal.
_TOLERANCE = 1e-6

_SUPPORT = re.compile(r"([+-][xyz]|(box|sphere|mask)\s*\(([^()]*)\))(?::([xyz]+))?(?=[\s,;]|$)")

Masks = Callable[[str], NDArray[np.generic]]


class Support(NamedTuple):
    """A place, and the components held there."""

    #: A side, ``"box"``, ``"sphere"`` or ``"mask"``.
    place: str
    #: Of a box (6) or sphere (4), in m.
    numbers: tuple[float, ...]
    #: Of a mask.
    name: str
    #: In the order "xyz".
    components: str

    def __str__(self) -> str:
        text = self.place
        if self.numbers:
            text += "(" + ", ".join(map(_shortest, self.numbers)) + ")"
        elif self.name:
            text += f"({self.name})"
        return text if self.components == "xyz" else f"{text}:{self.components}"


def parse(text: str) -> list[Support]:
    """Read supports.

    Parameters
    ----------
    text : str
        Any number, between spaces, commas or semicolons.

    Returns
    -------
    list of Support
        In the order given.

    Raises
    ------
    InputError
        If something is no support.
    """
    found: list[Support] = []
    at = 0
    while True:
        at += len(text[at:]) - len(text[at:].lstrip(" \t\n,;"))
        if at == len(text):
            return found
        match = _SUPPORT.match(text, at)
        if match is None:
            raise InputError(f'"{text[at:].strip()}" is no support')
        place, shape, inner, components = match.groups()
        held = "".join(c for c in "xyz" if c in (components or "xyz"))
        if shape is None:
            found.append(Support(place, (), "", held))
        elif shape == "mask":
            if not inner.strip():
                raise InputError("mask() names no point array")
            found.append(Support("mask", (), inner.strip(), held))
        else:
            found.append(Support(shape, _numbers(shape, inner), "", held))
        at = match.end()


def held_components(
    vertices: NDArray[np.float64], supports: Iterable[str], masks: Masks | None = None
) -> NDArray[np.bool_]:
    """Return which components of which vertices are held.

    Parameters
    ----------
    vertices : ndarray of float64, shape (V, 3)
        Positions in m.
    supports : iterable of str
        As `parse` reads them; none hold nothing.
    masks : callable, optional
        Returns the point array of a name, of shape (V,) or, for components, (V, 3).

    Returns
    -------
    ndarray of bool, shape (V, 3)
        True where held.

    Raises
    ------
    InputError
        If a support catches no vertex, or nothing is left that could move.

    Examples
    --------
    >>> held_components(np.eye(3), ["+x:z", "sphere(0, 1, 0, 0.1)"]).astype(int).tolist()
    [[0, 0, 1], [1, 1, 1], [0, 0, 0]]
    """
    held = np.zeros(vertices.shape, dtype=np.bool_)
    texts = list(supports)
    for text in texts:
        for support in parse(text):
            caught = _caught(vertices, support, masks)
            if not caught.any():
                low, high = vertices.min(axis=0), vertices.max(axis=0)
                raise InputError(
                    f'the support "{support}" catches no vertex of the cage',
                    key="fixed",
                    value=" ".join(texts),
                    allowed="a place that holds a vertex; the cage reaches from "
                    f"{_triple(low)} to {_triple(high)} m",
                )
            for axis, name in enumerate("xyz"):
                if name in support.components:
                    held[:, axis] |= caught if caught.ndim == 1 else caught[:, axis]
    if held.all():
        raise InputError(
            "every vertex of the cage is held, nothing can move",
            key="fixed",
            value=" ".join(texts),
            cure="Fix fewer sides, or divide the cage more finely.",
        )
    return held


def _caught(
    vertices: NDArray[np.float64], support: Support, masks: Masks | None
) -> NDArray[np.bool_]:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    # A share of the mesh, so that its unit of length does not matter.
    tolerance = _TOLERANCE * float(np.linalg.norm(high - low))
    if support.place in SIDES:
        axis, end = SIDES[support.place]
        wall = high[axis] if end > 0 else low[axis]
        side: NDArray[np.bool_] = np.abs(vertices[:, axis] - wall) <= tolerance
        return side
    if support.place == "box":
        bounds = np.reshape(support.numbers, (3, 2))
        inside = (vertices >= bounds[:, 0] - tolerance) & (vertices <= bounds[:, 1] + tolerance)
        return np.asarray(inside.all(axis=1))
    if support.place == "sphere":
        away = np.linalg.norm(vertices - np.array(support.numbers[:3]), axis=1)
        return np.asarray(away <= support.numbers[3] + tolerance)
    if masks is None:
        raise InputError("masks need a mesh with point arrays", key="fixed", value=str(support))
    mask = np.asarray(masks(support.name)) != 0
    if mask.shape not in ((len(vertices),), vertices.shape):
        raise InputError(
            f'the point array "{support.name}" has {mask.size // max(len(mask), 1)} components',
            key="fixed",
            value=str(support),
            allowed="one component, or three",
        )
    return mask


def _numbers(shape: str, inner: str) -> tuple[float, ...]:
    parts = inner.split(",")
    names = ("x0", "x1", "y0", "y1", "z0", "z1") if shape == "box" else ("x", "y", "z", "radius")
    if len(parts) != len(names):
        raise InputError(
            f"{shape}({inner}) has {len(parts)} lengths",
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


def _shortest(number: float) -> str:
    """Return a text that reads back as the number, but for what "0.1 um" leaves of rounding."""
    return f"{number:.14g}"


def _triple(values: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
