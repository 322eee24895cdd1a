"""Frames a second of a film, and the processor time that each takes, by one process and by two.

Run: python benchmarks/films.py [CHECKOUT]
The film is plain_weave, cage and cloth side by side at 1600 x 800, as .mp4: the whole command, its
start among it. The second column is what frames cost beyond the start: a film of four times as
many, less the first. On a busy machine the processor time says more than the seconds.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from commands import one

#: Of `scenes/plain_weave.toml`, and how much longer the other film is.
FRAMES, LONGER = 50, 4


def main() -> None:
    """Print a line for each number of processes."""
    checkout = str(Path(sys.argv[1] if sys.argv[1:] else Path(__file__).parents[1]).resolve())
    with tempfile.TemporaryDirectory() as folder:
        # What every later one finds: modules compiled, modes solved.
        one("animate plain_weave -q -o a.gif --size 64x48", checkout, folder)
        print("processes   frames a second: whole, then on   processor ms a frame: whole, then on")
        for workers in (1, 2):
            command = f"animate plain_weave -q -o a.mp4 --workers {workers}"
            short = one(command, checkout, folder)
            long = one(f"{command} --set animation.stop={0.2 * LONGER}", checkout, folder)
            more = (LONGER - 1) * FRAMES
            seconds, processor = (late - early for early, late in zip(short, long, strict=True))
            print(
                f"{workers:9}{FRAMES / short[0]:26.1f}{more / seconds:9.1f}"
                f"{1e3 * short[1] / FRAMES:29.0f}{1e3 * processor / more:9.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
