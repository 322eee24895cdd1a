"""The closed-form oscillator against mpmath, expm and its own laws.

An error is measured against the natural scale of each quantity, the most it can come to at that
time: with r the larger of √λ and h = (α + βλ)/2 and s = min(t, 1/r), these are 1 for the free
response and the rate of the impulse response, s for the impulse response, λs for the rate of the
free response, and min(t²/2, t s, 1/λ) for the step response.
"""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg as la
from hypothesis import given, settings
from hypothesis import strategies as st
from pencils import solve_matrices, stiffness_and_mass

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.response.oscillator import (
    Kernels,
    classify_regimes,
    compute_kernels,
    damping_ratio,
)

RATIOS = (0.0, 0.02, 1 - 1e-9, 1.0, 1 + 1e-9, 5.0, 1e3)
EIGENVALUES = (
    *(1e-20, 1e8),
    *(
        pytest.param(value, marks=pytest.mark.nightly)
        for value in (1e-12, 1e-6, 1e-2, 1.0, 7.3, 1e2, 1e4, 1e6)
    ),
)
PERIODS = (1e-6, 1e-3, 0.07, 0.09, 0.3, 1.0, 10.25, 100.0)


def exact_kernels(eigenvalue, alpha, beta, time):
    """The seven responses to 80 digits, as the solution of the first-order system.

    The states are q, q̇, the load and its first two derivatives: a matrix exponential by scaling and
    squaring, which knows of no case to distinguish.
    """
    with mp.workdps(80):
        lam, t = mp.mpf(eigenvalue), mp.mpf(time)
        damping = mp.mpf(alpha) + mp.mpf(beta) * lam
        system = mp.zeros(5)
        system[0, 1] = system[1, 2] = system[2, 3] = system[3, 4] = 1
        system[1, 0], system[1, 1] = -lam, -damping
        system *= t
        norm = max(mp.norm(system, 1), mp.mpf(1))
        halvings = int(mp.ceil(mp.log(norm, 2))) + 8
        with mp.workdps(80 + int(0.7 * halvings)):
            small = system / mp.mpf(2) ** halvings
            power = result = mp.eye(5)
            for k in range(1, 28):  # 256⁻ᵏ / k! is below 1e-90
                power = power * small / k
                result = result + power
            for _ in range(halvings):
                result = result * result
        return [result[0, 0], result[1, 0], result[0, 1], result[1, 1], *result[0, 2:]]


def kernels_of(eigenvalues, alpha, beta, time) -> Kernels:
    """Return the responses of q̈ + (α + βλ) q̇ + λ q = w."""
    eigenvalues = np.array(eigenvalues)
    return compute_kernels(eigenvalues, (alpha + beta * eigenvalues) / 2, time)


def largest_error(eigenvalue, alpha, beta, time):
    """Largest error of the seven responses, in their natural scales."""
    root = max(math.sqrt(eigenvalue), (alpha + beta * eigenvalue) / 2)
    short = time if root * time < 1 else 1 / root
    step = min(time * time / 2, time * short, 1 / eigenvalue if eigenvalue else math.inf)
    # Under a load that grows without end, the most is what the static response comes to.
    soft = 1 / eigenvalue if eigenvalue else math.inf
    ramp, parabola = min(step * time, time * soft), min(step * time**2, time**2 * soft / 2)
    scales = (1.0, eigenvalue * short, short, 1.0, step, ramp, parabola)
    half = (alpha + beta * eigenvalue) / 2
    got = [float(x[0]) for x in compute_kernels(*np.array([[eigenvalue], [half], [time]]))]
    assert np.isfinite(got).all()
    with mp.workdps(80):
        errors = [
            abs(mp.mpf(g) - e)
            for g, e in zip(got, exact_kernels(eigenvalue, alpha, beta, time), strict=True)
        ]
        return max(float(e / s) if s else float(e) for e, s in zip(errors, scales, strict=True))


@pytest.mark.parametrize("eigenvalue", EIGENVALUES)
@pytest.mark.parametrize("ratio", RATIOS)
def test_kernels_of_any_damping_ratio_equal_mpmath(eigenvalue, ratio):
    omega = math.sqrt(eigenvalue)
    # Either way of damping makes the same h: each of them in turn.
    by_stiffness = (RATIOS.index(ratio) + round(math.log10(eigenvalue))) % 2
    alpha, beta = (0.0, 2 * ratio / omega) if by_stiffness else (2 * ratio * omega, 0.0)
    times = {p * 2 * math.pi / omega for p in PERIODS} | {0.0, 1e-3, 1.0, 1e3}
    for time in times:
        if time <= 1e3:
            assert largest_error(eigenvalue, alpha, beta, time) <= 1e-9, time


@pytest.mark.parametrize("alpha", [0.0, 1e-20, 1e-9, 0.3, 1e2, 1e6])
def test_rigid_kernels_equal_mpmath(alpha):
    for time in (0.0, 1e-9, 1e-3, 0.7, 1.0, 37.0, 1e3):
        assert largest_error(0.0, alpha, 5.0, time) <= 1e-9, time


@settings(derandomize=True)
@given(
    st.one_of(st.just(0.0), st.floats(-20, 8).map(lambda x: 10.0**x)),
    st.one_of(st.just(0.0), st.floats(-9, 6).map(lambda x: 10.0**x)),
    st.one_of(st.just(0.0), st.floats(-9, 1).map(lambda x: 10.0**x)),
    st.one_of(st.just(0.0), st.floats(-9, 3).map(lambda x: 10.0**x)),
)
def test_kernels_of_any_oscillator_equal_mpmath(eigenvalue, alpha, beta, time):
    # The phase √λ t of an undamped oscillation is known to its last place, and no better.
    phase = math.sqrt(eigenvalue) * time
    assert largest_error(eigenvalue, alpha, beta, time) <= 1e-9 + 4.5e-16 * phase


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("eigenvalue", [1e-4, 1.0, 1e4])
def test_kernels_compose_over_two_spans(eigenvalue, ratio):
    alpha = 2 * ratio * math.sqrt(eigenvalue)
    period = 2 * math.pi / math.sqrt(eigenvalue)
    for first, second in ((0.3, 0.4), (3.7, 0.01), (1e-3, 20.2)):
        a, b, c = (
            kernels_of([eigenvalue], alpha, 0.0, p * period)
            for p in (first, second, first + second)
        )
        # From q(0) = 1, from q̇(0) = 1 and under a unit load: all three restarted at `first`.
        for q, rate, load, end in (
            (a.free, a.free_rate, 0, c.free),
            (a.impulse, a.impulse_rate, 0, c.impulse),
            (a.step, a.impulse, 1, c.step),
        ):
            again = q * b.free + rate * b.impulse + load * b.step
            scale = np.abs([q * b.free, rate * b.impulse, load * b.step, end]).max()
            assert abs(again - end) <= 1e-10 * scale + 1e-300


@pytest.mark.parametrize("eigenvalue", [1e-6, 1.0, 39.47, 1e8])
def test_undamped_kernels_conserve_energy(eigenvalue):
    period = 2 * math.pi / math.sqrt(eigenvalue)
    for periods in (0.1, 1.3, 100.7, 1e4, 1e4 + 0.37):
        r = kernels_of([eigenvalue], 0.0, 0.0, periods * period)
        for q, rate, energy in (
            (r.free, r.free_rate, eigenvalue),
            (r.impulse, r.impulse_rate, 1.0),
            (r.step - 1 / eigenvalue, r.impulse, 1 / eigenvalue),  # about the loaded rest
        ):
            assert rate**2 + eigenvalue * q**2 == pytest.approx(energy, rel=1e-10)


def test_kernels_of_mixed_modes_equal_single_ones():
    eigenvalues = np.array([0.0, 1e-20, 4.0, 4.0001, 3.9999, 1e8])
    together = kernels_of(eigenvalues, 4.0, 0.0, 0.7)
    for k, eigenvalue in enumerate(eigenvalues):
        alone = kernels_of([eigenvalue], 4.0, 0.0, 0.7)
        np.testing.assert_allclose([x[k] for x in together], np.ravel(alone), rtol=1e-15)


def test_kernels_have_their_limits_at_zero_and_infinity():
    eigenvalues = [0.0, 1.0, 1e4, 1e8]
    start = kernels_of(eigenvalues, 0.5, 1e-3, 0.0)
    np.testing.assert_array_equal(np.array(start), np.outer([1, 0, 0, 1, 0, 0, 0], np.ones(4)))
    end = kernels_of(eigenvalues[1:], 0.5, 1e-3, 1e3)
    np.testing.assert_allclose(end.step, 1 / np.array(eigenvalues[1:]), rtol=1e-12)
    np.testing.assert_allclose([end.free, end.impulse_rate], 0, atol=1e-12)


def test_damping_ratio_and_regime_are_classified():
    eigenvalues = [0.0, 1.0, 4.0, 9.0, 100.0]
    # 2h = α + βλ with α = 2, β = 0.5: ζ = (2 + λ/2) / 2√λ.
    np.testing.assert_allclose(
        damping_ratio(eigenvalues, 2.0, 0.5), [np.nan, 1.25, 1.0, 6.5 / 6, 2.6], rtol=1e-15
    )
    kinds = ["rigid", "overdamped", "critical", "overdamped", "overdamped"]
    assert classify_regimes(eigenvalues, 2.0, 0.5) == kinds
    assert classify_regimes([0.0, 1.0], 0.0, 0.0) == ["rigid", "underdamped"]


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 0.0), (1.5, 2e-3), (0.0, 0.2), (30.0, 0.0)])
def test_response_of_a_mesh_equals_the_matrix_exponential(fixed, alpha, beta):
    # M ü + C u̇ + K u = f, from an initial displacement and velocity: the sum over all modes
    # against the exponential of the unreduced first-order system, u, u̇ and 1 being its states.
    points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 0.3), (2, 2, 1))
    K, M = stiffness_and_mass(points, tetrahedra, isotropic(3e3, 0.3), 300.0)
    held = points[:, 1] == 1 if fixed else np.zeros(len(points), bool)
    free = np.repeat(~held, 3)
    eigenvalues, shapes = solve_matrices(K, M, free, free.sum())
    S = shapes.reshape(len(shapes), -1)[:, free].T
    K, M = (matrix[free][:, free].toarray() for matrix in (K, M))

    rng = np.random.default_rng(0)
    force = M @ np.tile([0.5, 0.0, -9.81], len(K) // 3) + rng.standard_normal(len(K))
    u, v = 0.1 * rng.standard_normal((2, len(K)))
    n = len(K)
    system = np.zeros((2 * n + 1,) * 2)
    system[:n, n : 2 * n] = np.eye(n)
    system[n : 2 * n] = la.solve(M, np.c_[-K, -(alpha * M + beta * K), force], assume_a="pos")
    for time in (1e-3, 0.2, 3.0):
        state = la.expm(time * system) @ np.r_[u, v, 1.0]
        r = kernels_of(eigenvalues, alpha, beta, time)
        q, rate, load = S.T @ M @ u, S.T @ M @ v, S.T @ force
        end = S @ (r.free * q + r.impulse * rate + r.step * load)
        end_rate = S @ (r.free_rate * q + r.impulse_rate * rate + r.impulse * load)
        np.testing.assert_allclose(end, state[:n], atol=1e-9 * abs(state[:n]).max())
        np.testing.assert_allclose(end_rate, state[n:-1], atol=1e-9 * abs(state[n:-1]).max())


@pytest.mark.parametrize("name", ["eigenvalues", "alpha", "beta"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_invalid_oscillators_are_refused(name, value):
    values = {"eigenvalues": [1.0], "alpha": 0.0, "beta": 0.0}
    for asked in (damping_ratio, classify_regimes):
        with pytest.raises(InputError, match=name):
            asked(**{**values, name: value})


def test_kernels_accept_many_times():
    eigenvalues, times = np.array([0.0, 1.0, 30.0]), np.array([[0.0], [0.1], [2.0]])
    together = kernels_of(eigenvalues, 3.0, 0.0, times)
    for k, time in enumerate(times[:, 0]):
        alone = kernels_of(eigenvalues, 3.0, 0.0, time)
        np.testing.assert_array_equal([x[k] for x in together], alone)


def test_kernels_equal_equation_20():
    # Underdamped, by the book: x = e^(-μt) (cos ωt + μ/ω sin ωt), μ = (α + βλ)/2, ω = √(λ - μ²).
    eigenvalue, alpha, beta, time = 50.0, 0.4, 0.01, 1.7
    mu = (alpha + beta * eigenvalue) / 2
    omega = math.sqrt(eigenvalue - mu * mu)
    sine, cosine = math.sin(omega * time), math.cos(omega * time)
    r = kernels_of([eigenvalue], alpha, beta, time)
    decay = math.exp(-mu * time)
    assert r.free[0] == pytest.approx(decay * (cosine + mu / omega * sine), rel=1e-12)
    assert r.impulse[0] == pytest.approx(decay * sine / omega, rel=1e-12)
    assert r.step[0] == pytest.approx((1 - r.free[0]) / eigenvalue, rel=1e-12)
