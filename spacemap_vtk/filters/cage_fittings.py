"""Parameters for supports, rigid bodies, springs and masses of a cage, and stiffness factors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import array_of, masks_of
from spacemap_vtk.datasets.extent import up_axis
from spacemap_vtk.errors import InputError, naming
from spacemap_vtk.mechanics.boundary.fittings import (
    MASS_UNITS,
    SPRING_UNITS,
    Fittings,
    make_fittings,
)
from spacemap_vtk.mechanics.boundary.places import ALLOWED, SIDES, Place, parse_places
from spacemap_vtk.mechanics.boundary.supports import RIGID_PLACE, default_support, loose_sides
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parameters import Parameter, Parameterised, Text

_SEVERAL = '; as one string or a list; or "" for none'
_HELD = (
    'each with ":" and the components {} where not all are, as in "-x:yz", or a direction, as in '
    '"-x:(0, 1, 1)"'
)


class Places(Parameter[tuple[str, ...]]):
    """Places of a cage, in the syntax of `spacemap_vtk.mechanics.boundary.places`."""

    kind = "places"
    annotation = "str or sequence of str"

    #: What a place is for, the units of its quantity, and whether it must have all components.
    what: str = "support"
    units: Sequence[str] = ()
    whole = False

    def read(self, text: str) -> list[Place]:
        """Parse the places in a text."""
        return parse_places(text, self.units, what=self.what, whole=self.whole)

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to places in canonical form, each once, sides first."""
        texts = [value] if isinstance(value, str) else value
        if not isinstance(texts, Iterable) or not all(isinstance(t, str) for t in texts):
            raise InputError("neither a string nor a list of strings")
        found = dict.fromkeys(str(place) for text in texts for place in self.read(text))
        rank = {side: number for number, side in enumerate(SIDES)}
        return tuple(sorted(found, key=lambda text: (rank.get(text[:2], len(rank)), text)))

    def text(self, value: tuple[str, ...]) -> str:
        """Join the places to one string."""
        return f'"{" ".join(value)}"'


class Supports(Places):
    """Places that are held."""

    kind = "supports"
    form = f"{ALLOWED}, {_HELD.format('held')}{_SEVERAL}"


class RigidPlaces(Places):
    """Places that each move as one rigid body."""

    what, whole = RIGID_PLACE, True
    form = ALLOWED + _SEVERAL


class Springs(Places):
    """Places with a stiffness."""

    what, units = "spring", SPRING_UNITS
    form = (
        f"{ALLOWED}, {_HELD.format('that it acts along')}, and a stiffness in N/m or, of a side, "
        f'N/m3, as in "-z:z 1e5 N/m3"{_SEVERAL}'
    )


class Masses(Places):
    """Places with a mass."""

    what, units, whole = "mass", MASS_UNITS, True
    form = f'{ALLOWED}, each with a mass, as in "sphere(0, 0, 0, 1 mm) 5 g"{_SEVERAL}'


class CageFittings(Parameterised):
    """Parameters for the supports of a cage and what is attached to it."""

    fixed = Supports(
        "+y",
        "Places of the cage that cannot move: sides of its bounding box, boxes, spheres, point "
        'masks, each in all directions or, after a colon, in those named, "-x:yz", or along one in '
        'parentheses, "-x:(0, 1, 1)", which is a slider in the plane across it.',
        automatic="what an object stands on, or of one that is thin what it hangs by",
    )
    rigid = RigidPlaces(
        "",
        "Places that each move as one rigid piece, such as a batten along a side: six degrees of "
        "freedom, less what supports hold of it. It turns by small angles.",
    )
    springs = Springs(
        "",
        "Springs between places of the cage and its base: N/m is the stiffness of a whole place, "
        "shared alike by the vertices in it, N/m3 that of a side per area, an elastic foundation. "
        'After a colon stand the directions that a spring resists: "-z:z 1e5 N/m3".',
    )
    masses = Masses(
        "",
        "Masses on places of the cage, each spread evenly over its volume, side or edge: "
        '"sphere(0, 0, 0, 1 mm) 5 g".',
    )
    stiffness_factors = Text(
        "",
        "Name of a cell array of the cage: how many times stiffer than the material each cell is.",
    )
    density_factors = Text(
        "",
        "Name of a cell array of the cage: how many times denser than the material each cell is.",
    )

    def make_fittings(
        self, grid: vtkUnstructuredGrid, vertices: Floats, elements: Ints
    ) -> tuple[Bools, Fittings, list[str]]:
        """Return the fixed components (V, 3), the other fittings, and warnings."""
        fixed, mask = self.fixed, masks_of(grid)
        if fixed is None:
            axis = up_axis(grid)
            fixed = type(self).fixed.default if axis is None else (default_support(vertices, axis),)
            self.in_use = {**self.in_use, "fixed": fixed}
        held, fittings = make_fittings(
            vertices, elements, fixed, self.rigid, self.springs, self.masses, mask
        )
        loose = [] if self.springs else loose_sides(vertices, fixed, mask)
        warnings = [
            f'the side "{side}" is one vertex of the cage, or few in a line, about which it '
            "turns freely: what is not flat there is held by a box or a sphere that catches "
            'more, as in fixed = "box(x0, x1, y0, y1, z0, z1)"'
            for side in loose
        ]
        fittings = fittings._replace(
            stiffness_factors=_factors(grid, "stiffness_factors", self.stiffness_factors),
            mass_factors=_factors(grid, "density_factors", self.density_factors),
        )
        return held, fittings, warnings


def _factors(grid: vtkUnstructuredGrid, key: str, name: str) -> Floats | None:
    if not name:
        return None
    with naming(key):
        values = array_of(grid.GetCellData(), name, "the cage")
        if values.shape != (grid.GetNumberOfCells(),):
            raise InputError(
                f'the cell array "{name}" has {values.shape[-1]} components',
                value=name,
                allowed="one number for each cell",
            )
        good = np.isfinite(values) & (values > 0)
        if not good.all():
            cell = int(good.argmin())
            raise InputError(
                f'the cell array "{name}" has {values[cell]:g} in cell {cell}',
                value=name,
                allowed="finite numbers above 0",
            )
        return values.astype(np.float64)
