"""Half an hour of a user who makes mistakes: wrong values, wrong files, fast input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import (
    click_picture,
    require_display,
    settled,
    type_into,
    type_into_field,
    wait_until,
)

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtWidgets import QFileDialog, QMessageBox  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


# The gate checks each of these claims by tests of single parts.
@pytest.mark.nightly
def test_clumsy_user_loses_nothing(
    open_window: Any, qtbot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window(None)
    window.resize(1440, 900)
    undo = window.menus.actions["Undo"].trigger

    # 1. A negative diameter: the field is red, the cloth stays, and undo restores it.
    cloth = window.view.frame
    row = type_into_field(window, "weave", "warp_diameter", "-5 mm")
    wait_until(lambda: "greater than 0 m" in window.errors.text)
    assert row.property("bad")
    assert window.view.frame is cloth
    undo()
    assert row.editor.line.text() == "0.25 mm"
    assert not row.property("bad")
    assert window.errors.text == ""

    # 2. A word, and 3. a number that is far too large.
    ends = window.properties.rows["ends"].editor.line
    type_into(ends, "three")
    wait_until(lambda: "must be a number; allowed: a whole number" in window.errors.text)
    type_into(ends, "1e9")
    wait_until(lambda: "at most 100000" in window.errors.text)
    type_into(ends, "7")
    wait_until(lambda: window.errors.text == "")

    # 4. A word instead of a quantity.
    type_into_field(window, "modal", "youngs_modulus", "soft")
    wait_until(lambda: "must be a number; allowed: a number greater than 0" in window.errors.text)
    undo()

    # 5. A time before the start.
    type_into(window.times.line, "-1")
    wait_until(lambda: "out of range" in window.errors.text)
    type_into(window.times.line, "30 ms")
    wait_until(lambda: settled(window) and window.view.frame.time == pytest.approx(0.03))
    assert window.errors.text == ""

    # 6. A cage of far too many cells, cancelled at once.
    window.stages.select("cage")
    type_into(window.properties.rows["divisions"].editor.components[0].line, "40")
    wait_until(window.cancel_button.isVisible)
    qtbot.mouseClick(window.cancel_button, LEFT)
    wait_until(lambda: "The run was cancelled" in window.errors.text)
    assert "older than the values" in window.errors.text
    undo()
    wait_until(lambda: settled(window))

    # 7. The wrong file.
    wrong = tmp_path / "ORIGIN.md"
    wrong.write_text("Where the scenes come from.\n")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(wrong), ""))
    qtbot.mouseClick(window.gallery.open_button, LEFT)
    wait_until(lambda: "the ending is not that of a scene, draft or mesh" in window.errors.text)
    assert window.document.source.stem == "plain_weave"

    # 8. A double click opens a scene once.
    opened: list[str] = []
    window.document.replaced.connect(lambda: opened.append(window.document.source.stem))
    click_picture(window, "basket_2", double=True)
    wait_until(lambda: settled(window))
    assert opened == ["basket_2"]
    type_into_field(window, "weave", "ends", "20")
    wait_until(lambda: settled(window))

    # 9. Closing with changes: a question, and nothing is lost.
    questions: list[str] = []

    def cancel(*words: Any) -> Any:
        questions.append(words[2])
        return QMessageBox.StandardButton.Cancel

    monkeypatch.setattr(QMessageBox, "question", cancel)
    window.close()
    assert "Save the changes to" in questions[0]
    assert window.isVisible()
    assert window.document.scene.source.ends == 20

    # 10. More undo steps than there are changes.
    for _ in range(20):
        undo()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""

    # 11. A small window: a picture, and as many fields as fit.
    window.resize(690, 420)
    wait_until(lambda: settled(window))
    assert window.view.isVisible()

    # 12. The fields are hidden for the picture, and shown again.
    window.resize(1440, 900)
    wait_until(lambda: settled(window))
    for shown in (False, True):
        window.menus.actions["Properties"].trigger()
        assert window.properties.isVisible() == shown

    # 13. Without unsaved changes, there is no question.
    window.close()
    assert len(questions) == 1
