"""For `pvbatch` under MPI: scripts one after another, as processes take longer to start than these.

mpirun -np 3 pvbatch tests/mpi/session.py SCRIPT,ARGUMENT,… …

Before each its name goes to the standard error.
"""

import os
import runpy
import sys
from typing import Any

from paraview import simple

draw_large = simple.SaveScreenshot


def draw_small(*arguments: Any, ImageResolution: list[int], **options: Any) -> None:
    """Save a picture a quarter as wide as asked for: most of a script's time would be drawing."""
    draw_large(*arguments, ImageResolution=[side // 4 for side in ImageResolution], **options)


simple.SaveScreenshot = draw_small

for words in sys.argv[1:]:
    script, *arguments = words.split(",")
    os.write(2, f"{os.path.basename(script)}\n".encode())
    sys.argv = [script, *arguments]
    runpy.run_path(script)
