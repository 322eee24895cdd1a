"""A cage of sheet elements: its figures, its equilibrium, and its colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, scene_of, settled, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

from spacemap_vtk.datasets.arrays import points_of  # noqa: E402
from spacemap_vtk.filters.load import DEAD_ACTIONS  # noqa: E402
from spacemap_vtk.scenes import report  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

#: Four cells of 20 mm by 20 mm, fixed at the left; the free end sags.
STRIP = """
[weave]
ends = 40
picks = 10
warp_spacing = "2 mm"
weft_spacing = "2 mm"
warp_diameter = "0.5 mm"
weft_diameter = "0.5 mm"
[cage]
divisions = [8, 2, 1]
[modal]
modes = 3
fixed = "-x"
gravity = [0, 0, -9.80665]
tensile_rigidity = "1 kN/m"
bending_rigidity = ["12 uN.m", "8 uN.m"]
areal_mass = "150 g/m2"
[surface]
subdivisions = 1
"""


@pytest.fixture
def strip(tmp_path: Path) -> Path:
    file = tmp_path / "strip.toml"
    file.write_text(STRIP)
    return file


def equilibrium(window: Any) -> np.ndarray | None:
    array = window.view.frame.cage.GetPointData().GetArray("equilibrium")
    return None if array is None else vtk_to_numpy(array)


def notes_of(window: Any) -> dict[str, str]:
    rows = window.properties.rows
    return {name: row.note.text() for name, row in rows.items() if not row.isHidden()}


def test_properties_show_the_figures_of_the_sheet(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    window.stages.select("modal")
    found, shown_notes = report.report_modes(Scene.read(strip))["sheet"], notes_of(window)
    assert shown_notes["elements"] == "in use: sheet"  # "auto" has decided
    assert shown_notes["bending_rigidity"] == (
        "in use: warp 12 µN·m (0.1224 gf.cm²/cm), weft 8 µN·m (0.08158 gf.cm²/cm)"
    )
    assert shown_notes["areal_mass"] == "in use: 150 g/m² (4.424 oz/yd²)"
    warp, weft = (f"{1e3 * c:.4g} mm ({1e2 * c:.4g} cm)" for c in found["bending_length"])
    assert shown_notes["bending_length"] == f"in use: warp {warp}, weft {weft}"
    assert f"bending length warp {warp}, weft {weft}" in window.modes.sheet.text()
    for name in found:
        assert shown_notes[name].startswith("in use: ")
    assert not window.properties.rows["material"].note.text()
    headings = window.properties.groups
    assert list(headings) == ["Sheet", "Hung"]
    assert all(heading.isVisibleTo(window) for heading in headings.values())


@pytest.mark.nightly
def test_properties_of_what_is_no_sheet_are_hidden(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    window.stages.select("modal")
    headings = window.properties.groups
    # With two layers it is not a sheet: parameters of sheets are hidden unless they are written.
    window.document.set("cage", "divisions", [8, 2, 2])
    wait_until(lambda: settled(window) and "tetrahedra" in notes_of(window)["elements"])
    shown_notes = notes_of(window)
    assert not {"shear_rigidity", "bending_length", "twisting_rigidity"} & shown_notes.keys()
    assert shown_notes["bending_rigidity"] == "no effect: the cage is not a sheet"
    assert "tetrahedra" in window.modes.sheet.text()
    window.document.set("modal", "elements", "tetrahedra")
    wait_until(lambda: settled(window) and notes_of(window)["elements"] == "")  # the field shows it
    window.document.history.undo()
    wait_until(lambda: settled(window))
    assert headings["Sheet"].isVisibleTo(window)  # written values stay
    for name in ("tensile_rigidity", "bending_rigidity", "areal_mass"):
        window.document.set("modal", name, None)
    wait_until(lambda: settled(window))
    assert not headings["Sheet"].isVisibleTo(window)
    assert headings["Hung"].isVisibleTo(window)
    for _ in range(4):
        window.document.history.undo()
    wait_until(lambda: settled(window) and "bending_length" in notes_of(window))
    supports, times = window.tools.part_actions["supports"], window.times
    assert all((supports.isEnabled(), supports.isChecked(), times.isEnabled()))
    play = times.play.toolTip()
    # Figures of the former scene are not shown.
    window.document.open("handweaving")
    wait_until(lambda: settled(window))
    # That scene has no supports and no motion.
    assert not any((supports.isEnabled(), supports.isChecked(), times.isEnabled()))
    assert "no supports" in supports.toolTip()
    assert "does not move" in times.play.toolTip()
    assert not window.menus.time.isEnabled()
    window.document.switch("response")
    assert all((supports.isEnabled(), supports.isChecked(), times.isEnabled()))
    assert times.play.toolTip() == play != times.toolTip() == ""
    window.document.history.undo()
    assert not times.isEnabled()
    window.stages.select("modal")
    assert not any("in force" in row.note.text() for row in window.properties.rows.values())
    assert not window.modes.sheet.isVisible()


@pytest.mark.nightly
def test_automatic_off_starts_with_the_value_in_use(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    window.document.set("modal", "bending_rigidity", None)
    window.stages.select("modal")
    wait_until(lambda: settled(window) and "warp" not in notes_of(window)["bending_rigidity"])
    before, row = notes_of(window), window.properties.rows["bending_length"]
    wait_until(lambda: row.automatic_value is not None)
    row.automatic.click()
    wait_until(lambda: settled(window))
    assert window.document.scene.modal.bending_length is not None
    assert notes_of(window)["bending_rigidity"] == before["bending_rigidity"]
    assert window.errors.text == ""


def test_hang_button_switches_the_equilibrium(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    hang = window.tools.hang
    assert hang.isChecked()
    hung = equilibrium(window)
    assert hung is not None
    assert hung[:, 2].min() < -0.03
    # The ghost is the undeformed cloth: flat, with its full length.
    window.tools.part_actions["ghost"].trigger()
    wait_until(lambda: settled(window))
    ghost = window.view.scene_view.ghost.GetMapper().GetInput()
    assert np.ptp(points_of(ghost)[:, 2]) < 1.1e-3
    assert np.ptp(points_of(window.view.frame.surface)[:, 2]) > 0.03
    frequency = window.modes.table.item(0, 1).text()
    for undone in (False, True):
        hang.trigger()
        wait_until(lambda: settled(window) and equilibrium(window) is None)
        assert not hang.isChecked()
        assert np.ptp(points_of(window.view.frame.surface)[:, 2]) < 1.1e-3
        assert window.modes.table.item(0, 1).text() != frequency
        # Its loads stay.
        assert window.document.scene.modal.gravity == (0.0, 0.0, -9.80665)
        if undone:
            window.document.history.undo()
        else:
            hang.trigger()
        wait_until(lambda: settled(window) and equilibrium(window) is not None)
        np.testing.assert_allclose(equilibrium(window), hung, rtol=0, atol=1e-9)
        assert window.modes.table.item(0, 1).text() == frequency
        assert "hang" not in window.document.values["modal"]


@pytest.mark.nightly
def test_hang_uses_the_gravity_of_the_motion(open_scene: Any, strip: Path) -> None:
    strip.write_text(
        STRIP.replace("gravity = [0, 0, -9.80665]", "") + "[response]\ngravity = [0, -1.6, 0]\n"
    )
    window = open_scene(str(strip))
    assert not window.tools.hang.isChecked()
    window.tools.hang.trigger()
    wait_until(lambda: settled(window) and equilibrium(window) is not None)
    assert window.document.values["modal"]["gravity"] == [0, -1.6, 0]
    window.document.open("calculix_fabric")  # its motion is read from a file
    wait_until(lambda: settled(window))
    assert not window.tools.hang.isEnabled()


@pytest.mark.nightly
def test_dead_load_can_be_added_and_has_no_time_function(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    window.stages.select("modal")
    row, before = window.properties.rows["dead_loads"], equilibrium(window)
    choices = [action.data() for action in row.editor.add_button.menu().actions()]
    assert choices == list(DEAD_ACTIONS)
    row.editor.add_button.menu().actions()[choices.index("pressure")].trigger()
    (card,) = row.editor.cards
    assert list(card.rows) == ["pressure", "on"]
    assert [card.kind.itemData(k) for k in range(card.kind.count())] == list(DEAD_ACTIONS)
    wait_until(lambda: settled(window) and (equilibrium(window) != before).any())
    assert window.errors.text == ""
    card.remove_button.click()
    wait_until(lambda: settled(window))
    np.testing.assert_array_equal(equilibrium(window), before)


@pytest.mark.nightly
def test_equilibrium_displacement_can_be_shown_in_colour(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    bar = window.view.scene_view.surface.color_bar
    sag = np.linalg.norm(equilibrium(window), axis=1).max()
    titles = {"equilibrium": "Displacement\nequilibrium", "displacement": "Displacement"}
    for name, title in titles.items():
        assert window.tools.colorings[name].isVisible()
        window.tools.colorings[name].trigger()
        wait_until(lambda name=name: settled(window) and window.view.frame.color == name)
        assert bar.GetTitle().startswith(title)
        assert bar.GetTitle().endswith("[mm]")
        shown = vtk_to_numpy(window.view.frame.surface.GetPointData().GetArray("in unit"))
        assert shown.max() == pytest.approx(1e3 * sag, rel=0.02)
        assert bar.GetLookupTable().GetTableRange() == pytest.approx((0, 200))  # a round number
    window.tools.hang.trigger()
    wait_until(lambda: settled(window) and equilibrium(window) is None)
    assert not window.tools.colorings["equilibrium"].isVisible()


# test_equilibrium.py cancels the search, and test_window_cancel.py the other long stages.
@pytest.mark.nightly
def test_equilibrium_reports_progress_and_can_be_cancelled(open_window: Any, strip: Path) -> None:
    window = open_window(str(strip))
    frame = window.view.frame
    window.document.set("cage", "divisions", [120, 60, 1])
    wait_until(lambda: window.running_label.text() == "Modal solver: hanging")
    wait_until(lambda: 0 < window.progress_bar.value() < 100)
    assert window.progress_bar.maximum() == 100
    QTest.mouseClick(window.cancel_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: not window.engine.busy)
    wait_until(lambda: window.stages.states["modal"] == "stale")
    assert window.view.frame is frame
    assert window.errors.text == "The run was cancelled: the picture is older than the values."
    # Partial results are not used.
    window.document.history.undo()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""
    assert window.view.frame.cage.GetNumberOfPoints() == 54
    assert scene_of(window).modal.is_hung
    np.testing.assert_array_equal(
        equilibrium(window), vtk_to_numpy(frame.cage.GetPointData().GetArray("equilibrium"))
    )


@pytest.mark.nightly
def test_colouring_is_reset_when_its_quantity_disappears(open_scene: Any, strip: Path) -> None:
    window = open_scene(str(strip))
    before = window.document.text
    window.document.set("view", "color", "equilibrium")
    wait_until(lambda: settled(window) and window.view.frame.color == "equilibrium")
    colored = window.document.text
    window.tools.hang.trigger()
    wait_until(lambda: settled(window) and window.view.frame.color == "own")
    assert window.errors.text == ""
    assert "Displacement, equilibrium" in window.statusBar().currentMessage()
    assert window.document.value_in_file("view", "color") is None
    assert not window.tools.hang.isChecked()
    # Undo restores the equilibrium and its colours together.
    window.document.history.undo()
    wait_until(lambda: settled(window) and window.view.frame.color == "equilibrium")
    assert window.document.text == colored
    window.document.history.undo()
    assert window.document.text == before
