"""Crimp interchange against closed forms, Peirce's formulas and other ways to the least energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.crimp.biaxial import compute_stretch_map
from spacemap_vtk.textile.crimp.interchange import CrimpState, Interchange, YarnMechanics
from spacemap_vtk.textile.drafts.drawdown import from_matrix, tile_drawdown
from spacemap_vtk.textile.weave import peirce
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

D = 0.5e-3
WEAVES = {
    "plain": ["10", "01"],
    "basket": ["1100", "1100", "0011", "0011"],
    "twill": ["1100", "0110", "0011", "1001"],
    "satin": ["10000", "00100", "00001", "01000", "00010"],
}


def cloth(
    warp: float = 0.5,
    weft: float = 0.5,
    weave: str = "plain",
    aspects: tuple[float, float] = (1.0, 1.0),
    **more: float,
) -> Cloth:
    """A cloth of round yarns, or of lenses whose heights add up to D too."""
    threads = [
        Threads(diameter=0.5 * D, spacing=p * 1e-3, section="lenticular", aspect=aspect)
        for p, aspect in zip((warp, weft), aspects, strict=True)
    ]
    return Cloth(drawdown=from_matrix(WEAVES[weave]), warp=threads[0], weft=threads[1], **more)


def stretched(crossings: Interchange, warp: float, weft: float) -> CrimpState:
    return crossings.solve(np.ones((2, *crossings.shape)) * np.reshape([warp, weft], (2, 1, 1)))


def free_width(crossings: Interchange, warp: float) -> float:
    """Return the largest stretch along the weft at which no crossing is pressed."""

    def pressed(weft: float) -> float:
        return float(stretched(crossings, warp, weft).distance[0, 0] < D * (1.0 - 1e-13)) - 0.5

    return float(brentq(pressed, 0.6, 1.2, xtol=1e-14))


def along(crossings: Interchange, first: NDArray, last: NDArray, points: int) -> CrimpState:
    """Return a line of stretches, laid over a cloth of as many crossings."""
    field = first[:, None, None] + (last - first)[:, None, None] * np.linspace(0.0, 1.0, points)
    return crossings.solve(np.broadcast_to(field, (2, 2, points)))


@pytest.mark.parametrize(
    ("height", "warp", "weft"),
    [(0.4786, 0.01521, -0.01702), (0.4572, 0.02896, -0.03640), (0.4358, 0.04146, -0.05928)],
)
def test_inextensible_yarns_exchange_crimp(height: float, warp: float, weft: float) -> None:
    crossings = Interchange(cloth())
    assert free_width(crossings, 1.0 + warp) - 1.0 == pytest.approx(weft, abs=2e-5)
    state = stretched(crossings, 1.0 + warp, free_width(crossings, 1.0 + warp))
    assert 2.0 * state.height[0, 0, 0] / D == pytest.approx(height, abs=5e-5)
    assert state.strain.max() == 0.0
    assert not state.slack.any()
    assert not state.jammed.any()
    # Peirce's own length, from the new spacings and heights
    lengths = peirce.solve(state.stretch * 0.5e-3, 2.0 * state.height, state.distance).length
    assert np.abs(lengths / 0.571751e-3 - 1.0).max() < 1e-6
    assert np.ptp(lengths) < 1e-9 * lengths.max()


def test_a_jammed_weft_stops_the_stretch() -> None:
    crossings = Interchange(cloth())
    state = stretched(crossings, 1.052870, 0.8)
    assert np.degrees(state.theta[1, 0, 0]) == pytest.approx(65.5178, abs=1e-4)
    assert 2.0 * state.height[1, 0, 0] / D == pytest.approx(0.585589, abs=1e-6)
    assert state.stretch[1, 0, 0] - 1.0 == pytest.approx(-0.089910, abs=1e-6)
    assert state.jammed[1].all()
    assert not state.jammed[0].any()
    shown = compute_stretch_map(crossings)
    border = np.concatenate([[shown.jam[0], shown.weft], [shown.warp, shown.jam[1]]], axis=1)
    # the map goes on past the other family's jam
    held = crossings.resultants(border).stretch
    border = border[:, (np.abs(held - border) < 1e-9).all(axis=0)]
    assert border.shape[1] > 40
    nearest = np.abs(border - [[1.052870], [1.0 - 0.089910]]).max(axis=0).min()
    assert nearest < 5e-3
    inside = [stretched(crossings, *point) for point in border.T + 1e-6]
    assert not any(state.jammed.any() for state in inside)
    outside = [stretched(crossings, *point) for point in border.T - 1e-6]
    assert all(state.jammed.any() for state in outside)


def test_poissons_ratio_and_where_the_warp_is_straight() -> None:
    crossings = Interchange(cloth(0.75, 0.5))
    step = 1e-5
    across = free_width(crossings, 1.0 - step) - free_width(crossings, 1.0 + step)
    assert across / (2.0 * step) == pytest.approx(0.33760, abs=5e-5)
    assert stretched(crossings, 1.14345, 0.7).height[0].max() > 1e-6
    assert stretched(crossings, 1.14355, 0.7).height[0].max() < 1e-9
    wide = Interchange(cloth(1.0, 1.0))
    assert stretched(wide, 1.0, 1.0).crimp == pytest.approx(0.032121, abs=5e-7)
    assert free_width(wide, 1.0322) - 1.0 == pytest.approx(-0.11294, abs=1e-5)


def test_elastic_yarns() -> None:
    hard = stretched(Interchange(cloth(), YarnMechanics((1.0, 1.0), np.inf)), 1.05, 0.95)
    assert 2.0 * hard.height[0, 0, 0] / D == pytest.approx(0.4369, abs=1e-4)
    assert hard.strain[:, 0, 0] * 100.0 == pytest.approx([0.70, 0.45], abs=5e-3)
    soft = stretched(Interchange(cloth(), YarnMechanics((1.0, 1.0), 0.1)), 1.05, 0.95)
    assert soft.distance[0, 0] / D == pytest.approx(0.987, abs=5e-4)
    assert soft.strain[:, 0, 0] * 100.0 == pytest.approx([0.25, 0.16], abs=7e-3)
    # at rest in between, the contact carries what the yarns' slopes press on it
    theta, tension = soft.theta[:, 0, 0], soft.strain[:, 0, 0]
    assert tension[0] * np.sin(theta[0]) == pytest.approx(tension[1] * np.sin(theta[1]), rel=1e-6)
    assert soft.contact[0, 0] == pytest.approx(0.2 * (1.0 - soft.distance[0, 0] / D), rel=1e-6)


def test_pulled_both_ways_crossings_flatten_and_then_yarns_strain() -> None:
    crossings = Interchange(cloth())
    state = stretched(crossings, 1.04, 1.04)
    assert state.strain.max() == 0.0
    assert 0.67 < state.distance[0, 0] / D < 1.0
    state = stretched(crossings, 1.12, 1.12)
    assert state.distance[0, 0] / D == pytest.approx(0.6 / 0.9069, abs=1e-4)
    assert 0.0 < state.strain.max() < 0.03
    hard = stretched(Interchange(cloth(), YarnMechanics(contact=np.inf)), 1.04, 1.02)
    stiff = stretched(Interchange(cloth(), YarnMechanics((1e5, 1e5), np.inf)), 1.04, 1.02)
    assert np.all(hard.distance == D)
    assert hard.height == pytest.approx(stiff.height, rel=1e-9)
    assert hard.strain == pytest.approx(stiff.strain, rel=1e-7)


def test_pushed_both_ways_yarns_are_slack() -> None:
    for yarns in (YarnMechanics(), YarnMechanics((10.0, 10.0), 1.0)):
        state = stretched(Interchange(cloth(), yarns), 0.96, 0.98)
        assert state.slack.all()
        assert state.strain.max() == 0.0
        assert np.all(state.distance == D)
        assert state.contact.max() == pytest.approx(0.0, abs=1e-12)
    # bending decides: the warp's room is less, it bends more, but no more than it must
    assert 2.0 * state.height[0, 0, 0] < D * 0.5


@pytest.mark.parametrize(
    "yarns",
    [
        YarnMechanics((3.0, 2.0), 0.7),
        YarnMechanics((3.0, 2.0), 0.7, (2e-9, 1e-9)),
        YarnMechanics((3.0, 2.0), np.inf, (2e-9, 1e-9)),
    ],
)
@pytest.mark.parametrize("aspects", [(1.0, 1.0), (1.3, 1.6)])
@pytest.mark.parametrize("weave", ["plain", "twill"])
def test_forces_are_derivatives(
    yarns: YarnMechanics, weave: str, aspects: tuple[float, float]
) -> None:
    crossings = Interchange(cloth(0.7, 0.6, weave, aspects), yarns)
    step, at = 1e-5, np.ones((2, *crossings.shape)) * np.reshape([1.05, 1.02], (2, 1, 1))
    found = crossings.forces(at)
    for family in (0, 1):
        near = []
        for sign in (1.0, -1.0):
            moved = at.copy()
            moved[family] += sign * step
            near.append(crossings.forces(moved))
        slope = (near[0].energy - near[1].energy) / (2.0 * step)
        assert slope == pytest.approx(found.force[family], rel=1e-6)
        curve = (near[0].force - near[1].force) / (2.0 * step)
        assert curve == pytest.approx(found.tangent[:, family], rel=1e-6)
    assert found.tangent[0, 1] == pytest.approx(found.tangent[1, 0], rel=1e-9)


def test_forces_where_a_yarn_jams_that_is_pulled() -> None:
    """Its straight part is gone before the cloth holds: what it pushes is in the force."""
    crossings = Interchange(cloth(0.6, 0.5), YarnMechanics((50.0, 50.0), np.inf))
    at, step = np.ones((2, *crossings.shape)) * np.reshape([1.227, 0.8106], (2, 1, 1)), 2e-6
    state, found = crossings.solve(at), crossings.forces(at)
    assert not state.jammed.any()
    room, height = 0.6e-3 * at[1], 2.0 * state.height[1]
    assert np.abs(room**2 - height * (2.0 * D - height)).max() < 1e-8 * D**2
    for family in (0, 1):
        shift = step * np.eye(2)[family][:, None, None]
        slope = crossings.forces(at + shift).energy - crossings.forces(at - shift).energy
        assert slope / (2.0 * step) == pytest.approx(found.force[family], abs=2e-9)


def energy(
    yarns: YarnMechanics,
    stretch: NDArray,
    height: float,
    distance: float = D,
    room: Any = 0.5e-3,
    arcs: Any = 1.0,
) -> float:
    """Return the energy of a crossing by Peirce's formulas, inf if jammed."""
    arcs = np.multiply(arcs, 1.0)
    try:
        now = peirce.solve(stretch * room, [height, distance - height], arcs * distance)
    except Exception:
        return np.inf
    rest = peirce.solve(room, 0.5 * D, arcs * D)
    strain = np.maximum(now.length / rest.length - 1.0, 0.0)
    # a sawtooth's moment over angle, 12 B s²/l³, for twice the share of arcs in less D
    bent = 6.0 * (rest.straight / rest.length) ** 2 / rest.length * (now.theta - rest.theta) ** 2
    total = 0.5 * np.multiply(yarns.tension, rest.length * strain**2).sum()
    total += np.multiply(yarns.bending, bent).sum() * D / distance
    if distance < D:
        total += 0.5 * yarns.contact * (distance - D) ** 2 / D
    return float(total)


@pytest.mark.parametrize("bending", [(1e-9, 4e-9), (2e-8, 0.0)])
@pytest.mark.parametrize("contact", [0.5, 1e4])
@pytest.mark.parametrize(
    ("warp", "weft", "stretches"),
    [
        (0.5, 0.5, ((0.93, 0.94), (0.91, 0.99), (0.911, 1.02), (1.04, 0.912), (0.95, 0.92))),
        # so little room that there are no angles of rest
        (0.45, 0.9, ((0.73, 0.635), (0.84, 0.76))),
    ],
)
def test_there_is_no_lower_energy_near_jams(
    warp: float,
    weft: float,
    stretches: tuple[tuple[float, float], ...],
    contact: float,
    bending: tuple[float, float],
) -> None:
    yarns, room = YarnMechanics((20.0, 30.0), contact, bending), 1e-3 * np.array([weft, warp])
    woven, random = cloth(warp, weft, crimp_height=0.5 * D), np.random.default_rng(3)
    crossings = Interchange(woven, yarns)
    for stretch in stretches:
        state = stretched(crossings, *stretch)
        at, d = state.stretch[:, 0, 0], float(state.distance[0, 0])
        # not on a jam itself, which is Peirce's to refuse
        h = np.clip(2.0 * float(state.height[0, 0, 0]), *_between_jams(room * at, d))
        found = energy(yarns, at, h, d, room)
        assert np.isfinite(found)
        for scale in (1e-1, 1e-2, 1e-3, 1e-4):
            for dh, dd in scale * D * random.uniform(-1.0, 1.0, (20, 2)):
                other = energy(yarns, at, h + dh, min(d + dd, D), room)
                assert found <= other * (1.0 + 1e-7) + 1e-22


def _between_jams(room: NDArray, distance: float) -> tuple[float, float]:
    """Return the least and most h1 of which no yarn jams."""
    jam = distance - np.sqrt(np.maximum(distance**2 - room**2, 0.0))
    return distance - jam[1] + 1e-12 * D, jam[0] - 1e-12 * D


@pytest.mark.parametrize(("aspects", "spacing"), [((1.0, 1.0), 0.5), ((1.2, 1.4), 0.7)])
@pytest.mark.parametrize(
    "bending", [1e-9, *(pytest.param(each, marks=pytest.mark.nightly) for each in (0.0, 1e-7))]
)
def test_the_energy_is_the_least(
    bending: float, aspects: tuple[float, float], spacing: float
) -> None:
    yarns = YarnMechanics((20.0, 30.0), np.inf, (bending, 2.0 * bending))
    crossings = Interchange(cloth(spacing, spacing, aspects=aspects), yarns)
    # the yarn that is crossed has arcs of (aspect² + 1) / 4 of its height, and half of D is its own
    arcs = (1.0 + (np.square(aspects[::-1]) + 1.0) / 2.0) / 2.0
    given: Any = {"room": spacing * 1e-3, "arcs": arcs}
    for stretch in np.random.default_rng(5).uniform(0.93, 1.12, (4, 2)):
        state = stretched(crossings, *stretch)
        found = energy(yarns, stretch, float(2.0 * state.height[0, 0, 0]), **given)
        grid = np.linspace(0.0, D, 401)
        values = [energy(yarns, stretch, height, **given) for height in grid]
        best = int(np.argmin(values))
        around = grid[max(best - 1, 0)], grid[min(best + 1, 400)]
        least = minimize_scalar(
            lambda h, s=stretch: energy(yarns, s, h, **given),
            bounds=around,
            method="bounded",
            options={"xatol": 1e-12},
        )
        assert found <= min(least.fun, values[best]) * (1.0 + 1e-6) + 1e-18


@pytest.mark.parametrize("weave", WEAVES)
@pytest.mark.parametrize("share", [0.5, 0.42])
def test_yarns_keep_their_length_in_any_weave(weave: str, share: float) -> None:
    threads = [
        Threads(diameter=d * 1e-3, spacing=p * 1e-3, section="racetrack", aspect=a)
        for d, p, a in ((0.25, 0.7, 1.3), (0.3, 0.8, 1.2))
    ]
    drawdown = tile_drawdown(from_matrix(WEAVES[weave]), 23, 21)
    woven = Cloth(drawdown=drawdown, warp=threads[0], weft=threads[1], crimp_height=share * 0.55e-3)
    crossings, period = Interchange(woven), len(WEAVES[weave])

    def lengths(state: CrimpState) -> list[float]:
        """Return those of the first repeat of each family, gap by gap."""
        result = []
        for family, (line, flat) in enumerate(
            ((drawdown[:, 3], 0.2 * 0.3e-3), (drawdown[2], 0.3 * 0.25e-3))
        ):
            h = 2.0 * (state.height[0, :, 3] if family == 0 else state.height[1, 2])
            d = state.distance[:, 3] if family == 0 else state.distance[2]
            stretch = state.stretch[family, 0, 0]
            p = stretch * (0.8e-3, 0.7e-3)[family]
            total = 0.0
            for k in range(period):
                if line[k] == line[k + 1]:
                    total += p
                else:
                    rise = 0.5 * (h[k] + h[k + 1])
                    total += flat + peirce.solve(p - flat, rise, 0.5 * (d[k] + d[k + 1])).length
            result.append(total)
        return result

    rest = lengths(stretched(crossings, 1.0, 1.0))
    for stretch in ((1.02, 1.01), (1.01, 0.985), (0.99, 1.015)):
        state = stretched(crossings, *stretch)
        now = lengths(state)
        taut = ~state.slack[:, 2, 3]
        assert taut.any()
        longer = np.divide(now, rest) - 1.0 - state.strain[:, 2, 3]
        assert np.abs(longer[taut]).max() < 1e-9
        assert longer.max() < 1e-9
        assert np.all(state.height.sum(axis=0) == pytest.approx(0.5 * state.distance, rel=1e-12))


@pytest.mark.parametrize(
    "yarns",
    [
        YarnMechanics(),
        YarnMechanics(contact=np.inf),
        YarnMechanics((50.0, 40.0), 5.0),
        YarnMechanics((50.0, 40.0), 5.0, (1e-9, 2e-9)),
        YarnMechanics((50.0, 40.0), 5.0, (1e-7, 1e-7)),
        YarnMechanics((50.0, 40.0), np.inf, (1e-9, 1e-9)),
    ],
)
@pytest.mark.parametrize(
    ("weave", "aspect"),
    [
        pytest.param("plain", 1.0, marks=pytest.mark.nightly),
        pytest.param("twill", 1.0, marks=pytest.mark.nightly),
        ("twill", 1.4),
    ],
)
def test_the_state_is_continuous_everywhere(
    yarns: YarnMechanics, weave: str, aspect: float
) -> None:
    points = 2001
    drawdown = tile_drawdown(from_matrix(WEAVES[weave]), points, 4)
    threads = Threads(diameter=0.5 * D, spacing=0.5e-3, section="lenticular", aspect=aspect)
    crossings = Interchange(Cloth(drawdown=drawdown, warp=threads, weft=threads), yarns)
    random = np.random.default_rng(7)
    for _ in range(4):
        first, last = random.uniform(0.5, 1.6, (2, 2))
        t = np.linspace(0.0, 1.0, points)
        field = first[:, None, None] + (last - first)[:, None, None] * t
        state = crossings.solve(np.broadcast_to(field, (2, 4, points)))
        for name, values in state._asdict().items():
            assert np.isfinite(values).all(), name
        assert state.height.min() >= 0.0
        step = np.abs(last - first).max() / (points - 1)
        # a yarn that becomes straight loses its height like the root of what is left
        for values in (2.0 * state.height / D, state.distance / D):
            assert np.abs(np.diff(values, axis=-1)).max() < 3.0 * np.sqrt(step)
        assert np.abs(np.diff(state.stretch, axis=-1)).max() < 3.0 * np.sqrt(step)


def test_wide_cloth_is_kawabatas_sawtooth() -> None:
    """Straight yarns between the crossings, whose tensions balance there."""
    strains = np.array([1.0008, 1.0003])
    errors = []
    for spacing in (4.0, 8.0, 16.0):
        # the same sawtooth: its crimp stays, and the arcs become short against it
        woven = cloth(spacing, spacing)
        stretch = 1.0 + (strains - 1.0) * (16.0 / spacing) ** 2
        state = stretched(Interchange(woven, YarnMechanics((50.0, 30.0), np.inf)), *stretch)
        p, rest = spacing * 1e-3, np.hypot(spacing * 1e-3, 0.5 * D)

        def balance(
            h: float, p: float = p, rest: float = rest, stretch: NDArray = stretch
        ) -> float:
            heights = np.array([h, D - h])
            length = np.hypot(p * stretch, heights)
            pull = np.array([50.0, 30.0]) * (length / rest - 1.0) * heights / length
            return float(pull[0] - pull[1])

        height = brentq(balance, 0.01 * D, 0.99 * D)
        errors.append(abs(2.0 * state.height[0, 0, 0] - height) / D)
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 2e-3


def test_a_yarn_that_never_changes_side_only_strains() -> None:
    threads = Threads(diameter=0.5 * D, spacing=0.6e-3)
    drawdown = np.array([[1, 1, 0], [1, 0, 1], [1, 1, 0], [1, 0, 1]], bool)
    crossings = Interchange(
        Cloth(drawdown=drawdown, warp=threads, weft=threads), YarnMechanics((10.0, 10.0), 1.0)
    )
    state = stretched(crossings, 1.02, 0.99)
    assert state.strain[0, :, 0] == pytest.approx(0.02)
    assert np.all(state.crimp[0, :, 0] == 0.0)
    assert np.all(state.strain[0, :, 1] < 0.019)
    found = crossings.forces(np.ones((2, 4, 3)) * np.reshape([1.02, 0.99], (2, 1, 1)))
    assert found.force[0, :, 0] == pytest.approx(10.0 * 0.02 * 0.6e-3)


def test_one_crossing_and_a_far_field() -> None:
    lone = Cloth(
        drawdown=[[1]],
        warp=Threads(diameter=0.1e-3, spacing=0.2e-3),
        weft=Threads(diameter=0.1e-3, spacing=0.2e-3),
    )
    assert np.isfinite(stretched(Interchange(lone), 1.3, 0.7).height).all()
    crossings = Interchange(cloth())
    for values in (1e-6, 30.0):
        state = stretched(crossings, values, 1.0)
        assert all(np.isfinite(array).all() for array in state)


def test_invalid_input_is_refused() -> None:
    with pytest.raises(InputError, match="tension"):
        Interchange(cloth(), YarnMechanics((np.inf, 1.0)))
    with pytest.raises(InputError, match="flattest"):
        Interchange(cloth(), YarnMechanics(flattest=1.5))
    with pytest.raises(InputError, match=r"\(2, 2, 2\)"):
        Interchange(cloth()).solve(np.ones((2, 3, 3)))
    with pytest.raises(InputError, match="tension"):
        Interchange(cloth()).forces(np.ones((2, 2, 2)))
