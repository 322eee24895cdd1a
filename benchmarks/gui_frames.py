"""Frames a second of the window: dragging a slider or the pad, playing, and turning large cloth.

Where other programs run at the same time, the processor's milliseconds for a frame say more: of the
window's thread, of the engine's, and of OpenGL's in software.
Run on a display: xvfb-run -a -s "-screen 0 1280x900x24" python benchmarks/gui_frames.py
"""

from __future__ import annotations

import gc
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QEvent, QEventLoop, QPointF, Qt, QTimer
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication

from spacemap_vtk.app.main_window import MainWindow

SECONDS = 4.0
#: A cloth that hangs.
CLOTH = """
[weave]
ends = {yarns}
picks = {yarns}
pattern = "twill 2/2"
[cage]
divisions = [6, 6, 1]
[response]
gravity = [0, -1, 0]
"""


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
        self._renderer = window.view.canvas.renderer
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
    window.stages.select(section)  # as a person has to
    live(300)
    window.director.set_dragging(True)
    frames, clocks = Frames(window), Clocks()
    begun = time.perf_counter()
    step = 0
    while time.perf_counter() - begun < SECONDS:
        share = abs((step % 100) / 50 - 1)
        window.document.set(section, name, low + share * (high - low), burst=1)
        step += 1
        live(5)
    line = clocks.line(frames.stop())
    window.director.set_dragging(False)
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
    window.director.set_dragging(True)
    frames, clocks = Frames(window), Clocks()
    begun = time.perf_counter()
    step = 0
    while time.perf_counter() - begun < SECONDS:
        share = abs((step % 100) / 50 - 1)
        window.pull.map.dragged.emit(1.0 + 0.05 * share, 1.0 - 0.03 * share)
        step += 1
        live(5)
    line = clocks.line(frames.stop())
    window.director.set_dragging(False)
    window.pull.stop()
    return line


def turning(window: MainWindow) -> str:
    """Return how often the view is drawn in a second while the mouse turns it."""
    view, drawn = window.view.canvas, []
    observer = view.renderer.AddObserver("EndEvent", lambda *_: drawn.append(1))
    middle = QPointF(view.width() / 2, view.height() / 2)
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier

    def mouse(kind: QEvent.Type, at: QPointF, held: Qt.MouseButton) -> None:
        button = Qt.MouseButton.NoButton if kind == QEvent.Type.MouseMove else left
        event = QMouseEvent(kind, at, view.mapToGlobal(at), button, held, none)
        QApplication.sendEvent(view, event)

    mouse(QEvent.Type.MouseButtonPress, middle, left)
    clocks, begun, step = Clocks(), time.perf_counter(), 0
    while time.perf_counter() - begun < SECONDS:
        step += 1
        aside = QPointF(60 * abs((step % 100) / 50 - 1), 40 * abs((step % 70) / 35 - 1))
        mouse(QEvent.Type.MouseMove, middle + aside, left)
        live(5)
    line = clocks.line(len(drawn))
    mouse(QEvent.Type.MouseButtonRelease, middle + aside, Qt.MouseButton.NoButton)
    view.renderer.RemoveObserver(observer)
    return line


def at_rest(window: MainWindow) -> str:
    """Return how long it takes until what is seen is drawn as it is at rest."""
    begun, clock = time.perf_counter(), time.process_time()
    wait_until(lambda: not window.view.steering and not window.engine.busy)
    live(20)  # it is handed over
    wait_until(lambda: not window.engine.busy)
    window.view.image()
    facets = window.status_text.text().split(" facets")[0]
    seconds, cpu = time.perf_counter() - begun, time.process_time() - clock
    return f"{facets} facets at rest after {seconds:.1f} s (processor {cpu:.1f} s)"


def large(window: MainWindow, yarns: int) -> None:
    """Print what becomes of a cloth of so many yarns when it is turned, from afar and near."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "cloth.toml")
        scene.write_text(CLOTH.format(yarns=yarns))
        generation = window.director.generation
        window.document.history.setClean()
        window.document.open(str(scene))
        wait_until(
            lambda: (
                window.view.frame is not None
                and window.view.frame.generation > generation
                and not window.engine.busy
            )
        )
    at_rest(window)
    window.view.reset_camera("front")
    at_rest(window)
    for name, nearer in (("whole", 1.0), ("3 times nearer", 3.0), ("12 times", 4.0)):
        window.view.zoom(nearer)
        at_rest(window)  # compiled loops are loaded once
        print(f"{yarns} x {yarns}, {name:<15} {turning(window)}; {at_rest(window)}")


def main() -> None:
    """Print a table."""
    # As `spacemap gui` does.
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    app = QApplication([])
    window = MainWindow()
    window.resize(1100, 700)
    window.start("plain_weave")
    window.splitter.setSizes([310, 470, 320])
    window.show()
    wait_until(lambda: window.view.frame is not None and not window.engine.busy)
    size = window.view.canvas.render_window.GetSize()
    print(f"view of {size[0]} x {size[1]} pixels")
    for section, name, low, high in (
        ("response", "alpha", 5.0, 20.0),
        ("modal", "youngs_modulus", 1000.0, 1600.0),
        ("weave", "warp_diameter", 0.00022, 0.00026),
    ):
        print(f"{section}.{name:<16} {rate(window, section, name, low, high)}")
    print(f"playing                {playing(window)}")
    print(f"pulling                {pulling(window)}")
    for yarns in (100, 800):
        large(window, yarns)
    window.document.history.setClean()
    window.close()
    app.processEvents()


if __name__ == "__main__":
    main()
