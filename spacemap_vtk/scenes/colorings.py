"""Meanings of a surface's colours, declared once for pictures, films and the window.

They are separate from the code that computes their numbers, because the help of a command lists
them and needs no VTK.
"""

from __future__ import annotations

from typing import NamedTuple


class Coloring(NamedTuple):
    """One meaning of colours."""

    #: Label for people; the title of the scale.
    label: str
    #: SI unit of the numbers.
    unit: str = ""
    #: Array that it shows or depends on; a stage must provide it.
    array: str = ""
    #: Whether the array has numbers that are shown on a scale.
    has_scale: bool = False

    @property
    def shows_numbers(self) -> bool:
        """Whether colours represent numbers, of an array or of measured clearances."""
        return self.has_scale or bool(self.array and self.unit)


#: Colourings by their names in scene files, in groups: colours, motion, strain and stress of the
#: cage, its material, and the state of yarns.
GROUPS = (
    {
        "own": Coloring("Own colours"),
        "family": Coloring("Warp and weft", "", "family"),
        "yarn": Coloring("Individual yarns", "", "yarn"),
    },
    {
        "displacement": Coloring("Displacement", "m", "displacement", True),
        "linear_displacement": Coloring("Displacement, linear", "m", "linear_displacement", True),
        "equilibrium": Coloring("Displacement, equilibrium", "m", "equilibrium", True),
        "velocity": Coloring("Velocity", "m/s", "velocity", True),
        "acceleration": Coloring("Acceleration", "m/s2", "acceleration", True),
    },
    {
        "strain": Coloring("Strain, largest principal", "", "strain", True),
        "stress": Coloring("Stress, von Mises", "Pa", "von_mises", True),
        "principal_stress": Coloring("Stress, largest principal", "Pa", "stress", True),
    },
    {
        "stiffness_factor": Coloring("Stiffness factor", "", "stiffness_factor", True),
        "density_factor": Coloring("Density factor", "", "density_factor", True),
    },
    {
        "clearance": Coloring("Clearance", "m", "yarn"),
        "crimp": Coloring("Crimp", "", "crimp", True),
        "yarn_strain": Coloring("Yarn strain", "", "yarn_strain", True),
        "yarn_tension": Coloring("Yarn tension", "N", "yarn_tension", True),
        "contact_force": Coloring("Contact force", "N", "contact_force", True),
        "jammed": Coloring("Jammed crossings", "", "jammed"),
    },
)
COLORINGS = {name: coloring for group in GROUPS for name, coloring in group.items()}
