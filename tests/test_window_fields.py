"""Fields for each kind of value: vectors, sides, patterns, colours, loads."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from window import drag, require_display, scene_of, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtGui import QColor  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QColorDialog  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

from spacemap_vtk.datasets.arrays import points_of  # noqa: E402
from spacemap_vtk.datasets.modal_model import contact_of  # noqa: E402
from spacemap_vtk.filters.obstacle import SHAPES  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.pipeline import section_classes  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def editor(window: Any, section: str, name: str) -> Any:
    window.stages.select(section)
    row = window.properties.rows[name]
    window.properties.ensureWidgetVisible(row)
    return row.editor


def click(widget: Any, at: Any = None) -> None:
    QTest.mouseClick(widget, Qt.MouseButton.LeftButton, pos=at or widget.rect().center())


@pytest.mark.nightly
def test_vector_component_can_be_dragged(open_scene: Any) -> None:
    window = open_scene()
    gravity = editor(window, "response", "gravity")
    before = window.document.scene.response.gravity
    drag(gravity.components[1].slider, 8)
    wait_until(lambda: settled(window))
    after = window.document.scene.response.gravity
    assert after[1] > before[1]
    assert (after[0], after[2]) == (before[0], before[2])
    assert window.document.history.count() == 1
    assert [c.line.text() for c in gravity.components] == [f"{v:.6g}" for v in after]


@pytest.mark.nightly
def test_vector_component_accepts_a_unit_and_refuses_a_word(open_scene: Any) -> None:
    window = open_scene()
    gravity = editor(window, "response", "gravity")
    type_into(gravity.components[2].line, "-1 g")
    assert window.document.scene.response.gravity[2] == -9.80665
    type_into(gravity.components[2].line, "down")
    assert window.properties.rows["gravity"].property("bad")
    assert "gravity" in window.errors.text
    assert window.document.scene.response.gravity[2] == -9.80665


def test_sides_are_fixed_by_clicking(open_scene: Any) -> None:
    window = open_scene()
    fixed = editor(window, "modal", "fixed")
    assert [s for s, b in fixed.sides.items() if b.isChecked()] == ["+y"]
    click(fixed.sides["-y"])
    assert set(window.document.scene.modal.fixed) == {"+y", "-y"}
    wait_until(lambda: settled(window))
    flags = window.view.frame.cage.GetPointData().GetArray("fixed")
    assert sum(flags.GetTuple1(i) for i in range(72)) == 24
    click(fixed.sides["+y"])
    assert window.document.scene.modal.fixed == ("-y",)
    # Other places can be typed, and a click does not change them.
    type_into(fixed.line, "sphere(0, 0, 0, 1 mm):z")
    click(fixed.sides["-x"])
    assert window.document.scene.modal.fixed == ("-x", "sphere(0,0,0,0.001):z".replace(",", ", "))
    type_into(fixed.line, "top")
    assert window.properties.rows["fixed"].property("bad")


def test_pattern_can_be_painted_with_the_mouse(open_scene: Any) -> None:
    window = open_scene()
    pattern = editor(window, "weave", "pattern")
    pattern.box.setCurrentText("")
    pattern.line.setFocus()
    QTest.keyClicks(pattern.line, "twill 2/2")
    QTest.keyClick(pattern.line, Qt.Key.Key_Return)
    assert window.document.scene.source.pattern == "twill 2/2"
    repeat = pattern.grid.repeat.copy()
    assert repeat.shape == (4, 4)
    # One stroke over a row is one undo step.
    count = window.document.history.count()
    start = pattern.grid.square_rect(0, 0).center().toPoint()
    step = QPoint(round(pattern.grid.cell), 0)
    QTest.mousePress(pattern.grid, Qt.MouseButton.LeftButton, pos=start)
    for k in range(1, 3):
        QTest.mouseMove(pattern.grid, start + k * step)
        QTest.qWait(20)
    QTest.mouseRelease(pattern.grid, Qt.MouseButton.LeftButton, pos=start + 2 * step)
    wait_until(lambda: settled(window))
    rows = window.document.scene.source.pattern
    assert rows[0][:3] == ("0" if repeat[0, 0] else "1") * 3
    assert rows[1:] == tuple("".join("01"[int(c)] for c in row) for row in repeat[1:])
    assert window.document.history.count() == count + 1
    drawdown = scene_of(window).woven.cloth.drawdown
    np.testing.assert_array_equal(drawdown[:4, :4], pattern.grid.repeat)
    click(pattern.buttons["+ end"])
    assert pattern.grid.repeat.shape == (4, 5)
    click(pattern.buttons["− pick"])
    assert pattern.grid.repeat.shape == (3, 5)


@pytest.mark.nightly
def test_swatch_opens_a_dialog_with_its_colour(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene("tartan", wait=False)
    colors = editor(window, "weave", "warp_color")
    colors_before: list[str] = []

    def choose(before: QColor, *_: Any) -> QColor:
        colors_before.append(before.name())
        return QColor("#010203")

    monkeypatch.setattr(QColorDialog, "getColor", choose)
    before = window.document.scene.source.warp_color
    click(colors.swatches, colors.swatches.swatch_rect(6).center().toPoint())
    after = window.document.scene.source.warp_color
    assert colors_before == ["#3d5fa8"]
    assert after[6] == (1, 2, 3)
    assert [c for k, c in enumerate(after) if k != 6] == [c for k, c in enumerate(before) if k != 6]


def test_automatic_values_in_use_are_shown(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene("plain_weave")
    colors = editor(window, "weave", "weft_color")
    window.document.set("weave", "weft_color", None)
    wait_until(lambda: colors.swatches.colors == ["#e8c78f"])
    colors_before: list[str] = []
    monkeypatch.setattr(
        QColorDialog, "getColor", lambda before, *_: colors_before.append(before.name()) or QColor()
    )
    click(colors.swatches, colors.swatches.swatch_rect(0).center().toPoint())
    assert colors_before == ["#e8c78f"]
    window.properties.rows["weft_color"].automatic.click()
    assert window.document.value_in_file("weave", "weft_color") == "#e8c78f"
    # Without a value, the line takes the place of the slider.
    gap = editor(window, "weave", "layer_gap")
    assert not gap.slider.isVisibleTo(gap)
    window.document.set("weave", "layer_gap", "0.1 mm")
    assert gap.slider.isVisibleTo(gap)
    # Equal values of warp and weft are shown as one number.
    window.document.set_many("modal", {"elements": "sheet", "tensile_rigidity": None})
    window.stages.select("modal")
    row = window.properties.rows["tensile_rigidity"]
    wait_until(lambda: row.automatic_value is not None)
    assert row.editor.line.placeholderText() == "0.65 N/m"
    wait_until(lambda: settled(window))


@pytest.mark.nightly
def test_new_fabric_shows_automatic_values_at_once(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    ends = editor(window, "weave", "ends")
    window.properties._next_limits = (
        perf_counter() + 60.0
    )  # as after limits that took long to compute
    window.gallery.new_button.click()
    wait_until(lambda: settled(window))
    assert ends.line.text() == ""
    assert ends.line.placeholderText() == "7"


def test_loads_can_be_added_changed_and_removed(open_scene: Any) -> None:
    window = open_scene()
    loads = editor(window, "response", "loads")
    for action in loads.add_button.menu().actions():
        action.trigger()
        if action.data() == "array":
            # There is no such array, which is reported.
            wait_until(lambda: window.errors.text)
            assert "force" in window.errors.text
            loads.cards[-1].remove_button.click()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""
    actions = [load.action for load in window.document.scene.response.loads]
    assert actions == [a.data() for a in loads.add_button.menu().actions() if a.data() != "array"]
    functions = ("pulse", "ramp", "table", "harmonic", "periodic", "step")
    for card in range(len(loads.cards)):
        for time in functions[: None if card == 0 else 2]:
            box = loads.cards[card].rows["time"].editor.box
            box.setCurrentText(time)
            box.activated.emit(box.currentIndex())
            assert window.errors.text == ""
            assert window.document.scene.response.loads[card].time == time
    type_into(loads.cards[0].rows["pressure"].editor.line, "3 kPa")
    assert window.document.scene.response.loads[0].pressure == 3000.0
    while loads.cards:
        loads.cards[0].remove_button.click()
    assert window.document.scene.response.loads == ()
    wait_until(lambda: settled(window))


def test_grips_have_cards_whose_motion_has_a_time_function(open_scene: Any) -> None:
    window = open_scene("plain_weave")
    cards = editor(window, "modal", "grips")
    actions = cards.add_button.menu().actions()
    next(each for each in actions if each.data() == "-y").trigger()
    wait_until(lambda: len(window.document.scene.modal.grips) == 1)
    cards.change(0, {"displacement": [0, 0, "1 mm"], "time": "ramp", "rise": "1 s"})
    (grip,) = window.document.scene.modal.grips
    assert grip.place == ("-y",)
    assert grip.motion["rise"] == 1.0
    assert {"time", "rise"} < set(cards.cards[0].rows)
    cards.cards[0].rows["displacement"].edited.emit("displacement", None, 0)
    assert window.document.scene.modal.grips[0].motion is None
    cards.cards[0].remove_button.click()
    assert window.document.scene.modal.grips == ()


@pytest.mark.parametrize("count", [2, pytest.param(len(SHAPES), marks=pytest.mark.nightly)])
def test_obstacles_have_cards_as_loads_have(open_scene: Any, count: int) -> None:
    window = open_scene()
    window.document.set_many("cage", {"divisions": [2, 2, 1]})
    window.document.set("modal", "hang", False)  # no equilibrium: it would take a second each time
    cards = editor(window, "modal", "obstacles")
    for action in cards.add_button.menu().actions()[:count]:
        if action.data() != "mesh":
            action.trigger()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""
    found = window.document.scene.modal.obstacles
    assert [each.shape for each in found] == [s for s in list(SHAPES)[:count] if s != "mesh"]
    width = np.ptp(points_of(window.document.scene.cage.output), axis=0).max()
    assert found[1].radius == pytest.approx(0.25 * width, rel=0.1)
    assert window.view.scene_view.bodies.GetVisibility()
    type_into(cards.cards[1].rows["friction"].editor.line, "0.4")
    assert window.document.scene.modal.obstacles[1].friction == 0.4
    assert 'shape = "plane"' in window.document.text  # although that is the default
    wait_until(lambda: settled(window))
    _drag_handle(window, 1, 0)
    # Another shape keeps place and friction; a displacement brings its time function.
    box = cards.cards[1].kind
    box.setCurrentIndex(box.findData("disc"))
    box.activated.emit(box.currentIndex())
    disc = window.document.scene.modal.obstacles[1]
    assert (disc.shape, disc.center, disc.friction) == ("disc", found[1].center, 0.4)
    while cards.cards:
        cards.cards[0].remove_button.click()
    wait_until(lambda: settled(window))
    assert window.document.scene.modal.obstacles == ()
    assert not window.view.scene_view.bodies.GetVisibility()


def _drag_handle(window: Any, number: int, axis: int) -> None:
    """Drag an arrow of an obstacle's handle, once given up with Esc, and undo it."""
    canvas, history, left = window.view.canvas, window.document.history, Qt.MouseButton.LeftButton
    editor(window, "modal", "obstacles").select(number)
    canvas.image()  # gives the handle its size
    handle, before = window.view.obstacles.handle, window.document.scene.modal.obstacles[number]
    ends = np.array(before.center) + np.outer(
        [0.7, 1.3], np.eye(3)[axis] * handle.arrows.GetScale()
    )
    ratio, steps = canvas.devicePixelRatioF(), history.count()
    x, y = (np.array([handle.project(end) for end in ends]) / ratio).T
    begin, end = (
        QPoint(round(a), round(canvas.height() - 1 - b)) for a, b in zip(x, y, strict=True)
    )
    for given_up in (True, False):
        QTest.mousePress(canvas, left, pos=begin)
        QTest.mouseMove(canvas, end)
        assert handle.obstacle.center[axis] > before.center[axis]  # before the scene changes
        assert window.document.scene.modal.obstacles[number] == before
        if given_up:
            QTest.keyClick(canvas, Qt.Key.Key_Escape)
            assert handle.obstacle == before
        QTest.mouseRelease(canvas, left, pos=end)
        assert history.count() == steps + (not given_up)
    now = window.document.scene.modal.obstacles[number]
    moved = np.array(now.center) - before.center
    assert moved[axis] == pytest.approx(ends[1, axis] - ends[0, axis], rel=0.1)
    assert np.delete(moved, axis) == pytest.approx([0.0, 0.0])
    assert (now.radius, now.friction) == (before.radius, before.friction)
    assert not window.view.picks
    history.undo()
    assert window.document.scene.modal.obstacles[number] == handle.obstacle == before
    QTest.keyClick(canvas, Qt.Key.Key_Escape)
    assert handle.obstacle is None
    wait_until(lambda: settled(window))


def test_cloth_let_go_falls_on_obstacles(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    assert not window.tools.let_go.isEnabled()
    assert "obstacle" in window.tools.let_go.toolTip()
    window.document.set_many("cage", {"divisions": [3, 3, 1]})
    window.document.set("modal", "elements", "sheet")
    ground = [{"shape": "plane", "center": [0, 0, "-1 mm"], "friction": 0.3}]
    window.document.set_many("modal", {"obstacles": ground, "gravity": [0, 0, -9.81]})
    wait_until(lambda: settled(window))
    assert window.tools.let_go.isEnabled()
    shown = vtk_to_numpy(window.view.frame.cage.GetPointData().GetArray("displacement")).copy()
    window.tools.let_go.trigger()
    wait_until(lambda: settled(window))
    # It falls from the state that was shown, which is saved with the scene.
    window.document.save(tmp_path / "dropped.toml")
    state = Scene.read(tmp_path / "dropped.toml").modal.start
    assert state.parent == tmp_path
    assert pv.read(state)["displacement"] == pytest.approx(shown, abs=1e-12)
    assert window.errors.text == ""
    assert window.document.scene.modal.fixed == ()
    (contact,) = contact_of(window.view.frame.cage)
    weight = 9.81 * vtk_to_numpy(window.view.frame.cage.GetPointData().GetArray("nodal_mass")).sum()
    assert np.linalg.norm(contact.force) == pytest.approx(weight, rel=0.01)


@pytest.mark.nightly
def test_changing_a_load_keeps_the_comments_around_it(open_scene: Any) -> None:
    window = open_scene("gust")
    before = (library.folder() / "gust.toml").read_text().splitlines()
    loads = editor(window, "response", "loads")
    type_into(loads.cards[0].rows["pressure"].editor.line, "1.2 Pa")
    after = window.document.text.splitlines()
    changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0][1].split("#")[0].strip() == 'pressure = "1.2 Pa"'
    assert changed[0][1].endswith("# from behind")


@pytest.mark.parametrize("scene", ["plain_weave", pytest.param("gust", marks=pytest.mark.nightly)])
def test_reset_restores_every_default(open_scene: Any, scene: str) -> None:
    window = open_scene(scene)
    for section in section_classes():
        window.stages.select(section)
        for name, row in window.properties.rows.items():
            if row.reset.isEnabled():
                row.reset.click()
            assert name not in window.document.values.get(section, {}), section
        part = window.document.scene.parts[section]
        for name, parameter in part.parameters.items():
            assert getattr(part, name) == parameter.default_for(of_object=False), section


def test_parameter_without_effect_is_hidden_or_explained(open_scene: Any) -> None:
    window = open_scene()
    window.stages.select("cage")
    rows = window.properties.rows

    def shown() -> list[str]:
        return [name for name, row in rows.items() if row.isVisible()]

    assert shown() == ["method", "divisions", "order", "padding"]
    window.document.set("cage", "method", "carved")
    window.document.set("cage", "margin", 1)
    assert shown() == ["method", "divisions", "order", "padding", "margin", "fill"]
    assert rows["margin"].editor.isEnabled()
    # A written value stays visible in grey and can be reset.
    window.document.set("cage", "method", "lattice")
    assert shown() == ["method", "divisions", "order", "padding", "margin"]
    assert rows["margin"].note.text() == 'no effect: method is "lattice"'
    assert not rows["margin"].editor.isEnabled()
    wait_until(lambda: settled(window))
    assert "cage.margin has no effect" in window.status_text.toolTip()
    click(rows["margin"].reset)
    assert shown() == ["method", "divisions", "order", "padding"]
    window.document.history.undo()
    assert "margin" in shown()


def test_rows_without_effect_are_hidden(open_scene: Any) -> None:
    window = open_scene()
    for section in section_classes():
        window.properties.show_section(section)
        part = window.document.scene.parts[section]
        written = window.document.values.get(section, {})
        for name, row in window.properties.rows.items():
            assert row.isHidden() == (bool(part.disabled_by(name)) and name not in written), section


def type_again(line: Any, text: str) -> None:
    line.selectAll()
    QTest.keyClick(line, Qt.Key.Key_Backspace)
    type_into(line, text)


def undo_typing(line: Any, text: str) -> None:
    while line.text() != text:
        QTest.keyClick(line, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)


@pytest.mark.nightly
@pytest.mark.parametrize("again", [type_again, undo_typing])
def test_restoring_a_value_clears_the_error(open_scene: Any, again: Any) -> None:
    window = open_scene()
    for scene, section, name, wrong in (
        ("plain_weave", "weave", "pattern", "twil"),
        ("plain_weave", "weave", "warp_crimp_height", "high"),
        ("plain_weave", "weave", "warp_color", "redish"),
        ("plain_weave", "view", "background", "redish"),
        ("plain_weave", "modal", "fixed", "top"),
        ("animal_in_carved_cage", "object", "scale", "-5"),
    ):
        if window.document.source.stem != scene:
            window.document.open(scene)
        line, row = editor(window, section, name).line, window.properties.rows[name]
        right = line.text()
        type_into(line, wrong)
        assert row.property("bad"), name
        assert name in window.errors.text
        again(line, right)
        assert (line.text(), window.errors.text) == (right, ""), name
        assert not row.property("bad"), name
        assert window.document.history.isClean(), name


@pytest.mark.nightly
def test_picture_size_starts_with_the_automatic_size(open_scene: Any) -> None:
    window = open_scene("handweaving", wait=False)
    window.document.set("view", "size", None)
    window.stages.select("view")
    row = window.properties.rows["size"]
    wait_until(lambda: row.automatic_value is not None)
    row.automatic.click()
    assert window.document.value_in_file("view", "size") == [1280, 1280]
    assert window.errors.text == ""


@pytest.mark.nightly
def test_undo_first_restores_a_refused_value(open_scene: Any) -> None:
    window = open_scene("plain_weave")
    undo = window.menus.actions["Undo"]
    line, row = editor(window, "weave", "ends").line, window.properties.rows["ends"]
    right = line.text()
    type_into(line, "9")
    for before in ("9", right):
        type_into(line, "none")
        assert row.property("bad")
        assert undo.isEnabled()
        undo.trigger()
        assert (line.text(), window.errors.text) == (before, "")
        assert not row.property("bad")
        assert undo.isEnabled() == (before == "9")
        if before == "9":
            undo.trigger()
            assert line.text() == right
    wait_until(lambda: settled(window))


@pytest.mark.nightly
def test_vector_field_is_valid_only_when_all_components_are(open_scene: Any) -> None:
    window = open_scene("gust")
    gravity = editor(window, "response", "gravity")
    row = window.properties.rows["gravity"]
    for component in gravity.components[:2]:
        type_into(component.line, "down")
    right = [component.shown for component in gravity.components]
    type_again(gravity.components[0].line, right[0])
    assert row.property("bad")
    type_again(gravity.components[1].line, right[1])
    assert not row.property("bad")
    assert window.errors.text == ""
    # The value of a load is a row inside a row.
    line = editor(window, "response", "loads").cards[0].rows["pressure"].editor.line
    right = line.text()
    type_into(line, "strong")
    assert "pressure" in window.errors.text
    type_again(line, right)
    assert window.errors.text == ""


@pytest.mark.nightly
def test_value_refused_by_a_run_stays_marked_until_changed(open_scene: Any) -> None:
    window = open_scene()
    window.document.set("weave", "warp_diameter", "1.9 mm")
    wait_until(lambda: window.errors.text)
    row = window.properties.rows["warp_diameter"]
    assert row.property("bad")
    line = row.editor.line
    line.setFocus()
    QTest.keyClick(line, Qt.Key.Key_Return)
    assert row.property("bad")
    assert window.errors.text


def test_number_without_a_unit_has_the_unit_of_its_field(open_scene: Any) -> None:
    window = open_scene()
    diameter = editor(window, "weave", "warp_diameter")
    assert diameter.line.text().endswith("mm")
    type_into(diameter.line, "0.3")
    assert window.document.values["weave"]["warp_diameter"] == "0.3 mm"
    assert window.document.scene.source.warp_diameter == 0.0003
    type_into(diameter.line, "200 um")
    assert window.document.scene.source.warp_diameter == 0.0002


def test_new_cards_bend_the_cage_a_little(open_scene: Any) -> None:
    window = open_scene()

    def deflection() -> float:
        wait_until(lambda: settled(window))
        assert window.errors.text == ""
        cage = window.view.frame.cage
        moved = vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
        sizes = np.ptp(vtk_to_numpy(cage.GetPoints().GetData()), axis=0)
        return float(np.linalg.norm(moved, axis=1).max() / sizes.max())

    window.document.set("response", "gravity", [0.0, 0.0, 0.0])
    window.document.set("response", "alpha", 400.0)  # so damped that it does not swing
    window.times.go_to_end()
    loads = editor(window, "response", "loads")
    for action in loads.add_button.menu().actions():
        if action.data() in ("pressure", "force"):
            action.trigger()
            loads.cards[0].rows["time"].edited.emit("time", "step", 0)
            assert 0.02 < deflection() < 0.08
            loads.cards[0].remove_button.click()

    def mass() -> float:
        wait_until(lambda: settled(window))
        array = window.view.frame.cage.GetPointData().GetArray("nodal_mass")
        return float(vtk_to_numpy(array).sum())

    before = mass()
    editor(window, "modal", "masses").add_button.menu().actions()[0].trigger()
    assert mass() == pytest.approx(1.1 * before, rel=0.01)


def test_yarns_of_the_library_are_offered(open_scene: Any) -> None:
    window = open_scene()
    names = editor(window, "weave", "warp_yarn")
    names.line.setFocus()
    names.offer.trigger()
    popup = names.line.completer().popup()
    wait_until(popup.isVisible, 20.0)
    found = [popup.model().index(row, 0) for row in range(popup.model().rowCount())]
    chosen = next(index for index in found if index.data() == "60/2 silk")
    at = popup.visualRect(chosen).center()
    QTest.mouseClick(popup.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert window.document.scene.source.warp_yarn == "60/2 silk"
    assert window.document.scene.source.warp_diameter is None  # replaced
    assert not popup.isVisible()
    wait_until(lambda: settled(window))
    assert window.errors.text == ""
