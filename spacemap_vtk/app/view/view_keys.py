"""What keys alone do in the view: the habits of VTK and PyVista that a person brings along."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from PySide6.QtCore import QObject, QPointF, Qt, Signal
from PySide6.QtGui import QAction, QCursor

from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.widgets import action

#: How much nearer one press brings, as in PyVista.
_ZOOM = 1.05
#: How much nearer what is flown to comes, as in VTK.
_FLY = 1.3


class ViewKeys(QObject):
    """Makes the actions; they stand in the menu and in the help as all others do."""

    # Not VTK's own: S, F and 3 have another meaning here, so its wireframe could not be left again;
    # its R changes the lens, and saved pictures would show another part than the view.

    #: By how many steps lines and dots shall be thicker.
    thickened = Signal(int)

    def __init__(self, view: View3D, parent: QObject) -> None:
        super().__init__(parent)
        self._view = view
        self.wireframe = self._action("Wireframe", "W", self._toggle_wireframe)
        self.wireframe.setCheckable(True)
        #: What concerns the camera.
        self.cameras = [
            self._action("Whole in sight", "R", partial(view.reset_camera, None)),
            self._action("To the point under the mouse", "Shift+F", self._fly),
            self._action("Nearer", "Up", partial(view.zoom, _ZOOM)),
            self._action("Farther", "Down", partial(view.zoom, 1.0 / _ZOOM)),
        ]
        # Everywhere else the arrows choose: in lists, tables, fields.
        for nearer in self.cameras[-2:]:
            nearer.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
            view.plotter.addAction(nearer)
        #: What concerns what is seen.
        self.looks = [
            self.wireframe,
            self._action("Thicker lines and dots", "+", partial(self.thickened.emit, 1)),
            self._action("Thinner lines and dots", "-", partial(self.thickened.emit, -1)),
            self._action("Read the point under the mouse", "P", lambda: view.click(self._mouse)),
            self._action("Forget what was read", "Esc", view.forget_picks),
        ]
        # Elsewhere the key gives up other things.
        view.picks_changed.connect(self._may_forget)
        self._may_forget([])

    def _may_forget(self, picks: list[object]) -> None:
        self.looks[-1].setEnabled(bool(picks))

    def _toggle_wireframe(self) -> None:
        self._view.look.wireframe = self.wireframe.isChecked()
        self._view.refresh()

    def _fly(self) -> None:
        found = self._view.pick(self._mouse.x(), self._mouse.y())
        if found is None:
            return
        camera, point = self._view.plotter.camera, np.array(found.position)
        moved = np.array(camera.GetPosition()) + point - camera.GetFocalPoint()
        camera.SetPosition(*moved.tolist())
        camera.SetFocalPoint(*point.tolist())
        self._view.zoom(_FLY)

    @property
    def _mouse(self) -> QPointF:
        return self._view.plotter.mapFromGlobal(QPointF(QCursor.pos()))

    def _action(self, name: str, key: str, slot: Callable[[], object]) -> QAction:
        # Without "checked", which `partial` would take for its next argument.
        return action(self, name, lambda _=False: slot(), key)
