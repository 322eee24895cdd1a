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
response.UpdatePipelineInformation()
assert len(response.TimestepValues) == 101, response.TimestepValues
response.Frames = 21  # the rest would say no more
simple.SaveData(str(folder / "swing.pvd"), surface, WriteTimeSteps=1)
# ParaView updates once without a time, before it goes through the steps: that is the first one's.
assert executions(proxies) == [1, 1, 1, 21, 21, 21], executions(proxies)
entries = re.findall(r'timestep="(.*?)".*?file="(.*?)"', (folder / "swing.pvd").read_text())
assert len(entries) == 21, len(entries)

# Each file holds its own time, as a pipeline that is asked for that time alone makes it.
stage = surface.GetClientSideObject()
for number in (0, 7, 20):
    time, file = float(entries[number][0]), entries[number][1]
    assert abs(time - number / 20) < 1e-9, (number, time)
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(folder / file))
    reader.Update()
    surface.UpdatePipeline(time)
    found, expected = (
        vtk_to_numpy(data.GetPoints().GetData())
        for data in (reader.GetOutput(), stage.GetOutputDataObject(0))
    )
    assert abs(found - expected).max() == 0, number
surface.UpdatePipeline(0.05)
first = bounds(surface)
surface.UpdatePipeline(0.1)
second = bounds(surface)

# Played, each step is a frame; a time in between is none of its neighbours.
view = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, view)
scene = simple.GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
assert len(scene.TimeKeeper.TimestepValues) == 21
scene.PlayMode = "Snap To TimeSteps"
scene.GoToFirst()
simple.Render(view)
before = executions(proxies)
scene.Play()
ran = [b - a for a, b in zip(before, executions(proxies), strict=True)]
assert ran[:3] == [0, 0, 0], ran
assert 20 <= ran[3] == ran[4] == ran[5] <= 21, ran
scene.AnimationTime = 0.0737
simple.Render(view)
between = bounds(surface)
assert min(first[4], second[4]) < between[4] < max(first[4], second[4])
assert response.GetClientSideObject().executions == surface.GetClientSideObject().executions

response.Frames = 11
response.UpdatePipelineInformation()
assert len(response.TimestepValues) == 11, response.TimestepValues

# What "spacemap export" has written has its times here, too.
for files in (folder / "cloth.pvd", [folder / "cloth_0.vtp", folder / "cloth_1.vtp"]):
    read = simple.OpenDataFile([str(f) for f in files] if isinstance(files, list) else str(files))
    read.UpdatePipelineInformation()
    assert list(read.TimestepValues) == [0.0, 0.1 / 3], read.TimestepValues
    read.UpdatePipeline(0.1 / 3)
    assert bounds(read)[4] < -0.00025, bounds(read)
whole, made = (simple.OpenDataFile(str(folder / n)) for n in ("cloth_1.vtp", "in_pieces.pvtp"))
for read in (whole, made):
    read.UpdatePipeline()
whole, made = (read.GetDataInformation() for read in (whole, made))
assert made.GetNumberOfCells() == whole.GetNumberOfCells() > 0
assert made.GetBounds() == whole.GetBounds()
for side in ("GetPointDataInformation", "GetCellDataInformation"):
    counts = [getattr(info, side)().GetNumberOfArrays() for info in (whole, made)]
    assert counts[0] == counts[1] > 0, counts

print("every step is offered, and any time between")
