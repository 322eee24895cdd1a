"""A film in PyVista: a cloth that is let go, over one period of its first mode.

``python pipelines/film_with_pyvista.py swing.gif``; without a name it goes into a temporary folder.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from PIL import Image

import spacemap_vtk.accessor  # noqa: F401  (pyvista >= 0.48 finds it by itself once installed)
from spacemap_vtk import ModalSolver, PatchTessellator, WeaveSource, connect
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.io.formats.film import write_film

weave, surface = WeaveSource(ends=7, picks=7), PatchTessellator()
connect(weave, surface).update()
swing = pv.wrap(surface.output).spacemap.modal(
    divisions=(5, 5, 1), order=2, modes=60, youngs_modulus="4 kPa", alpha=0.0, gravity=(0, -2, 2)
)
modal = next(stage for stage in swing.upstream() if isinstance(stage, ModalSolver))
period = 1.0 / pv.wrap(modal.GetOutputDataObject(0)).field_data["frequencies"][0]

prepare_offscreen()
plotter = pv.Plotter(off_screen=True, window_size=(480, 480))
actor = plotter.add_mesh(swing, scalars="color", rgb=True, smooth_shading=True)
plotter.view_vector((2.5, 0.6, 1.0), (0, 1, 0))
plotter.camera.zoom(0.9)
times, reach = np.linspace(0.0, period, 12, endpoint=False), []


def frames():
    """Draw one frame after the other, and note how far the lower edge is out."""
    for time in times:
        actor.mapper.GetInputAlgorithm().UpdateTimeStep(time)  # it needs no new mesh
        reach.append(pv.wrap(swing.GetOutputDataObject(0))["displacement"][:, 2].max())
        plotter.render()
        yield plotter.screenshot(return_img=True)


file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()) / "swing.gif"
write_film(file, frames(), rate=12.0)
plotter.close()
print(f"{file}: {len(times)} frames, a period of {period * 1e3:.1f} ms")
# It is let go at t = 0, is out farthest half a period later, and comes back.
assert reach[0] == 0.0
assert abs(times[int(np.argmax(reach))] / period - 0.5) < 0.05
assert modal.executions == 1
with Image.open(file) as film:  # which keeps frames that look alike as one
    assert len(times) // 2 < film.n_frames <= len(times)
