"""What the README's picture of ParaView's window shows; run by photograph.py."""

import os
from pathlib import Path

from paraview import simple

YARNS = int(os.environ.get("SPACEMAP_YARNS", "40"))
CELLS = 18  # half a bending length wide, however many yarns there are
STRIPES = ", ".join(["#b3262e"] * 4 + ["#f4ecdc"] * 4)

# A napkin of 20 cm hangs over a round table of 9 cm.
weave = simple.WeaveSource(Pattern="twill 2/2", Ends=YARNS, Picks=YARNS)
weave.WarpDiameter = weave.WeftDiameter = f"{112 / YARNS} mm"
weave.WarpSpacing = weave.WeftSpacing = f"{200 / YARNS} mm"
weave.WarpColor = weave.WeftColor = STRIPES
cage = simple.TetraCage(Input=weave, Divisions=[CELLS, CELLS, 1])
modal = simple.ModalSolver(Input=cage, Elements="sheet", Fixed="sphere(0, 0, 0, 45 mm)")
modal.TensileRigidity, modal.ShearRigidity, modal.BendingRigidity = "1 kN/m", "40 N/m", "30 uN.m"
modal.ArealMass, modal.Gravity = "150 g/m2", [0.0, 0.0, -9.80665]
response = simple.ModalResponse(Input=modal, DampingRatio=0.05)
rotation = simple.RotationStrain(Input=response)
crimp = simple.CrimpInterchange(Input=weave, Cage=rotation)
warp = simple.BarycentricWarp(Input=crimp, Cage=rotation, Smooth=1)
surface = simple.PatchTessellator(Input=warp, Subdivisions=2)

view = simple.GetActiveViewOrCreate("RenderView")
view.UseColorPaletteForBackground, view.BackgroundColorMode = 0, "Gradient"
view.Background, view.Background2 = [1.0, 1.0, 1.0], [0.8, 0.85, 0.9]
view.OrientationAxesLabelColor = [0.0, 0.0, 0.0]
simple.Show(surface, view)
lines = simple.Show(cage, view)
lines.SetRepresentationType("Wireframe")
lines.AmbientColor = lines.DiffuseColor = [0.2, 0.25, 0.35]
lines.Opacity = 0.3
camera = view.GetActiveCamera()
camera.SetViewUp(0.0, 0.0, 1.0)
camera.SetPosition(0.2, -0.45, 0.28)
camera.SetFocalPoint(0.0, 0.0, 0.0)
simple.ResetCamera(view)
camera.Zoom(1.35)
# The panel shows the properties of the active source.
simple.SetActiveSource(modal)
simple.Render(view)
Path(os.environ["SPACEMAP_READY"]).touch()
