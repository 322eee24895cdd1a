"""The tutorial docs/tutorials/researcher.md in the window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import (
    fill_in,
    keep_picture,
    replace_text,
    require_display,
    settled,
    type_into_field,
    wait_until,
    wait_written,
)

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtWidgets import QFileDialog  # noqa: E402

from spacemap_vtk.app.work.frame_request import Swing  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


# The gate checks each of these claims by tests of single parts.
@pytest.mark.nightly
def test_researcher_compares_cages(
    open_window: Any, qtbot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window(None, wait=False)
    window.resize(1440, 900)

    # 1. A softer cage.
    wait_until(lambda: settled(window))
    type_into_field(window, "modal", "youngs_modulus", "2 kPa")
    wait_until(lambda: settled(window))

    # 2. Its modes; the first one is animated.
    modes = window.modes
    window.tabs.setCurrentWidget(modes)
    wait_until(lambda: modes.table.rowCount() > 0)
    assert "The cage consists of tetrahedra" in modes.sheet.text()
    tetrahedra = modes.table.item(0, 1).text()
    first = modes.table.visualItemRect(modes.table.item(0, 0)).center()
    qtbot.mouseClick(modes.table.viewport(), LEFT, pos=first)
    wait_until(lambda: isinstance(window.director.swing, Swing))
    qtbot.mouseClick(modes.back_button, LEFT)
    assert window.director.swing is None

    # 3. A sheet.
    window.stages.select("modal")
    elements = window.properties.rows["elements"].editor.box
    elements.setCurrentText("sheet")
    elements.activated.emit(elements.currentIndex())
    wait_until(lambda: settled(window) and "The cage is a sheet" in modes.sheet.text())
    assert modes.table.item(0, 1).text() != tetrahedra
    wait_until(lambda: "not resolved by the cage's cells" in modes.unresolved.text())

    # 4. A finer cage.
    window.stages.select("cage")
    divisions = window.properties.rows["divisions"].editor.components[0].line
    divisions.selectAll()
    qtbot.keyClicks(divisions, "8")
    qtbot.keyClick(divisions, Qt.Key.Key_Return)
    wait_until(lambda: settled(window))
    assert window.document.scene.cage.divisions[0] == 8

    # 5. Two dampings exclude each other.
    type_into_field(window, "response", "damping_ratio", "0.05")
    wait_until(lambda: "both define the damping" in window.errors.text)
    qtbot.mouseClick(window.properties.rows["alpha"].reset, LEFT)
    wait_until(lambda: settled(window))
    assert window.errors.text == ""

    # 6. Velocities over time.
    window.tabs.setCurrentWidget(window.plots)
    wait_until(lambda: window.plots.curves is not None and settled(window))
    window.plots.quantity.setCurrentText("Velocity")
    window.plots.quantity.activated.emit(window.plots.quantity.currentIndex())
    wait_until(lambda: settled(window) and window.engine.background is None)
    titles = [axes.get_title(loc="left") for axes in window.plots.canvas.figure.axes]
    assert any(title.startswith("Velocity") for title in titles)
    keep_picture(window, "researcher.jpg")

    # 7. A series for ParaView.
    file = tmp_path / "cloth.pvd"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))

    def fill_times(dialog: Any) -> None:
        replace_text(dialog.time_lines["stop"], "20 ms")
        qtbot.mouseClick(dialog.accept_button, LEFT)

    fill_in(window.menus.actions["Export data…"], fill_times)
    wait_written(window, file)
    assert file.read_text().count("<DataSet") > 1

    # 8. The same motion by time steps of the nonlinear equations.
    window.stages.select("transient")
    qtbot.mouseClick(window.properties.switch_on_button, LEFT)
    wait_until(lambda: settled(window))
    assert window.stages.states["transient"] == "fresh"
    assert window.errors.text == ""
