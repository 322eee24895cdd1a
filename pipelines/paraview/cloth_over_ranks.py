"""A cloth that is spread over processes: each makes, moves and draws its share of the yarns.

    eval "$(spacemap paraview)"
    mpirun -np 4 pvbatch pipelines/paraview/cloth_over_ranks.py cloth.png 60   # ends and picks

ParaView needs nothing else for it: the first process solves the cage for all, and pictures are
composited. Each process writes its piece of cloth.pvtu, which ParaView opens as one. By itself, in
pvpython, the script does the same with one piece.
"""

import sys
from pathlib import Path

from paraview import simple

picture = Path(sys.argv[1] if len(sys.argv) > 1 else "cloth.png")
yarns = int(sys.argv[2]) if len(sys.argv) > 2 else 16

density, gravity = 300.0, 9.81  # kg/m3, m/s2
weave = simple.WeaveSource(Ends=yarns, Picks=yarns, Precision="single")
weave.UpdatePipeline()
west, east, foot, head, back, front = weave.GetDataInformation().GetBounds()  # of all processes
height = 1.02 * (head - foot)
# Quadratic tetrahedra of a thousand thicknesses hardly bend: the cage of a large cloth is thicker.
room = simple.Box(
    XLength=1.02 * (east - west), YLength=height, ZLength=max(1.02 * (front - back), height / 40)
)
cage = simple.TetraCage(Input=room, Divisions=[4, 4, 1], Order=2)
modulus = density * gravity * height / 0.02  # Pa: it stretches by a hundredth
modal = simple.ModalSolver(
    Input=cage, YoungsModulus=modulus, PoissonsRatio=0.0, Density=density, Modes=100
)
response = simple.ModalResponse(Input=modal, Gravity=[0.0, -gravity, 0.0], Initial="equilibrium")
warp = simple.BarycentricWarp(Input=weave, Cage=response)

# Hung by its upper edge, a sheet moves down at depth s by rho g s (L - s / 2) / E.
warp.UpdatePipeline(0.0)
depth = height / 2 - foot
expected = density * gravity * depth * (height - depth / 2) / modulus
arrays = warp.GetDataInformation().GetPointDataInformation()
stretch = -arrays.GetArrayInformation("displacement").GetComponentRange(1)[0]
print(f"stretch {stretch * 1e6:.3f} um, by the formula {expected * 1e6:.3f} um")
assert abs(stretch / expected - 1.0) < 1e-6, stretch / expected
simple.SaveData(str(picture.with_suffix(".pvtu")), warp)

# A breath of wind from behind, and a picture.
response.Gravity = [0.0, -gravity, 0.004 * gravity]
# Polygons that nobody can see would be most of the work: their number goes with a yarn's width.
surface = simple.PatchTessellator(Input=warp, Subdivisions=max(1, min(6, 180 // yarns)))
view = simple.GetActiveViewOrCreate("RenderView")
view.OrientationAxesVisibility = 0
display = simple.Show(surface, view)
simple.ColorBy(display, ("CELLS", "color"))
display.MapScalars = 0  # they are colours already
simple.Show(response, view).SetRepresentationType("Wireframe")
simple.ResetCamera(view)
view.GetActiveCamera().Azimuth(40)
view.GetActiveCamera().Elevation(20)
simple.SaveScreenshot(str(picture), view, ImageResolution=[1280, 960])
