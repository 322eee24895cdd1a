"""Peirce's geometry against published figures, mpmath and its own limits."""

from __future__ import annotations

import doctest
import re
from math import degrees, pi, sqrt

import mpmath
import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from weaves import measured

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.weave import peirce
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import solve
from spacemap_vtk.units import parse_quantity

lengths = st.floats(0.05, 2.0)


def cloth(d1: float, d2: float, p1: float, p2: float, **more: float) -> Cloth:
    """Plain weave of these diameters and spacings."""
    return measured(warp_diameter=d1, weft_diameter=d2, warp_spacing=p1, weft_spacing=p2, **more)


def check(d1: float, d2: float, p1: float, p2: float, height: float) -> None:
    cloth(d1, d2, p1, p2, warp_crimp_height=height).check()


def test_examples() -> None:
    assert doctest.testmod(peirce).failed == 0


def test_jammed_square_cloth() -> None:
    theta, straight, length, crimp = solve(sqrt(3) / 2, 0.5, 1.0)
    assert degrees(theta) == pytest.approx(60, abs=1e-9)
    assert straight == 0
    assert length == pytest.approx(pi / 3, rel=1e-12)
    assert crimp == pytest.approx(2 * pi / sqrt(27) - 1, rel=1e-11)
    assert length == pytest.approx(1.0472, abs=5e-5)
    assert crimp == pytest.approx(0.2092, abs=5e-5)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-6, 1 / 3, 1e-9])
def test_exact_jam_is_clamped_in_any_unit(scale: float) -> None:
    d1, d2 = 0.1 * scale, 0.2 * scale
    p = 0.3 * sqrt(3) / 2 * scale
    check(d1, d2, p, p, 0.15 * scale)
    assert solve(p, 0.15 * scale, d1 + d2).straight == 0
    # D a rounding above p, where the interval itself has lost half its digits
    assert d1 + d2 > 0.3 * scale or scale != 1.0
    check(d1, d2, 0.3 * scale, 0.3 * scale, d1 + d2)


def test_symmetric_cloth() -> None:
    theta, straight, _, crimp = solve(0.2, 0.1, 0.2)
    assert np.tan(theta / 2) == pytest.approx(1 / 3, rel=1e-14)
    assert degrees(theta) == pytest.approx(36.869898, abs=5e-7)
    assert straight == pytest.approx(0.1, rel=1e-12)
    assert crimp == pytest.approx(0.143501, abs=5e-7)


def test_unequal_cloth() -> None:
    warp, weft = cloth(0.25, 0.30, 0.55, 0.60, warp_crimp_height=0.20).families
    assert degrees(warp.crimp.theta) == pytest.approx(22.097356, abs=5e-7)
    assert warp.crimp.length == pytest.approx(0.63638346, abs=5e-9)
    assert warp.crimp.crimp == pytest.approx(0.060639, abs=5e-7)
    assert weft.height == pytest.approx(0.35)
    assert degrees(weft.crimp.theta) == pytest.approx(50.033787, abs=5e-7)
    assert weft.crimp.length == pytest.approx(0.68028988, abs=5e-9)
    assert weft.crimp.crimp == pytest.approx(0.236891, abs=5e-7)


def test_published_exam_question() -> None:
    height = cloth(0.2, 0.3, 0.6, 0.4, warp_crimp=0.09).height
    assert height == pytest.approx(0.15556, abs=5e-6)
    assert degrees(solve(0.4, height, 0.5).theta) == pytest.approx(30.570, abs=5e-4)


@given(p=lengths, share=st.floats(0, 1), d=lengths)
def test_peirce_equations_hold(p: float, share: float, d: float) -> None:
    height = share * peirce.feasible_height(10.0, p, d)[1]
    theta, s, length, crimp = solve(p, height, d)
    assert d * np.sin(theta) + s * np.cos(theta) == pytest.approx(p, rel=1e-11)
    assert d * (1 - np.cos(theta)) + s * np.sin(theta) == pytest.approx(height, abs=1e-11 * d)
    assert length == pytest.approx(p * (1 + crimp), rel=1e-11)
    assert 0 <= degrees(theta) <= 90 + 1e-9


@pytest.mark.parametrize("height", [0.3, 1e-1, 3e-2, 1e-3, 1e-6, 1e-9, 1e-12])
def test_crimp_keeps_its_digits(height: float) -> None:
    with mpmath.workdps(50):
        p, h, d = mpmath.mpf(0.5), mpmath.mpf(height), mpmath.mpf(0.375)
        s = mpmath.sqrt(p * p - h * (2 * d - h))
        expected = float((2 * d * mpmath.atan2(h, p + s) + s) / p - 1)
    assert solve(0.5, height, 0.375).crimp == pytest.approx(expected, rel=1e-13)


def test_arrays_broadcast() -> None:
    result = solve(np.array([[0.2], [0.3]]), np.array([0.0, 0.05, 0.1]), 0.2)
    assert all(field.shape == (2, 3) for field in result)
    assert result.length[0, 2] == solve(0.2, 0.1, 0.2).length
    assert result.crimp[1, 0] == 0
    assert result.theta[1, 0] == 0
    assert result.straight[1, 0] == pytest.approx(0.3)
    assert solve(0.0, 0.0, 0.2) == (0, 0, 0, 0)


@pytest.mark.parametrize(
    "values", [(0.1, 0.1, 0.2), (0.2, -0.1, 0.2), (np.nan, 0.1, 0.2), (np.inf, 0.1, 0.2)]
)
def test_solve_refuses(values: tuple[float, float, float]) -> None:
    with pytest.raises(GeometryError, match="height") as caught:
        solve(*(np.array([good, bad]) for good, bad in zip((1, 0, 1), values, strict=True)))
    assert caught.value.key == "height"
    if np.isfinite(values).all():
        assert "a height of 0 m to " in str(caught.value)


@given(p1=lengths, p2=lengths, d=lengths, share=st.floats(0.001, 0.999))
def test_feasible_interval(p1: float, p2: float, d: float, share: float) -> None:
    low, high = peirce.feasible_height(p1, p2, d)
    assert low == pytest.approx(sqrt(max(0, d * d - p1 * p1)), abs=2e-6 * d)
    assert high == pytest.approx(d - sqrt(max(0, d * d - p2 * p2)), abs=2e-6 * d)
    assume(high > low)
    for h in (low, low + share * (high - low), high):
        solve(p2, h, d)
        solve(p1, d - h, d)
    for h in (low - 1e-4 * d, high + 1e-4 * d):
        if 0 <= h <= d:
            with pytest.raises(GeometryError):
                solve([p2, p1], [h, d - h], d)
    assert peirce.balanced_height(p1, p2, d) == pytest.approx((low + high) / 2)


@given(p1=lengths, p2=lengths)
def test_largest_diameter_sum_jams_both(p1: float, p2: float) -> None:
    d = peirce.largest_diameter_sum(p1, p2)
    assert sqrt(d * d - p1 * p1) + sqrt(d * d - p2 * p2) == pytest.approx(d, rel=1e-8)
    low, high = peirce.feasible_height(p1, p2, 0.999 * d)
    assert low < high
    low, high = peirce.feasible_height(p1, p2, 1.001 * d)
    assert low > high


def test_largest_diameter_sum_of_square_cloth() -> None:
    assert peirce.largest_diameter_sum(sqrt(3) / 2, sqrt(3) / 2) == pytest.approx(1, rel=1e-14)
    assert peirce.largest_diameter_sum(1e-200, 1e-200) > 0


@given(p=lengths, d=lengths, share=st.floats(1e-3, 1))
@example(p=0.4453125, d=1.0, share=1 - 2**-53)
def test_the_height_for_a_crimp_inverts_solve(p: float, d: float, share: float) -> None:
    height = share * peirce.feasible_height(10.0, p, d)[1]
    crimp = float(solve(p, height, d).crimp)
    thin = 0.5 * min(p, d)
    found = cloth(d - thin, thin, 10.0, p, warp_crimp=crimp).height
    # the crimp is flat in the height at 0, and so is its rounding
    assert found == pytest.approx(height, rel=1e-7, abs=1e-8 * d)
    assert float(solve(p, min(found, height / share), d).crimp) == pytest.approx(crimp, rel=1e-8)


def test_crimps_have_limits() -> None:
    yarns = 0.2, 0.3, 0.6, 0.4
    assert cloth(*yarns, warp_crimp=0.0).height == 0
    jam = float(solve(0.4, 0.2, 0.5).crimp)
    assert cloth(*yarns, warp_crimp=jam).height == pytest.approx(0.2)
    for crimp in (-0.01, 1.01 * jam, np.nan):
        with pytest.raises(GeometryError, match=f"0 to {jam:.6g}"):
            cloth(*yarns, warp_crimp=crimp).check()


def test_check_names_the_feasible_interval() -> None:
    with pytest.raises(GeometryError) as caught:
        check(0.15e-3, 0.15e-3, 0.27e-3, 0.27e-3, 0.1e-3)
    error = caught.value
    assert error.key == "crimp height of the warp"
    assert error.value == 0.1e-3
    low, high = (parse_quantity(part, "m") for part in str(error.allowed).split(" to "))
    expected = peirce.feasible_height(0.27e-3, 0.27e-3, 0.3e-3)
    assert (low, high) == pytest.approx(expected, rel=1e-4)
    assert str(error.allowed).startswith("0.1307")
    assert "0.15 mm" in str(error.cure)
    for bound in (low, high):
        check(0.15e-3, 0.15e-3, 0.27e-3, 0.27e-3, bound)


@pytest.mark.parametrize("height", [-0.1e-3, 0.4e-3, float("nan"), float("inf")])
def test_check_refuses_heights_outside(height: float) -> None:
    with pytest.raises(GeometryError, match=re.escape("allowed: 0 mm to 0.3 mm")):
        check(0.15e-3, 0.15e-3, 0.5e-3, 0.5e-3, height)


def test_check_refuses_cloth_jammed_at_every_height() -> None:
    with pytest.raises(GeometryError, match="jammed at every crimp height of the warp") as caught:
        check(0.2e-3, 0.2e-3, 0.3e-3, 0.3e-3, 0.2e-3)
    low, high = peirce.feasible_height(0.3e-3, 0.3e-3, 0.4e-3)
    message = str(caught.value)
    assert f"{1e3 * low:.6g} mm" in message
    assert f"{1e3 * high:.6g} mm" in message
    assert "up to 0.34641 mm" in message
    d = peirce.largest_diameter_sum(0.3e-3, 0.3e-3)
    check(d / 2, d / 2, 0.3e-3, 0.3e-3, d / 2)


@pytest.mark.parametrize(
    ("measures", "key"),
    [
        ((0.5, 0.1, 0.4, 2.0, 0.3), "diameter of the warp"),
        ((0.1, 0.5, 2.0, 0.4, 0.3), "diameter of the weft"),
        ((0.0, 0.1, 0.2, 0.2, 0.1), "diameter of the warp"),
        ((0.1, -0.1, 0.2, 0.2, 0.1), "diameter of the weft"),
        ((0.1, 0.1, np.nan, 0.2, 0.1), "spacing of the warp"),
        ((0.1, 0.1, 0.2, np.inf, 0.1), "spacing of the weft"),
    ],
)
def test_check_names_the_quantity(measures: tuple[float, ...], key: str) -> None:
    with pytest.raises(GeometryError) as caught:
        check(*measures)
    assert caught.value.key == key
    assert caught.value.cure


def test_yarns_may_touch_their_neighbours() -> None:
    check(0.3, 0.1, 0.3, 0.5, 0.3)


def test_overhang_is_checked() -> None:
    measures = dict.fromkeys(("warp_diameter", "weft_diameter"), 0.1)
    measures |= dict.fromkeys(("warp_spacing", "weft_spacing"), 0.2)
    for overhang in (-1.0, float("nan"), float("inf")):
        with pytest.raises(GeometryError, match="overhang"):
            measured(**measures, overhang=overhang).check()
