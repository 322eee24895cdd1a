"""Prints how many pixels dots, lines and letters take; QT_SCALE_FACTOR is the caller's."""

from __future__ import annotations

import json

import numpy as np
from PySide6.QtWidgets import QApplication
from window import settled, wait_until

import spacemap_vtk.app.launch  # noqa: F401  chooses the Qt binding
from spacemap_vtk.app.main_window import MainWindow


def main() -> None:
    app = QApplication([])
    window = MainWindow()
    window.resize(800, 600)
    window.start("plain_weave")
    window.show()
    view, document = window.view, window.document
    shown = view.scene_view
    document.set("view", "color", "displacement")
    wait_until(lambda: settled(window))
    shown.surface.VisibilityOff()

    def pixels(*visible: str) -> int:
        props = {
            "supports": shown.supports,
            "cage": shown.cage,
            "pick": view.marks,
            "letters": shown.surface.bar,
        }
        images = []
        for on in (True, False):
            for name, prop in props.items():
                prop.SetVisibility(on and name in visible)
            images.append(view.image().astype(int))
        # The scale's own colours are a share of the picture, whatever its letters are.
        change = np.abs(images[0] - images[1])
        grey = np.ptp(images[0], axis=2) < 24 if "letters" in visible else True
        return int(((change.max(axis=2) > 40) & grey).sum())

    counts = {name: pixels(name) for name in ("supports", "cage", "letters")}
    shown.surface.VisibilityOn()
    for x in range(-60, 61, 12):
        at = view.plotter.rect().center().toPointF()
        at.setX(at.x() + x)
        view.click(at)
        if view.picks:
            break
    shown.surface.VisibilityOff()
    counts["pick"] = pixels("pick")
    print(json.dumps(counts))
    window.discard()
    app.processEvents()


if __name__ == "__main__":
    main()
