"""A parameter study in PyVista: the same cloth, four times as stiff from one to the next.

``python pipelines/parameter_study_with_pyvista.py study.png`` keeps a picture of all, side by side.
"""

import sys

import numpy as np
import pyvista as pv

import spacemap_vtk.accessor  # noqa: F401  (pyvista >= 0.48 finds it by itself once installed)
from spacemap_vtk import ModalSolver, PatchTessellator, WeaveSource, connect
from spacemap_vtk.draw.graphics import prepare_offscreen

weave, surface = WeaveSource(ends=7, picks=7), PatchTessellator()
connect(weave, surface).update()
swing = pv.wrap(surface.output).spacemap.modal(
    divisions=(5, 5, 1), order=2, modes=60, fixed="+y", gravity=(0, -4, 4), initial="equilibrium"
)
modal = next(stage for stage in swing.upstream() if isinstance(stage, ModalSolver))

moduli, hung = 2000.0 * 4.0 ** np.arange(4), []
for modulus in moduli:
    modal.youngs_modulus = modulus  # only the solver and what follows runs again
    swing.update()
    hung.append(pv.wrap(swing.GetOutputDataObject(0)).copy())
reach = np.array([cloth["displacement"][:, 2].max() for cloth in hung])
for modulus, out in zip(moduli, reach, strict=True):
    print(f"{modulus:6g} Pa: its lower edge hangs {out * 1e6:6.1f} µm in front")
assert np.allclose(reach * moduli, reach[0] * moduli[0], rtol=1e-5)  # linear elasticity

if len(sys.argv) > 1:
    prepare_offscreen()
    plotter = pv.Plotter(shape=(1, 4), off_screen=True, window_size=(1600, 600), border=False)
    for column, (modulus, cloth) in enumerate(zip(moduli, hung, strict=True)):
        plotter.subplot(0, column)
        plotter.add_mesh(cloth, scalars="color", rgb=True, smooth_shading=True)
        plotter.add_text(f"{modulus:g} Pa", position="upper_edge", font_size=14)
        plotter.view_vector((2.5, 0.6, 1.0), (0, 1, 0))
    plotter.link_views()
    plotter.camera.zoom(1.6)
    plotter.screenshot(sys.argv[1])
