"""A source of yarns that is not woven: the window offers nothing of a weave."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtWidgets import QFileDialog  # noqa: E402
from test_textile import MOVING, Loops, Rods, sources  # noqa: E402, F401


def offered_types(window: Any, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the file types that the export dialog offers."""
    asked: list[str] = []

    def ask(parent: Any, title: str, proposal: str, filters: str) -> tuple[str, str]:
        asked.append(filters)
        return "", ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", ask)
    window.exports.data()
    return asked[0]


def test_export_offers_drafts_for_a_weave(
    open_window: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "draft" in offered_types(open_window("plain_weave"), monkeypatch)


def test_draft_of_another_source_cannot_be_edited(open_window: Any, tmp_path: Path) -> None:
    file = tmp_path / "tabby.toml"
    file.write_text("[tabby]\nthreads = 5\n", "utf-8")
    window = open_window(file)
    wait_until(lambda: settled(window))
    window.tabs.setCurrentWidget(window.figures)
    rows = window.figures.table
    wait_until(lambda: rows.rowCount() > 10)
    assert "crimp c" in [rows.item(k, 0).text() for k in range(rows.rowCount())]
    window.tabs.setCurrentWidget(window.draft)
    wait_until(lambda: "source cannot be edited" in window.draft.placeholder.text())


@pytest.mark.parametrize("source", [pytest.param(Rods, marks=pytest.mark.nightly), Loops])
def test_other_textile_shows_its_own_figures(
    source: type[Rods], open_window: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "textile.toml"
    file.write_text(f"[{source.section}]\ncount = 4\n{MOVING}", "utf-8")
    window = open_window(file)
    wait_until(lambda: settled(window))
    assert window.view.frame.surface.GetNumberOfCells() > 1000
    window.tabs.setCurrentWidget(window.figures)
    wait_until(lambda: window.figures.table.rowCount() >= 3)
    table = window.figures.table
    rows = {table.item(k, 0).text(): table.item(k, 1).text() for k in range(table.rowCount())}
    assert rows["yarns"] == ("4 yarns" if source is Rods else "4 courses")
    assert rows["diameter d"] == "0.4 mm"
    assert "crimp c" not in rows
    window.tabs.setCurrentWidget(window.draft)
    wait_until(lambda: "not woven" in window.draft.placeholder.text())
    assert not window.draft.save_button.isEnabled()
    assert "draft" not in offered_types(window, monkeypatch)
    # Another value of the source gives another textile.
    window.document.set(source.section, "count", 6)
    window.tabs.setCurrentWidget(window.figures)
    wait_until(lambda: settled(window) and table.item(0, 1).text().startswith("6 "))
