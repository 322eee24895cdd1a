"""Helpers of the window's tests: waiting, typing, dragging, dialogs."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from spacemap_vtk.app.requirements import require_window
from spacemap_vtk.errors import MissingLibraryError, SpacemapWarning

# The window shows the warnings of its stages, so Python need not print them.
warnings.simplefilter("ignore", SpacemapWarning)

#: Size of a test's window, in pixels: a frame takes a third less time than at 1200 by 800.
SIZE = 1000, 640
#: Size for tests that need a large view.
WIDE = 1200, 800
#: Widths of the window's three parts before Qt fits them into it.
PARTS = [310, 770, 360]


def require_display() -> None:
    """Skip the module if no window can be opened."""
    try:
        require_window()
    except MissingLibraryError as error:
        pytest.skip(str(error), allow_module_level=True)


def wait_until(done: Callable[[], Any], seconds: float = 300.0) -> None:
    """Process events until a condition holds.

    The usual limit is for a machine whose cores many others share: there a second of work can take
    a minute.
    """
    from PySide6.QtCore import QEventLoop, QTimer

    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "it never happened"
        # Not QTest.qWait, which holds the GIL, so the engine could not run.
        loop = QEventLoop()
        QTimer.singleShot(10, loop.quit)
        loop.exec()


def settled(window: Any) -> bool:
    """Return whether a fine frame of the present scene is drawn and nothing runs."""
    from spacemap_vtk.app.work.frame_request import Swing

    director = window.director
    frame = window.view.frame
    return (
        frame is not None
        and frame.generation == director.generation
        and (not frame.coarse or isinstance(director.swing, Swing))
        and not window.engine.busy
        # A frame may be computed but not drawn: the thread can end before its signal arrives.
        # Checked after "busy", because the thread hands over the frame first.
        and window.engine.waiting_frame is None
        and not director.rest_timer.isActive()
    )


def as_new(window: Any) -> Any:
    """Reset what another scene does not reset in a window; return the window."""
    window.setFocus()  # end typing
    # A message of an earlier test would hide the status line, which is then not laid out.
    window.statusBar().clearMessage()
    window.resize(*SIZE)
    window.splitter.setSizes(PARTS)
    page = window.properties
    if page.section == "weave":
        # Most scenes start with this page, which the window keeps. Creating it takes longer than
        # the rest of opening a scene.
        page.search.clear()
        page.verticalScrollBar().setValue(0)
    else:  # the first scene selects the stage
        window.stages.setCurrentItem(None)
        page.section = ""
    window.times.loop.setChecked(True)
    window.modes.amplitude.setValue(15)
    window.modes.table.scrollToTop()
    tools = window.tools
    for action, on in (
        (tools.part_actions["fabric"], True),
        *((tools.part_actions[name], True) for name in ("cage", "triad", "scale_bar")),
        (tools.turntable, False),
        (tools.keys.wireframe, False),
        (tools.orthographic, False),
    ):
        if action.isChecked() != on:
            action.trigger()
    return window


def scene_of(window: Any) -> Any:
    """Return the scene of the window's engine."""
    return window.engine.pipeline.scene


def drag(slider: Any, steps: int) -> None:
    """Drag the handle of a slider."""
    from PySide6.QtCore import QPoint, Qt
    from PySide6.QtTest import QTest
    from PySide6.QtWidgets import QStyle, QStyleOptionSlider

    option = QStyleOptionSlider()
    slider.initStyleOption(option)
    handle = slider.style().subControlRect(
        QStyle.ComplexControl.CC_Slider, option, QStyle.SubControl.SC_SliderHandle, slider
    )
    at = handle.center()
    QTest.mousePress(slider, Qt.MouseButton.LeftButton, pos=at)
    for _ in range(abs(steps)):
        at += QPoint(4 if steps > 0 else -4, 0)
        QTest.mouseMove(slider, at)
        QTest.qWait(15)
    QTest.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=at)


def replace_text(line: Any, text: str) -> None:
    """Replace the text of a line."""
    from PySide6.QtTest import QTest

    line.setFocus()
    line.selectAll()
    QTest.keyClicks(line, text)


def type_into(line: Any, text: str) -> None:
    """Replace the text of a line, and press Enter."""
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    replace_text(line, text)
    QTest.keyClick(line, Qt.Key.Key_Return)


def turn_wheel(view: Any, angle: int) -> None:
    """Turn the wheel over the centre of a view; a notch has 120 units, positive is up."""
    from PySide6.QtCore import QPoint, QPointF, Qt
    from PySide6.QtGui import QWheelEvent
    from PySide6.QtWidgets import QApplication

    at = QPointF(view.rect().center())
    none = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(at, view.mapToGlobal(at), QPoint(), QPoint(0, angle), *none, False)
    QApplication.sendEvent(view, event)


def type_into_field(window: Any, section: str, name: str, text: str) -> Any:
    """Type into the field of a stage, press Enter, and return the row."""
    window.stages.select(section)
    row = window.properties.rows[name]
    type_into(row.editor.line, text)
    return row


def click_picture(window: Any, name: str, double: bool = False) -> None:
    """Click a scene of the gallery."""
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    window.tabs.setCurrentWidget(window.gallery)
    pictures = window.gallery.list
    rows = range(pictures.count())
    item = next(
        pictures.item(row)
        for row in rows
        if pictures.item(row).data(Qt.ItemDataRole.UserRole) == name
    )
    pictures.scrollToItem(item)
    at, left = pictures.visualItemRect(item).center(), Qt.MouseButton.LeftButton
    QTest.mouseClick(pictures.viewport(), left, pos=at)
    if double:
        QTest.mouseDClick(pictures.viewport(), left, pos=at)


def fill_in(action: Any, fill: Callable[[Any], None]) -> None:
    """Trigger an action that opens a dialog; `fill` fills it in and closes it."""
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    errors: list[BaseException] = []

    def begin() -> None:
        dialog = QApplication.activeModalWidget()
        if dialog is None:
            QTimer.singleShot(50, begin)
            return
        try:
            fill(dialog)
        except BaseException as error:  # otherwise the dialog would stay open
            errors.append(error)
            dialog.reject()

    QTimer.singleShot(50, begin)
    action.trigger()
    if errors:
        raise errors[0]


def wait_written(window: Any, file: Path) -> None:
    """Wait until the status bar reports a written file."""

    def reported() -> bool:
        message = window.statusBar().currentMessage()
        return message.startswith("Saved:") and file.name in message

    # Another process writes it, whose start takes long on a busy machine.
    wait_until(lambda: reported() or window.errors.text, 600.0)
    assert window.errors.text == ""


def enlarge_for_pictures(window: Any) -> None:
    """Resize a window to the size of the tutorials' pictures, if they are saved."""
    if "SPACEMAP_WALKS" in os.environ:
        window.resize(1440, 900)


def keep_picture(window: Any, name: str) -> None:
    """Save a screenshot of a window in the folder SPACEMAP_WALKS.

    The pictures in docs/tutorials are made like this; docs/contributing/set_up.md has the command.
    """
    if (folder := os.environ.get("SPACEMAP_WALKS")) is None:
        return
    start = time.monotonic()  # tabs and fields are updated after a delay
    wait_until(lambda: settled(window) and time.monotonic() > start + 2.0)
    at = window.frameGeometry()
    grabbed = window.screen().grabWindow(0, at.x(), at.y(), at.width(), at.height())
    assert grabbed.save(str(Path(folder) / name), quality=70)
