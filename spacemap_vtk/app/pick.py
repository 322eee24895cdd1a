"""A point of the fabric that the user has picked."""

from __future__ import annotations

from dataclasses import dataclass

from spacemap_vtk.units import format_quantity

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Pick:
    """What is known of a picked point.

    Parameters
    ----------
    yarn : int or None
        Its yarn: ends from 0 on, then picks; None on an object.
    family : int or None
        0 warp, 1 weft.
    number : int or None
        The yarn's number among its family's, from 1 on, as weavers count and the draft does.
    position, rest, displacement : tuple of 3 float
        Where it is, where it is at rest, and the difference, in m.
    """

    yarn: int | None
    family: int | None
    number: int | None
    position: Point
    rest: Point
    displacement: Point

    @property
    def text(self) -> str:
        """One line for people."""
        size = sum(c * c for c in self.displacement) ** 0.5
        where = ", ".join(format_quantity(float(f"{c:.4g}"), "m") for c in self.position)
        of = ""
        if self.number is not None and self.family is not None:
            of = f"{('end', 'pick')[self.family]} {self.number}   "
        return f"{of}at ({where})   moved by {format_quantity(float(f'{size:.4g}'), 'm')}"
