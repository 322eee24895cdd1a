"""A cloth that does not fit into memory at once: made, moved and written piece by piece.

VTK's writer asks for one piece after the other. Each is a share of the yarns, which alone are in
memory; the cage is whole in every one. The files open as one in ParaView:

    python pipelines/in_pieces.py cloth.pvtp 8
"""

import sys
import tempfile
from pathlib import Path

from vtkmodules.vtkIOParallelXML import vtkXMLPPolyDataWriter
from vtkmodules.vtkIOXML import vtkXMLPPolyDataReader

from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.scenes.scene import Scene

modulus, density, gravity = 2e3, 300.0, 9.81  # Pa, kg/m3, m/s2
scene = Scene(
    {
        "weave": {"ends": 24, "picks": 24},
        "cage": {"divisions": [6, 6, 1], "order": 2},
        "modal": {
            "youngs_modulus": modulus,
            "poissons_ratio": 0.0,
            "density": density,
            "modes": 90,
        },
        "response": {"gravity": [0.0, -gravity, 0.0], "initial": "equilibrium"},
    }
)
pieces = int(sys.argv[2]) if len(sys.argv) > 2 else 4

with tempfile.TemporaryDirectory() as folder:
    file = sys.argv[1] if len(sys.argv) > 1 else str(Path(folder) / "cloth.pvtp")
    scene.update(0.0, Piece(0, pieces))  # raises what VTK's writer would print
    writer = vtkXMLPPolyDataWriter()
    writer.SetFileName(file)
    writer.SetInputConnection(scene.surface.GetOutputPort())
    writer.SetNumberOfPieces(pieces)
    writer.SetEndPiece(pieces - 1)
    writer.Write()
    reader = vtkXMLPPolyDataReader()
    reader.SetFileName(file)
    reader.Update()

# Hung by its upper edge, a sheet stretches under its own weight by rho g L^2 / (2 E).
written = reader.GetOutput()
stretch = -written.GetPointData().GetArray("displacement").GetRange(1)[0]
low, high = scene.deformed_cage.GetBounds()[2:4]
expected = density * gravity * (high - low) ** 2 / (2 * modulus)
shares = [stage.executions for stage in scene.stages]
print(f"{pieces} pieces, {written.GetNumberOfCells():,} polygons; stretch {stretch * 1e6:.3f} um")
assert abs(stretch / expected - 1.0) < 1e-5, stretch / expected
assert scene.polygons.GetNumberOfCells() < 1.1 * written.GetNumberOfCells() / pieces
assert shares == [pieces] * 6, shares  # one run of each stage for each piece
