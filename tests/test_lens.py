"""Lenticular yarns: published figures, room, contact in any weave, and sizes from counts."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, pi, sqrt
from typing import Any

import numpy as np
import pytest
from weaves import closed_cloth

from spacemap_vtk import WeaveSource
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.geometry.yarn_clearance import least_clearance, measure_clearance
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.double_weave import find_layers
from spacemap_vtk.textile.weave.lens import (
    HEIGHT_SHARE,
    DraftFamily,
    face_radius,
    fit_lenses,
    lens_area,
)
from spacemap_vtk.textile.weave.threads import Threads

PLAIN = np.indices((4, 4)).sum(axis=0) % 2 == 0
WEAVES = {
    "plain": PLAIN,
    "twill": np.indices((5, 5)).sum(axis=0) % 4 < 2,
    "satin": (np.indices((5, 6)) * [[[2]], [[1]]]).sum(axis=0) % 5 == 0,
    "random": np.random.default_rng(6).random((5, 5)) < 0.5,
}


def lenses(height: Any, width: Any, spacing: Any = 1.0) -> Threads:
    aspect = float(np.mean(width) / np.mean(height))
    return Threads(diameter=height, spacing=spacing, section="lenticular", aspect=aspect)


@pytest.mark.parametrize(
    ("width", "height", "aspect", "theta", "crimp"),
    [
        (0.70, 0.505, 1.39, 54, 0.162),
        (0.80, 0.424, 1.89, 46, 0.116),
        (0.85, 0.373, 2.28, 41, 0.090),
        (0.90, 0.308, 2.92, 34, 0.062),
        (0.95, 0.221, 4.30, 25, 0.032),
    ],
)
def test_jammed_plain_weaves_have_the_derived_figures(
    width: float, height: float, aspect: float, theta: float, crimp: float
) -> None:
    largest = sqrt(0.5 * (1.0 - width**2))
    assert largest == pytest.approx(height, abs=5.1e-4)
    threads = lenses(largest, width)
    cloth = Cloth(drawdown=PLAIN, warp=threads, weft=threads)
    found = cloth.families[0].crimp
    assert threads.aspect == pytest.approx(aspect, abs=5e-3)
    assert degrees(found.theta) == pytest.approx(theta, abs=0.5)
    assert found.crimp == pytest.approx(crimp, abs=5e-4)
    # No height but that of level crowns is left, and a little more height is refused.
    assert cloth.feasible_heights == pytest.approx((largest, largest))
    thicker = lenses(1.0001 * largest, width)
    with pytest.raises(GeometryError, match="jammed: lenticular") as error:
        Cloth(drawdown=PLAIN, warp=thicker, weft=thicker).check()
    assert "up to" in str(error.value.allowed)


def test_a_lens_of_aspect_one_is_a_circle() -> None:
    assert lens_area(1.0) == pytest.approx(pi / 4)
    assert face_radius(1.0) == 0.5
    lens, circle = (build_section(kind, 1.0, True) for kind in ("lenticular", "circular"))
    for name in ("lateral", "normal", "weight"):
        assert getattr(lens, name) == pytest.approx(getattr(circle, name), abs=1e-15)


@pytest.mark.parametrize("aspect", [1.5, 3.2, 8.0])
def test_a_rational_lens_lies_on_its_two_arcs(aspect: float) -> None:
    lens = build_section("lenticular", aspect, True)
    radius = 2.0 * face_radius(aspect)
    t = np.linspace(0.0, 1.0, 40)[:, None]
    basis = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    area, last = 0.0, None
    for cubic in range(4):
        place = (3 * cubic + np.arange(4)) % 12
        weights = basis * lens.weight[place]
        weights /= weights.sum(axis=1, keepdims=True)
        x, z = weights @ lens.lateral[place], weights @ lens.normal[place]
        # Upper arcs about a centre below the middle, lower ones about one above it.
        centre = (1.0 - radius) if cubic in (0, 3) else (radius - 1.0)
        assert np.hypot(x, z - centre) == pytest.approx(np.full(40, radius), rel=1e-14)
        area += 0.5 * float(np.sum(x[1:] * z[:-1] - x[:-1] * z[1:]))
        assert last is None or (x[0], z[0]) == pytest.approx(last, abs=1e-14)
        last = x[-1], z[-1]
    # For a half height of 1; 40 chords of each arc cut off a little.
    assert area == pytest.approx(4.0 * lens_area(aspect), rel=1e-3)
    assert lens_area(aspect) == pytest.approx(2.0 / 3.0 * aspect, rel=0.1)


@pytest.mark.parametrize(
    ("weave", "unequal"),
    # In the gate a plain weave of like yarns, and any weave of unequal ones.
    [
        pytest.param(
            weave,
            unequal,
            marks=[pytest.mark.nightly]
            * ((weave, unequal) not in {("plain", False), ("random", True)}),
        )
        for weave in WEAVES
        for unequal in (False, True)
    ],
)
def test_yarns_touch_and_do_not_overlap_in_any_weave(weave: str, unequal: bool) -> None:
    bounds = ((0.4, 0.7), (0.8, 1.4)) if unequal else ()
    cloth = closed_cloth(WEAVES[weave], *bounds, exact=True)
    low, high = cloth.feasible_heights
    assert low < high
    size = float(np.min(cloth.warp.diameter))
    for height in (low, high):
        at_height = replace(cloth, crimp_height=height)
        assert abs(least_clearance(at_height).distance) < 1e-13 * size
    assert abs(measure_clearance(build_weave(cloth)).distance) < 1e-13 * size
    for outside in (0.99 * low, 1.01 * high):
        with pytest.raises(GeometryError, match="level crowns"):
            replace(cloth, crimp_height=outside).check()


def test_overlap_is_found() -> None:
    # Neighbours that are pushed into each other, by a quarter of the gap between them.
    cloth = closed_cloth(PLAIN, exact=True)
    weave = build_weave(cloth)
    points = np.array(weave.points)
    one = np.unique(weave.patches[weave.yarn == 1])
    points[one, 0] += 0.15
    # The edges of lenses 0.9 wide, 1 apart, are 0.15 nearer.
    assert measure_clearance(weave, points).distance < -0.049


@pytest.mark.parametrize(
    ("section", "aspect", "height"),
    [
        pytest.param("circular", 1.0, 0.25, marks=pytest.mark.nightly),
        ("racetrack", 1.5, 0.2),
    ],
)
def test_flat_and_round_yarns_are_woven_with_lenses(
    section: str, aspect: float, height: float
) -> None:
    flat = Threads(diameter=height, spacing=1.0, section=section, aspect=aspect)
    cloth = Cloth(drawdown=PLAIN, warp=flat, weft=lenses(0.25, 0.8), exact=True)
    for found in (least_clearance(cloth), measure_clearance(build_weave(cloth))):
        assert abs(found.distance) < 1e-14


def test_two_cloths_of_lenses() -> None:
    plain = np.indices((6, 6)).sum(axis=0) % 2 == 0
    first, second = np.zeros((2, 12, 12), bool)
    first[::2, ::2] = first[1::2, 1::2] = second[::2, ::2] = second[1::2, 1::2] = plain
    first[1::2, ::2] = True
    second[::2, 1::2] = True
    first[:, 6:] = second[:, 6:]  # the cloths change places
    layers = find_layers(first)
    assert layers is not None
    assert any(layers.has_changes)
    threads = lenses(0.2, 0.4)
    cloth = Cloth(drawdown=first, warp=threads, weft=threads, layers=layers, exact=True)
    assert abs(least_clearance(cloth).distance) < 1e-14
    wide = lenses(0.28, 0.84)
    with pytest.raises(GeometryError, match="no room to change places"):
        replace(cloth, warp=wide, weft=wide).check()


def test_sections_of_a_draft_fill_the_cloth() -> None:
    family = DraftFamily(np.array(0.9), np.array(1.0), None)
    warp, weft = fit_lenses(family, family)
    assert warp == weft
    assert warp.height == pytest.approx(HEIGHT_SHARE * sqrt(0.5 * (1.0 - 0.9**2)))
    # Unequal families share the height in the ratio of the square roots of their widths.
    wide = DraftFamily(np.array(1.8), np.array(2.0), None)
    warp, weft = fit_lenses(family, wide)
    assert warp.height / weft.height == pytest.approx(sqrt(0.5))
    product = 0.5 * min(1.0 - 0.9**2, 2.0**2 - 1.8**2)
    assert warp.height * weft.height == pytest.approx(HEIGHT_SHARE**2 * product)


@pytest.mark.parametrize("area", [0.02, 0.1, 0.15, 0.25, 0.4])
def test_sections_of_a_count_keep_its_area(area: float) -> None:
    family = DraftFamily(np.array(0.9), np.array(1.0), np.array(area))
    shape, _ = fit_lenses(family, family)
    assert lens_area(shape.aspect) * shape.height**2 == pytest.approx(area)
    assert 1.0 <= shape.aspect <= 4.0
    width = shape.aspect * float(shape.height)
    assert width <= 0.9 * (1.0 + 1e-9) or shape.aspect == 1.0
    if area < 0.2:
        threads = lenses(float(shape.height), width)
        Cloth(drawdown=PLAIN, warp=threads, weft=threads).check()


def test_patterns_with_a_count_are_closed_at_their_sett() -> None:
    # 20/2 cotton at 36 ends per inch, within the usual setts of 30 to 48.
    source = WeaveSource(
        warp_count="20/2", weft_count="20/2", warp_sett="36 epi", weft_sett="36 ppi"
    )
    cloth = source.cloth
    assert cloth.warp.shape == "lenticular"
    assert cloth.warp.size == "given"
    cover = cloth.warp.aspect * cloth.warp.mean_diameter / (0.0254 / 36)
    assert 0.85 < cover <= 0.9
    # Without a count nothing is assumed: the round yarns of Peirce's paper.
    assert WeaveSource().cloth.warp.shape == "circular"
