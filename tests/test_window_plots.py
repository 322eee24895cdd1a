"""The plots tab: correct curves, a cheap cursor, and readable files."""

from __future__ import annotations

import csv
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import QPoint, Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QFileDialog  # noqa: E402

from spacemap_vtk.app.plots import plots_tab  # noqa: E402
from spacemap_vtk.app.plots.curves import compute_curves  # noqa: E402
from spacemap_vtk.datasets.arrays import points_of  # noqa: E402
from spacemap_vtk.draw.figure.plots import prefixed_unit  # noqa: E402
from spacemap_vtk.draw.figure.reaction_plot import reaction_curves  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


def is_plotted(window: Any) -> bool:
    plots = window.plots
    return plots.curves is not None and plots.curves.key == plots.make_request().key


@pytest.fixture
def plots_of(open_scene: Any) -> Any:
    """Open a scene with the plots tab visible."""

    def open_(scene: str = "plain_weave") -> Any:
        window = open_scene(scene)
        plots = window.plots
        # The curves of the former test have the same key.
        plots.curves = None
        plots.quantity.setCurrentIndex(0)
        plots.component.setCurrentIndex(0)
        window.tabs.setCurrentWidget(plots)
        wait_until(lambda: is_plotted(window))
        return window

    return open_


def pick(qtbot: Any, window: Any, number: int = 1) -> None:
    """Pick a number of points, and wait for the curves of all points."""
    for _ in range(number):
        pick_point(qtbot, window)
    count = len(window.plots.points)
    wait_until(lambda: is_plotted(window))
    assert len(window.plots.curves.points) == count


def pick_point(qtbot: Any, window: Any) -> None:
    count = len(window.plots.points)
    middle = QPoint(window.view.canvas.width() // 2, window.view.canvas.height() // 2)
    keys = Qt.KeyboardModifier
    for x in range(-40, 60, 20):
        at = middle + QPoint(x, 100 * count)
        adding = keys.ShiftModifier if count else keys.NoModifier
        qtbot.mouseClick(window.view.canvas, LEFT, adding, at)
        if len(window.plots.points) > count:
            break
    assert len(window.plots.points) == count + 1


def test_curve_matches_the_motion_of_the_picked_point(plots_of: Any, qtbot: Any) -> None:
    window = plots_of()
    # A drawn yarn that is irregular moves with its woven axis and not with its own place.
    window.document.set("view", "irregularity", 0.0)
    wait_until(lambda: settled(window))
    window.tools.cameras["front"].trigger()
    pick(qtbot, window, 2)
    curves, points = window.plots.curves, window.plots.points
    assert curves.motion.shape == (3, 2, len(curves.times), 3)
    assert (curves.times[0], curves.times[-1]) == (0.0, 0.2)
    # Where it was picked, at the time of the picture.
    for number, point in enumerate(points):
        at = [
            np.interp(window.view.frame.time, curves.times, c) for c in curves.motion[0, number].T
        ]
        size = np.linalg.norm(point.displacement)
        np.testing.assert_allclose(at, point.displacement, atol=1e-3 * size)
    # Velocity is the derivative of the displacement, by finite differences.
    slope = np.gradient(curves.motion[0, 0], curves.times, axis=0)
    error = np.abs(slope - curves.motion[1, 0])[2:-2].max()
    assert error < 0.05 * np.abs(curves.motion[1, 0]).max()


@pytest.mark.nightly
def test_plotted_points_are_marked_in_the_view(plots_of: Any, qtbot: Any) -> None:
    window = plots_of()
    window.tools.cameras["front"].trigger()
    pick(qtbot, window, 2)
    first, second = window.view.picks
    assert window.plots.points == [first, second]
    # A click without Shift starts a new list.
    widget = window.view.canvas
    middle = QPoint(widget.width() // 2, widget.height() // 2)
    for x in range(-40, 60, 20):
        qtbot.mouseClick(widget, LEFT, pos=middle + QPoint(x, -100))
        if window.view.picks != [first, second]:
            break
    (alone,) = window.view.picks
    assert window.plots.points == [alone]
    assert alone not in (first, second)
    wait_until(lambda: is_plotted(window))
    np.testing.assert_allclose(window.plots.curves.points, [alone.rest])
    qtbot.mouseClick(window.plots.clear_button, LEFT)
    assert window.view.picks == []
    assert not window.view.marks.GetVisibility()
    wait_until(lambda: is_plotted(window))
    assert len(window.plots.curves.points) == 1  # the tip


def test_plotted_energies_and_response_equal_those_of_the_pipeline(plots_of: Any) -> None:
    window = plots_of()
    curves = window.plots.curves
    scene = Scene.read("plain_weave")
    at = 700
    scene.update_stage(scene.response, float(curves.times[at]))
    field = scene.response.GetOutputDataObject(0).GetFieldData()
    names = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
    *parts, work = [field.GetArray(name).GetTuple1(0) for name in names]
    found = curves.balance
    plotted_parts = [part[at] for part in (found.kinetic, found.strain, found.dissipated)]
    np.testing.assert_allclose(plotted_parts, parts, rtol=1e-9)
    # Only the weight does work, at the cost of potential energy; the total is constant.
    assert found.potential[at] == pytest.approx(-work, rel=1e-9)
    assert work > 0.0
    np.testing.assert_allclose(found.total, 0.0, atol=1e-9 * work)
    labels = [text.get_text() for text in window.plots.canvas.axes[1].get_legend().get_texts()]
    assert labels == ["kinetic", "strain", "potential", "dissipated", "total"]
    # The response peaks at the first loaded mode.
    peak = curves.frequencies[np.argmax(curves.response[0, :, 2])]
    assert abs(peak / curves.modes[0] - 1) < 0.01


@pytest.mark.nightly
def test_playing_moves_the_cursor_without_drawing_the_plot(
    plots_of: Any, qtbot: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = plots_of()
    canvas = window.plots.canvas
    drawn: list[int] = []
    curves = window.plots.curves
    columns = set()
    window.director.drawn.connect(lambda _: columns.add(tuple(canvas.cursor_columns())))
    qtbot.mouseClick(window.times.play, LEFT)
    # Draw the canvas now, which was requested when the tab opened.
    wait_until(lambda: len(columns) > 4)
    monkeypatch.setattr(canvas, "draw", lambda: drawn.append(1))
    columns.clear()
    wait_until(lambda: len(columns) > 8)
    qtbot.mouseClick(window.times.play, LEFT)
    wait_until(lambda: settled(window))
    assert not drawn
    assert window.plots.curves is curves
    # The cursor is painted at the time in both plots over time.
    share = window.times.time / 0.2
    box = canvas.axes[0].get_position()
    column = (box.x0 + share * box.width) * canvas.width()
    assert all(abs(c - column) <= 1 for c in canvas.cursor_columns())
    picture = canvas.grab().toImage()
    middle = round(canvas.height() * (1 - (box.y0 + box.y1) / 2))
    dark = [
        picture.pixelColor(x, middle + y).lightness() < 90
        for x in range(canvas.cursor_columns()[0] - 1, canvas.cursor_columns()[0] + 2)
        for y in (0, 3, 7)
    ]
    assert sum(dark) >= 3


def test_click_in_a_plot_goes_to_its_time(plots_of: Any, qtbot: Any) -> None:
    window = plots_of()
    canvas = window.plots.canvas
    for axes, share in ((canvas.axes[0], 0.25), (canvas.axes[1], 0.75)):
        box = axes.get_position()
        x = round((box.x0 + share * box.width) * canvas.width())
        y = round(canvas.height() * (1 - (box.y0 + box.y1) / 2))
        qtbot.mouseClick(canvas, LEFT, pos=QPoint(x, y))
        assert abs(window.times.time - 0.2 * share) < 0.002
        wait_until(lambda: settled(window) and window.view.frame.time == window.times.time)
    before = window.times.time
    box = canvas.axes[2].get_position()
    y = round(canvas.height() * (1 - (box.y0 + box.y1) / 2))
    qtbot.mouseClick(canvas, LEFT, pos=QPoint(canvas.width() // 2, y))
    assert window.times.time == before  # frequencies have no time


@pytest.mark.nightly
def test_curves_are_computed_only_while_the_tab_is_visible(plots_of: Any, qtbot: Any) -> None:
    window = plots_of()
    first = window.plots.curves
    window.document.set("modal", "youngs_modulus", "4 kPa")
    wait_until(lambda: settled(window) and is_plotted(window))
    second = window.plots.curves
    ratio = second.modes[0] / first.modes[0]
    assert ratio == pytest.approx(np.sqrt(4e3 / Scene.read("plain_weave").modal.youngs_modulus))
    # Changes that do not affect the motion, or a hidden tab, compute nothing.
    window.document.set("view", "cage_color", "#ff0000")
    wait_until(lambda: settled(window))
    qtbot.wait(400)
    assert window.plots.curves is second
    window.tabs.setCurrentWidget(window.modes)
    window.document.set("response", "alpha", 9.0)
    wait_until(lambda: settled(window))
    qtbot.wait(400)
    assert window.plots.curves is second
    window.tabs.setCurrentWidget(window.plots)
    wait_until(lambda: is_plotted(window))
    assert window.plots.curves is not second


@pytest.mark.nightly
def test_every_quantity_and_component_gives_another_plot(plots_of: Any, qtbot: Any) -> None:
    window = plots_of()
    pictures = []
    for box in (window.plots.quantity, window.plots.component):
        count = sum(box.model().item(number).isEnabled() for number in range(box.count()))
        for _ in range(count):
            pictures.append(window.plots.canvas.grab().toImage())
            box.setFocus()
            down = box.currentIndex() < count - 1
            qtbot.keyClick(box, Qt.Key.Key_Down if down else Qt.Key.Key_Up)
    distinct = sum(a != b for k, a in enumerate(pictures) for b in pictures[:k])
    assert distinct >= len(pictures) * (len(pictures) - 1) // 2 - 6


def test_curves_and_plot_pictures_can_be_saved(
    plots_of: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = plots_of()
    chosen = [""]
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (chosen[0], ""))
    curves = window.plots.curves
    for name, head, rows in (
        ("times", "time [s]", len(curves.times)),
        ("frequencies", "frequency [Hz]", len(curves.frequencies)),
    ):
        chosen[0] = str(tmp_path / name)
        window.plots.save_actions[name].trigger()
        with open(tmp_path / f"{name}.csv", newline="", encoding="utf-8") as stream:
            table = list(csv.reader(stream))
        assert table[0][0] == head
        assert len(table) == rows + 1
    with open(tmp_path / "times.csv", newline="", encoding="utf-8") as stream:
        last = list(csv.DictReader(stream))[-1]
    assert float(last["displacement z of point 1 [m]"]) == curves.motion[0, 0, -1, 2]
    assert float(last["total energy [J]"]) == curves.balance.total[-1]
    chosen[0] = str(tmp_path / "plots.png")
    window.plots.save_actions["picture"].trigger()
    assert np.asarray(Image.open(chosen[0]).convert("L")).std() > 5
    chosen[0] = str(tmp_path / "plots.xyz")
    window.plots.save_actions["picture"].trigger()
    assert ".png" in window.errors.text
    assert not (tmp_path / "plots.xyz").exists()


def test_plots_use_the_time_steps_of_a_motion_file(plots_of: Any) -> None:
    window = plots_of("calculix_fabric")
    curves = window.plots.curves
    assert curves.balance is None
    assert not window.plots.save_actions["frequencies"].isEnabled()
    scene = Scene.read("calculix_fabric")
    time = float(curves.times[len(curves.times) // 2])
    scene.update_stage(scene.motion, time)
    cage = scene.motion.GetOutputDataObject(0)
    vertex = int(np.argmin(np.linalg.norm(points_of(cage) - curves.points[0], axis=1)))
    expected = cage.GetPointData().GetArray("displacement").GetTuple3(vertex)
    np.testing.assert_allclose(curves.motion[0, 0, len(curves.times) // 2], expected, rtol=1e-6)


@pytest.mark.nightly
def test_scene_without_motion_has_no_plots(plots_of: Any, tmp_path: Path) -> None:
    window = plots_of()
    scene_file = tmp_path / "still.toml"
    scene_file.write_text("[weave]\nends = 3\npicks = 3\n")
    window.document.open(scene_file)
    wait_until(lambda: settled(window) and "not move" in window.plots.hint.text())
    assert not window.plots.canvas.isVisible()
    assert not window.plots.save_button.isEnabled()
    window.document.open("plain_weave")
    wait_until(lambda: is_plotted(window))
    assert window.plots.canvas.isVisible()
    window.document.open(scene_file)
    assert not window.plots.canvas.isVisible()  # at once
    wait_until(lambda: settled(window))


@pytest.mark.nightly
def test_titles_and_legends_do_not_overlap(plots_of: Any, qtbot: Any) -> None:
    window = plots_of()
    window.tools.cameras["front"].trigger()
    canvas = window.plots.canvas
    for points in (1, 3):  # the tip, and picked points
        if points > 1:
            pick(qtbot, window, points)
        for size in ((1590, 980), (1440, 800), (1100, 700)):
            window.resize(*size)
            wait_until(lambda: settled(window))
            canvas.grab()  # draws if a drawing is pending
            renderer = canvas.get_renderer()
            boxes = []
            for axes in canvas.axes:
                boxes.append(axes.get_window_extent(renderer))
                boxes.append(axes._left_title.get_window_extent(renderer))
                if axes.get_legend() is not None:
                    boxes.append(axes.get_legend().get_window_extent(renderer))
            assert len(boxes) == 7 + (points > 1)
            for number, box in enumerate(boxes):
                assert box.x0 >= 0
                assert box.x1 <= canvas.width(), (points, size)
                assert box.y1 <= canvas.height(), (points, size)
                for other in boxes[:number]:
                    assert not box.overlaps(other), (points, size)


@pytest.mark.nightly
def test_cancelled_run_gives_no_curves(plots_of: Any) -> None:
    window = plots_of()
    plots, before = window.plots, window.plots.curves
    window.document.set_many("cage", {"divisions": [24, 24, 2], "order": 2})
    wait_until(
        lambda: window.stages.states["modal"] == "running" and window.cancel_button.isVisible()
    )
    window.cancel_button.click()
    wait_until(lambda: not window.engine.busy)
    # The engine's scene has the old modes, so its curves would be wrong.
    plots.show_points([])
    wait_until(lambda: not plots.rest_timer.isActive())
    QTest.qWait(500)
    assert plots.curves is before
    assert plots.hint.text() != "Computing…"
    # After undo, the curves are valid again; for another scene, new ones follow.
    window.document.history.undo()
    wait_until(lambda: settled(window) and is_plotted(window))
    window.document.set("cage", "divisions", [3, 3, 1])
    wait_until(lambda: settled(window) and is_plotted(window))
    assert not np.allclose(plots.curves.modes[:5], before.modes[:5], rtol=1e-3)


@pytest.mark.nightly
def test_transient_motion_is_plotted_with_its_energies(plots_of: Any, tmp_path: Path) -> None:
    file = tmp_path / "fall.toml"
    file.write_text(
        "weave = { ends = 3, picks = 5 }\ncage = { divisions = [1, 3, 1] }\n"
        'modal = { elements = "sheet", youngs_modulus = "20 kPa", density = 300, fixed = "+y" }\n'
        "transient = { alpha = 5 }\nanimation = { stop = 0.02 }\n"
    )
    window = plots_of(file)
    curves = window.plots.curves
    assert "has a frequency response" in curves.note
    assert "has a frequency response" in window.plots.hint.text()
    assert not window.plots.save_actions["frequencies"].isEnabled()
    found = curves.balance
    gained = -found.potential.min()
    assert found.kinetic.max() > 0.1 * gained > 0
    np.testing.assert_allclose(found.total, 0.0, atol=1e-9 * gained)
    # At first it falls freely where it is not fixed, as the sum of all modes, whose consistent mass
    # makes the free end of three cells start 3.8 % faster.
    time, fallen = curves.times[:8], curves.motion[0, 0, :8, 2]
    np.testing.assert_allclose(fallen, -9.80665 * time**2 / 2, rtol=0.05)
    window.times.go_to(0.01, False)
    wait_until(lambda: settled(window) and window.view.frame.time == 0.01)
    rest = points_of(window.view.frame.cage)
    vertex = int(np.argmin(np.linalg.norm(rest - curves.points[0], axis=1)))
    moved = window.view.frame.cage.GetPointData().GetArray("displacement").GetTuple(vertex)
    now = [np.interp(0.01, curves.times, c) for c in curves.motion[0, 0].T]
    np.testing.assert_allclose(moved, now, atol=1e-3 * np.linalg.norm(moved))
    # Another motion has other curves.
    window.document.set("transient", "gravity", [0.0, 0.0, 4.0])
    assert "before the last change" in window.plots.hint.text()  # at once
    wait_until(lambda: settled(window) and is_plotted(window))
    assert "before the last change" not in window.plots.hint.text()
    assert window.plots.curves.motion[0, 0, 7, 2] > 0


@pytest.mark.nightly
def test_slow_curves_show_progress_and_can_be_cancelled(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    plots, engine = window.plots, window.engine
    shown = []

    def slow(scene: Any, request: Any) -> Any:
        for share in compute_curves(scene, request):
            shown.append(share)
            time.sleep(0.06)
            yield share

    monkeypatch.setattr(plots_tab, "compute_curves", slow)
    plots.curves = None
    window.tabs.setCurrentWidget(plots)
    # A progress report of earlier work may still arrive.
    wait_until(
        lambda: (
            plots.progress_bar.isVisible()
            and max(shown, default=0.0) >= 0.1 <= plots.progress_bar.value() / 100
        )
    )
    assert shown == sorted(shown)
    assert 0.0 <= shown[0] < shown[-1] <= 1.0
    assert plots.run_button.text() == "Cancel"
    QTest.mouseClick(plots.run_button, LEFT)
    assert engine.background is None
    assert not plots.progress_bar.isVisible()
    assert "Cancelled" in plots.hint.text()
    count = len(shown)
    QTest.qWait(400)
    assert len(shown) <= count + 1
    assert plots.curves is None

    monkeypatch.setattr(plots_tab, "compute_curves", compute_curves)
    assert plots.run_button.text() == "Compute"
    QTest.mouseClick(plots.run_button, LEFT)
    wait_until(lambda: is_plotted(window))
    assert not plots.run_button.isVisible()
    assert not plots.progress_bar.isVisible()


PULLED = """
[weave]
ends = 12
picks = 36
[cage]
divisions = [2, 6, 1]
[modal]
elements = "sheet"
fixed = "-y"
modes = 2
path_steps = 4
tensile_rigidity = "1 kN/m"
bending_rigidity = "10 uN.m"
areal_mass = "0.15 kg/m2"
[[modal.grips]]
place = "+y"
path = [[0, "0.2 mm", 0]]
displacement = [0, 0, "0.5 mm"]
rise = "10 ms"
[transient]
duration = "20 ms"
max_step = "2 ms"
tolerance = 1
alpha = 50
[animation]
stop = "20 ms"
"""


def choose(box: Any, text: str) -> None:
    """Choose an item of a combo box, as a user does."""
    box.setCurrentIndex(box.findText(text))
    assert box.currentText() == text
    box.activated.emit(box.currentIndex())


def test_reactions_are_plotted_over_time_and_over_the_stroke(
    plots_of: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "pulled.toml"
    file.write_text(PULLED, encoding="utf-8")
    window = plots_of(file)
    plots, canvas = window.plots, window.plots.canvas
    choose(plots.quantity, "Force")
    choose(plots.component, "along y")
    # The plotted curves are those of the pipeline.
    scene = Scene.read(file)
    for over, name in (("over time", "time"), ("over the stroke", "stroke")):
        choose(plots.abscissa, over)
        expected = reaction_curves(scene, name)
        assert canvas.axes[0].get_xlabel() == expected.heading
        unit, size = prefixed_unit("N", float(abs(expected.forces).max()))
        assert canvas.axes[0].get_title(loc="left") == f"Force along y [{unit}]"
        for body, line in enumerate(canvas.axes[0].lines):
            assert line.get_label() == expected.names[body] == ("support -y", "grip +y")[body]
            values = np.interp(line.get_xdata(), expected.x, expected.forces[:, body, 1])
            assert size * line.get_ydata()[-1] == pytest.approx(values[-1], rel=1e-6)
        # Only a plot over time has energies and a cursor below it.
        assert len(canvas.axes) == len(canvas.time_axes) + (name == "stroke")
    choose(plots.quantity, "Moment")
    choose(plots.body, "grip +y")
    assert canvas.axes[0].get_title(loc="left").startswith("Moment of grip +y about y")
    assert len(canvas.axes[0].lines) == 1
    saved = tmp_path / "reactions.csv"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(saved), ""))
    plots.save_actions["reactions"].trigger()
    lines = saved.read_text(encoding="utf-8").splitlines()
    rows = [*csv.DictReader(line for line in lines if not line.startswith("#"))]
    assert [float(row["stroke [mm]"]) for row in rows] == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])
    assert float(rows[-1]["grip +y force y [N]"]) == pytest.approx(expected.forces[-1, 1, 1])


def test_scene_without_reactions_over_time_offers_none(plots_of: Any) -> None:
    plots = plots_of().plots
    offered = [plots.quantity.model().item(number).isEnabled() for number in range(5)]
    assert offered == [True, True, True, False, False]
    assert not plots.body.isVisible()
    assert not plots.save_actions["reactions"].isEnabled()
