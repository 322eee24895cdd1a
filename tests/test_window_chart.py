"""The chart tab: stitches and colours of knits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from window import WIDE, require_display, scene_of, settled, type_into, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtGui import QColor  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QWidget  # noqa: E402

LEFT = Qt.MouseButton.LeftButton
KNIT = '[textile]\nrows = "stockinette"\nwales = 4\ncourses = 4\ncolor = ["#c43e3a", "#eee2c8"]\n'


def open_knit(open_scene: Any, folder: Path) -> Any:
    file = folder / "knit.toml"
    file.write_text(KNIT, "utf-8")
    window = open_scene(str(file), wait=False)
    window.resize(*WIDE)  # a narrow window hides the tabs
    window.tabs.setCurrentWidget(window.chart)
    wait_until(lambda: settled(window) and window.chart.chart.shown is not None)
    return window


def drag(chart: Any, *places: tuple[int | None, int]) -> None:
    """Drag over stitches, counted from the left and from below, from 0."""
    points = [chart.rect_of(*place).center().toPoint() for place in places]
    QTest.mousePress(chart, LEFT, pos=points[0])
    for point in points[1:]:
        QTest.mouseMove(chart, point)
        QTest.qWait(15)
    QTest.mouseRelease(chart, LEFT, pos=points[-1])


def test_a_stroke_changes_stitches_and_is_undone_at_once(open_scene: Any, tmp_path: Path) -> None:
    window = open_knit(open_scene, tmp_path)
    tab = window.chart
    assert tab.chart.shown.size == (1, 2)
    type_into(tab.counts["stitches"].lineEdit(), "4")
    assert tab.chart.shown.size == (4, 2)
    tab.buttons["p"].click()
    drag(tab.chart, (0, 1), (3, 1))
    assert window.document.value_in_file("textile", "rows") == "garter"
    assert tab.chart.shown.size == (4, 2)
    wait_until(lambda: settled(window))
    assert scene_of(window).textile.rows == ("k", "p")
    window.menus.actions["Undo"].trigger()
    assert window.document.value_in_file("textile", "rows") == "stockinette"


def test_colours_of_stitches_become_a_chart(open_scene: Any, tmp_path: Path) -> None:
    window = open_knit(open_scene, tmp_path)
    tab = window.chart
    type_into(tab.counts["stitches"].lineEdit(), "4")
    tab.palette_row.choose(QColor("#2d6a8e"))
    drag(tab.chart, (0, 0), (1, 1))
    written = window.document.values["textile"]
    assert written["chart"] == ["CAAA", "BCBB"]
    assert written["color"] == ["#c43e3a", "#eee2c8", "#2d6a8e"]
    # A row that no yarn can knit is refused, and the chart stays as it was.
    tab.buttons["m"].click()
    drag(tab.chart, (0, 0), (3, 0))
    assert window.document.value_in_file("textile", "rows") == "stockinette"
    assert (tab.chart.shown.stitches == "k").all()
    assert "misses" in window.errors.label.text()
    drag(tab.chart, (None, 0), (None, 1))
    assert window.document.value_in_file("textile", "chart") is None


def test_keys_write_stitches_and_undo_takes_them_back(open_scene: Any, tmp_path: Path) -> None:
    window = open_knit(open_scene, tmp_path)
    tab, chart = window.chart, window.chart.chart
    type_into(tab.counts["stitches"].lineEdit(), "4")
    chart.setFocus()
    chart.place = (0, 0)
    QTest.keyClicks(chart, "kp")
    assert window.document.value_in_file("textile", "rows") == ["kpkk", "kkkk"]
    assert chart.place == (2, 0)
    # Keys of the menus are not letters.
    QTest.keyClick(chart, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    assert window.document.value_in_file("textile", "rows") == ["kpkk", "kkkk"]
    window.menus.actions["Undo"].trigger()
    assert window.document.value_in_file("textile", "rows") == "stockinette"
    # From the end of a row keys go on in the next one; Enter goes to its beginning.
    QTest.keyClick(chart, Qt.Key.Key_Right)
    QTest.keyClick(chart, Qt.Key.Key_Right)
    assert chart.place == (0, 1)
    QTest.keyClick(chart, Qt.Key.Key_Up)
    QTest.keyClick(chart, Qt.Key.Key_Return)
    assert chart.place == (0, 1)


def test_lace_is_stored_once_its_row_can_be_knitted(open_scene: Any, tmp_path: Path) -> None:
    window = open_knit(open_scene, tmp_path)
    tab, chart = window.chart, window.chart.chart
    type_into(tab.counts["stitches"].lineEdit(), "4")
    chart.setFocus()
    chart.place = (1, 1)
    QTest.keyClicks(chart, "y")
    assert window.document.value_in_file("textile", "rows") == "stockinette"
    assert "Row 2 makes 1 stitch too many: add a decrease" in tab.hint.text()
    assert str(chart.shown.stitches[1, 1]) == "yo"
    QTest.keyClicks(chart, "/")
    assert window.document.value_in_file("textile", "rows") == ["kkkk", "kyok2togk"]
    # An incomplete row is discarded by Esc.
    QTest.keyClick(chart, Qt.Key.Key_Backspace)
    assert str(chart.shown.stitches[1, 2]) == "k"
    QTest.keyClick(chart, Qt.Key.Key_Escape)
    assert str(chart.shown.stitches[1, 2]) == "k2tog"
    assert tab.buttons["yo"].toolTip().endswith("Key y")


def test_only_knits_have_a_chart(open_scene: Any, tmp_path: Path) -> None:
    window = open_knit(open_scene, tmp_path)
    assert window.tabs.indexOf(window.chart) >= 0
    window.tabs.setCurrentWidget(window.chart)
    window.document.set("textile", "kind", "mesh")
    assert window.tabs.indexOf(window.chart) < 0
    assert window.tabs.currentWidget() is window.draft
    window.menus.actions["Undo"].trigger()
    assert window.tabs.indexOf(window.chart) >= 0


def test_many_tabs_do_not_hide_the_panel_in_a_narrow_window(
    open_scene: Any, tmp_path: Path
) -> None:
    window = open_knit(open_scene, tmp_path)
    window.tabs.addTab(QWidget(), "A tab with a long title")
    window.tabs.addTab(QWidget(), "Another tab with a long title")
    window.resize(960, 700)
    wait_until(lambda: window.width() == 960)
    assert window.tabs.isVisible()
    assert window.tabs.tabBar().minimumSizeHint().width() < window.tabs.width()


def test_a_machine_knitting_file_opens_as_a_new_scene(open_scene: Any, tmp_path: Path) -> None:
    needles = [f"f{number}" for number in range(4)]
    rows = [[f"tuck - {n} 1" for n in needles[::-1]], [f"knit + {n} 1" for n in needles]]
    file = tmp_path / "swatch.k"
    file.write_text("\n".join([";!knitout-2", ";;Carriers: 1", *rows[0], *rows[1]]))
    window = open_scene(str(file), wait=False)
    written = window.document.values["textile"]
    assert (written["rows"], written["wales"], written["courses"]) == (["k"], 4, 1)
    # Saving asks for a name: the file of the machine is not overwritten.
    assert window.document.file is None
