"""Asking for a file to write."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget


def ask_file(parent: QWidget, title: str, proposal: str, filters: str, ending: str) -> Path | None:
    """Ask where to write.

    Parameters
    ----------
    parent : QWidget
        Of the dialog.
    title : str
        Of the dialog.
    proposal : str
        Name of the file; empty: none.
    filters : str
        As Qt's file dialogs have them.
    ending : str
        For a name without one, as in ``".toml"``.

    Returns
    -------
    Path or None
        None where nothing shall be written.
    """
    name, _ = QFileDialog.getSaveFileName(parent, title, proposal, filters)
    return ended(parent, Path(name), ending) if name else None


def ended(parent: QWidget, path: Path, ending: str) -> Path | None:
    """Give a name its ending. Qt has asked about the name without it, not about this file.

    Parameters
    ----------
    parent : QWidget
        Of the question.
    path : Path
        As the user has written it.
    ending : str
        For a name without one.

    Returns
    -------
    Path or None
        None where a file of that name shall stay.
    """
    if path.suffix:
        return path
    path = path.with_suffix(ending)
    box = QMessageBox.StandardButton
    stays = path.exists() and box.Yes != QMessageBox.question(
        parent, "Write over it?", f"{path.name} already exists.", box.Yes | box.No, box.No
    )
    return None if stays else path
