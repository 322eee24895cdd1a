"""A parameter study in ParaView: how stiffness changes sag and frequency.

    eval "$(spacemap paraview)"
    pvbatch pipelines/paraview/parameter_study.py cloth.png

Only what depends on a parameter runs again: the cloth is woven once for four moduli.
"""

import sys

from paraview import simple

weave = simple.WeaveSource(Ends=7, Picks=7)
cage = simple.TetraCage(Input=weave, Divisions=[5, 5, 1], Order=2)
modal = simple.ModalSolver(Input=cage, Modes=24)
response = simple.ModalResponse(Input=modal, Initial="equilibrium", Gravity=[0.0, 0.0, -1.0])
warp = simple.BarycentricWarp(Input=weave, Cage=response)
surface = simple.PatchTessellator(Input=warp)

moduli = [500.0, 1e3, 2e3, 4e3]
sags, frequencies = [], []
print("modulus [Pa]   sag [um]   first mode [Hz]")
for modulus in moduli:
    modal.YoungsModulus = modulus
    surface.UpdatePipeline(0.0)
    points = surface.GetDataInformation().GetPointDataInformation()
    sags.append(-points.GetArrayInformation("displacement").GetComponentRange(2)[0])
    field = modal.GetDataInformation().GetFieldDataInformation()
    frequencies.append(field.GetArrayInformation("frequencies").GetComponentRange(0)[0])
    print(f"{modulus:12g}{sags[-1] * 1e6:11.2f}{frequencies[-1]:18.3f}")

# Linear elasticity: sag goes with 1 / E, frequency with the root of E.
for modulus, sag, frequency in zip(moduli, sags, frequencies, strict=True):
    assert abs(sag * modulus / (sags[0] * moduli[0]) - 1) < 1e-4
    assert abs(frequency**2 / modulus / (frequencies[0] ** 2 / moduli[0]) - 1) < 1e-6

modal.YoungsModulus = moduli[0]
view = simple.GetActiveViewOrCreate("RenderView")
simple.Show(surface, view)  # in the yarns' own colours
simple.ResetCamera(view)
view.GetActiveCamera().Azimuth(40)
simple.Render(view)
if len(sys.argv) > 1:
    simple.SaveScreenshot(sys.argv[1], view, ImageResolution=[1280, 960])
