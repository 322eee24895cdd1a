"""Scenes as files: open, save, undo, copy and drop."""

from __future__ import annotations

import gc
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from window import require_display, settled, type_into, wait_until

require_display()

from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl  # noqa: E402
from PySide6.QtGui import QDropEvent, QGuiApplication  # noqa: E402
from PySide6.QtWidgets import QFileDialog, QMessageBox  # noqa: E402

from spacemap_vtk.app.documents.document import Document  # noqa: E402
from spacemap_vtk.cli.main import main  # noqa: E402
from spacemap_vtk.errors import SpacemapError  # noqa: E402
from spacemap_vtk.filters.base import Stage  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def open_and_check(open_scene: Any, name: str) -> Any:
    """Open a scene instead of another one, which has another picture."""
    window = open_scene("gust" if name == "plain_weave" else "plain_weave")
    before = window.view.image().astype(int)
    assert open_scene(name) is window
    assert window.errors.text == ""
    after = window.view.image()
    assert after.std() > 15
    assert np.abs(after - before).max() > 60
    view = window.view
    if view.frame.cloth is None:  # or it is drawn as a sheet of other facets
        drawn = view.scene_view.surface.GetBounds()
        np.testing.assert_allclose(drawn, view.frame.surface.GetBounds(), rtol=1e-6)
    return window


#: Scenes that are soon open: the gate opens these, the nightly run one of each kind.
QUICK = ("calculix_fabric", "plain_weave", "stockinette", "tube_bundle", "twill_2_2", "wire_mesh")


def kinds() -> list[Any]:
    """Return one scene for each set of sections; test_scenes.py draws all scenes."""
    found: dict[tuple[object, ...], str] = {}
    for name in sorted(library.names(), key=lambda name: name in QUICK):
        values = library.values_of(library.find(name))
        draft = "draft" in values.get("weave", {})
        key = *sorted(values), values.get("cage", {}).get("method"), draft
        found[key] = name
    nightly = pytest.mark.nightly
    return [pytest.param(name, marks=() if name in QUICK else nightly) for name in found.values()]


@pytest.mark.usefixtures("kept_modes")
@pytest.mark.parametrize("name", kinds())
def test_every_kind_of_scene_opens(open_scene: Any, name: str) -> None:
    open_and_check(open_scene, name)


def test_mesh_opens_as_a_scene(open_scene: Any) -> None:
    mesh = next(library.folder().rglob("*.ply"))
    window = open_and_check(open_scene, str(mesh))
    assert window.document.values["object"]["file"] == str(mesh.resolve())


@pytest.mark.nightly
def test_object_shows_its_texture(open_scene: Any, tmp_path: Path) -> None:
    squares = np.zeros((64, 64, 3), np.uint8)
    squares[:, :32] = 230, 20, 20
    squares[:, 32:] = 20, 20, 230
    Image.fromarray(squares).save(tmp_path / "two.png")
    (tmp_path / "plane.mtl").write_text("newmtl painted\nmap_Kd two.png\n")
    (tmp_path / "plane.obj").write_text(
        "mtllib plane.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl painted\nf 1/1 2/2 3/3 4/4\n"
    )
    window = open_scene(str(tmp_path / "plane.obj"))
    assert window.errors.text == ""
    window.tools.cameras["front"].trigger()
    image = window.view.image().astype(int)
    height, width, _ = image.shape
    red, _, blue = image[height // 2, width // 2 - height // 8]
    assert red > blue + 80
    red, _, blue = image[height // 2, width // 2 + height // 8]
    assert blue > red + 80
    # Another texture replaces it, and undo restores it. The texture object stays the same:
    # freeing one in VTK's collector would need the OpenGL context and block forever.
    texture = window.view.scene_view.surface.GetTexture()
    Image.fromarray(np.full((8, 8, 3), (20, 200, 20), np.uint8)).save(tmp_path / "green.png")
    window.document.set("object", "texture", str(tmp_path / "green.png"))
    wait_until(lambda: settled(window))
    red, green, blue = window.view.image().astype(int)[height // 2, width // 2]
    assert green > max(red, blue) + 80
    window.document.history.undo()
    wait_until(lambda: settled(window))
    assert np.abs(window.view.image().astype(int) - image).max() < 30
    assert window.view.scene_view.surface.GetTexture() is texture


def test_draft_file_opens_as_a_scene(open_scene: Any) -> None:
    window = open_scene(str(library.folder() / "double_weave.wif"), wait=False)
    assert window.errors.text == ""
    assert window.document.file is None
    assert window.document.history.isClean()


def test_saving_keeps_every_comment(open_scene: Any, tmp_path: Path) -> None:
    original = (library.folder() / "plain_weave.toml").read_text()
    window = open_scene(wait=False)
    window.stages.select("modal")
    type_into(window.properties.rows["youngs_modulus"].editor.line, "2 kPa")
    window.document.save(tmp_path / "mine.toml")
    saved = (tmp_path / "mine.toml").read_text()
    changed = [
        (a, b) for a, b in zip(original.splitlines(), saved.splitlines(), strict=True) if a != b
    ]
    assert len(changed) == 1
    assert changed[0][1].startswith('youngs_modulus = "2 kPa"')
    comment = changed[0][0].partition("#")[2]
    assert comment
    assert changed[0][1].endswith(comment)
    assert Scene.read(tmp_path / "mine.toml").modal.youngs_modulus == 2000.0


def test_scene_of_the_program_is_never_overwritten(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    target = tmp_path / "copy"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(target), ""))
    window.menus.actions["Save"].trigger()
    assert target.with_suffix(".toml").is_file()
    assert window.files.recent[0] == str(target.with_suffix(".toml"))


def test_shown_time_is_saved(open_scene: Any, tmp_path: Path) -> None:
    window, file = open_scene(), tmp_path / "swing.toml"
    window.document.save(file)
    assert '"20 ms"' in file.read_text()
    window.times.go_to(0.1 / 3)
    assert not window.isWindowModified()
    window.menus.actions["Save"].trigger()
    assert Scene.read(file).view.time == 0.0333333
    window.times.go_to(0.0)
    window.document.open(file)
    assert window.times.time == 0.0333333
    window.times.go_to(0.0)
    window.menus.actions["Save"].trigger()
    assert Scene.read(file).view.time == 0.0
    assert "# half a swing" in file.read_text()


@pytest.mark.nightly
def test_undo_of_a_reset_restores_the_comment(open_scene: Any) -> None:
    window = open_scene()
    before = window.document.text
    window.stages.select("modal")
    window.properties.rows["fixed"].reset.click()
    assert "fixed" not in window.document.text
    window.menus.actions["Undo"].trigger()
    assert window.document.text == before
    window.menus.actions["Redo"].trigger()
    assert "fixed" not in window.document.text


def test_paths_refer_to_the_same_file_after_saving_in_another_folder(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.mkdir()
    second.mkdir()
    draft = (library.folder() / "32-shaft_twill.wif").read_bytes()
    (first / "twill.wif").write_bytes(draft)
    (first / "scene.toml").write_text('[weave]\ndraft = "twill.wif"\n')
    document = Document()
    document.open(first / "scene.toml")
    document.save(second / "scene.toml")
    scene = Scene.read(second / "scene.toml")
    assert scene.source.draft.resolve() == first / "twill.wif"


LOADS = """[weave]
ends = 3
picks = 3

[[response.loads]]  # a puff
pressure = "1 Pa"
on = "-z"
time = "table"
file = "puff.csv"

[[response.loads]]
gravity = [0.0, "-1 g", 0.0]  # downwards
"""


@pytest.mark.parametrize(
    "text",
    [LOADS, '[response]\nloads = [{gravity = [0, 0, 1], time = "table", file = "puff.csv"}]\n'],
)
def test_files_of_loads_are_found_after_saving_in_another_folder(tmp_path: Path, text: str) -> None:
    first, second = tmp_path / "a", tmp_path / "b" / "c"
    first.mkdir()
    second.mkdir(parents=True)
    (first / "puff.csv").write_text("0, 0\n0.1, 1\n0.2, 0\n")
    (first / "scene.toml").write_text(text)
    document = Document()
    document.open(first / "scene.toml")
    document.save(second / "scene.toml")
    assert Scene.read(second / "scene.toml").response.loads == document.scene.response.loads
    assert document.scene.response.loads[0].function.value(0.05) == 0.5
    if text is LOADS:  # with its comments
        saved = (second / "scene.toml").read_text()
        assert saved == text.replace("puff.csv", "../../a/puff.csv")
        document.save(first / "copy.toml")
        assert (first / "copy.toml").read_text() == text


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Return two folders; the first has a scene that refers to files in all possible ways."""
    first, second = tmp_path / "a", tmp_path / "b" / "c"
    first.mkdir()
    second.mkdir(parents=True)
    for name in ("twill.wif", "whole.wif"):
        (first / name).write_bytes((library.folder() / "32-shaft_twill.wif").read_bytes())
    (first / "puff.csv").write_text("0, 0\n0.1, 1\n0.2, 0\n")
    text = LOADS.replace("[weave]", '[weave]\ndraft = "twill.wif"  # on loan')
    (first / "scene.toml").write_text(text)
    return first, second


def resolved_files(document: Document) -> tuple[Path | None, Path]:
    """Return the resolved files of the draft and of the first load's table."""
    scene = document.scene
    draft = None if scene.source.draft is None else scene.source.draft.resolve(strict=True)
    return draft, scene.response.loads[0].file.resolve(strict=True)


def test_undo_after_save_as_keeps_every_path(folders: tuple[Path, Path]) -> None:
    first, second = folders
    document = Document()
    document.open(first / "scene.toml")
    expected = first / "twill.wif", first / "puff.csv"
    whole = first / "whole.wif", first / "puff.csv"
    document.set("weave", "ends", 5)
    document.set("weave", "draft", str(first / "whole.wif"))
    document.save(second / "scene.toml")
    assert resolved_files(document) == whole
    # An absolute path stays absolute.
    assert document.value_in_file("weave", "draft") == str(first / "whole.wif")
    document.history.undo()
    assert resolved_files(document) == expected
    document.history.undo()
    assert resolved_files(document) == expected
    assert document.value_in_file("weave", "draft") == "../../a/twill.wif"
    document.save()
    assert Scene.read(second / "scene.toml").source.draft.resolve() == first / "twill.wif"
    assert "on loan" in (second / "scene.toml").read_text()
    document.save(first / "again.toml")
    for _ in range(2):
        document.history.redo()
    assert resolved_files(document) == whole
    document.history.undo()
    assert document.value_in_file("weave", "draft") == "twill.wif"
    assert resolved_files(document) == expected
    document.history.undo()
    assert document.text == (first / "scene.toml").read_text()


def test_failed_save_changes_nothing(folders: tuple[Path, Path]) -> None:
    first, second = folders
    document = Document()
    document.open(first / "scene.toml")
    document.set("weave", "ends", 5)
    text = document.text
    with pytest.raises(SpacemapError, match=r"scene\.toml: could not be written: no such file"):
        document.save(second / "nowhere" / "scene.toml")
    assert (document.text, document.file) == (text, first / "scene.toml")
    assert not document.history.isClean()
    assert resolved_files(document) == (first / "twill.wif", first / "puff.csv")
    document.set("weave", "picks", 5)
    assert resolved_files(document) == (first / "twill.wif", first / "puff.csv")


def test_undo_restores_an_overwritten_draft(folders: tuple[Path, Path]) -> None:
    first, second = folders
    document = Document()
    document.open(first / "scene.toml")
    document.save(first / "twill.toml")  # its edited draft is saved as twill.wif
    original = (first / "twill.wif").read_bytes()
    wif = document.scene.draft
    loom = replace(wif.loom, rising=not wif.loom.rising)
    edited = replace(wif, loom=loom, drawdown=loom.drawdown())
    document.set("weave", "draft", str(document.drafts.add(edited)))
    inverted = document.scene.woven.make_draft().drawdown
    document.save()
    assert (first / "twill.wif").read_bytes() != original
    document.history.undo()
    assert document.scene.source.draft.read_bytes() == original
    document.history.redo()
    assert (document.scene.woven.make_draft().drawdown == inverted).all()
    document.history.undo()
    document.save(second / "twill.toml")
    assert Scene.read(second / "twill.toml").source.draft.read_bytes() == original
    document.history.redo()
    assert (document.scene.woven.make_draft().drawdown == inverted).all()


@pytest.mark.nightly
def test_undo_to_a_deleted_file_is_reported(open_scene: Any, folders: tuple[Path, Path]) -> None:
    first, _ = folders
    window = open_scene(str(first / "scene.toml"))
    document = window.document
    document.set("response", "loads", [])
    (first / "puff.csv").unlink()
    document.history.undo()
    assert "puff.csv" in window.errors.text
    assert document.scene.response.loads == ()
    assert document.values["response"]["loads"] == []
    document.history.redo()
    document.set("weave", "ends", 5)
    wait_until(lambda: settled(window) and window.errors.text == "")


def test_closing_asks_about_unsaved_changes(
    open_window: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window()
    window.document.set("weave", "ends", 5)
    assert window.isWindowModified()
    answers = []

    def cancel(*_: Any) -> Any:
        answers.append("asked")
        return QMessageBox.StandardButton.Cancel

    monkeypatch.setattr(QMessageBox, "question", cancel)
    window.close()
    assert answers == ["asked"]
    assert window.engine.isRunning()
    assert window.document.scene.source.ends == 5


def test_dropped_file_opens_and_an_invalid_one_is_reported(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()

    def drop(path: Path) -> None:
        data = QMimeData()
        data.setUrls([QUrl.fromLocalFile(str(path))])
        event = QDropEvent(
            QPointF(50, 50),
            Qt.DropAction.CopyAction,
            data,
            Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
        )
        window.dropEvent(event)

    scene, bad = tmp_path / "small.toml", tmp_path / "bad.toml"
    scene.write_text("[weave]\nends = 3\npicks = 3\n")
    bad.write_text("[weave]\nends = -3\n")
    drop(bad)
    assert "ends" in window.errors.text
    assert window.document.scene.source.ends == 7
    window.document.set("view", "ghost", True)  # work goes on without the file
    assert window.errors.text == ""
    window.document.history.undo()
    drop(bad)
    drop(scene)
    wait_until(lambda: settled(window))
    assert window.document.scene.source.ends == 3
    assert window.errors.text == ""


@pytest.mark.nightly
def test_copied_command_and_script_run(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene()
    window.document.set("weave", "ends", 5)
    window.document.set("weave", "warp_diameter", "0.2 mm")
    window.menus.actions["Copy as command line"].trigger()
    arguments = shlex.split(QGuiApplication.clipboard().text())
    assert arguments[:2] == ["spacemap", "render"]
    assert arguments.count("--set") == 2
    checked = ["validate", arguments[2], *arguments[arguments.index("--set") :], "-q"]
    with pytest.raises(SystemExit) as ended:
        main(checked)
    assert ended.value.code == 0
    window.menus.actions["Copy as Python script"].trigger()
    script = tmp_path / "script.py"
    script.write_text(QGuiApplication.clipboard().text())
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    wait_until(lambda: settled(window))
    assert int(done.stdout.split()[0]) == window.view.frame.surface.GetNumberOfPoints()


def test_screenshot_equals_the_view_and_can_be_drawn_again(
    open_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_scene()
    file = tmp_path / "seen.png"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    for name in ("cage", "triad", "scale_bar"):  # their sizes depend on the screen
        window.tools.part_actions[name].trigger()
    wait_until(lambda: settled(window))
    window.menus.actions["Save screenshot…"].trigger()
    seen = window.view.image().astype(int)
    assert np.abs(np.asarray(Image.open(file)).astype(int) - seen).max() < 8
    # Its provenance is enough to draw it again without a window.
    with pytest.raises(SystemExit) as end:
        main(["again", str(file), "-o", str(tmp_path / "again.png"), "-q"])
    assert end.value.code == 0
    again = np.asarray(Image.open(tmp_path / "again.png")).astype(int)
    assert (np.abs(again - seen).max(axis=2) > 48).mean() < 0.01


def test_dark_theme_can_be_switched_and_help_lists_the_keys(open_scene: Any) -> None:
    window = open_scene()
    light = window.palette().window().color().lightness()
    window.menus.dark.trigger()
    assert window.palette().window().color().lightness() < light / 2
    window.menus.dark.trigger()
    lines = [line for lines in window.help.key_groups.values() for line in lines]
    listed = "\n".join(f"{key} {name}" for key, name in lines)
    for words in ("Ctrl+S", "Ctrl+Z", "Space", "Ghost", "or Ctrl+Q", "or Ctrl+Y"):
        assert words in listed


def test_menu_items_are_unique(open_scene: Any) -> None:
    window = open_scene()

    def look_at(menu: Any) -> None:
        shown = (action for action in menu.actions() if action.isVisible())
        named = [action.text() for action in shown if action.text()]
        assert len(named) == len(set(named)) <= 14
        for action in menu.actions():
            if action.menu():
                look_at(action.menu())

    for top in window.menuBar().actions():
        look_at(top.menu())


@pytest.mark.nightly
def test_opening_scenes_repeatedly_leaks_no_stages(open_window: Any, twill: Path) -> None:
    def stages() -> int:
        gc.collect()
        return sum(isinstance(thing, Stage) for thing in gc.get_objects())

    window = open_window()
    before = stages()
    for name in ["plain_weave", str(twill.with_suffix(".wif"))] * 2:
        window.document.open(name)
        wait_until(lambda: settled(window))
    window.document.open("plain_weave")
    wait_until(lambda: settled(window))
    assert stages() == before
