"""How the cost of building a weave grows, from a hundred crossings to a million.

Each size runs in a process of its own, so that its peak memory is its own, and builds once: the
time includes the system's for handing out fresh memory, which is most of it where a virtual machine
has to get that from its host. So the program's own share is shown beside it, and the growth is that
of this share. The best of a few processes counts::

    python benchmarks/weave_scale.py                 # up to 1000 x 1000: about 11 GB, half a minute
    python benchmarks/weave_scale.py --sizes 10 100  # ends = picks
    python benchmarks/weave_scale.py --weave twill --exact --json
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
from dataclasses import replace
from time import perf_counter
from typing import Any

SIZES = (10, 32, 100, 316, 1000)
COLUMNS = (
    ("crossings", "crossings", ",d"),
    ("patches", "patches", ",d"),
    ("points", "points", ",d"),
    ("seconds", "time [s]", ".3f"),
    ("user_seconds", "user time [s]", ".3f"),
    ("points_per_second", "points/s", ".3g"),
    ("bytes_per_crossing", "bytes/crossing", ",.0f"),
    ("peak_bytes", "peak bytes", ",d"),
    ("peak_per_crossing", "peak/crossing", ",.0f"),
    ("estimate", "estimate", ",d"),
)


def measure(size: int, weave_name: str, exact: bool) -> dict[str, Any]:
    """Build one weave in this process and return what it took."""
    import numpy as np

    from spacemap_vtk.textile.drafts import patterns
    from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
    from spacemap_vtk.textile.geometry.weave import build_weave, estimate_bytes
    from spacemap_vtk.textile.weave.cloth import Cloth
    from spacemap_vtk.textile.weave.threads import Threads

    unit = patterns.plain() if weave_name == "plain" else patterns.twill(2, 2)
    over = tile_drawdown(unit, size, size)
    threads = Threads(diameter=0.25e-3, spacing=0.5e-3)
    cloth = Cloth(drawdown=over, warp=threads, weft=threads, exact=exact)
    build_weave(
        replace(cloth, drawdown=over[:4, :4])
    )  # what is loaded and compiled at first use is not the weave's
    before = resource.getrusage(resource.RUSAGE_SELF)
    start = perf_counter()
    made = build_weave(cloth)
    seconds = perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_SELF)
    peak = 1024 * (after.ru_maxrss - before.ru_maxrss)
    arrays = [made.points, made.patches, made.yarn, made.family]
    arrays += [made.weights] if made.weights is not None else []
    assert np.isfinite(made.points[-1]).all()
    size_in_bytes = sum(array.nbytes for array in arrays)
    return {
        "crossings": over.size,
        "patches": len(made.patches),
        "points": len(made.points),
        "seconds": seconds,
        "user_seconds": after.ru_utime - before.ru_utime,
        "points_per_second": len(made.points) / seconds,
        "bytes_per_crossing": size_in_bytes / over.size,
        "peak_bytes": peak,
        "peak_per_crossing": peak / over.size,
        "estimate": estimate_bytes(cloth),
    }


def growth(rows: list[dict[str, Any]], key: str) -> float:
    """Return the exponent of the crossings with which a cost grows, over the last decades."""
    first, last = rows[max(0, len(rows) - 3)], rows[-1]
    return math.log(last[key] / first[key]) / math.log(last["crossings"] / first["crossings"])


def main() -> None:
    """Measure every size and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="ends = picks")
    parser.add_argument("--weave", choices=("plain", "twill"), default="plain")
    parser.add_argument("--exact", action="store_true", help="rational patches")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--repeats", type=int, default=3, help="processes for each size below 500")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one is not None:
        print(json.dumps(measure(args.one, args.weave, args.exact)))
        return
    rows = []
    for size in args.sizes:
        command = [sys.executable, __file__, "--one", str(size), "--weave", args.weave]
        command += ["--exact"] if args.exact else []
        answers = [
            json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            for _ in range(args.repeats if size < 500 else 1)
        ]
        rows.append(min(answers, key=lambda answer: answer["seconds"]))
    result: dict[str, Any] = {"weave": args.weave, "exact": args.exact, "sizes": rows}
    if len(rows) > 1:
        result["growth_of_seconds"] = growth(rows, "user_seconds")
        result["growth_of_bytes"] = growth(rows, "peak_bytes")
    if args.json:
        print(json.dumps(result, indent=1))
        return
    print("  ".join(f"{title:>14}" for _, title, _ in COLUMNS))
    for row in rows:
        print("  ".join(f"{row[key]:>14{form}}" for key, _, form in COLUMNS))
    if len(rows) > 1:
        print(
            f"growth with crossings: power {result['growth_of_seconds']:.2f} (user time)"
            f" and {result['growth_of_bytes']:.2f} (peak memory)"
        )


if __name__ == "__main__":
    main()
