"""A fabric on another solver's result, in PyVista: ``mesh.spacemap.deform(cage, "U")``.

PyVista reads what CalculiX has computed, a sheet of hexahedra that falls from its top edge. Given
the name of a picture, ``python pipelines/on_a_result_with_pyvista.py cloth.png``, it draws both.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import spacemap_vtk.accessor  # noqa: F401  (pyvista >= 0.48 finds it by itself once installed)
from spacemap_vtk import PatchTessellator, WeaveSource, connect
from spacemap_vtk.draw.graphics import prepare_offscreen

RESULT = Path(__file__).resolve().parents[1] / "scenes" / "calculix" / "sheet.pvd"

weave, surface = WeaveSource(ends=7, picks=7), PatchTessellator(subdivisions=4)
connect(weave, surface).update()
fabric = pv.wrap(surface.output)

reader = pv.get_reader(RESULT)
reader.set_active_time_value(0.026)
sheet = reader.read()[0]
swung = fabric.spacemap.deform(sheet, "U", smooth=True)

# VTK's own interpolation in the hexahedra, which shares nothing with the map through tetrahedra.
sampled = pv.PolyData(fabric.points).sample(sheet)
assert sampled["vtkValidPointMask"].all()
difference = np.linalg.norm(swung["displacement"] - sampled["U"], axis=1).max()
reach = np.linalg.norm(sampled["U"], axis=1).max()
print(f"it swings out by {reach * 1e3:.3f} mm; the two maps differ by {difference / reach:.2%}")
assert reach > 1.3e-3
assert difference < 0.01 * reach

if len(sys.argv) > 1:
    prepare_offscreen()
    plotter = pv.Plotter(off_screen=True, window_size=(900, 700))
    plotter.add_mesh(swung, scalars="color", rgb=True, smooth_shading=True)
    plotter.add_mesh(sheet.warp_by_vector("U"), style="wireframe", color="black", opacity=0.4)
    plotter.camera_position = [(7e-3, 2e-3, 6e-3), (0, 0, 0.5e-3), (0, 1, 0)]
    plotter.screenshot(sys.argv[1])
