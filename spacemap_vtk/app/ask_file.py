"""Asking for a file to write."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget


def ask_file(parent: QWidget, title: str, proposal: str, filters: str, ending: str) -> Path | None:
    """Ask where to write."""
    name, _ = QFileDialog.getSaveFileName(parent, title, proposal, filters)
    return ended(parent, Path(name), ending) if name else None


def ended(parent: QWidget, path: Path, ending: str) -> Path | None:
    """Give a name its ending. Qt has asked about the name without it, not about this file."""
    if path.suffix:
        return path
    path = path.with_suffix(ending)
    box = QMessageBox.StandardButton
    stays = path.exists() and box.Yes != QMessageBox.question(
        parent, "Write over it?", f"{path.name} already exists.", box.Yes | box.No, box.No
    )
    return None if stays else path
