"""ModalSolver: the vibration modes of a viscoelastic cage."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.arrays import add_array, elements_of, points_of
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.modal_model import attach
from spacemap_vtk.memory import require
from spacemap_vtk.modal.eigen import estimate_bytes, lowest
from spacemap_vtk.modal.materials import isotropic
from spacemap_vtk.modal.model import Model
from spacemap_vtk.modal.supports import SIDES, layers_through_thickness, on_sides
from spacemap_vtk.parameters import Choice, Integer, Parameter, Real

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
    """Solve K s = λ M s for the lowest vibration modes of a cage of tetrahedra.

    Notes
    -----
    Equations (9) to (15) of Furukawa, Kitagawa and Shimizu; the volume in (9) needs its absolute
    value. The modes are mass-normalised.

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
    mass = Choice(
        "consistent",
        "Mass matrix: consistent with the elements' shape functions, or lumped on the vertices.",
        ["consistent", "lumped"],
    )

    #: Kept for those that come upon it by content: another support or material reuses parts.
    _model: Model | None = None

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Assemble, solve and attach the modes as point arrays."""
        vertices = points_of(inputs[0]).astype(np.float64, copy=False)
        tetrahedra = elements_of(inputs[0])
        held = np.repeat(on_sides(vertices, self.fixed)[:, None], 3, axis=1)
        dof = int((~held).sum())
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
        self._model = model = Model(
            vertices, tetrahedra, elasticity, self.density, held, self.mass == "lumped"
        )
        eigenvalues, shapes = lowest(model.structure.pencil, count, self.report)
        eigenvalues *= model.modulus / model.density
        shapes /= math.sqrt(model.density)

        output.ShallowCopy(inputs[0])
        data = output.GetPointData()
        attach(output, model)
        for k, shape in enumerate(shapes):
            add_array(data, MODE_NAME.format(k), shape)
        add_array(output.GetFieldData(), "eigenvalues", eigenvalues)
        add_array(output.GetFieldData(), "frequencies", np.sqrt(eigenvalues) / (2 * math.pi))

        if layers < 1.5:
            self.warn(
                "one layer of linear tetrahedra through the thickness bends several times too "
                "stiffly; raise the cage's divisions there to trust frequencies and sag"
            )
