"""The gallery of scenes, the splash screen and the preview."""

from __future__ import annotations

import os
import shutil
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtGui import QColor, QImage  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QMessageBox  # noqa: E402

from spacemap_vtk.app.documents.file_thumbnails import thumbnail_of  # noqa: E402
from spacemap_vtk.app.splash import Splash  # noqa: E402
from spacemap_vtk.app.work.pipeline import Pipeline  # noqa: E402
from spacemap_vtk.cancel import Cancelled  # noqa: E402
from spacemap_vtk.draw import thumbnails  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402

NIGHTLY = pytest.mark.nightly


def item_position(window: Any, name: str) -> Any:
    pictures = window.gallery.list
    item = next(
        pictures.item(k)
        for k in range(pictures.count())
        if pictures.item(k).data(Qt.ItemDataRole.UserRole) == name
    )
    pictures.scrollToItem(item)
    return pictures.visualItemRect(item).center()


@pytest.mark.parametrize("name", library.names())
def test_every_thumbnail_is_up_to_date(name: str) -> None:
    """If this fails after a change of a scene, run python -m spacemap_vtk.draw.thumbnails."""
    assert thumbnails.stored_digest(name) == thumbnails.digest_of(name)


def test_every_thumbnail_belongs_to_a_scene() -> None:
    folder = thumbnails.file_of("").parent
    assert sorted(path.stem for path in folder.glob("*.jpg")) == library.names()


def test_starting_without_a_scene_shows_plain_weave_and_the_gallery(open_window: Any) -> None:
    window = open_window(None)
    assert window.document.source.stem == "plain_weave"
    assert window.view.image().std() > 20
    assert window.tabs.currentWidget() is window.gallery
    items = window.gallery.list.thumbnails
    assert sorted(item.data(Qt.ItemDataRole.UserRole) for item in items) == library.names()
    # The thumbnails are coloured; a missing one would be a grey card.
    for item in items:
        image = item.icon().pixmap(96, 64).toImage()
        colors = {image.pixel(x, y) for x in range(0, 96, 4) for y in range(0, 64, 4)}
        assert len(colors) > 20


@pytest.mark.nightly
def test_starting_with_a_scene_shows_the_modes_tab(open_window: Any) -> None:
    window = open_window("gust")
    assert window.tabs.currentWidget() is window.modes


@pytest.mark.parametrize(
    "how", ["click", *(pytest.param(each, marks=NIGHTLY) for each in ("double click", "keyboard"))]
)
def test_gallery_opens_a_scene(open_scene: Any, how: str) -> None:
    window = open_scene(None)
    opened: list[str] = []
    window.document.replaced.connect(lambda: opened.append(str(window.document.source)))
    pictures, left = window.gallery.list, Qt.MouseButton.LeftButton
    at = item_position(window, "twill_2_2")
    if how == "keyboard":
        pictures.setFocus()
        pictures.setCurrentItem(pictures.thumbnails[0])
        while pictures.currentItem().data(Qt.ItemDataRole.UserRole) != "twill_2_2":
            before = pictures.currentRow()
            QTest.keyClick(pictures, Qt.Key.Key_Right)
            if pictures.currentRow() == before:
                QTest.keyClick(pictures, Qt.Key.Key_Down)
                QTest.keyClick(pictures, Qt.Key.Key_Home)
            assert pictures.currentRow() != before
        QTest.keyClick(pictures, Qt.Key.Key_Return)
    else:
        QTest.mouseClick(pictures.viewport(), left, pos=at)
        if how == "double click":
            QTest.mouseDClick(pictures.viewport(), left, pos=at)
    wait_until(lambda: settled(window))
    assert opened[0].endswith("twill_2_2.toml")
    assert window.document.source.stem == "twill_2_2"
    assert window.errors.text == ""


@pytest.mark.nightly
def test_opening_a_scene_asks_about_unsaved_changes(
    open_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene(None)
    window.document.set("weave", "ends", 5)
    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.Cancel)
    at = item_position(window, "gust")
    QTest.mouseClick(window.gallery.list.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert window.document.source.stem == "plain_weave"
    assert window.document.scene.source.ends == 5


def test_new_fabric_is_drawn_without_warnings(open_scene: Any) -> None:
    window = open_scene()
    window.document.history.setClean()
    QTest.mouseClick(window.gallery.new_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and window.document.source is None)
    assert "facets" in window.status_text.full_text
    assert "⚠" not in window.status_text.full_text
    window.document.set_many("weave", {"ends": 12, "picks": 12})
    wait_until(lambda: settled(window))
    assert "⚠" not in window.status_text.full_text


def shown_scenes(window: Any) -> list[str]:
    items = [item for item in window.gallery.list.thumbnails if not item.isHidden()]
    return [item.data(Qt.ItemDataRole.UserRole) for item in items]


def test_search_shows_matching_scenes_and_enter_opens_the_first(open_scene: Any) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.gallery)
    QTest.keyClicks(window.gallery.search, "knits fair")
    assert shown_scenes(window) == ["fair_isle"]
    window.gallery.search.setText("twill 2/2")
    assert "twill_2_2" in shown_scenes(window)
    QTest.keyClick(window.gallery.search, Qt.Key.Key_Return)
    wait_until(lambda: settled(window))
    assert window.document.example_name == shown_scenes(window)[0]
    window.gallery.search.setText("no such scene")
    assert shown_scenes(window) == []
    assert window.gallery.nothing.isVisible()
    window.gallery.search.clear()
    assert shown_scenes(window)[-1] in library.names()


def test_recent_draft_has_a_thumbnail_and_opens_on_its_draft(
    open_window: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path / "cache"))
    file = tmp_path / "mine.wif"
    shutil.copy(library.folder() / "drafts/basket_weave.wif", file)
    window = open_window(None)
    assert set(shown_scenes(window)) == set(library.names())
    window.files.load(str(file))
    wait_until(lambda: settled(window))
    assert window.tabs.currentWidget() is window.draft
    assert shown_scenes(window)[0] == str(file)
    # The thumbnail is a picture of the view, and covers the view at once when the file is reopened.
    drawn = window.view.image().std()
    stored = thumbnail_of(file)
    assert stored is not None
    image = QImage(str(stored))
    assert (image.width(), image.height()) == thumbnails.SIZE
    levels = [image.pixelColor(x, 160).lightness() for x in range(0, 480, 4)]
    assert np.std(levels) > 0.3 * drawn
    window.files.load("gust")  # the program's own scenes are not listed twice
    assert shown_scenes(window)[0] == str(file)
    window.files.load(str(file))
    assert window.view.preview.isVisible()
    wait_until(lambda: settled(window))
    assert not window.view.preview.isVisible()
    os.utime(file, (time.time() + 60, time.time() + 60))  # another program has changed it
    assert thumbnail_of(file) is None


@pytest.mark.parametrize(
    ("tab", "section"),
    [
        ("modes", "response"),
        pytest.param("plots", "response", marks=NIGHTLY),
        pytest.param("pull", "yarns", marks=NIGHTLY),
    ],
)
def test_button_in_an_empty_tab_adds_its_stage(open_scene: Any, tab: str, section: str) -> None:
    window = open_scene("twill_2_2")
    before = window.document.text
    panel = getattr(window, tab)
    window.tabs.setCurrentWidget(panel)
    wait_until(panel.add_button.isVisible)
    QTest.mouseClick(panel.add_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: settled(window) and not panel.add_button.isVisible())
    assert section in window.document.scene.given_sections
    window.document.history.undo()
    assert window.document.text == before
    wait_until(lambda: settled(window) and panel.add_button.isVisible())


def test_splash_screen_closes_when_the_window_has_drawn(open_window: Any) -> None:
    splash = Splash("gust")
    screen = splash.label
    assert screen.isVisible()
    shot = screen.grab().toImage()
    assert len({shot.pixel(x, 160) for x in range(0, 480, 3)}) > 20
    window = open_window("gust", wait=False)
    splash.close_after_first_frame(window)
    wait_until(lambda: settled(window))
    assert not screen.isVisible()
    assert np.isfinite(window.view.frame.time)


@pytest.mark.nightly
def test_splash_screen_closes_when_the_first_run_is_cancelled(
    open_window: Any, tmp_path: Path
) -> None:
    scene = tmp_path / "large.toml"
    scene.write_text(
        "[weave]\n[cage]\ndivisions = [24, 24, 2]\norder = 2\n[modal]\nmodes = 400\n[response]\n"
    )
    splash = Splash(str(scene))
    screen = splash.label
    window = open_window(str(scene), wait=False)
    splash.close_after_first_frame(window)
    wait_until(
        lambda: window.stages.states["modal"] == "running" and window.cancel_button.isVisible()
    )
    assert screen.isVisible()
    window.cancel_button.click()
    wait_until(lambda: not screen.isVisible(), 30)


@pytest.mark.nightly
@pytest.mark.parametrize("dark", [False, True])
def test_scroll_bar_of_the_gallery_is_drawn_completely(open_scene: Any, dark: bool) -> None:
    window = open_scene()
    if window.menus.dark.isChecked() != dark:
        window.menus.dark.trigger()
    window.tabs.setCurrentWidget(window.gallery)
    bar = window.gallery.list.verticalScrollBar()
    assert bar.isVisible()
    assert bar.maximum() > 0
    QTest.qWait(200)
    place = bar.mapToGlobal(bar.rect().topLeft())
    screen = window.screen().grabWindow(0, place.x(), place.y(), bar.width(), bar.height())
    image = screen.toImage()
    middle = [image.pixelColor(image.width() // 2, y) for y in range(image.height())]
    # The groove was once black, darker than the rest of the window.
    limit = 24 if dark else 120
    assert min(color.lightness() for color in middle[30:-30]) >= limit
    if dark:
        window.menus.dark.trigger()


@pytest.mark.nightly
def test_late_thumbnails_are_drawn_completely(open_window: Any) -> None:
    window = open_window("plain_weave")
    window.tabs.setCurrentWidget(window.gallery)
    pictures, name = window.gallery.list, Qt.ItemDataRole.UserRole
    animal = next(i for i in pictures.thumbnails if i.data(name) == "animal_in_carved_cage")
    wait_until(lambda: not animal.icon().isNull())
    pictures.scrollToItem(animal)
    QTest.qWait(100)
    picture = pictures.viewport().grab().toImage()
    icon, cell = pictures.iconSize(), pictures.visualItemRect(animal)
    # Once only a strip was drawn, as high as an item without a picture.
    assert cell.height() > icon.height()
    x, y = cell.center().x(), cell.top()
    column = [picture.pixelColor(x, y + step) for step in range(icon.height())]
    # The animal in the middle is brown down to its feet.
    brown = [step for step, c in enumerate(column) if c.red() - c.blue() > 40]
    assert len(brown) > icon.height() // 4


@pytest.mark.nightly
@pytest.mark.parametrize("ends", ["drawn", "cancelled"])
def test_slow_scene_shows_its_thumbnail_until_it_is_drawn(
    ends: str, open_window: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window()
    view = window.view
    assert not view.preview.isVisible()
    go, run = threading.Event(), Pipeline.run

    def slow(pipeline: Pipeline, job: Any) -> Any:
        while not go.wait(0.05):
            if pipeline.token.cancelled:
                raise Cancelled("the run was stopped")
        return run(pipeline, job)

    monkeypatch.setattr(Pipeline, "run", slow)
    window.document.open("tartan")
    wait_until(view.preview.isVisible)
    assert view.preview.size() == view.size()
    # It is the thumbnail of the scene, as wide as the view allows.
    shot = view.preview.grab().toImage()
    scene = QImage(str(thumbnails.file_of("tartan")))
    middle, its_middle = shot.rect().center(), scene.rect().center()
    step, its_step = round(0.3 * view.width()), round(0.3 / 0.88 * scene.width())
    for side in (-1, 0, 1):
        color = shot.pixelColor(middle.x() + side * step, middle.y())
        around = [
            scene.pixelColor(its_middle.x() + side * its_step + x, its_middle.y() + y)
            for x in range(-4, 5)
            for y in range(-4, 5)
        ]
        for part in (QColor.red, QColor.green, QColor.blue):
            values = [part(each) for each in around]
            assert min(values) - 25 <= part(color) <= max(values) + 25
    if ends == "drawn":
        go.set()
        wait_until(lambda: settled(window))
    else:
        window.director.cancel()
        wait_until(lambda: "no picture of this scene yet" in window.errors.text)
    assert not view.preview.isVisible()
    go.set()


@pytest.mark.nightly
def test_scene_of_the_user_has_no_preview(open_window: Any, tmp_path: Path) -> None:
    file = tmp_path / "tartan.toml"
    file.write_text("[weave]\nends = 4\npicks = 4\n")
    window = open_window()
    window.document.open(str(file))
    QTest.qWait(500)
    assert not window.view.preview.isVisible()
