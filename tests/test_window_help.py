"""The command palette, the manual, the list of changes and the page of keys."""

from __future__ import annotations

import re
from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import Qt, QTimer, QUrl  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication  # noqa: E402

from spacemap_vtk.app.help.manual import Manual, as_qt_markdown, read_pages  # noqa: E402


def run_command(window: Any, text: str, downs: int = 0) -> str:
    """Search the palette, press Enter, and return the title of what was run."""
    window.help.find_command()
    palette = window.help.commands
    QTest.keyClicks(palette.search, text)
    for _ in range(downs):
        QTest.keyClick(palette.search, Qt.Key.Key_Down)
    title = str(palette.shown[downs].title)
    QTest.keyClick(palette.search, Qt.Key.Key_Return)
    assert not palette.isVisible()
    return title


def test_palette_runs_actions_and_goes_to_parameters_and_scenes(open_scene: Any) -> None:
    window = open_scene()
    window.activateWindow()
    assert run_command(window, "ghost") == "Ghost"
    wait_until(lambda: window.document.scene.view.ghost)
    assert run_command(window, "switch on crimp") == "Switch on Crimp interchange"
    assert "yarns" in window.document.scene.given_sections
    assert run_command(window, "show plots") == "Show Plots"
    assert window.tabs.currentWidget() is window.plots
    # Words of the help find a parameter, too; the keyboard is then in its field.
    assert run_command(window, "young modal solver") == "Young's modulus"
    assert window.properties.section == "modal"
    row = window.properties.rows["youngs_modulus"]
    wait_until(lambda: row.isAncestorOf(QApplication.focusWidget()))
    assert not row.visibleRegion().isEmpty()
    run_command(window, "gravity", downs=1)
    assert window.properties.section == "response"
    window.document.history.setClean()
    assert (
        run_command(window, "twill_2_2")
        == "Open 2/2 twill, 30 tex cotton, 24 x 22 to the centimetre"
    )
    wait_until(lambda: settled(window))
    assert window.document.example_name == "twill_2_2"


def test_palette_finds_every_action_with_a_key(open_scene: Any) -> None:
    window = open_scene()
    found = {entry.title.removesuffix(" ✓") for entry in window.help.palette_entries}
    for action in window.menus.actions.values():
        possible = action.isEnabled() and action.isVisible() and action.shortcuts()
        assert not possible or action.text().replace("&", "") in found


def test_list_of_changes_names_them_and_goes_to_each(open_scene: Any) -> None:
    window = open_scene()
    document = window.document
    begin = document.text
    document.set("weave", "ends", 9)
    after_first = document.text
    document.set_many("weave", {"warp_color": "#aa3311", "weft_color": "#113355"})
    window.menus.actions["Undo list…"].trigger()
    view = window.menus.undo_list.view
    model = view.model()
    names = [model.index(n, 0).data() for n in range(model.rowCount())]
    assert names == ["As opened", "Weave source: Ends", "Weave source: Warp colour, Weft colour"]
    last = document.text
    for row, text in ((1, after_first), (0, begin), (2, last)):
        rect = view.visualRect(model.index(row, 0))
        QTest.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=rect.center())
        assert document.text == text
    window.menus.undo_list.close()


def test_manual_shows_pages_search_and_links(open_scene: Any) -> None:
    window = open_scene()
    window.help.show_manual()
    manual = window.help.manual
    assert isinstance(manual, Manual)
    assert manual.text.toPlainText().startswith("Use the window")
    manual.search.setText("biaxial KES")
    shown = [item.text(0) for item in manual._items() if not item.isHidden()]
    assert "Measure cloth as a laboratory does" in shown
    assert "Use the window" not in shown
    manual.search.clear()
    manual.text.anchorClicked.emit(QUrl("let_cloth_meet_things.md"))
    assert manual.text.toPlainText().startswith("Let cloth meet things")
    manual.close()


@pytest.mark.parametrize("page", read_pages(), ids=lambda page: page.file.stem)
def test_pages_of_the_manual_lack_nothing_that_qt_cannot_show(page: Any) -> None:
    text = as_qt_markdown(page)
    prose = re.sub(r"```.*?```", "", text, flags=re.S)
    assert "$" not in re.sub(r"`[^`\n]*`", "", prose)
    for mark, words, address in re.findall(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", prose):
        assert words or mark
        if mark:
            assert (page.file.parent / address).is_file()


def test_keys_are_shown_by_topic(open_scene: Any) -> None:
    window = open_scene()
    texts: list[str] = []

    def read() -> None:
        dialog = QApplication.activeModalWidget()
        if dialog is None:
            QTimer.singleShot(50, read)
            return
        texts.extend(label.text() for label in dialog.findChildren(type(window.running_label)))
        dialog.reject()

    QTimer.singleShot(50, read)
    next(a for a in window.menuBar().actions()[-1].menu().actions() if "Key" in a.text()).trigger()
    page = "".join(texts)
    for topic in ("File", "Edit", "Time", "Camera", "Mouse in the view"):
        assert f"<h4>{topic}</h4>" in page
