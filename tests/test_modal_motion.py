"""ModalMotion under loads with time functions, against integration of the equations step by step.

The list of scenarios is that of CalculiX's own tests of modal dynamics, beamdy1 to beamdy20: step,
piecewise linear, base motion, harmonic (steady and from rest), periodic, direct modal damping.
"""

from __future__ import annotations

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary import time_functions as tf
from spacemap_vtk.mechanics.response.harmonic import receptance, response_from_rest
from spacemap_vtk.mechanics.response.modal_motion import ModalLoad, ModalMotion

#: Rigid, slow, two near each other, and fast; free of damping to far overdamped.
STIFFNESS = np.array([0.0, 0.3, 40.0, 40.5, 900.0])
GAIN = np.array([0.7, -1.0, 2.0, 0.5, 1.5])
DAMPING = {
    "none": np.zeros(5),
    "alpha": np.full(5, 0.4),
    "ratio": 0.03 * np.sqrt(STIFFNESS),
    "mixed": np.array([0.0, 0.6, 40.0**0.5, 30.0, 20.0]),
}
#: The extremes; what lies between them is damped alike.
DAMPED = [
    pytest.param(name, marks=[pytest.mark.nightly] * (name in ("alpha", "ratio")))
    for name in DAMPING
]
FUNCTIONS = {
    "step": tf.step(),
    "late step": tf.step(0.35),
    "pulse": tf.table([0, 0.4, 0.4], [1, 1, 0], 0.1),
    "ramp": tf.table([0, 0.5], [0, 1], 0.2),
    "table": tf.table([0.0, 0.2, 0.2, 0.9, 1.4], [0.0, 1.0, -0.5, 0.3, 0.0]),
    "late table": tf.table([0.3, 0.9], [0.4, 1.0], 0.1),
    "sine": tf.harmonic(0.8),
    "cosine": tf.harmonic(1.3, math.pi / 2),
    "resonance": tf.harmonic(math.sqrt(40.0) / (2 * math.pi), 0.3),
    "periodic": tf.periodic([0.0, 0.1, 0.1, 0.3], [0.2, 1.0, -1.0, 0.1]),
    "saw": tf.periodic([0.0, 0.25], [0.0, 1.0]),
}
TIMES = (0.0, 0.05, 0.2, 0.35, 0.77, 1.4, 2.1)


def break_times(function, end):
    """Return the times up to `end` where a function is not smooth."""
    if isinstance(function, tf.Sine):
        return []
    if function.period is None:
        return [t for t in function.times if t < end]
    count = math.ceil(end / function.period)
    marks = [k * function.period + t for k in range(count) for t in function.times]
    return [t for t in marks if t < end]


def integrate(half, drives, start, times, held=False):
    """Yield q and q̇ at each of `times` by an explicit method of order 8, from break to break.

    A moving base is integrated in absolute coordinates: x = q + Γ d is driven by the spring and
    the damper between it and the base.
    """
    forces = [(d.gain, d.function) for d in drives if not d.moves_base]
    bases = [(d.gain, d.function) for d in drives if d.moves_base]
    found = {0.0, *times, *(t for d in drives for t in break_times(d.function, max(times)))}
    # Marks that differ by rounding are one, and what is asked for is asked for as it is.
    marks = [a for a in sorted(found) if a in times or not any(0 < b - a < 1e-12 for b in found)]
    state = np.concatenate(start)
    n = len(half)
    values = [held * f.value(0.0) for _, f in bases]  # of the bases' displacements, just before
    for begin, finish in itertools.pairwise([*marks, math.inf]):
        if begin in times:
            q, v = state[:n], state[n:]
            for k, (gain, function) in enumerate(bases):
                v = v + 2 * half * gain * (function.value(begin) - values[k])
                q = q - gain * function.value(begin)
                v = v - gain * function.slope(begin)
            yield q, v
        if finish == math.inf:
            return
        # Linear pieces by their ends, so that no evaluation falls on the wrong side of a jump.
        middle = (begin + finish) / 2

        # Where the base jumps, its dampers pull once.
        for k, (gain, function) in enumerate(bases):
            state[n:] += 2 * half * gain * (function.value(begin) - values[k])

        def factor(function, t, middle=middle):
            if isinstance(function, tf.Sine):
                return function.value(t), function.slope(t)
            slope = function.slope(middle)
            return function.value(middle) + slope * (t - middle), slope

        def rate(t, y, factor=factor):
            q, v = y[:n].copy(), y[n:].copy()
            load = np.zeros(n)
            for gain, function in forces:
                load += gain * factor(function, t)[0]
            for gain, function in bases:
                value, slope = factor(function, t)
                q -= gain * value
                v -= gain * slope
            return np.concatenate([y[n:], load - 2 * half * v - STIFFNESS * q])

        done = solve_ivp(rate, (begin, finish), state, "DOP853", rtol=1e-12, atol=1e-13)
        state = done.y[:, -1]
        values = [factor(function, finish)[0] for _, function in bases]


def check_against_integration(half, drives, times=TIMES, start=None, **options):
    motion = ModalMotion(STIFFNESS, half, drives, **options)
    before = motion.start if start is None else start
    for time, (q, v) in zip(times, integrate(half, drives, before, times), strict=True):
        got = motion.at_time(time)
        scale = max(abs(q).max(), 1.0)
        np.testing.assert_allclose(got.position, q, atol=1e-9 * scale)
        np.testing.assert_allclose(got.rate, v, atol=3e-8 * scale)
        load = motion.load(time)
        balance = got.acceleration + 2 * half * got.rate + STIFFNESS * got.position
        np.testing.assert_allclose(balance, load, atol=1e-9)


@pytest.mark.parametrize(
    "damping",
    [pytest.param(each, marks=[pytest.mark.nightly] * (each != "mixed")) for each in DAMPING],
)
@pytest.mark.parametrize("function", FUNCTIONS)
def test_response_to_one_force_equals_numerical_integration(function, damping):
    check_against_integration(DAMPING[damping], [ModalLoad(GAIN, FUNCTIONS[function])])


@pytest.mark.parametrize(
    "damping",
    [pytest.param(each, marks=[pytest.mark.nightly] * (each != "mixed")) for each in DAMPING],
)
@pytest.mark.parametrize("function", FUNCTIONS)
def test_response_to_a_moving_base_equals_numerical_integration(function, damping):
    check_against_integration(
        DAMPING[damping], [ModalLoad(GAIN, FUNCTIONS[function], True)], TIMES[1:]
    )


def test_all_loads_from_a_given_state_superpose():
    drives = [
        ModalLoad(np.roll(GAIN, k), function, k % 3 == 0)
        for k, function in enumerate(FUNCTIONS.values())
    ]
    given = {"position": 0.1 * GAIN, "rate": -GAIN}
    check_against_integration(DAMPING["ratio"], drives, TIMES[1:], **given)


@pytest.mark.parametrize("base", [False, True])
@pytest.mark.parametrize("function", FUNCTIONS)
def test_initial_state_is_at_rest_before_zero(function, base):
    drives = [ModalLoad(GAIN, FUNCTIONS[function], base)]
    motion = ModalMotion(STIFFNESS, DAMPING["alpha"], drives, position=GAIN, rate=-GAIN)
    first, later = motion.at_time(-0.2), motion.at_time(-0.1)
    np.testing.assert_array_equal(first.position, motion.at_time(0.0).position)
    for state in (first, later):
        # the derivatives of a displacement that is the same at all times before 0
        np.testing.assert_array_equal(state.rate, (later.position - first.position) / 0.1)
        assert not state.acceleration.any()


def test_equilibrium_is_at_rest_until_loads_change():
    gain = GAIN * (STIFFNESS > 0)
    weight, held = (
        ModalLoad(gain, tf.step()),
        ModalLoad(np.roll(gain, 1) * (STIFFNESS > 0), tf.table([0, 0.5, 0.5], [1, 1, 0])),
    )
    half = DAMPING["alpha"]
    motion = ModalMotion(STIFFNESS, half, [weight, held], equilibrium=True)
    for time in (0.0, 0.2, 0.4999):
        state = motion.at_time(time)
        np.testing.assert_allclose(state.position, motion.start[0], atol=1e-14)
        np.testing.assert_allclose(state.rate, 0, atol=1e-13)
    check_against_integration(half, [weight, held], (0.5, 0.9, 2.0), equilibrium=True)
    with pytest.raises(InputError, match="1 rigid modes are free to fall"):
        ModalMotion(STIFFNESS, half, [ModalLoad(GAIN, tf.step())], equilibrium=True)


def test_base_starts_smoothly_from_equilibrium():
    # The base rests at its first displacement until t = 0, and starts to move from there.
    drive = ModalLoad(GAIN, tf.table([0.0, 0.5], [1.0, 2.0]), True)
    motion = ModalMotion(STIFFNESS, DAMPING["alpha"], [drive], equilibrium=True)
    absolute = GAIN * 1.0, np.zeros(5)
    times = (0.2, 0.9)
    found = integrate(DAMPING["alpha"], [drive], absolute, times, held=True)
    for time, (q, v) in zip(times, found, strict=True):
        np.testing.assert_allclose(motion.at_time(time).position, q, atol=1e-9)
        np.testing.assert_allclose(motion.at_time(time).rate, v, atol=1e-8)


@pytest.mark.parametrize("base", [False, True])
@pytest.mark.parametrize("name", ["sine", "cosine"])
def test_steady_state_of_a_sine_is_the_limit_of_the_response(name, base):
    half = np.full(5, 2.0)
    function = FUNCTIONS[name]
    gain = GAIN * (STIFFNESS > 0)
    rested = ModalMotion(STIFFNESS, half, [ModalLoad(gain, function, base)])
    settled = ModalMotion(STIFFNESS, half, [ModalLoad(gain, function._replace(steady=True), base)])
    late = 1000.0  # whole periods of both
    np.testing.assert_allclose(
        rested.at_time(late).position, settled.at_time(0.0).position, atol=1e-12
    )
    np.testing.assert_allclose(
        rested.at_time(late + 0.1).rate, settled.at_time(0.1).rate, atol=1e-11
    )
    assert settled.at_time(0.3).position[1:].all()
    # One degree of freedom, by the book.
    ratio = function.omega / math.sqrt(40.0)
    zeta = 2.0 / math.sqrt(40.0)
    amplitude = gain[2] / 40.0 / math.hypot(1 - ratio**2, 2 * zeta * ratio)
    times = np.linspace(0, 2 * math.pi / function.omega, 400)
    most = max(abs(settled.at_time(t).position[2]) for t in times)
    assert most == pytest.approx(amplitude * (function.omega**2 if base else 1), rel=1e-4)


@pytest.mark.parametrize("base", [False, True])
@pytest.mark.parametrize("name", ["periodic", "saw"])
def test_steady_state_of_a_periodic_load_repeats(name, base):
    half = np.full(5, 2.0)
    function = FUNCTIONS[name]
    gain = GAIN * (STIFFNESS > 0)
    settled = ModalMotion(STIFFNESS, half, [ModalLoad(gain, function._replace(steady=True), base)])
    rested = ModalMotion(STIFFNESS, half, [ModalLoad(gain, function, base)])
    for time in (0.0, 0.07, 0.11):
        now, later = settled.at_time(time), settled.at_time(time + 7 * function.period)
        np.testing.assert_allclose(now.position, later.position, atol=1e-13)
        np.testing.assert_allclose(now.rate, later.rate, atol=1e-12)
        much_later = rested.at_time(time + 4000 * function.period)
        np.testing.assert_allclose(now.position, much_later.position, atol=1e-11)


def test_resonance_without_damping_has_no_steady_state():
    stiffness, half = np.array([(2 * math.pi) ** 2]), np.zeros(1)
    with pytest.raises(InputError, match="no steady state"):
        receptance(stiffness, half, 2 * math.pi)
    saw = tf.periodic([0.0, 2.0], [0.0, 1.0], steady=True)
    with pytest.raises(InputError, match="mode 1 has no steady state"):
        ModalMotion(stiffness, half, [ModalLoad(np.ones(1), saw)])
    # From rest both grow linearly: x = t / 2Ω for the sine.
    at = 1000.25
    grown = ModalMotion(stiffness, half, [ModalLoad(np.ones(1), tf.harmonic(1.0))]).at_time(at)
    # x = (sin Ωt - Ωt cos Ωt) / 2Ω², and at a quarter turn the cosine is zero.
    assert grown.position[0] == pytest.approx(1 / (8 * math.pi**2), abs=1e-12 * at)
    cosine = ModalMotion(
        stiffness, half, [ModalLoad(np.ones(1), tf.harmonic(1.0, math.pi / 2))]
    ).at_time(at)
    assert cosine.position[0] == pytest.approx(at / (4 * math.pi), rel=1e-10)
    forced = ModalMotion(stiffness, half, [ModalLoad(np.ones(1), saw._replace(steady=False))])
    assert abs(forced.at_time(2000.0).rate[0]) > 100 * abs(forced.at_time(2.0).rate[0])


def test_late_times_of_a_periodic_load_need_few_sums():
    drive = ModalLoad(np.ones(5), FUNCTIONS["periodic"])
    motion = ModalMotion(STIFFNESS, DAMPING["ratio"], [drive])
    late = motion.at_time(3e5)
    assert np.isfinite(late.position).all()
    assert len(motion.repeated[0].sums) <= 21  # of a million periods


def test_restarted_table_gives_the_same_state():
    table = tf.table([0.0, 0.2, 0.2, 0.9, 1.4], [0.0, 1.0, -0.5, 0.3, 0.0])
    rest = tf.table([0.0, 0.4, 0.9], [float(table.value(0.5)), 0.3, 0.0])
    half = DAMPING["mixed"]
    whole = ModalMotion(STIFFNESS, half, [ModalLoad(GAIN, table)])
    state = whole.at_time(0.5)
    parts = {"position": state.position, "rate": state.rate}
    again = ModalMotion(STIFFNESS, half, [ModalLoad(GAIN, rest)], **parts)
    for time in (0.0, 0.3, 2.0):
        got, expected = again.at_time(time), whole.at_time(0.5 + time)
        np.testing.assert_allclose(got.position, expected.position, atol=1e-10)
        np.testing.assert_allclose(got.rate, expected.rate, atol=1e-10)


@settings(derandomize=True)
@given(
    st.one_of(st.just(0.0), st.floats(-8, 6).map(lambda x: 10.0**x)),
    st.one_of(st.just(0.0), st.floats(-6, 3).map(lambda x: 10.0**x)),
    st.floats(-3, 3).map(lambda x: 10.0**x),
    st.floats(-6, 2).map(lambda x: 10.0**x),
    st.sampled_from([0.0, 1e-12, -1e-9, 1e-6, -1e-3, 0.1]),
)
def test_sine_from_rest_equals_mpmath(eigenvalue, ratio, omega, time, detuning):
    if detuning:  # on and around resonance
        omega = math.sqrt(eigenvalue) * (1 + detuning) or 1.0
    half = ratio * math.sqrt(eigenvalue)
    got = response_from_rest(*np.array([[eigenvalue], [half]]), omega, time)
    with mp.workdps(60):
        lam, h, w, t = (mp.mpf(float(x)) for x in (eigenvalue, half, omega, time))
        system = mp.matrix([[0, 1, 0], [-lam, -2 * h, 1], [0, 0, 1j * w]]) * t
        squarings = int(mp.ceil(mp.log(max(mp.norm(system, 1), 1), 2))) + 8
        with mp.workdps(60 + squarings):
            small = system / mp.mpf(2) ** squarings
            power = result = mp.eye(3)
            for k in range(1, 34):
                power = power * small / k
                result = result + power
            for _ in range(squarings):
                result = result * result
        x, v = complex(result[0, 2]), complex(result[1, 2])
    root = max(math.sqrt(eigenvalue), half)
    short = time if root * time < 1 else 1 / root
    phase = (math.sqrt(eigenvalue) + omega) * time
    bound = 1e-10 + 1e-15 * phase
    # The most that each can come to: X = ∫ S e^{pt}, its rate ∫ Ṡ e^{pt}.
    assert abs(got.value[0] - x) <= bound * max(min(time * short, time * time / 2), abs(x))
    assert abs(got.rate[0] - v) <= bound * max(time, abs(v))


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf, 1e200])
def test_non_finite_time_is_refused(time):
    motion = ModalMotion(STIFFNESS, DAMPING["alpha"], [ModalLoad(GAIN, FUNCTIONS["step"])])
    with pytest.raises(InputError, match=r"time = .*a finite number of seconds"):
        motion.at_time(time)
