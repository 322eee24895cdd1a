"""What the README's picture of ParaView's window shows; run by photograph.py."""

import os
from pathlib import Path

from paraview import simple

script = Path(os.environ["SPACEMAP_ROOT"]) / "pipelines" / "paraview" / "plain_weave.py"
names = {"__name__": "__main__"}
exec(compile(script.read_text(), str(script), "exec"), names)
# The panel shows the properties of the active source.
simple.SetActiveSource(names["weave"])
simple.Render(names["view"])
Path(os.environ["SPACEMAP_READY"]).touch()
