"""The tools over the view: what is shown, in which colours, and from where."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QComboBox, QLabel, QToolBar

from spacemap_vtk.app.look import COLORINGS
from spacemap_vtk.app.view import View3D
from spacemap_vtk.scenes.picture import CAMERAS

#: What can be shown: attribute of `Look`, words, key.
_SHOWN = (
    ("fabric", "Fabric", "F"),
    ("cage", "Cage", "C"),
    ("supports", "Supports", "S"),
    ("ghost", "Ghost", "G"),
)


class ViewBar(QToolBar):
    """Tools that change the look and nothing else.

    Parameters
    ----------
    view : View3D
        What they act on.
    """

    def __init__(self, view: View3D) -> None:
        super().__init__("View")
        self.setObjectName("view bar")
        self.setIconSize(QSize(16, 16))
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self._view = view
        self.shown: dict[str, QAction] = {}
        for name, words, key in _SHOWN:
            action = QAction(words, self)
            action.setCheckable(True)
            action.setChecked(getattr(view.look, name))
            action.setShortcut(QKeySequence(key))
            action.setToolTip(f"Show the {words.lower()} ({key})")
            action.setData(name)
            action.toggled.connect(self._toggled)
            self.addAction(action)
            self.shown[name] = action
        self.addSeparator()
        self.addWidget(QLabel(" Colour by "))
        self.coloring = QComboBox()
        self.coloring.addItems(COLORINGS)
        self.coloring.currentTextChanged.connect(self._colored)
        self.addWidget(self.coloring)
        self.addSeparator()
        self.cameras: dict[str, QAction] = {}
        for number, name in enumerate(CAMERAS, 1):
            action = QAction(name.capitalize(), self)
            action.setShortcut(QKeySequence(str(number)))
            action.setToolTip(f"Look from the {name} ({number})")
            action.setData(name)
            action.triggered.connect(self._aimed)
            self.addAction(action)
            self.cameras[name] = action
        self.orthographic = QAction("Orthographic", self)
        self.orthographic.setCheckable(True)
        self.orthographic.setShortcut(QKeySequence("O"))
        self.orthographic.setToolTip("Parallel projection (O)")
        self.orthographic.toggled.connect(view.set_orthographic)
        self.addAction(self.orthographic)

    @property
    def choices(self) -> list[QAction]:
        """Every action, for a menu."""
        return [*self.shown.values(), *self.cameras.values(), self.orthographic]

    def _toggled(self, on: bool) -> None:
        setattr(self._view.look, self.sender().data(), on)
        self._view.refresh()

    def _colored(self, coloring: str) -> None:
        self._view.look.coloring = coloring
        self._view.refresh()

    def _aimed(self) -> None:
        self._view.reset_camera(self.sender().data())
