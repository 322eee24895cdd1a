"""Frames per second of a film, and processor time per frame, with one process and with two.

Run: python benchmarks/films.py [CHECKOUT]
The film is plain_weave, cage and cloth side by side at 1600 x 800, as .mp4. The first number is
for the whole command with its start. The second is for further frames: the difference to a film
with four times as many frames. On a busy machine, compare the processor times.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from commands import run_command

#: Number of frames of `scenes/plain_weave.toml`.
FRAMES = 50
#: Length of the longer film relative to it.
LONGER = 4


def main() -> None:
    """Print a line for each number of processes."""
    checkout = str(Path(sys.argv[1] if sys.argv[1:] else Path(__file__).parents[1]).resolve())
    with tempfile.TemporaryDirectory() as folder:
        # The first run compiles the modules and solves the modes.
        run_command("animate plain_weave -q -o a.gif --size 64x48", checkout, folder)
        print("processes   frames/s: all, further   processor ms/frame: all, further")
        for workers in (1, 2):
            command = f"animate plain_weave -q -o a.mp4 --workers {workers}"
            short = run_command(command, checkout, folder)
            long = run_command(f"{command} --set animation.stop={0.2 * LONGER}", checkout, folder)
            more = (LONGER - 1) * FRAMES
            seconds, processor = (late - early for early, late in zip(short, long, strict=True))
            print(
                f"{workers:9}{FRAMES / short[0]:16.1f}{more / seconds:9.1f}"
                f"{1e3 * short[1] / FRAMES:25.0f}{1e3 * processor / more:9.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
