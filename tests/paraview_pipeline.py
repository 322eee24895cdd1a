"""Run by ParaView's own Python (VTK 9.2, numpy 1.24, scipy 1.10, no pyvista): the main pipeline.

pvpython tests/paraview_pipeline.py
"""

import sys
import tempfile
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkIOGeometry import vtkSTLWriter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    MotionReader,
    ObjectSource,
    PatchTessellator,
    SpacemapWarning,
    TetraCage,
    WeaveSource,
)

window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
vtkOutputWindow.SetInstance(window)
warnings.simplefilter("ignore", SpacemapWarning)  # these cages are doubtful on purpose


def made_and_left() -> float:
    """Make a pipeline, and let go of its stages in the order of data, as a function does."""
    weave, cage = WeaveSource(ends=4, picks=3), TetraCage(divisions=(3, 3, 1))
    modal, response, warp = ModalSolver(modes=12), ModalResponse(), BarycentricWarp()
    cage.SetInputConnection(weave.GetOutputPort())
    modal.SetInputConnection(cage.GetOutputPort())
    response.SetInputConnection(modal.GetOutputPort())
    warp.SetInputConnection(0, weave.GetOutputPort())
    warp.SetInputConnection(1, response.GetOutputPort())
    warp.update(time=0.01)
    return float(warp.GetOutputDataObject(0).GetBounds()[4])


# Before VTK 9.7 the second or third of these corrupted memory.
assert len({made_and_left() for _ in range(10)}) == 1

weave = WeaveSource(ends=7, picks=7)
cage = TetraCage(divisions=(5, 5, 1))
modal = ModalSolver(youngs_modulus=1e3, density=300, modes=180, fixed="+y")
response = ModalResponse(alpha=2.0, gravity=(0.0, 0.0, -9.81), initial="equilibrium")
warp = BarycentricWarp()
surface = PatchTessellator(subdivisions=3)
cage.SetInputConnection(weave.GetOutputPort())
modal.SetInputConnection(cage.GetOutputPort())
response.SetInputConnection(modal.GetOutputPort())
warp.SetInputConnection(0, weave.GetOutputPort())
warp.SetInputConnection(1, response.GetOutputPort())
surface.SetInputConnection(warp.GetOutputPort())
stages = [weave, cage, modal, response, warp, surface]


def lowest() -> float:
    """The deepest point of the surface's displacement along z, in m."""
    data = surface.GetOutputDataObject(0).GetPointData()
    return float(vtk_to_numpy(data.GetArray("displacement"))[:, 2].min())


grid = cage.GetOutputDataObject(0)
surface.update(time=0.0)
assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells()) == (72, 125)
sag = lowest()
assert sag < -1e-4, sag

# From rest an undamped mode swings to twice its static sag after half its period.
response.configure(initial="rest", alpha=0.0)
eigenvalue = modal.GetOutputDataObject(0).GetFieldData().GetArray("eigenvalues").GetValue(0)
surface.update(time=0.0)
assert lowest() == 0.0
surface.update(time=3.141592653589793 / eigenvalue**0.5)
assert 1.9 * sag > lowest() > 2.2 * sag, (lowest(), sag)
assert [stage.executions for stage in stages] == [1, 1, 1, 3, 3, 3], [s.executions for s in stages]

# What later VTKs bring for all filters, but for `>>`.
assert surface.update(time=0.0).output is surface.GetOutputDataObject(0)
patches = weave()
assert patches.GetNumberOfCells() == weave.output.GetNumberOfCells() == 1176
assert PatchTessellator(subdivisions=3)(patches).GetNumberOfCells() == 9 * 1176
try:
    weave >> surface
except TypeError as error:
    assert "unsupported operand" in str(error), error
else:
    assert hasattr(type(weave), "__rshift__"), "VTK 9.2 has no >>"

# Every kind of yarn and weave, on the oldest VTK: 8-end satin of flat yarns by their count.
satin = WeaveSource(
    pattern="satin 8/3",
    ends=8,
    picks=8,
    warp_count="167 dtex",
    warp_section="racetrack",
    weft_diameter=["0.2 mm", "0.25 mm"],
    weft_crimp="2 %",
    exact=True,
)
satin.update()
assert satin.cloth.drawdown.sum() == 56
assert satin.GetOutputDataObject(0).GetPointData().GetRationalWeights() is not None
assert 0 < satin.feasible["warp_spacing"][0] < satin.feasible["warp_spacing"][1]

try:
    weave.warp_diameter = "0.6 mm"
    surface.update()
except ValueError as error:
    assert "warp_diameter" in str(error), error
else:
    raise AssertionError("an impossible cloth was accepted")

# An object in a carved cage, and a motion out of a file, without pyvista.
sphere = vtkSphereSource()
sphere.SetThetaResolution(40)
carved = TetraCage(method="carved", divisions=(6, 6, 6), margin=1)
carved.SetInputConnection(sphere.GetOutputPort())
carved.update()
grid = vtkUnstructuredGrid()
grid.ShallowCopy(carved.GetOutputDataObject(0))
rest = vtk_to_numpy(grid.GetPoints().GetData())
turn = numpy_to_vtk(rest[:, [1, 2, 0]] - rest, deep=True)
turn.SetName("u")
grid.GetPointData().AddArray(turn)
with tempfile.TemporaryDirectory() as folder:
    for name, writer, data in (
        ("cage.vtu", vtkXMLUnstructuredGridWriter(), grid),
        ("ball.stl", vtkSTLWriter(), sphere.GetOutput()),
    ):
        writer.SetFileName(f"{folder}/{name}")
        writer.SetInputData(data)
        writer.Write()
    ball = ObjectSource(file=f"{folder}/ball.stl")
    motion = MotionReader(file=f"{folder}/cage.vtu", array="u")
    warp = BarycentricWarp(outside="error", smooth=True)
    warp.SetInputConnection(0, ball.GetOutputPort())
    warp.SetInputConnection(1, motion.GetOutputPort())
    warp.update(time=0.0)
    before = vtk_to_numpy(ball.GetOutputDataObject(0).GetPoints().GetData())
    after = vtk_to_numpy(warp.GetOutputDataObject(0).GetPoints().GetData())
    assert len(before) > 100
    assert abs(after - before[:, [1, 2, 0]]).max() < 1e-6

assert window.GetOutput() == "", window.GetOutput()
vtkOutputWindow.SetInstance(usual)  # pvpython's own stdout goes through it
assert "pyvista" not in sys.modules
print(
    f"VTK {vtkVersion.GetVTKVersion()}, Python {sys.version.split()[0]}: "
    f"72 vertices, 125 tetrahedra, sag {-sag * 1e3:.4f} mm, 1 passed"
)
