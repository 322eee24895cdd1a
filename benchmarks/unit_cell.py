"""Processor time and memory of the constants of a composite.

    python benchmarks/unit_cell.py

A plain weave of E-glass in epoxy, six loads, without the second solution on larger voxels.
"""

from __future__ import annotations

import resource
import time

import numpy as np

from spacemap_vtk import UnitCell, WeaveSource
from spacemap_vtk.filters.unit_cell import make_unit_cell
from spacemap_vtk.unit_cell.homogenise import homogenise


def main() -> None:
    """Print a line for each number of voxels."""
    patches = WeaveSource().around_repeat().update().output
    # The first solution loads or compiles the loops.
    for count in (32, 64, 128):
        stage = UnitCell(voxels=count)
        times = [time.process_time()]
        voxels, spacing = make_unit_cell(stage, patches, count)
        times.append(time.process_time())
        phases = stage.assign(voxels, spacing)
        times.append(time.process_time())
        constants, response = homogenise(phases, spacing)
        times.append(time.process_time())
        parts = ", ".join(f"{part:.2f}" for part in np.diff(times))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{' x '.join(map(str, voxels.fraction.shape[::-1]))}: {times[-1] - times[0]:.2f} s "
            f"(voxels, materials, six loads: {parts}), steps {response.steps}, {memory:.0f} MiB, "
            f"Ex {constants.engineering['Ex'] / 1e9:.4f} GPa"
        )


if __name__ == "__main__":
    main()
