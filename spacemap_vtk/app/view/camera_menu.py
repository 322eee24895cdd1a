"""The saved cameras of a scene: save the present camera, go to one, delete one."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QInputDialog, QMenu

from spacemap_vtk.app.view.view3d import View3D
from spacemap_vtk.app.widgets import action
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.scenes.saved_cameras import SavedCamera
from spacemap_vtk.scenes.scene import Scene


class SavedCameraMenu(QObject):
    """Keep a menu of the saved cameras of the present scene."""

    #: Changed values of the section ``[view]``, and the name of the change.
    changed = Signal(object, str)

    def __init__(self, view: View3D, parent: QObject) -> None:
        super().__init__(parent)
        self._view = view
        self._cameras: tuple[SavedCamera, ...] = ()
        self._chosen: str | None = None
        tip = "Keep the present camera in the scene, by name"
        self.save = action(self, "Save camera…", self._ask_name, "Ctrl+Shift+K", tip)
        self.saved, self.deleted = QMenu("Saved cameras"), QMenu("Delete camera")
        #: Actions that go to each saved camera.
        self.cameras: list[QAction] = []
        self._fill()

    def show_scene(self, scene: Scene) -> None:
        """Show the saved cameras of a scene."""
        self._chosen = scene.view.camera
        if scene.view.cameras != self._cameras:
            self._cameras = scene.view.cameras
            self._fill()

    def save_as(self, name: str) -> None:
        """Save the present camera by a name; it replaces a camera of that name."""
        values = {"name": name, **self._view.viewpoint.as_saved(self._view.up_axis)}
        tables = self._tables_without(name)
        place = next((k for k, c in enumerate(self._cameras) if c.name == name), len(tables))
        tables.insert(place, values)
        self.changed.emit({"cameras": tables}, f"save camera {name}")

    def delete(self, name: str) -> None:
        """Delete a saved camera."""
        written: dict[str, Any] = {"cameras": self._tables_without(name) or None}
        if self._chosen == name:
            written["camera"] = None
        self.changed.emit(written, f"delete camera {name}")

    def _tables_without(self, name: str) -> list[dict[str, Any]]:
        return [_as_table(camera) for camera in self._cameras if camera.name != name]

    def _fill(self) -> None:
        self.saved.clear()
        self.deleted.clear()
        self.cameras = []
        for camera in self._cameras:
            go_to = self.saved.addAction(camera.name)
            go_to.triggered.connect(lambda _=False, to=camera: self._go_to(to))
            self.cameras.append(go_to)
            delete = self.deleted.addAction(camera.name)
            delete.triggered.connect(lambda _=False, name=camera.name: self.delete(name))
        for menu in (self.saved, self.deleted):
            menu.menuAction().setVisible(bool(self._cameras))

    def _go_to(self, camera: SavedCamera) -> None:
        self._view.reset_camera(Viewpoint.from_saved(camera))

    def _ask_name(self) -> None:
        if self._view.frame is None:
            return
        name, accepted = QInputDialog.getText(
            self._view.window(), "Save camera", "Name of the camera:", text=self._free_name()
        )
        if accepted:
            self.save_as(name.strip())

    def _free_name(self) -> str:
        names = {camera.name for camera in self._cameras}
        return next(n for k in range(1, len(names) + 2) if (n := f"camera {k}") not in names)


def _as_table(camera: SavedCamera) -> dict[str, Any]:
    return {k: list(v) if isinstance(v, tuple) else v for k, v in camera.given_values.items()}
