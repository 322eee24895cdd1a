"""The tutorial docs/tutorials/engineer.md in the window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import (
    enlarge_for_pictures,
    keep_picture,
    require_display,
    settled,
    type_into,
    type_into_field,
    wait_until,
    wait_written,
)

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtWidgets import QApplication, QFileDialog  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


def test_engineer_designs_a_twill(
    open_window: Any, qtbot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window(None, wait=False)
    enlarge_for_pictures(window)

    # 1. A new fabric.
    qtbot.mouseClick(window.gallery.new_button, LEFT)
    wait_until(lambda: settled(window))
    weave = window.document.scene.source
    assert (weave.cloth.size, weave.pattern) == ((7, 7), "plain")

    # 2. A twill, and 3. its counts and setts; automatic values are grey.
    type_into_field(window, "weave", "pattern", "twill 2/2")
    for name, text in (
        ("ends", "16"),
        ("picks", "12"),
        ("warp_count", "30 tex"),
        ("weft_count", "30 tex"),
        ("warp_sett", "24 /cm"),
        ("weft_sett", "22 /cm"),
    ):
        type_into_field(window, "weave", name, text)
    wait_until(lambda: settled(window))
    rows = window.properties.rows
    wait_until(lambda: rows["warp_diameter"].editor.line.placeholderText() == "0.1304 mm")
    assert rows["warp_spacing"].editor.line.placeholderText() == "0.4167 mm"

    # 4. Its figures.
    window.tabs.setCurrentWidget(window.figures)
    table = window.figures.table

    def figures() -> str:
        cells = [
            table.item(row, column)
            for row in range(table.rowCount())
            for column in range(table.columnCount())
        ]
        return "\n".join(cell.text() for cell in cells if cell is not None)

    wait_until(lambda: "0 m (end" in figures())
    assert "141.7 g/m²" in figures()
    qtbot.mouseClick(window.figures.copy_button, LEFT)
    assert "141.664" in QApplication.clipboard().text()
    keep_picture(window, "figures.jpg")

    # 5. A sett that cannot be woven.
    type_into(rows["warp_sett"].editor.line, "60 /cm")
    wait_until(lambda: "neighbouring warp yarns overlap" in window.errors.text)
    assert window.view.frame.surface.GetNumberOfPoints() > 0
    window.menus.actions["Undo"].trigger()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""

    # 6. Clearance.
    window.tools.coloring.setCurrentText("Clearance")
    wait_until(lambda: settled(window))
    assert window.document.scene.view.color == "clearance"
    window.tools.coloring.setCurrentText("Own colours")

    # 7. The cloth is stretched along the warp.
    window.tabs.setCurrentWidget(window.pull)
    qtbot.mouseClick(window.pull.add_button, LEFT)
    pad = window.pull.map
    wait_until(lambda: pad.map is not None and settled(window))
    start, end = pad.position_of(*pad.stretch).toPoint(), pad.position_of(1.03, 1.0).toPoint()
    qtbot.mousePress(pad, LEFT, pos=start)
    for share in (0.25, 0.5, 0.75, 1.0):
        qtbot.mouseMove(pad, start + (end - start) * share)
        qtbot.wait(10)
    qtbot.mouseRelease(pad, LEFT, pos=end)
    wait_until(lambda: "Crossings are pressed to" in window.pull.state_text.text())
    assert "pressed to 66." in window.pull.state_text.text()
    keep_picture(window, "engineer.jpg")

    # 8. The axes of all yarns are written as a table.
    qtbot.mouseClick(window.pull.back_button, LEFT)
    wait_until(lambda: settled(window))
    file = tmp_path / "twill.csv"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    window.menus.actions["Export data…"].trigger()
    wait_written(window, file)
    assert len(file.read_text().splitlines()) > 28
