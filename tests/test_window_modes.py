"""The modes tab: its figures, and the animated mode."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import WIDE, require_display, scene_of, settled, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtGui import QBrush  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

from spacemap_vtk.datasets.arrays import array_of, points_of  # noqa: E402
from spacemap_vtk.scenes import report  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def click_row(window: Any, row: int) -> None:
    table = window.modes.table
    where = table.visualItemRect(table.item(row, 1)).center()
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=where)


def test_table_of_modes_equals_the_command_line(open_scene: Any) -> None:
    window = open_scene()
    figures = report.report_modes(Scene.read("plain_weave"))["modes"]
    table = window.modes.table
    assert table.rowCount() == len(figures) == 180
    for row in (0, 1, 57, 179):
        assert table.item(row, 0).text() == str(row + 1)
        frequency = float(table.item(row, 1).text())
        assert abs(frequency / figures[row]["frequency_hz"] - 1) < 1e-3
        damping = float(table.item(row, 2).text())
        assert abs(damping / figures[row]["damping_ratio"] - 1) < 0.03
    decimals = {len(table.item(row, 1).text().split(".")[1]) for row in range(180)}
    assert len(decimals) == 1
    window.tabs.setCurrentWidget(window.modes)
    wait_until(lambda: table.item(0, 3).text())
    assert table.item(0, 3).text() == f"{figures[0]['effective_mass_share'][2]:.0%} z"


def test_click_in_the_response_plot_animates_the_nearest_mode(
    open_scene: Any, tmp_path: Path
) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.modes)
    plot = window.modes.response
    wait_until(lambda: plot.isVisible())
    spectrum = plot.spectrum
    # The highest peak is at the first mode, which the gust excites.
    assert abs(spectrum.frequencies[np.argmax(spectrum.response)] / plot.frequencies[0] - 1) < 0.01
    at = QPoint(round(plot.x_of(plot.frequencies[3])), plot.height() // 2)
    QTest.mouseClick(plot, Qt.MouseButton.LeftButton, pos=at)
    assert window.modes.mode == plot.mode == 3
    wait_until(lambda: window.director.swing is not None and window.director.swing.mode == 3)
    QTest.mouseClick(window.modes.back_button, Qt.MouseButton.LeftButton)
    assert plot.mode is None
    scene_file = tmp_path / "still.toml"  # without modes
    scene_file.write_text("[weave]\nends = 3\npicks = 3\n")
    open_scene(str(scene_file))
    wait_until(lambda: not plot.isVisible(), 20.0)


def test_click_animates_a_mode_and_runs_no_stage(open_scene: Any) -> None:
    window = open_scene()
    scene = scene_of(window)
    before = {stage.section: stage.executions for stage in scene.stages}
    sizes: list[float] = []

    def measure(frame: Any) -> None:
        if frame.mode == 2:
            moved = array_of(frame.cage.GetPointData(), "displacement", "a swing")
            sizes.append(float(np.linalg.norm(moved, axis=1).max()))

    window.director.drawn.connect(measure)
    window.modes.amplitude.setValue(30)
    click_row(window, 2)
    wait_until(lambda: len(sizes) > 12)
    side = np.ptp(np.array(window.view.frame.cage.GetBounds()).reshape(3, 2), axis=1).max()
    assert 0.1 * side < max(sizes) <= 0.3001 * side
    assert window.view.frame.surface.GetPointData().GetArray("displacement") is not None
    assert {stage.section: stage.executions for stage in scene.stages} == before
    QTest.mouseClick(window.modes.back_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and window.view.frame.mode is None)
    assert window.modes.mode is None


def test_table_of_modes_follows_the_scene(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.document.set("modal", "modes", 12)
    wait_until(lambda: settled(window))
    assert window.modes.table.rowCount() == 12
    scene_file = tmp_path / "still.toml"
    scene_file.write_text("[weave]\nends = 3\npicks = 3\n")
    wait_until(window.modes.response.isVisible)
    window.document.open(scene_file)
    # At once, so that modes of the former scene are not shown.
    assert window.modes.table.rowCount() == 0
    assert not window.modes.response.isVisible()
    wait_until(lambda: settled(window))
    assert window.stages.states["modal"] == "off"
    # Setting a value of a stage that is off switches on the stage and the motion.
    window.document.set("modal", "modes", 5)
    wait_until(lambda: settled(window))
    assert window.modes.table.rowCount() == 5


@pytest.mark.nightly
def test_unresolved_modes_are_marked(open_scene: Any) -> None:
    """With 5 x 5 cells, the 7th mode of a sheet is 25 % too high."""
    window = open_scene()
    window.tabs.setCurrentWidget(window.modes)
    warning, table = window.modes.unresolved, window.modes.table
    wait_until(lambda: table.item(0, 3).text())
    assert not warning.isVisible()  # not for tetrahedra
    sheet = {"elements": "sheet", "tensile_rigidity": 1e3, "bending_rigidity": 1e-9, "modes": 20}
    window.document.set_many("modal", sheet)
    wait_until(warning.isVisible)
    scene = Scene.read("plain_weave")
    for name, value in sheet.items():
        scene.set(f"modal.{name}={value}")
    report.report_modes(scene)
    (warning_text,) = (
        text for text in scene.warnings if "not resolved by the cage's cells" in text
    )
    assert warning.text().split(";")[0].lower() == warning_text.split(";")[0]
    marked = [row for row in range(20) if table.item(row, 1).text().startswith("≈")]
    assert marked[0] == 6
    assert "too high" in table.item(6, 1).toolTip()
    window.document.set("modal", "modes", 5)
    wait_until(lambda: settled(window) and table.rowCount() == 5 and table.item(4, 3).text())
    assert not warning.isVisible()


@pytest.mark.nightly
def test_masses_of_former_modes_are_grey(open_scene: Any) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.modes)

    def fresh() -> bool:
        cell = window.modes.table.item(0, 3)
        return cell is not None and cell.text() != "" and cell.foreground() == QBrush()

    wait_until(fresh)
    drawn: list[bool] = []
    connection = window.director.drawn.connect(lambda _: drawn.append(fresh()))
    window.document.set("modal", "elements", "sheet")
    wait_until(lambda: settled(window) and fresh())
    window.director.drawn.disconnect(connection)
    assert drawn[0] is False


# Wide, as at the start, and as narrow as possible.
@pytest.mark.nightly
def test_table_of_modes_fills_its_width(open_scene: Any) -> None:
    window = open_scene()
    window.resize(*WIDE)
    window.tabs.setCurrentWidget(window.modes)
    table = window.modes.table
    for width, diameter in ((510, "0.2 mm"), (360, "0.21 mm"), (1, "0.19 mm")):
        window.splitter.setSizes([290, 910 - width, width])
        first = table.item(0, 1).text()
        window.document.set("weave", "warp_diameter", diameter)
        wait_until(lambda: settled(window) and table.item(0, 1).text() != first)  # noqa: B023
        # No horizontal scrolling, and at least half of every text is visible.
        assert table.horizontalScrollBar().maximum() == 0
        for column in range(4):
            needed = table.sizeHintForColumn(column)
            assert table.columnWidth(column) >= needed * (0.5 if column == 3 else 1.0)
        assert table.horizontalHeader().length() == table.viewport().width()


@pytest.mark.nightly
def test_modes_tab_explains_how_to_add_modes(open_scene: Any) -> None:
    window = open_scene("handweaving")
    assert window.modes.table.rowCount() == 0
    assert "modal solver" in window.modes.hint.text()
    window.files.load("plain_weave")
    wait_until(lambda: window.modes.table.rowCount() > 0)
    assert "Click a mode" in window.modes.hint.text()
    window.files.load("calculix_fabric")
    wait_until(lambda: "from a file" in window.modes.hint.text())
    assert window.modes.table.rowCount() == 0


def test_arrow_keys_change_the_animated_mode(open_scene: Any) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.modes)
    table = window.modes.table
    at = table.visualItemRect(table.item(1, 1)).center()
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert window.modes.mode == 1
    QTest.keyClick(table, Qt.Key.Key_Down)
    assert window.modes.mode == 2
    wait_until(lambda: window.director.swing is not None and window.director.swing.mode == 2)
    window.modes.stop()
    QTest.keyClick(table, Qt.Key.Key_Down)
    assert window.modes.mode is None


@pytest.mark.nightly
def test_mode_with_rotation_strain_rotates_by_ninety_degrees(
    open_scene: Any, tmp_path: Path
) -> None:
    file = tmp_path / "strip.toml"
    file.write_text(
        "weave = { ends = 3, picks = 9 }\ncage = { divisions = [1, 20, 1] }\nrotation = {}\n"
        'modal = { elements = "sheet", fixed = "+y", modes = 2 }\nresponse = {}\n'
    )
    window = open_scene(file)
    assert window.modes.amplitude_text.text() == "45°"
    window.modes.amplitude.setValue(window.modes.amplitude.maximum())
    assert window.modes.amplitude_text.text() == "90°"
    turned: list[float] = []
    longest: list[float] = []

    def measure(frame: Any) -> None:
        if frame.mode == 0:
            rest = points_of(frame.cage)
            moved = rest + array_of(frame.cage.GetPointData(), "displacement", "a swing")
            side = np.flatnonzero(rest[:, 0] == rest[0, 0])
            side = side[
                np.argsort(rest[side, 1], kind="stable")
            ]  # in pairs through the thickness of the sheet
            steps = np.diff(moved[side].reshape(-1, 2, 3).mean(axis=1), axis=0)
            # From the fixed end to the free end, which hangs along -y.
            turned.append(float(np.degrees(np.arccos(steps[0, 1] / np.linalg.norm(steps[0])))))
            longest.append(float(np.linalg.norm(steps, axis=1).sum() / np.ptp(rest[:, 1])))

    window.director.drawn.connect(measure)
    click_row(window, 0)
    wait_until(lambda: len(turned) > 40)
    # A frame need not show the exact end of a swing.
    assert 80 < max(turned) < 90.1
    np.testing.assert_allclose(longest, 1.0, rtol=0, atol=0.005)
    # Without rotation strain, the sheet would stretch.
    window.modes.stop()
    window.document.open("plain_weave")
    wait_until(lambda: settled(window))
    assert window.modes.amplitude.maximum() == 50
    assert window.modes.amplitude_text.text() == "15 %"


def test_errors_are_estimated_on_demand(open_scene: Any) -> None:
    window = open_scene("gust")
    modes = window.modes
    window.tabs.setCurrentWidget(modes)
    wait_until(lambda: modes.table.item(0, 3) is not None and modes.table.item(0, 3).text())
    assert "±" not in modes.table.item(0, 1).text()
    modes.errors_button.click()
    assert modes.errors_button.text() == "Cancel the estimate"
    wait_until(lambda: "±" in modes.table.item(0, 1).text())
    assert modes.errors_button.text() == "Estimate errors"
    assert modes.table.item(0, 1).text().split() == ["21.78", "±", "0.40"]
    assert "increase cage.divisions" in modes.unresolved.text()
    window.document.set("modal", "modes", 4)
    wait_until(lambda: settled(window) and modes.table.rowCount() == 4)
    assert "±" not in modes.table.item(0, 1).text()


def test_frames_are_drawn_during_an_estimate_of_errors_which_a_click_cancels(
    open_scene: Any,
) -> None:
    window = open_scene("gust")
    modes, engine = window.modes, window.engine
    window.tabs.setCurrentWidget(modes)
    # So many cells that their estimate takes much longer than a frame.
    window.document.set_many("modal", {"modes": 40})
    window.document.set("cage", "divisions", [40, 40, 1])
    wait_until(lambda: settled(window) and modes.table.rowCount() == 40)
    drawn: list[Any] = []
    window.director.drawn.connect(drawn.append)
    modes.errors_button.click()
    for number in range(3):
        before = len(drawn)
        window.times.go_to(0.01 * (number + 1))
        wait_until(lambda: len(drawn) > before)  # noqa: B023
        assert engine.background is not None
    modes.errors_button.click()
    assert modes.errors_button.text() == "Estimate errors"
    wait_until(lambda: settled(window))
    assert engine.background is None
    assert "±" not in modes.table.item(0, 1).text()
