"""Insets of a scene's pictures: magnified parts of the same picture, each in a frame."""

from __future__ import annotations

from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.records import Record, Records
from spacemap_vtk.parameters import Choice, Flag, Real, Vector

#: Corners of the picture: right and upper, as 0 or 1.
CORNERS = {
    "upper right": (1, 1),
    "upper left": (0, 1),
    "lower right": (1, 0),
    "lower left": (0, 0),
}
SHAPES = ("circle", "square")


class Inset(Record):
    """A close-up of a place of the picture, with a scale bar, in a corner of the picture."""

    section = "view.insets"
    noun, nouns = "inset", "insets"

    place = Vector(
        (0.5, 0.5),
        "The magnified place, as shares of the picture's width from the left and of its height "
        "from below.",
        component=Real(0.0, "", minimum=0.0, maximum=1.0),
        labels="xy",
    )
    magnification = Real(
        6.0, "How much larger the inset is than the picture around it.", above=1.0, maximum=1000.0
    )
    corner = Choice(
        None,
        "Corner of the picture where the inset is.",
        list(CORNERS),
        automatic="above or below the place, where there is more room, on its side",
    )
    size = Real(
        0.42, "Width of the inset, as a share of the picture's height.", minimum=0.1, maximum=0.9
    )
    shape = Choice("circle", "Shape of the inset's frame.", list(SHAPES))
    scale_bar = Flag(True, "Draw a scale bar in the inset.")

    @property
    def corner_of_picture(self) -> tuple[int, int]:
        """The corner: right and upper, as 0 or 1."""
        if self.corner is not None:
            return CORNERS[self.corner]
        x, y = self.place
        return int(x > 0.5), int(y <= 0.5)


class Insets(Records):
    """Any number of insets; a scene file writes them as ``[[view.insets]]``."""

    kind = "insets"
    annotation = "sequence of Inset or dict"
    record = Inset

    @property
    def expected(self) -> str:
        """The keys of an inset, in words."""
        return f"a list of tables, each with any of {', '.join(Inset.parameters)}"

    def convert(self, value: Any) -> tuple[Any, ...]:
        """Convert to checked insets, of which no two are in one corner."""
        insets = super().convert(value)
        corners = [inset.corner_of_picture for inset in insets]
        for number, corner in enumerate(corners):
            if corner in corners[:number]:
                raise InputError(
                    "two insets are in this corner",
                    key=f"[{number}].corner",
                    value=next(name for name, which in CORNERS.items() if which == corner),
                    allowed=", ".join(CORNERS),
                )
        return insets
