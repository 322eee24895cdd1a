"""Make yarns thinner or flatter where a draft's yarns are too thick to interlace.

Weaving programs write a thickness equal to the spacing, because they draw yarns touching each
other. Round yarns cannot be woven like that: the other family has no room to pass between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.lens import neighbour_means
from spacemap_vtk.textile.weave.threads import Lengths, Threads
from spacemap_vtk.units import format_quantity

#: The new thickness (or height, for flattened yarns) as a share of the largest feasible one.
THICKNESS_SHARE = 0.85
#: Largest width of a flattened yarn as a share of its spacing, so that others can pass.
WIDTH_SHARE = 0.9
#: The same where two cloths change places: as the yarns become flatter in proportion to the room
#: that is left beside them, wider ones would be tapes; these leave 4 % of the cloth open.
LAYERED_WIDTH_SHARE = 0.8
#: Least factor on the draft's thickness; smaller ones do not count as a solution.
_LEAST = 1e-3

#: Whether the thickness of warp and weft comes from a draft and may be changed.
Thick = tuple[bool, bool]


def scale_yarns(cloth: Cloth, thick: Thick) -> tuple[Cloth, str]:
    """Make a draft's yarns thinner until they can interlace; also return a message."""

    def scale(factor: float) -> Cloth:
        return _replace_families(cloth, thick, lambda t: replace(t, diameter=factor * t.diameter))

    limit = _largest_factor(lambda factor: is_feasible(scale(factor)))
    if limit is None or limit == 1.0:
        return cloth, ""
    scaled = scale(THICKNESS_SHARE * limit)
    return scaled, (
        f"{_describe_problem(cloth, thick)}; drawn {_format_diameters(scaled, thick)} thick, "
        f"{THICKNESS_SHARE:.0%} of the feasible limit"
    )


def flatten_yarns(cloth: Cloth, thick: Thick) -> tuple[Cloth, str]:
    """Flatten a draft's yarns until they can interlace: the thickness becomes their width."""
    changes = cloth.layers is not None and any(cloth.layers.has_changes)
    filling = LAYERED_WIDTH_SHARE if changes else WIDTH_SHARE
    if is_feasible(cloth) or any(
        _width_share(threads, filling) < _LEAST
        for threads, mine in zip(cloth.threads, thick, strict=True)
        if mine
    ):
        return cloth, ""

    def flatten(height: float) -> Cloth:
        def flatten_family(threads: Threads) -> Threads:
            return replace(
                threads,
                diameter=height * _width(threads, filling),
                aspect=1.0 / height,
                section="racetrack" if threads.section == "circular" else threads.section,
            )

        return _replace_families(cloth, thick, flatten_family)

    limit = _largest_factor(lambda height: is_feasible(flatten(height)))
    if limit is None:
        return cloth, ""
    flattened = flatten(THICKNESS_SHARE * limit)
    widths = _format_lengths(thick, *(_width(threads, filling) for threads in cloth.threads))
    return flattened, (
        f"{_describe_problem(cloth, thick)}; flattened to {widths} wide "
        f"and {_format_diameters(flattened, thick)} high, {THICKNESS_SHARE:.0%} of the "
        "feasible limit"
    )


def _replace_families(cloth: Cloth, thick: Thick, change: Callable[[Threads], Threads]) -> Cloth:
    warp, weft = (
        change(threads) if mine else threads
        for threads, mine in zip(cloth.threads, thick, strict=True)
    )
    return replace(cloth, warp=warp, weft=weft)


def _width(threads: Threads, filling: float) -> Lengths:
    """Compute the width of a flattened yarn: its thickness, if others can pass beside it."""
    return np.asarray(
        _width_share(threads, filling) * threads.aspect * np.asarray(threads.diameter)
    )


def _width_share(threads: Threads, filling: float) -> float:
    """Compute the share of its thickness that a flattened yarn keeps as its width."""
    thickness = threads.aspect * np.asarray(threads.diameter)
    room = np.asarray(threads.spacing) / neighbour_means(thickness)
    return min(1.0, filling * float(np.min(room)))


def is_feasible(cloth: Cloth) -> bool:
    """Check whether there is a crimp height at which the yarns of a cloth have room."""
    try:
        _ = cloth.feasible_heights
    except GeometryError:
        return False
    return True


def _largest_factor(feasible: Callable[[float], bool]) -> float | None:
    """Find the largest feasible factor up to 1; None if it is below `_LEAST`."""
    if feasible(1.0):
        return 1.0
    low, high = _LEAST, 1.0
    if not feasible(low):
        return None
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if feasible(middle) else (low, middle)
    return low


def _describe_problem(cloth: Cloth, thick: Thick) -> str:
    spacings = _format_lengths(thick, cloth.warp.spacing, cloth.weft.spacing)
    return (
        f"the draft's yarns are too thick to interlace: {_format_diameters(cloth, thick)} thick at "
        f"spacings of {spacings}"
    )


def _format_diameters(cloth: Cloth, thick: Thick) -> str:
    return _format_lengths(thick, cloth.warp.diameter, cloth.weft.diameter)


def _format_lengths(thick: Thick, *lengths: Lengths) -> str:
    return " and ".join(
        f"{_format_range(values)} ({family})"
        for family, values, mine in zip(FAMILIES, lengths, thick, strict=True)
        if mine
    )


def _format_range(values: Lengths) -> str:
    shown = [format_quantity(value, "m", 4) for value in (np.min(values), np.max(values))]
    return " to ".join(dict.fromkeys(shown))
