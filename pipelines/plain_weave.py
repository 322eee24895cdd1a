"""The paper's experiment as a pipeline of six filters, without a scene file.

A plain weave hangs by its top edge in a coarse cage and swings under gravity. Run it with
``python pipelines/plain_weave.py``: it prints how far the lower edge swings out over time. Given
the name of a picture, ``python pipelines/plain_weave.py cloth.png``, it draws the last moment.
"""

import sys
import warnings

import numpy as np
import pyvista as pv

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    PatchTessellator,
    SpacemapWarning,
    TetraCage,
    WeaveSource,
    connect,
)

# One layer of linear tetrahedra is too stiff; this modulus makes up for it.
warnings.simplefilter("ignore", SpacemapWarning)
weave = WeaveSource(pattern="plain", ends=7, picks=7)
cage = TetraCage(divisions=(5, 5, 1))
modal = ModalSolver(youngs_modulus="1.3 kPa", density="300 kg/m3", modes=180, fixed="+y")
response = ModalResponse(alpha="10 Hz", gravity=(0.0, -6.9, 6.9))
warp = BarycentricWarp()
surface = PatchTessellator(subdivisions=6)

connect((weave, connect(weave, cage, modal, response)), warp, surface)

# Only the last three stages run again for a new time.
times = np.linspace(0.0, 0.04, 9)
reach = []
for time in times:
    surface.update(time=time)
    cloth = pv.wrap(surface.output)
    reach.append(cloth["displacement"][:, 2].max())
    print(f"t = {time * 1e3:4.0f} ms   the lower edge is {reach[-1] * 1e3:.3f} mm in front")

# It is out farthest after half a period of the first mode.
frequency = pv.wrap(modal.output).field_data["frequencies"][0]
print(f"first mode: {frequency:.2f} Hz, half a period: {0.5e3 / frequency:.1f} ms")
assert abs(times[np.argmax(reach)] - 0.5 / frequency) < times[1]
assert [stage.executions for stage in (weave, cage, modal, response, warp)] == [1, 1, 1, 9, 9]

if len(sys.argv) > 1:
    cloth.plot(scalars="color", rgb=True, off_screen=True, screenshot=sys.argv[1], cpos="iso")
