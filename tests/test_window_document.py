"""Edits of the document: number of scenes built, stages switched on and off."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from window import drag, require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

from spacemap_vtk.app.draft.draft_layout import GridCell  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


@pytest.mark.nightly
def test_each_edit_builds_one_scene(
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

    window.stages.select("modal")
    modulus = settings.rows["youngs_modulus"].editor
    assert count(lambda: type_into(modulus.line, "2 MPa")) == 1
    assert count(document.history.undo) == 1
    assert count(document.history.redo) == 1
    # Each accepted value of a drag is an edit.
    changes: list[int] = []
    document.changed.connect(lambda: changes.append(1))
    assert count(lambda: drag(modulus.slider, 5)) == len(changes) > 0
    # Switching sections changes the connections of the engine's scene.
    scene_file = tmp_path / "still.toml"
    scene_file.write_text("[weave]\nends = 4\npicks = 4\n")
    with_engine = 2
    assert count(lambda: document.open(scene_file)) == with_engine
    assert count(lambda: document.set("cage", "divisions", [2, 2, 1])) == 1
    assert window.stages.states["modal"] == "fresh"
    assert count(document.history.undo) == 1
    assert count(document.new) == with_engine
    document.open("plain_weave")
    window.tabs.setCurrentWidget(window.draft)
    wait_until(lambda: settled(window))
    grid, before = window.draft.grid, document.text
    crossing = QPoint(*grid.current_layout().center(GridCell("drawdown", 1, 1)))
    left = Qt.MouseButton.LeftButton
    assert count(lambda: QTest.mouseClick(grid.viewport(), left, pos=crossing)) == 1
    assert document.text != before
    document.changed.disconnect()
    document.history.setClean()


def click_box(window: Any, section: str, column: int = 3) -> None:
    """Click the box of a stage, or another column."""
    stages = window.stages
    at = stages.visualRect(stages.indexFromItem(stages.items[section], column)).center()
    if column == 3:
        at.setX(stages.columnViewportPosition(column) + 10)
    QTest.mouseClick(stages.viewport(), Qt.MouseButton.LeftButton, pos=at)
    wait_until(lambda: settled(window))


def test_stages_can_be_switched_in_the_list(open_scene: Any) -> None:
    window = open_scene()
    document, stages = window.document, window.stages
    before, values = document.text, document.values
    window.stages.select("rotation")
    QTest.mouseClick(window.properties.switch_on_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and stages.states["rotation"] == "fresh")
    assert document.text == before + "\n[rotation]\n"
    assert window.properties.switch_on_button.isHidden()
    # Stages that do not depend on it do not run again.
    assert stages.items["modal"].text(2) == "1"
    click_box(window, "rotation")
    assert document.text == before
    # A source cannot be switched off; without modes nothing moves, and modes restore the motion.
    assert stages.items["weave"].data(3, Qt.ItemDataRole.CheckStateRole) is None
    click_box(window, "modal")
    assert [s for s, state in stages.states.items() if state == "fresh"] == ["weave", "surface"]
    assert (
        window.statusBar()
        .currentMessage()
        .startswith("Also switched off: Tetra cage, Modal response")
    )
    assert window.view.frame.cage is None
    click_box(window, "response")
    assert document.values == values
    assert stages.states["rotation"] == "off"
    for _ in range(4):
        document.history.undo()
    wait_until(lambda: settled(window))
    assert document.text == before


def test_replacing_stage_takes_over_common_values(open_scene: Any, tmp_path: Path) -> None:
    scene = tmp_path / "held.toml"
    scene.write_text(
        "[weave]\nends = 3\npicks = 3\n\n[cage]\ndivisions = [1, 1, 1]\n\n[modal]\n\n[response]\n"
        'gravity = [0.0, 0.0, -2.0] # weak\nduration = "1 s"\nresidual_vectors = false\n\n'
        '[[response.loads]]\npressure = "1 Pa" # a breath\non = "+z"\n\n[animation]\nstop = 0.01\n'
    )
    window = open_scene(scene)
    document, before = window.document, window.document.text
    click_box(window, "transient")
    assert document.scene.parts["transient"].gravity == (0.0, 0.0, -2.0)
    assert document.scene.parts["transient"].duration == 1.0
    assert document.scene.parts["transient"].loads[0].pressure == 1.0
    assert "response" not in document.values
    document.history.undo()
    assert document.text == before
    document.history.redo()
    document.set_many("transient", {"gravity": [0.0, 0.0, -3.0], "duration": None, "alpha": 4.0})
    click_box(window, "response")
    assert document.values["response"] == {
        "gravity": [0.0, 0.0, -3.0],
        "residual_vectors": False,  # only of the transient response
        "alpha": 4.0,
        "loads": [{"pressure": "1 Pa", "on": "+z"}],
    }


def test_eye_button_menu_and_scene_always_agree(open_scene: Any) -> None:
    window = open_scene()
    document, cage, fabric = (
        window.document,
        window.tools.part_actions["cage"],
        window.view.scene_view.cage,
    )
    for click, show in (
        (lambda: click_box(window, "cage", column=4), "fabric"),
        (cage.trigger, "side by side"),  # as before
        (lambda: click_box(window, "surface", column=4), "cage"),
        (lambda: document.set("view", "show", "both"), "both"),
        (document.history.undo, "cage"),
    ):
        click()
        assert document.scene.view.show == show
        assert cage.isChecked() == bool(fabric.GetVisibility()) == (show != "fabric")
        assert window.tools.part_actions["fabric"].isChecked() == (show != "cage")
