"""Asking for a file to write."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget


def last_folder() -> Path:
    """Return the folder that was used last, in this session or another."""
    folder = Path(str(QSettings().value("folder") or Path.cwd()))
    return folder if folder.is_dir() else Path.cwd()


def keep_folder(file: Path) -> Path:
    """Let a file's folder be the one that was used last."""
    QSettings().setValue("folder", str(file.resolve().parent))
    return file


def ask_file(parent: QWidget, title: str, proposal: str, filters: str, ending: str) -> Path | None:
    """Ask where to write: as is proposed, or so in the folder that was used last."""
    begin = last_folder() / proposal
    name, chosen = QFileDialog.getSaveFileName(parent, title, str(begin), filters)
    if not name:
        return None
    path, kinds = Path(name), re.findall(r"\*(\.\w+)", chosen)
    if path == begin and kinds and begin.suffix not in kinds:
        # As it was proposed, but another kind of file is chosen.
        path, ending = path.with_suffix(""), kinds[0]
    whole = ended(parent, path, ending)
    return whole and keep_folder(whole)


def ask_opened(parent: QWidget, title: str, filters: str) -> str:
    """Ask what to open, in the folder that was used last; nothing is empty."""
    name, _ = QFileDialog.getOpenFileName(parent, title, str(last_folder()), filters)
    return str(keep_folder(Path(name))) if name else ""


def ended(parent: QWidget, path: Path, ending: str) -> Path | None:
    """Give a name its ending. Qt has asked about the name without it, not about this file."""
    if path.suffix:
        return path
    path = path.with_suffix(ending)
    return path if may_write_over(parent, path) else None


def may_write_over(parent: QWidget, path: Path) -> bool:
    """Ask, if there is such a file."""
    return not path.exists() or agreed(parent, "Write over it?", f"{path.name} already exists.")


def agreed(parent: QWidget, title: str, question: str) -> bool:
    """Ask whether to go on; by itself Enter does not."""
    box = QMessageBox.StandardButton
    return box.Yes == QMessageBox.question(parent, title, question, box.Yes | box.No, box.No)
