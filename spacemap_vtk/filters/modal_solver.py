"""ModalSolver: the vibration modes of a viscoelastic cage."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import add_array, points_of, tetrahedra_of
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.memory import require
from spacemap_vtk.modal.eigen import estimate_bytes, solve_modes
from spacemap_vtk.modal.elasticity import isotropic, nodal_mass, stiffness_and_mass
from spacemap_vtk.modal.supports import SIDES, layers_through_thickness, on_sides
from spacemap_vtk.parameters import Integer, Parameter, Real

#: Name of the point array that holds a mode shape.
MODE_NAME = "mode_{:03d}"


class Sides(Parameter[tuple[str, ...]]):
    """Any of the six sides of a box."""

    kind = "sides"
    annotation = "str or sequence of str"
    allowed = 'sides of the box out of "' + '", "'.join(SIDES) + '", as a string or a list, or ""'

    def convert(self, value: Any) -> tuple[str, ...]:
        """Return the sides, each once, in a fixed order."""
        names = value.replace(",", " ").split() if isinstance(value, str) else value
        if not isinstance(names, Iterable) or any(name not in SIDES for name in names):
            raise InputError("not a side")
        return tuple(side for side in SIDES if side in names)

    def show(self, value: tuple[str, ...]) -> str:
        """Return the sides as one string."""
        return f'"{" ".join(value)}"'


class ModalSolver(Stage):
    """Solve K s = λ M s for the lowest vibration modes of a cage of linear tetrahedra.

    Notes
    -----
    Equations (9) to (15) of Furukawa, Kitagawa and Shimizu; the volume in (9) needs its absolute
    value. The mass is consistent. The modes are mass-normalised.

    Examples
    --------
    >>> from spacemap_vtk import ModalSolver
    >>> ModalSolver(youngs_modulus="2 MPa").youngs_modulus
    2000000.0
    """

    section = "modal"
    inputs = ("vtkUnstructuredGrid",)

    youngs_modulus = Real(1e6, "Young's modulus of the cage.", unit="Pa", above=0.0)
    poissons_ratio = Real(
        0.3,
        "Poisson's ratio. Linear tetrahedra lock as it nears 0.5, where K is singular.",
        above=-1.0,
        below=0.5,
    )
    density = Real(300.0, "Mass density of the cage.", unit="kg/m3", above=0.0)
    modes = Integer(
        30,
        "Number of modes, the lowest first; at most as many as there are degrees of freedom.",
        minimum=1,
        maximum=100_000,
    )
    fixed = Sides("+y", "Sides of the cage's bounding box whose vertices cannot move.")

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Assemble, solve and attach the modes as point arrays."""
        vertices = points_of(inputs[0]).astype(np.float64, copy=False)
        tetrahedra = tetrahedra_of(inputs[0])
        held = on_sides(vertices, self.fixed)
        free = np.repeat(~held, 3)
        dof = int(free.sum())
        count = min(self.modes, dof)
        layers = layers_through_thickness(vertices, tetrahedra)
        require(
            estimate_bytes(dof, count, layers),
            f"solving {count} modes of {dof} degrees of freedom",
            key="modes",
            value=self.modes,
            cure="Use a coarser cage or fewer modes.",
        )
        elasticity = isotropic(self.youngs_modulus, self.poissons_ratio)
        stiffness, mass = stiffness_and_mass(vertices, tetrahedra, elasticity, self.density)
        eigenvalues, shapes = solve_modes(stiffness, mass, free, count, self.report)

        output.ShallowCopy(inputs[0])
        data = output.GetPointData()
        add_array(data, "fixed", held.astype(np.uint8))
        add_array(data, "nodal_mass", nodal_mass(vertices, tetrahedra, self.density))
        for k, shape in enumerate(shapes):
            add_array(data, MODE_NAME.format(k), shape)
        add_array(output.GetFieldData(), "eigenvalues", eigenvalues)
        add_array(output.GetFieldData(), "frequencies", np.sqrt(eigenvalues) / (2 * math.pi))

        if layers < 1.5:
            self.warn(
                "one layer of linear tetrahedra through the thickness bends several times too "
                "stiffly; raise the cage's divisions there to trust frequencies and sag"
            )
