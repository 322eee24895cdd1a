"""The paper's experiment as a pipeline of six filters, without a scene file.

A plain weave hangs by its top edge in a coarse cage and swings under gravity. Run it with
``python pipelines/plain_weave.py``; it prints where the cloth's lower edge is over time, and
draws the last moment into ``plain_weave_pipeline.png`` if that name is given to it:
``python pipelines/plain_weave.py plain_weave_pipeline.png``.
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
)

weave = WeaveSource(pattern="plain", ends=7, picks=7)
cage = TetraCage(divisions=(5, 5, 1))
modal = ModalSolver(youngs_modulus="600 Pa", density="300 kg/m3", modes=180, fixed="+y")
response = ModalResponse(alpha=4.0, gravity=(0.0, -6.9, -6.9))
warp = BarycentricWarp()
surface = PatchTessellator(subdivisions=6)

cage.SetInputConnection(weave.GetOutputPort())
modal.SetInputConnection(cage.GetOutputPort())
response.SetInputConnection(modal.GetOutputPort())
warp.SetInputConnection(0, weave.GetOutputPort())
warp.SetInputConnection(1, response.GetOutputPort())
surface.SetInputConnection(warp.GetOutputPort())

# Only the last three stages run again for a new time.
for time in np.linspace(0.0, 0.12, 7):
    surface.update(time=time)
    cloth = pv.wrap(surface.GetOutputDataObject(0))
    print(f"t = {time * 1e3:5.1f} ms   lowest z = {cloth.bounds.z_min * 1e3:7.3f} mm")

print({type(stage).__name__: stage.executions for stage in (weave, cage, modal, response, warp)})

if len(sys.argv) > 1:
    cloth.plot(scalars="color", rgb=True, off_screen=True, screenshot=sys.argv[1], cpos="iso")
