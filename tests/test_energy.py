"""Energies of a motion: the balance, and the loss in the dampers integrated step by step."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_modal_motion import DAMPING, FUNCTIONS, GAIN, STIFFNESS, break_times

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary import time_functions as tf
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.response.cage_response import Response
from spacemap_vtk.mechanics.response.energy import EnergyAccount, balance_energies
from spacemap_vtk.mechanics.response.modal_motion import ModalLoad, ModalMotion
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion


def dissipation_by_quadrature(motion, start, end):
    """∫ 2h q̇² by Gauss's rule, panel by panel, from break to break."""
    marks = {
        start,
        end,
        *(t for d in motion.drives for t in break_times(d.function, end) if t > start),
    }
    marks = sorted(marks)
    marks = [a for a, b in zip(marks, [*marks[1:], math.inf], strict=True) if b - a > 1e-12]
    nodes, weights = np.polynomial.legendre.leggauss(18)
    total = 0.0
    for begin, finish in itertools.pairwise(marks):
        edges = np.linspace(begin, finish, 2 + int((finish - begin) / 0.2))
        for a, b in itertools.pairwise(edges):
            rates = [motion.at_time(a + (b - a) * (x + 1) / 2).rate for x in nodes]
            total += (b - a) / 2 * weights @ (np.square(rates) @ (2 * motion.half))
    return total


def check(motion, times=(0.05, 0.35, 0.77, 1.5)):
    account, lost, before = EnergyAccount(motion), 0.0, 0.0
    for time in times:
        energy = account.at_time(time)
        state = motion.at_time(time)
        assert energy.kinetic == pytest.approx(0.5 * (state.rate**2).sum(), rel=1e-13)
        assert energy.strain == pytest.approx(0.5 * (STIFFNESS * state.position**2).sum())
        size = max(abs(energy.work), energy.kinetic + energy.strain)
        if motion.half.any():
            lost += dissipation_by_quadrature(motion, before, time)
        before = time
        balance = energy.kinetic + energy.strain + lost - energy.work
        assert abs(balance) <= 1e-10 * size
        assert energy.dissipated == pytest.approx(lost, abs=1e-10 * size)
    again = EnergyAccount(motion).at_time(times[-1])
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
def test_energies_balance(function, damping, base):
    check(ModalMotion(STIFFNESS, DAMPING[damping], [ModalLoad(GAIN, FUNCTIONS[function], base)]))


@pytest.mark.parametrize("damping", ["none", pytest.param("alpha", marks=pytest.mark.nightly)])
def test_energies_balance_with_all_kinds_of_loads(damping):
    drives = [
        ModalLoad(np.roll(GAIN, k), function, k % 3 == 0)
        for k, function in enumerate(FUNCTIONS.values())
    ]
    drives.append(ModalLoad(GAIN, tf.harmonic(0.37, 0.2, steady=True)))
    gain = GAIN * (STIFFNESS > 0)
    drives.append(
        ModalLoad(gain, tf.periodic([0, 0.11, 0.31], [0, 1, 0], steady=damping == "alpha"))
    )
    check(
        ModalMotion(STIFFNESS, DAMPING[damping], drives, position=0.1 * GAIN, rate=-GAIN),
        (0.2, 0.5),
    )


def test_undamped_motion_conserves_energy_over_ten_thousand_periods():
    motion = ModalMotion(STIFFNESS, np.zeros(5), [ModalLoad(GAIN, tf.step())], rate=GAIN)
    account = EnergyAccount(motion)
    for time in (1.0, 1e2, 1e4 * 2 * math.pi / math.sqrt(40.0)):
        energy = account.at_time(time)
        stored = energy.kinetic + energy.strain
        assert energy.dissipated == 0.0
        assert stored == pytest.approx(energy.work, rel=1e-10)


def test_work_after_too_many_periods_is_nan():
    """Kinetic and strain energy are known at any time, and at once."""
    motion = ModalMotion(
        STIFFNESS, DAMPING["mixed"], [ModalLoad(GAIN, tf.periodic([0, 0.01], [0, 1]))]
    )
    account = EnergyAccount(motion)
    late = account.at_time(1e8)
    assert late.kinetic > 0
    assert math.isnan(late.work)
    assert math.isnan(late.dissipated)
    early = account.at_time(0.1)
    assert early.kinetic + early.strain + early.dissipated == pytest.approx(early.work, rel=1e-10)


def test_initial_equilibrium_counts_as_work():
    gain = GAIN * (STIFFNESS > 0)
    motion = ModalMotion(
        STIFFNESS,
        DAMPING["ratio"],
        [ModalLoad(gain, tf.table([0, 0.2, 0.2], [1, 1, 0]))],
        equilibrium=True,
    )
    energy = EnergyAccount(motion).at_time(0.1)
    static = 0.5 * (gain[1:] ** 2 / STIFFNESS[1:]).sum()
    assert energy.strain == pytest.approx(static)
    assert energy.work == pytest.approx(static)
    check(motion)
    late = EnergyAccount(motion).at_time(5000.0)
    assert late.dissipated == pytest.approx(late.work, rel=1e-10)


def held_block():
    """Return a soft block that is held at one end, with all of its modes."""
    points, cells = build_lattice((0, 0.04, 0, 0.06, 0, 0.01), (1, 2, 1))
    held = np.repeat(points[:, 1:2] > 0.0599, 3, axis=1)
    model = Model(points, cells, isotropic(1e4, 0.3), 300.0, held)
    values, shapes, lost = model.modes(1000)
    values, shapes = values * model.modulus / model.density, shapes / model.density**0.5
    return CageModes(model, values, shapes.reshape(len(values), -1), lost)


def balance_of(motion, times):
    start = motion.energies(np.array([0.0]))[0, 3]
    return balance_energies(motion.energies(times), motion.potential(times), start)


@pytest.mark.parametrize("alpha", [0.0, 3.0])
def test_the_balance_agrees_with_an_integration_of_the_equations_of_motion(alpha):
    """M u'' + C u' + K u = weight + force sin(wt), integrated by Runge and Kutta's method."""
    cage = held_block()
    beta = alpha / 1e4
    weight = cage.load_vector("gravity", (0.0, 0.0, -9.8), tf.step())
    force = cage.load_vector("force", (1e-3, 0.0, 2e-3), tf.harmonic(15.0), (0.0, 0.0, 0.0))
    motion = Response(cage, [weight, force], Damping(alpha=alpha, beta=beta))

    stiffness, damping = cage.eigenvalues, alpha + beta * cage.eigenvalues
    dead, driven = cage.shapes @ cage.vertex_forces(weight), cage.shapes @ cage.vertex_forces(force)
    count = len(stiffness)

    def rates(time, state):
        q, v = state[:count], state[count : 2 * count]
        push = driven * math.sin(2 * math.pi * 15.0 * time)
        acceleration = dead + push - damping * v - stiffness * q
        return np.concatenate([v, acceleration, [damping @ v**2, push @ v]])

    times = np.linspace(0.0, 0.3, 31)
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-15}
    exact = solve_ivp(rates, (0.0, 0.3), np.zeros(2 * count + 2), t_eval=times, **options).y
    q, v = exact[:count], exact[count : 2 * count]

    found = balance_of(motion, times)
    size = found.strain.max()
    close = {"rtol": 0.0, "atol": 1e-8 * size}
    np.testing.assert_allclose(found.kinetic, (v**2).sum(axis=0) / 2, **close)
    np.testing.assert_allclose(found.strain, stiffness @ q**2 / 2, **close)
    np.testing.assert_allclose(found.potential, -dead @ q, **close)
    np.testing.assert_allclose(found.dissipated, exact[-2], **close)
    np.testing.assert_allclose(found.work, exact[-1], **close)
    np.testing.assert_allclose(found.total, 0.0, **close)
    # None of them is trivial.
    assert min(abs(part).max() for part in found[:5]) > 1e-3 * size or alpha == 0.0
    assert (found.dissipated.max() > 0.1 * size) == (alpha > 0.0)


def test_undamped_thrown_cage_conserves_total_energy():
    cage = held_block()
    weight = cage.load_vector("gravity", (0.0, -3.0, -9.8), tf.step())
    thrown = 10.0 * cage.model.points
    motion = Response(cage, [weight], Damping(), velocity=thrown)
    found = balance_of(motion, np.linspace(0.0, 40.0, 200))
    assert np.ptp(found.kinetic) > 0.1 * found.total[0]
    np.testing.assert_allclose(found.total, found.kinetic[0], rtol=1e-9)
    np.testing.assert_allclose(found.work, 0.0, atol=1e-10 * found.total[0])


@pytest.mark.parametrize("alpha", [0.0, 5.0])
def test_stepped_motion_conserves_total_energy_under_a_load(alpha):
    cage = held_block()
    weight = cage.load_vector("gravity", (0.0, 0.0, -9.8), tf.step())
    gust = cage.load_vector("pressure", 20.0, tf.table([0, 0.05, 0.05], [1, 1, 0]), "+z")
    motion = SteppedMotion(cage, [weight, gust], Damping(alpha=alpha), tolerance=1.0, max_step=2e-3)
    found = balance_of(motion, np.linspace(0.0, 0.3, 100))
    size = abs(found.potential).max()
    assert np.ptp(found.work) > 0.01 * size  # the gust's, which ends
    np.testing.assert_allclose(found.work[50:], found.work[-1], atol=1e-9 * size)
    assert (found.dissipated[-1] > 0.01 * size) == (alpha > 0.0)
    np.testing.assert_allclose(found.total, 0.0, atol=1e-8 * size)
