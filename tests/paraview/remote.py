"""The client of a pvserver on which the pipeline runs; the client need not have the plugin.

Run with the server's port, a draft, a picture to write, and the plugin if the server has yet to
load it.
"""

import math
import sys

from paraview import servermanager, simple

port, draft, picture, *plugin = sys.argv[1:]
here = hasattr(simple, "WeaveSource")  # the client has the plugin as well
simple.Connect("localhost", int(port))
assert hasattr(simple, "WeaveSource") == (not plugin)
for path in plugin:
    simple.LoadPlugin(path, remote=True)

# Texts are texts: only the plugin on the client's side makes them of numbers.
weave = simple.WeaveSource(Ends=7 if here else "7", Picks="7")
cage = simple.TetraCage(Input=weave, Divisions=[5, 5, 1], Order=2)
modal = simple.ModalSolver(Input=cage, YoungsModulus=2e3, Modes=40)
response = simple.ModalResponse(Input=modal, Alpha="0", Gravity="0, 0, -1")
warp = simple.BarycentricWarp(Input=weave, Cage=response)
surface = simple.PatchTessellator(Input=warp)
# Nothing of it is here.
assert surface.GetClientSideObject() is None


def lowest() -> float:
    """Return the deepest displacement in m, from the server's summary of the array."""
    array = surface.GetDataInformation().GetPointDataInformation().GetArrayInformation
    return array("displacement").GetComponentRange(2)[0]


surface.UpdatePipeline(0.0)
assert lowest() == 0.0
assert list(response.GetProperty("TimeRange")) == [0.0, 10.0]
field = modal.GetDataInformation().GetFieldDataInformation()
eigenvalue = field.GetArrayInformation("eigenvalues").GetComponentRange(0)[0]
half_a_period = math.pi / math.sqrt(eigenvalue)
surface.UpdatePipeline(half_a_period)
swung = lowest()
response.Initial = "equilibrium"
surface.UpdatePipeline(half_a_period)
sag = lowest()
assert 1.9 < swung / sag < 2.1, (swung, sag)

# The polygons themselves, brought here: they are those that the server tells of.
fetched = servermanager.Fetch(surface)
assert fetched.GetNumberOfCells() == surface.GetDataInformation().GetNumberOfCells() > 10_000
assert fetched.GetPointData().GetArray("displacement").GetRange(2)[0] == sag

# A bad value: its message crosses the wire, and the last good state stays.
print("two mistakes:", flush=True)
response.Duration = -1.0
weave.WarpDiameter = "0.7 mm"
surface.UpdatePipeline(half_a_period)
print("no more", flush=True)
assert lowest() == sag
response.Duration = 10.0
weave.WarpDiameter = ""
surface.Subdivisions = "2"
surface.UpdatePipeline(half_a_period)
assert surface.GetDataInformation().GetNumberOfCells() < fetched.GetNumberOfCells()

try:
    weave.WarpDiameter = 0.25e-3
except TypeError:
    assert not here
else:
    assert here
    weave.WarpDiameter = ""

# Files are the server's.
reader = simple.OpenDataFile(draft)
reader.Ends = reader.Picks = "12"
reader.WarpDiameter = reader.WeftDiameter = "0.4 mm"
reader.UpdatePipeline()
assert reader.GetDataInformation().GetNumberOfCells() > 1000

# A picture.
view = simple.CreateRenderView(ViewSize=[300, 200])
display = simple.Show(surface, view)
# The yarns' own colours: by themselves where the plugin is, by a click elsewhere.
assert display.MapScalars == (0 if here else 1)
display.MapScalars = 0
simple.Render(view)
simple.SaveScreenshot(picture, view)
simple.Disconnect()
print(f"sag {-sag * 1e6:.1f} um, swing {-swung * 1e6:.1f} um over the wire")
