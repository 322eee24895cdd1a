"""Seconds that each command takes as a whole, and the processor time of all its threads.

Run: python benchmarks/commands.py [CHECKOUT ...]
Each round is a process of its own, as a person starts it. Of several checkouts, each command is run
in one after the other, so that what else the machine does meets all alike. A first round that is
not shown leaves what every later start finds: the modules compiled, as pip does, and the modes in
the user's cache. On a busy machine the processor time says more than the seconds.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROUNDS = 5
COMMANDS = (
    "--help",
    "render --help",
    "scenes",
    "keys",
    "validate plain_weave",
    "info plain_weave",
    "modes plain_weave",
    "modes plain_weave --plot a.png",
    "plot plain_weave -o a.png",
    "export plain_weave -o a.vtu",
    "export plain_weave -o a.stl",
    "render plain_weave -o a.png",
    "render tartan -o a.png",
    "storyboard -o a.png",
    "animate plain_weave -o a.gif --size 640x320 --set animation.stop=0.04",
)


def one(command: str, checkout: str, folder: str) -> tuple[float, float]:
    """Run a command and return its seconds and its processor time."""
    # A machine that is told to keep no bytecode would compile every module at every start.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPATH": checkout, "SPACEMAP_CACHE": str(Path(folder, "kept"))}
    arguments = [sys.executable, "-m", "spacemap_vtk", *command.split()]
    with open(Path(folder, "said"), "w+") as said:
        begun = time.perf_counter()
        process = subprocess.Popen(arguments, cwd=folder, env=environment, stdout=said, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - begun
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            said.seek(0)
            sys.exit(f"{command}: {said.read()}")
    return seconds, used.ru_utime + used.ru_stime


def main() -> None:
    """Print a line for each command: medians of the rounds."""
    checkouts = [str(Path(path).resolve()) for path in sys.argv[1:]]
    checkouts = checkouts or [str(Path(__file__).resolve().parents[1])]
    if len(checkouts) > 1:
        print(*(f"{number}: {path}" for number, path in enumerate(checkouts, 1)), sep="\n")
    print(f"{'':44}" + "   seconds processor" * len(checkouts))
    with tempfile.TemporaryDirectory() as folder:
        for command in COMMANDS:
            rounds = [[one(command, path, folder) for path in checkouts] for _ in range(ROUNDS + 1)]
            text = f"{command[:43]:44}"
            for number in range(len(checkouts)):
                for measured in (0, 1):
                    middle = statistics.median(r[number][measured] for r in rounds[1:])
                    text += f"{middle:10.2f}"
            print(text, flush=True)


if __name__ == "__main__":
    main()
