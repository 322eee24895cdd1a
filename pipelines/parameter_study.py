"""A parameter study: how stiffness changes sag and frequency.

Only what depends on a parameter runs again: the cloth is woven once for four moduli.
"""

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    TetraCage,
    WeaveSource,
    connect,
)

weave, cage = WeaveSource(ends=9, picks=9), TetraCage(divisions=(6, 6, 1), order=2)
modal = ModalSolver(modes=24, fixed="+y")
response = ModalResponse(initial="equilibrium", gravity=(0.0, 0.0, -9.81))
warp = BarycentricWarp()
connect((weave, connect(weave, cage, modal, response)), warp)

moduli = np.array([0.5e6, 1e6, 2e6, 4e6])
sags, frequencies = [], []
print("modulus [MPa]   sag [µm]   first mode [Hz]")
for modulus in moduli:
    modal.youngs_modulus = modulus
    warp.update()
    moved = warp.GetOutputDataObject(0).GetPointData().GetArray("displacement")
    sags.append(-vtk_to_numpy(moved)[:, 2].min())
    field = modal.GetOutputDataObject(0).GetFieldData()
    frequencies.append(field.GetArray("frequencies").GetValue(0))
    print(f"{modulus / 1e6:13g}{sags[-1] * 1e6:11.4f}{frequencies[-1]:18.2f}")

# Linear elasticity: sag goes with 1 / E, frequency with the root of E.
assert np.allclose(sags * moduli, sags[0] * moduli[0], rtol=1e-5)
assert np.allclose(frequencies / np.sqrt(moduli), frequencies[0] / np.sqrt(moduli[0]), rtol=1e-6)
assert [stage.executions for stage in (weave, cage, modal)] == [1, 1, 4]
