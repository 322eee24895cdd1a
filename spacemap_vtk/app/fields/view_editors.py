"""Editors of a view's camera, its saved cameras and its insets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from spacemap_vtk.app.fields.basic_editors import ChoiceEditor
from spacemap_vtk.app.fields.record_cards import RecordCards
from spacemap_vtk.scenes.insets import CORNERS, Inset, Insets
from spacemap_vtk.scenes.saved_cameras import CameraName, SavedCamera, SavedCameras

_PERSPECTIVE, _PARALLEL = "perspective", "no_perspective"
#: Height of what a new camera without perspective shows.
_HEIGHT = "10 cm"


class CameraEditor(ChoiceEditor):
    """A combo box with the cameras of the program and of the scene."""

    def __init__(self, parameter: CameraName) -> None:
        super().__init__(parameter)
        self._own = self.box.count()

    def offer(self, names: Iterable[str]) -> None:
        """Offer the saved cameras of the scene."""
        while self.box.count() > self._own:
            self.box.removeItem(self._own)
        for name in names:
            self.box.addItem(name, name)


class CamerasEditor(RecordCards):
    """Cards of the saved cameras."""

    def __init__(self, parameter: SavedCameras) -> None:
        super().__init__(parameter, [_PERSPECTIVE, _PARALLEL], parameter.record.noun)

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new camera, with a name that is free."""
        names = {table["name"] for table in self._tables}
        free = next(n for k in range(1, len(names) + 2) if (n := f"camera {k}") not in names)
        return {"name": free, **({"height": _HEIGHT} if kind == _PARALLEL else {})}

    def kind_of(self, record: SavedCamera) -> str:
        """Return whether a camera has perspective."""
        return _PERSPECTIVE if record.height is None else _PARALLEL

    def change_kind(self, record: SavedCamera, kind: str) -> dict[str, Any]:
        """Return the changes for another projection."""
        return {"height": None} if kind == _PERSPECTIVE else {"height": _HEIGHT, "angle": None}

    def is_optional(self, record: SavedCamera, name: str) -> bool:
        """Return whether a camera may do without this key."""
        return name not in ("name", "height")

    def row_names(self, record: SavedCamera) -> list[str]:
        """Return the keys of the rows of a camera."""
        extent = "angle" if record.height is None else "height"
        return ["name", "position", "focal_point", "up", extent]


class InsetsEditor(RecordCards):
    """Cards of the insets."""

    def __init__(self, parameter: Insets) -> None:
        super().__init__(parameter, [*CORNERS], parameter.record.noun)

    def first_values(self, kind: str) -> dict[str, Any]:
        """Return the first values of a new inset: it shows the middle of the picture."""
        return {"corner": kind}

    def kind_of(self, record: Inset) -> str:
        """Return the corner of an inset."""
        return next(n for n, corner in CORNERS.items() if corner == record.corner_of_picture)

    def change_kind(self, record: Inset, kind: str) -> dict[str, Any]:
        """Return the changes for another corner."""
        return {"corner": kind}

    def row_names(self, record: Inset) -> list[str]:
        """Return the keys of the rows of an inset."""
        return [name for name in Inset.parameters if name != "corner"]
