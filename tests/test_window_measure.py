"""The measure tab: its figures are those of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtWidgets import QFileDialog  # noqa: E402

from spacemap_vtk.scenes.laboratory import measure_scene  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

COTTON = """[weave]
ends = 4
picks = 4
warp_spacing = "0.5 mm"
weft_spacing = "0.5 mm"
warp_count = "30 tex"
weft_count = "30 tex"
[yarns]
inextensible = false
modulus = "300 cN/tex"
bending = "2 mN.mm2"
flattest = 1
"""


def test_the_figures_are_those_of_the_command_line(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tmp_path / "cotton.toml"
    scene.write_text(COTTON, encoding="utf-8")
    window = open_scene(str(scene))
    tab = window.measure
    window.tabs.setCurrentWidget(tab)
    tab.tests.setCurrentIndex(tab.tests.findData("bending"))
    assert "KES-FB2" in tab.hint.text()
    tab.run_button.click()
    wait_until(lambda: tab.run_button.text() == "Measure")
    assert tab.result is not None
    measurement = measure_scene(Scene.read(scene), "bending")[0].measurement
    assert measurement is not None
    shown = [tab.table.item(row, 3).text() for row in range(tab.table.rowCount())]
    assert shown == [reading.text for reading in measurement.readings]
    assert "2HB is not modelled" in tab.notes.text()
    assert len(tab.canvas.figure.axes[0].lines) == 4  # two curves, and both zeros
    saved: list[tuple[str, Path, str]] = []
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "b.csv"), ""))
    monkeypatch.setattr(window.exports, "start", lambda *job, test: saved.append((*job, test)))
    tab.save_actions[".csv"].trigger()
    assert saved == [("measurement", tmp_path / "b.csv", "bending")]


def test_a_cloth_without_stiffness_is_offered_cotton_yarns(open_scene: Any) -> None:
    window = open_scene("plain_weave")
    tab = window.measure
    window.tabs.setCurrentWidget(tab)
    tab.run_button.click()
    wait_until(lambda: tab.run_button.text() == "Measure")
    assert "stiffness of the yarns" in tab.notes.text()
    assert tab.result is None
    before = window.document.text
    tab.cotton_button.click()
    assert window.document.scene.parts["yarns"].modulus is not None
    wait_until(lambda: settled(window))
    tab.tests.setCurrentIndex(tab.tests.findData("bending"))
    tab.run_button.click()
    wait_until(lambda: tab.run_button.text() == "Measure")
    assert tab.result is not None
    wait_until(lambda: tab.canvas.height() > 100)
    assert not tab.cotton_button.isVisible()
    window.document.history.undo()
    assert window.document.text == before
