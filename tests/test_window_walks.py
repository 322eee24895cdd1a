"""The guided walks of the help menu."""

from __future__ import annotations

from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402


def start(window: Any, title: str) -> Any:
    entry = next(entry for entry in window.help.entries if entry.title == title)
    assert entry.path == ("Help", "Guided walks")
    entry.action.trigger()
    return window.help.guide


def points_at(guide: Any, widget: Any) -> bool:
    """Return whether the frame is around a widget, and the note beside it in the window."""
    left, right, top, bottom = (line.geometry() for line in guide.frame)
    around = left.united(right).united(top).united(bottom)
    corner = widget.mapTo(guide.parent(), widget.rect().center())
    inside = guide.parent().rect().contains(guide.bubble.geometry())
    return bool(around.contains(corner) and inside and guide.bubble.isVisible())


def test_walk_goes_on_when_a_step_is_done(open_scene: Any) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.gallery)
    guide = start(window, "Draw a draft and hang it")
    assert guide.number == 0
    assert points_at(guide, window.gallery.new_button)
    QTest.mouseClick(window.gallery.new_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: guide.number == 1 and settled(window))
    window.tabs.setCurrentWidget(window.draft)
    wait_until(lambda: guide.number == 2)
    assert points_at(guide, window.draft.grid)
    window.document.set("weave", "pattern", "twill 2/1")
    wait_until(lambda: guide.number == 3)
    guide.next_button.click()  # leaves out the colours
    assert guide.number == 4
    window.tabs.setCurrentWidget(window.gallery)
    wait_until(lambda: points_at(guide, window.gallery.presets[0]))
    assert window.gallery.presets[0].text() == "Hang as curtain"
    # Back shows a step again, although it is done.
    guide.back_button.click()
    guide.back_button.click()
    QTest.qWait(500)
    assert guide.number == 2
    guide.close_button.click()
    assert not guide.bubble.isVisible()
    assert not any(line.isVisible() for line in guide.frame)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "title", ["Draw a draft and hang it", "See how cloth swings", "From a weave to the loom"]
)
def test_every_step_points_to_something(open_scene: Any, title: str) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.gallery)
    guide = start(window, title)
    ended: list[bool] = []
    guide.ended.connect(ended.append)
    seen = set()
    while guide.steps:
        seen.add(guide.number)
        frame = guide.frame[0].geometry().united(guide.frame[1].geometry())
        assert frame.width() > 10
        assert guide.parent().rect().contains(guide.bubble.geometry())
        assert guide.text.height() >= guide.text.heightForWidth(guide.text.width())
        guide.next_button.click()
    assert len(seen) > 3
    assert ended == [True]
