"""Drafts of the draft tab: stored, saved and opened."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from window import require_display, settled, type_into, wait_until

require_display()

from PySide6.QtWidgets import QFileDialog, QLabel, QMessageBox  # noqa: E402
from test_window_draft import LEFT, click, drawdown_of  # noqa: E402

from spacemap_vtk.app.documents.draft_versions import DraftVersions  # noqa: E402
from spacemap_vtk.errors import InputError  # noqa: E402
from spacemap_vtk.io.drafts.wif import parse_wif, read_wif  # noqa: E402
from spacemap_vtk.io.drafts.wif_writer import format_wif  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.editable_draft import format_colors  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402
from spacemap_vtk.textile.drafts.draft import Draft  # noqa: E402


def test_edited_draft_is_saved_next_to_its_scene(draft_of: Any, qtbot: Any, twill: Path) -> None:
    window = draft_of(twill)
    original = read_wif(twill.with_suffix(".wif")).loom
    click(qtbot, window, "threading", 2, 4)
    saved = window.document.scene.source.draft
    window.menus.actions["Copy as command line"].trigger()
    assert "Save the scene" in window.errors.text
    # An existing file of that name is never overwritten.
    other = twill.parent / "mine.wif"
    other.write_text("not mine")
    window.document.save(twill.parent / "mine.toml")
    assert other.read_text() == "not mine"
    scene = Scene.read(twill.parent / "mine.toml")
    assert scene.source.draft.name == "mine-2.wif"
    assert read_wif(scene.source.draft).loom.threading[1] == (4,)
    # The scene's own draft is overwritten.
    click(qtbot, window, "threading", 3, 4)
    window.document.save()
    assert read_wif(twill.parent / "mine-2.wif").loom.threading[1:3] == ((4,), (4,))
    assert not (twill.parent / "mine-3.wif").exists()
    assert read_wif(twill.with_suffix(".wif")).loom == original
    assert saved.is_file()  # for undo


def test_draft_versions_are_deleted_with_their_owner(twill: Path) -> None:
    keeper = DraftVersions()
    path = keeper.add(read_wif(twill.with_suffix(".wif")))
    assert keeper.contains(path)
    assert not keeper.contains(twill)
    assert keeper.add(read_wif(twill.with_suffix(".wif"))) == path
    del keeper
    assert not path.parent.exists()


def test_draft_version_is_complete_after_a_failed_write(
    small_disk: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = small_disk(2**16)
    monkeypatch.setattr(tempfile, "tempdir", str(disk))
    drawdown = np.random.default_rng(1).random((60, 60)) < 0.5
    wif = parse_wif(format_wif(Draft(drawdown)))
    assert len(format_wif(wif)) > 2**12
    (disk / "fill").write_bytes(bytes(2**16 - 2**12))  # too little space
    keeper = DraftVersions()
    with pytest.raises(InputError, match=f"Free space in {disk}"):
        keeper.add(wif)
    (disk / "fill").unlink()
    np.testing.assert_array_equal(read_wif(keeper.add(wif)).drawdown, drawdown)


def test_drafts_can_be_opened_and_saved_as_wif(
    draft_of: Any, qtbot: Any, twill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = draft_of("plain_weave")
    monkeypatch.setattr(
        QFileDialog, "getOpenFileName", lambda *_: (str(twill.with_suffix(".wif")), "")
    )
    out = twill.parent / "out"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(out), ""))
    divisions = window.document.scene.cage.divisions
    qtbot.mouseClick(window.draft.open_button, LEFT)
    assert drawdown_of(window).shape == (8, 8)
    assert window.document.scene.cage.divisions == divisions  # the rest of the scene is unchanged
    click(qtbot, window, "treadling", 4, 1)
    qtbot.mouseClick(window.draft.save_button, LEFT)
    written = read_wif(out.with_suffix(".wif"))
    assert written.loom == window.draft.grid.shown.loom
    assert window.document.scene.source.draft == out.with_suffix(".wif")
    wait_until(lambda: settled(window))
    # A file that is not a draft is reported, and the cloth stays.
    bad = twill.parent / "bad.wif"
    bad.write_text("nonsense")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(bad), ""))
    qtbot.mouseClick(window.draft.open_button, LEFT)
    wait_until(lambda: window.errors.text)
    window.menus.actions["Undo"].trigger()
    assert drawdown_of(window).shape == (8, 8)


def save_draft(window: Any, qtbot: Any, monkeypatch: pytest.MonkeyPatch, file: Path) -> None:
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    qtbot.mouseClick(window.draft.save_button, LEFT)
    assert read_wif(file).loom == window.draft.grid.shown.loom


@pytest.mark.nightly
def test_edited_draft_is_shown_by_its_original_name(
    draft_of: Any, qtbot: Any, twill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = draft_of(twill)
    window.stages.select("weave")
    line = window.properties.rows["draft"].editor.line
    assert line.text() == "twill.wif"
    click(qtbot, window, "threading", 2, 4)
    assert line.text() == "twill.wif (edited)"
    assert not any("spacemap-drafts" in label.text() for label in window.findChildren(QLabel))
    # Leaving the field unchanged has no effect.
    type_into(line, line.text())
    assert window.errors.text == ""
    assert window.document.drafts.contains(window.document.scene.source.draft)
    # A message shows that name too, for example if the file was deleted.
    window.document.scene.source.draft.unlink()
    window.document.set("weave", "warp_spacing", "1 mm")
    wait_until(lambda: window.errors.text)
    assert "twill.wif (edited)" in window.errors.text
    assert "spacemap-drafts" not in window.errors.text
    window.document.history.undo()
    window.document.history.undo()
    click(qtbot, window, "threading", 2, 4)
    wait_until(lambda: settled(window))
    save_draft(window, qtbot, monkeypatch, twill.parent / "mine.wif")
    assert line.text() == "mine.wif"


@pytest.mark.nightly
def test_saved_draft_leaves_no_unsaved_change(
    draft_of: Any, qtbot: Any, twill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, text = draft_of(twill), twill.read_text()
    click(qtbot, window, "threading", 2, 4)
    assert window.isWindowModified()
    # The scene file refers to another draft.
    save_draft(window, qtbot, monkeypatch, twill.parent / "mine.wif")
    assert window.isWindowModified()
    click(qtbot, window, "threading", 3, 4)
    save_draft(window, qtbot, monkeypatch, twill.with_suffix(".wif"))
    assert not window.isWindowModified()
    assert window.document.text == text
    click(qtbot, window, "threading", 4, 1)
    assert window.isWindowModified()
    window.document.history.undo()
    assert not window.isWindowModified()
    # Other values of the scene are not saved with the draft.
    window.document.set("response", "alpha", 3.0)
    click(qtbot, window, "threading", 4, 1)
    save_draft(window, qtbot, monkeypatch, twill.with_suffix(".wif"))
    assert window.isWindowModified()


@pytest.mark.nightly
def test_opened_draft_is_saved_as_a_draft(
    draft_of: Any, qtbot: Any, twill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = draft_of(twill.with_suffix(".wif"))
    click(qtbot, window, "threading", 2, 4)
    type_into(window.draft.counts["ends"].lineEdit(), "12")
    click(qtbot, window, "warp", 2, 0)
    assert window.isWindowModified()
    file = twill.parent / "mine.wif"
    save_draft(window, qtbot, monkeypatch, file)
    assert not window.isWindowModified()
    # Leaving loses nothing: the file equals the scene.
    seen = window.document.scene.woven.cloth
    again = Scene.read(file).woven.cloth
    np.testing.assert_array_equal(again.drawdown, seen.drawdown)
    np.testing.assert_array_equal(again.warp.colors, seen.warp.colors)
    window.document.history.undo()
    assert window.isWindowModified()
    window.document.history.redo()
    window.document.set("cage", "divisions", [3, 3, 1])
    save_draft(window, qtbot, monkeypatch, file)
    assert window.isWindowModified()


def test_draft_can_be_opened_edited_and_saved_as_a_document(
    draft_of: Any, qtbot: Any, twill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, notes = (
        twill.with_suffix(".wif"),
        "[TEXT]\nAuthor=Ada\n[NOTES]\n1=for the loom upstairs\n",
    )
    file.write_text(notes + file.read_text())
    original = file.read_bytes()
    window = draft_of(file)
    assert window.windowTitle().startswith("twill.wif")
    click(qtbot, window, "threading", 2, 4)
    click(qtbot, window, "warp", 2, 0)
    assert window.isWindowModified()
    window.menus.actions["Save"].trigger()
    assert not window.isWindowModified()
    assert window.errors.text == ""
    again = read_wif(file)
    assert again.loom == window.draft.grid.shown.loom
    assert again.loom.threading[1] == (4,)
    assert {k: [*v] for k, v in again.other_sections.items()} == {
        "TEXT": ["Author=Ada"],
        "NOTES": ["1=for the loom upstairs"],
    }
    monkeypatch.setattr(QMessageBox, "question", lambda *_: pytest.fail("asked"))
    assert window.files.confirm_close()
    # Undo restores the former content of the file.
    for _ in range(2):
        window.menus.actions["Undo"].trigger()
    assert window.document.scene.source.draft.read_bytes() == original
    # Values that a draft cannot store are reported as unsaved.
    window.document.set("cage", "divisions", [3, 3, 1])
    window.menus.actions["Save"].trigger()
    assert "a draft file cannot store cage.divisions" in window.errors.text
    assert window.isWindowModified()
    dialogs: list[tuple[str, ...]] = []

    def answer(_parent: Any, *about: str) -> tuple[str, str]:
        dialogs.append(about)
        return next(answers, ("", ""))

    twill.unlink()
    # Another file type is chosen, with the proposed name.
    answers = iter([(str(file), "Scenes (*.toml)")])

    monkeypatch.setattr(QFileDialog, "getSaveFileName", answer)
    window.menus.actions["Save as…"].trigger()
    assert window.document.file == twill
    assert Scene.read(twill).cage.divisions == (3, 3, 1)
    dialogs.clear()
    # Opening another draft replaces the document.
    window.document.open(file)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(other), ""))
    other = file.with_name("other.wif")
    other.write_bytes(original)
    window.draft.open_button.click()
    assert window.document.file == other
    # A format that can only be read.
    file.rename(other := file.with_suffix(".wifw"))
    window.document.open(other)
    window.menus.actions["Save"].trigger()
    window.document.open("twill_2_2")
    window.menus.actions["Save as…"].trigger()
    assert [about[1] for about in dialogs] == [str(file), str(file.parent / "twill_2_2.toml")]
    assert ".wifw cannot be written" in dialogs[0][0]


def test_yarn_colours_are_written_as_their_repeat() -> None:
    a, b = (1, 2, 3), (4, 5, 6)

    def series(*rows: tuple[int, ...]) -> Any:
        return format_colors(np.array(rows, dtype=np.uint8))

    assert series(a, a, a) == "#010203"
    assert series(a, b, a) == ["#010203", "#040506"]
    assert series(a, a, b) == ["#010203", "#010203", "#040506"]
    many = np.arange(2001 * 3, dtype=np.uint8).reshape(-1, 3)
    assert len(format_colors(many)) == 2001


def test_edited_draft_keeps_the_data_of_its_file(draft_of: Any, qtbot: Any) -> None:
    source = library.folder() / "32-shaft_twill.wif"
    window = draft_of(source, wait=False)
    before = window.document.scene.woven.cloth
    click(qtbot, window, "threading", 31, 1)
    now = window.document.scene.source
    saved, original = read_wif(now.draft), read_wif(source)
    assert saved.loom.tieup == original.loom.tieup
    assert saved.warp.thickness == original.warp.thickness
    np.testing.assert_array_equal(saved.warp.colors, original.warp.colors)
    np.testing.assert_array_equal(now.cloth.warp.colors, before.warp.colors)
    assert np.array_equal(now.cloth.warp.diameter, before.warp.diameter)
    assert format_wif(saved) == now.draft.read_bytes()
