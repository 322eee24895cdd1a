"""The cards of springs, masses and rigid bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

from spacemap_vtk.app.fields.places_editor import (  # noqa: E402
    MassRecord,
    PlaceRecord,
    RigidRecord,
    SpringRecord,
)
from spacemap_vtk.mechanics.boundary.fittings import MASS_UNITS, SPRING_UNITS  # noqa: E402
from spacemap_vtk.mechanics.boundary.places import parse_places  # noqa: E402


@pytest.mark.parametrize(
    ("record", "units", "text"),
    [
        (SpringRecord, SPRING_UNITS, "-z:z 100000 N/m3"),
        (SpringRecord, SPRING_UNITS, "+x:(0, 1, -1.5) 12.5 N/m"),
        (SpringRecord, SPRING_UNITS, "box(-inf, 0.001, 0, 0.02, -0.5, inf):xy 3 N/m"),
        (SpringRecord, SPRING_UNITS, "sphere(0, -0.0025, 0.001, 0.0004) 1e-3 N/m"),
        (MassRecord, MASS_UNITS, "sphere(0, 0, 0, 0.001) 5 g"),
        (MassRecord, MASS_UNITS, "mask(glued) 120 mg"),
        (RigidRecord, (), "-y"),
        (RigidRecord, (), "box(0, 0.001, -inf, inf, 0, 1)"),
    ],
)
def test_cards_keep_every_place(record: type[PlaceRecord], units: Any, text: str) -> None:
    (place,) = parse_places(text, units)
    (again,) = parse_places(record.from_place(place).text, units)
    assert again == place


def add(window: Any, name: str, kind: str) -> Any:
    """Choose a kind in the menu of "Add …", wait for the run, and return the editor."""
    editor = window.properties.rows[name].editor
    actions = editor.add_button.menu().actions()
    next(action for action in actions if action.data() == kind).trigger()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""
    return editor


def frequency(window: Any) -> float:
    return float(window.modes.response.frequencies[0])


def test_cards_add_change_and_remove_springs_and_masses(open_scene: Any) -> None:
    window = open_scene()
    document = window.document
    begin, free = document.text, frequency(window)
    window.stages.select("modal")
    springs = add(window, "springs", "-y")
    (first,) = document.value_in_file("modal", "springs")
    # As stiff as the cage in its first mode: mass times the square of the angular frequency.
    mass = vtk_to_numpy(window.view.frame.cage.GetPointData().GetArray("nodal_mass")).sum()
    place, stiffness, unit = first.split()
    assert (place, unit) == ("-y", "N/m")
    assert float(stiffness) == pytest.approx(mass * (2 * np.pi * free) ** 2, rel=0.05)
    held = frequency(window)
    assert held > 1.2 * free
    # A card for each; all of its values are rows with units.
    (card,) = springs.cards
    assert list(card.rows) == ["along", "stiffness", "foundation"]
    line = card.rows["stiffness"].editor.line
    line.setText("1 furlong")
    QTest.keyClick(line, Qt.Key.Key_Return)
    assert "furlong" in window.errors.text
    assert document.value_in_file("modal", "springs") == [first]
    line.setText("1 N/m")
    QTest.keyClick(line, Qt.Key.Key_Return)
    assert window.errors.text == ""
    assert document.value_in_file("modal", "springs") == ["-y 1 N/m"]
    # A stiffness per area replaces that of the whole side.
    card.rows["foundation"].editor.edited.emit("2e6 N/m3", 0)
    assert document.value_in_file("modal", "springs") == ["-y 2000000 N/m3"]
    card.remove_button.click()
    wait_until(lambda: settled(window))
    assert springs.cards == []
    assert frequency(window) == pytest.approx(free)
    add(window, "masses", "sphere")
    assert frequency(window) < free
    for _ in range(document.history.index()):
        document.history.undo()
    assert document.text == begin


@pytest.mark.nightly
def test_rigid_side_and_other_shapes_run(open_scene: Any) -> None:
    window = open_scene()
    window.stages.select("modal")
    for name, kind in (("rigid", "-y"), ("springs", "sphere"), ("masses", "box")):
        editor = add(window, name, kind)
        assert len(editor.cards) == 1
    (card,) = window.properties.rows["springs"].editor.cards
    card.kind.setCurrentIndex(card.kind.findData("+x"))
    card.kind.activated.emit(card.kind.currentIndex())
    wait_until(lambda: settled(window))
    (text,) = window.document.value_in_file("modal", "springs")
    assert text.startswith("+x ")
