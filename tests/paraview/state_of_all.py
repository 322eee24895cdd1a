"""State files of both kinds bring back every proxy: all its values, and what it makes of them.

Run with the folder of the scenes and one to write to.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from paraview import simple, smstate
from pipeline import connected, executions
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Parameter
from spacemap_vtk.paraview.property_xml import property_name
from spacemap_vtk.paraview.stages import PROXIES

scenes, folder = (Path(argument) for argument in sys.argv[1:3])
DRAFT, SHEET = scenes / "32-shaft_twill.wif", scenes / "calculix" / "sheet.pvd"
TUBES, WEAVE = scenes / "objects" / "tubes.vtp", folder / "scene.toml"
text = (scenes / "plain_weave.toml").read_text().replace("1.3 kPa", "5 kPa")
text = text.replace("modes = 180", "modes = 60").replace("subdivisions = 6", "subdivisions = 2")
WEAVE.write_text(text.replace("[5, 5, 1]", "[3, 3, 1]\norder = 2"))
TIME = 0.013
#: Test values: for each parameter one of these is plausible and differs from the default. A third
#: has no short decimal form.
VALUES: tuple[Any, ...] = (
    *(False, True, 1 / 3, 1e-3 / 3, 1e3 / 3, 2, 5, 100),
    *((1 / 3, 0.1 + 0.2, 1e-7), (3, 4, 6), (2, 3), (0.5, 1 / 3), "#102030", "-x:yz"),
    *("twill 2/1", "20/2 cotton", "rib 1x1", "AB", ["1-0/1-2"], "1 in 1 out"),
    *("-x", "-x:(0, 1, 3) 0.3 N/m", "-x 0.3 g"),
    [["10 Hz", 0.02], ["80 Hz", 1 / 3]],
    [{"pressure": "2 Pa", "on": "-y", "time": "harmonic", "frequency": "3 Hz"}],
    [{"pressure": "2 Pa", "on": "-y"}],
    [{"shape": "sphere", "radius": "2 mm", "center": [0, 0, "-3 mm"], "friction": 1 / 3}],
    [{"place": "-y", "path": [[0, "1 mm", 0]]}],
)


def another(stage: str, parameter: Parameter) -> Any:
    """Return a value that is not the default."""
    files = {"MotionReader": SHEET, "SceneReader": WEAVE, "WIFReader": DRAFT, "ObjectSource": TUBES}
    values = [str(files.get(stage, DRAFT))] if parameter.kind == "file" else VALUES
    for value in (*getattr(parameter, "choices", ()), *values):
        try:
            parameter.require_plausible(value)
            if parameter.check(value) != parameter.default:
                return value
        except InputError:
            continue
    raise AssertionError(f"{stage}.{parameter.name} is always {parameter.default}")


def name_of(proxy: Any, parameter: Parameter) -> str:
    """Return a parameter's name in ParaView's Python, of a reader's file, too."""
    name = property_name(parameter)
    return name if name in proxy.ListProperties() else "FileName"


def settings(proxy: Any) -> dict[str, Any]:
    """Return the values that have reached the stage."""
    proxy.UpdateVTKObjects()
    return proxy.GetClientSideObject().settings


def data(proxy: Any) -> dict[str, np.ndarray]:
    """Return points and arrays of what a stage makes."""
    proxy.UpdatePipeline(TIME)
    output = proxy.GetClientSideObject().GetOutputDataObject(0)
    found = {"points": vtk_to_numpy(output.GetPoints().GetData())}
    for kind in ("Point", "Cell", "Field"):
        arrays = getattr(output, f"Get{kind}Data")()
        for index in range(arrays.GetNumberOfArrays()):
            array = arrays.GetArray(index)
            if array is not None:
                found[f"{kind} {array.GetName()}"] = vtk_to_numpy(array)
    return {name: values.copy() for name, values in found.items()}


# Each value of each proxy: together they make no sense, and nothing of it is run.
base = simple.WeaveSource(registrationName="base", Ends=2, Picks=2)
written = {}
for name, stage in PROXIES.items():
    inputs = dict.fromkeys(stage.input_names[: len(stage.inputs)], base)
    proxy = getattr(simple, name)(registrationName=f"all of {name}", **inputs)
    for parameter in stage.parameters.values():
        setattr(proxy, name_of(proxy, parameter), another(name, parameter))
    written[f"all of {name}"] = settings(proxy)
    for parameter in stage.parameters.values():
        assert settings(proxy)[parameter.name] != parameter.default, (name, parameter.name)
assert len(written) == len(PROXIES), list(written)

# What is read from files, and moved by it.
draft = simple.WIFReader(
    registrationName="draft",
    FileName=str(DRAFT),
    **{"Ends": 9, "Picks": 8, "WarpDiameter": "0.2 mm", "WeftDiameter": "0.2 mm"},
    **{"WarpSpacing": "0.5 mm", "WeftSpacing": "0.5 mm"},
)
scene = simple.SceneReader(registrationName="moving cage", FileName=str(WEAVE), Show="cage")
motion = simple.MotionReader(registrationName="motion", File=str(SHEET), Array="U", Scale=1.5)
tubes = simple.ObjectSource(
    registrationName="object", File=str(TUBES), Scale=0.001, Rotate=[0, 0, 30], Place=[1e-4, 0, 0]
)
simple.BarycentricWarp(registrationName="cloth on motion", Input=draft, Cage=motion, Smooth=1)
moved = simple.FindSource("cloth on motion")
surface = simple.PatchTessellator(registrationName="surface", Input=moved, Subdivisions=2)
simple.BarycentricWarp(registrationName="object on scene", Input=tubes, Cage=scene)
# And the main pipeline, shown at a time.
chain = connected(WarpDiameter="0.2 mm", WarpColor="#ff0000")
chain[4].Outside, chain[5].Subdivisions = "clamp", 3
chain[3].Gravity = [0.0, 0.0, -1.0]  # too weak to turn it so far that it warns
# By steps, and turned without being stretched: what moves in place of it, or after it.
stepped = simple.TransientResponse(
    registrationName="stepped", Input=chain[2], Gravity="0, 0, -1", Tolerance=1.0
)
turned = simple.RotationStrain(registrationName="turned", Input=chain[3])
simple.CrimpInterchange(registrationName="crimped", Input=chain[0], Cage=turned)
simple.BarycentricWarp(
    registrationName="interchanged", Input=simple.FindSource("crimped"), Cage=turned
)
CHAIN = ("WeaveSource1", "TetraCage1", "ModalSolver1", "ModalResponse1", "BarycentricWarp1")
CHAIN = (*CHAIN, "PatchTessellator1")
made = {}
for name in (
    *("draft", "moving cage", "motion", "object"),
    *("cloth on motion", "surface", "object on scene"),
    *("stepped", "turned", "crimped", "interchanged"),
    *CHAIN,
):
    proxy = simple.FindSource(name)
    written[name], made[name] = settings(proxy), data(proxy)
    assert len(made[name]["points"]) > 0, name
for name in (
    *("moving cage", "motion", "surface", "object on scene", CHAIN[-1]),
    *("stepped", "turned", "interchanged"),
):
    assert np.abs(made[name]["Point displacement"]).max() > 1e-5, name

view = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, view)
simple.Show(chain[-1], view)
animation = simple.GetAnimationScene()
animation.UpdateAnimationUsingDataTimeSteps()
animation.AnimationTime = TIME
simple.Render(view)
simple.SaveState(str(folder / "all.pvsm"))
(folder / "all.py").write_text(smstate.get_state())  # as the window's File > Save State does


def check() -> None:
    """Find every proxy again, with all values; what can run makes the same."""
    for name, old in written.items():
        new = settings(simple.FindSource(name))
        assert new == old, (
            name,
            {key: (old[key], new[key]) for key in old if new[key] != old[key]},
        )
    for name, old in made.items():
        new = data(simple.FindSource(name))
        assert list(new) == list(old), (name, list(old), list(new))
        for array, values in old.items():
            np.testing.assert_array_equal(new[array], values, err_msg=f"{name}: {array}")
    assert executions([simple.FindSource(name) for name in CHAIN])[:3] == [1, 1, 1]


simple.ResetSession()
simple.LoadState(str(folder / "all.pvsm"))
displays = [simple.GetDisplayProperties(simple.FindSource(name)) for name in ("surface", CHAIN[-1])]
assert [each.MapScalars for each in displays] == [0, 0]  # yarns keep their own colours
check()
simple.ResetSession()
exec((folder / "all.py").read_text(), {"__name__": "state"})
check()
print(f"{len(PROXIES)} proxies come back from both state files")
