"""What a stage can say of its parameters before it runs: feasible intervals, settled values."""

from __future__ import annotations

from typing import Any

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.parameters import Parameterised


def intervals(part: Parameterised) -> dict[str, tuple[float, float]]:
    """Return the interval in which each parameter may lie, all the others as they are."""
    try:
        if hasattr(type(part), "feasible"):
            return dict(part.feasible)  # type: ignore[attr-defined]
    except SpacemapError:
        pass
    return {}


def settled(part: Parameterised) -> dict[str, Any]:
    """Return what automatic parameters have settled to."""
    if not isinstance(part, WeaveSource):
        return {}
    try:
        fabric = part.fabric
    except SpacemapError:
        return {}
    picks, ends = fabric.drawdown.shape
    known: dict[str, Any] = {"ends": int(ends), "picks": int(picks)}
    for name in part.parameters:
        value = getattr(fabric.cloth, "height" if name == "warp_crimp_height" else name, None)
        if isinstance(value, float):
            known[name] = value
    return known
