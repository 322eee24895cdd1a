"""A fabric as a draft that weaving programs read, whatever it was made from."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.loom import Loom
from spacemap_vtk.fabric.loom_edit import tiled
from spacemap_vtk.fabric.settle import FAMILIES, Dressed, settled_measures
from spacemap_vtk.fabric.wishes import Wishes
from spacemap_vtk.io.wif import WifDraft


def as_wif(fabric: Dressed, source: Draft | WifDraft, wishes: Wishes, title: str = "") -> WifDraft:
    """Return the draft of a fabric."""
    # What came from a draft and was not changed by a wish is handed on as it was, the thickness of
    # yarns that would have to be thinned among it: nothing here needs room for the yarns.
    from_wif = isinstance(source, WifDraft)
    own = source.draft if isinstance(source, WifDraft) else source
    lengths: dict[str, Any] = {}
    each: dict[str, Any] = {}
    colors: dict[str, Any] = {}
    for number, family in enumerate(FAMILIES):
        count = fabric.drawdown.shape[1 - number]
        asked = {"spacing": ("spacing", "sett"), "thickness": ("diameter", "count", "aspect")}
        for name, several in (("spacing", "spacings"), ("thickness", "thicknesses")):
            wished = any(getattr(wishes, f"{family}_{w}") is not None for w in asked[name])
            value = getattr(own, f"{family}_{name}")
            threads = getattr(source, f"{family}_{several}", None)
            if wished or (value is None and not from_wif):
                threads = _MADE[name](settled_measures(source, wishes)[0], family, count)
                value = float(threads.mean())
            if threads is not None:
                threads = np.resize(threads, count)
                threads = None if (threads == value).all() else threads
            lengths[f"{family}_{name}"], each[f"{family}_{several}"] = value, threads
        plain = from_wif and getattr(own, f"{family}_colors") is None
        if not plain or getattr(wishes, f"{family}_color") is not None:
            colors[f"{family}_colors"] = getattr(fabric, f"{family}_colors")
    return WifDraft(
        Draft(
            fabric.drawdown,
            **colors,
            **lengths,
            title=own.title or title,
            warnings=own.warnings,
        ),
        loom_of(source, fabric.drawdown),
        **each,
    )


def loom_of(source: Draft | WifDraft, drawdown: NDArray[np.bool_]) -> Loom:
    """Return the loom for a cloth: the draft's own, repeated, if it weaves it."""
    if isinstance(source, WifDraft):
        loom = tiled(source.loom, drawdown.shape[1], len(drawdown))
        if np.array_equal(loom.drawdown(), drawdown):
            return loom
    return Loom.from_drawdown(drawdown)


def _widths(measures: dict[str, Any], family: str, count: int) -> NDArray[np.float64]:
    diameter = np.asarray(measures[f"{family}_diameter"])
    return np.resize(measures[f"{family}_aspect"] * diameter, count)


def _spaces(measures: dict[str, Any], family: str, count: int) -> NDArray[np.float64]:
    """Return the space of each thread, in whose middle it stands."""
    gaps = np.asarray(measures[f"{family}_spacing"])
    if gaps.ndim == 0 or gaps.size == 0:
        around = sum(float(np.mean(measures[f"{of}_diameter"])) for of in FAMILIES)
        return np.full(count, float(gaps) if gaps.ndim == 0 else around)
    # s[i] + s[i + 1] = 2 gap[i]: all follow from the first, with alternating signs
    sign = (-1.0) ** np.arange(count)
    rest = np.zeros(count)
    for index, gap in enumerate(gaps.tolist()):
        rest[index + 1] = 2.0 * gap - rest[index]
    low = max(float((-rest[sign > 0]).max()), 0.0)
    high = float(rest[sign < 0].min())
    if not low < high:
        raise InputError(
            f"a WIF cannot hold the distances between the {family} yarns",
            key=f"{family}_spacing",
            cure="It gives each thread a space, in whose middle it stands: let distances change "
            "more gently",
        )
    return np.asarray(rest + sign * 0.5 * (low + high))


_MADE = {"spacing": _spaces, "thickness": _widths}
