"""Energies of a motion: the balance, and the loss in the dampers integrated step by step."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from test_motion import DAMPING, FUNCTIONS, GAIN, STIFFNESS, breaks

from spacemap_vtk.mechanics import timefunctions as tf
from spacemap_vtk.mechanics.energy import Account
from spacemap_vtk.mechanics.motion import Drive, ModalMotion


def lost_by_quadrature(motion, start, end):
    """∫ 2h q̇² by Gauss's rule, panel by panel, from break to break."""
    marks = {start, end, *(t for d in motion.drives for t in breaks(d.function, end) if t > start)}
    marks = sorted(marks)
    marks = [a for a, b in zip(marks, [*marks[1:], math.inf], strict=True) if b - a > 1e-12]
    nodes, weights = np.polynomial.legendre.leggauss(18)
    total = 0.0
    for begin, finish in itertools.pairwise(marks):
        edges = np.linspace(begin, finish, 2 + int((finish - begin) / 0.2))
        for a, b in itertools.pairwise(edges):
            rates = [motion.at(a + (b - a) * (x + 1) / 2).rate for x in nodes]
            total += (b - a) / 2 * weights @ (np.square(rates) @ (2 * motion.half))
    return total


def check(motion, times=(0.05, 0.35, 0.77, 1.5)):
    account, lost, before = Account(motion), 0.0, 0.0
    for time in times:
        energy = account.at(time)
        state = motion.at(time)
        assert energy.kinetic == pytest.approx(0.5 * (state.rate**2).sum(), rel=1e-13)
        assert energy.strain == pytest.approx(0.5 * (STIFFNESS * state.position**2).sum())
        size = max(abs(energy.work), energy.kinetic + energy.strain)
        if motion.half.any():
            lost += lost_by_quadrature(motion, before, time)
        before = time
        balance = energy.kinetic + energy.strain + lost - energy.work
        assert abs(balance) <= 1e-10 * size
        assert energy.dissipated == pytest.approx(lost, abs=1e-10 * size)
    again = Account(motion).at(times[-1])
    assert again.work == pytest.approx(energy.work, rel=1e-12)


@pytest.mark.parametrize(
    ("damping", "base"),
    [
        ("none", True),
        ("mixed", False),
        pytest.param("none", False, marks=pytest.mark.nightly),
        pytest.param("mixed", True, marks=pytest.mark.nightly),
    ],
)
@pytest.mark.parametrize("function", FUNCTIONS)
def test_balance(function, damping, base):
    check(ModalMotion(STIFFNESS, DAMPING[damping], [Drive(GAIN, FUNCTIONS[function], base)]))


@pytest.mark.parametrize("damping", ["none", "alpha"])
def test_balance_of_everything_at_once(damping):
    drives = [
        Drive(np.roll(GAIN, k), function, k % 3 == 0)
        for k, function in enumerate(FUNCTIONS.values())
    ]
    drives.append(Drive(GAIN, tf.harmonic(0.37, 0.2, steady=True)))
    gain = GAIN * (STIFFNESS > 0)
    drives.append(Drive(gain, tf.periodic([0, 0.11, 0.31], [0, 1, 0], steady=damping == "alpha")))
    check(
        ModalMotion(STIFFNESS, DAMPING[damping], drives, position=0.1 * GAIN, rate=-GAIN),
        (0.35, 1.1),
    )


def test_no_damping_loses_nothing_over_ten_thousand_periods():
    motion = ModalMotion(STIFFNESS, np.zeros(5), [Drive(GAIN, tf.step())], rate=GAIN)
    account = Account(motion)
    for time in (1.0, 1e2, 1e4 * 2 * math.pi / math.sqrt(40.0)):
        energy = account.at(time)
        stored = energy.kinetic + energy.strain
        assert energy.dissipated == 0.0
        assert stored == pytest.approx(energy.work, rel=1e-10)


def test_work_behind_too_many_periods_is_not_added_up():
    """Kinetic and strain energy are known at any time, and at once."""
    motion = ModalMotion(STIFFNESS, DAMPING["mixed"], [Drive(GAIN, tf.periodic([0, 0.01], [0, 1]))])
    account = Account(motion)
    late = account.at(1e8)
    assert late.kinetic > 0
    assert math.isnan(late.work)
    assert math.isnan(late.dissipated)
    early = account.at(0.1)
    assert early.kinetic + early.strain + early.dissipated == pytest.approx(early.work, rel=1e-10)


def test_equilibrium_holds_the_work_that_led_there():
    gain = GAIN * (STIFFNESS > 0)
    motion = ModalMotion(
        STIFFNESS,
        DAMPING["ratio"],
        [Drive(gain, tf.table([0, 0.2, 0.2], [1, 1, 0]))],
        equilibrium=True,
    )
    energy = Account(motion).at(0.1)
    static = 0.5 * (gain[1:] ** 2 / STIFFNESS[1:]).sum()
    assert energy.strain == pytest.approx(static)
    assert energy.work == pytest.approx(static)
    check(motion)
    late = Account(motion).at(5000.0)
    assert late.dissipated == pytest.approx(late.work, rel=1e-10)
