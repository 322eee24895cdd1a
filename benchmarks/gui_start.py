"""Seconds from the start of the process until window, first picture and smooth picture are there.

Run on a display: xvfb-run -a -s "-screen 0 1600x1000x24" python benchmarks/gui_start.py [SCENE]
Each round is a process of its own; the modes are found in the user's cache from the second on.
"""

from __future__ import annotations

import subprocess
import sys
import time

ROUNDS = 5


def one(scene: str | None) -> None:
    """Be one round: print when what was there, and end."""
    import psutil

    begun = psutil.Process().create_time()
    from spacemap_vtk.app.splash import Splash

    splash = Splash(scene)
    splashed = time.time() - begun
    from spacemap_vtk.app import launch

    imported = time.time() - begun
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    seen: dict[str, float] = {"splash": splashed, "imported": imported}

    def watch(window: launch.MainWindow) -> None:
        splash.give_way_to(window)
        renderer = window.view.plotter.renderer

        def drawn(_caller: object, _event: str) -> None:
            frame = window.view.frame
            now = time.time() - begun
            seen.setdefault("window", now)
            if frame is not None:
                seen.setdefault("picture", now)
                if not frame.coarse:
                    seen.setdefault("smooth", now)
                    QTimer.singleShot(0, QApplication.instance().quit)

        renderer.AddObserver("EndEvent", drawn)

    launch.launch(scene, watch)
    print(*(f"{name} {at:.2f}" for name, at in seen.items()), flush=True)


def main() -> None:
    """Print a line for each round."""
    scene = sys.argv[1] if len(sys.argv) > 1 else ""
    for _ in range(ROUNDS):
        command = [sys.executable, __file__, "--one", scene]
        print(subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip())


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(sys.argv[2] or None)
    else:
        main()
