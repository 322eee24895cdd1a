"""A sheet hangs in ParaView as it does in Python, and WarpByVector shows where. Run with a file.

The file has what Python found: the equilibrium, the frequencies, Peirce's bending lengths.
"""

import sys
from typing import Any

import numpy as np
from paraview import simple
from pipeline import bounds
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of

expected = np.load(sys.argv[1])
weave = simple.WeaveSource(Ends=20, Picks=8)
cage = simple.TetraCage(Input=weave, Divisions=[10, 4, 1])
modal = simple.ModalSolver(Input=cage, Elements="sheet", Fixed="-x", Modes=6)
modal.Gravity = [0.0, 0.0, -9.80665]
modal.TensileRigidity, modal.BendingRigidity = "200 N/m", "0.1 uN.m, 0.05 uN.m"
modal.ArealMass = 0.15

# Each measure has its unit in its help, with those of the trade.
for name, units in (
    ("ArealMass", ("g/m2", "oz/yd2")),
    ("BendingRigidity", ("N.m", "gf.cm2/cm", "mN.cm")),
    ("TensileRigidity", ("N/m", "gf/cm")),
    ("BendingLength", ("mm", "cm")),
    ("TwistingRigidity", ("N.m",)),
    ("ShearRigidity", ("gf/cm.deg",)),
):
    help = modal.GetProperty(name).SMProperty.GetDocumentation().GetDescription()
    assert all(unit in help for unit in units), (name, help)

reported = []
stage = modal.GetClientSideObject()


def tell(caller: Any, _: str) -> None:
    reported.append(caller.GetProgressText() or "")


watching = stage.AddObserver("ProgressEvent", tell)
modal.UpdatePipeline()
stage.RemoveObserver(watching)  # it knows this module, and by that the stage
assert list(dict.fromkeys(reported)) == ["", "hanging", "modes"], reported
field = stage.output.GetFieldData()
hung = vtk_to_numpy(stage.output.GetPointData().GetArray("equilibrium"))
assert hung[:, 2].min() < -1e-3
assert abs(hung - expected["equilibrium"]).max() < 1e-6 * abs(hung).max()
for name in ("frequencies", "bending_length"):
    found = vtk_to_numpy(field.GetArray(name))
    np.testing.assert_allclose(found, expected[name], rtol=1e-6)

# ParaView's own filter moves the cage to where it hangs, and that is where its motion begins.
moved = simple.WarpByVector(Input=modal, Vectors=["POINTS", "equilibrium"])
moved.UpdatePipeline()
places = points_of(stage.output) + hung
box = np.stack([places.min(axis=0), places.max(axis=0)], axis=1).ravel()
np.testing.assert_allclose(bounds(moved), box, atol=1e-8)
response = simple.ModalResponse(Input=modal)
response.UpdatePipeline(0.0)
begins = response.GetClientSideObject().output.GetPointData().GetArray("displacement")
np.testing.assert_array_equal(vtk_to_numpy(begins), hung)
cloth = simple.PatchTessellator(Input=simple.BarycentricWarp(Input=weave, Cage=response))
cloth.UpdatePipeline(0.0)
assert abs(bounds(cloth)[4] - box[4]) < 2e-4

modal.Hang = 0
modal.UpdatePipeline()
assert not stage.output.GetPointData().HasArray("equilibrium")
print("hung as in Python")
