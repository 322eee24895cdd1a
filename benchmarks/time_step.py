"""Set-up and time step of the main pipeline: 7 x 7 and 100 x 100 plain weave.

    python benchmarks/time_step.py
    NUMBA_DISABLE_JIT=1 python benchmarks/time_step.py    # as without Numba

Prints medians in ms, and what a copy of the same bytes takes, into fresh and into used memory.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    PatchTessellator,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.parallel import loops

STEPS = 15


def chain(yarns: int, subdivisions: int) -> list[Stage]:
    """Return the six stages, connected."""
    weave, cage = WeaveSource(ends=yarns, picks=yarns), TetraCage(divisions=(5, 5, 1))
    modal = ModalSolver(youngs_modulus="1.3 kPa", modes=180)
    response, warp = ModalResponse(alpha=10.0), BarycentricWarp()
    surface = PatchTessellator(subdivisions=subdivisions)
    connect((weave, connect(weave, cage, modal, response)), warp, surface)
    return [weave, cage, modal, response, warp, surface]


def milliseconds(run: Callable[..., object], *arguments: object) -> float:
    """Return how long a call takes."""
    start = time.perf_counter()
    run(*arguments)
    return (time.perf_counter() - start) * 1e3


def main() -> None:
    """Print the table."""
    compiled = loops("spacemap_vtk.fabric.patch_loops") is not None
    without = "NumPy alone, as there is no Numba"
    print("Large fabrics:", "loops compiled by Numba" if compiled else without)
    print(
        f"{'plain weave':<14}{'patches':>10}{'points':>12}{'set-up':>10}{'response':>10}"
        f"{'warp':>8}{'surface':>9}{'step':>8}{'copy':>8}{'again':>8}  [ms]"
    )
    for yarns, subdivisions in ((7, 4), (7, 6), (100, 3), (100, 4)):
        stages = chain(yarns, subdivisions)
        response, warp, surface = stages[3:]
        setup = milliseconds(surface.update, 0.0)
        rows, steps = [], []
        for k in range(1, STEPS + 1):
            at = 1e-3 * k
            rows.append([milliseconds(stage.update, at) for stage in (response, warp, surface)])
            steps.append(milliseconds(surface.update, at + 5e-4))
        a, b, c = (statistics.median(column) for column in zip(*rows[3:], strict=True))
        whole = statistics.median(steps[3:])
        points = surface.GetOutputDataObject(0).GetNumberOfPoints()
        moved = warp.GetOutputDataObject(0).GetNumberOfPoints()
        # What a step writes: displacement and position of the control points in float64,
        # position, normal and displacement of the surface in float32.
        written = np.ones(moved * 6 * 8 + points * 9 * 4, dtype=np.uint8)
        copy = statistics.median(milliseconds(written.copy) for _ in range(5))
        used = written.copy()
        again = statistics.median(milliseconds(np.copyto, used, written) for _ in range(5))
        patches = warp.GetOutputDataObject(0).GetNumberOfCells()
        print(
            f"{yarns:>3} x {yarns:<3} /{subdivisions:<4}{patches:>10}{points:>12}{setup:>10.0f}"
            f"{a:>10.2f}{b:>8.2f}{c:>9.2f}{whole:>8.2f}{copy:>8.2f}{again:>8.2f}"
        )


if __name__ == "__main__":
    main()
