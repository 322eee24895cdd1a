"""Files: scenes, drafts, and another solver's time series that moves a fabric.

Run with the folder of the scenes and one to write to.
"""

import sys
from pathlib import Path

import numpy as np
from paraview import simple
from pipeline import executions
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

scenes, folder = (Path(argument) for argument in sys.argv[1:3])

# --- a scene: its film's times, its surface, patches and cage -----------------------------------
text = (scenes / "plain_weave.toml").read_text().replace("[5, 5, 1]", "[3, 3, 1]\norder = 2")
text = text.replace("modes = 180", "modes = 60").replace("1.3 kPa", "5 kPa")
(folder / "scene.toml").write_text(text)
scene = simple.OpenDataFile(str(folder / "scene.toml"))
scene.UpdatePipeline(0.0)
times = list(scene.TimestepValues)
assert len(times) == 50, times
assert abs(times[1] - 0.004) < 1e-12
rest = scene.GetDataInformation().GetBounds()
polygons = scene.GetDataInformation().GetNumberOfCells()
scene.UpdatePipeline(0.02)
assert scene.GetDataInformation().GetBounds()[5] > rest[5] + 1e-4
scene.Show = "patches"
scene.UpdatePipeline(0.02)
assert scene.GetDataInformation().GetNumberOfCells() * 36 == polygons > 10_000
scene.Show = "cage"
scene.UpdatePipeline(0.02)
assert scene.GetDataInformation().GetNumberOfCells() == 3 * 3 * 5

# --- a draft ------------------------------------------------------------------------------------
draft = simple.OpenDataFile(str(scenes / "32-shaft_twill.wif"))
assert type(draft).__name__ == "WIFReader", draft
# Thinner than the draft says, which warns of yarns that are too thick to interlace.
draft.WarpDiameter = draft.WeftDiameter = "0.4 mm"
draft.Ends = draft.Picks = 24
draft.UpdatePipeline()
assert draft.GetDataInformation().GetNumberOfCells() > 10_000

# --- another solver's result drives the fabric: an affine motion, known in closed form ----------
weave = simple.WeaveSource(Ends=3, Picks=3)
cage = simple.TetraCage(Input=weave, Divisions=[2, 2, 1], Padding=0.1)
cage.UpdatePipeline()
mesh = cage.GetClientSideObject().GetOutputDataObject(0)
vertices = vtk_to_numpy(mesh.GetPoints().GetData()).astype(float)
stretch = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.0], [0.3, 0.0, 0.2]])
entries = []
for step, time in enumerate((0.0, 0.5, 2.0)):
    grid = mesh.NewInstance()
    grid.ShallowCopy(mesh)
    array = numpy_to_vtk(time * vertices @ stretch.T, deep=True)
    array.SetName("displacement")
    grid.GetPointData().AddArray(array)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(folder / f"step{step}.vtu"))
    writer.SetInputData(grid)
    assert writer.Write()
    entries.append(f'<DataSet timestep="{time}" file="step{step}.vtu"/>')
(folder / "motion.pvd").write_text(
    f'<VTKFile type="Collection"><Collection>{"".join(entries)}</Collection></VTKFile>'
)
motion = simple.OpenDataFile(str(folder / "motion.pvd"))
warp = simple.BarycentricWarp(Input=weave, Cage=motion)
surface = simple.PatchTessellator(Input=warp)
view = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, view)
animation = simple.GetAnimationScene()
animation.PlayMode = "Snap To TimeSteps"
animation.UpdateAnimationUsingDataTimeSteps()
at_rest = vtk_to_numpy(weave.GetClientSideObject().GetOutputDataObject(0).GetPoints().GetData())
at_rest = at_rest.astype(float)
for time in (0.0, 0.5, 2.0):
    animation.AnimationTime = time
    simple.Render(view)
    moved = vtk_to_numpy(warp.GetClientSideObject().GetOutputDataObject(0).GetPoints().GetData())
    expected = at_rest + time * at_rest @ stretch.T
    error = np.abs(moved - expected).max() / np.ptp(at_rest)
    assert error < 1e-6, (time, error)
assert executions([weave, warp, surface]) == [1, 3, 3], executions([weave, warp, surface])
# --- grouped with it, another object rides along, in one cage; the cloth's points are as alone ---
both = simple.GroupDatasets(Input=[weave, simple.Sphere(Radius=1e-4)])
riding = simple.BarycentricWarp(Input=both, Cage=motion)
for time in (0.5, 2.0):
    riding.UpdatePipeline(time)
    cloth = riding.GetClientSideObject().GetOutputDataObject(0).GetBlock(0)
    expected = at_rest + time * at_rest @ stretch.T
    moved = vtk_to_numpy(cloth.GetPoints().GetData())
    assert np.abs(moved - expected).max() < 1e-6 * np.ptp(at_rest), time
around = simple.TetraCage(Input=both, Divisions=[1, 1, 1])
around.UpdatePipeline()
assert around.GetDataInformation().GetNumberOfPoints() == 8
print("scenes, drafts and other readers")
