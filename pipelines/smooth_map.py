"""The smooth map beside the piecewise affine one: ``BarycentricWarp(smooth=True)``.

A fine rod stands in a cage of only 2 x 2 x 4 hexahedra that is twisted by a formula. With the plain
map the rod shows the borders of the tetrahedra as kinks; with the smooth one it does not, and comes
nearer to the exact twist. Run it with ``python pipelines/smooth_map.py``; given the name of a
picture, it draws exact, plain and smooth side by side.
"""

import sys

import numpy as np
import pyvista as pv

import spacemap_vtk.accessor  # noqa: F401  (pyvista >= 0.48 finds it by itself once installed)
from spacemap_vtk.draw.graphics import prepare_offscreen


def twisted(points: np.ndarray) -> np.ndarray:
    """Turn each height by an angle that grows upwards to 100 degrees, and bend a little."""
    x, y, z = np.asarray(points, dtype=float).T
    angle = np.radians(100) * z / 4
    turned_x, turned_y = (
        x * np.cos(angle) - y * np.sin(angle),
        x * np.sin(angle) + y * np.cos(angle),
    )
    return np.stack([turned_x + 0.05 * z**2, turned_y, z], axis=1)


profile = pv.Box((-0.8, 0.8, -0.8, 0.8, 0.0, 4.0), level=60, quads=True).triangulate()
rod = profile.compute_normals(cell_normals=False, feature_angle=30, split_vertices=True)
cage = pv.ImageData(dimensions=(3, 3, 5), origin=(-1, -1, 0), spacing=(1, 1, 1))
displacement = twisted(cage.points) - cage.points

exact = twisted(rod.points)
print("            largest error   largest kink of the side's lines")
kinks = {}
for name, smooth in (("affine", False), ("smooth", True)):
    moved = rod.spacemap.deform(cage, displacement, smooth=smooth, outside="error")
    # Lines up the side x = 0.8: their direction jumps at the borders of tetrahedra.
    z = np.linspace(0.0, 4.0, 2001)
    line = np.stack([np.full_like(z, 0.8), np.full_like(z, 0.3), z], axis=1)
    path = pv.PolyData(line).spacemap.deform(cage, displacement, smooth=smooth).points
    way = np.diff(np.asarray(path, dtype=float), axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    turn = np.degrees(2 * np.arcsin(np.linalg.norm(np.diff(way, axis=0), axis=1).clip(0, 2) / 2))
    kinks[name] = turn.max()
    error = np.linalg.norm(moved.points - exact, axis=1).max()
    print(f"{name:>10}{error:>14.4f}{turn.max():>20.2f} degrees")
    if smooth:
        smooth_rod, smooth_error = moved, error
    else:
        plain_rod, plain_error = moved, error
assert smooth_error < 0.5 * plain_error
# what is left is the bend between two samples: there is no kink
assert kinks["smooth"] < 0.01 * kinks["affine"]

if len(sys.argv) > 1:
    prepare_offscreen()
    ideal = rod.copy()
    ideal.clear_data()
    ideal.points = exact
    ideal = ideal.compute_normals(cell_normals=False, split_vertices=False)
    plotter = pv.Plotter(shape=(1, 3), off_screen=True, window_size=(1500, 900), border=False)
    titles = ("exact", "affine in each tetrahedron", "smooth=True")
    for column, (mesh, title) in enumerate(
        zip((ideal, plain_rod, smooth_rod), titles, strict=True)
    ):
        plotter.subplot(0, column)
        plotter.add_mesh(mesh, color="#d8a25a", smooth_shading=True, specular=0.5)
        plotter.add_text(title, font_size=12, position="lower_edge")
        plotter.camera_position = [(9, -9, 6), (0.3, 0, 2), (0, 0, 1)]
        plotter.camera.zoom(1.25)
    plotter.screenshot(sys.argv[1])
