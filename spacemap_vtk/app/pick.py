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
    yarn : int
        Its yarn: ends from 0 on, then picks.
    family : int
        0 warp, 1 weft.
    position, rest, displacement : tuple of 3 float
        Where it is, where it is at rest, and the difference, in m.
    """

    yarn: int
    family: int
    position: Point
    rest: Point
    displacement: Point

    @property
    def text(self) -> str:
        """One line for people."""
        size = sum(c * c for c in self.displacement) ** 0.5
        where = ", ".join(format_quantity(float(f"{c:.4g}"), "m") for c in self.position)
        return (
            f"yarn {self.yarn} ({('warp', 'weft')[self.family]})   at ({where})   "
            f"moved by {format_quantity(float(f'{size:.4g}'), 'm')}"
        )
