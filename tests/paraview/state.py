"""A state file brings back the main pipeline: its values, and what they make.

Run with a folder to write to. `state_of_all.py` does so with every proxy, and with state in Python.
"""

import sys
from pathlib import Path

from paraview import simple
from pipeline import bounds, connected, executions

VALUES = {"WarpDiameter": "0.2 mm", "WarpColor": "#ff0000"}
TIME, FILE = 0.013, str(Path(sys.argv[1]) / "pipeline.pvsm")

chain = connected(**VALUES)
chain[4].Outside, chain[5].Subdivisions = "clamp", 3
chain[3].Gravity = [0.0, 0.0, -1.0]  # too weak to turn it so far that it warns
chain[5].UpdatePipeline(TIME)
moved = bounds(chain[5])
names = [
    next(key[0] for key, value in simple.GetSources().items() if value == each) for each in chain
]
settings = [each.GetClientSideObject().settings for each in chain]
simple.SaveState(FILE)

simple.ResetSession()
simple.LoadState(FILE)
chain = [simple.FindSource(name) for name in names]
chain[5].UpdatePipeline(TIME)
assert [each.GetClientSideObject().settings for each in chain] == settings
assert settings[0]["warp_diameter"] == 2e-4, settings[0]
assert bounds(chain[5]) == moved, (bounds(chain[5]), moved)
assert executions(chain) == [1] * 6
print("a state file brings back its pipeline")
