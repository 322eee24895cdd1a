"""What a surface's colours can mean: declared here once, for pictures, films and the window.

Apart from what computes their numbers: the help of a command names them, and needs no VTK.
"""

from __future__ import annotations

from typing import NamedTuple


class Coloring(NamedTuple):
    """A meaning of colours."""

    #: Words for people; the title of the scale.
    label: str
    #: SI unit of the numbers.
    unit: str = ""
    #: Array that it shows, or without which it is nothing: one that a stage must provide.
    array: str = ""
    #: Whether the array is one of numbers, whose size is shown on a scale.
    scaled: bool = False

    @property
    def numbers(self) -> bool:
        """Whether colours stand for numbers, those of an array or of gaps that are measured."""
        return self.scaled or bool(self.array and self.unit)


#: By the word that a scene file has for it.
COLORINGS = {
    "own": Coloring("Own colours"),
    "family": Coloring("Warp and weft", "", "family"),
    "yarn": Coloring("Yarn by yarn", "", "yarn"),
    "displacement": Coloring("Displacement", "m", "displacement", True),
    "equilibrium": Coloring("Hung state, displacement", "m", "equilibrium", True),
    "velocity": Coloring("Velocity", "m/s", "velocity", True),
    "strain": Coloring("Strain, largest principal", "", "strain", True),
    "stress": Coloring("Stress, von Mises", "Pa", "von_mises", True),
    "clearance": Coloring("Clearance", "m", "yarn"),
    "crimp": Coloring("Crimp", "", "crimp", True),
    "yarn_strain": Coloring("Yarn strain", "", "yarn_strain", True),
    "yarn_tension": Coloring("Yarn tension", "N", "yarn_tension", True),
    "contact_force": Coloring("Contact force", "N", "contact_force", True),
    "jammed": Coloring("Jammed crossings", "", "jammed"),
}
