"""A live pipeline in a pyvista plotter: ``plotter.add_mesh(mesh.spacemap.modal(...))``.

An aeroplane of PyVista's own is held by its tail in a carved cage of soft rubber; let go, it
swings under gravity. Run it with ``python pipelines/live_swing.py``; given the name of a .gif, it
writes a film of a period.
"""

import sys

import numpy as np
import pyvista as pv
from pyvista import examples

import spacemap_vtk.accessor  # noqa: F401  (pyvista >= 0.48 finds it by itself once installed)
from spacemap_vtk.draw.graphics import prepare_offscreen

plane = examples.load_airplane().scale(1e-3)  # metres, 1.8 m long
swing = plane.spacemap.modal(
    method="carved",
    divisions=(12, 10, 5),
    margin=1,
    youngs_modulus="600 kPa",
    density="200 kg/m3",
    modes=40,
    fixed="-x",
    alpha=0.0,
    gravity=(0, 0, -0.6),
)
modal = next(stage for stage in swing.upstream() if type(stage).__name__ == "ModalSolver")
response = next(stage for stage in swing.upstream() if type(stage).__name__ == "ModalResponse")
frequency = pv.wrap(modal.GetOutputDataObject(0)).field_data["frequencies"][0]

# Let go from rest, an undamped mode swings to twice its static sag after half a period.
tip = int(np.argmax(plane.points[:, 0]))
sag = []
for share in (0.0, 0.5, 1.0):
    swing.update(time=share / frequency)
    sag.append(-pv.wrap(swing.GetOutputDataObject(0))["displacement"][tip, 2])
response.initial = "equilibrium"
swing.update()
static = -pv.wrap(swing.GetOutputDataObject(0))["displacement"][tip, 2]
response.initial = "rest"
print(f"{frequency:.2f} Hz; static sag {static * 1e3:.0f} mm, swings to {sag[1] * 1e3:.0f} mm")
assert sag[0] == 0.0
assert abs(sag[1] / static - 2) < 0.1
assert sag[2] < 0.2 * static
assert modal.executions == 1

if len(sys.argv) > 1:
    prepare_offscreen()
    plotter = pv.Plotter(off_screen=True, window_size=(960, 640))
    swing.update(time=0.0)
    plotter.add_mesh(swing, color="#5b7fa3", smooth_shading=True, specular=0.4)
    plotter.camera_position = "xz"
    plotter.camera.azimuth, plotter.camera.elevation = -40, 25
    if sys.argv[1].endswith(".gif"):
        plotter.open_gif(sys.argv[1], fps=20)
        for time in np.linspace(0, 1 / frequency, 24, endpoint=False):
            swing.update(time=time)
            plotter.write_frame()
    else:
        swing.update(time=0.5 / frequency)
        plotter.screenshot(sys.argv[1])
    plotter.close()
