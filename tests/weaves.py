"""Random cloths and the surfaces of their patches, for the tests of fabric geometry."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.weave import Weave

#: VTK's order of a 3 x 3 Bézier quadrilateral, by hand: its place in the list for each (i, j).
PLACES = [[0, 10, 11, 3], [4, 12, 14, 8], [5, 13, 15, 9], [1, 6, 7, 2]]
LENGTHS = (
    *(f"{family}_{what}" for family in ("warp", "weft") for what in ("diameter", "spacing")),
    "warp_crimp_height",
    "overhang",
)


def bernstein(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cubic Bernstein polynomials and their derivatives, (n, 4)."""
    s = 1 - t
    value = np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=1)
    slope = 3 * np.stack([-s * s, s * s - 2 * s * t, 2 * s * t - t * t, t * t], axis=1)
    return value, slope


def surface(made: Weave, t: np.ndarray, which: Any = slice(None)) -> tuple[np.ndarray, ...]:
    """Points and derivatives of patches at t x t, (patches, n, n, 3); rational ones too."""
    patches = made.patches[which]
    weights = np.ones(len(made.points)) if made.weights is None else made.weights
    net = np.column_stack([made.points * weights[:, None], weights])[patches][:, PLACES]
    value, slope = bernstein(t)
    p, u, v = (
        np.einsum("ui,vj,pijc->puvc", a, b, net, optimize=True)
        for a, b in ((value, value), (slope, value), (value, slope))
    )
    point = p[..., :3] / p[..., 3:]
    return point, *((d[..., :3] - d[..., 3:] * point) / p[..., 3:] for d in (u, v))


def scaled(cloth: Cloth, unit: float) -> Cloth:
    """The same cloth in another unit."""
    values = {name: getattr(cloth, name) for name in LENGTHS}
    return replace(cloth, **{n: v * unit for n, v in values.items() if v is not None})


def loosened(share: float, **measures: Any) -> Cloth:
    """A cloth with spacings stretched until it can be woven, at a share of its crimp interval."""
    for _ in range(400):
        try:
            cloth = Cloth(**measures)
        except GeometryError:
            for name in ("warp_spacing", "weft_spacing"):
                measures[name] = 1.05 * measures[name]
            continue
        low, high = cloth.feasible_heights
        return replace(cloth, warp_crimp_height=low + share * (high - low))
    raise AssertionError("no cloth")


@st.composite
def woven(draw: st.DrawFn, most: int = 5, sections: bool = True) -> tuple[np.ndarray, Cloth]:
    """Any weave of yarns of any diameters, spacings and sections."""
    picks, ends = draw(st.integers(1, most)), draw(st.integers(1, most))
    over = draw(arrays(bool, (picks, ends)))
    measures: dict[str, Any] = {"exact": draw(st.booleans())}
    for family, count in (("warp", ends), ("weft", picks)):
        diameter = draw(arrays(float, count, elements=st.floats(0.05, 1)))
        section = draw(st.sampled_from(["circular", "racetrack", "elliptic"]))
        aspect = draw(st.floats(1.01, 3)) if sections and section != "circular" else 1.0
        loose = draw(arrays(float, count - 1, elements=st.floats(1, 2)))
        measures[f"{family}_diameter"] = diameter
        measures[f"{family}_spacing"] = aspect * loose * (diameter[1:] + diameter[:-1]) / 2
        measures[f"{family}_section"] = section if sections else "circular"
        measures[f"{family}_aspect"] = aspect
    return over, loosened(draw(st.floats(0, 1)), **measures)
