"""Work with scenes: new, recent, undo of every change, restored layout."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl  # noqa: E402
from PySide6.QtGui import QDropEvent  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QFileDialog, QMessageBox  # noqa: E402

from spacemap_vtk.app.main_window import MainWindow  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def press(window: Any, name: str) -> None:
    """Press the shortcut that the help lists for an action."""
    window.activateWindow()
    wait_until(window.isActiveWindow)
    window.setFocus()
    key = window.menus.actions[name].shortcut()[0]
    QTest.keyClick(window, key.key(), key.keyboardModifiers())


def test_new_scene_is_drawn_and_saved(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    press(window, "New")
    wait_until(lambda: settled(window) and window.document.source is None)
    assert window.view.image().std() > 20
    file = tmp_path / "first.toml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    press(window, "Save")
    assert Scene.read(file).source.ends is None
    window.document.set("weave", "ends", 4)
    assert window.isWindowModified()
    press(window, "Save")
    assert not window.isWindowModified()
    assert Scene.read(file).source.ends == 4


@pytest.mark.nightly
def test_save_as_keeps_every_comment_and_value(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "copy.toml"), "")
    )
    window = open_scene()
    for name in library.names():
        window.document.open(name)
        window.menus.actions["Save as…"].trigger()
        comments = [
            line.split("#", 1)[1]
            for line in (library.folder() / f"{name}.toml").read_text().splitlines()
            if "# " in line
        ]
        saved = (tmp_path / "copy.toml").read_text()
        assert all(comment in saved for comment in comments)
        one, other = Scene.read(name), Scene.read(tmp_path / "copy.toml")
        for stage in ("weave", "modal", "response", "view", "animation"):
            assert one.parts[stage].settings.keys() == other.parts[stage].settings.keys()
        assert one.response.settings == other.response.settings
        assert one.view.settings == other.view.settings


def test_recent_files_can_be_opened(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(f'title = "{name}"\n[weave]\nends = 3\npicks = 3\n')
        window.files.load(str(tmp_path / f"{name}.toml"))
    window.menus.recent.aboutToShow.emit()
    names = [action.text() for action in window.menus.recent.actions()]
    assert [Path(name).stem for name in names] == ["b", "a"]
    window.menus.recent.actions()[1].trigger()
    wait_until(lambda: settled(window))
    assert window.document.scene.title == "a"
    (tmp_path / "b.toml").unlink()
    assert [Path(name).stem for name in window.files.recent] == ["a"]


@pytest.mark.nightly
def test_file_dropped_on_the_view_opens_after_asking(
    open_scene: Any, twill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    window.document.set("weave", "ends", 5)
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(twill.with_suffix(".wif")))])

    def drop() -> None:
        window.dropEvent(
            QDropEvent(
                QPointF(600, 400),
                Qt.DropAction.CopyAction,
                data,
                Qt.MouseButton.LeftButton,
                Qt.KeyboardModifier.NoModifier,
            )
        )

    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.Cancel)
    drop()
    assert window.document.scene.source.ends == 5
    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.Discard)
    drop()
    wait_until(lambda: settled(window))
    assert window.document.source.name == "twill.wif"


def test_every_kind_of_change_can_be_undone_and_redone(open_scene: Any) -> None:
    window = open_scene("gust")
    document, texts = window.document, [window.document.text]
    window.stages.select("response")
    loads = window.properties.rows["loads"].editor
    window.stages.select("weave")
    pattern = window.properties.rows["pattern"].editor
    assert loads is not pattern
    for change in (
        lambda: document.set("weave", "ends", 5),
        lambda: pattern.buttons["+ end"].click(),
        lambda: document.set("modal", "fixed", None),
        lambda: window.tools.colorings["displacement"].trigger(),
        lambda: window.tools.backgrounds["Dark"].trigger(),
        lambda: document.set("response", "loads", []),
        lambda: document.set("animation", "stop", "1 s"),
        lambda: document.set("cage", "padding", 0.2),
    ):
        change()
        texts.append(document.text)
    assert len(set(texts)) == len(texts)
    for text in texts[-2::-1]:
        press(window, "Undo")
        assert document.text == text
    assert not window.isWindowModified()
    for text in texts[1:]:
        press(window, "Redo")
        assert document.text == text
    wait_until(lambda: settled(window))


@pytest.mark.nightly
def test_next_window_restores_the_layout(open_window: Any) -> None:
    window = open_window()
    window.resize(1010, 707)
    window.splitter.setSizes([340, 400, 270])
    window.menus.dark.trigger()
    assert window.menus.dark.isChecked()
    window.save_state()
    again = MainWindow()
    try:
        assert (again.width(), again.height()) == (1010, 707)
        again.start("plain_weave")
        again.show()
        wait_until(lambda: settled(again))
        assert again.splitter.sizes() == pytest.approx(window.splitter.sizes(), abs=3)
        assert again.menus.dark.isChecked()
    finally:
        again.menus.dark.trigger()
        again.discard()


def test_every_shortcut_belongs_to_one_action(open_scene: Any) -> None:
    window = open_scene()
    keys = [key for lines in window.help.key_groups.values() for key, _ in lines]
    assert len(keys) == len(set(keys))
    for name in ("Export picture…", "Export film…", "Export data…", "Save", "Undo", "New"):
        assert window.menus.actions[name].shortcut().toString() in keys


@pytest.mark.nightly
def test_window_can_be_narrow(open_scene: Any) -> None:
    window = open_scene()
    window.resize(950, 640)
    for tab in (window.gallery, window.modes, window.plots, window.draft):
        window.tabs.setCurrentWidget(tab)
        wait_until(lambda: settled(window))
        assert window.width() <= 950
        # Nothing is pushed out of view.
        for widget in (window.view, window.times, window.times.speed, tab):
            corner = widget.mapTo(window, widget.rect().bottomRight())
            assert corner.x() < window.width()
            assert corner.y() < window.height()
    assert not window.times.first.isVisible()
    window.resize(1400, 800)
    wait_until(lambda: window.times.first.isVisible())
