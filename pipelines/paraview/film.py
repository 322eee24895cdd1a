"""A film of a scene file in ParaView: its frames as pictures, ``swing.0000.png`` and on.

    eval "$(spacemap paraview)"
    pvbatch pipelines/paraview/film.py swing.png              # or .avi, or .ogv

The reader runs the scene's whole pipeline, and gives ParaView's clock the times of its film.
"""

import sys
from pathlib import Path

from paraview import simple

root = next(folder for folder in Path(__file__).resolve().parents if (folder / "scenes").is_dir())
cloth = simple.OpenDataFile(str(root / "scenes" / "calculix_fabric.toml"))
times = list(cloth.TimestepValues)

# It lets go at t = 0, is out farthest after half a swing, and comes back.
reach, some = [], times[::5]
for time in some:
    cloth.UpdatePipeline(time)
    points = cloth.GetDataInformation().GetPointDataInformation()
    reach.append(points.GetArrayInformation("displacement").GetComponentRange(2)[1])
farthest = some[reach.index(max(reach))]
print(f"{len(times)} frames; out by {max(reach) * 1e3:.3f} mm after {farthest * 1e3:.0f} ms")
assert reach[0] == 0.0
assert abs(farthest - 0.026) < 0.003
assert abs(max(reach) - 1.45e-3) < 0.05e-3  # as CalculiX's sheet, see on_a_result.py

view = simple.GetActiveViewOrCreate("RenderView")
simple.Show(cloth, view)  # in the yarns' own colours
view.CameraPosition, view.CameraFocalPoint = [7e-3, 2e-3, 6e-3], [0.0, 0.0, 0.5e-3]
view.CameraViewUp = [0.0, 1.0, 0.0]
animation = simple.GetAnimationScene()
animation.UpdateAnimationUsingDataTimeSteps()
animation.PlayMode = "Sequence"
animation.NumberOfFrames = 12  # "Snap To TimeSteps" takes all that the scene has
if len(sys.argv) > 1:
    simple.SaveAnimation(sys.argv[1], view, ImageResolution=[480, 360])
