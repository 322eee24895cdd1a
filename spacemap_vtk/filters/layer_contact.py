"""LayerContact: cloth that touches itself."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.parameters import Flag, Real

#: Field array of a cage whose layers touch each other: their coefficient of friction.
LAYER_FRICTION = "layer_friction"


class LayerContact(Stage):
    """Keep layers of a sheet apart where it folds onto itself, at rest and in time steps.

    ModalSolver and TransientResponse, further down, keep the mid-surfaces of layers apart by the
    thickness of the cloth; they need the library ipctk. A start in which layers overlap is refused.
    Obstacles, with their own friction, are given to ModalSolver.

    Examples
    --------
    >>> from spacemap_vtk import LayerContact, ModalSolver, TetraCage, WeaveSource, connect
    >>> solver = ModalSolver(elements="sheet")
    >>> pipeline = connect(WeaveSource(), TetraCage(), LayerContact(friction=0.3), solver)
    >>> LayerContact.parameter("friction").default
    0.0
    """

    section = "contact"
    role, after = "contact", "cage"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"

    self = Flag(True, "Let the cloth touch itself, and not pass through itself.")
    friction = Real(
        0.0,
        "Coefficient of Coulomb friction between layers. With friction an equilibrium depends on "
        "the path: layers stick where they first touch.",
        minimum=0.0,
        when={"self": (True,)},
    )

    def run(
        self, inputs: list[vtkUnstructuredGrid], output: vtkUnstructuredGrid, time: float
    ) -> None:
        """Pass the cage on, with the coefficient of friction as a field array."""
        output.ShallowCopy(inputs[0])
        field = output.GetFieldData()
        field.RemoveArray(LAYER_FRICTION)
        if self.self:
            add_array(field, LAYER_FRICTION, np.array([self.friction]))
