"""Bend any pyvista mesh with a coarse cage: ``mesh.spacemap.deform(cage, displacement)``.

A bundled scan-like mesh, an ant, stands in a cage of 64 hexahedra. The cage's 125 corners are bent
round an arc by a formula; the ant follows, with its normals. Run it with
``python pipelines/bend_a_mesh.py``; given the name of a picture, it draws before and after.
"""

import sys

import numpy as np
import pyvista as pv
from pyvista import examples

import spacemap_vtk.accessor  # noqa: F401  (pyvista >= 0.48 finds it by itself once installed)
from spacemap_vtk.draw.graphics import prepare_offscreen

ant = examples.load_ant().compute_normals()
x0, x1, y0, y1, z0, z1 = ant.bounds
cage = pv.ImageData(
    dimensions=(5, 5, 5),
    spacing=((x1 - x0) / 4, (y1 - y0) / 4, (z1 - z0) / 4),
    origin=(x0, y0, z0),
)

# The x axis becomes an arc in the plane of x and z; lengths along the middle line stay.
x, y, z = cage.points.T
angle = np.radians(80) * (x - x0) / (x1 - x0)
radius = (x1 - x0) / np.radians(80)
middle = (z0 + z1) / 2
bent_points = np.stack(
    [
        x0 + (radius - (z - middle)) * np.sin(angle),
        y,
        middle + radius - (radius - (z - middle)) * np.cos(angle),
    ],
    axis=1,
)
bent = ant.spacemap.deform(cage, bent_points - cage.points, smooth=True)

# The arc's chord in closed form, against the ant's own ends along x.
print(f"length at rest {x1 - x0:.2f}, bent {bent.bounds.x_max - bent.bounds.x_min:.2f}")
ends = [int(np.argmin(ant.points[:, 0])), int(np.argmax(ant.points[:, 0]))]
exact = []
for px, py, pz in ant.points[ends].astype(float):
    turn, reach = np.radians(80) * (px - x0) / (x1 - x0), radius - (pz - middle)
    exact.append([x0 + reach * np.sin(turn), py, middle + radius - reach * np.cos(turn)])
error = np.abs(bent.points[ends] - exact).max() / (x1 - x0)
print(f"its ends are {error:.1%} of its length from where the exact bend has them")
assert error < 0.02
# Unit normals that turned with it: those of the front by nearly 80 degrees.
assert np.allclose(np.linalg.norm(bent["Normals"], axis=1), 1, atol=1e-5)

if len(sys.argv) > 1:
    prepare_offscreen()
    plotter = pv.Plotter(shape=(1, 2), off_screen=True, window_size=(1600, 700))
    for column, mesh in enumerate((ant, bent)):
        plotter.subplot(0, column)
        plotter.add_mesh(mesh, color="#c8553d", smooth_shading=True, specular=0.3)
        plotter.camera_position = "xz"
        plotter.camera.azimuth, plotter.camera.elevation = 30, 20
    plotter.link_views()
    plotter.screenshot(sys.argv[1])
