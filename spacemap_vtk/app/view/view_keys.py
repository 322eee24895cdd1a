"""Keyboard commands of the view that users know from VTK and PyVista."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from PySide6.QtCore import QObject, QPointF, Qt, Signal
from PySide6.QtGui import QAction, QCursor

from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.widgets import action

#: Zoom factor of one key press, as in PyVista.
_ZOOM = 1.05
#: Zoom factor of flying to a point, as in VTK.
_FLY_ZOOM = 1.3


class ViewKeys(QObject):
    """Create the actions of these keys, for the menu and the help."""

    # VTK's own keys are not used. S, F and 3 have other meanings here, so VTK's wireframe could not
    # be switched off; its R changes the view angle, and saved pictures would differ from the view.

    #: Number of steps by which lines and dots shall become thicker.
    thickness_changed = Signal(int)

    def __init__(self, view: View3D, parent: QObject) -> None:
        super().__init__(parent)
        self._view = view
        self.wireframe = self._make_action("Wireframe", "W", self._toggle_wireframe)
        self.wireframe.setCheckable(True)
        #: Actions of the camera.
        self.camera_actions = [
            self._make_action("Fit to view", "R", partial(view.reset_camera, None)),
            self._make_action("Fly to the point under the mouse", "Shift+F", self._fly_to_mouse),
            self._make_action("Zoom in", "Up", partial(view.zoom, _ZOOM)),
            self._make_action("Zoom out", "Down", partial(view.zoom, 1.0 / _ZOOM)),
        ]
        # Only in the view: in lists, tables and fields the arrow keys select.
        for nearer in self.camera_actions[-2:]:
            nearer.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
            view.canvas.addAction(nearer)
        #: Actions of the appearance and of picked points.
        self.appearance_actions = [
            self.wireframe,
            self._make_action(
                "Thicker lines and points", "+", partial(self.thickness_changed.emit, 1)
            ),
            self._make_action(
                "Thinner lines and points", "-", partial(self.thickness_changed.emit, -1)
            ),
            self._make_action(
                "Pick the point under the mouse", "P", lambda: view.click(self._mouse)
            ),
            self._make_action("Clear picked points", "Esc", view.clear_picks),
        ]
        tip = "Click two points to measure their distance, and a third one for an angle (M)"
        #: Switches the ruler on.
        self.ruler = action(self, "Ruler", view.set_ruler, "M", tip, checkable=True)
        # Enabled only with picked points, because Esc has other uses elsewhere.
        for changed in (view.picks_changed, view.measured):
            changed.connect(self._enable_clear)
        self._enable_clear()

    def _enable_clear(self, *_: object) -> None:
        has_points = bool(self._view.picks or self._view.ruler.picks)
        self.appearance_actions[-1].setEnabled(has_points)

    def _toggle_wireframe(self) -> None:
        self._view.options.wireframe = self.wireframe.isChecked()
        self._view.refresh()

    def _fly_to_mouse(self) -> None:
        pick = self._view.pick(self._mouse.x(), self._mouse.y())
        if pick is None:
            return
        camera, point = self._view.canvas.camera, np.array(pick.position)
        moved = np.array(camera.GetPosition()) + point - camera.GetFocalPoint()
        camera.SetPosition(*moved.tolist())
        camera.SetFocalPoint(*point.tolist())
        self._view.zoom(_FLY_ZOOM)

    @property
    def _mouse(self) -> QPointF:
        return self._view.canvas.mapFromGlobal(QPointF(QCursor.pos()))

    def _make_action(self, name: str, key: str, slot: Callable[[], object]) -> QAction:
        # Drop Qt's argument "checked": `partial` would pass it as the next argument.
        return action(self, name, lambda _=False: slot(), key)
