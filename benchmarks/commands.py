"""Wall-clock and processor time of each command.

Run: python benchmarks/commands.py [CHECKOUT ...]
Each round starts a new process, as a user does. With several checkouts, each command runs in one
after the other, so that other load on the machine affects all of them equally. A first round, which
is not printed, compiles the modules and fills the cache. On a busy machine, compare the processor
times.
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


def run_command(command: str, checkout: str, folder: str) -> tuple[float, float]:
    """Run a command; return its wall-clock and processor time in seconds."""
    # Without stored bytecode, every start would compile all modules.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPATH": checkout, "SPACEMAP_CACHE": str(Path(folder, "cache"))}
    arguments = [sys.executable, "-m", "spacemap_vtk", *command.split()]
    with open(Path(folder, "output"), "w+") as output:
        start = time.perf_counter()
        process = subprocess.Popen(
            arguments, cwd=folder, env=environment, stdout=output, stderr=output
        )
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            sys.exit(f"{command}: {output.read()}")
    return seconds, used.ru_utime + used.ru_stime


def main() -> None:
    """Print the medians of the rounds for each command."""
    checkouts = [str(Path(path).resolve()) for path in sys.argv[1:]]
    checkouts = checkouts or [str(Path(__file__).resolve().parents[1])]
    if len(checkouts) > 1:
        print(*(f"{number}: {path}" for number, path in enumerate(checkouts, 1)), sep="\n")
    print(f"{'':44}" + "   seconds processor" * len(checkouts))
    with tempfile.TemporaryDirectory() as folder:
        for command in COMMANDS:
            rounds = [
                [run_command(command, path, folder) for path in checkouts]
                for _ in range(ROUNDS + 1)
            ]
            text = f"{command[:43]:44}"
            for number in range(len(checkouts)):
                for measured in (0, 1):
                    middle = statistics.median(r[number][measured] for r in rounds[1:])
                    text += f"{middle:10.2f}"
            print(text, flush=True)


if __name__ == "__main__":
    main()
