"""What the window asks its engine for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Swing:
    """A mode to be shown in place of the motion.

    Parameters
    ----------
    mode : int
        Its number.
    amplitude : float
        Largest displacement, as a share of the cage's largest side.
    phase : float
        In whole swings.
    """

    mode: int
    amplitude: float
    phase: float


@dataclass(frozen=True)
class Job:
    """A picture wanted.

    Parameters
    ----------
    values : dict
        The scene, as a file has it.
    base : Path
        Relative paths count from its folder.
    settings : dict
        The values of every section's parameters, checked and in SI, as `values` have them.
    stages : tuple of str
        Sections of the stages that are connected, likewise.
    generation : int
        Another number for another scene.
    time : float
        In s.
    coarse : bool
        Whether speed counts for more than smoothness.
    swing : Swing, optional
        The mode to show in place of the motion.
    """

    values: dict[str, Any]
    base: Path
    settings: dict[str, dict[str, Any]]
    stages: tuple[str, ...]
    generation: int
    time: float
    coarse: bool = False
    swing: Swing | None = field(default=None)
