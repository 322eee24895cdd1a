"""Energy of a crossing whose yarns exchange crimp, and its minimum, for many crossings at once.

The unknowns are Peirce's two angles. The energy is smooth in them, also at jams, where a height is
below its maximum by the square of the amount by which its angle is. Heights and D, twice the
distance of the axes, follow in closed form and are linear in the rooms p. The two arcs of a gap
have radii with the sum k D: k is 1 for round yarns and larger where a lens is crossed. With S and C
for sine and cosine, r = 1 - C,

    m = C1 C2 + k1 r1 C2 + k2 r2 C1,  e1 = (1 - k1) C2 + k2 r2
    D = (p1 S1 C2 + p2 S2 C1) / m,  s1 = (p1 - k1 D S1) / C1,  h1 = k1 D r1 + s1 S1
    l1 = k1 D theta1 + s1

and the same with 1 and 2 exchanged. With w = s / m,

    dD = w1 C2 dtheta1 + w2 C1 dtheta2
    dl1 = w1 (k1 theta1 C2 + S1 e1) dtheta1 + w2 k1 (theta1 C1 - S1) dtheta2
    ds1 = (S1 e1 w1 - k1 D) dtheta1 - k1 S1 w2 dtheta2
    m dw1 = (2 S1 e1 w1 - k1 D) dtheta1 + (e2 S2 w1 - k1 S1 w2) dtheta2

Arrays have the families first, (2, n): the gap of the warp over picks, that of the weft over ends.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.textile.crimp.contact_law import ContactLaw
from spacemap_vtk.textile.weave.peirce import jam_height, solve_gaps

Arrays = TypeVar("Arrays", bound=tuple[Any, ...])

#: Remaining distance at which Newton's method stops, as a share of D.
_TOLERANCE = 1e-10
#: Movement that is assumed to precede its first step, as a share of D.
_FIRST_MOVE = 1e-3
#: The last step turns angles by less than this, in rad: near a jam heights hardly change.
_ANGLE_TOLERANCE = 1e-6
#: Largest turn of an angle in one step, in rad.
_MOST_TURN = 0.5
#: Share of the distance to a jam that heights keep: at the jam itself the derivatives of heights
#: and D by the angle vanish.
_JAM_MARGIN = 0.01
#: Angle, in rad, below which a yarn that is pressed towards its other side counts as straight.
_STRAIGHT = 1e-4
#: A straight part shorter than this share of D is too short to divide by.
_SLIVER = 1e-7
#: A yarn with a straight part shorter than this share of D counts as jammed, because Newton's
#: method stops just before the jam.
_JAMMED = 1e-5
#: Share of D within which D is at its bound.
_EQUAL = 1e-12
#: Added to a divisor, or used as its least value, so that it is not 0.
_TINY = 1e-150


def select_crossings(arrays: Arrays, which: NDArray) -> Arrays:
    """Select some of the crossings."""
    return type(arrays)(*(array.take(which, axis=-1) for array in arrays))


class CrimpEnergy(NamedTuple):
    """Coefficients of the energy of crossings."""

    # The energy is 1/2 tension (l - length)**2 for each yarn whose axis is longer than the yarn,
    # contact full**2 u(D / full), and hinge (theta - rest)**2 / D for each yarn. Without a law of
    # the contact, u is (D / full - 1)**2 / 2.

    tension: Floats
    """(2, n) EA over the yarn's length, in N/m."""
    contact: Floats
    """(n,) Stiffness of the contact, in N/m."""
    hinge: Floats
    """(2, n) Half of D times the bending stiffness of an angle at rest, in N m2."""
    rest: Floats
    """(2, n) Angles at rest."""
    full: Floats
    """(n,) D at rest."""
    arcs: Floats
    """(2, n) Sum of the radii of a gap's arcs over D."""
    law: ContactLaw = ContactLaw()
    """Function u of the contact."""

    def push(self, distance: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute the energy of the contact, and its two derivatives by D."""
        if type(self.law) is ContactLaw:
            squash = distance - self.full
            push = self.contact * squash
            return 0.5 * push * squash, push, self.contact
        value, slope, bend = self.law.evaluate(distance / self.full)
        force = self.contact * self.full
        return force * self.full * value, force * slope, self.contact * bend

    def without_pull(
        self, theta: Floats, distance: Floats
    ) -> tuple[Floats, Floats, Floats, Floats | float]:
        """Compute energy without the yarns' pull, two derivatives by D, and the first by theta."""
        value, push, stiff = self.push(distance)
        if not self.hinge.any():
            return value, push, stiff, 0.0
        bent = theta - self.rest
        moment = 2.0 * self.hinge / distance * bent
        work = moment * bent
        fade = 0.5 * (work[0] + work[1]) / distance
        contact = stiff + 2.0 * fade / distance
        return value + fade * distance, push - fade, contact, moment


class AngleDerivatives(NamedTuple):
    """Energy of crossings and its derivatives by the angles of their yarns."""

    value: Floats
    """(n,) J"""
    theta: Floats
    half: Floats
    straight: Floats
    over: Floats
    """(2, n) Length of the axis less that of the yarn; negative for slack yarns."""
    own: Floats
    """(2, n) Derivative of an axis's length by its own angle."""
    other: Floats
    """(2, n) Derivative of an axis's length by the angle of the other yarn."""
    turn: Floats
    """(2, n) Derivatives of D by the angles."""
    slope: Floats
    """(2, n) Derivatives of the energy less press times D, by the angles."""
    curve: Floats
    """(3, n) Second derivatives of the same: by theta1 twice, by both, by theta2 twice."""

    def add_pull(self, stiff: Floats) -> AngleDerivatives:
        """Add the pull of yarns of a given stiffness; slack yarns push."""
        own, other = stiff * self.own, stiff * self.other
        slope = self.slope + own * self.over + (other * self.over)[::-1]
        square = own * self.own + (other * self.other)[::-1]
        mixed = own * self.other
        curve = self.curve + np.stack([square[0], mixed[0] + mixed[1], square[1]])
        return self._replace(slope=slope, curve=curve)

    def press(self) -> Floats:
        """Compute the derivative of the least energy by D, in N; straight yarns do not count."""
        turn = self.turn * (self.theta > _STRAIGHT)
        return (self.slope * turn).sum(axis=0) / ((turn * turn).sum(axis=0) + _TINY)


def angle_derivatives(
    energy: CrimpEnergy,
    room: Floats,
    length: Floats,
    heights: Floats,
    distance: Floats,
    press: Floats | float = 0.0,
) -> AngleDerivatives:
    """Compute the energy and its derivatives by the angles."""
    # Arrays are reused in place, because allocating new ones costs as much as the arithmetic.
    arcs = energy.arcs
    theta, s, over, sin, cos, half = solve_gaps(room, heights, arcs * distance)
    over -= length
    cross = cos[::-1]
    lift, both = _lift(arcs, cos)
    weight = s / both
    stiff = energy.tension * (over > 0.0)
    force = stiff * over
    value, free, steep, moment = energy.without_pull(theta, distance)
    value += 0.5 * (force[0] * over[0] + force[1] * over[1])
    free = free - press
    aside = lift * sin
    turn, own, other = weight * cross, arcs * theta * cross, theta * cos
    own += aside
    other -= sin
    other *= arcs
    slope = force * own
    slope += (force * other)[::-1]
    slope += free * cross
    mixed = (lift[1] * sin[1] * weight[0] - arcs[0] * sin[0] * weight[1]) / both * slope[0]
    bent = force * arcs * theta
    bent[0] -= force[0] * sin[0] * (arcs[0] + arcs[1] - 1.0)
    mixed -= weight[0] * sin[1] * (bent[0] + bent[1] + free)
    square = aside
    square *= 2.0 * weight
    square -= arcs * distance
    square *= slope / both
    slope *= weight
    own *= weight
    other *= weight[::-1]
    force *= s
    square += force
    by_own, by_other, by_turn = stiff * own, stiff * other, steep * turn
    mixed += by_own[0] * other[0] + by_own[1] * other[1] + by_turn[0] * turn[1]
    by_own *= own
    by_own += (by_other * other)[::-1]
    square += by_own
    if not isinstance(moment, float):
        slope += moment
        fade = moment / distance
        mixed -= fade[0] * turn[1] + fade[1] * turn[0]
        by_turn -= 2.0 * fade
        square += energy.hinge * (2.0 / distance)
    by_turn *= turn
    square += by_turn
    curve = np.stack([square[0], mixed, square[1]])
    return AngleDerivatives(value, theta, half, s, over, own, other, turn, slope, curve)


def _lift(arcs: Floats, cos: Floats) -> tuple[Floats, Floats]:
    """Compute e (2, n) and m (n,) of the module's formulas."""
    bow, cross = arcs * (1.0 - cos), cos[::-1]
    lift = (1.0 - arcs) * cross + bow[::-1]
    return lift, cos[0] * cos[1] + bow[0] * cos[1] + bow[1] * cos[0]


def yarn_forces(
    energy: CrimpEnergy,
    room: Floats,
    length: Floats,
    heights: Floats,
    distance: Floats,
    along: tuple[Floats, Floats],
) -> Floats:
    """Compute the forces, (2, n), as derivatives at given heights, without the push of jams."""
    gap = solve_gaps(room, heights, energy.arcs * distance)
    force = energy.tension * np.maximum(gap.length - length, 0.0)
    moment = energy.without_pull(gap.theta, distance)[-1]
    lean = gap.sin / np.maximum(gap.straight, _SLIVER * distance)
    return force * (gap.cos * along[0] + along[1]) - moment * lean * along[0]


def energy_derivatives(
    energy: CrimpEnergy,
    room: Floats,
    length: Floats,
    heights: Floats,
    distance: Floats,
    along: tuple[Floats, Floats],
    distances: tuple[Floats, Floats],
) -> tuple[Floats, Floats, Floats]:
    """Compute the least energy, (n,), and its derivatives by the stretches, (2, n), (2, 2, n)."""
    # `along` holds d(room) and -d(length) by the stretch: spacing and floats of each yarn.
    low, high = distances
    little = 1e-9 * energy.tension.max(axis=0) * energy.full
    now = angle_derivatives(energy, room, length, heights, distance)
    # Push of a jam into which bending turns a yarn.
    jammed = (now.straight < _JAMMED * distance) & (now.slope < -little)
    push = np.where(jammed, -now.slope / (energy.arcs * distance), 0.0)
    turned = (push * energy.arcs * np.tan(now.theta))[::-1] * now.turn
    press = now._replace(slope=np.where(jammed, 0.0, now.slope) + turned).press()
    # Where D is pressed against a bound it does not follow the stretch. At rest nothing presses,
    # and D follows everywhere.
    firm = ((distance <= low) & (press > little)) | ((distance >= high) & (press < -little))
    firm |= low >= high
    press = np.where(firm, press, 0.0)
    now = angle_derivatives(energy, room, length, heights, distance, press)
    # A yarn that is neither slack nor strained counts as pulling: then the stiffness at rest is
    # that of a cloth under tension.
    pull = energy.tension * (now.over >= -1e-12 * length)
    now = now.add_pull(pull * (now.over <= 0.0))
    force = pull * np.maximum(now.over, 0.0)
    _, free, steep, moment = energy.without_pull(now.theta, distance)
    free = free - press
    # At given angles lengths are linear in the rooms. Arrays are (2, stretches, n), and each
    # stretch changes the room of one yarn.
    theta, sin, cos = (one[:, None] for one in (now.theta, np.sin(now.theta), np.cos(now.theta)))
    arcs, cross = energy.arcs[:, None], cos[::-1]
    lift, both = _lift(arcs, cos)
    rooms, more = np.zeros((2, *room.shape)), np.zeros((2, *room.shape))
    rooms[[0, 1], [0, 1]], more[[0, 1], [0, 1]] = along
    rise = rooms * sin
    wider = (rise * cross).sum(axis=0) / both
    straight = rooms * (lift + arcs * cos * cross) - arcs * sin * rise[::-1]
    straight /= both
    weight = straight / both
    longer = arcs * wider * theta + straight + more
    force = force[:, None]
    slope = (force * longer - push[:, None] * straight).sum(axis=0) + free * wider
    tangent = np.einsum("in,ikn,iln->kln", pull, longer, longer) + steep * wider * wider[:, None]
    mixed = weight * (force * (arcs * theta * cross + lift * sin) + free * cross)
    mixed += weight * (force * arcs * (theta * cos - sin))[::-1]
    mixed += (pull * now.own)[:, None] * longer + ((pull * now.other)[:, None] * longer)[::-1]
    mixed += (steep * now.turn - moment / distance)[:, None] * wider
    # The angles follow the stretch, except those of straight yarns that are pressed. D stays where
    # it is held. Jams into which bending turns a yarn follow by their angles only, without the
    # effect of the room on bending.
    loose = (now.theta > _STRAIGHT) | (now.slope < little)
    a, b, c = now.curve * np.stack([loose[0], loose[0] & loose[1], loose[1]])
    scale = firm * (np.abs(a) + np.abs(c)) / np.maximum(np.abs(now.turn).max(axis=0), _TINY)
    turn = scale * loose * now.turn
    system = np.array([[a, b, turn[0]], [b, c, turn[1]], [turn[0], turn[1], np.zeros_like(a)]])
    sides = np.concatenate([loose[:, None] * mixed, scale * wider[None]])
    # The pseudo-inverse leaves directions alone that nothing resists.
    inverse = np.linalg.pinv(system.transpose(2, 0, 1), 1e-13, True)
    tangent -= np.einsum("ikn,nij,jln->kln", sides, inverse, sides)
    return now.value, slope, tangent


class _NewtonState(NamedTuple):
    """State of the crossings, and Newton's step from it."""

    heights: Floats
    distance: Floats
    top: Floats
    """(2, n) Heights at which yarns jam at that distance."""
    value: Floats
    half: Floats
    turn: Floats
    step: Floats
    """(2, n) Step of the angles."""
    press: Floats
    """(n,) Force that presses D against its bound, in N; negative at the upper bound."""
    first: Bools
    """(n,) Whether the warp's angle leads and the weft's follows; D depends less on the leader."""
    part: Floats
    """(n,) Share of the step to be tried."""
    moves: Floats
    """(n,) Larger of the changes of h1 and D that led to this state."""


def minimise_energy(
    energy: CrimpEnergy,
    room: Floats,
    length: Floats,
    height: Floats,
    distance: Floats,
    low: Floats,
    high: Floats,
) -> tuple[Floats, Floats]:
    """Find h1 and D of the least energy by Newton's method, D within its bounds."""
    result = np.empty((2, len(low)))
    live: Ints = np.arange(len(low))
    noise = 1e-18 * (energy.tension * length**2 + energy.hinge / energy.full).sum(axis=0)
    d = np.clip(distance, low, high)
    top = jam_height(room, energy.arcs * d)
    # Where both yarns are jammed, only a smaller D makes room.
    if (tight := top[0] + top[1] < 1.001 * d).any():
        d = np.where(tight, d - 0.1 * (d - low), d)
        top = jam_height(room, energy.arcs * d)
    inside = _JAM_MARGIN * (top[0] + top[1] - d)
    h = np.clip(height, d - top[1] + inside, top[0] - inside)
    heights, press, state, moves = np.stack([h, d - h]), np.zeros_like(d), None, _FIRST_MOVE * d
    for _ in range(100):
        now = angle_derivatives(energy, room, length, heights, d, press)
        step, press, first, over = _newton_step(energy, now, d, press, low, high)
        part = np.ones_like(d) if state is None else np.minimum(3.0 * state.part, 1.0)
        trial = _NewtonState(
            heights, d, top, now.value, now.half, now.turn, step, press, first, part, moves
        )
        if state is not None:
            worse = np.flatnonzero(~(trial.value <= state.value * (1.0 + 1e-12) + noise))
            if len(worse):
                for new, old in zip(trial, state, strict=True):
                    new[..., worse] = old[..., worse]
                part[worse] /= 3.0
        state = trial
        heights, d, top = _apply_step(room, energy.arcs, state, low, high)
        moves = np.maximum(np.abs(heights[0] - state.heights[0]), np.abs(d - state.distance))
        # Steps that keep shrinking at the rate of this one would move less than the tolerance.
        done = (moves * moves <= _TOLERANCE * d * state.moves) & (part > 0.9)
        done &= np.maximum(np.abs(step[0]), np.abs(step[1])) < _ANGLE_TOLERANCE
        # The step must not make a taut yarn slack.
        done &= ((now.over <= 0.0) | (over > -_EQUAL * d)).all(axis=0)
        if 8 * np.count_nonzero(done) > len(done):
            for bound in (low, high):  # D is at a bound up to rounding
                d = np.where(np.abs(d - bound) < _EQUAL * bound, bound, d)
            result[:, live[done]] = heights[0, done], d[done]
            on = np.flatnonzero(~done)
            if not len(on):
                return result[0], result[1]
            energy, state = select_crossings(energy, on), select_crossings(state, on)
            live = live[on]
            room, length, heights, top, d, low, high, press, moves, noise = (
                one.take(on, axis=-1)
                for one in (room, length, heights, top, d, low, high, press, moves, noise)
            )
    result[:, live] = heights[0], d
    return result[0], result[1]


def _newton_step(
    energy: CrimpEnergy, now: AngleDerivatives, d: Floats, press: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats, Bools, Floats]:
    """Compute Newton's step, the press on D, whether the warp leads, and `over` after the step."""
    taut = now.over > 0.0
    step, press, first, over = _bounded_step(energy.arcs, now, d, press, low, high)
    # A yarn that becomes taut in the step counts as taut from the start of the step.
    new = (over > 0.0) > taut
    for _ in range(2):
        which = np.flatnonzero(new[0] | new[1])
        if not len(which):
            break
        taut[:, which] |= new[:, which]
        arguments = (one.take(which, axis=-1) for one in (d, press, low, high))
        pushed = select_crossings(now, which).add_pull(
            energy.tension[:, which] * (taut & (now.over <= 0.0))[:, which]
        )
        found = _bounded_step(energy.arcs[:, which], pushed, *arguments)
        step[:, which], press[which], first[which], over[:, which] = found
        new = (over > 0.0) > taut
    size = np.maximum(np.abs(step[0]), np.abs(step[1]))
    return step * (_MOST_TURN / np.maximum(size, _MOST_TURN)), press, first, over


def _bounded_step(
    arcs: Floats, now: AngleDerivatives, d: Floats, press: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats, Bools, Floats]:
    """Compute the results of `_newton_step` for yarns that stay as taut or slack as they are."""
    (a, b, c), slope, turn = now.curve, now.slope, now.turn
    # At a saddle, use the curvatures by size; otherwise the step would climb.
    saddle = np.flatnonzero(~((a > 0.0) & (a * c * (1.0 - 1e-10) > b * b)))
    if len(saddle):
        a, b, c = np.stack([a, b, c])
        a[saddle], b[saddle], c[saddle] = _positive_matrix(a[saddle], b[saddle], c[saddle])
    across = np.stack([c, a])
    by = 1.0 / (a * c - b * b)
    yielding = (across * turn - b * turn[::-1]) * by
    # `slope` contains the previous press. It is removed to see whether D is still pressed.
    step = (b * slope[::-1] - across * slope) * by - press * yielding
    to = d + turn[0] * step[0] + turn[1] * step[1]
    off = np.minimum(np.maximum(to, low), high) - to
    more = off / np.maximum(turn[0] * yielding[0] + turn[1] * yielding[1], _TINY)
    step += more * yielding
    first = np.abs(turn[0]) <= np.abs(turn[1])
    # The step may take a yarn past a jam, or past being straight.
    size, (s1, s2) = np.maximum(np.abs(step[0]), np.abs(step[1])), now.straight
    near = np.minimum(s1, s2) < size * (d + s1 + s2)
    ends = np.flatnonzero(near | (np.minimum(now.theta[0], now.theta[1]) < size))
    if len(ends):
        arguments = (
            one.take(ends, axis=-1) for one in (np.stack([a, b, c]), step, d, press, low, high)
        )
        past, *found = _end_step_at_limit(arcs[:, ends], select_crossings(now, ends), *arguments)
        for array, value in zip((step, more, first), found, strict=True):
            array[..., ends[past]] = value[..., past]
    return step, more, first, now.over + now.own * step + now.other * step[::-1]


def _end_step_at_limit(
    arcs: Floats,
    now: AngleDerivatives,
    curve: Floats,
    step: Floats,
    d: Floats,
    press: Floats,
    low: Floats,
    high: Floats,
) -> tuple[Bools, Floats, Floats, Bools]:
    """Check whether a step passes a jam or a straight yarn; compute the step that ends there."""
    turn, sin = now.turn, np.sin(now.theta)
    lift, both = _lift(arcs, np.cos(now.theta))
    weight = now.straight / both
    # Derivatives of a straight part by the angle of its own yarn and of the other one.
    own, other = sin * lift * weight - arcs * d, -arcs * sin * weight[::-1]
    jammed = -(now.straight + own * step + other * step[::-1]) / d
    over = np.maximum(jammed, -now.theta - step)
    warp, jams = over[0] > over[1], jammed >= over
    mine, jam = np.stack([warp, ~warp]), np.where(warp, jams[0], jams[1])
    left = np.where(jam, now.straight, now.theta)
    change = mine * np.where(jam, own, 1.0) + (mine * np.where(jam, other, 0.0))[::-1]
    way = -np.where(warp, left[0], left[1]) / (change * change).sum(axis=0) * change
    # Direction in which the yarn stays jammed, or straight.
    aside = np.stack([change[1], -change[0]])
    (a, b, c), (u, v) = curve, aside
    slope = now.slope + press * turn
    slope += np.stack([a * way[0] + b * way[1], b * way[0] + c * way[1]])
    pull, stiff = (aside * slope).sum(axis=0), a * u * u + 2.0 * b * u * v + c * v * v
    lean = (aside * turn).sum(axis=0)
    to = d + (turn * way).sum(axis=0) - pull / stiff * lean
    off = np.clip(to, low, high) - to
    free = (off == 0.0) | (lean == 0.0)
    far = np.where(free, 0.0, off / np.where(free, 1.0, lean))
    press = np.where(free, 0.0, far * stiff / np.where(free, 1.0, lean))
    first = np.where(jam, np.abs(turn[0]) <= np.abs(turn[1]), warp)
    return over.max(axis=0) > 0.0, way + (far - pull / stiff) * aside, press, first


def _positive_matrix(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
    """Replace the eigenvalues of matrices [[a, b], [b, c]] by their sizes, none of them 0."""
    root = np.maximum(np.abs(a * c - b * b), 1e-12 * (a + c) ** 2 + _TINY**2)
    trace = np.sqrt(a * a + 2.0 * b * b + c * c + 2.0 * root)
    return (a * a + b * b + root) / trace, b * (a + c) / trace, (c * c + b * b + root) / trace


def _apply_step(
    room: Floats, arcs: Floats, state: _NewtonState, low: Floats, high: Floats
) -> tuple[Floats, Floats, Floats]:
    """Compute heights, D and jam heights after a step; D and the leading angle decide."""
    step = state.part * state.step
    d = state.distance + state.turn[0] * step[0] + state.turn[1] * step[1]
    d = np.minimum(np.maximum(d, low), high)
    top = jam_height(room, arcs * d)
    most = top - _JAM_MARGIN * np.maximum(state.top - state.heights, 0.0)
    p, t, half, arc = (
        np.where(state.first, one[0], one[1]) for one in (room, state.half, 0.5 * step, arcs * d)
    )
    few, many = np.minimum(p, arc), np.maximum(p, arc)
    last = few / (many + np.sqrt((many - few) * (many + few)))
    t = np.minimum(np.maximum((t + half) / (1.0 - t * half), 0.0), np.minimum(last, 1.0 - 1e-9))
    h = 2.0 * t * (p - arc * t) / (1.0 - t * t)
    h = np.where(state.first, h, d - h)
    h = np.minimum(np.maximum(np.minimum(h, most[0]), np.maximum(d - most[1], 0.0)), d)
    return np.stack([h, d - h]), d, top
