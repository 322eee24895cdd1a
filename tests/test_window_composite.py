"""The composite tab: constants as by the command line, and slices of the voxels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtWidgets import QFileDialog  # noqa: E402

from spacemap_vtk.draw.actors.unit_cell_actors import shown_voxels  # noqa: E402
from spacemap_vtk.scenes.composite import compute_constants, constant_rows  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def test_the_constants_are_those_of_the_command_line(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene("plain_weave")
    tab, document = window.composite, window.document
    assert window.tabs.indexOf(tab) < 0
    window.show_composite.trigger()
    assert window.tabs.currentWidget() is tab
    document.set("unit_cell", "voxels", 16)
    tab.fibre.setCurrentIndex(tab.fibre.findData("carbon_t300"))
    tab.fibre.activated.emit(tab.fibre.currentIndex())
    assert document.scene.parts["unit_cell"].fibre == "carbon_t300"
    assert not tab.slider.isEnabled()
    tab.run_button.click()
    wait_until(lambda: tab.run_button.text() == "Compute")
    assert tab.result is not None
    scene = Scene.read("plain_weave")
    scene.set("unit_cell.voxels=16")
    scene.set("unit_cell.fibre=carbon_t300")
    rows = constant_rows(compute_constants(scene))
    shown = [tab.table.item(line, 1).text() for line in range(tab.table.rowCount())]
    assert shown == [value for _, value, *_ in rows]
    # The slices are those of the voxels, and stresses have their own scale.
    tab.content.setCurrentIndex(tab.content.findData("fraction"))
    tab.plane.setCurrentIndex(tab.plane.findData("x"))
    tab.slider.setValue(3)
    picture = tab.canvas.figure.axes[0].images[0].get_array()
    np.testing.assert_array_equal(picture, tab.result[1].voxels.fraction[:, :, 3])
    tab.content.setCurrentIndex(tab.content.findData("stress"))
    assert not tab.load.isHidden()
    assert "GPa" in tab.canvas.figure.axes[1].get_ylabel()
    tab.content.setCurrentIndex(tab.content.findData("moduli"))
    assert tab.slider.isHidden()
    # The view shows the cell, its slice and the chosen voxels, until the switch is off.
    tab.content.setCurrentIndex(tab.content.findData("strain_xx"))
    tab.in_view.setChecked(True)
    tab.voxels.setCurrentIndex(tab.voxels.findData("value"))
    tab.threshold.setValue(30)
    cell, look = window.view.cell, tab.look
    model = tab.result[1]
    strain = model.fields["strain_xx"][:, 0].reshape(model.voxels.fraction.shape)
    np.testing.assert_array_equal(
        shown_voxels(model, look)[..., : look.index], strain[..., : look.index] >= look.threshold
    )
    assert not shown_voxels(model, look)[..., look.index :].any()
    assert f"{look.threshold:.3g}" in tab.threshold_text.text()
    assert not window.view.scene_view.surface.GetVisibility()
    assert cell.slice.GetVisibility()
    document.set("view", "camera", "front")
    wait_until(lambda: settled(window))
    assert not window.view.scene_view.surface.GetVisibility()
    tab.in_view.setChecked(False)
    assert window.view.cell is None
    assert window.view.scene_view.surface.GetVisibility()
    assert not tab.voxels.isEnabled()
    document.history.undo()
    assert tab.minimumSizeHint().width() <= 266
    # Another fibre makes them old; undo brings the first one back.
    document.history.undo()
    assert tab.fibre.currentData() == "e_glass"
    assert "changed" in tab.notes.text()
    saved: list[tuple[Any, ...]] = []
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "c.vti"), ""))
    monkeypatch.setattr(window.exports, "start", lambda *job: saved.append(job))
    tab.save_button.menu().actions()[1].trigger()
    assert saved == [("unit_cell", tmp_path / "c.vti")]


def test_a_knit_is_put_into_a_matrix_by_one_button(open_scene: Any) -> None:
    window = open_scene("stockinette")
    window.show_composite.trigger()
    window.document.set("unit_cell", "voxels", 16)
    window.document.set("unit_cell", "thickness", 0.01)
    tab = window.composite
    tab.run_button.click()
    wait_until(lambda: tab.run_button.text() == "Compute")
    wait_until(lambda: settled(window))
    assert window.errors.text == ""
    assert tab.result is not None
    # A mould that is higher than the knit is reported.
    assert "unit_cell.height" in tab.notes.text()


def test_a_scene_without_a_cage_is_drawn_with_a_unit_cell(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    wait_until(lambda: settled(window))
    window.document.set_many("weave", {"ends": 8, "picks": 8})
    window.document.set("unit_cell", "voxels", 16)
    wait_until(lambda: settled(window) and window.view.frame.values == window.document.values)
    assert window.errors.text == ""
    assert window.view.scene_view.surface.GetVisibility()


def test_a_tube_is_refused_without_the_name_of_a_file(open_scene: Any) -> None:
    window = open_scene("tubular_braid")
    window.show_composite.trigger()
    window.composite.run_button.click()
    wait_until(lambda: window.composite.run_button.text() == "Compute")
    assert window.composite.notes.text().startswith("a unit cell needs a textile")
