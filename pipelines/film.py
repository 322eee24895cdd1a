"""A film of a scene that comes with the program: ``python pipelines/film.py swing.gif``.

The scene's file says how it looks; this script says when. Without a name the film goes into a
temporary folder.
"""

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import SpacemapWarning
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.io.formats.film import write_film
from spacemap_vtk.scenes.scene import Scene

# One layer of linear tetrahedra is too stiff; the scene's modulus makes up for it.
warnings.simplefilter("ignore", SpacemapWarning)
scene = Scene.read("plain_weave")
scene.set("surface.subdivisions=3")
scene.update(0.0)
frequencies = scene.deformed_cage.GetFieldData().GetArray("frequencies")
period = 1.0 / frequencies.GetValue(0)

# One period of the first mode in twelve frames.
times = [k * period / 12 for k in range(12)]
picture = Picture(scene, times, size=(480, 240))
reach = []


def frames():
    """Draw one frame after the other, and note how far the lower edge is out."""
    for time in times:
        yield picture.draw(time)
        displacement = scene.deformed_cage.GetPointData().GetArray("displacement")
        reach.append(vtk_to_numpy(displacement)[:, 2].max())


file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()) / "swing.gif"
write_film(file, frames(), rate=12.0)
picture.close()
print(f"{file}: {len(times)} frames, one period of {period * 1e3:.1f} ms")

# Out farthest half a period after it is let go.
assert abs(times[int(np.argmax(reach))] - period / 2) <= period / 12
assert file.stat().st_size > 10_000
