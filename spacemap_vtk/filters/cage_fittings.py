"""Parameters for supports, rigid bodies, springs and masses of a cage, and stiffness factors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import array_of, mask_reader
from spacemap_vtk.datasets.extent import up_axis
from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.mechanics.boundary.fittings import (
    MASS_UNITS,
    SPRING_UNITS,
    Fittings,
    make_fittings,
)
from spacemap_vtk.mechanics.boundary.grips import PLACE as GRIP_PLACE
from spacemap_vtk.mechanics.boundary.grips import check_axes
from spacemap_vtk.mechanics.boundary.places import ALLOWED, SIDES, Place, parse_places
from spacemap_vtk.mechanics.boundary.supports import RIGID_PLACE, default_support, loose_sides
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.parameters import Parameter, Parameterised, Text

_SEVERAL = '; as one string or a list; "" for none'
_COMPONENTS = (
    'optionally followed by ":" and the components {}, as in "-x:yz", or by a direction, as in '
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
            raise InputError("must be a string or a list of strings")
        found = {str(place): place for text in texts for place in self.read(text)}
        rank = {side: number for number, side in enumerate(SIDES)}

        def order(text: str) -> tuple[Any, ...]:
            place = found[text]
            return rank.get(place.shape, len(rank)), place.shape, place.numbers, text

        return tuple(sorted(found, key=order))

    def text(self, value: tuple[str, ...]) -> str:
        """Join the places to one string."""
        return f'"{" ".join(value)}"'


class Supports(Places):
    """Places that are held."""

    kind = "supports"
    expected = f"{ALLOWED}, {_COMPONENTS.format('to hold')}{_SEVERAL}"


class GripPlaces(Places):
    """Places that a grip holds, along axes."""

    what = GRIP_PLACE
    expected = f'{ALLOWED}, optionally followed by ":" and the components to hold{_SEVERAL}'

    def read(self, text: str) -> list[Place]:
        """Parse the places in a text; refuse directions."""
        found = super().read(text)
        for place in found:
            check_axes(place)
        return found


class RigidPlaces(Places):
    """Places that each move as one rigid body."""

    what, whole = RIGID_PLACE, True
    expected = ALLOWED + _SEVERAL


class Springs(Places):
    """Places with a stiffness."""

    what, units = "spring", SPRING_UNITS
    expected = (
        f"{ALLOWED}, {_COMPONENTS.format('along which it acts')}, and a stiffness in N/m, or for a "
        f'side in N/m3, as in "-z:z 1e5 N/m3"{_SEVERAL}'
    )


class Masses(Places):
    """Places with a mass."""

    what, units, whole = "mass", MASS_UNITS, True
    expected = f'{ALLOWED}, each with a mass, as in "sphere(0, 0, 0, 1 mm) 5 g"{_SEVERAL}'


class CageFittings(Parameterised):
    """Parameters for the supports of a cage and what is attached to it."""

    fixed = Supports(
        "+y",
        "Places of the cage that cannot move: sides of its bounding box, boxes, spheres or point "
        'masks. A colon and components, "-x:yz", hold only these; a direction, "-x:(0, 1, 1)", '
        "lets the place slide in the plane across it.",
        automatic="for an object its bottom, or its top if it is thin",
    )
    rigid = RigidPlaces(
        "",
        "Places that each move as one rigid body, such as a batten along a side. A body has six "
        "degrees of freedom, less those that supports hold, and can turn by small angles only.",
    )
    springs = Springs(
        "",
        "Springs between places of the cage and its base. A stiffness in N/m is shared equally by "
        "the vertices of the place; a stiffness in N/m3 is that of a side per area (an elastic "
        'foundation). Components or a direction after a colon limit a spring: "-z:z 1e5 N/m3".',
    )
    masses = Masses(
        "",
        "Masses at places of the cage, each spread evenly over the place: "
        '"sphere(0, 0, 0, 1 mm) 5 g".',
    )
    stiffness_factors = Text(
        "", "Name of a cell array of the cage: factor on the stiffness of each cell."
    )
    density_factors = Text(
        "", "Name of a cell array of the cage: factor on the density of each cell."
    )

    def make_fittings(
        self, grid: vtkUnstructuredGrid, vertices: Floats, elements: Ints
    ) -> tuple[Bools, Fittings, list[str]]:
        """Return the fixed components (V, 3), the other fittings, and warnings."""
        fixed, mask = self.fixed, mask_reader(grid)
        if fixed is None:
            axis = up_axis(grid)
            fixed = type(self).fixed.default if axis is None else (default_support(vertices, axis),)
            self.values_in_use = {**self.values_in_use, "fixed": fixed}
        held, fittings = make_fittings(
            vertices, elements, fixed, self.rigid, self.springs, self.masses, mask
        )
        loose = [] if self.springs else loose_sides(vertices, fixed, mask)
        warnings = [
            f'the side "{side}" contains only vertices in a line, about which the cage can turn '
            'freely; use a larger box or a sphere, as in fixed = "box(x0, x1, y0, y1, z0, z1)"'
            for side in loose
        ]
        fittings = fittings._replace(
            stiffness_factors=_read_factors(grid, "stiffness_factors", self.stiffness_factors),
            mass_factors=_read_factors(grid, "density_factors", self.density_factors),
        )
        return held, fittings, warnings


def _read_factors(grid: vtkUnstructuredGrid, key: str, name: str) -> Floats | None:
    if not name:
        return None
    with add_key_to_errors(key):
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
                f'the cell array "{name}" has the value {values[cell]:g} in cell {cell}',
                value=name,
                allowed="finite numbers above 0",
            )
        return values.astype(np.float64)
