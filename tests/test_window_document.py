"""What an edit costs: one scene, whoever makes it; the engine goes on with its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from window import drag, require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

from spacemap_vtk.app.draft.layout import Place  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def test_an_edit_builds_one_scene(
    open_window: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    built: list[int] = []
    construct = Scene.__init__

    def counted(scene: Scene, *given: Any) -> None:
        built.append(1)
        construct(scene, *given)

    window = open_window("plain_weave")
    document, settings = window.document, window.properties
    monkeypatch.setattr(Scene, "__init__", counted)

    def count(deed: Callable[[], object]) -> int:
        built.clear()
        deed()
        wait_until(lambda: settled(window))
        return len(built)

    window.stages.choose("modal")
    modulus = settings.rows["youngs_modulus"].editor
    assert count(lambda: type_into(modulus.line, "2 MPa")) == 1
    assert count(document.undo.undo) == 1
    assert count(document.undo.redo) == 1
    # Of a drag each value that is taken is an edit.
    changes: list[int] = []
    document.changed.connect(lambda: changes.append(1))
    assert count(lambda: drag(modulus.slider, 5)) == len(changes) > 0
    # Sections come and go: what the engine has connected is connected otherwise.
    still = tmp_path / "still.toml"
    still.write_text("[weave]\nends = 4\npicks = 4\n")
    with_engine = 2
    assert count(lambda: document.open(still)) == with_engine
    assert count(lambda: document.set("cage", "divisions", [2, 2, 1])) == 1
    assert window.stages.states["modal"] == "fresh"
    assert count(document.undo.undo) == 1
    assert count(document.new) == with_engine
    document.open("plain_weave")
    window.tabs.setCurrentWidget(window.draft)
    wait_until(lambda: settled(window))
    grid, before = window.draft.grid, document.text
    crossing = QPoint(*grid.layout_now().center(Place("drawdown", 1, 1)))
    left = Qt.MouseButton.LeftButton
    assert count(lambda: QTest.mouseClick(grid.viewport(), left, pos=crossing)) == 1
    assert document.text != before
    document.changed.disconnect()
    document.undo.setClean()


def test_a_stage_that_needs_no_value_is_added_by_a_click(open_scene: Any) -> None:
    window = open_scene()
    document, properties = window.document, window.properties
    before = document.text
    assert properties.add.isHidden()
    window.stages.choose("rotation")
    QTest.mouseClick(properties.add, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and window.stages.states["rotation"] == "fresh")
    assert document.text == before + "\n[rotation]\n"
    assert properties.add.isHidden()
    document.undo.undo()
    wait_until(lambda: settled(window) and window.stages.states["rotation"] == "off")
    assert document.text == before
    assert not properties.add.isHidden()
    # What another takes the place of is refused as in a file.
    window.stages.choose("transient")
    QTest.mouseClick(properties.add, Qt.MouseButton.LeftButton)
    assert "[transient] takes the place of [response]" in window.errors.text
    assert document.text == before
