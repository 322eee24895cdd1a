"""The cameras of the program, by name."""

from __future__ import annotations

#: Position of each camera, as a direction from the middle of the scene, and the direction that is
#: up: y, or z for `lying`; neither can be up in views along y.
CAMERAS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "three-quarter": ((0.75, 0.35, 1.0), (0.0, 1.0, 0.0)),
    "isometric": ((1.0, 1.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "back": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "right": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "left": ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "top": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    "bottom": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "lying": ((0.45, -1.0, 0.55), (0.0, 0.0, 1.0)),
    "face": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
}
#: Cameras that look along an axis.
SIDES = ("front", "back", "right", "left", "top", "bottom")
#: The camera without perspective.
FLAT = "face"
#: Vertical view angle of the camera, in degrees.
VIEW_ANGLE = 24.0
