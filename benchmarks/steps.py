"""Time one step of a scene, stage by stage, and compare it with a copy of the bytes it writes.

    python benchmarks/steps.py                      # plain_weave, and the same of 100 x 100 yarns
    python benchmarks/steps.py tartan --set weave.ends=40
    python benchmarks/steps.py plain_weave --steps 20 --json

A step does little with each number of a large fabric, so memory limits it: no step can be faster
than a copy of the same bytes. Copy and step alternate in one run, because machines differ, and one
machine differs from minute to minute. A copy reads and writes each byte once, in one thread or in
as many as the stages use, whichever is faster. The other rows are the times of vtkProbeFilter for
the same points, of Blender's lattice modifier where its module bpy is installed, and of the solver
of crimp interchange for the crossings of a weave. Nothing is drawn.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataSet, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkProbeFilter

from spacemap_vtk.cli.options import number_table, open_scene, print_json, print_plain
from spacemap_vtk.datasets.arrays import points_of, to_points
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parallel import blocks, for_each, thread_count
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.patches.tessellation import Tessellation

#: Scene and changed values where no scene is named.
_DEFAULT = (("plain_weave", ()), ("plain_weave", ("weave.ends=100", "weave.picks=100")))
#: Between two times [s]: any will do, as no time step depends on the last.
_STEP = 1e-4
#: Times that are not counted: memory is taken, and loops are loaded or compiled. A small surface
#: earns them by its steps; at most so many for each that is counted.
_WARM, _EARNING = 3, 100
#: Points that VTK's probe is measured with, at most: it takes 40 us for each.
_PROBED = 50_000
#: What crossings are solved with: EA and k_D in N, B in N m2, of a cotton yarn.
_YARNS = {
    "keep their length": YarnMechanics(),
    "stretch": YarnMechanics((50.0, 50.0), 20.0),
    "stretch and bend": YarnMechanics((50.0, 50.0), 20.0, (2e-9, 2e-9)),
}
#: Points of Blender's lattice along x, y and z, as of a cage of 5 x 5 x 1 hexahedra.
_LATTICE = (6, 6, 2)


@dataclass(frozen=True)
class Timing:
    """What one stage takes."""

    name: str
    #: Bytes of the points that come out, and of their normals.
    bytes: int
    #: A copy of that, into memory that is in use, by the faster of one thread and all [ms].
    copy_ms: float
    #: [ms]
    ms: float

    @property
    def copies(self) -> float:
        """How many copies could be made meanwhile."""
        return self.ms / self.copy_ms if self.copy_ms else float("inf")


def step_timings(scene: Scene, steps: int = 9) -> dict[str, Any]:
    """Measure a new time of a scene: the stages that it runs, all in one update, and others."""
    last, time = scene.stages[-1], scene.view.time
    stages = [stage for stage in reversed(list(last.upstream())) if isinstance(stage, Stage)]
    before: list[int] = []
    for warm in range(_EARNING * steps):
        if warm >= _WARM and not ((made := _surface(last)) and made.can_compile):
            break
        before, time = [stage.executions for stage in stages], time + _STEP
        scene.update(time)
    stages = [s for s, runs in zip(stages, before, strict=True) if s.executions > runs]
    written = [_written(stage.output) for stage in stages]
    sources = [np.ones(size, np.uint8) for size in (*written, sum(written))]
    used = [source.copy() for source in sources]
    copies: list[list[float]] = [[] for _ in sources]
    takes: list[list[float]] = [[] for _ in sources]
    for _ in range(steps):
        time += _STEP
        for stage, taken in zip(stages, takes, strict=False):
            taken.append(_ms(partial(stage.update, time)))
        time += _STEP
        takes[-1].append(_ms(partial(last.update, time)))
        for target, source, taken in zip(used, sources, copies, strict=True):
            taken.append(min(_ms(partial(copy, target, source)) for copy in (np.copyto, _copy)))
    names = [*(type(stage).__name__ for stage in stages), "all in one update"]
    rows = [
        Timing(name, source.nbytes, median(copy), median(take))
        for name, source, copy, take in zip(names, sources, copies, takes, strict=True)
    ]
    if scene.moves:
        warp = rows[names.index(type(scene.warp).__name__)]
        rows += [Timing(name, warp.bytes, warp.copy_ms, ms) for name, ms in _others(scene, steps)]
    count = last.output.GetNumberOfPoints()
    made = _surface(last)
    return {
        "title": "{} x {} yarns".format(*scene.woven.cloth.size) if scene.woven else scene.title,
        "points": scene.stages[0].output.GetNumberOfPoints(),
        "surface_points": count,
        "threads": thread_count(),
        "compiled": made is not None and made.bicubic is not None,
        "stages": [asdict(row) | {"copies": row.copies} for row in rows],
    }


def _surface(stage: Stage) -> Tessellation | None:
    return stage.tessellation if isinstance(stage, PatchTessellator) else None


def _ms(run: Callable[[], object]) -> float:
    start = perf_counter()
    run()
    return (perf_counter() - start) * 1e3


def _copy(target: NDArray[np.uint8], source: NDArray[np.uint8]) -> None:
    """Copy in as many threads as the stages work in: one may not use all that memory gives."""
    parts = blocks(len(source), -(-len(source) // thread_count()))
    for_each(parts, lambda: lambda part: np.copyto(target[part], source[part]))


def _written(data: vtkDataSet) -> int:
    normals = data.GetPointData().GetNormals()
    return points_of(data).nbytes + (vtk_to_numpy(normals).nbytes if normals is not None else 0)


def _others(scene: Scene, steps: int) -> list[tuple[str, float]]:
    """Return what others take to move a scene's points, and crossings to be solved."""
    rest = points_of(scene.warp.GetInputDataObject(0, 0))
    cage = scene.warp.GetInputDataObject(1, 0)
    found = [("vtkProbeFilter", _probe_ms(rest, cage))]
    if find_spec("bpy") is not None:
        found.append(("Blender's lattice", _lattice_ms(rest)))
    with suppress(InputError):  # what is not woven, or in two layers, has no such crossings
        for name, yarns in _YARNS.items() if scene.woven else ():
            solve = partial(Interchange(scene.woven.cloth, yarns).solve, _waves(scene))
            found.append((f"crossings, {name}", median(_ms(solve) for _ in range(_WARM + steps))))
    return found


def _waves(scene: Scene) -> Floats:
    """Return stretches of up to 5 % along warp and weft, (2, picks, ends)."""
    pick, end = (np.linspace(0.0, 6.0, size) for size in scene.woven.cloth.drawdown.shape)
    phases = np.add.outer(pick, 0.7 * end), np.subtract.outer(0.8 * pick, end)
    return 1.0 + 0.05 * np.stack([np.sin(phases[0]), np.cos(phases[1])])


def _probe_ms(rest: NDArray[Any], cage: vtkUnstructuredGrid) -> float:
    """Return what VTK takes to sample the cage's displacement; it looks for each point anew."""
    points, probe = vtkPolyData(), vtkProbeFilter()
    some = rest[:: -(-len(rest) // _PROBED)]
    points.SetPoints(to_points(some))
    probe.SetInputData(points)
    probe.SetSourceData(cage)

    def run() -> None:
        probe.Update()
        some + vtk_to_numpy(probe.GetOutput().GetPointData().GetArray("displacement"))

    return _ms(run) * len(rest) / len(some)


def _lattice_ms(rest: NDArray[Any]) -> float:
    """Return what Blender takes to move points by a lattice whose points have moved."""
    import bpy

    low, high = rest.min(axis=0), rest.max(axis=0)
    mesh = bpy.data.meshes.new("points")
    mesh.vertices.add(len(rest))
    mesh.vertices.foreach_set("co", rest.astype(np.float32).ravel())
    moved = bpy.data.objects.new("points", mesh)
    lattice = bpy.data.lattices.new("cage")
    lattice.points_u, lattice.points_v, lattice.points_w = _LATTICE
    cage = bpy.data.objects.new("cage", lattice)
    cage.location, cage.scale = (low + high) / 2, high - low
    for item in (moved, cage):
        bpy.context.collection.objects.link(item)
    moved.modifiers.new("ride", "LATTICE").object = cage
    takes = []
    for step in range(1, _WARM + 3):
        for point in lattice.points:
            point.co_deform[2] = point.co[2] + 1e-3 * step * point.co[0]
        lattice.update_tag()
        takes.append(_ms(lambda: bpy.context.evaluated_depsgraph_get().update()))
    for item, data, kind in ((moved, mesh, "meshes"), (cage, lattice, "lattices")):
        bpy.data.objects.remove(item)
        getattr(bpy.data, kind).remove(data)
    return median(takes[_WARM:])


def table(figures: dict[str, Any]) -> Any:
    """Return the timings of one scene as a table to print."""
    how = "loops compiled by Numba" if figures["compiled"] else "NumPy"
    rows = number_table(
        ("stage", "MB", "copy [ms]", "step [ms]", "copies"),
        words=1,
        title=f"{figures['title']}\n{figures['points']:,} points, "
        f"{figures['surface_points']:,} on the surface\n{how}, {figures['threads']} threads",
        caption="copies: how often its points and normals could be copied in that time",
        min_width=72,  # of the caption
    )
    for row in figures["stages"]:
        rows.add_row(
            row["name"],
            f"{row['bytes'] / 1e6:.3g}",
            f"{row['copy_ms']:.3g}",
            f"{row['ms']:.3g}",
            f"{row['copies']:.3g}",
        )
    return rows


def main(arguments: list[str] | None = None) -> None:
    """Measure the scenes named on the command line and print a table, or JSON, of each."""
    words = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    words.add_argument("scene", nargs="?", help="scene file, or name of a scene")
    words.add_argument("--set", action="append", default=[], help="change a value: section.key=2")
    words.add_argument("--steps", type=int, default=9, help="number of steps for the medians")
    words.add_argument("--json", action="store_true", help="print JSON, for programs")
    asked = words.parse_args(arguments)
    scenes = _DEFAULT if asked.scene is None else ((asked.scene, ()),)
    found = [
        step_timings(open_scene(name, (*values, *asked.set)), max(asked.steps, 1))
        for name, values in scenes
    ]
    if asked.json:
        print_json({"scenes": found})
        return
    for figures in found:
        print_plain(table(figures))


if __name__ == "__main__":
    main()
