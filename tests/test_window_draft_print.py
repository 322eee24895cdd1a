"""Print a draft from the window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import require_display, wait_until

require_display()

from PySide6.QtCore import Qt, QTimer  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication, QFileDialog  # noqa: E402

from spacemap_vtk.app.draft.print_dialog import PrintDialog  # noqa: E402
from spacemap_vtk.io.provenance import read_record  # noqa: E402


def fill_dialog(seen: list[str]) -> None:
    """Fill in the dialog as soon as it opens, first with values that are refused."""
    dialog = QApplication.activeModalWidget()
    if not isinstance(dialog, PrintDialog):
        QTimer.singleShot(50, lambda: fill_dialog(seen))
        return
    for text in ("nonsense", "3"):
        dialog.fields["floats"].setText(text)
        seen.append(f"{dialog.accept_button.isEnabled()}: {dialog.summary.text()}")
    dialog.fields["paper"].setCurrentText("Letter")
    dialog.fields["mono"].setChecked(True)
    QTest.mouseClick(dialog.accept_button, Qt.MouseButton.LeftButton)


@pytest.mark.nightly
def test_the_draft_tab_prints_a_draft(
    draft_of: Any, twill: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = draft_of(twill)
    file = tmp_path / "twill"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), "Documents (*.pdf)"))
    written: list[str] = []
    seen: list[str] = []
    window.exports.written.connect(written.append)
    QTimer.singleShot(50, lambda: fill_dialog(seen))
    window.draft.print_button.click()
    wait_until(lambda: bool(written) or window.errors.text)
    assert window.errors.text == ""
    assert seen[0].startswith('False: floats = "nonsense": must be a number')
    assert seen[1].startswith("True: ")
    record = read_record(file.with_suffix(".pdf"))
    assert record is not None
    assert record.order["what"] == "print"
    settings = record.order["settings"]
    assert (settings["paper"], settings["floats"], settings["mono"]) == ("letter", "3", True)


def test_a_scene_that_is_not_woven_has_no_draft_to_print(open_scene: Any) -> None:
    window = open_scene("tube_bundle")
    window.menus.actions["Print draft…"].trigger()
    wait_until(lambda: bool(window.errors.text))
    assert "has no draft" in window.errors.text
