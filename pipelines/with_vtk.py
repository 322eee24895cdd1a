"""The pipeline in plain VTK: no PyVista, no scene file. It runs in ParaView's Python too.

An undamped cloth that is let go swings to twice the depth at which it would hang at rest.
"""

import math

from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    PatchTessellator,
    TetraCage,
    WeaveSource,
    connect,
)

weave = WeaveSource(ends=7, picks=7)
cage = TetraCage(divisions=(5, 5, 1), order=2)
modal = ModalSolver(youngs_modulus="2 kPa", density="300 kg/m3", modes=100, fixed="+y")
response = ModalResponse(alpha=0.0, gravity=(0.0, 0.0, -1.0))
warp = BarycentricWarp()
surface = PatchTessellator(subdivisions=3)

# From VTK 9.4 on (weave, weave >> cage >> modal >> response) >> warp >> surface does the same.
connect((weave, connect(weave, cage, modal, response)), warp, surface)


def lowest() -> float:
    """The surface's deepest displacement, in m."""
    data = surface.GetOutputDataObject(0).GetPointData()
    return float(vtk_to_numpy(data.GetArray("displacement"))[:, 2].min())


surface.update()
eigenvalues = modal.GetOutputDataObject(0).GetFieldData().GetArray("eigenvalues")
half_a_period = math.pi / math.sqrt(eigenvalues.GetValue(0))
surface.update(time=half_a_period)
swung = lowest()

response.initial = "equilibrium"  # hung at rest under its own weight
surface.update()
sag = lowest()
print(f"sag {-sag * 1e6:.1f} µm, swing {-swung * 1e6:.1f} µm after {half_a_period * 1e3:.1f} ms")
assert 1.9 < swung / sag < 2.1
assert [stage.executions for stage in (weave, cage, modal, response)] == [1, 1, 1, 3]
