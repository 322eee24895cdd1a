"""A fabric on another solver's result: ParaView's own readers and filters drive Barycentric Warp.

    eval "$(spacemap paraview)"
    pvpython pipelines/paraview/on_a_result.py cloth.png      # or pvbatch, or Tools > Run Script

Any mesh of tetrahedra with a point array `displacement` can be the cage. CalculiX gives hexahedra
and calls it `U`, so that two of ParaView's filters stand between. (The source Motion Reader does
all three: file, array, and hexahedra into tetrahedra.)
"""

import sys
from pathlib import Path

from paraview import simple

root = next(folder for folder in Path(__file__).resolve().parents if (folder / "scenes").is_dir())
sheet = simple.PVDReader(FileName=str(root / "scenes" / "calculix" / "sheet.pvd"))
tetrahedra = simple.Tetrahedralize(Input=sheet)
cage = simple.Calculator(Input=tetrahedra, ResultArrayName="displacement", Function="U")
weave = simple.WeaveSource(Ends=7, Picks=7, WarpDiameter="0.25 mm", WeftDiameter="0.25 mm")
warp = simple.BarycentricWarp(Input=weave, Cage=cage, Outside="error", Smooth=1)
surface = simple.PatchTessellator(Input=warp)


def front(proxy, array: str) -> float:
    """Return how far the foremost point is out, in m."""
    information = proxy.GetDataInformation().GetPointDataInformation()
    return information.GetArrayInformation(array).GetComponentRange(2)[1]


# The fabric goes where ParaView's own interpolation in the hexahedra says, at any of its times.
probe = simple.ResampleWithDataset(SourceDataArrays=sheet, DestinationMesh=weave)
for time in (0.01, 0.02, 0.026, 0.04):
    warp.UpdatePipeline(time)
    probe.UpdatePipeline(time)
    out, expected = front(warp, "displacement"), front(probe, "U")
    print(f"{time * 1e3:3.0f} ms: {out * 1e3:.3f} mm in front; the sheet {expected * 1e3:.3f} mm")
    assert abs(out - expected) < 0.01 * expected

view = simple.GetActiveViewOrCreate("RenderView")
simple.Show(surface, view)  # in the yarns' own colours
edges = simple.Show(simple.WarpByVector(Input=sheet, Vectors="U"), view)
edges.SetRepresentationType("Wireframe")
simple.ColorBy(edges, None)
animation = simple.GetAnimationScene()
animation.UpdateAnimationUsingDataTimeSteps()
animation.AnimationTime = 0.026
view.CameraPosition, view.CameraFocalPoint = [7e-3, 2e-3, 6e-3], [0.0, 0.0, 0.5e-3]
view.CameraViewUp = [0.0, 1.0, 0.0]
simple.Render(view)
if len(sys.argv) > 1:
    simple.SaveScreenshot(sys.argv[1], view, ImageResolution=[1280, 960])
