"""The plan tab: its plan is that of the command line, and follows the fields and the scene."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtGui import QGuiApplication  # noqa: E402
from PySide6.QtWidgets import QFileDialog  # noqa: E402

from spacemap_vtk.scenes.plan import plan_scene  # noqa: E402
from spacemap_vtk.scenes.plan_settings import PlanSettings  # noqa: E402
from spacemap_vtk.scenes.plan_tables import plan_as_csv  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def type_text(window: Any, name: str, text: str) -> None:
    window.plan.fields[name].setText(text)
    window.plan.fields[name].editingFinished.emit()


def wait_for_plan(window: Any) -> None:
    plan = window.plan
    wait_until(lambda: plan._is_complete and not plan._rest_timer.isActive())


def copied_rows(window: Any) -> dict[str, list[str]]:
    window.plan.copy_button.click()
    lines = QGuiApplication.clipboard().text().splitlines()
    return {name: cells for name, *cells in (line.split("\t") for line in lines if line)}


def test_the_plan_is_that_of_the_command_line(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene("twill_2_2")
    plan = window.plan
    window.tabs.setCurrentWidget(plan)
    # Numbers without a unit are in those of the switch.
    for name, text in (("width", "50"), ("length", "0.7 m"), ("warp_yarn", "8/2 Cotton")):
        type_text(window, name, text)
    type_text(window, "draw_in", "6")
    assert plan.fields["width"].text() == "50 cm"
    assert plan.fields["draw_in"].text() == "6 %"
    wait_for_plan(window)
    chosen = PlanSettings(width=0.5, length=0.7, warp_yarn="8/2 cotton", draw_in=0.06)
    expected = plan_as_csv(plan_scene(Scene.read("twill_2_2"), chosen), "\t")
    plan.copy_button.click()
    assert QGuiApplication.clipboard().text() == expected
    shown = plan.result.toPlainText()
    assert copied_rows(window)["warp length"][0] in shown
    assert "#4f7cac" not in shown  # a sample of the colour
    # The file, by the same job as the command's.
    file = tmp_path / "plan.csv"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    plan.buttons[".csv"].click()
    wait_until(lambda: not window.exports.busy)
    rows = list(csv.reader(file.read_text().splitlines()))
    assert rows == list(csv.reader(expected.splitlines(), delimiter="\t"))


def test_the_plan_follows_fields_units_and_scene(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    plan = window.plan
    window.tabs.setCurrentWidget(plan)
    type_text(window, "width", "60 cm")
    type_text(window, "warp_yarn", "8/2 cotton")
    wait_for_plan(window)
    before = copied_rows(window)
    plan.units.setCurrentText("imperial")
    plan.units.activated.emit(1)
    wait_until(lambda: "epi" in copied_rows(window)["sett in the reed"])
    assert float(copied_rows(window)["width in the reed"][0]) * 2.54 == pytest.approx(
        float(before["width in the reed"][0]), rel=0.05
    )
    assert "24" in copied_rows(window)["sett in the reed"]
    window.document.set("weave", "pattern", "plain")
    wait_until(lambda: "20" in copied_rows(window)["sett in the reed"])
    # A refused text is marked, and the plan stays until it is corrected.
    type_text(window, "length", "-3 cm")
    assert plan.fields["length"].property("bad")
    assert "Length" in plan.hint.text()
    assert ", in inches or with its unit" in plan.hint.text()  # as for a text without a unit
    assert "20" in copied_rows(window)["sett in the reed"]
    type_text(window, "length", "")
    assert not plan.fields["length"].property("bad")
    assert "without a unit" in plan.hint.text()


@pytest.mark.nightly
def test_the_tab_is_absent_for_what_is_not_woven(open_scene: Any) -> None:
    window = open_scene("plain_weave")
    place = window.tabs.indexOf(window.plan)
    assert window.tabs.isTabVisible(place)
    window.document.open("tube_bundle")
    wait_until(lambda: settled(window))
    assert not window.tabs.isTabVisible(place)
    window.document.open("plain_weave")
    wait_until(lambda: settled(window))
    assert window.tabs.isTabVisible(place)
