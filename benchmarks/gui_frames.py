"""Frames a second of the window, on the 7 x 7 scene: dragging a slider or the pad, and playing.

Where other programs run at the same time, the processor's milliseconds for a frame say more: of the
window's thread, of the engine's, and of OpenGL's in software.
Run on a display: xvfb-run -a -s "-screen 0 1280x900x24" python benchmarks/gui_frames.py
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from PySide6.QtCore import QEventLoop, QTimer
from PySide6.QtWidgets import QApplication

import spacemap_vtk.app.launch  # noqa: F401  chooses the Qt binding
from spacemap_vtk.app.main_window import MainWindow
from spacemap_vtk.cli.window import begin_collecting

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


class Clocks:
    """Processor time of the window's thread, of the engine's, and of the others."""

    def __init__(self) -> None:
        self._begun, self._at = time.perf_counter(), self._now()

    def line(self, frames: int) -> str:
        """Return what a frame has cost since the beginning."""
        seconds = time.perf_counter() - self._begun
        window, engine, all_ = (
            (b - a) / max(1, frames) * 1e3 for a, b in zip(self._at, self._now(), strict=True)
        )
        return (
            f"{frames / seconds:5.1f} frames a second; CPU ms a frame: window {window:5.1f}, "
            f"engine {engine:5.1f}, OpenGL {all_ - window - engine:5.1f}"
        )

    def _now(self) -> tuple[float, float, float]:
        # Python knows of Qt's thread since the engine's first run.
        engine = sum(
            time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
            for thread in threading.enumerate()
            if thread is not threading.main_thread()
        )
        return time.thread_time(), engine, time.process_time()


def rate(window: MainWindow, section: str, name: str, low: float, high: float) -> str:
    """Return the frames a second while a value runs to and fro, faster than it is drawn."""
    window.stages.choose(section)  # as a person has to
    live(300)
    window.director.hold(True)
    frames, clocks = Frames(window), Clocks()
    begun = time.perf_counter()
    step = 0
    while time.perf_counter() - begun < SECONDS:
        share = abs((step % 100) / 50 - 1)
        window.document.set(section, name, low + share * (high - low), burst=1)
        step += 1
        live(5)
    line = clocks.line(frames.stop())
    window.director.hold(False)
    return line


def playing(window: MainWindow) -> str:
    """Return the frames a second while time plays."""
    frames, clocks = Frames(window), Clocks()
    window.times.play.click()
    live(int(SECONDS * 1000))
    line = clocks.line(frames.stop())
    window.times.pause()
    return line


def pulling(window: MainWindow) -> str:
    """Return the frames a second while cloth of yarns that stretch is pulled to and fro."""
    window.document.set_many("yarns", {"inextensible": False, "tension": "50 N", "contact": "9 N"})
    window.tabs.setCurrentWidget(window.pull)
    wait_until(lambda: window.pull.map.map is not None and not window.engine.busy)
    window.pull.map.dragged.emit(1.01, 0.99)
    live(1000)  # what all pulls share
    window.director.hold(True)
    frames, clocks = Frames(window), Clocks()
    begun = time.perf_counter()
    step = 0
    while time.perf_counter() - begun < SECONDS:
        share = abs((step % 100) / 50 - 1)
        window.pull.map.dragged.emit(1.0 + 0.05 * share, 1.0 - 0.03 * share)
        step += 1
        live(5)
    line = clocks.line(frames.stop())
    window.director.hold(False)
    window.pull.stop()
    return line


def main() -> None:
    """Print a table."""
    begin_collecting()  # as `spacemap gui` does
    app = QApplication([])
    window = MainWindow()
    window.resize(1100, 700)
    window.start("plain_weave")
    window.splitter.setSizes([310, 470, 320])
    window.show()
    wait_until(lambda: window.view.frame is not None and not window.engine.busy)
    size = window.view.plotter.render_window.GetSize()
    print(f"view of {size[0]} x {size[1]} pixels")
    for section, name, low, high in (
        ("response", "alpha", 5.0, 20.0),
        ("modal", "youngs_modulus", 1000.0, 1600.0),
        ("weave", "warp_diameter", 0.00022, 0.00026),
    ):
        print(f"{section}.{name:<16} {rate(window, section, name, low, high)}")
    print(f"playing                {playing(window)}")
    print(f"pulling                {pulling(window)}")
    window.document.undo.setClean()
    window.close()
    app.processEvents()


if __name__ == "__main__":
    main()
