"""A bad value is printed in the output window, and the last good state stays."""

import sys

from paraview import simple
from pipeline import bounds, connected
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

# pvpython's own go through the window that is replaced here: a failed assertion would be silent.
sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
vtkOutputWindow.SetInstance(window)


def printed() -> str:
    """Return what was printed since the last call."""
    global window
    text = window.GetOutput()
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    return text


proxies = connected()
weave, cage, modal, response, warp, surface = proxies
surface.UpdatePipeline(0.02)
good = bounds(surface)
assert printed() == ""

for proxy, name, bad, fine, words in (
    # refused by its own check: the stage keeps the old value
    (weave, "Pattern", "nonsense", "plain", "nonsense"),
    (modal, "PoissonsRatio", 0.7, 0.3, "less than 0.5"),
    (modal, "Fixed", "+q", "+y", "+q"),
    (response, "Initial", "asleep", "rest", '"equilibrium"'),
    (response, "Duration", -1.0, 1.0, "greater than 0 s"),
    # refused when it runs: a cloth that cannot be, a file that is not there
    (weave, "WarpDiameter", "0.7 mm", "", "Make warp_diameter smaller"),
    (weave, "Draft", "/no/such/file.wif", "", "/no/such/file.wif"),
):
    setattr(proxy, name, bad)
    surface.UpdatePipeline(0.02)
    text = printed()
    assert words in text, (name, text)
    assert "\n" not in text.strip(), text
    assert "Traceback" not in text, text
    assert bounds(surface) == good, name
    setattr(proxy, name, fine)
    surface.UpdatePipeline(0.02)
    assert printed() == "", name
    assert bounds(surface) == good, name

# Values that a property cannot store raise an error at once, and nothing changes.
for proxy, name, bad, words in (
    (
        weave,
        "Ends",
        "many",
        'WeaveSource: ends = "many": must be a number; allowed: a whole number',
    ),
    (weave, "Ends", 3.7, "must be a whole number"),
    (weave, "WarpDiameter", -1e-3, "warp_diameter = -0.001: out of range"),
    (weave, "WarpDiameter", ["0.2 mm", "0.3 kg"], "value 2"),
    (weave, "WarpSett", "dense", "must be a number; allowed: a number greater than 0 1/m"),
    (response, "Beta", None, "ModalResponse: beta"),
    (response, "Gravity", [0, -1], "must have 3 components, not 2"),
    (surface, "Subdivisions", "fine", "must be a number"),
    (surface, "Subdivisions", 1000, "subdivisions = 1000: out of range"),
    (response, "Gravity", "0, -1", "must have 3 components, not 2"),
):
    refusal = ""
    try:
        setattr(proxy, name, bad)
    except TypeError as error:
        refusal = str(error)
    assert words in refusal, (name, bad, refusal)
    surface.UpdatePipeline(0.02)
    assert printed() == "", name
    assert bounds(surface) == good, name

# What the filters take in Python is taken here: numbers and lists for texts, units for numbers.
for name, value, held in (
    ("WarpDiameter", 0.2e-3, 0.2e-3),
    ("WarpDiameter", [0.2e-3, "0.25 mm"], (0.2e-3, 0.25e-3)),
    ("WarpDiameter", None, None),
    ("WarpSett", "20 /cm", 2000.0),
    ("WarpSett", None, None),
    ("WarpColor", (255, 0, 0), (255, 0, 0)),
    ("WarpColor", "", None),
    ("Pattern", ["10", "01"], ("10", "01")),
    ("Pattern", "plain", "plain"),
):
    setattr(weave, name, value)
    weave.UpdatePipeline()
    settings = weave.GetClientSideObject().settings
    key = name.lower() if name == "Pattern" else f"warp_{name[4:].lower()}"
    assert settings[key] == held, (name, settings[key])
surface.UpdatePipeline(0.02)
assert printed() == ""
assert bounds(surface) == good

# Nothing good yet: empty, and printed once for each time it is asked for, with no error of VTK's.
empty = simple.SceneReader(FileName="/no/such/scene.toml")
empty.UpdatePipeline()
text = printed()
assert "/no/such/scene.toml" in text, text
assert "Traceback" not in text, text
assert "ERROR" not in text, text
assert "(0x" not in text, text
assert empty.GetDataInformation().GetNumberOfCells() == 0

# What a stage doubts is a warning, once however many frames there are.
cage.Order = 1
for time in (0.01, 0.02, 0.03):
    surface.UpdatePipeline(time)
assert printed().count("too stiffly") == 1, printed()
# What a stage says of a wrong input: the cage's motion is missing.
still = simple.BarycentricWarp(Input=weave, Cage=cage)
still.UpdatePipeline()
assert "displacement" in printed()
vtkOutputWindow.SetInstance(usual)
print("mistakes are reported and do no harm")
