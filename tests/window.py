"""What the tests of the window share: a person's hands, and a reason to skip."""

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

# The window says itself what its stages doubt: the command, which starts it, keeps Python from it.
warnings.simplefilter("ignore", SpacemapWarning)


def require_display() -> None:
    """Skip the module where no window can be opened."""
    try:
        require_window()
    except MissingLibraryError as error:
        pytest.skip(str(error), allow_module_level=True)


def wait_until(done: Callable[[], Any], seconds: float = 120.0) -> None:
    """Let the window live until something holds.

    The usual limit is for a machine whose cores ten others share: there a scene of modes takes
    longer to open than half a minute.
    """
    from PySide6.QtCore import QEventLoop, QTimer

    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "it never happened"
        # Not QTest.qWait, which keeps Python's lock: the engine would starve.
        loop = QEventLoop()
        QTimer.singleShot(10, loop.quit)
        loop.exec()


def settled(window: Any) -> bool:
    """Whether a smooth frame of the present wishes is drawn, and nothing runs."""
    from spacemap_vtk.app.work.frame_request import Swing

    director = window.director
    frame = window.view.frame
    return (
        frame is not None
        and frame.generation == director.generation
        and (not frame.coarse or isinstance(director.swing, Swing))
        and not window.engine.busy
        # Made, but not drawn yet: the thread can be done before its word arrives. Asked for after
        # "busy": the thread hands the frame over first.
        and window.engine.waiting_frame is None
        and not director.rest_timer.isActive()
    )


def as_new(window: Any) -> Any:
    """Take back what tests do to a window that another scene does not; return it."""
    window.setFocus()  # what is being typed
    # A message of the test before would hide the status line, which is then not laid out.
    window.statusBar().clearMessage()
    window.resize(1200, 800)
    window.splitter.setSizes([310, 770, 360])
    page = window.properties
    if page.section == "weave":
        # Most scenes begin with it. To make it anew takes more than all else of opening a scene;
        # and whoever opens another one keeps it, too.
        page.search.clear()
        page.verticalScrollBar().setValue(0)
    else:  # the first scene chooses the stage whose properties are seen
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
    """Return the scene that the window's engine runs."""
    return window.engine.pipeline.scene


def drag(slider: Any, steps: int) -> None:
    """Press a slider's handle, move it, let go."""
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
    """Replace a line's text."""
    from PySide6.QtTest import QTest

    line.setFocus()
    line.selectAll()
    QTest.keyClicks(line, text)


def type_into(line: Any, text: str) -> None:
    """Replace a line's text, and press Enter."""
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    replace_text(line, text)
    QTest.keyClick(line, Qt.Key.Key_Return)


def turn_wheel(view: Any, angle: int) -> None:
    """Turn the wheel over the middle of a view: up where the angle is positive, 120 a notch."""
    from PySide6.QtCore import QPoint, QPointF, Qt
    from PySide6.QtGui import QWheelEvent
    from PySide6.QtWidgets import QApplication

    at = QPointF(view.rect().center())
    none = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(at, view.mapToGlobal(at), QPoint(), QPoint(0, angle), *none, False)
    QApplication.sendEvent(view, event)


def type_into_field(window: Any, section: str, name: str, text: str) -> Any:
    """Replace the text of a stage's field, press Enter, and return the field's row."""
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
    """Trigger an action that opens a dialog, and fill the dialog in; `fill` closes it."""
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
        except BaseException as error:  # else the dialog stays open for ever
            errors.append(error)
            dialog.reject()

    QTimer.singleShot(50, begin)
    action.trigger()
    if errors:
        raise errors[0]


def wait_written(window: Any, file: Path) -> None:
    """Wait until an export says that it has written a file."""

    def told() -> bool:
        message = window.statusBar().currentMessage()
        return message.startswith("Saved:") and file.name in message

    # Another process writes it: on a machine whose cores others share its start alone takes long.
    wait_until(lambda: told() or window.errors.text, 600.0)
    assert window.errors.text == ""


def keep_picture(window: Any, name: str) -> None:
    """Save what the screen shows of a window, in the folder that SPACEMAP_WALKS names.

    The pictures in docs/tutorials are made like this; docs/contributing/set_up.md has the command.
    """
    if (folder := os.environ.get("SPACEMAP_WALKS")) is None:
        return
    begun = time.monotonic()  # tabs and fields follow the last change after a while
    wait_until(lambda: settled(window) and time.monotonic() > begun + 2.0)
    at = window.frameGeometry()
    grabbed = window.screen().grabWindow(0, at.x(), at.y(), at.width(), at.height())
    assert grabbed.save(str(Path(folder) / name), quality=70)
