"""Obstacles are a property of ModalSolver, as dead loads are, and a filter shows their surfaces."""

import numpy as np
from paraview import simple
from pipeline import bounds

weave = simple.WeaveSource(Ends=8, Picks=4)
cage = simple.TetraCage(Input=weave, Divisions=[6, 3, 1])
modal = simple.ModalSolver(Input=cage, Elements="sheet", Fixed="-x", Modes=1)
modal.Gravity = [0.0, 0.0, -9.80665]
modal.TensileRigidity, modal.BendingRigidity, modal.ArealMass = "200 N/m", "1e-3 uN.m", 0.15
ground = '{shape = "plane", center = [0, 0, "-0.5 mm"]}'
moving = '{shape = "sphere", radius = "0.5 mm", center = ["9 mm", 0, "-5 mm"], '
moving += 'displacement = [0, 0, "1 mm"], rise = "20 ms"}'
modal.Obstacles = f"[{ground}, {moving}]"
surfaces = simple.ObstacleSurfaces(Input=modal)
surfaces.UpdatePipeline()
np.testing.assert_allclose(np.array(bounds(surfaces))[[1, 4, 5]], (9.5e-3, -5.5e-3, -5e-4))
assert surfaces.GetDataInformation().GetCellDataInformation().GetArrayInformation("obstacle")
force = modal.GetClientSideObject().output.GetFieldData().GetArray("contact_force")
assert force.GetTuple3(0)[2] < 0.0
stepped = simple.TransientResponse(Input=modal, Duration=0.02, Tolerance=1.0)
surfaces = simple.ObstacleSurfaces(Input=stepped)
surfaces.UpdatePipeline(0.01)
np.testing.assert_allclose(bounds(surfaces)[4], -5e-3)  # half the way up
print("obstacles, shown where they are")
