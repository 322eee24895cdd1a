"""Spline axes, compared with arc - straight - arc."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from test_caps import OVER, ROUND, lengths, volumes
from weaves import PLACES, changed, plain

from spacemap_vtk.textile.geometry.cloth_axes import cloth_axes, sample_axes
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.geometry.yarn_clearance import least_clearance, measure_clearance
from spacemap_vtk.textile.weave.figures import fabric_figures

SPLINE = changed(ROUND, axis="spline")


def test_spline_equals_another_spline_of_scipy() -> None:
    """The same curve by B-splines, and through every crossing."""
    path = cloth_axes(SPLINE)[0]
    height = np.where(OVER[:, 1], 0.1, -0.1)
    knots = np.concatenate([[-1.5], np.arange(-1.2, 1.3, 0.6), [1.5]])
    flat = [(1, 0.0)]
    curve = make_interp_spline(knots, np.pad(height, 1, mode="edge"), k=3, bc_type=(flat, flat))
    points, yarn = sample_axes(SPLINE, samples=5)
    mine = points[yarn == 1]
    np.testing.assert_allclose(mine[:, 2], curve(mine[:, 1]), atol=1e-13)
    assert (np.diff(mine[:, 1]) > 0).all()
    assert path.parts.tolist() == [24] * 4


@pytest.mark.parametrize("axis", ["arcs", "spline"])
def test_tangents_are_continuous_and_curvatures_of_splines(axis: str) -> None:
    cloth = changed(ROUND, axis=axis)
    made = build_weave(cloth)
    patches = made.patches[: made.tube_patches]
    net = made.points[patches][:, PLACES]
    follows = made.yarn[: made.tube_patches - 4] == made.yarn[4 : made.tube_patches]
    arrive = (net[:-4, 3] - net[:-4, 2])[follows]
    leave = (net[4:, 1] - net[4:, 0])[follows]
    for end in (arrive, leave):
        end /= np.linalg.norm(end, axis=-1, keepdims=True)
    assert abs(arrive - leave).max() < 1e-11
    for path in cloth_axes(cloth):
        inside = np.diff(path.owner) == 0
        jump = abs(path.curvature[1, :-1] - path.curvature[0, 1:])[inside].max()
        if axis == "spline":
            assert jump < 1e-12
        else:  # from 0 to that of the contact, 2/D
            assert jump == pytest.approx(2 / 0.55)


def test_arcs_keep_their_distance_and_splines_do_not() -> None:
    over = plain(7, 7)
    d = ROUND.diameter_sum
    assert abs(least_clearance(changed(ROUND, drawdown=over)).distance) < 1e-15
    found = least_clearance(changed(SPLINE, drawdown=over))
    # TexGen's plain weave overlaps likewise, by some 5 % of a diameter near the jam
    assert -0.10 * d < found.distance < -0.01 * d
    assert measure_clearance(build_weave(changed(SPLINE, drawdown=over))).distance == pytest.approx(
        found.distance, abs=2e-3 * d
    )
    arcs, spline = (fabric_figures(changed(cloth, drawdown=over)) for cloth in (ROUND, SPLINE))
    for family in ("warp", "weft"):
        assert arcs[family]["crimp"] == spline[family]["crimp"]
        # the same heights over the same spacings: the crimp is nearly the same
        ratio = spline[family]["mean_crimp"] / arcs[family]["mean_crimp"]
        assert ratio == pytest.approx(1.0, abs=0.15)
    points, yarn = sample_axes(changed(SPLINE, drawdown=over), samples=60)
    step = np.linalg.norm(np.diff(points[yarn == 3], axis=0), axis=1)
    assert spline["warp"]["yarn_length"] == pytest.approx(7 * step.sum(), rel=1e-5)


def test_loose_splines_come_near_arcs() -> None:
    """With spacings much wider than the yarns both are nearly straight."""
    wide = changed(SPLINE, warp_spacing=5.5, weft_spacing=6.0)
    found = least_clearance(changed(wide, drawdown=plain(4, 4))).distance / wide.diameter_sum
    assert -1e-2 < found < 1e-12


def test_tubes_along_splines_are_round() -> None:
    made = build_weave(SPLINE)
    assert 2.7e-4 < made.radial_error < 5e-3
    found = volumes(made)
    area = np.pi / 4 * np.repeat([0.25**2, 0.30**2], [4, 5])
    np.testing.assert_allclose(found, lengths(SPLINE) * area, rtol=2e-3)
