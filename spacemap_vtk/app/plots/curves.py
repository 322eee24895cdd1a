"""Compute the curves of the plots in small steps, as background work of the engine."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.app.view.pick import Point
from spacemap_vtk.datasets.arrays import array_of, points_of, tetrahedra_of
from spacemap_vtk.datasets.modal_model import ModesReader
from spacemap_vtk.draw.figure.plots import (
    NO_FREQUENCY_RESPONSE,
    NUDGE,
    frequencies_near,
    most_moving_vertex,
)
from spacemap_vtk.draw.figure.reaction_plot import (
    ReactionCurves,
    reactions_in_time,
    reactions_on_path,
)
from spacemap_vtk.embedding.interpolation import point_weights
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.mechanics.modal.resolution import mode_errors
from spacemap_vtk.mechanics.response.cage_response import Response
from spacemap_vtk.mechanics.response.energy import EnergyBalance, balance_energies
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:  # it imports Qt
    from spacemap_vtk.app.documents.document import Document

FloatArray = NDArray[np.float64]

#: Number of times of a curve.
SAMPLES = 1500
#: Most times or frequencies that are computed before the engine checks for other work.
CHUNK = 60
#: Intended time of one such part in s.
_SLICE_TIME = 0.1
#: Progress when the time steps are finished.
_STEPPED = 0.9
#: Progress when the motion of the points is known.
_MOVED = 0.97


class CurveRequest(NamedTuple):
    """A request for curves."""

    key: str
    """Differs for another scene, range or set of points."""
    points: tuple[Point, ...]
    """Positions at rest [m]; if empty, the vertex that moves most in the first mode."""
    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class Curves:
    """Data of the plots."""

    #: Key of the request.
    key: str
    #: (p, 3) Positions at rest in m.
    points: FloatArray
    #: (t,) Times in s.
    times: FloatArray
    #: (3, p, t, 3) Displacement in m, velocity in m/s and acceleration in m/s².
    motion: FloatArray
    #: Kinds of energy over time in J; None if unknown.
    balance: EnergyBalance | None
    #: (f,) Frequencies in Hz; empty if the response is unknown.
    frequencies: FloatArray
    #: (p, f, 3) Amplitude of the displacement in m under sinusoidal loads.
    response: FloatArray
    #: (n,) Natural frequencies in Hz.
    modes: FloatArray
    #: Sentence about missing data and the reason.
    note: str = ""
    #: Forces and moments of supports, grips and obstacles: over time, over the stroke, or both.
    reactions: tuple[ReactionCurves, ...] = ()

    @property
    def moves(self) -> bool:
        """Whether a point can be plotted; a scene without motion may still have reactions."""
        return len(self.times) > 0


def motion_key(document: Document) -> str:
    """Return a key that changes when the motion of a scene changes."""
    scene = document.scene
    last = scene.cage_stage if scene.moves else scene.stage("solver") or scene.source
    stages = scene.stages[: scene.stages.index(last) + 1]
    return repr({stage.section: document.values.get(stage.section) for stage in stages})


def compute_curves(scene: Scene, request: CurveRequest) -> Generator[float, None, Curves | None]:
    """Compute curves; yields the progress (0 to 1) at short intervals."""
    yield 0.0
    times = np.linspace(request.start, request.stop, SAMPLES)
    solver = scene.stage("solver")
    on_path = None if solver is None else reactions_on_path(solver)
    reactions = () if on_path is None else (on_path,)
    if not scene.moves:
        return _still_curves(request, reactions) if reactions else None
    mover = scene.cage_stage
    model = mover.motion
    if model is None:
        # A separate stage reads the motion: the scene's stage would run again at each time, and
        # once more for the view.
        return (
            None
            if mover.inputs
            else (yield from _read_curves(type(mover)(**mover.settings), request))
        )
    linear = None if (mover_stage := scene.stage("mover")) is None else mover_stage.motion
    response = linear if isinstance(linear, Response) else None
    natural = np.zeros(0) if response is None else response.modes.frequencies
    places, weights, note = [], [], "" if response else NO_FREQUENCY_RESPONSE
    for place in request.points or (tuple(most_moving_vertex(scene)),):
        try:
            weights.append(point_weights(model.points, model.cells, np.asarray(place)))
            places.append(place)
        except InputError as error:
            note = f"{error.message}."
        yield 0.0
    done = 0.0
    if mover_stage is not None and isinstance(mover_stage, TransientResponse):
        done = _STEPPED
        for time in times:  # one at a time, since a step can take long
            model.at_time(float(time))
            yield done * float(time - request.start) / (request.stop - request.start)
    motion = np.zeros((3, len(places), len(times), 3))
    energies, potential = np.zeros((len(times), 4)), np.zeros(len(times))
    has_energy = "kinetic_energy" in scene.arrays
    work_at_start = float(model.energies(np.zeros(1))[0, 3]) if has_energy else 0.0
    # All quantities of one span of times in sequence, so that its states are computed only once.
    for span in _timed_slices(len(times)):
        share = done + (_MOVED - done) * span.start / len(times)
        for number, weight in enumerate(weights):
            motion[:, number, span] = model.history(weight, times[span])
            yield share
        if has_energy:
            energies[span] = model.energies(times[span])
            potential[span] = model.potential(times[span])
            yield share
    energy_balance = balance_energies(energies, potential, work_at_start) if has_energy else None
    frequencies = frequencies_near(natural.tolist()) if response else np.zeros(0)
    answers = yield from _compute_responses(response, weights, frequencies)
    if isinstance(mover_stage, TransientResponse):
        reactions = (reactions_in_time(mover_stage, times), *reactions)
    points = np.array(places).reshape(-1, 3)
    return Curves(
        request.key,
        points,
        times,
        motion,
        energy_balance,
        frequencies,
        answers,
        natural,
        note,
        tuple(each for each in reactions if each.names),
    )


def _still_curves(request: CurveRequest, reactions: tuple[ReactionCurves, ...]) -> Curves:
    """Return the curves of a scene that has reactions along a path, but no motion."""
    nothing, points = np.zeros(0), np.zeros((0, 3))
    motion, answers = np.zeros((3, 0, 0, 3)), np.zeros((0, 0, 3))
    note = "This scene does not move in time."
    return Curves(
        request.key, points, nothing, motion, None, nothing, answers, nothing, note, reactions
    )


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Frequency response, and the effective mass and resolution of each mode."""

    #: (f,) Frequencies in Hz; empty if the response is unknown.
    frequencies: FloatArray
    #: (f,) Amplitude in m at the point that moves most in the first mode.
    response: FloatArray
    #: (n, 3) Effective mass of each mode along x, y and z, as a fraction of the mass that can move.
    shares: FloatArray
    #: (n,) Estimated relative error of each frequency of a sheet: how far it is too high.
    errors: FloatArray


def compute_spectrum(scene: Scene) -> Generator[float, None, Spectrum]:
    """Compute frequency response, effective masses and errors; yields the progress."""
    yield 0.0
    solver, mover = scene.stage("solver"), scene.stage("mover")
    frequencies, answers = np.zeros(0), np.zeros((1, 0, 3))
    if solver is None:
        return Spectrum(frequencies, frequencies, np.zeros((0, 3)), np.zeros(0))
    modes = ModesReader().read(solver.output)
    yield 0.0
    response = None if mover is None else mover.motion
    if isinstance(response, Response):
        frequencies = frequencies_near(modes.frequencies.tolist())
        weight = point_weights(response.points, response.cells, most_moving_vertex(scene))
        answers = yield from _compute_responses(response, [weight], frequencies)
    errors = []
    for error in mode_errors(modes.model, modes.eigenvalues, modes.shapes):
        errors.append(error)
        yield _MOVED
    amplitudes = np.linalg.norm(answers[0], axis=1)
    return Spectrum(frequencies, amplitudes, modes.mass_shares, np.array(errors))


def _compute_responses(
    response: Response | None, weights: list[FloatArray], frequencies: FloatArray
) -> Generator[float, None, FloatArray]:
    answers = np.zeros((len(weights), len(frequencies), 3))
    for number, weight in enumerate(weights):
        if response is None:
            break
        for part in _slices(len(frequencies)):
            try:
                answer = response.frequency_response(weight, frequencies[part])
            except InputError:  # a frequency is exactly that of an undamped mode
                frequencies[part] *= NUDGE
                answer = response.frequency_response(weight, frequencies[part])
            answers[number, part] = abs(answer)
            yield _MOVED
    return answers


def _read_curves(reader: Stage, request: CurveRequest) -> Generator[float, None, Curves]:
    """Read the motion of points from a file at its time steps; linear in between."""
    cage = reader.update().output
    rest, cells = points_of(cage), tetrahedra_of(cage)
    steps = reader.time_steps([])
    inside = [t for t in steps if request.start < t < request.stop]
    times = np.array([request.start, *inside, request.stop])
    fields = []
    for time in times:
        reader.update(time=float(time))
        data = reader.output.GetPointData()
        fields.append(array_of(data, "displacement", "a plot").copy())
        yield len(fields) / len(times)
    fields_array = np.stack(fields)
    places, curves, note = [], [], "A motion that is read from a file has no energies and no modes."
    largest = rest[int(np.argmax(np.linalg.norm(fields_array, axis=2).max(axis=0)))]
    for place in request.points or (largest,):
        location = locate([place], rest, cells, threads=1)
        if location.outside:
            note = "A point lies outside the cage."
            continue
        corners = cells[location.tetrahedron[0]]
        places.append(place)
        curves.append(np.einsum("c,tcx->tx", location.weights[0], fields_array[:, corners]))
    displacement = np.array(curves).reshape(-1, len(times), 3)
    velocity = np.gradient(displacement, times, axis=1)
    motion = np.stack([displacement, velocity, np.gradient(velocity, times, axis=1)])
    nothing, points = np.zeros(0), np.array(places).reshape(-1, 3)
    answers = np.zeros((len(places), 0, 3))
    return Curves(request.key, points, times, motion, None, nothing, answers, nothing, note)


def _timed_slices(count: int) -> Iterator[slice]:
    """Yield slices of a range, sized so that the work on each takes about `_SLICE_TIME` seconds."""
    first, size, begin = 0, 1, perf_counter()
    while first < count:
        yield slice(first, first + size)
        now = perf_counter()
        first, begin, duration = first + size, now, now - begin
        size = max(1, min(CHUNK, 2 * size, round(size * _SLICE_TIME / max(duration, 1e-6))))


def _slices(count: int) -> list[slice]:
    return [slice(first, first + CHUNK) for first in range(0, count, CHUNK)]
