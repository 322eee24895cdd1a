"""A fabric on another solver's result, in plain VTK. It runs in ParaView's Python too.

CalculiX has let a soft sheet of hexahedra fall from its top edge, with large rotations; it knows of
no yarn. `MotionReader` reads its files in place of `ModalSolver` and `ModalResponse`.
"""

from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import BarycentricWarp, MotionReader, PatchTessellator, WeaveSource, connect

RESULT = Path(__file__).resolve().parents[1] / "scenes" / "calculix" / "sheet.pvd"

weave = WeaveSource(ends=7, picks=7, warp_diameter="0.25 mm", weft_diameter="0.25 mm")
motion = MotionReader(file=RESULT, array="U")  # CalculiX's name of the displacement
warp = BarycentricWarp(outside="error", smooth=True)
surface = PatchTessellator(subdivisions=4)

connect((weave, motion), warp, surface)  # from VTK 9.4 on also (weave, motion) >> warp >> surface


def end_length() -> float:
    """The length of the first end's axis in m: its points' means, slice by slice along the yarn."""
    cloth = warp.GetOutputDataObject(0)
    yarn = vtk_to_numpy(cloth.GetCellData().GetArray("yarn"))
    patches = vtk_to_numpy(cloth.GetCells().GetConnectivityArray()).reshape(len(yarn), -1)
    end = np.unique(patches[yarn == 0])
    moved = vtk_to_numpy(cloth.GetPoints().GetData())[end]
    along = vtk_to_numpy(weave.GetOutputDataObject(0).GetPoints().GetData())[end, 1]
    slices = np.digitize(along, np.linspace(along.min(), along.max(), 31)[1:-1])
    means = [moved[slices == k].mean(axis=0) for k in range(30)]
    return float(np.linalg.norm(np.diff(means, axis=0), axis=1).sum())


print("time [ms]   lowest point, in front and up [mm]   length of an end [mm]")
lengths, reach = [], []
for time in np.linspace(0.0, 0.04, 9):
    surface.update(time=time)
    moved = vtk_to_numpy(surface.GetOutputDataObject(0).GetPointData().GetArray("displacement"))
    _, up, front = moved[np.argmax(np.linalg.norm(moved, axis=1))]
    lengths.append(end_length())
    reach.append(front)
    print(f"{time * 1e3:9.0f}{front * 1e3:24.3f}{up * 1e3:10.3f}{lengths[-1] * 1e3:24.3f}")

# Its lower edge swings out by more than a third of its length. A motion linear in time and space
# would stretch the yarns by 7 per cent; the solver's rotations arrive in the fabric, and they keep
# their length.
assert np.hypot(lengths[0], max(reach)) > 1.06 * lengths[0]
assert np.ptp(lengths) < 0.01 * lengths[0]
assert [stage.executions for stage in (weave, motion, warp)] == [1, 9, 9]
