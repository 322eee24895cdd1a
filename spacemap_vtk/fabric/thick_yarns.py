"""Drafts whose yarns are too thick to interlace.

Weaving programs write a thickness equal to the spacing, because they draw yarns side by side. No
round yarn can be woven so: there would be no room for the other family to pass between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.units import format_quantity

#: Such yarns are drawn this share of the thickest (or, flattened, the highest) feasible.
THICKNESS_SHARE = 0.85
#: A flattened yarn is at most this share of its spacing wide, so that others can pass beside it.
WIDTH_SHARE = 0.8
#: Thinner than this share of the draft's thickness is no mending.
_LEAST = 1e-3


def scaled(measures: dict[str, Any], families: Sequence[str]) -> tuple[dict[str, Any], str]:
    """Make a draft's yarns thinner until they can interlace."""

    def at(factor: float) -> dict[str, Any]:
        return {f"{f}_diameter": factor * measures[f"{f}_diameter"] for f in families}

    limit = _largest(lambda factor: _feasible(measures | at(factor)))
    if limit is None or limit == 1.0:
        return {}, ""
    changes = at(THICKNESS_SHARE * limit)
    return changes, (
        f"{_too_thick(measures, families)}; drawn {_sizes(changes, families, '_diameter')} thick, "
        f"{THICKNESS_SHARE:.0%} of the most that can be woven"
    )


def flattened(measures: dict[str, Any], families: Sequence[str]) -> tuple[dict[str, Any], str]:
    """Flatten a draft's yarns until they can interlace: the thickness becomes their width."""
    if _feasible(measures):
        return {}, ""
    widths = {}
    for family in families:
        thickness = measures[f"{family}_aspect"] * np.asarray(measures[f"{family}_diameter"])
        between = thickness if thickness.ndim == 0 else 0.5 * (thickness[1:] + thickness[:-1])
        room = np.min(np.asarray(measures[f"{family}_spacing"]) / between)
        widths[family] = min(1.0, WIDTH_SHARE * float(room)) * thickness

    def at(height: float) -> dict[str, Any]:
        changes: dict[str, Any] = {}
        for family, width in widths.items():
            own = measures[f"{family}_section"]
            changes[f"{family}_diameter"] = height * width
            changes[f"{family}_aspect"] = 1.0 / height
            changes[f"{family}_section"] = "racetrack" if own == "circular" else own
        return changes

    limit = _largest(lambda height: _feasible(measures | at(height)))
    if limit is None:
        return {}, ""
    changes = at(THICKNESS_SHARE * limit)
    shown = {f"{f}_width": width for f, width in widths.items()}
    return changes, (
        f"{_too_thick(measures, families)}; flattened to {_sizes(shown, families, '_width')} wide "
        f"and {_sizes(changes, families, '_diameter')} high, {THICKNESS_SHARE:.0%} of the most "
        "that can be woven"
    )


def _feasible(measures: dict[str, Any]) -> bool:
    try:
        Cloth(**measures)
    except GeometryError:
        return False
    return True


def _largest(feasible: Callable[[float], bool]) -> float | None:
    """Return the largest feasible factor up to 1; None if there is none worth having."""
    if feasible(1.0):
        return 1.0
    low, high = _LEAST, 1.0
    if not feasible(low):
        return None
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if feasible(middle) else (low, middle)
    return low


def _too_thick(measures: dict[str, Any], families: Sequence[str]) -> str:
    return (
        f"the draft's yarns, {_sizes(measures, families, '_diameter')} thick at spacings of "
        f"{_sizes(measures, families, '_spacing')}, are too thick to interlace"
    )


def _sizes(measures: dict[str, Any], families: Sequence[str], what: str) -> str:
    return " and ".join(f"{_range(measures[f + what])} ({f})" for f in families)


def _range(values: Any) -> str:
    shown = [
        format_quantity(float(f"{value:.4g}"), "m") for value in (np.min(values), np.max(values))
    ]
    return " to ".join(dict.fromkeys(shown))
