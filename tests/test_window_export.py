"""Export of pictures, films and data: complete or not at all, and cancelled at once."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree
from window import require_display, settled, wait_until

require_display()

import pyvista as pv  # noqa: E402
from PySide6.QtCore import QEvent, Qt, QTimer  # noqa: E402
from PySide6.QtGui import QFocusEvent  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication, QFileDialog, QPushButton  # noqa: E402

from spacemap_vtk.app.work.export_dialog import ExportDialog  # noqa: E402

# Otherwise each process would solve the modes again.
pytestmark = pytest.mark.usefixtures("kept_modes")


def record_written(window: Any) -> list[str]:
    names: list[str] = []
    window.exports.written.connect(names.append)
    return names


def fill_dialog(file: Path, width: int, height: int, seen: int) -> None:
    """Fill in the export dialog as soon as it opens, and press Save."""
    dialog = QApplication.activeModalWidget()
    if not isinstance(dialog, ExportDialog):
        QTimer.singleShot(50, lambda: fill_dialog(file, width, height, seen))
        return
    dialog.file_line.selectAll()
    QTest.keyClicks(dialog.file_line, str(file))
    dialog.width_box.setValue(width)
    dialog.height_box.setValue(height)
    dialog.camera.setCurrentIndex(seen)
    save = next(b for b in dialog.findChildren(QPushButton) if b.text() in ("Save", "&Save"))
    QTest.mouseClick(save, Qt.MouseButton.LeftButton)


@pytest.mark.nightly
def test_exported_picture_has_the_camera_of_the_window(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.tools.part_actions["cage"].trigger()
    done = record_written(window)
    pictures = []
    for camera in ("front", "right"):
        window.tools.cameras[camera].trigger()
        file = tmp_path / f"{camera}.png"
        QTimer.singleShot(50, lambda file=file: fill_dialog(file, 320, 240, 0))
        window.menus.actions["Export picture…"].trigger()
        wait_until(lambda file=file: str(file) in done or window.errors.text)
        assert window.errors.text == ""
        pictures.append(np.asarray(Image.open(file)).astype(int))
        assert pictures[-1].shape == (240, 320, 3)
    # The message stays for a while, whatever is drawn.
    window.times.go_to(0.1)
    wait_until(lambda: settled(window) and window.view.frame.time == 0.1)
    assert window.statusBar().currentMessage() == f"Saved: {file}"
    # From the side, the cloth is narrow.
    coloured = [(np.ptp(picture, axis=2) > 40).any(axis=0).sum() for picture in pictures]
    assert coloured[1] < 0.6 * coloured[0]


def find_yarns(picture: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """Return a mask of the yarns in a picture, and the fractions of width and height they fill."""
    mask = np.ptp(picture.astype(int), axis=2) > 40
    shares = [np.ptp(np.flatnonzero(mask.any(axis=axis))) / mask.shape[1 - axis] for axis in (0, 1)]
    return mask, (shares[0], shares[1])


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("widths", "size"),
    [
        ((300, 260, 640), (400, 300)),
        pytest.param((200, 900, 100), (240, 480), marks=pytest.mark.nightly),
        pytest.param((300, 260, 640), (240, 480), marks=pytest.mark.nightly),
        pytest.param((200, 900, 100), (400, 300), marks=pytest.mark.nightly),
    ],
)
def test_exported_picture_of_any_shape_is_filled(
    open_scene: Any, tmp_path: Path, widths: tuple[int, ...], size: tuple[int, int]
) -> None:
    window = open_scene()
    window.splitter.setSizes(widths)
    wait_until(lambda: settled(window))
    window.tools.cameras["front"].trigger()
    for name in ("cage", "triad", "scale_bar"):
        window.tools.part_actions[name].trigger()
    wait_until(lambda: settled(window))
    _, seen = find_yarns(window.view.image())
    file, done = tmp_path / "cloth.png", record_written(window)
    QTimer.singleShot(50, lambda: fill_dialog(file, *size, 0))
    window.menus.actions["Export picture…"].trigger()
    wait_until(lambda: str(file) in done or window.errors.text)
    _, shares = find_yarns(np.asarray(Image.open(file)))
    assert max(shares) == pytest.approx(max(seen), abs=0.02)


@pytest.mark.nightly
def test_exported_picture_contains_at_least_the_zoomed_view(open_scene: Any) -> None:
    window = open_scene()
    window.tools.cameras["front"].trigger()
    window.view.zoom(4.0)
    width, height = window.view.camera_view.size
    wide, tall = (
        window.view.viewpoint_for((2 * height, height)),
        window.view.viewpoint_for((height, 2 * height)),
    )
    # The cloth fills the view: a wider picture has its whole height, a taller one all its width.
    tangent = np.tan(np.radians(window.view.viewpoint.angle / 2))
    assert np.tan(np.radians(wide.angle / 2)) == pytest.approx(tangent)
    assert 0.5 * np.tan(np.radians(tall.angle / 2)) == pytest.approx(
        tangent * width / height, rel=1e-6
    )
    window.tools.orthographic.trigger()
    here = window.view.viewpoint
    assert window.view.viewpoint_for((width, height)).parallel_scale == pytest.approx(
        here.parallel_scale
    )
    tall = window.view.viewpoint_for((height, 2 * height))
    assert 0.5 * tall.parallel_scale == pytest.approx(here.parallel_scale * width / height)


@pytest.mark.nightly
def test_dark_window_exports_its_background_and_wireframe(open_scene: Any, tmp_path: Path) -> None:
    window, done = open_scene(), []
    window.exports.written.connect(done.append)
    window.menus.dark.trigger()
    window.tools.part_actions["cage"].trigger()
    window.view.zoom(6.0)
    filled = window.view.image()
    window.tools.keys.wireframe.trigger()
    pictures = []
    try:
        for name, seen in (("window.png", 0), ("scene.png", 1)):
            file = tmp_path / name
            QTimer.singleShot(50, lambda file=file, seen=seen: fill_dialog(file, 320, 240, seen))
            window.menus.actions["Export picture…"].trigger()
            wait_until(lambda file=file: str(file) in done or window.errors.text)
            assert window.errors.text == ""
            pictures.append(np.asarray(Image.open(file)))
        view_image = window.view.image()
    finally:
        window.menus.dark.trigger()
    tops = [np.median(picture[0], axis=0) for picture in (view_image, *pictures)]
    assert np.abs(tops[0] - tops[1]).max() <= 3
    assert (tops[2] > 200).all()
    # Edges cover only a part of the cloth, as in the view.
    shares = [find_yarns(picture)[0].mean() for picture in (pictures[0], view_image, filled)]
    assert shares[0] < 0.6 * shares[2]
    assert shares[1] < 0.6 * shares[2]


@pytest.mark.nightly
def test_export_dialog_applies_presets_and_remembers_the_size(
    open_scene: Any, tmp_path: Path
) -> None:
    window, done = open_scene(), []
    window.exports.written.connect(done.append)
    seen: list[Any] = []

    def fill(name: str, preset: str) -> None:
        dialog = QApplication.activeModalWidget()
        if not isinstance(dialog, ExportDialog):
            QTimer.singleShot(50, lambda: fill(name, preset))
            return
        seen.append((dialog.file, dialog.preset.currentText(), dialog.picture_size))
        dialog.preset.textActivated.emit(preset)
        seen.append(dialog.picture_size)
        dialog.file_line.setText(str(tmp_path / name))
        seen.append(dialog.transparent.isEnabled())
        dialog.width_box.setValue(320)
        dialog.height_box.setValue(200)
        dialog.transparent.setChecked(True)
        dialog.accept_button.click()

    for name, preset in (("a.png", "4K"), ("b.jpg", "1080p")):
        QTimer.singleShot(50, lambda given=(name, preset): fill(*given))
        window.menus.actions["Export picture…"].trigger()
        wait_until(lambda name=name: str(tmp_path / name) in done or window.errors.text)
        assert window.errors.text == ""
    assert seen[0][1:] == ("Scene", (1600, 800))
    assert (seen[1], seen[4]) == ((3840, 2160), (1920, 1080))
    assert seen[3] == (tmp_path / "plain_weave.png", "Other", (320, 200))
    assert (seen[2], seen[5]) == (True, False)
    with Image.open(tmp_path / "a.png") as clear, Image.open(tmp_path / "b.jpg") as filled:
        cover = np.asarray(clear)[..., 3]
        assert cover[0, 0] == 0
        assert 0.1 < (cover == 255).mean() < 0.9
        assert filled.mode == "RGB"
        # The covered pixels are equal up to JPEG compression.
        both = np.asarray(clear)[..., :3].astype(int), np.asarray(filled).astype(int)
        assert np.abs(both[0] - both[1])[cover == 255].mean() < 15.0


@pytest.mark.nightly
def test_data_lost_by_a_format_are_reported(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene("twill_2_2")
    done = record_written(window)
    file = tmp_path / "twill.dtx"
    window.exports.start("draft", file)
    wait_until(lambda: str(file) in done)
    assert "a .dtx cannot store a thickness" in window.errors.text
    assert b"@@Threading" in file.read_bytes()
    window.exports.start("draft", file.with_suffix(".wif"))
    wait_until(lambda: len(done) == 2)
    assert window.errors.text == ""


def test_film_has_all_its_frames(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.document.set("animation", "stop", "20 ms")
    done = record_written(window)
    file = tmp_path / "swing.gif"
    QTimer.singleShot(50, lambda: fill_dialog(file, 160, 120, 1))
    window.menus.actions["Export film…"].trigger()
    wait_until(lambda: done or window.errors.text)
    assert window.errors.text == ""
    with Image.open(file) as film:
        assert film.n_frames == 5
    assert sorted(tmp_path.glob(".spacemap*")) == []


@pytest.mark.nightly
def test_cancelled_film_leaves_no_file(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    window.document.set("animation", "speed", 0.001)
    file = tmp_path / "long.gif"
    file.write_bytes(b"what was there")
    window.exports.start("film", file, size=(320, 240))
    bar = window.exports.bar
    wait_until(lambda: bar.maximum() > 100 and bar.value() >= 2, 60)
    # Work can go on meanwhile, except for another film.
    assert bar.isVisible()
    window.menus.actions["Export film…"].trigger()
    assert "long.gif is being written. Wait" in window.errors.text
    window.times.go_to(0.1)
    wait_until(lambda: settled(window) and window.view.frame.time == 0.1)
    questions: list[str] = []

    def refuse() -> None:
        box = QApplication.activeModalWidget()
        questions.append(box.text())
        next(button for button in box.buttons() if button.text() == "Keep writing").click()

    QTimer.singleShot(200, refuse)
    window.close()
    assert window.isVisible()
    assert "long.gif is being written" in questions[0]
    window.document.history.setClean()
    window.errors.clear()
    QTest.qWait(100)  # the view is larger again
    wait_until(lambda: settled(window))
    QTest.mouseClick(window.exports.cancel_button, Qt.MouseButton.LeftButton)
    # The film itself would take minutes.
    wait_until(lambda: not window.exports.busy)
    assert file.read_bytes() == b"what was there"
    assert [path.name for path in tmp_path.iterdir() if "spacemap-" in path.name] == []
    assert window.errors.text == ""


@pytest.mark.parametrize("encoder", [pytest.param(True, marks=pytest.mark.nightly), False])
def test_film_without_an_encoder_is_neither_proposed_nor_started(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoder: bool
) -> None:
    window = open_scene()
    if encoder:
        pytest.importorskip("imageio_ffmpeg")
    else:
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    proposed: list[tuple[str, str]] = []
    messages: list[str] = []

    def look() -> None:
        dialog = QApplication.activeModalWidget()
        proposed.append((dialog.file.name, dialog._picture.filters))
        # Requirements are checked before the export starts.
        dialog.file_line.setText(str(tmp_path / "film.mp4"))
        messages.append(dialog.summary.text())
        assert dialog.accept_button.isEnabled() == encoder
        dialog.file_line.setText(str(tmp_path / "film.avi"))
        assert not dialog.accept_button.isEnabled()
        dialog.reject()

    QTimer.singleShot(200, look)
    window.menus.actions["Export film…"].trigger()
    assert proposed[0][0] == ("plain_weave.mp4" if encoder else "plain_weave.gif")
    assert ("50 frames" if encoder else "pip install 'spacemap_vtk[movie]'") in messages[0]
    assert ("*.mp4" in proposed[0][1]) == encoder
    window.exports.start("film", tmp_path / "film.mp4", size=(160, 120))
    assert window.exports.busy == encoder
    window.exports.stop()
    if not encoder:
        assert "pip install 'spacemap_vtk[movie]'" in window.errors.text
    assert list(tmp_path.glob("*.mp4")) == []


@pytest.mark.parametrize(
    ("words", "ending", "cells"),
    [
        ("Cage with its motion", ".vtu", 125),
        ("Surface", ".stl", None),
        pytest.param("Bézier patches", ".vtu", None, marks=pytest.mark.nightly),
        pytest.param("Surface", ".vtp", None, marks=pytest.mark.nightly),
    ],
)
def test_exported_data_belong_to_the_shown_time(
    open_scene: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: str,
    ending: str,
    cells: int | None,
) -> None:
    window = open_scene()
    done, file = record_written(window), tmp_path / f"data{ending}"
    answer = str(file), f"{words} (*{ending})"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: answer)
    window.menus.actions["Export data…"].trigger()
    wait_until(lambda: done or window.errors.text)
    assert window.errors.text == ""
    data = pv.read(file)
    assert cells is None or data.n_cells == cells
    if words == "Surface":
        here = np.array(window.view.frame.surface.GetBounds())
        np.testing.assert_allclose(data.bounds, here, atol=1e-6)


@pytest.mark.nightly
def test_exported_yarns_are_irregular_only_on_request(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, found = open_scene(), []
    for name in ("regular", "irregular"):
        done, file = record_written(window), tmp_path / f"{name}.stl"
        answer = str(file), "Surface (*.stl)"
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, answer=answer: answer)
        window.menus.actions["Irregular yarns in data"].setChecked(name == "irregular")
        window.menus.actions["Export data…"].trigger()
        wait_until(lambda done=done: done or window.errors.text)
        assert window.errors.text == ""
        found.append(pv.read(file).points)
    assert 5e-6 < cKDTree(found[0]).query(found[1])[0].max() < 5e-5


@pytest.mark.nightly
def test_exported_series_has_the_typed_times(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    done, file = record_written(window), tmp_path / "cloth.pvd"
    answer = str(file.with_suffix("")), "Surface, all times (*.pvd)"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: answer)
    messages: list[str] = []

    def fill() -> None:
        dialog = QApplication.activeModalWidget()
        if not isinstance(dialog, ExportDialog):
            QTimer.singleShot(50, fill)
            return
        messages.append(dialog.summary.text())
        for name, text in {"frames_per_second": "50", "start": "1 s", "stop": "0.3"}.items():
            dialog.time_lines[name].selectAll()
            QTest.keyClicks(dialog.time_lines[name], text)
        messages.append(dialog.summary.text())
        assert not dialog.accept_button.isEnabled()
        dialog.time_lines["start"].setText("292 ms")
        messages.append(dialog.summary.text())
        QTest.mouseClick(dialog.accept_button, Qt.MouseButton.LeftButton)

    QTimer.singleShot(50, fill)
    window.menus.actions["Export data…"].trigger()
    wait_until(lambda: done or window.errors.text)
    assert window.errors.text == ""
    assert messages[0] == "50 times, 4 ms apart; 1 s of film shows 100 ms"
    assert "a time after animation.start = 1 s" in messages[1]
    assert messages[2].startswith("4 times, 2 ms apart")
    assert done[0].startswith(f"{file}: 4 times, ")
    reader = pv.PVDReader(file)
    np.testing.assert_allclose(reader.time_values, [0.292, 0.294, 0.296, 0.298], rtol=1e-12)
    before = {each: each.read_bytes() for each in tmp_path.rglob("*.*")}
    window.exports.start("surface", file, times=list(np.arange(1000) / 1000))
    wait_until(lambda: window.exports.bar.value() >= 2)
    window.exports.cancel()
    wait_until(lambda: not window.exports.busy)
    assert {each: each.read_bytes() for each in tmp_path.rglob("*.*")} == before
    assert len([each for each in before if each.suffix == ".vtp"]) == 4


def test_failed_exports_are_reported(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.exports.start("picture", tmp_path / "no" / "picture.png")
    assert "does not exist" in window.errors.text
    window.exports.start("picture", tmp_path / "picture.bmp")
    assert ".bmp" in window.errors.text
    # Errors of the child process are reported.
    window.document.set("animation", "start", "1 s")
    wait_until(lambda: settled(window))
    window.exports.start("film", tmp_path / "none.gif", size=(160, 120))
    wait_until(lambda: not window.exports.busy)
    assert "animation.stop" in window.errors.text
    assert list(tmp_path.glob("none*")) == []


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("surface", "x.vtp"),
        pytest.param("film", "x.mp4", marks=pytest.mark.nightly),
        pytest.param("picture", "x.png", marks=pytest.mark.nightly),
    ],
)
def test_full_disk_is_reported_and_the_old_file_stays(
    open_scene: Any, small_disk: Any, kind: str, name: str
) -> None:
    disk = small_disk(2**15)
    (disk / name).write_bytes(b"what was there")
    window = open_scene()
    window.document.set("animation", "speed", 1.0)
    size = {} if kind == "surface" else {"size": (480, 360)}
    window.exports.start(kind, disk / name, **size)
    wait_until(lambda: not window.exports.busy)
    assert f"{name}: could not be written: disk full. " in window.errors.text
    assert ".spacemap-" not in window.errors.text
    assert [(path.name, path.read_bytes()) for path in disk.iterdir()] == [
        (name, b"what was there")
    ]


@pytest.mark.nightly
def test_folder_in_place_of_the_output_is_reported(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.exports.start("picture", tmp_path / "x.png", size=(160, 120))
    (tmp_path / "x.png").mkdir()
    wait_until(lambda: not window.exports.busy)
    assert "x.png: could not be written: is a directory" in window.errors.text
    assert list(tmp_path.glob(".spacemap*")) == []


_ENDED = """
import sys
from pathlib import Path
from spacemap_vtk.app.requirements import require_window
require_window()
from PySide6.QtCore import QTimer
from spacemap_vtk.app.launch import launch
def begin(window):
    window.document.set("animation", "speed", 0.001)
    window.exports.start("film", Path(sys.argv[1]), size=(320, 240))
launch("plain_weave", lambda window: QTimer.singleShot(1000, lambda: begin(window)))
"""


@pytest.mark.nightly
def test_terminated_window_leaves_no_partial_file(tmp_path: Path) -> None:
    target = tmp_path / "film.mp4"
    target.write_bytes(b"what was there")
    with subprocess.Popen([sys.executable, "-c", _ENDED, str(target)]) as process:
        try:
            end = time.monotonic() + 300
            while not list(tmp_path.glob(".spacemap-*/film.mp4")):
                assert time.monotonic() < end
                time.sleep(0.1)
            process.terminate()
            assert process.wait(300) == 143
        finally:
            process.kill()  # otherwise a failed test would wait for the window to be closed
    assert [(path, path.read_bytes()) for path in tmp_path.iterdir()] == [
        (target, b"what was there")
    ]


@pytest.mark.nightly
def test_process_that_does_not_start_is_reported(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    done, folder = record_written(window), tmp_path / "pictures"
    folder.mkdir()
    for kind in ("nothing there", "no program", "ends at once"):
        program = tmp_path / kind
        if kind != "nothing there":
            program.write_text("" if kind == "no program" else "#!/bin/sh\nexit 3\n")
            program.chmod(0o644 if kind == "no program" else 0o755)
        with monkeypatch.context() as changed:
            changed.setattr(sys, "executable", str(program))
            window.exports.start("picture", folder / "picture.png", size=(160, 120))
        wait_until(lambda: not window.exports.busy)
        assert "picture.png could not be written: " in window.errors.text
        assert (str(program) if kind != "ends at once" else "code 3") in window.errors.text
        assert list(folder.iterdir()) == []
        assert not window.exports.progress.isVisible()
        window.errors.clear()
    window.exports.start("picture", folder / "picture.png", size=(160, 120))
    wait_until(lambda: done or window.exports.busy is False)
    assert done == [str(folder / "picture.png")]
    assert [path.name for path in folder.iterdir()] == ["picture.png"]


@pytest.mark.nightly
def test_typed_size_keeps_its_digits(open_scene: Any, tmp_path: Path) -> None:
    window, seen = open_scene(), []

    def fill() -> None:
        dialog = QApplication.activeModalWidget()
        if not isinstance(dialog, ExportDialog):
            QTimer.singleShot(50, fill)
            return
        dialog.file_line.setText(str(tmp_path / "large.png"))
        line = dialog.width_box.lineEdit()
        dialog.width_box.setFocus()
        for typed in ("99999", "2400"):
            line.selectAll()
            QTest.keyClicks(line, typed)
            seen.append((line.text(), dialog.summary.text(), dialog.accept_button.isEnabled()))
        # On leaving the box, a number out of range is limited to the range.
        line.selectAll()
        QTest.keyClicks(line, "99999")
        # Sent explicitly, because an inactive window gets no focus events.
        QApplication.sendEvent(dialog.width_box, QFocusEvent(QEvent.Type.FocusOut))
        seen.append((line.text(), dialog.summary.text(), dialog.accept_button.isEnabled()))
        dialog.reject()

    QTimer.singleShot(50, fill)
    window.menus.actions["Export picture…"].trigger()
    assert len(seen) == 3
    assert seen[0][0].removesuffix(" px") == "99999"
    assert "99999" in seen[0][1]
    assert "16 to 8192" in seen[0][1]
    assert not seen[0][2]
    for (text, message, enabled), size in zip(seen[1:], ("2400 px", "8192 px"), strict=True):
        assert (text, enabled) == (size, True)
        assert "out of range" not in message
