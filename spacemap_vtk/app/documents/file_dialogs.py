"""Dialogs that ask for a file to read or to write."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget


def last_folder() -> Path:
    """Return the folder that was used last, also in an earlier session."""
    folder = Path(str(QSettings().value("folder") or Path.cwd()))
    return folder if folder.is_dir() else Path.cwd()


def remember_folder(file: Path) -> Path:
    """Remember a file's folder as the last used one."""
    QSettings().setValue("folder", str(file.resolve().parent))
    return file


def ask_output_file(
    parent: QWidget, title: str, proposal: str, filters: str, ending: str
) -> Path | None:
    """Ask where to write a file; propose a name, relative to the folder that was used last."""
    start = last_folder() / proposal
    name, chosen = QFileDialog.getSaveFileName(parent, title, str(start), filters)
    if not name:
        return None
    path, endings = Path(name), re.findall(r"\*(\.\w+)", chosen)
    if path == start and endings and start.suffix not in endings:
        # The proposed name was kept, but with another file type.
        path, ending = path.with_suffix(""), endings[0]
    output = add_ending(parent, path, ending)
    return output and remember_folder(output)


def ask_input_file(parent: QWidget, title: str, filters: str) -> str:
    """Ask which file to open; return an empty string if the dialog is cancelled."""
    name, _ = QFileDialog.getOpenFileName(parent, title, str(last_folder()), filters)
    return str(remember_folder(Path(name))) if name else ""


def add_ending(parent: QWidget, path: Path, ending: str) -> Path | None:
    """Add an ending to a name without one, and ask before an existing file is overwritten."""
    # Qt's dialog has checked only the name without the ending.
    if path.suffix:
        return path
    path = path.with_suffix(ending)
    return path if confirm_overwrite(parent, path) else None


def confirm_overwrite(parent: QWidget, path: Path) -> bool:
    """Ask before an existing file is overwritten; return whether to go on."""
    return not path.exists() or confirm(
        parent, "Replace file", f"{path.name} already exists. Replace it?"
    )


def choose(parent: QWidget, title: str, question: str, yes: str, no: str) -> bool:
    """Ask a question whose two answers are in words; Enter and Escape choose the second."""
    box = QMessageBox(QMessageBox.Icon.Question, title, question, parent=parent)
    accepted = box.addButton(yes, QMessageBox.ButtonRole.DestructiveRole)
    refused = box.addButton(no, QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(refused)
    box.setEscapeButton(refused)
    box.exec()
    return box.clickedButton() is accepted


def confirm(parent: QWidget, title: str, question: str) -> bool:
    """Ask a yes-or-no question; Enter means no."""
    box = QMessageBox.StandardButton
    return box.Yes == QMessageBox.question(parent, title, question, box.Yes | box.No, box.No)
