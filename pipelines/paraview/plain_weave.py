"""The pipeline in ParaView's own Python, with the plugin loaded, and a picture.

    eval "$(spacemap paraview)"
    pvpython pipelines/paraview/plain_weave.py cloth.png      # or pvbatch, or Tools > Run Script

Every name here is a name in the window too: "Weave Source", its property "Warp Diameter".
"""

import math
import sys

from paraview import simple

weave = simple.WeaveSource(Ends=7, Picks=7, WarpDiameter="0.25 mm", WeftDiameter="0.25 mm")
cage = simple.TetraCage(Input=weave, Divisions=[5, 5, 1], Order=2)
modal = simple.ModalSolver(Input=cage, YoungsModulus=2e3, Modes=100, Fixed="+y")
response = simple.ModalResponse(Input=modal, Alpha=0.0, Gravity=[0.0, -1.0, 1.0], Duration=0.2)
warp = simple.BarycentricWarp(Input=weave, Cage=response)
surface = simple.PatchTessellator(Input=warp, Subdivisions=6)


def reach() -> float:
    """Return how far the cloth is out in front, in m."""
    array = surface.GetDataInformation().GetPointDataInformation().GetArrayInformation
    return array("displacement").GetComponentRange(2)[1]


# Undamped, it swings to twice the depth at which it would hang at rest, after half a period.
surface.UpdatePipeline(0.0)
field = modal.GetDataInformation().GetFieldDataInformation()
first = field.GetArrayInformation("eigenvalues").GetComponentRange(0)[0]
half_a_period = math.pi / math.sqrt(first)
surface.UpdatePipeline(half_a_period)
swung = reach()
response.Initial = "equilibrium"
surface.UpdatePipeline(half_a_period)
sag = reach()
response.Initial = "rest"
print(f"sag {sag * 1e6:.1f} um, swing {swung * 1e6:.1f} um after {half_a_period * 1e3:.1f} ms")
assert 1.9 < swung / sag < 2.1, swung / sag

view = simple.GetActiveViewOrCreate("RenderView")
simple.Show(surface, view)  # in the yarns' own colours
edges = simple.Show(response, view)
edges.SetRepresentationType("Wireframe")
simple.Hide(weave, view)
animation = simple.GetAnimationScene()
animation.UpdateAnimationUsingDataTimeSteps()
animation.AnimationTime = half_a_period
simple.ResetCamera(view)
view.GetActiveCamera().Azimuth(40)
view.GetActiveCamera().Elevation(20)
simple.Render(view)
if len(sys.argv) > 1:
    simple.SaveScreenshot(sys.argv[1], view, ImageResolution=[1280, 960])
