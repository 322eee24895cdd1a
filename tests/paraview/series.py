"""A pipeline built by hand offers time steps, and any time in between. Run with a folder."""

import re
import sys
from pathlib import Path

from paraview import simple
from pipeline import bounds, connected, executions
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

folder = Path(sys.argv[1])
proxies = connected()
response, surface = proxies[3], proxies[5]
response.Gravity = [0.0, 0.0, -1.0]  # too weak to turn it so far that it warns
surface.Subdivisions = 1
simple.SaveData(str(folder / "swing.pvd"), surface, WriteTimeSteps=1)
# ParaView updates once without a time, before it goes through the steps.
assert executions(proxies) == [1, 1, 1, 102, 102, 102], executions(proxies)
entries = re.findall(r'timestep="(.*?)".*?file="(.*?)"', (folder / "swing.pvd").read_text())
assert len(entries) == 101, len(entries)

# Each file holds its own time, as a pipeline that is asked for that time alone makes it.
stage = surface.GetClientSideObject()
for number in (0, 7, 100):
    time, file = float(entries[number][0]), entries[number][1]
    assert abs(time - number / 100) < 1e-9, (number, time)
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(folder / file))
    reader.Update()
    surface.UpdatePipeline(time)
    found, expected = (
        vtk_to_numpy(data.GetPoints().GetData())
        for data in (reader.GetOutput(), stage.GetOutputDataObject(0))
    )
    assert abs(found - expected).max() == 0, number
surface.UpdatePipeline(0.07)
seventh = bounds(surface)
surface.UpdatePipeline(0.08)
eighth = bounds(surface)

# Played, each step is a frame; a time in between is none of its neighbours.
view = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, view)
scene = simple.GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
assert len(scene.TimeKeeper.TimestepValues) == 101
scene.PlayMode = "Snap To TimeSteps"
scene.GoToFirst()
simple.Render(view)
before = executions(proxies)
scene.Play()
ran = [b - a for a, b in zip(before, executions(proxies), strict=True)]
assert ran[:3] == [0, 0, 0], ran
assert 100 <= ran[3] == ran[4] == ran[5] <= 101, ran
scene.AnimationTime = 0.0737
simple.Render(view)
between = bounds(surface)
assert min(seventh[4], eighth[4]) < between[4] < max(seventh[4], eighth[4])
assert response.GetClientSideObject().executions == surface.GetClientSideObject().executions

response.Frames = 11
response.UpdatePipelineInformation()
assert len(response.TimestepValues) == 11, response.TimestepValues
print("every step is offered, and any time between")
