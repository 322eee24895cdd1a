"""Composing pictures in the window: lights, saved cameras, the clipboard, pages and sweeps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import Qt, QTimer  # noqa: E402
from PySide6.QtGui import QDesktopServices, QGuiApplication, QImage  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog  # noqa: E402

from spacemap_vtk.app.documents.document import Document  # noqa: E402
from spacemap_vtk.app.work.export_dialog import ExportDialog  # noqa: E402
from spacemap_vtk.app.work.figure_dialog import FigureDialog  # noqa: E402
from spacemap_vtk.app.work.sweep_dialog import SweepDialog  # noqa: E402

# Otherwise each process would solve the modes again.
pytestmark = pytest.mark.usefixtures("kept_modes")


def when_open(kind: type[QDialog], act: Callable[[Any], None]) -> None:
    """Act on a dialog of a kind as soon as it is open."""

    def try_now() -> None:
        dialog = QApplication.activeModalWidget()
        if isinstance(dialog, kind):
            act(dialog)
        else:
            QTimer.singleShot(50, try_now)

    QTimer.singleShot(50, try_now)


def pixels_of(image: QImage) -> np.ndarray:
    image = image.convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).astype(int)


def test_a_light_changes_the_view_at_once_and_can_be_undone(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    before = window.view.image().astype(int)
    window.tools.lights["raking"].trigger()
    assert window.document.scene.view.light == "raking"
    raking = window.view.image().astype(int)
    assert np.abs(raking - before).mean() > 3
    window.tools.lights[None].trigger()
    assert "light" not in window.document.values.get("view", {})
    window.document.history.undo()
    assert window.tools.lights["raking"].isChecked()


def test_a_saved_camera_is_found_again(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    window.tools.cameras["lying"].trigger()
    window.view.zoom(2.0)
    there, saved = window.view.viewpoint, window.tools.saved_cameras
    saved.save_as("hem")
    assert window.document.scene.view.cameras[0].name == "hem"
    assert [go_to.text() for go_to in saved.cameras] == ["hem"]
    window.tools.cameras["front"].trigger()
    saved.cameras[0].trigger()
    assert window.view.viewpoint.position == pytest.approx(there.position, rel=1e-4)
    assert window.view.viewpoint.focus == pytest.approx(there.focus, abs=1e-6)
    saved.save_as("front")
    assert "a name of its own" in window.errors.text
    window.document.set("view", "camera", "hem")
    saved.delete("hem")
    assert window.document.scene.view.cameras == ()
    assert window.document.scene.view.camera == "three-quarter"
    window.document.history.undo()
    assert window.document.scene.view.camera == "hem"


def test_cards_of_the_view_add_a_close_up_and_choose_a_saved_camera(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    window.tools.cameras["front"].trigger()
    window.tools.saved_cameras.save_as("hem")
    window.tools.cameras["lying"].trigger()
    window.stages.select("view")
    rows = window.properties.rows
    box = rows["camera"].editor.box
    box.setCurrentText("hem")
    box.activated.emit(box.currentIndex())
    assert window.document.scene.view.camera == "hem"
    assert np.array(window.view.viewpoint.up) == pytest.approx([0.0, 1.0, 0.0])
    rows["insets"].editor.add_button.menu().actions()[2].trigger()
    (inset,) = window.document.scene.view.insets
    assert (inset.corner, inset.place) == ("lower right", (0.5, 0.5))
    rows["cameras"].editor.add_button.menu().actions()[1].trigger()
    assert window.document.scene.view.cameras[1].height == 0.1


def test_the_picture_of_the_view_is_copied(open_scene: Any) -> None:
    window = open_scene("twill_2_2")
    window.menus.actions["Copy picture"].trigger()
    assert "in the clipboard" in window.statusBar().currentMessage()
    copied = pixels_of(QGuiApplication.clipboard().image())
    assert np.array_equal(copied, window.view.image())


@pytest.mark.nightly
def test_the_exported_picture_is_copied(open_scene: Any) -> None:
    window, done = open_scene("twill_2_2"), []
    window.exports.copied.connect(done.append)
    window.menus.actions["Copy exported picture"].trigger()
    wait_until(lambda: done or window.errors.text)
    assert window.errors.text == ""
    copied, shown = pixels_of(QGuiApplication.clipboard().image()), window.view.image()
    assert copied.shape == shown.shape
    assert np.abs(copied - shown).mean() < 12


def test_the_dialog_offers_an_orbit_for_a_still_scene_and_says_what_the_file_shows(
    open_scene: Any,
) -> None:
    window, texts = open_scene("twill_2_2"), []

    def look(dialog: Any) -> None:
        texts.append(dialog.summary.text())
        dialog.time_lines["orbit"].setText("0")
        texts.append(dialog.summary.text())
        dialog.reject()

    def enlarge(dialog: Any) -> None:
        texts.append(dialog.summary.text())
        dialog.width_box.setValue(8000)
        dialog.height_box.setValue(6000)
        texts.append(dialog.summary.text())
        dialog.reject()

    when_open(ExportDialog, look)
    window.menus.actions["Export film…"].trigger()
    window.view.zoom(0.15)
    wait_until(lambda: settled(window))
    when_open(ExportDialog, enlarge)
    window.menus.actions["Export picture…"].trigger()
    assert texts[0].startswith("200 frames")
    assert "all frames would be the same" in texts[1]
    assert "will show fibres" not in texts[2]
    assert "will show fibres" in texts[3]


@pytest.mark.nightly
def test_an_exported_picture_has_a_close_up_of_the_picked_point(
    open_scene: Any, tmp_path: Path
) -> None:
    window, done = open_scene("twill_2_2"), []
    window.exports.written.connect(done.append)
    window.view.click(window.view.canvas.rect().center())
    assert window.view.picks
    for number in (0, 2):

        def fill(dialog: Any, number: int = number) -> None:
            dialog.file_line.setText(str(tmp_path / f"{number}.png"))
            dialog.width_box.setValue(320)
            dialog.height_box.setValue(240)
            dialog.composition.inset.setCurrentIndex(number)
            assert dialog.composition.inset.currentText() == ("None", "", "Picked point")[number]
            dialog.accept()

        when_open(ExportDialog, fill)
        window.menus.actions["Export picture…"].trigger()
        wait_until(lambda: not window.exports.busy)
    assert window.errors.text == ""
    plain, close = (np.asarray(Image.open(tmp_path / f"{k}.png")).astype(int) for k in (0, 2))
    assert 0.05 < (np.abs(plain - close).max(axis=2) > 20).mean() < 0.5


@pytest.mark.parametrize("after", ["", "\n[animation]\nstop = 2.0\n"])
def test_one_blank_line_separates_the_cameras_of_a_file(tmp_path: Path, after: str) -> None:
    def block(number: int) -> str:
        place = f"position = [1.0, 2.0, {number}.0]"
        return f'\n[[view.cameras]]\nname = "camera {number}"\n{place}\n'

    head, file = "[weave]\n\n[view]\nzoom = 2.0\n", tmp_path / "scene.toml"
    for there in ([], [1], [1, 2]):  # in the file before
        file.write_text(head + "".join(map(block, there)) + after)
        document = Document()
        document.open(file)
        for count in range(len(there) + 1, 4):
            numbers = range(1, count + 1)
            cameras = [{"name": f"camera {n}", "position": [1.0, 2.0, float(n)]} for n in numbers]
            document.set("view", "cameras", cameras)
            assert document.text.rstrip() == (head + "".join(map(block, numbers)) + after).rstrip()
        document.set("view", "cameras", cameras[1:])
        assert document.text.rstrip() == (head + block(2) + block(3) + after).rstrip()


@pytest.mark.nightly
def test_pages_and_sweeps_are_made_from_the_menu(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, done = open_scene("twill_2_2"), []
    window.exports.written.connect(done.append)
    page = tmp_path / "page.svg"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(page), ""))
    when_open(FigureDialog, lambda dialog: dialog.accept())
    window.menus.actions["Export figure page…"].trigger()
    wait_until(lambda: not window.exports.busy)
    assert window.errors.text == ""
    assert "Draft" in page.read_text()

    def fill(dialog: Any) -> None:
        assert not dialog.accept_button.isEnabled()
        dialog.keys[0].setCurrentText("weave.ends")
        dialog.lists[0].setText("4, 6")
        dialog.folder_line.setText(str(tmp_path / "sweep"))
        assert dialog.summary.text().startswith("2 runs")
        dialog.accept()

    when_open(SweepDialog, fill)
    window.menus.actions["Run a sweep…"].trigger()
    wait_until(lambda: not window.exports.busy)
    assert window.errors.text == ""
    names = {path.name for path in (tmp_path / "sweep").iterdir()}
    assert {"table.csv", "contact_sheet.png", "ends=4.png", "ends=6.toml"} <= names
    assert done[-1].endswith("2 runs")
    opened: list[str] = []
    monkeypatch.setattr(
        QDesktopServices, "openUrl", lambda url: bool(opened.append(url.toLocalFile())) or True
    )
    for button in window.exports.open_buttons:
        assert button.isVisible()
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    assert opened == [str(tmp_path / "sweep" / name) for name in ("table.csv", "contact_sheet.png")]
