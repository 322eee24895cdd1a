"""Obstacles are a property of ModalSolver, as dead loads are, and a filter shows their surfaces."""

import numpy as np
from paraview import simple
from pipeline import bounds

weave = simple.WeaveSource(Ends=8, Picks=8)
cage = simple.TetraCage(Input=weave, Divisions=[6, 6, 1])
modal = simple.ModalSolver(Input=cage, Elements="sheet", Fixed="", Modes=1)
modal.Gravity = [0.0, 0.0, -9.80665]
modal.TensileRigidity, modal.BendingRigidity, modal.ArealMass = "1 kN/m", "1e-3 uN.m", 0.15
disc = '{shape = "disc", radius = "1 mm", height = "1 mm", center = [0, 0, "-1 mm"], friction = 0.3}'
moving = (
    '{shape = "sphere", radius = "0.5 mm", center = ["9 mm", 0, "-5 mm"], '
    'displacement = [0, 0, "1 mm"], time = "ramp", rise = "1 s"}'
)
modal.Obstacles = f"[{disc}, {moving}]"
surfaces = simple.ObstacleSurfaces(Input=modal)
surfaces.UpdatePipeline()
expected = (-1e-3, 9.5e-3, -1e-3, 1e-3, -5.5e-3, -1e-3)
np.testing.assert_allclose(bounds(surfaces), expected, atol=2e-6)
assert surfaces.GetDataInformation().GetCellDataInformation().GetArrayInformation("obstacle")
report = modal.GetClientSideObject().output.GetFieldData().GetArray("contact_force")
assert report.GetTuple3(0)[2] < 0.0
stepped = simple.TransientResponse(Input=modal, Duration=0.5)
surfaces = simple.ObstacleSurfaces(Input=stepped)
surfaces.UpdatePipeline(0.5)
assert abs(bounds(surfaces)[4] + 5e-3) < 2e-6, bounds(surfaces)  # half the way up
print("a disc and a moving sphere, shown where they are")
