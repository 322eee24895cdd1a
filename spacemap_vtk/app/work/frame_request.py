"""Requests from the window and the browser to their engines."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spacemap_vtk.draw.camera import CameraView

#: A run that has taken longer, in s, is cancelled when a newer request arrives. Shorter runs are
#: finished: a drag that sends requests faster than runs end would otherwise show no frame at all.
CANCEL_AFTER = 0.5


@dataclass(frozen=True)
class Swing:
    """One vibration mode, shown instead of the motion."""

    #: Index of the mode, from 0.
    mode: int
    #: Largest displacement, as a fraction of the cage's longest side.
    amplitude: float
    #: Phase in periods.
    phase: float
    #: Largest rotation in rad; used instead of `amplitude` if the scene reconstructs rotations.
    angle: float | None = None


@dataclass(frozen=True)
class Pull:
    """A uniform stretch of the cloth, shown instead of the motion."""

    #: Stretch ratios of the cage along warp and weft; 1 at rest.
    warp: float
    weft: float


@dataclass(frozen=True)
class FrameRequest:
    """A request for one frame."""

    #: The scene as in a scene file.
    values: dict[str, Any]
    #: File whose folder is the base of relative paths.
    base: Path
    #: Parameter values of every section, checked and in SI units; they correspond to `values`.
    settings: dict[str, dict[str, Any]]
    #: Changes when another scene is opened.
    generation: int
    #: Time in s.
    time: float
    #: Whether to draw fewer facets, to be faster.
    coarse: bool = False
    #: Mode or stretch to show instead of the motion.
    swing: Swing | Pull | None = field(default=None)
    #: Camera and size of the view; None before the camera is aimed.
    camera_view: CameraView | None = None
