"""The same thing at any size, stiffness and density: what Buckingham's theorem leaves to be so.

Mass, length and time can be measured in any units. A scene whose lengths are multiplied by s,
moduli by e and densities by d, and every other input by the product of these that its unit is, is
the same in other units: results are multiplied by what theirs is. By powers of two this loses no
digit, so that any constant that is compared with a length, a force or a time shows.
"""

from __future__ import annotations

import math
import tomllib
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.filters.load import Load
from spacemap_vtk.mechanics.boundary.places import parse_places
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.scene import Scene

#: Powers of mass, length and time in each unit.
UNITS = {
    **{"": (0, 0, 0), "deg": (0, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "1/s": (0, 0, -1)},
    **{"m/s": (0, 1, -1), "m/s2": (0, 1, -2), "1/m": (0, -1, 0), "kg/m3": (1, -3, 0)},
    **{"kg/m2": (1, -2, 0), "kg/m": (1, -1, 0), "kg": (1, 0, 0), "Pa": (1, -1, -2)},
    **{"N": (1, 1, -2), "N/m": (1, 0, -2), "N.m": (1, 2, -2), "N.m2": (1, 3, -2)},
    **{"N/m3": (1, -2, -2), "J": (1, 2, -2), "Hz": (0, 0, -1), "1/s2": (0, 0, -2)},
    "m of a unit of mass": (0.5, 1, 0),
}
#: Of what stages add and do not say.
MORE = {
    **{"points": "m", "displacement": "m", "equilibrium": "m", "nodal_mass": "kg"},
    **{"eigenvalues": "1/s2", "frequencies": "1/s", "Normals": ""},
    "modal_coordinates": "m of a unit of mass",
}
#: From a nanometre to 1000 km, from 1 mPa to 1 PPa of the scenes' own, about 1 mm to 1 m and 1 MPa.
EXTREMES = [
    (2.0**-20, 1.0, 1.0),
    (2.0**-30, 2.0**30, 2.0**10),
    (2.0**30, 2.0**-30, 2.0**-10),
    (2.0**20, 2.0**30, 2.0**-10),
]

LAW = """
[weave]
ends = 4
picks = 4
warp_spacing = "0.5 mm"
weft_spacing = "0.5 mm"
[cage]
divisions = [3, 3, 1]
[modal]
elements = "sheet"
youngs_modulus = "8.5 kPa"
density = "300 kg/m3"
modes = 8
gravity = [0.0, "-1 g", "0.1 g"]
fixed = "+y"
springs = "-y:z 0.02 N/m"
[response]
damping_ratio = 0.08
[[response.loads]]
pressure = "0.9 Pa"
on = "-z"
time = "pulse"
length = "20 ms"
[rotation]
[yarns]
inextensible = false
tension = "0.01 N"
contact = "1 mN"
[surface]
subdivisions = 1
[view]
time = "30 ms"
"""


class Law:
    """What things of a unit are multiplied by."""

    def __init__(self, s: float, e: float, d: float) -> None:
        self.mass, self.length, self.time = d * s**3, s, s * (d / e) ** 0.5

    def __call__(self, unit: str) -> float:
        mass, length, time = UNITS[unit]
        return self.mass**mass * self.length**length * self.time**time

    def scene(self, values: dict[str, Any]) -> Scene:
        """Return a scene in other units; what it does not say is as without them."""
        plain, made = Scene(values), {}
        for section, given in values.items():
            part = plain.parts[section]
            made[section] = {key: self._scaled(part, key, given[key]) for key in given}
        return Scene(made)

    def _scaled(self, part: Any, key: str, given: Any) -> Any:
        parameter, value = part.parameter(key), getattr(part, key)
        if parameter.kind in ("places", "supports"):
            units = getattr(parameter, "units", ())
            return [self._place(place) for text in value for place in parse_places(text, units)]
        if parameter.kind == "loads":
            unit = {name: each.unit for name, each in Load.parameters.items()}
            return [
                {name: self._times(each, unit[name]) for name, each in load._values.items()}
                for load in value
            ]
        if not parameter.unit:
            return given
        scaled = self._times(value, parameter.unit)
        # A bare number of an implausible size is refused; one with its unit is not.
        return f"{scaled!r} {parameter.unit}" if isinstance(scaled, float) else scaled

    def _times(self, value: Any, unit: str) -> Any:
        if isinstance(value, tuple):
            return [self._times(each, unit) for each in value]
        return value * self(unit) if unit and not isinstance(value, str) else value

    def _place(self, place: Any) -> str:
        """Return a place in other units."""
        more = {"numbers": tuple(n * self("m") for n in place.numbers)}
        if place.unit:
            more["value"] = place.value * self(place.unit)
        return str(place._replace(**more))


def arrays_of(stage: Any) -> dict[str, np.ndarray[Any, Any]]:
    data = stage.output
    found = {"points": points_of(data)}
    for side in (data.GetPointData(), data.GetCellData(), data.GetFieldData()):
        for number in range(side.GetNumberOfArrays()):
            if (array := side.GetArray(number)) is not None:
                found[array.GetName()] = vtk_to_numpy(array)
    return found


def differences(values: dict[str, Any], law: Law) -> dict[str, float]:
    """Return how far each array is from what the law says, as a share of its largest number."""
    time = Scene(values).view.time
    plain, other = Scene(values), law.scene(values)
    plain.update(time)
    other.update(time * law("s"))
    units = MORE | {name: array.unit.replace("²", "2") for name, array in plain.arrays.items()}
    units |= MORE
    found = {}
    for one, two in zip(plain.stages, other.stages, strict=True):
        mine, others = arrays_of(one), arrays_of(two)
        for name in mine.keys() & others.keys() & units.keys():
            size = abs(mine[name]).max(initial=0.0)
            if mine[name].dtype.kind == "f" and size:
                away = abs(others[name] / law(units[name]) - mine[name]).max() / size
                found[f"{type(one).__name__}.{name}"] = float(away)
    return found


@pytest.mark.parametrize("modulus", [1e-3, 1e15])
@pytest.mark.parametrize("size", [1e-9, pytest.param(1e6, marks=pytest.mark.nightly)])
def test_a_chain_of_all_stages_keeps_the_law(size: float, modulus: float) -> None:
    # Of 2 mm and 8.5 kPa it comes to these, in m and Pa, or as near as powers of two do.
    s, e = (2.0 ** round(math.log2(ratio)) for ratio in (size / 2e-3, modulus / 8.5e3))
    found = differences(tomllib.loads(LAW), Law(s, e, 2.0**10))
    assert {"ModalSolver.frequencies", "CrimpInterchange.contact_force"} <= found.keys()
    assert "PatchTessellator.points" in found
    assert len(found) > 20
    # The surface is in single precision.
    bounds = {name: 1e-6 if name.startswith("PatchT") else 1e-9 for name in found}
    assert not {name: away for name, away in found.items() if not away < bounds[name]}


@pytest.mark.nightly
@pytest.mark.parametrize("extreme", EXTREMES)
@pytest.mark.parametrize("name", ["plain_weave", "let_go", "swing", "yarn_tension", "satin_5_2"])
def test_scenes_keep_the_law(name: str, extreme: tuple[float, float, float]) -> None:
    values = library.values_of(library.find(name))
    values.pop("title")
    # Defaults are in no other unit.
    values["weave"] = {"warp_spacing": 0.5e-3, "weft_spacing": 0.5e-3} | values["weave"]
    if "transient" in values:
        values["transient"] = {"max_step": 0.02} | values["transient"]
    found = differences(values, Law(*extreme))
    assert not {name: away for name, away in found.items() if not away < 1e-4}
    assert found["PatchTessellator.points"] < 1e-6
