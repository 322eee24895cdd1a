"""What window and browser ask their engines for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spacemap_vtk.draw.camera import Seen

#: Seconds after which a run is given up for a newer wish; a shorter one ends, or a drag whose
#: wishes come faster than runs end would show nothing.
PATIENCE = 0.5


@dataclass(frozen=True)
class Swing:
    """A mode to be shown in place of the motion."""

    #: Its number.
    mode: int
    #: Largest displacement, as a share of the cage's largest side.
    amplitude: float
    #: In whole swings.
    phase: float
    #: The largest angle that it turns by [rad], in place of that, where turning is rebuilt.
    angle: float | None = None


@dataclass(frozen=True)
class Pull:
    """The cloth stretched alike everywhere, in place of the motion."""

    #: Stretches of space along warp and weft, 1 at rest.
    warp: float
    weft: float


@dataclass(frozen=True)
class Job:
    """A picture wanted."""

    #: The scene, as a file has it.
    values: dict[str, Any]
    #: Relative paths count from its folder.
    base: Path
    #: The values of every section's parameters, checked and in SI, as `values` have them.
    settings: dict[str, dict[str, Any]]
    #: Another number for another scene.
    generation: int
    #: In s.
    time: float
    #: Whether speed counts for more than smoothness.
    coarse: bool = False
    #: The mode, or the stretch, to show in place of the motion.
    swing: Swing | Pull | None = field(default=None)
    #: What the view looks at; None before it has been aimed.
    seen: Seen | None = None
