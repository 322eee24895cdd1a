"""The tutorial docs/tutorials/film.md in the window: style, camera, colours, a film."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import (
    click_picture,
    fill_in,
    keep_picture,
    replace_text,
    require_display,
    settled,
    turn_wheel,
    type_into_field,
    wait_until,
    wait_written,
)

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtWidgets import QFileDialog  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


# The gate checks each of these claims by tests of single parts.
@pytest.mark.nightly
def test_artist_makes_a_film_and_an_object(
    open_window: Any, qtbot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window(None, wait=False)
    window.resize(1440, 900)

    # 1. A scene of the gallery.
    click_picture(window, "gust")
    wait_until(lambda: settled(window))
    assert window.windowTitle().startswith("Plain weave in a gust")

    # 2. A style.
    studio = window.view.image().astype(int)
    window.tools.styles["paper"].trigger()
    wait_until(lambda: np.abs(window.view.image().astype(int) - studio).max() > 60)

    # 3. The camera: from the front, turned by a drag, farther away by the wheel.
    window.tools.cameras["front"].trigger()
    front = np.array(window.view.viewpoint.position)
    view = window.view.canvas
    middle = view.rect().center()
    qtbot.mousePress(view, LEFT, pos=middle)
    for step in range(1, 5):
        qtbot.mouseMove(view, middle + QPoint(24 * step, -8 * step))
        qtbot.wait(10)
    qtbot.mouseRelease(view, LEFT, pos=middle + QPoint(96, -32))
    turned = np.array(window.view.viewpoint.position)
    assert np.linalg.norm(turned - front) > 0.05 * np.linalg.norm(front)
    turn_wheel(view, -120)
    away = np.array(window.view.viewpoint.position)
    assert np.linalg.norm(away) > 1.01 * np.linalg.norm(turned)

    # 4. A red warp.
    type_into_field(window, "weave", "warp_color", "#b5443c")
    wait_until(lambda: settled(window))
    assert window.document.values["weave"]["warp_color"] == "#b5443c"

    # 5. A dark background.
    window.tools.backgrounds["Dark"].trigger()
    wait_until(lambda: settled(window) and window.view.image()[2, 2].mean() < 90)
    keep_picture(window, "artist.jpg")

    # 6. It moves.
    qtbot.mouseClick(window.times.play, LEFT)
    wait_until(lambda: window.times.time > 0.06)
    qtbot.mouseClick(window.times.play, LEFT)
    assert not window.times.playing

    # 7. A small film.
    film = tmp_path / "film.gif"

    def fill_film(dialog: Any) -> None:
        dialog.width_box.setValue(160)
        dialog.height_box.setValue(120)
        replace_text(dialog.time_lines["stop"], "20 ms")
        replace_text(dialog.file_line, str(film))
        assert "frames" in dialog.summary.text()
        qtbot.mouseClick(dialog.accept_button, LEFT)

    fill_in(window.menus.actions["Export film…"], fill_film)
    wait_written(window, film)
    assert film.read_bytes().startswith(b"GIF8")

    # 8. An object that moves, for Blender.
    model = tmp_path / "cloth.glb"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(model), ""))

    def fill_times(dialog: Any) -> None:
        replace_text(dialog.time_lines["stop"], "10 ms")
        qtbot.mouseClick(dialog.accept_button, LEFT)

    fill_in(window.menus.actions["Export data…"], fill_times)
    wait_written(window, model)
    assert model.read_bytes().startswith(b"glTF")
