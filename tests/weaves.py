"""Random cloths and the surfaces of their patches, for the tests of fabric geometry."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.geometry.weave import Weave
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.lens import DraftFamily, fit_lenses
from spacemap_vtk.textile.weave.threads import Threads

#: VTK's order of a 3 x 3 Bézier quadrilateral, by hand: its place in the list for each (i, j).
PLACES = [[0, 10, 11, 3], [4, 12, 14, 8], [5, 13, 15, 9], [1, 6, 7, 2]]
PLAIN = [[1, 0], [0, 1]]


def plain(ends: int, picks: int) -> np.ndarray:
    """Plain weave of so many yarns."""
    return tile_drawdown(patterns.plain(), ends, picks)


def closed_cloth(
    drawdown: np.ndarray,
    widths: tuple[float, float] | None = None,
    spacings: tuple[float, float] = (1.0, 1.0),
    exact: bool = False,
) -> Cloth:
    """Make a cloth of lenses that hardly leave gaps: 0.9 wide and 1 apart, or random in bounds."""
    random, families = np.random.default_rng(2), []
    for count in drawdown.shape[::-1]:
        spacing = random.uniform(*spacings, count - 1)
        width = np.full(count, 0.9) if widths is None else random.uniform(*widths, count)
        families.append(DraftFamily(width, spacing, None))
    warp, weft = (
        Threads(
            diameter=shape.height,
            spacing=family.spacing,
            section="lenticular",
            aspect=shape.aspect,
        )
        for shape, family in zip(fit_lenses(*families), families, strict=True)
    )
    return Cloth(drawdown=drawdown, warp=warp, weft=weft, exact=exact)


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


def measured(**measures: Any) -> Cloth:
    """A cloth from the measures that a user gives by name; by default a plain weave."""
    none = Threads(diameter=1.0, spacing=1.0)
    return changed(Cloth(drawdown=PLAIN, warp=none, weft=none), **measures)


def changed(cloth: Cloth, **measures: Any) -> Cloth:
    """The same cloth with other measures, by the names that a user gives them."""
    if "warp_crimp_height" in measures:
        measures["crimp_height"] = measures.pop("warp_crimp_height")
    for family, threads in (("warp", cloth.warp), ("weft", cloth.weft)):
        own = [name for name in measures if name.startswith(family)]
        measures[family] = replace(threads, **{name[5:]: measures.pop(name) for name in own})
    return replace(cloth, **measures)


def scaled(cloth: Cloth, unit: float) -> Cloth:
    """The same cloth in another unit."""
    warp, weft = (
        replace(threads, diameter=threads.diameter * unit, spacing=threads.spacing * unit)
        for threads in cloth.threads
    )
    height, overhang = (
        None if value is None else value * unit for value in (cloth.crimp_height, cloth.overhang)
    )
    return replace(cloth, warp=warp, weft=weft, crimp_height=height, overhang=overhang)


def loosened(share: float, cloth: Cloth) -> Cloth:
    """A cloth with spacings stretched until it can be woven, at a share of its crimp interval."""
    for _ in range(400):
        try:
            low, high = cloth.feasible_heights
        except GeometryError:
            warp, weft = (replace(t, spacing=1.05 * t.spacing) for t in cloth.threads)
            cloth = replace(cloth, warp=warp, weft=weft)
            continue
        return replace(cloth, crimp_height=low + share * (high - low))
    raise AssertionError("no cloth")


@st.composite
def woven(draw: st.DrawFn, most: int = 5, sections: bool = True) -> Cloth:
    """Any weave of yarns of any diameters, spacings and sections."""
    picks, ends = draw(st.integers(1, most)), draw(st.integers(1, most))
    over, exact = draw(arrays(bool, (picks, ends))), draw(st.booleans())
    families = []
    for count in (ends, picks):
        diameter = draw(arrays(float, count, elements=st.floats(0.05, 1)))
        section = draw(st.sampled_from(["circular", "racetrack", "elliptic"]))
        aspect = draw(st.floats(1.01, 3)) if sections and section != "circular" else 1.0
        loose = draw(arrays(float, count - 1, elements=st.floats(1, 2)))
        families.append(
            Threads(
                diameter=diameter,
                spacing=aspect * loose * (diameter[1:] + diameter[:-1]) / 2,
                section=section if sections else "circular",
                aspect=aspect,
            )
        )
    cloth = Cloth(drawdown=over, warp=families[0], weft=families[1], exact=exact)
    return loosened(draw(st.floats(0, 1)), cloth)
