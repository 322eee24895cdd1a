"""Frames a second of the window, on the 7 x 7 scene, while a slider is dragged or time plays.

Run on a display: xvfb-run -a -s "-screen 0 1280x900x24" python benchmarks/gui_frames.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QEventLoop, QTimer
from PySide6.QtWidgets import QApplication

import spacemap_vtk.app.launch  # noqa: F401  chooses the Qt binding
from spacemap_vtk.app.main_window import MainWindow

SECONDS = 4.0


def live(milliseconds: int) -> None:
    """Let the window live. Not QTest.qWait, which keeps Python's lock: the engine would starve."""
    loop = QEventLoop()
    QTimer.singleShot(milliseconds, loop.quit)
    loop.exec()


def wait_until(done: Callable[[], bool]) -> None:
    """Let the window live until something holds."""
    while not done():
        live(10)


class Frames:
    """Counts different frames that have reached the screen."""

    def __init__(self, window: MainWindow) -> None:
        self._view, self._shown = window.view, []
        self._renderer = window.view.plotter.renderer
        self._observer = self._renderer.AddObserver("EndEvent", self._count)

    def _count(self, _caller: object, _event: str) -> None:
        if not self._shown or self._shown[-1] is not self._view.frame:
            self._shown.append(self._view.frame)

    def stop(self) -> int:
        """Stop counting; return how many there were."""
        self._renderer.RemoveObserver(self._observer)
        return len(self._shown)


def rate(window: MainWindow, section: str, name: str, low: float, high: float) -> float:
    """Return the frames a second while a value runs to and fro, faster than it is drawn."""
    window.director.hold(True)
    frames = Frames(window)
    begun = time.perf_counter()
    step = 0
    while time.perf_counter() - begun < SECONDS:
        share = abs((step % 100) / 50 - 1)
        window.document.set(section, name, low + share * (high - low), burst=1)
        step += 1
        live(5)
    window.director.hold(False)
    return frames.stop() / SECONDS


def playing(window: MainWindow) -> float:
    """Return the frames a second while time plays."""
    frames = Frames(window)
    window.times.play.click()
    live(int(SECONDS * 1000))
    window.times.pause()
    return frames.stop() / SECONDS


def main() -> None:
    """Print a table."""
    app = QApplication([])
    window = MainWindow()
    window.resize(1100, 700)
    window.start("plain_weave")
    window.show()
    wait_until(lambda: window.view.frame is not None and not window.engine.busy)
    size = window.view.plotter.render_window.GetSize()
    print(f"view of {size[0]} x {size[1]} pixels")
    for section, name, low, high in (
        ("response", "alpha", 5.0, 20.0),
        ("modal", "youngs_modulus", 1000.0, 1600.0),
        ("weave", "warp_diameter", 0.00022, 0.00026),
    ):
        print(f"{section}.{name:<16} {rate(window, section, name, low, high):5.1f} frames a second")
    print(f"playing                {playing(window):5.1f} frames a second")
    window.document.undo.setClean()
    window.close()
    app.processEvents()


if __name__ == "__main__":
    main()
