"""Cameras that a scene stores, in the same namespace as those of the program."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.records import Record, Records
from spacemap_vtk.parameters import AUTOMATIC, Choice, Real, Text, Vector, suggestion
from spacemap_vtk.scenes.cameras import CAMERAS, VIEW_ANGLE


class Direction(Vector):
    """A vector whose length is not zero."""

    def convert(self, value: Any) -> tuple[Any, ...]:
        """Convert to three numbers, not all zero."""
        found = super().convert(value)
        if not any(found):
            raise InputError("must not be the zero vector")
        return found


class SavedCamera(Record):
    """A camera with a name of its own, at a fixed place."""

    section = "view.cameras"
    noun, nouns = "saved camera", "saved cameras"

    name = Text("", "Name, by which view.camera chooses the camera.")
    position = Vector((0.0, 0.0, 1.0), "Where the camera is.", component=Real(0.0, "", unit="m"))
    focal_point = Vector(
        (0.0, 0.0, 0.0),
        "The point in the middle of the picture.",
        component=Real(0.0, "", unit="m"),
    )
    up = Direction((0.0, 1.0, 0.0), "Direction that is up in the picture.", component=Real(0.0, ""))
    angle = Real(
        VIEW_ANGLE,
        "Angle between the lower and the upper edge of the picture.",
        unit="deg",
        above=0.0,
        below=180.0,
    )
    height = Real(
        None,
        "Height of what a camera without perspective shows.",
        unit="m",
        above=0.0,
        automatic="with perspective",
    )

    def complete(self) -> None:
        """Check that the name is new, and that there is a direction to look in."""
        if not self.name.strip() or self.name in CAMERAS or self.name == AUTOMATIC:
            raise InputError(
                "a saved camera needs a name of its own",
                key="name",
                value=self.name,
                allowed=f"any but {', '.join((*CAMERAS, AUTOMATIC))}",
            )
        ahead = [f - p for f, p in zip(self.focal_point, self.position, strict=True)]
        across = [ahead[k - 2] * self.up[k - 1] - ahead[k - 1] * self.up[k - 2] for k in range(3)]
        if not any(abs(part) > 1e-9 * max(map(abs, ahead)) for part in across):
            raise InputError(
                "a camera looks from its position to another point, and not along its up direction",
                key="focal_point",
                value=self.focal_point,
            )


class SavedCameras(Records):
    """Any number of saved cameras; a scene file writes them as ``[[view.cameras]]``."""

    kind = "cameras"
    annotation = "sequence of SavedCamera or dict"
    record = SavedCamera

    @property
    def expected(self) -> str:
        """The keys of a saved camera, in words."""
        return f"a list of tables, each with {', '.join(SavedCamera.parameters)}"

    def convert(self, value: Any) -> tuple[Any, ...]:
        """Convert to checked cameras, each with a name of its own."""
        cameras = super().convert(value)
        names = [camera.name for camera in cameras]
        for number, name in enumerate(names):
            if name in names[:number]:
                raise InputError("two cameras have this name", key=f"[{number}].name", value=name)
        return cameras


class CameraName(Choice):
    """Name of one of `CAMERAS`, or of a saved camera; whether that exists is checked later."""

    def convert(self, value: Any) -> str:
        """Return the name."""
        if not isinstance(value, str) or not value.strip():
            raise InputError("must be the name of a camera")
        return value

    @property
    def expected(self) -> str:
        """The names, quoted."""
        return f'{super().expected} or the name of a camera in "cameras"'


def require_camera(name: str | None, saved: Iterable[SavedCamera]) -> SavedCamera | None:
    """Return the saved camera of a name; None for a camera of the program."""
    by_name = {camera.name: camera for camera in saved}
    if name is None or name in CAMERAS:
        return None
    if name in by_name:
        return by_name[name]
    names = [*CAMERAS, *by_name]
    raise InputError(
        "there is no such camera",
        key="camera",
        value=name,
        allowed=", ".join(names),
        cure=suggestion(name, names),
    )
