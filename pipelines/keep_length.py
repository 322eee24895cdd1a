"""The same cloth pulled by 5 %, its yarns embedded in space and keeping their length, side by side.

A plain weave is pulled along its warp, and gets as much narrower as its yarns ask for. Embedded
yarns are stretched and squeezed with the space around them; with CrimpInterchange the warp
straightens, the weft bends the more, and sections stay round. Run it with
``python pipelines/keep_length.py``; given the name of a picture, it draws both.
"""

import sys

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import (
    BarycentricWarp,
    CrimpInterchange,
    PatchTessellator,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.textile.geometry.cloth_axes import sample_axes

PULL = np.array([0.92, 1.05, 1.0])  # along the weft, the warp and the normal

weave = WeaveSource(ends=9, picks=9, warp_diameter="0.25 mm", weft_diameter="0.25 mm")
cage = pv.wrap(connect(weave, TetraCage(divisions=(4, 4, 1))).update().output)
cage["displacement"] = cage.points * (PULL - 1.0)

yarns = CrimpInterchange()
connect((weave, cage), yarns)
embedded = connect((weave, cage), BarycentricWarp(), PatchTessellator(subdivisions=6))
kept = connect((yarns, cage), BarycentricWarp(), PatchTessellator(subdivisions=6))
embedded.update()
kept.update()

# What embedding does to the length of the yarns' axes, and what is left of it.
places, owners = sample_axes(weave.cloth, samples=32)
for number, family in enumerate(("warp", "weft")):
    yarn = places[owners == number * weave.cloth.size[0]]
    lengths = [np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in (yarn, yarn * PULL)]
    cells = yarns.output.GetCellData()
    own = vtk_to_numpy(cells.GetArray("family")) == number
    strain = vtk_to_numpy(cells.GetArray("yarn_strain"))[own].max()
    crimp = vtk_to_numpy(cells.GetArray("crimp"))[own].max()
    print(
        f"{family}: embedded it strains by {lengths[1] / lengths[0] - 1.0:.2%}, "
        f"now by {strain:.2%}; its crimp goes from 14.35 % to {crimp:.2%}"
    )
    assert strain < 1e-9

# Sections: embedded picks are pulled wide by what the warp is pulled, kept ones are round.
for surface, round_ in ((embedded, False), (kept, True)):
    mesh = pv.wrap(surface.output)
    first = mesh.extract_cells(np.flatnonzero(mesh["yarn"] == weave.cloth.size[0])).points
    end = first[first[:, 0] < first[:, 0].min() + 1e-9]
    height, width = np.ptp(end[:, 2]), np.ptp(end[:, 1])
    print(f"a pick is {width * 1e3:.4f} mm wide and {height * 1e3:.4f} mm high")
    assert (abs(width / height - 1.0) < 1e-3) == round_

if len(sys.argv) > 1:
    prepare_offscreen()
    plotter = pv.Plotter(shape=(1, 2), off_screen=True, window_size=(1600, 640), border=False)
    for column, (surface, title) in enumerate(
        ((embedded, "embedded: warp strained, weft squeezed"), (kept, "yarns keep their length"))
    ):
        plotter.subplot(0, column)
        mesh = pv.wrap(surface.output)
        plotter.set_background("#eef2f6")
        plotter.add_mesh(mesh, scalars="color", rgb=True, smooth_shading=True, specular=0.2)
        plotter.add_text(title, position="lower_edge", font_size=13, color="#29303a")
        plotter.camera_position = "xy"
        plotter.camera.azimuth, plotter.camera.elevation = 0, -58
        plotter.camera.zoom(1.5)
    plotter.link_views()
    plotter.screenshot(sys.argv[1])
