"""Seconds from "spacemap gui" until splash, window, first picture and smooth picture are there.

Run on a display: xvfb-run -a -s "-screen 0 1600x1000x24" python benchmarks/gui_start.py [SCENE]
Each round is a process of its own that runs the real command, from the interpreter's start on, and
is told by the window when it has drawn. A first round that is not shown leaves what every later
start finds: the modules compiled, as pip does, and the modes in the user's cache.
"processor" is the time that all threads worked: on a busy machine it says more than the others.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time

ROUNDS = 9


def one(begun: float, scene: list[str]) -> None:
    """Be one round: run the command, print when what was there, and end."""
    from spacemap_vtk.cli.main import main

    seen: dict[str, float] = {"command": time.time() - begun}
    # Only now, as the command does: what it imports is part of what is measured.
    from spacemap_vtk.app.requirements import require_window

    require_window()
    from spacemap_vtk.app import splash

    class Watched(splash.Splash):
        def __init__(self, scene: str | None) -> None:
            super().__init__(scene)
            seen["splash"] = time.time() - begun

        def close_after_first_frame(self, window: object) -> None:
            super().close_after_first_frame(window)
            seen["made"] = time.time() - begun
            view = window.view
            view.canvas.renderer.AddObserver("EndEvent", lambda *_: drawn(view.frame))

    def drawn(frame: object) -> None:
        from PySide6.QtCore import QTimer
        from PySide6.QtWidgets import QApplication

        now = time.time() - begun
        seen.setdefault("window", now)
        if frame is not None:
            seen.setdefault("picture", now)
            if not frame.coarse and "smooth" not in seen:
                seen["smooth"] = now
                seen["processor"] = time.process_time()
                QTimer.singleShot(0, QApplication.instance().quit)

    splash.Splash = Watched
    try:
        main(["gui", *scene])
    finally:
        print(*(f"{name} {at:.2f}" for name, at in seen.items()), flush=True)


def main() -> None:
    """Print a line for each round, and one of their medians."""
    # A machine that is told to keep no bytecode would compile every module at every start.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    rounds = []
    for number in range(ROUNDS + 1):
        command = [sys.executable, __file__, "--one", str(time.time()), *sys.argv[1:]]
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        if not done.stdout.strip():
            sys.exit(done.stderr)
        if number > 0:
            print(done.stdout.strip(), flush=True)
            rounds.append(done.stdout.split())
    # Words and numbers take turns.
    columns = zip(*(map(float, words[1::2]) for words in rounds), strict=True)
    medians = (f"{statistics.median(column):.2f}" for column in columns)
    print("median:", *(f"{n} {m}" for n, m in zip(rounds[0][::2], medians, strict=True)))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(float(sys.argv[2]), sys.argv[3:])
    else:
        main()
