"""The window: stages, fields, sliders, time and errors. Needs a display."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from window import drag, require_display, scene_of, settled, type_into, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

from spacemap_vtk.scenes.pipeline import section_classes  # noqa: E402
from spacemap_vtk.units import typeset_units  # noqa: E402


def executions(window: Any) -> dict[str, int]:
    scene = scene_of(window)
    return {stage.section: stage.executions for stage in scene.stages}


def row(window: Any, section: str, name: str) -> Any:
    window.stages.select(section)
    return window.properties.rows[name]


def test_stages_show_their_state_time_and_runs(open_scene: Any) -> None:
    window = open_scene()
    for section in ("weave", "cage", "modal", "response", "warp", "surface"):
        assert window.stages.states[section] == "fresh"
        assert window.stages.items[section].text(1).endswith("s")
        assert window.stages.items[section].text(2) == "1"


def test_every_declared_parameter_has_a_field(open_scene: Any) -> None:
    window = open_scene(wait=False)
    for section, part in section_classes().items():
        window.stages.select(section)
        rows = window.properties.rows
        assert list(rows) == list(part.parameters)
        for name, parameter in part.parameters.items():
            assert typeset_units(parameter.help) in rows[name].toolTip(), section
            assert (rows[name].automatic is not None) == bool(parameter.automatic), name


def test_typed_value_with_a_unit_is_converted(open_scene: Any) -> None:
    window = open_scene()
    before = executions(window)
    type_into(row(window, "weave", "warp_diameter").editor.line, "0.3 mm")
    assert window.document.scene.source.warp_diameter == 0.0003
    assert window.document.value_in_file("weave", "warp_diameter") == "0.3 mm"
    wait_until(lambda: settled(window))
    assert executions(window) == {name: runs + 1 for name, runs in before.items()}


@pytest.mark.nightly
def test_word_auto_can_be_typed(open_scene: Any) -> None:
    window = open_scene()
    document = window.document
    document.set("modal", "material", "denim")  # moduli have no effect on an isotropic material
    for section, name, written in (
        ("weave", "warp_diameter", "0.2 mm"),
        ("weave", "warp_color", "#102030"),
        ("modal", "density", "250 kg/m3"),
        ("modal", "youngs_moduli", ["1 kPa", "2 kPa", "3 kPa"]),
    ):
        document.set(section, name, None)
        field = row(window, section, name)
        before = document.text
        document.set(section, name, written)
        assert not field.automatic.isChecked(), name
        editor = getattr(field.editor, "components", [field.editor])[0]
        type_into(editor.line, "auto")
        assert getattr(document.scene.parts[section], name) is None
        assert document.text.strip() == before.strip(), name
        assert field.automatic.isChecked(), name
        assert editor.line.text() == "", name


def test_slider_drag_runs_only_downstream_stages(open_scene: Any) -> None:
    window = open_scene()
    editor = row(window, "modal", "youngs_modulus").editor
    before, image = executions(window), window.view.image().astype(int)
    value = window.document.scene.modal.youngs_modulus
    drag(editor.slider, -12)
    wait_until(lambda: settled(window))
    after = executions(window)
    assert window.document.scene.modal.youngs_modulus < value / 1.3
    assert (after["weave"], after["cage"]) == (before["weave"], before["cage"])
    assert after["modal"] > before["modal"]
    # The fine surface is computed only after the drag.
    assert after["surface"] == before["surface"] + 1
    assert np.abs(window.view.image().astype(int) - image).max() > 60
    # One drag is one undo step.
    assert window.document.history.count() == 1
    window.document.history.undo()
    assert window.document.scene.modal.youngs_modulus == value


@pytest.mark.nightly
def test_new_time_runs_only_the_last_three_stages(open_scene: Any) -> None:
    window = open_scene()
    before = executions(window)
    type_into(window.times.line, "33 ms")
    wait_until(lambda: settled(window) and window.view.frame.time == 0.033)
    changed = {k for k, v in executions(window).items() if v != before[k]}
    assert changed == {"response", "warp", "surface"}


def test_playing_draws_frames_and_loops(open_scene: Any) -> None:
    window = open_scene()
    times: list[float] = []
    window.director.drawn.connect(lambda frame: times.append(frame.time))
    window.times.speed.setCurrentText("0.5 ×")
    QTest.mouseClick(window.times.play, Qt.MouseButton.LeftButton)
    wait_until(lambda: len(times) > 20 and np.min(np.diff(times)) < 0)
    QTest.mouseClick(window.times.play, Qt.MouseButton.LeftButton)
    assert not window.times.playing
    wait_until(lambda: settled(window))
    assert window.view.frame.time == window.times.time


def test_invalid_value_is_marked_and_changes_nothing(open_scene: Any) -> None:
    window = open_scene()
    for section, name, text in (
        ("weave", "warp_diameter", "wide"),
        ("weave", "warp_diameter", "3 kg"),
        ("weave", "ends", "2.5"),
        ("modal", "poissons_ratio", "0.5"),
        ("modal", "youngs_modulus", "-1"),
    ):
        before, changes = window.document.text, window.document.history.count()
        field = row(window, section, name)
        type_into(field.editor.line, text)
        assert field.property("bad"), text
        assert not field.note.isHidden(), text
        assert name in window.errors.text
        assert "allowed" in window.errors.text
        assert window.document.text == before, text
        assert window.document.history.count() == changes, text
        # A valid value is accepted afterwards.
        right = {"ends": "6", "poissons_ratio": "0.25", "youngs_modulus": "1 kPa"}
        type_into(field.editor.line, right.get(name, "0.2 mm"))
        wait_until(lambda: settled(window))
        assert not field.property("bad"), text
        assert window.errors.text == ""


def test_jammed_cloth_keeps_the_last_picture(open_scene: Any) -> None:
    window = open_scene()
    frame = window.view.frame
    field = row(window, "weave", "warp_diameter")
    type_into(field.editor.line, "1.9 mm")
    wait_until(lambda: window.errors.text)
    assert window.stages.states["weave"] == "failed"
    assert window.stages.states["surface"] == "stale"
    assert window.view.frame is frame
    assert window.view.image().std() > 20
    window.document.history.undo()
    wait_until(lambda: settled(window) and window.errors.text == "")
    assert window.stages.states["weave"] == "fresh"


def test_feasible_interval_of_the_crimp_height_is_updated(open_scene: Any) -> None:
    window = open_scene()
    field = row(window, "weave", "warp_crimp_height")
    before = field.editor.toolTip()
    assert "feasible: " in before
    type_into(row(window, "weave", "warp_diameter").editor.line, "0.3 mm")
    field = window.properties.rows["warp_crimp_height"]
    # Updated at most four times per second, less often under load.
    wait_until(lambda: field.editor.toolTip() != before)
    assert "feasible: " in field.editor.toolTip()
    # The automatic value is shown in grey.
    found = window.document.scene.source.automatic_values["warp_crimp_height"]
    assert f"{found * 1e3:.4g} mm" == field.editor.line.placeholderText()
    # Switching "auto" off starts with the automatic value.
    QTest.mouseClick(
        field.automatic, Qt.MouseButton.LeftButton, pos=field.automatic.rect().center()
    )
    field.automatic.click() if field.automatic.isChecked() else None
    assert window.document.scene.source.warp_crimp_height is not None
    field.reset.click()
    assert window.document.scene.source.warp_crimp_height is None


def test_window_responds_during_a_run_that_can_be_cancelled(open_window: Any) -> None:
    window = open_window()
    image = window.view.image().astype(int)
    window.document.set("modal", "modes", 400)
    window.document.set("cage", "divisions", [22, 22, 4])
    wait_until(
        lambda: window.stages.states["modal"] == "running" and window.cancel_button.isVisible()
    )
    for _ in range(10):
        QTest.qWait(10)
    assert window.engine.busy  # the window handles its events while the engine works
    QTest.mouseClick(window.cancel_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: not window.engine.busy)
    wait_until(lambda: "picture is older" in window.errors.text)
    window.errors.hide()  # restores the height of the view
    wait_until(lambda: window.view.image().shape == image.shape)
    # The last good picture stays; some pixels come from a coarser surface.
    assert np.abs(window.view.image().astype(int) - image).mean() < 4
    window.document.history.undo()
    window.document.history.undo()
    wait_until(lambda: settled(window))


@pytest.mark.nightly
def test_window_can_be_closed_during_a_run(open_window: Any) -> None:
    window = open_window(wait=False)
    window.document.set("modal", "modes", 400)
    window.document.set("cage", "divisions", [20, 20, 3])
    wait_until(lambda: window.engine.busy)
    QTest.qWait(300)
    window.discard()
    assert not window.engine.isRunning()
