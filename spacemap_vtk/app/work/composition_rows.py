"""Rows of the export dialog that compose a picture: depth of field and a close-up."""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFormLayout, QLabel

from spacemap_vtk.app.widgets import row
from spacemap_vtk.draw.camera import CameraView, project_points
from spacemap_vtk.scenes.settings import View

#: Depths of field, as `view.aperture`.
_APERTURES = {"Everything is sharp": 0.0, "Slight": 0.03, "Medium": 0.08, "Strong": 0.2}
_MIDDLE, _PICKED = "Middle of the picture", "Picked point"
_NO_INSET, _OWN = "None", "As in the scene"


class CompositionRows:
    """Choose what is sharp in a picture, and the place of a close-up."""

    def __init__(
        self, form: QFormLayout, view: View, picked: tuple[float, float, float] | None
    ) -> None:
        self._view, self._picked = view, picked
        places = [_MIDDLE, *([_PICKED] if picked is not None else [])]
        self.aperture, self.focus = QComboBox(), QComboBox()
        for name, value in _APERTURES.items():
            self.aperture.addItem(name, value)
        if view.aperture not in _APERTURES.values():
            self.aperture.addItem(f"{_OWN} ({view.aperture:g})", view.aperture)
        self.aperture.setCurrentIndex(self.aperture.findData(view.aperture))
        self.aperture.setToolTip(
            "What is nearer or farther is blurred; takes about eight times longer"
        )
        self.focus.addItems([*([_OWN] if view.focus is not None else []), *places])
        self.focus.setToolTip("What is sharp; click a point in the view before to choose it")
        self.inset, self.magnification = QComboBox(), QDoubleSpinBox(prefix="× ")
        self.inset.addItems([_NO_INSET, *([_OWN] if view.insets else []), *places])
        self.inset.setCurrentIndex(1 if view.insets else 0)
        self.inset.setToolTip("A place that is drawn again in a frame, larger, with its scale")
        self.magnification.setRange(1.5, 200.0)
        self.magnification.setValue(6.0)
        self.magnification.setDecimals(1)
        form.addRow("Depth of field", row(None, (self.aperture, 1), QLabel("at"), self.focus))
        form.addRow("Close-up", row(None, (self.inset, 1), self.magnification))
        for box in (self.aperture, self.inset):
            box.currentIndexChanged.connect(self._enable)
        self._enable()

    def values(self, camera_view: CameraView) -> dict[str, Any]:
        """Return the chosen values of a scene's section ``[view]``, for a picture with a camera."""
        values: dict[str, Any] = {"aperture": self.aperture.currentData()}
        if self.focus.currentText() != _OWN:
            at_point = self.focus.currentText() == _PICKED and self._picked is not None
            values["focus"] = list(self._picked or ()) if at_point else None
        inset = self.inset.currentText()
        if inset == _OWN:
            return values
        place = [0.5, 0.5]
        if inset == _PICKED and self._picked is not None:
            width, height = camera_view.size
            clip = project_points(camera_view.camera, np.array([self._picked]), width / height)[0]
            place = np.clip((clip[:2] / clip[3] + 1.0) / 2, 0.0, 1.0).round(4).tolist()
        magnified = {"place": place, "magnification": self.magnification.value()}
        values["insets"] = [] if inset == _NO_INSET else [magnified]
        return values

    def _enable(self) -> None:
        self.focus.setEnabled(self.aperture.currentData() > 0.0)
        self.magnification.setEnabled(self.inset.currentText() not in (_NO_INSET, _OWN))
