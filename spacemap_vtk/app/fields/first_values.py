"""First values of new loads, masses and springs: those that bend the shown cage a little."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import array_of, points_of
from spacemap_vtk.datasets.modal_model import MODE_NAME
from spacemap_vtk.units import GRAVITY

#: Static deflection under the load of a new card, over the longest side of the cage. It is visible,
#: and small enough for a linear motion even where a sudden load deflects the cage twice as far.
_DEFLECTION = 0.04
#: Mass of a new card, as a share of the cage's mass.
_MASS = 0.1
#: Whose arrays are missing, in an error.
_OWNER = "a new card"
#: Modes with smaller eigenvalues [1/s²] move the cage without strain.
_LEAST_EIGENVALUE = 1e-3


class FirstValues(NamedTuple):
    """What a new card of a cage may have, in SI units."""

    #: Least acceleration along an axis that gives the wanted deflection, and this axis.
    acceleration: float = 0.1 * GRAVITY
    axis: int = 2
    #: Acceleration down, along -y, that gives the wanted deflection.
    gravity: float = 0.1 * GRAVITY
    #: Axis along which the cage is thinnest, pressure on that side, and traction along `axis`.
    thin: int = 2
    pressure: float = 0.1
    traction: float = 0.1
    #: Force on the vertex that moves most, and this vertex at rest.
    force: float = 1e-4
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    displacement: float = 1e-3
    mass: float = 1e-6
    #: Stiffness of a spring that is as stiff as the cage in its first mode.
    stiffness: float = 10.0

    @classmethod
    def from_cage(cls, cage: vtkUnstructuredGrid | None) -> FirstValues:
        """Return the values for a cage with modes; small ones if it has none."""
        values = None if cage is None else cage.GetFieldData().GetArray("eigenvalues")
        if cage is None or values is None or not cage.GetPointData().HasArray("nodal_mass"):
            return cls()
        eigenvalues = array_of(cage.GetFieldData(), "eigenvalues", _OWNER)
        shown = [n for n, value in enumerate(eigenvalues) if value > _LEAST_EIGENVALUE]
        data, points = cage.GetPointData(), points_of(cage).astype(np.float64)
        sizes = np.ptp(points, axis=0)
        if not shown or not sizes.any():
            return cls()
        shapes = np.stack([array_of(data, MODE_NAME.format(n), _OWNER) for n in shown])
        mass, stiffness = array_of(data, "nodal_mass", _OWNER), eigenvalues[shown]
        total, wanted = float(mass.sum()), _DEFLECTION * float(sizes.max())
        # Static deflection under a unit acceleration along each axis, by the modes: (3, V, 3).
        pushes = np.einsum("kva,v->ka", shapes, mass) / stiffness[:, None]
        moved = np.linalg.norm(np.einsum("ka,kvi->avi", pushes, shapes), axis=2)
        most = moved.max(axis=1)
        axis = int(most.argmax())
        # No load is above the weight: a cage that hangs may be as good as rigid along an axis.
        needed = np.minimum(GRAVITY, wanted / np.maximum(most, 1e-30))
        vertex = int(moved[axis].argmax())
        compliance = float((shapes[:, vertex, axis] ** 2 / stiffness).sum())
        thin, place = int(sizes.argmin()), points[vertex]
        areal_mass = total / float(np.delete(sizes, thin).prod())
        return cls(
            float(needed[axis]),
            axis,
            float(needed[1]),
            thin,
            areal_mass * float(needed[thin]),
            areal_mass * float(needed[axis]),
            min(wanted / compliance, GRAVITY * total),
            (float(place[0]), float(place[1]), float(place[2])),
            wanted,
            _MASS * total,
            total * float(stiffness[0]),
        )

    def along(self, size: float) -> list[float]:
        """Return a vector of a size along the axis."""
        return [float(f"{size:.2g}") if n == self.axis else 0.0 for n in range(3)]

    def of_load(self, action: str) -> dict[str, Any]:
        """Return the first values of a load."""
        side = f"-{'xyz'[self.thin]}"
        values: dict[str, dict[str, Any]] = {
            "pressure": {"pressure": round_value(self.pressure), "on": side},
            "traction": {"traction": self.along(self.traction), "on": side},
            "force": {"force": self.along(self.force), "at": _round_place(self.place)},
            "array": {"array": "force"},
            "gravity": {"gravity": [0.0, f"{-self.gravity / GRAVITY:.2g} g", 0.0]},
            "base_acceleration": {
                "base_acceleration": [
                    f"{each / GRAVITY:.2g} g" if each else 0.0
                    for each in self.along(self.acceleration)
                ]
            },
            "base_displacement": {"base_displacement": self.along(self.displacement)},
        }
        return values[action]


def round_value(value: float) -> float:
    """Round a value to two digits, as a person would write it."""
    return float(f"{value:.2g}")


def _round_place(place: tuple[float, ...]) -> list[float]:
    """Round coordinates to four digits of the largest."""
    largest = max(map(abs, place)) or 1.0
    digits = 3 - int(np.floor(np.log10(largest)))
    return [round(each, digits) + 0.0 for each in place]
