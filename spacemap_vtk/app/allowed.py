"""What a stage can say of its parameters before it runs: feasible intervals, settled values."""

from __future__ import annotations

from typing import Any

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.parameters import Parameterised


def intervals(part: Parameterised) -> dict[str, tuple[float, float]]:
    """Return the interval in which each parameter may lie, all the others as they are.

    Parameters
    ----------
    part : Parameterised
        A stage, not necessarily feasible; a class with a property `feasible` speaks for itself.

    Returns
    -------
    dict of str to tuple of float
        By parameter; empty where nothing is known.
    """
    try:
        if hasattr(type(part), "feasible"):
            return dict(part.feasible)  # type: ignore[attr-defined]
    except SpacemapError:
        pass
    return {}


def settled(part: Parameterised) -> dict[str, Any]:
    """Return what automatic parameters have settled to.

    Parameters
    ----------
    part : Parameterised
        A stage.

    Returns
    -------
    dict of str to object
        By parameter, in SI; empty where nothing is known.
    """
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
