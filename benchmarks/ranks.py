"""What a cloth costs on several processes, and what a metre of it would.

Runs the whole pipeline under MPI in ParaView's pvbatch, fits bytes and seconds per crossing to the
small runs, checks the fit against the largest, and says what larger cloths need. Where mpirun,
pvbatch and xvfb-run are installed::

    python benchmarks/ranks.py                     # up to 400 x 400 on 1 and 2 processes: 8 GB
    python benchmarks/ranks.py --sizes 60 120 240  # ends = picks; the last one is the check
    python benchmarks/ranks.py --ranks 1 4 16 --markdown
    python benchmarks/ranks.py --precision single  # of the control points
    python benchmarks/ranks.py --scaling           # of 400 and 800 yarns: 12 GB, single precision

Each process counts for itself: seconds of its own processor time, its own peak of resident memory;
what it waits for others, MPI spends as processor time as well, so that the process that waits least
says what the work is. Started by pvbatch as
``pvbatch --symmetric ranks.py worker SIZE PRECISION FOLDER`` the same file is what they run.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

SIZES = (60, 120, 240, 400)
#: Ends = picks and processes: the same cloth on more of them; and as many crossings for each.
STRONG = ((400, 1), (400, 2), (400, 4), (800, 1), (800, 2), (800, 4))
WEAK = ((400, 1), (566, 2), (800, 4))
#: Ends and picks: cloth of 0.5 mm spacing, which is 2000 yarns to a metre.
CLOTHS = (("1 m x 1 m", 2000, 2000), ("a shirt, 1.5 m x 1.4 m", 2800, 3000))
CAGE = (30, 30, 2)
MODES = 60
PICTURE = (1920, 1080)
GIB = 2**30


def resident(name: str) -> int:
    """Return VmHWM or VmRSS of this process, in bytes."""
    found = re.search(rf"{name}:\s+(\d+) kB", Path("/proc/self/status").read_text())
    assert found is not None
    return int(found[1]) * 1024


@contextmanager
def timed(
    into: dict[str, float], name: str, clock: Callable[[], float] = perf_counter
) -> Iterator[None]:
    """Write down the seconds that pass meanwhile."""
    start = clock()
    yield
    into[name] = clock() - start


def work(size: int, precision: str, folder: Path) -> None:
    """Run the pipeline as one process of several and write what it took."""
    from paraview import simple
    from vtkmodules.vtkParallelCore import vtkMultiProcessController

    from spacemap_vtk import (
        BarycentricWarp,
        ModalResponse,
        ModalSolver,
        PatchTessellator,
        SpacemapWarning,
        TetraCage,
        WeaveSource,
        connect,
    )
    from spacemap_vtk.datasets.processes import Piece, Processes

    warnings.simplefilter("ignore", SpacemapWarning)  # the cage is doubtful, its cost is not

    started, begun = process_time(), perf_counter()
    controller = vtkMultiProcessController.GetGlobalController()
    piece = Piece(controller.GetLocalProcessId(), controller.GetNumberOfProcesses())
    seconds: dict[str, float] = {}
    weave = WeaveSource(ends=size, picks=size, precision=precision)
    cage, modal = TetraCage(divisions=CAGE), ModalSolver(modes=MODES, youngs_modulus=1e4)
    response, warp, surface = ModalResponse(), BarycentricWarp(), PatchTessellator(subdivisions=1)
    connect((weave, connect(weave, cage, modal, response)), warp, surface)
    base = resident("VmRSS")
    for name, stage in (
        ("weave", weave),
        ("cage", cage),
        ("solve", modal),
        ("response", response),
        ("locate", warp),
        ("surface", surface),
    ):
        with timed(seconds, name, process_time):
            stage.update(0.0, piece)
    peak = resident("VmHWM")
    frames: list[float] = []
    for step in range(1, 6):
        start = process_time()
        surface.update(0.01 * step, piece)
        frames.append(process_time() - start)
    seconds["frame"] = min(frames)
    seconds["start"], seconds["wall"] = started, perf_counter() - begun
    processes = Processes.for_piece(piece)
    if processes is not None:
        shapes = 3 * modal.GetOutputDataObject(0).GetNumberOfPoints() * MODES
        import numpy as np

        with timed(seconds, "share modes"):
            processes.make_in_first(lambda: [np.zeros(shapes)])
        with timed(seconds, "agree"):
            for _ in range(100):
                processes.check_peers()
        seconds["agree"] /= 100
    # Next to nothing is drawn: what is timed is how pictures become one.
    view = simple.CreateView("RenderView")
    view.ViewSize = list(PICTURE)
    simple.Show(simple.Sphere(), view)
    simple.Render(view)
    view.RemoteRenderThreshold = 0.0
    simple.Render(view)
    with timed(seconds, "picture"):
        for _ in range(5):
            simple.Render(view)
    seconds["picture"] /= 5
    result = {"seconds": seconds, "base": base, "peak": peak}
    (folder / f"{piece.number}.json").write_text(json.dumps(result))


def run(size: int, ranks: int, precision: str) -> dict[str, Any]:
    """Return the seconds of the process that waits least, and the largest peak of one run."""
    from spacemap_vtk.paraview import environment

    with tempfile.TemporaryDirectory() as name:
        command = ["xvfb-run", "-a", "-s", "-screen 0 2000x1200x24 -noreset", "mpirun"]
        command += ["--allow-run-as-root", "--oversubscribe", "-np", str(ranks)]
        command += ["pvbatch", "--symmetric", __file__, "worker", str(size), precision, name]
        variables = {"SPACEMAP_CACHE": "off", "LIBGL_ALWAYS_SOFTWARE": "1"}
        variables["OMPI_MCA_plm"] = "isolated"  # one machine: no ssh is looked for
        variables["OMPI_MCA_mpi_yield_when_idle"] = "1"  # who waits lets others have the core
        subprocess.run(
            command, env={**os.environ, **environment.variables(), **variables}, check=True
        )
        found = [json.loads(file.read_text()) for file in sorted(Path(name).glob("*.json"))]
    assert len(found) == ranks
    stages = {key: min(f["seconds"][key] for f in found) for key in found[0]["seconds"]}
    stages["solve"] = found[0]["seconds"]["solve"]  # which the others wait for
    return {
        **stages,
        "size": size,
        "ranks": ranks,
        "crossings": size * size / ranks,
        "base": max(f["base"] for f in found),
        "peak": max(f["peak"] for f in found),
        # what falls with the number of processes, without the cage's own work
        "set up": sum(stages[key] for key in ("weave", "locate", "surface")),
    }


def line(runs: list[dict[str, Any]], key: str) -> tuple[float, float]:
    """Fit ``key = a + b crossings`` to runs, with b from sizes that count."""
    import numpy as np

    x, y = (np.array([r[name] for r in runs], dtype=float) for name in ("crossings", key))
    slope, constant = np.polyfit(x, y, 1, w=1.0 / np.sqrt(x))
    return float(constant), float(slope)


def table(head: list[str], rows: list[list[str]], markdown: bool) -> None:
    """Print rows under a head."""
    if markdown:
        rows = [["---"] + ["---:"] * (len(head) - 1), *rows]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    edge = "| " if markdown else ""
    for row in [head, *rows]:
        cells = [
            row[i].ljust(widths[i]) if i == 0 else row[i].rjust(widths[i]) for i in range(len(head))
        ]
        print(edge + (" | " if markdown else "  ").join(cells) + (" |" if markdown else ""))
    print()


def scaling(precision: str, repeats: int, markdown: bool) -> None:
    """Measure the same cloth on more processes, and as much cloth on each of more."""
    found: dict[tuple[int, int], dict[str, Any]] = {}
    keys = ("start", "weave", "solve", "locate", "surface", "set up", "frame", "wall")
    for size, ranks in repeats * list(dict.fromkeys(STRONG + WEAK)):
        new = run(size, ranks, precision)
        old = found.get((size, ranks), new)
        found[size, ranks] = {**new, **{key: min(new[key], old[key]) for key in keys}}
    for kind, chosen in (("strong", STRONG), ("weak", WEAK)):
        head = [f"{kind} scaling", "processes", "peak each, MB", "start, s", "cage, s"]
        head += ["set up, s", "x", "frame, s", "x", "all by the clock, s"]
        rows = []
        for size, ranks in chosen:
            r = found[size, ranks]
            alone = found[size if kind == "strong" else chosen[0][0], 1]
            rows.append(
                [f"{size} x {size}", str(ranks), f"{r['peak'] / 1e6:,.0f}", f"{r['start']:.2f}"]
                + [f"{r['solve']:.2f}"]
                + [
                    text
                    for key in ("set up", "frame")
                    for text in (f"{r[key]:.2f}", f"{alone[key] / r[key]:.2f}")
                ]
                + [f"{r['wall']:.1f}"]
            )
        table(head, rows, markdown)


def main() -> None:
    """Measure, fit, check, predict."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="ends = picks")
    parser.add_argument("--ranks", type=int, nargs="+", default=(1, 2), help="processes")
    parser.add_argument("--markdown", action="store_true", help="print tables as Markdown")
    parser.add_argument("--precision", choices=("double", "single"), default="double")
    parser.add_argument("--scaling", action="store_true", help="measure strong and weak scaling")
    parser.add_argument(
        "--repeats", type=int, default=1, help="number of repeats; the fastest counts"
    )
    options = parser.parse_args()
    if options.scaling:
        scaling("single", options.repeats, options.markdown)
        return
    *sizes, largest = options.sizes
    small = [run(size, ranks, options.precision) for size in sizes for ranks in options.ranks]
    check = [run(largest, ranks, options.precision) for ranks in options.ranks]

    head = ["yarns", "processes", "peak, MB", "weave, s", "solve, s", "locate, s", "frame, s"]
    keys = ("weave", "solve", "locate", "frame")
    rows = [
        [f"{r['size']} x {r['size']}", str(r["ranks"]), f"{r['peak'] / 1e6:,.0f}"]
        + [f"{r[key]:.2f}" for key in keys]
        for r in small + check
    ]
    table(head, rows, options.markdown)
    fits = {key: line(small, key) for key in ("peak", "set up", "frame")}
    print(
        f"each process: {fits['peak'][0] / 1e6:.0f} MB; each crossing: "
        f"{fits['peak'][1]:,.0f} bytes, {fits['set up'][1] * 1e6:.2f} us for the set-up and "
        f"{fits['frame'][1] * 1e6:.2f} us per frame; the cage: "
        f"{max(r['solve'] for r in check):.1f} s to solve once, "
        f"{max(r['response'] for r in check):.1f} s before the first frame"
    )
    shared = [r for r in check if "agree" in r]
    if shared:
        alone = min(r["picture"] for r in check if r["ranks"] == 1)
        r = shared[-1]
        print(
            f"between {r['ranks']} processes: {r['share modes']:.2f} s to share the modes, "
            f"{r['agree'] * 1e6:.0f} us to synchronise after a stage, "
            f"{r['picture'] - alone:.3f} s to join one {PICTURE[0]} x {PICTURE[1]} picture"
        )
    print()
    head = ["prediction against the largest", "processes", "predicted", "measured", "ratio"]
    rows = []
    for r in check:
        for key, unit, scale in (("peak", "MB", 1e6), ("set up", "s", 1.0), ("frame", "s", 1.0)):
            guess = fits[key][0] + fits[key][1] * r["crossings"]
            rows.append(
                [
                    f"{key}, {unit}",
                    str(r["ranks"]),
                    f"{guess / scale:.3g}",
                    f"{r[key] / scale:.3g}",
                    f"{guess / r[key]:.2f}",
                ]
            )
    table(head, rows, options.markdown)
    head = ["cloth", "yarns", "crossings", "processes", "GiB each", "GiB in all", "set up, s"]
    head.append("frame, s")
    rows = []
    for name, ends, picks in CLOTHS:
        for ranks in (1, 16, 64, 256):
            peak, setup, frame = (a + b * ends * picks / ranks for a, b in fits.values())
            rows.append(
                [
                    name,
                    f"{ends} x {picks}",
                    f"{ends * picks / 1000000.0:.1f} M",
                    str(ranks),
                    f"{peak / GIB:.2f}",
                    f"{ranks * peak / GIB:.0f}",
                    f"{setup:.1f}",
                    f"{frame:.2f}",
                ]
            )
    table(head, rows, options.markdown)


if __name__ == "__main__":
    if sys.argv[1:2] == ["worker"]:
        work(int(sys.argv[2]), sys.argv[3], Path(sys.argv[4]))
    else:
        main()
