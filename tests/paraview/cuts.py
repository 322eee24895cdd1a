"""What ParaView cuts out of the patches keeps its yarns, and cutting crashes nothing."""

from typing import Any

import numpy as np
from paraview import servermanager, simple
from vtkmodules.util.numpy_support import vtk_to_numpy

ENDS = 5
SPACING = 0.5e-3
COLORS = np.array([[0x2D, 0x6A, 0x8E], [0xE8, 0xC7, 0x8F]])  # warp, weft

weave = simple.WeaveSource(Ends=ENDS, Picks=ENDS)
cage = simple.TetraCage(Input=weave, Divisions=[4, 4, 1], Order=2)
modal = simple.ModalSolver(Input=cage, Modes=20, YoungsModulus=1e6)
response = simple.ModalResponse(Input=modal, Duration=0.04, Frames=6)
warp = simple.BarycentricWarp(Input=weave, Cage=response)
surface = simple.PatchTessellator(Input=warp, Subdivisions=3)
yarns = simple.CrimpInterchange(Input=weave, Cage=response)
kept = simple.BarycentricWarp(Input=yarns, Cage=response)  # with numbers that neighbours share not

# As a session goes: played, changed, and with other filters on it before.
view = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, view)
animation = simple.GetAnimationScene()
animation.UpdateAnimationUsingDataTimeSteps()
animation.Play()
for ends in (3, ENDS):
    weave.Ends = ends
    surface.UpdatePipeline(0.01)
for made in (
    simple.Clip(Input=surface),
    simple.Glyph(Input=response, GlyphType="Arrow", OrientationArray=["POINTS", "displacement"]),
    simple.Threshold(Input=surface, Scalars=["CELLS", "yarn"], LowerThreshold=3, UpperThreshold=4),
    simple.Slice(Input=response),
    simple.Shrink(Input=warp),
    simple.ExtractSurface(Input=warp),
):
    made.UpdatePipeline(0.01)


def check(made: Any, whole: set[int]) -> None:
    """Compare each cell's yarn with where it lies, and its colour with its family."""
    made.UpdatePipeline(0.0)  # undeformed: a yarn is where its number says
    data = servermanager.Fetch(made)
    assert data.GetNumberOfCells() > 50
    where = np.array([data.GetCell(i).GetBounds() for i in range(data.GetNumberOfCells())])
    middle = (where[:, ::2] + where[:, 1::2]) / 2
    at_points = data.GetPointData().HasArray("yarn")
    arrays = data.GetPointData() if at_points else data.GetCellData()
    yarn, family, color = (vtk_to_numpy(arrays.GetArray(n)) for n in ("yarn", "family", "color"))
    if at_points:
        corner = [data.GetCell(i).GetPointId(0) for i in range(data.GetNumberOfCells())]
        yarn, family, color = yarn[corner], family[corner], color[corner]
    np.testing.assert_array_equal(family, yarn >= ENDS)
    np.testing.assert_array_equal(color, COLORS[family])
    across = np.where(family == 0, middle[:, 0], middle[:, 1])
    number = np.round(across / SPACING + (ENDS - 1) / 2)
    np.testing.assert_array_equal(yarn % ENDS, number)
    assert set(yarn) == whole, set(yarn)


picks = set(range(ENDS, 2 * ENDS))
for source in (weave, warp, kept):
    cut = simple.Slice(Input=source)
    cut.SliceType.Origin = [0.1e-3, 0.0, 0.0]  # along the third end, across all picks
    check(cut, {2} | picks)
    half = simple.Clip(Input=source, Invert=0)
    half.ClipType.Origin = [0.7e-3, 0.0, 0.0]
    check(half, {4} | picks)
    place = simple.Calculator(Input=source, ResultArrayName="x", Function="coordsX")
    check(simple.Contour(Input=place, ContourBy=["POINTS", "x"], Isosurfaces=[0.1e-3]), {2} | picks)
assert response.GetClientSideObject().executions > 6
kept.UpdatePipeline(0.02)
points = kept.GetClientSideObject().GetOutputDataObject(0).GetPointData()
rest = weave.GetClientSideObject().cloth.families
low, high = (0.5 * min(f.crimp.crimp for f in rest), 2.0 * max(f.crimp.crimp for f in rest))
crimp = vtk_to_numpy(points.GetArray("crimp"))
assert low < crimp.min() < crimp.max() < high
print("cut yarns keep their numbers and colours")
