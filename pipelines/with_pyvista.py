"""The pipeline in PyVista: the surface is a live mesh in a plotter, coloured yarn by yarn.

``python pipelines/with_pyvista.py cloth.png`` keeps the picture.
"""

import sys

import numpy as np
import pyvista as pv

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    PatchTessellator,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.draw.graphics import prepare_offscreen

weave = WeaveSource(ends=7, picks=7, warp_diameter="0.25 mm", weft_diameter="0.25 mm")
cage, modal = TetraCage(divisions=(5, 5, 1), order=2), ModalSolver(youngs_modulus="8 kPa", modes=60)
response, warp, surface = ModalResponse(alpha=10.0), BarycentricWarp(), PatchTessellator()
connect((weave, connect(weave, cage, modal, response)), warp, surface)

# At rest the cloth is as thick as one end and one pick: they touch and do not overlap.
surface.update(time=0.0)
rest = pv.wrap(surface.output)
thickness = rest.bounds[5] - rest.bounds[4]
print(f"{rest.n_cells} polygons, {thickness * 1e3:.4f} mm thick")
assert abs(thickness - 0.5e-3) < 1e-3 * 0.5e-3

prepare_offscreen()
plotter = pv.Plotter(off_screen=True, window_size=(800, 600))
actor = plotter.add_mesh(surface, scalars="color", rgb=True)
plotter.camera_position = "iso"
first = plotter.screenshot(return_img=True)

# The mapper asks the pipeline for a new time; it needs no new mesh.
actor.mapper.GetInputAlgorithm().UpdateTimeStep(0.02)
plotter.render()
last = plotter.screenshot(sys.argv[1] if len(sys.argv) > 1 else None, return_img=True)
assert np.any(first != last)
assert modal.executions == 1
plotter.close()
