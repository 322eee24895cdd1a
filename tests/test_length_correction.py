"""Yarns through crossings that differ: drafts, uneven spacings, yarns of many diameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacemap_vtk.textile.crimp.crimp_geometry import CrimpGeometry
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.drafts.drawdown import from_matrix
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

#: Plain in one corner, floats of two, three and four in the others; a repeat, and a yarn.
REPEAT = """
10101100
01011001
10100011
01010110
10100110
01011100
10101001
01010011
"""
MIXED = np.pad(from_matrix(REPEAT.split()), ((0, 1), (0, 1)), mode="wrap")
STRETCHES = [(1.01, 1.005), (1.02, 0.99), (0.99, 1.02), (1.02, 0.97), (1.001, 1.0)]


def threads(spacing: float, diameter: float, seed: int) -> Threads:
    """Threads whose spacings and diameters differ by up to such a share."""
    random = np.random.default_rng(seed)
    return Threads(
        diameter=0.25e-3 * (1.0 - diameter * random.random(9)),
        spacing=0.6e-3 * (1.0 + spacing * random.random(8)),
    )


CLOTHS = {
    name: Cloth(drawdown=MIXED, warp=threads(*uneven, 1), weft=threads(*uneven, 2))
    for name, uneven in (
        ("floats", (0.0, 0.0)),
        ("spacings", (0.3, 0.0)),
        ("diameters", (0.0, 0.2)),
        ("all", (0.3, 0.2)),
    )
}
CLOTHS["racetrack"] = replace(
    CLOTHS["all"], warp=replace(CLOTHS["all"].warp, section="racetrack", aspect=1.2)
)


def everywhere(cloth: Cloth, stretch: tuple[float, float]) -> np.ndarray:
    return np.broadcast_to(np.reshape(stretch, (2, 1, 1)), (2, *cloth.drawdown.shape))


def lengths(cloth: Cloth, number: int, height: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Whole lengths of the axes as drawn, less that past the first and last crossing."""
    path = CrimpGeometry(cloth).axes(number, height, stretch)
    return np.bincount(path.owner, path.length) - 2.0 * cloth.families[number].overhang


@pytest.mark.parametrize("stretch", STRETCHES)
@pytest.mark.parametrize("name", CLOTHS)
def test_axes_are_as_long_as_woven(name: str, stretch: tuple[float, float]) -> None:
    cloth = CLOTHS[name]
    crossings, still = Interchange(cloth), everywhere(cloth, (1.0, 1.0))
    asked = everywhere(cloth, stretch)
    rest, state = crossings.solve(still).height, crossings.solve(asked)
    woven = (
        np.reshape(cloth.shares, (2, 1, 1))
        * 0.5
        * np.add.outer(cloth.yarns[1].diameter, cloth.yarns[0].diameter)
    )
    assert np.allclose(rest, woven, rtol=1e-12, atol=0.0)
    taut = ~state.slack & (state.strain == 0.0)
    kept = taut[0].all(axis=0), taut[1].all(axis=1)
    assert kept[0].any() or kept[1].any()
    for number in range(2):
        before = lengths(cloth, number, rest, still)[kept[number]]
        after = lengths(cloth, number, state.height, asked)[kept[number]]
        assert np.allclose(after, before, rtol=1e-9, atol=0.0)


@pytest.mark.parametrize(
    "yarns",
    [pytest.param(YarnMechanics(), marks=pytest.mark.nightly), YarnMechanics((3.0, 5.0), 1.0)],
)
@pytest.mark.parametrize("name", CLOTHS)
def test_heights_stay_within_the_crossing_and_change_without_jumps(
    name: str, yarns: YarnMechanics
) -> None:
    cloth = CLOTHS[name]
    crossings = Interchange(cloth, yarns)
    full = np.add.outer(cloth.yarns[1].diameter, cloth.yarns[0].diameter)
    low = crossings.solve(everywhere(cloth, (1.0, 1.0)))
    y, x = np.mgrid[0:1:9j, 0:1:9j]
    uneven = np.stack([np.sin(7.0 * x + 3.0 * y), np.cos(5.0 * x - 4.0 * y)])
    for path in (np.reshape([0.02, -0.02], (2, 1, 1)) + 0.0 * uneven, 0.01 + 0.03 * uneven):
        for part in np.linspace(0.0, 1.0, 9):
            low, high = (crossings.solve(1.0 + (part + step) * path) for step in (0.0, 1e-6))
            for state in (low, high):
                assert (state.height >= 0.0).all()
                assert (state.distance <= full * (1.0 + 1e-12)).all()
                assert (state.distance >= yarns.flattest * full * (1.0 - 1e-12)).all()
                assert np.allclose(state.distance, 2.0 * state.height.sum(axis=0), rtol=1e-12)
            assert abs(high.height - low.height).max() < 2e-5 * full.max()
