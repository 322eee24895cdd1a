"""What is known of a section's parameters, all the others as they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.cage_material import CageMaterial
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.parameters import Parameter, Parameterised
from spacemap_vtk.units import format_quantity


def feasible_of(part: Parameterised) -> dict[str, tuple[float, float]]:
    """Return the interval in which each parameter may lie, all the others as they are."""
    try:
        if hasattr(type(part), "feasible"):
            return dict(part.feasible)  # type: ignore[attr-defined]
    except SpacemapError:
        pass
    return {}


def resolved_of(part: Parameterised) -> dict[str, Any]:
    """Return what automatic parameters are resolved to."""
    try:
        return dict(part.found) if isinstance(part, WeaveSource) else {}
    except SpacemapError:
        return {}


def idle_of(part: Parameterised, name: str, found: Mapping[str, Any]) -> str:
    """Return why a parameter counts for nothing, as it is set or as the last run has found it."""
    why, kind = part.idle(name), found.get("elements")
    if not why and kind and isinstance(part, CageMaterial) and part.elements == "auto":
        why = part.idle_as(name, kind == "sheet")
    return why


def told_interval(parameter: Parameter[Any], interval: tuple[float, float] | None) -> str:
    """Return in words between which values one is feasible; empty where that is not known."""
    if interval is None:
        return ""
    low, high = (
        "∞" if end == float("inf") else format_quantity(end, parameter.unit, 4) for end in interval
    )
    return f"feasible: {low} to {high}"
