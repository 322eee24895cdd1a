"""The list of all changes of a document; a click goes to the state after one of them."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QUndoView, QWidget

from spacemap_vtk.app.documents.edit import History
from spacemap_vtk.app.widgets import column, note


class UndoList(QDialog):
    """Show the changes beside the window, which stays usable."""

    def __init__(self, parent: QWidget, history: History) -> None:
        super().__init__(parent, Qt.WindowType.Tool)
        self.setWindowTitle("Changes")
        self.view = QUndoView(history)
        self.view.setEmptyLabel("As opened")
        hint = note("Click a line to go back or forward to the scene after that change.")
        column(self, hint, (self.view, 1), margins=(8, 8, 8, 8))
        self.resize(300, 360)
