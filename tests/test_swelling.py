"""Floats of lenticular yarns swell, stay inside their spacing, and overlap no other yarn."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from weaves import closed_cloth

from spacemap_vtk import WeaveSource
from spacemap_vtk.textile.drafts.pattern_weft import find_pattern_weft
from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.swelling import (
    RISE,
    measure_float_ends,
    swollen_changes,
)
from spacemap_vtk.textile.geometry.weave import Weave, build_weave
from spacemap_vtk.textile.patches.tessellation import Tessellation
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.lens import face_radius
from spacemap_vtk.textile.weave.threads import Threads

WEAVES = {
    "plain": np.indices((6, 6)).sum(axis=0) % 2 == 0,
    "twill": np.indices((6, 6)).sum(axis=0) % 4 < 2,
    "satin": (np.indices((6, 6)) * [[[2]], [[1]]]).sum(axis=0) % 5 == 0,
    "random": np.random.default_rng(4).random((6, 6)) < 0.5,
}


#: Bounds of unequal widths and spacings.
UNEQUAL = (0.5, 0.8), (0.9, 1.2)


def surface(weave: Weave, sides: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return points and normals on the tubes, and the yarn of each."""
    tubes = weave.patches[: weave.tube_patches]
    points, normals = Tessellation(tubes, (3, 3), sides).evaluate(
        weave.points, np.float64, weave.weights
    )
    yarn = np.empty(len(points), int)
    for which, part in Tessellation(tubes, (3, 3), sides).views(yarn[:, None].astype(float)):
        part[:] = weave.yarn[: weave.tube_patches][which][None, :, None]
        yarn.reshape(-1)[_positions(part, points, which, sides)] = part.ravel().astype(int)
    return points, normals, yarn


def _positions(part: Any, points: Any, which: slice, sides: int) -> Any:
    samples = (sides + 1) ** 2
    return slice(which.start * samples, which.stop * samples)


def gaps_at_crossings(cloth: Cloth, sides: int) -> list[float]:
    """Return the least gap between both yarns at each crossing of a cloth of spacing 1."""
    points, normals, yarn = surface(build_weave(cloth), sides)
    ends, picks = cloth.size
    across, along = cloth.yarns[0].position, cloth.yarns[1].position
    least = []
    for end in range(ends):
        for pick in range(picks):
            over = cloth.drawdown[pick, end]
            upper, lower = (end, ends + pick) if over else (ends + pick, end)
            near = np.abs(points[:, :2] - [across[end], along[pick]]).max(axis=1) < 0.75
            below = near & (yarn == upper) & (normals[:, 2] < 0.0)
            above = near & (yarn == lower) & (normals[:, 2] > 0.0)
            # The lower yarn's height is that of the tangent plane at its nearest point.
            away, nearest = cKDTree(points[above, :2]).query(points[below, :2])
            foot, up = points[above][nearest], normals[above][nearest]
            beside = points[below] - foot
            gap = (beside * up).sum(axis=1) / up[:, 2]
            least.append(float(gap[away < 0.012].min()))
    return least


@pytest.mark.parametrize(
    ("weave", "unequal"),
    # In the gate a satin of like yarns, and any weave of unequal ones.
    [
        pytest.param(
            weave,
            unequal,
            marks=[pytest.mark.nightly]
            * ((weave, unequal) not in {("satin", False), ("random", True)}),
        )
        for weave in WEAVES
        for unequal in (False, True)
    ],
)
def test_swollen_yarns_touch_and_do_not_overlap(weave: str, unequal: bool) -> None:
    cloth = closed_cloth(WEAVES[weave], *(UNEQUAL if unequal else ()))
    size, least = float(np.min(cloth.warp.diameter)), gaps_at_crossings(cloth, 16)
    # Tangent planes are too high by less than this.
    assert min(least) > -1.5e-3 * size
    assert max(least) < 1e-2 * size


def test_high_floats_over_flat_yarns_swell_late_enough() -> None:
    # The shallow arcs over flat ends leave high picks little room to rise.
    flat, high = (
        Threads(diameter=height, spacing=1.0, section="lenticular", aspect=width / height)
        for height, width in ((0.1, 0.95), (0.5, 0.9))
    )
    cloth = Cloth(drawdown=WEAVES["random"], warp=flat, weft=high)
    cloth.check()
    assert min(gaps_at_crossings(cloth, 12)) > -1e-3 * 0.5


@given(
    near=st.floats(0.5, 4.0),
    far=st.floats(0.5, 4.0),
    straight=st.floats(0.0, 1.0),
    theta=st.floats(0.02, 1.2),
    height=st.floats(0.02, 0.9),
)
def test_rising_floats_stay_outside_of_the_yarn_before_them(
    near: float, far: float, straight: float, theta: float, height: float
) -> None:
    arc = measure_float_ends(*(np.array([[x]]) for x in (near, far, straight, theta, height)), 2.0)
    # Positions on the arc by fractions of its length along the cloth; the axis starts at 0.
    t = np.linspace(0.0, 1.0, 50)
    phi = np.arcsin(t * np.sin(theta))
    outer = near + 0.5 * height + 0.46 * height * arc.rise[0, 0] * t**2
    x, z = outer * np.sin(phi), outer * np.cos(phi) - near
    assert np.hypot(x + straight, z - far).min() >= (far - 0.5 * height) * (1.0 - 1e-12)
    assert arc.length[0, 0] == pytest.approx(near * np.sin(theta))


def test_floats_are_nearly_full_at_their_first_crossing() -> None:
    cloth = closed_cloth(WEAVES["twill"])
    points, _, yarn = surface(build_weave(cloth), 6)
    # End 2 floats on picks 2 and 3, and is 0.9 wide in between and 0.985 where it is full.
    assert cloth.drawdown[1:5, 2].tolist() == [False, True, True, False]
    first = np.abs(points[:, 1] - cloth.yarns[1].position[2]) < 0.02
    assert np.ptp(points[first & (yarn == 2), 0]) > 0.9 + 0.75 * 0.085


def test_a_pattern_weft_covers_its_tabby_without_overlap() -> None:
    draft = Path(__file__).parents[1] / "scenes" / "drafts" / "overshot.wif"
    cloth = WeaveSource(draft=draft, ends=14, picks=14).cloth
    pattern = find_pattern_weft(cloth.drawdown)
    assert pattern is not None
    points, normals, yarn = surface(build_weave(cloth), 10)
    picks = cloth.size[0] + np.arange(cloth.size[1])
    lower, upper = (
        np.array([extreme(points[yarn == pick, 1]) for pick in picks]) for extreme in (min, max)
    )
    size = float(np.max(cloth.weft.diameter))
    covered = [upper[n] - lower[n + 1] for n in range(13) if pattern.pattern[n : n + 2].any()]
    assert max(covered) > 0.2 * size
    deepest, compared = [], 0
    for one, other in itertools.pairwise(picks):
        mine, facing = points[yarn == one], yarn == other
        sheets = []
        for side in (1.0, -1.0):
            sheet = facing & (side * normals[:, 2] > 0.0)
            away, nearest = cKDTree(points[sheet, :2]).query(mine[:, :2])
            foot, up = points[sheet][nearest], normals[sheet][nearest]
            height = ((foot - mine) * up).sum(axis=1) / np.abs(up[:, 2])
            sheets.append(np.where(away < 0.1 * size, height, -np.inf))
        # How far a point is below the upper and above the lower side of the other yarn.
        depth = np.minimum(*sheets)
        compared += np.count_nonzero(np.isfinite(depth))
        deepest.append(depth.max())
    assert compared > 200
    assert max(deepest) < 4e-3 * size


def test_short_floats_of_a_pattern_weft_spread_by_half() -> None:
    draft = Path(__file__).parents[1] / "scenes" / "drafts" / "summer_and_winter.wif"
    cloth = WeaveSource(draft=draft, ends=16, picks=16).cloth
    points, _, yarn = surface(build_weave(cloth), 8)
    width: dict[int, list[float]] = {1: [], 2: [], 3: []}  # by crossings of the float
    for pick in range(0, 16, 2):
        over = np.flatnonzero(np.diff(~cloth.drawdown[pick], prepend=True, append=True))
        for first, last in itertools.pairwise(over):
            length = last - first
            if cloth.drawdown[pick, first] or length not in width or first == 0 or last == 16:
                continue
            middle = cloth.yarns[0].position[first:last].mean()
            mine = (yarn == 16 + pick) & (np.abs(points[:, 0] - middle) < 0.02e-3)
            width[length].append(float(np.ptp(points[mine, 1])))
    lens, short, long_ = (np.mean(width[length]) for length in (1, 2, 3))
    assert (short - lens) / (long_ - lens) == pytest.approx(0.5, abs=0.03)
    assert long_ > 1.5 * lens


def test_neighbouring_floats_close_up_and_stay_apart() -> None:
    cloth = closed_cloth(WEAVES["twill"])
    points, _, yarn = surface(build_weave(cloth), 6)
    width = max(np.ptp(points[yarn == end, 0]) for end in range(cloth.size[0]))
    assert width == pytest.approx(0.985, abs=1e-3)
    # A plain weave has no floats.
    points, _, yarn = surface(build_weave(closed_cloth(WEAVES["plain"])), 6)
    assert max(np.ptp(points[yarn == end, 0]) for end in range(4)) == pytest.approx(0.9, abs=1e-6)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("aspect", [1.0, 1.4, 3.2, 8.0])
def test_the_face_of_a_swollen_section_lies_in_the_circle_of_contact(
    aspect: float, exact: bool
) -> None:
    lens = build_section("lenticular", aspect, exact)
    widest = 1.4
    lateral, normal = swollen_changes(aspect, exact, widest)
    radius = 2.0 * face_radius(aspect)
    t = np.linspace(0.0, 1.0, 50)[:, None]
    basis = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    for share, wide in ((0.3, 0.0), (1.0, 0.0), (1.0, 1.0), (0.6, 0.4)):
        x = lens.lateral + share * (lateral[0] + wide * lateral[1])
        z = lens.normal + share * (normal[0] + wide * normal[1])
        assert z[0] >= 1.0 + share * 2.0 * RISE - 1e-12
        assert z[0] > z[3] + 0.2 * share
        weights = basis * lens.weight[3:7]
        weights /= weights.sum(axis=1, keepdims=True)
        distance = np.hypot(weights @ x[3:7], weights @ z[3:7] - (radius - 1.0))
        assert distance.max() < radius * (1.0 + 1e-4 if exact else 1.0 + 3e-4)
        assert x[3] <= widest * aspect * (1.0 + 1e-12)
        # The same, upside down.
        turned = lens.normal + share * (normal[2] + wide * normal[3])
        assert turned == pytest.approx(-z[(6 - np.arange(12)) % 12])
