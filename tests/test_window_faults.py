"""Regression tests of faults of the window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QComboBox, QFileDialog, QMessageBox, QSlider  # noqa: E402

from spacemap_vtk.app.documents.document import Document  # noqa: E402
from spacemap_vtk.errors import InputError  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

SMALL = "[weave]\nends = 3\npicks = 3\n"
PUFF = """
[[response.loads]]  # a puff
pressure = "1 Pa"
on = "-z"
time = "table"
file = "puff.csv"  # measured
"""


@pytest.mark.nightly
def test_load_with_a_table_file_can_be_edited(open_scene: Any, tmp_path: Path) -> None:
    (tmp_path / "puff.csv").write_text("0, 0\n0.1, 1\n0.2, 0\n")
    scene = tmp_path / "scene.toml"
    scene.write_text(SMALL + PUFF)
    window = open_scene(str(scene))
    window.stages.select("response")
    editor = window.properties.rows["loads"].editor
    type_into(editor.cards[0].rows["pressure"].editor.line, "2 Pa")
    assert window.document.scene.response.loads[0].pressure == 2.0
    # The file keeps its name and its comment.
    assert window.document.text == (SMALL + PUFF).replace('"1 Pa"', '"2 Pa"')
    # With another load, the list is rewritten and refers to the same file.
    editor.add_button.menu().triggered.emit(
        next(a for a in editor.add_button.menu().actions() if a.data() == "gravity")
    )
    window.document.save()
    puff, gravity = Scene.read(scene).response.loads
    assert (puff.file.resolve(), gravity.action) == (tmp_path / "puff.csv", "gravity")


@pytest.mark.nightly
def test_table_of_modes_shows_the_damping_in_use(open_scene: Any) -> None:
    window = open_scene()
    window.stages.select("response")
    alpha = window.properties.rows["alpha"]
    window.document.set("response", "damping_ratio", 0.05)
    wait_until(lambda: "(or set alpha = 0)" in window.errors.text)
    assert alpha.note.text() == ""
    assert alpha.editor.isEnabled()  # the advice can be followed
    type_into(alpha.editor.line, "0")
    wait_until(lambda: settled(window) and window.errors.text == "")
    assert alpha.note.text().startswith("no effect: damping_ratio is ")
    assert not alpha.editor.isEnabled()
    table = window.modes.table
    assert {table.item(row, 2).text() for row in range(10)} == {"0.050"}
    window.document.set("response", "damping_ratio", [1.5, 1.0, 0.05])
    wait_until(lambda: settled(window))
    damping = [table.item(row, 2).text() for row in range(3)]
    assert damping == ["overdamped", "critical", "0.050"]
    window.document.history.undo()
    wait_until(lambda: settled(window))
    # Contradictory parameters are reported, and the table stays.
    window.document.set("response", "alpha", 3.0)
    wait_until(lambda: "damping_ratio" in window.errors.text)
    assert table.item(0, 2).text() == "0.050"


@pytest.mark.nightly
def test_refused_value_without_effect_can_be_corrected(open_scene: Any) -> None:
    window = open_scene()
    window.stages.select("modal")
    window.document.set("modal", "thickness", "1 mm")
    wait_until(lambda: "the value has no effect" in window.errors.text)
    thickness = window.properties.rows["thickness"]
    assert thickness.property("bad")
    assert thickness.editor.isEnabled()
    assert thickness.note.text().startswith("the value has no effect: material is ")
    line = thickness.editor.line
    line.setFocus()
    line.selectAll()
    for key in (Qt.Key.Key_Backspace, Qt.Key.Key_Return):
        QTest.keyClick(line, key)
    wait_until(lambda: settled(window) and window.errors.text == "")
    assert not thickness.isVisible()


@pytest.mark.parametrize("answer", ["Yes", pytest.param("No", marks=pytest.mark.nightly)])
def test_name_without_an_ending_asks_before_overwriting(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    window = open_scene()
    there = tmp_path / "copy.toml"
    there.write_text("mine")
    asked = []

    def question(*words: Any) -> Any:
        asked.append(words[2])
        return getattr(QMessageBox.StandardButton, answer)

    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "copy"), ""))
    monkeypatch.setattr(QMessageBox, "question", question)
    window.menus.actions["Save as…"].trigger()
    assert len(asked) == 1
    assert "copy.toml" in asked[0]
    assert (there.read_text() == "mine") == (answer == "No")
    assert (window.document.file == there) == (answer == "Yes")


def test_scene_with_another_file_ending_opens(tmp_path: Path) -> None:
    document = Document()
    file = tmp_path / "cloth.v2"
    file.write_text(SMALL)
    document.open(file)
    assert document.file == file
    assert document.scene.source.ends == 3
    document.set("weave", "ends", 4)
    document.save()
    assert Scene.read(file).source.ends == 4


@pytest.mark.nightly
def test_leaving_the_time_field_unchanged_keeps_the_time(open_scene: Any) -> None:
    window = open_scene()
    window.times.go_to(1 / 30)
    asked: list[float] = []
    window.times.time_changed.connect(lambda at, _: asked.append(at))
    window.times.line.setFocus()
    window.times.line.editingFinished.emit()
    assert window.times.time == 1 / 30
    assert asked == []
    type_into(window.times.line, "20 ms")
    assert asked == [0.02]


@pytest.mark.nightly
def test_undo_switches_an_added_stage_off(open_scene: Any, tmp_path: Path) -> None:
    scene_file = tmp_path / "still.toml"
    scene_file.write_text(SMALL)
    window = open_scene(str(scene_file))
    assert window.stages.states["modal"] == "off"
    window.document.set("response", "alpha", 1.0)
    wait_until(lambda: settled(window) and window.stages.states["modal"] == "fresh")
    window.document.history.undo()
    wait_until(lambda: settled(window))
    assert [s for s, state in window.stages.states.items() if state == "fresh"] == [
        "weave",
        "surface",
    ]
    assert window.stages.states["modal"] == "off"


def test_last_value_of_a_fast_drag_is_applied(qtbot: Any) -> None:
    document = Document()
    document.open("plain_weave")
    begin, changes, congested = document.text, [], [False]
    document.changed.connect(lambda: changes.append(document.value_in_file("response", "alpha")))
    document.congested = lambda: congested[0]
    document.set("response", "alpha", 5.0, burst=1)
    congested[0] = True
    for value in (6.0, 7.0, 8.0):
        document.set("response", "alpha", value, burst=1)
    assert changes == [5.0]
    # An invalid value is refused at once and replaces nothing.
    with pytest.raises(InputError, match="out of range") as refused:
        document.set("response", "alpha", -1.0, burst=1)
    assert refused.value.section == "response"
    assert document.scene.response.alpha == 8.0  # reading applies the newest value
    assert changes == [5.0, 8.0]
    document.set("response", "alpha", 9.0, burst=1)
    qtbot.waitUntil(lambda: changes == [5.0, 8.0, 9.0], timeout=60_000)  # applied after the delay
    document.set("response", "alpha", 10.0, burst=1)
    document.set("modal", "youngs_modulus", 1500.0)  # another change is applied after it
    assert changes == [5.0, 8.0, 9.0, 10.0, 10.0]
    end = document.text
    assert document.history.count() == 2
    document.history.undo()
    assert document.value_in_file("response", "alpha") == 10.0
    document.history.undo()
    assert document.text == begin
    document.history.redo()
    document.history.redo()
    assert document.text == end
    document.changed.disconnect()  # the connection keeps the document alive


def test_mouse_wheel_scrolls_without_changing_fields(open_scene: Any) -> None:
    window = open_scene("gust")
    window.stages.select("response")
    assert isinstance(window.properties.rows["loads"].editor.cards[0].kind, QComboBox)
    for section in ("weave", "response", "view"):
        window.stages.select(section)
        page = window.properties
        fields = [*page.findChildren(QSlider), *page.findChildren(QComboBox)]
        seen = [field for field in fields if field.isVisible()]  # an unused slider is hidden
        assert len(seen) > 2
        for field in seen:
            page.verticalScrollBar().setValue(0)
            page.ensureWidgetVisible(field)
            before = page.verticalScrollBar().value()
            down = before < page.verticalScrollBar().maximum()
            at = field.mapTo(window, field.rect().center())
            turn = QPoint(0, -120 if down else 120)
            QTest.wheelEvent(window.windowHandle(), at, turn)
            assert (page.verticalScrollBar().value() > before) == down
    assert window.document.history.isClean()


def test_typed_time_is_shown_with_its_unit_or_marked_as_invalid(open_scene: Any) -> None:
    window = open_scene()
    line = window.times.line
    type_into(line, "0.05")
    assert (line.text(), window.times.time) == ("50 ms", 0.05)
    type_into(line, "soon")
    assert line.property("bad")
    assert "soon" in window.errors.text
    type_into(line, "0.05")
    assert not line.property("bad")
    assert line.text() == "50 ms"
    type_into(line, "later")
    window.times.go_to_start()
    assert (line.text(), line.property("bad")) == ("0 s", False)


def test_invalid_draft_marks_its_field_and_shows_an_empty_view(
    open_window: Any, tmp_path: Path
) -> None:
    (tmp_path / "bad.wif").write_text("junk")
    window = open_window(str(tmp_path / "bad.wif"), wait=False)
    wait_until(lambda: "no section of a draft" in window.errors.text)
    assert window.properties.section == "weave"
    assert window.properties.rows["draft"].property("bad")
    assert window.view.image().min() > 200
    window.document.set("weave", "draft", None)
    wait_until(lambda: settled(window))
    assert not window.properties.rows["draft"].property("bad")
    assert window.view.image().min() < 100


@pytest.mark.nightly
def test_table_of_modes_follows_a_change_while_playing(open_scene: Any) -> None:
    window = open_scene()
    window.times.play.click()
    before = window.modes.table.item(0, 1).text()
    window.document.set("modal", "youngs_modulus", "20 kPa")
    wait_until(lambda: window.modes.table.item(0, 1).text() != before)
    assert window.times.playing
    window.times.play.click()
