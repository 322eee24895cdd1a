"""Seconds of textiles whose yarns come to rest, and their largest overlaps.

    OPENBLAS_NUM_THREADS=1 python benchmarks/rods.py

Seconds are the processor's, beside those that are asked for. Nothing is loaded from the cache; the
first picture is drawn by a new process with an empty one.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from spacemap_vtk.filters.textiles.braid import Braid
from spacemap_vtk.filters.textiles.woven import Layers, Leno, Mesh
from spacemap_vtk.textile.rods.guess import relax_guess
from spacemap_vtk.textile.rods.knit import relax_knit, repeat_knit
from spacemap_vtk.textile.rods.relax import Relaxed
from spacemap_vtk.textile.rods.stitches import plan_passes
from spacemap_vtk.textile.rods.tubes import sweep_yarns

#: Diameters of yarn in a stitch.
STITCH = 16.0
#: Each textile, and the seconds that are asked for; 0 where none are.
TEXTILES: dict[str, tuple[Callable[[], Relaxed], float]] = {
    "a stitch of stockinette": (lambda: relax_knit(["k"], STITCH), 0.5),
    "2 x 4 stitches": (lambda: relax_knit(["kk"] * 4, STITCH), 5.0),
    "2 x 4 stitches, moss": (lambda: relax_knit(["kp", "kp", "pk", "pk"], STITCH), 5.0),
    "rib 1 x 1": (lambda: relax_knit(["kp"], STITCH), 0.0),
    "a plain cell": (lambda: relax_guess(Mesh().guess()), 0.5),
    "a twill cell": (lambda: relax_guess(Mesh(weave="twill").guess()), 0.0),
    "leno": (lambda: relax_guess(Leno().guess()), 0.0),
    "three-strand plait": (lambda: relax_guess(Braid(form="flat", carriers=3).guess()), 0.0),
    "tubular braid": (lambda: relax_guess(Braid().guess()), 0.0),
    **{
        structure: (lambda name=structure: relax_guess(Layers(structure=name).guess()), 10.0)
        for structure in ("orthogonal", "layer to layer", "through thickness", "double")
    },
}


def main() -> None:
    print(f"{'textile':28s} seconds   asked   steps  points  largest overlap over the diameter")
    for name, (relax, asked) in TEXTILES.items():
        start = time.process_time()
        found = relax()
        seconds = time.process_time() - start
        points = sum(len(yarn.points) for yarn in found.yarns)
        limit = f"{asked:7.1f}" if asked else " " * 7
        row = f"{seconds:7.2f} {limit} {found.steps:7d} {points:7d}  {found.overlap:.4f}"
        print(f"{name:28s} {row}", flush=True)

    knit, count = relax_knit(["k"], STITCH), 20
    start = time.process_time()
    lines = repeat_knit(knit.yarns, knit.cell, plan_passes(["k"]), count, count)
    sweep_yarns(lines, np.ones(len(lines)))
    seconds = time.process_time() - start
    print(f"{'20 x 20 stitches swept':28s} {seconds:7.2f} {0.2:7.1f}")

    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "spacemap_vtk", "render", "stockinette"]
        command += ["-o", str(Path(folder) / "stockinette.png")]
        start = os.times()
        subprocess.run(
            command,
            check=True,
            env=os.environ | {"SPACEMAP_CACHE": folder},
            stdout=subprocess.DEVNULL,
        )
        end = os.times()
        seconds = end.children_user + end.children_system
        seconds -= start.children_user + start.children_system
    print(f"{'first picture of stockinette':28s} {seconds:7.2f} {3.0:7.1f}")


if __name__ == "__main__":
    main()
