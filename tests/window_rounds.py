"""Open and close the window many times, and print what is left behind; run by a test.

In each round the window opens, draws a scene, shows every tab, and closes; in every third it is
edited and plots are computed too.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

import psutil
from PySide6.QtCore import QCoreApplication, QEvent, QObject, QSettings
from PySide6.QtWidgets import QApplication
from window import settled, wait_until

from spacemap_vtk.app.main_window import MainWindow

SCENE = """[weave]
ends = 3
picks = 3
[cage]
divisions = [2, 2, 1]
[modal]
[response]
[animation]
stop = 0.1
"""


def one_round(app: QApplication, scene: Path, with_plots: bool) -> None:
    window = MainWindow()
    window.resize(1000, 600)
    window.start(str(scene))
    window.show()
    wait_until(lambda: settled(window))
    for number in range(window.tabs.count()):
        window.tabs.setCurrentIndex(number)
        app.processEvents()
    if with_plots:
        window.document.set("weave", "warp_diameter", "0.2 mm")
        wait_until(lambda: settled(window))
        window.tabs.setCurrentWidget(window.plots)
        wait_until(lambda: window.plots.curves is not None)
        window.plots.canvas.repaint()
    window.discard()


def count_types() -> Counter[str]:
    return Counter(type(thing).__name__ for thing in gc.get_objects())


def main(rounds: int) -> None:
    # Print the stack of each thread before the waiting test times out.
    faulthandler.dump_traceback_later(840, exit=True)
    os.environ["SPACEMAP_CACHE"] = tempfile.mkdtemp()
    QSettings.setDefaultFormat(QSettings.Format.IniFormat)
    folder = tempfile.mkdtemp()
    QSettings.setPath(QSettings.Format.IniFormat, QSettings.Scope.UserScope, folder)
    app = QApplication([])
    app.setApplicationName("spacemap")
    scene = Path(folder) / "small.toml"
    scene.write_text(SCENE)
    process = psutil.Process()
    memory, objects, threads = [], [], []
    early: Counter[str] = Counter()
    for number in range(rounds):
        one_round(app, scene, with_plots=number % 3 == 0)
        app.processEvents()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
        gc.collect()
        if number == rounds // 2:
            early = count_types()
        memory.append(process.memory_info().rss / 2**20)
        objects.append(len(gc.get_objects()))
        threads.append(process.num_threads())
    grown = {
        name: count - early[name] for name, count in count_types().items() if count > early[name]
    }
    left = [thing for thing in gc.get_objects() if isinstance(thing, QObject)]
    result = {
        "memory": memory,
        "objects": objects,
        "threads": threads,
        "grown": grown,
        "windows": sum(isinstance(thing, MainWindow) for thing in left),
        "widgets": len(QApplication.allWidgets()),
        "files": process.num_fds(),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main(int(sys.argv[1]))
