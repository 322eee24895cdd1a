"""Damping of the modes: from two pairs, by one ratio, by a ratio for each."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_response import Chain

from spacemap_vtk import ModalResponse
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.paraview.property_xml import property_of
from spacemap_vtk.scenes.scene import Scene


def test_two_pairs_make_alpha_and_beta() -> None:
    damping = ModalResponse(damping_pairs=[["10 Hz", 0.02], [80, 0.03]]).damping
    for frequency, ratio in ((10, 0.02), (80, 0.03)):
        omega = 2 * math.pi * frequency
        assert damping.alpha / (2 * omega) + damping.beta * omega / 2 == pytest.approx(ratio)
    with pytest.raises(InputError, match=r"damping_pairs.*second ratio from 0.0025 to 0.16"):
        _ = ModalResponse(damping_pairs=[[10, 0.02], [80, 0.5]]).damping
    with pytest.raises(InputError, match=r"damping_pairs.*must be two pairs, not 3"):
        ModalResponse(damping_pairs=[[1, 0.1], [2, 0.1], [3, 0.1]])


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ({"damping_ratio": 0.1, "alpha": 2.0}, ("damping_ratio", "alpha")),
        ({"damping_ratio": 0.0, "beta": 2.0}, ("damping_ratio", "beta")),
        ({"damping_pairs": [[1, 0.1], [2, 0.1]], "alpha": 2.0}, ("damping_pairs", "alpha")),
        (
            {"damping_pairs": [[1, 0.1], [2, 0.1]], "damping_ratio": 0.1},
            ("damping_ratio", "damping_pairs"),
        ),
    ],
)
def test_contradictory_parameters_are_both_named(
    values: dict[str, Any], names: tuple[str, str]
) -> None:
    chain = Chain(**values)
    with pytest.raises(InputError) as caught:
        chain.response.update(0.1)
    assert f"response.{names[0]}" in str(caught.value)
    assert f"{names[0]} and {names[1]} both" in str(caught.value)
    assert Chain(damping_ratio=0.1, alpha=0.0).response.damping.ratio == 0.1


def test_one_ratio_damps_all_modes() -> None:
    chain = Chain(damping_ratio=0.05, gravity=(0, 0, 0), initial_velocity=(0, 0, 0.1))
    chain.response.residual_vectors = False
    eigenvalues = chain.at(0.0, "eigenvalues")
    chain.at(0.02, "modal_coordinates")
    omega = np.sqrt(eigenvalues)
    d = omega * math.sqrt(1 - 0.05**2)
    rates = chain.response.motion.modes.shapes @ (
        chain.model.mass @ (np.tile([0, 0, 0.1], len(chain.model.points)) * chain.model.free)
    )
    expected = rates * np.exp(-0.05 * omega * 0.02) * np.sin(d * 0.02) / d
    np.testing.assert_allclose(chain.at(0.02, "modal_coordinates"), expected, rtol=1e-10)


def test_last_of_several_ratios_applies_to_higher_modes() -> None:
    chain = Chain(damping_ratio=[0.3, 0.05], gravity=(0, 0, 0), initial_velocity=(0, 0, 0.1))
    chain.response.residual_vectors = False
    omega = np.sqrt(chain.at(0.0, "eigenvalues"))
    ratio = np.array([0.3] + [0.05] * (len(omega) - 1))
    chain.at(0.02, "modal_coordinates")
    rates = chain.response.motion.modes.shapes @ (
        chain.model.mass @ (np.tile([0, 0, 0.1], len(chain.model.points)) * chain.model.free)
    )
    d = omega * np.sqrt(1 - ratio**2)
    expected = rates * np.exp(-ratio * omega * 0.02) * np.sin(d * 0.02) / d
    np.testing.assert_allclose(chain.at(0.02, "modal_coordinates"), expected, rtol=1e-10)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("5 %", 0.05),
        ([0.1, 0.1], 0.1),
        ("0.1, 0.05", (0.1, 0.05)),
        (["10 %", 0.05, 0], (0.1, 0.05, 0.0)),
    ],
)
def test_list_of_ratios_round_trips_as_text(value: Any, expected: Any) -> None:
    response = ModalResponse(damping_ratio=value, alpha=0.0)
    assert response.damping == Damping(ratio=expected)
    parameter = ModalResponse.parameter("damping_ratio")
    assert parameter.check(parameter.format(response.damping_ratio)) == expected
    there = property_of(parameter)
    assert parameter.check(there.read(there.write(expected))) == expected
    assert there.read(there.write(None)) is None


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (-0.1, r"damping_ratio = -0.1: out of range; allowed: a number at least 0; or a list of"),
        ([0.1, "x"], r'value 2, "x": must be a number'),
        ([], "must not be an empty list"),
        ("", "must be a number"),
    ],
)
def test_invalid_ratios_are_refused(value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ModalResponse(damping_ratio=value)


def test_file_of_ratios_is_relative_to_the_scene(tmp_path: Path) -> None:
    (tmp_path / "ratios.txt").write_text("ratio\n0.08  # the first bends\n0,05\n\n0.02\n")
    scene_file = tmp_path / "mine.toml"
    scene_file.write_text("""
        [weave]
        ends = 3
        picks = 3
        [response]
        damping_ratio = "ratios.txt"
        """)
    scene = Scene.read(scene_file)
    assert scene.response.damping.ratio == (0.08, 0.05, 0.02)
    halves = scene.response.damping.decay_rates(np.array([4.0, 9.0, 16.0, 100.0]))
    np.testing.assert_allclose(halves, [0.16, 0.15, 0.08, 0.2], rtol=1e-14)
    parameter = ModalResponse.parameter("damping_ratio")
    there = property_of(parameter)
    path = tmp_path / "ratios.txt"
    assert parameter.check(there.read(there.write(path))) == path
    for text, message in (
        ("0.1\n0.2 0.3\n", r'line 2 of .*ratios.txt: "0.2 0.3"; allowed: one number in each'),
        ("0.1\n-0.2\n", "value 2, -0.2: out of range"),
        ("ratio\n", "has no numbers"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=message) as caught:
            scene.update(0.1)
        assert caught.value.key == "damping_ratio"
    path.unlink()
    with pytest.raises(InputError, match=r"No such file or directory: .*ratios\.txt"):
        _ = scene.response.damping
