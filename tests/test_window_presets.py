"""Presets of motion in the window: one undo step, and a cloth that hangs in the view."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

from spacemap_vtk.app.documents.document import Document  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.presets import PRESETS  # noqa: E402

TWILL = library.folder() / "drafts" / "twill_2_2.wif"


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_is_one_undo_step(preset: str) -> None:
    document = Document()
    document.open(TWILL)
    before = document.text
    notes = document.apply_preset(preset)
    assert "cotton" in notes[0]
    assert document.history.count() == 1
    assert document.scene.moves
    assert document.scene.woven is not None
    assert document.scene.draft_file == TWILL.resolve()
    assert "bending length" in document.text  # a comment on where the lengths come from
    # Another preset replaces it; a value can be changed as usual.
    document.apply_preset("drape")
    assert document.scene.title.count(":") == 1  # it names the last preset only
    document.set("cage", "divisions", [6, 6, 1])
    assert document.scene.cage.divisions == (6, 6, 1)
    for _ in range(document.history.count()):
        document.history.undo()
    assert document.text == before
    assert not document.scene.moves


def test_a_preset_keeps_an_edited_draft() -> None:
    document = Document()
    document.open(TWILL)
    document.set("weave", "ends", 24)
    document.apply_preset("hang", yarn="20/2 silk", size=[0.1])
    assert document.scene.draft_file == TWILL.resolve()
    assert document.values["weave"]["warp_yarn"] == "20/2 silk"


def test_an_edited_draft_is_saved_with_the_scene_of_a_preset(tmp_path: Path) -> None:
    document = Document()
    document.open(TWILL)
    edited = document.drafts.add(document.scene.woven.make_draft(), TWILL)
    document.set("weave", "draft", str(edited))
    document.apply_preset("hang")
    document.save(tmp_path / "curtain.toml")
    assert document.scene.draft_file.parent == tmp_path


def test_the_button_hang_makes_a_curtain_of_a_still_cloth(open_window: Any) -> None:
    window = open_window(str(TWILL))
    assert "curtain" in window.tools.hang.toolTip()
    camera = window.view.canvas.camera
    before = camera.GetPosition()
    window.tools.hang.trigger()
    # Until the curtain is computed, the flat cloth stays in its camera, with a note.
    assert camera.GetPosition() == before
    assert window.view.preview.isVisible()
    assert "being computed" in window.modes.hint.text()
    assert window.modes.add_button.isHidden()
    assert window.document.scene.modal.fixed
    assert len(window.document.scene.modal.obstacles) == 1  # the rail
    message = window.statusBar().currentMessage()
    assert "cotton" in message
    assert "--yarn" not in message
    window.document.history.undo()
    assert not window.document.scene.moves


@pytest.mark.nightly
def test_the_menu_hangs_the_cloth_in_the_view(open_window: Any) -> None:
    window = open_window("plain_weave")
    assert all(each.isEnabled() for each in window.presets.values())
    window.presets["hang"].trigger()
    wait_until(lambda: settled(window))
    frame = window.view.frame
    moved = vtk_to_numpy(frame.cage.GetPointData().GetArray("displacement"))
    size = max(window.document.scene.woven.extent)
    assert 0.05 * size < abs(moved).max() < size
    assert "cotton" in window.statusBar().currentMessage()
    window.document.open("lever_in_tetwild_cage")
    assert not any(each.isEnabled() for each in window.presets.values())
