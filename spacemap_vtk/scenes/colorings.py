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
    #: Array of the cage that must ride along for it.
    carried: str = ""
    #: Whether it takes yarns; whether it takes a cage that moves.
    weave: bool = False
    moves: bool = False


#: By the word that a scene file has for it.
COLORINGS = {
    "own": Coloring("Own colours"),
    "family": Coloring("Warp and weft", weave=True),
    "yarn": Coloring("Yarn by yarn", weave=True),
    "displacement": Coloring("Displacement", "m", moves=True),
    "velocity": Coloring("Velocity", "m/s", "velocity", moves=True),
    "strain": Coloring("Strain, largest principal", "", "strain", moves=True),
    "stress": Coloring("Stress, von Mises", "Pa", "von_mises", moves=True),
    "clearance": Coloring("Clearance", "m", weave=True),
}
