"""Twist and plies: helices, their hand, and what is left of the section."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from spacemap_vtk import PatchTessellator, WeaveSource
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.patch_tessellator import STRANDS
from spacemap_vtk.textile.geometry.plies import ply_outline
from spacemap_vtk.textile.geometry.strand_curves import build_strand_curves, fibre_count
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.weave.yarn import parse_twist, usual_twist

#: A lone straight pick along x, 40 mm long and 0.25 mm thick, under an end that is far thinner.
STRAIGHT = {
    "ends": 1,
    "picks": 1,
    "overhang": "20 mm",
    "warp_crimp_height": 0.252e-3,
    "weft_diameter": 0.25e-3,
    "warp_diameter": 2e-6,
}
TWISTS = ("warp_twist", "weft_twist")


def surface(sides: int, **values: object) -> np.ndarray:
    """The surface points of the pick, and what shading knows of them."""
    weave, surface = WeaveSource(**STRAIGHT, **values), PatchTessellator(subdivisions=sides)
    surface.SetInputConnection(weave.GetOutputPort())
    surface.set_detail(sides, strands=True)
    out = surface.update().output
    points, data = points_of(out).astype(float), out.GetPointData()
    ways = np.array(data.GetArray(STRANDS)).reshape(-1, 3)
    normals = np.array(data.GetNormals()).reshape(-1, 3)
    axis = points[np.abs(points[:, 1]) < 0.2e-3]
    assert np.ptp(axis[:, 0]) == pytest.approx(0.04)
    pick = (np.abs(points[:, 0]) > 1e-3) & (ways[:, 2] > 0.0)
    found = np.column_stack([points, ways, normals])[pick]
    found[:, 2] -= 0.5 * (found[:, 2].max() + found[:, 2].min())
    return found


@pytest.mark.parametrize(("plies", "hand"), [(2, "Z"), (3, "S")])
def test_crowns_of_plies_wind_by_the_twist_and_its_hand(plies: int, hand: str) -> None:
    x, y, z, *_, nx, ny, nz = surface(16, weft_plies=plies, weft_twist=f"100 {hand}").T
    radius, angle = np.hypot(y, z), np.arctan2(z, y)
    assert radius.max() == pytest.approx(0.125e-3, rel=1e-3)
    # a right-handed screw about x turns from y to z while it goes on along x
    turns = 100.0 if hand == "Z" else -100.0
    phase = plies * (angle - 2 * np.pi * turns * x)
    crown = np.angle(np.exp(1j * phase)[radius > 0.99 * radius.max()].mean())
    off = np.angle(np.exp(1j * (phase - crown)))
    assert np.abs(off[radius > 0.995 * radius.max()]).max() < 0.8
    assert np.abs(off[radius < 1.02 * radius.min()]).min() > 2.0
    # the same normal as the closed form's: of a screw, moving along it keeps within the surface
    along = np.column_stack([np.ones_like(x), -2 * np.pi * turns * z, 2 * np.pi * turns * y])
    tilt = np.einsum("nk,nk->n", along, np.column_stack([nx, ny, nz]))
    assert np.abs(tilt).max() < 5e-3


def test_plies_fill_what_circles_pressed_together_do() -> None:
    for plies in (2, 3, 5):
        middle = 0.8 / (1 + np.sin(np.pi / plies))  # of their circles, which reach to 1
        half = np.pi / plies

        def rim(t: float, a: float = middle) -> float:
            return a * np.cos(t) + np.sqrt((1 - a) ** 2 - (a * np.sin(t)) ** 2)

        area = plies * quad(lambda t: rim(t) ** 2, 0.0, half)[0]
        phase = np.linspace(0.0, 1.0, 4001)[:-1]
        reach, slope = ply_outline(phase, np.array(float(plies)))
        # grooves are rounded, by a few per cent
        assert np.pi * (reach**2).mean() == pytest.approx(area, rel=0.03)
        by_steps = (np.roll(reach, -1) - np.roll(reach, 1)) / (2 * phase[1])
        np.testing.assert_allclose(slope, by_steps, atol=2e-3 * np.abs(slope).max())


def test_usual_fibres_lean_by_24_degrees_and_are_that_much_longer() -> None:
    x, y, z, fibre, *_ = surface(8).T
    (turns,), diameter = usual_twist(np.array([0.25e-3]), np.array([1.0])), 0.25e-3
    # what stays along a fibre stays along a right-handed screw of so many turns
    screw = np.arctan2(z, y) - 2 * np.pi * turns * x
    assert abs(np.exp(1j * (2 * np.pi * fibre + screw)).mean()) == pytest.approx(1.0, abs=1e-4)
    points = np.linspace(0.0, 2 * np.pi * turns * 0.1, 20_000)
    helix = np.stack([0.5 * diameter * np.cos(points), 0.5 * diameter * np.sin(points)])
    steps = np.hypot(*np.diff(helix)), np.diff(points) / (2 * np.pi * turns)
    length = np.hypot(*steps).sum() / 0.1
    assert length == pytest.approx(np.hypot(1.0, np.pi * diameter * turns), rel=1e-5)
    assert length == pytest.approx(1 / np.cos(np.radians(24.0)), rel=1e-5)


def test_number_of_fibres_follows_from_the_mass() -> None:
    diameters = {"warp_diameter": [1e-4, 3e-4], "weft_diameter": 2e-4}
    cloth = WeaveSource(ends=4, picks=4, warp_crimp_height=1e-5, **diameters).cloth
    # Of a mean square of 0.045 mm2, with 912 kg/m3 32.23 tex, of fibres of 1.7 dtex.
    assert fibre_count(cloth) == 189


def test_fibres_of_a_straight_yarn_are_helices() -> None:
    cloth = WeaveSource(**STRAIGHT, weft_twist="Z 500").cloth
    made = build_weave(cloth)
    curves = build_strand_curves(cloth, made.tubes, made.places, made.points, fibres=20)
    lines = np.split(curves.points, np.cumsum(curves.counts)[:-1])
    for line, yarn in zip(lines, curves.yarn, strict=True):
        if not yarn:
            continue
        knots = ((line[:-2] + 4 * line[1:-1] + line[2:]) / 6).astype(float)
        x, y, z = knots[knots[:, 0] < -1e-3].T
        z = z - made.points[made.points[:, 0] < -0.019, 2].mean()
        (turns, _), radius = np.polyfit(x, np.unwrap(np.arctan2(z, y)), 1), np.hypot(y, z)
        assert turns / (2 * np.pi) == pytest.approx(500.0, rel=1e-3)  # right-handed
        assert np.ptp(radius) < 0.13 * 0.125e-3  # it wanders from its layer
        steps = np.linalg.norm(np.diff(np.column_stack([x, y, z]), axis=0), axis=1)
        length = steps.sum() / np.ptp(x)
        # chords of a twelfth of a turn, and the closed form
        mean = 2 * np.pi * 500 * np.sqrt((radius**2).mean())
        assert length == pytest.approx(np.hypot(1.0, mean), rel=0.01)


@pytest.mark.parametrize("text", ["Z 600 S", "-600 Z", "600 X", "Z"])
def test_invalid_twists_are_refused(text: str) -> None:
    with pytest.raises(InputError):
        parse_twist(text)


def test_twist_and_plies_are_of_each_yarn_and_enter_no_figures() -> None:
    plain, plied = WeaveSource(ends=3), WeaveSource(ends=3)
    plied.configure(warp_plies=[2, 1], weft_twist="S 700", warp_twist=["Z 300", "S 300"])
    one, other = plain.update().output, plied.update().output
    np.testing.assert_array_equal(points_of(one), points_of(other))
    turns, plies, _ = plied.cloth.warp.strands(3)
    assert (turns.tolist(), plies.tolist()) == ([300, -300, 300], [2, 1, 2])
    assert plied.cloth.weft.strands(7)[0].tolist() == 7 * [-700]
    # and are shown as they are written
    shown = [plied.parameter(name).format(getattr(plied, name)) for name in TWISTS]
    assert shown == ["300 Z, 300 S", "700 S"]
    assert parse_twist("700 S") == plied.weft_twist
