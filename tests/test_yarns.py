"""Yarns of different diameters, spacings and sections in one cloth, and their clearance."""

from __future__ import annotations

import doctest
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import brentq
from weaves import changed, loosened, measured, plain, scaled, surface, woven

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown
from spacemap_vtk.textile.geometry import yarn_clearance
from spacemap_vtk.textile.geometry.cloth_axes import sample_axes
from spacemap_vtk.textile.geometry.weave import Weave, build_weave, estimate_bytes
from spacemap_vtk.textile.geometry.yarn_clearance import (
    Clearance,
    find_contact,
    least_clearance,
    measure_clearance,
)
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.figures import fabric_figures

UNEQUAL = loosened(
    0.3,
    measured(
        drawdown=tile_drawdown(patterns.twill(2, 1), 5, 4),
        warp_diameter=np.array([0.2, 0.5, 0.1, 0.1, 0.3]),
        weft_diameter=np.array([0.4, 0.1, 0.1, 0.6]),
        warp_spacing=np.array([0.9, 0.4, 0.5, 0.3]),
        weft_spacing=np.array([0.5, 0.6, 0.7]),
    ),
)
KEMP = measured(
    drawdown=tile_drawdown(patterns.twill(2, 1), 5, 4),
    warp_diameter=0.25,
    weft_diameter=0.30,
    warp_spacing=0.55,
    weft_spacing=0.80,
    warp_crimp_height=0.20,
    weft_section="racetrack",
    weft_aspect=1.5,
)


def test_examples() -> None:
    assert doctest.testmod(yarn_clearance).failed == 0


def nearest_at(cloth: Cloth, found: Clearance, tolerance: float) -> None:
    """Both yarns' axes pass the place at their radii."""
    assert found.distance == 0.0
    end, pick = found.yarns[0], found.yarns[1] - cloth.size[0]
    points, yarn = sample_axes(cloth, 64)
    for number, radius in (
        (found.yarns[0], 0.5 * cloth.yarns[0].diameter[end]),
        (found.yarns[1], 0.5 * cloth.yarns[1].diameter[pick]),
    ):
        distance = np.linalg.norm(points[yarn == number] - found.place, axis=1)
        assert distance.min() == pytest.approx(radius, abs=1e-3 * radius + tolerance)


def touches_and_never_overlaps(cloth: Cloth) -> None:
    size = np.max(cloth.warp.diameter) + np.max(cloth.weft.diameter)
    assert least_clearance(cloth).distance == pytest.approx(0, abs=1e-9 * size)
    nearest_at(cloth, find_contact(cloth), 1e-9 * size)
    made = build_weave(cloth)
    assert np.isfinite(made.points).all()
    assert len(made.points) == made.patches.max() + 1
    found = measure_clearance(made)
    assert abs(found.distance) <= (made.radial_error + 1e-12) * size


@settings(max_examples=4)
@given(woven())
def test_any_cloth_touches_and_never_overlaps(cloth: Cloth) -> None:
    touches_and_never_overlaps(cloth)


@pytest.mark.nightly
@settings(max_examples=150, deadline=None)
@given(woven())
def test_many_cloths_touch_and_never_overlap(cloth: Cloth) -> None:
    touches_and_never_overlaps(cloth)


@given(woven(most=4))
def test_surfaces_hold_their_distance(cloth: Cloth) -> None:
    """No point of a warp yarn's surface lies inside a weft yarn, by the definition of a section."""
    made = build_weave(cloth)
    points, *_ = surface(made, np.linspace(0, 1, 5), made.family == 0)
    points = points.reshape(-1, 3)
    axis, yarn = sample_axes(cloth, samples=16)
    weft = cloth.yarns[1]
    for pick in range(cloth.size[1]):
        line = axis[yarn == cloth.size[0] + pick]
        beside = np.maximum(abs(points[:, 1] - line[0, 1]) - weft.flat[pick] / 2, 0)
        square = np.min(
            (points[:, None, 0] - line[:, 0]) ** 2 + (points[:, None, 2] - line[:, 2]) ** 2, axis=1
        )
        least = np.sqrt(square + beside**2).min() / (weft.diameter[pick] / 2)
        ratio = np.max(cloth.warp.diameter) / weft.diameter[pick]
        assert least > 1 - 1e-9 - made.radial_error * ratio


def test_crossings_share_the_distance() -> None:
    over = UNEQUAL.drawdown
    points, yarn = sample_axes(UNEQUAL, samples=1)
    share = UNEQUAL.height / UNEQUAL.diameter_sum
    x, y = (yarns.position for yarns in UNEQUAL.yarns)
    np.testing.assert_allclose(np.diff(x), UNEQUAL.warp.spacing)
    np.testing.assert_allclose(np.diff(y), UNEQUAL.weft.spacing)
    for end, pick in np.ndindex(5, 4):
        at = np.linalg.norm(points[:, :2] - (x[end], y[pick]), axis=1) < 1e-12
        warp, weft = (points[at & (yarn == k), 2] for k in (end, 5 + pick))
        apart = (UNEQUAL.warp.diameter[end] + UNEQUAL.weft.diameter[pick]) / 2
        sign = 1 if over[pick, end] else -1
        assert warp == pytest.approx(sign * share * apart)
        assert warp - weft == pytest.approx(sign * apart)


def test_floats_over_unequal_yarns_bend() -> None:
    straight = build_weave(changed(UNEQUAL, drawdown=np.ones((4, 5), dtype=bool)))
    parts = straight.tubes[0].parts
    # between unequal picks arc, straight, arc; between the equal ones in the middle one straight
    assert (parts == 2 + 3 + 1 + 3).all()


def test_kemp_by_an_independent_solution() -> None:
    """p' = p - (a - b): theta from both of Peirce's equations at once, by bisection."""
    d, room, height = 0.55, 0.80 - 0.15, 0.20

    def remainder(theta: float) -> float:
        straight = (room - d * np.sin(theta)) / np.cos(theta)
        return d * (1 - np.cos(theta)) + straight * np.sin(theta) - height

    theta = brentq(remainder, 1e-6, 1.0, xtol=1e-15)
    length = 0.15 + d * theta + (room - d * np.sin(theta)) / np.cos(theta)
    warp, weft = KEMP.families
    assert warp.crimp.theta == pytest.approx(theta, rel=1e-12)
    assert warp.crimp.length == pytest.approx(length, rel=1e-12)
    assert warp.crimp.crimp == pytest.approx(length / 0.80 - 1, rel=1e-11)
    assert weft.width == pytest.approx(0.45)
    # the weft crosses round yarns: it is Peirce's own
    assert np.degrees(weft.crimp.theta) == pytest.approx(50.033787, abs=5e-7)
    points, yarn = sample_axes(changed(KEMP, drawdown=plain(4, 6)), samples=200)
    step = np.linalg.norm(np.diff(points[yarn == 1], axis=0), axis=1)
    assert step.sum() == pytest.approx(5 * length + 0.80, rel=1e-6)
    figures = fabric_figures(changed(KEMP, drawdown=plain(4, 6)))
    assert figures["warp"]["yarn_length"] == pytest.approx(4 * (5 * length + 0.80))
    assert figures["weft"]["cover"] == pytest.approx(0.45 / 0.80)
    area = pi / 4 * 0.30**2 + 0.15 * 0.30
    volume = pi / 4 * 0.25**2 * length / 0.8 / 0.55 + area * (1 + weft.crimp.crimp) / 0.80
    assert figures["volume_fraction"] * figures["thickness"] == pytest.approx(volume)


@pytest.mark.parametrize("section", ["racetrack", "elliptic"])
def test_sections_have_their_shape(section: str) -> None:
    made = build_weave(changed(KEMP, weft_section=section, exact=True, drawdown=[[1]]))
    points, *_ = surface(made, np.linspace(0, 1, 9), slice(0, made.tube_patches))
    y, z = np.moveaxis(points[made.family[: made.tube_patches] == 1], -1, 0)[1:]
    z = z + KEMP.families[1].height / 2
    if section == "elliptic":
        inside = (y / 0.225) ** 2 + (z / 0.15) ** 2
    else:
        inside = (np.maximum(abs(y) - 0.075, 0) ** 2 + z**2) / 0.15**2
    np.testing.assert_allclose(inside, 1, atol=1e-13)


def test_figures_are_those_of_the_axes() -> None:
    figures = fabric_figures(UNEQUAL)
    points, yarn = sample_axes(UNEQUAL, samples=300)
    lengths = [np.linalg.norm(np.diff(points[yarn == k], axis=0), axis=1).sum() for k in range(9)]
    assert figures["warp"]["yarn_length"] == pytest.approx(sum(lengths[:5]), rel=1e-5)
    assert figures["weft"]["yarn_length"] == pytest.approx(sum(lengths[5:]), rel=1e-5)
    made = build_weave(UNEQUAL)
    tallest = 2 * abs(made.points[:, 2]).max()
    assert figures["thickness"] >= tallest * (1 - 1e-12)
    unit = fabric_figures(changed(UNEQUAL, drawdown=plain(5, 4)))
    assert unit["warp"]["mean_crimp"] > figures["warp"]["mean_crimp"]


def sheared(made: Weave) -> np.ndarray:
    return made.points @ np.array([[1, 0.4, 0], [0, 1, 0], [0.2, 0, 0.5]])


@pytest.mark.parametrize(
    "cloth",
    [
        pytest.param(UNEQUAL, marks=pytest.mark.nightly),
        KEMP,
        pytest.param(changed(UNEQUAL, exact=True), marks=pytest.mark.nightly),
    ],
)
def test_clearance_after_deformation(cloth: Cloth) -> None:
    made = build_weave(changed(cloth, drawdown=plain(5, 4)))
    # what is deformed as a whole cannot overlap: sections are sheared and flattened with the rest
    assert measure_clearance(made, sheared(made)).distance == pytest.approx(0, abs=2e-3)
    # one yarn pushed down into those below it
    points = made.points.copy()
    mine = np.unique(made.patches[made.yarn == 7])
    points[mine, 2] -= 0.01
    found = measure_clearance(made, points)
    assert found.distance == pytest.approx(-0.01, abs=2e-3)
    assert found.yarns[1] == 7
    # and the place is where it crosses the yarn found
    x = cloth.yarns[0].position[found.yarns[0]]
    y = cloth.yarns[1].position[2]
    assert np.linalg.norm(found.place[:2] - (x, y)) < 0.3
    # the families apart: what is left are neighbours, which pass each other at the same height
    points = made.points.copy()
    points[np.unique(made.patches[made.family == 1]), 2] += 5.0
    warp = cloth.yarns[0]
    room = warp.spacing - (warp.diameter[1:] + warp.diameter[:-1]) / 2
    assert measure_clearance(made, points).distance == pytest.approx(room.min(), abs=1e-12)
    points[0] = np.nan
    with pytest.raises(GeometryError, match="finite"):
        measure_clearance(made, points)


def test_two_straight_yarns() -> None:
    """The distance of skew lines, in closed form."""
    made = build_weave(
        changed(KEMP, weft_section="circular", weft_aspect=1.0, overhang=2.0, drawdown=[[1]])
    )
    points = made.points.copy()
    mine = np.unique(made.patches[made.yarn == 1])
    points[mine, 2] -= 0.1 + 0.5 * points[mine, 0]
    found = measure_clearance(made, points)
    # the weft's section is sheared: (0, 1) up and (0, 0.15) across stay, along the line it is 0.15
    tilt = np.array([1, 0, -0.5]) / np.sqrt(1.25)
    normal = np.cross(tilt, [0, 1, 0])
    apart = abs(normal[2]) * (0.275 + 0.1)
    assert found.yarns == (0, 1)
    assert found.distance == pytest.approx(apart - 0.125 - 0.15 * abs(normal[2]), rel=1e-3)


@pytest.mark.parametrize(
    "kind",
    [
        "unequal",
        "kemp",
        *(pytest.param(each, marks=pytest.mark.nightly) for each in ("spline", "exact")),
    ],
)
def test_shape_does_not_depend_on_the_unit(kind: str) -> None:
    cloth = {
        "unequal": UNEQUAL,
        "kemp": KEMP,
        "spline": changed(UNEQUAL, axis="spline"),
        "exact": changed(UNEQUAL, exact=True),
    }[kind]
    reference, figures = build_weave(cloth), fabric_figures(cloth)
    size = abs(reference.points).max()
    gap = least_clearance(cloth)
    for unit in (1e6, 1 / 3):
        made = build_weave(scaled(cloth, unit))
        assert np.array_equal(made.patches, reference.patches)
        assert abs(made.points / unit - reference.points).max() < 1e-12 * size
        other = fabric_figures(scaled(cloth, unit))
        assert other["volume_fraction"] == pytest.approx(figures["volume_fraction"], rel=1e-12)
        again = least_clearance(scaled(cloth, unit)).distance / unit
        assert again == pytest.approx(gap.distance, abs=1e-12 * size)


def test_memory_is_estimated_from_above() -> None:
    import tracemalloc

    over = plain(40, 30)
    base = changed(
        KEMP, drawdown=over, warp_section="racetrack", warp_aspect=1.2, warp_spacing=0.65
    )
    for cloth in (base, changed(base, exact=True), changed(base, axis="spline")):
        tracemalloc.start()
        build_weave(cloth)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        estimate = estimate_bytes(cloth)
        assert 0.5 * estimate < peak < estimate


def test_refusals() -> None:
    with pytest.raises(InputError, match=r"diameter of the weft.*4 values for 3 yarns"):
        build_weave(changed(UNEQUAL, drawdown=np.ones((3, 5))))
    with pytest.raises(InputError, match=r"spacing of the warp.*allowed: one value, or 4"):
        changed(UNEQUAL, warp_spacing=np.ones(7)).check()
    with pytest.raises(GeometryError, match="yarns 2 and 3 overlap"):
        changed(UNEQUAL, warp_spacing=np.array([9, 0.1, 9, 9])).check()
    with pytest.raises(GeometryError, match="spacing of the warp"):
        changed(UNEQUAL, warp_spacing=np.array([1, 1, -1, 1])).check()
    with pytest.raises(GeometryError, match="aspect of the warp"):
        changed(KEMP, warp_aspect=1.5).check()
    with pytest.raises(GeometryError, match="aspect of the weft"):
        changed(KEMP, weft_aspect=0.5).check()
    with pytest.raises(GeometryError, match=r"overlap: they are 900 mm wide"):
        changed(KEMP, weft_aspect=3.0).check()
    with pytest.raises(InputError, match="racetrack"):
        changed(KEMP, weft_section="square").check()
    with pytest.raises(InputError, match="spline"):
        changed(KEMP, axis="polyline").check()
