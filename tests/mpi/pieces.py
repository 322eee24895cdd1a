"""For `pvbatch --symmetric`: each process runs every case for its own piece, and keeps it.

    mpirun -np 3 pvbatch --symmetric tests/mpi/pieces.py OUT CASES

OUT gets ``NAME_RANK.npz`` for each case, CASES is JSON: by name, what `connected` takes.
"""

import json
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from paraview import simple  # noqa: F401  loads the plugin
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkParallelCore import vtkMultiProcessController

sys.path.insert(0, str(Path(__file__).parent))
from cases import connected, surface

from spacemap_vtk import ModalSolver, SpacemapWarning
from spacemap_vtk.datasets.processes import Piece

warnings.simplefilter("ignore", SpacemapWarning)


def solves(stages: list[Any]) -> bool:
    """Return whether this process has factorised the cage's matrices."""
    return any(
        "stiffness" in vars(stage._model.pencil)
        for stage in stages
        if isinstance(stage, ModalSolver)
    )


controller = vtkMultiProcessController.GetGlobalController()
piece = Piece(controller.GetLocalProcessId(), controller.GetNumberOfProcesses())
for name, case in json.loads(Path(sys.argv[2]).read_text()).items():
    stages = connected(**case)
    for time in (0.0, 0.05):
        stages[-1].update(time, piece)
    cage = stages[-3].GetOutputDataObject(0)
    ghosts = vtk_to_numpy(cage.GetCellData().GetArray("vtkGhostType"))
    np.savez(
        Path(sys.argv[1]) / f"{name}_{piece.number}.npz",
        executions=[stage.executions for stage in stages],
        cage=vtk_to_numpy(cage.GetPoints().GetData()),
        displacement=vtk_to_numpy(cage.GetPointData().GetArray("displacement")),
        solved=solves(stages),
        owned=np.count_nonzero(ghosts == 0),
        **surface(stages[-1].GetOutputDataObject(0)),
    )
