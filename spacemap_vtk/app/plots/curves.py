"""The curves of the plots, computed by the engine a little at a time."""

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
from spacemap_vtk.draw.figure.plots import ASIDE, NO_FREQUENCIES, frequencies_near, tip
from spacemap_vtk.embedding.interpolation import point_weights
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.mechanics.modal.resolution import mode_errors
from spacemap_vtk.mechanics.response.cage_response import Response
from spacemap_vtk.mechanics.response.energy import Balance, balance
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:  # it imports Qt
    from spacemap_vtk.app.documents.document import Document

FloatArray = NDArray[np.float64]

#: What stages are that say how a scene moves.
#: Times of a curve.
SAMPLES = 1500
#: Times or frequencies that are computed before the engine looks for other work, at most.
CHUNK = 60
#: Seconds that such a part takes, about, where a single time takes long.
_PART = 0.1
#: Shares of the work that are done when the steps have been taken, and when the motion is known.
_STEPPED, _MOVED = 0.9, 0.97


class Wish(NamedTuple):
    """Curves wanted."""

    key: str
    """Another word for another scene, range or set of points."""
    points: tuple[Point, ...]
    """At rest [m]; none: the vertex that moves most in the first mode."""
    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class Curves:
    """What is plotted."""

    #: Of the wish.
    key: str
    #: (p, 3) At rest [m].
    points: FloatArray
    #: (t,) In s.
    times: FloatArray
    #: (3, p, t, 3) Displacement [m], velocity [m/s] and acceleration [m/s²].
    motion: FloatArray
    #: Where the energy is over time [J]; None where that is not known.
    balance: Balance | None
    #: (f,) In Hz; empty where the response is not known.
    frequencies: FloatArray
    #: (p, f, 3) Amplitude of the displacement [m] under the loads as sines.
    response: FloatArray
    #: (n,) Frequencies of the modes in Hz.
    modes: FloatArray
    #: What is missing, and why.
    note: str = ""


def moving(document: Document) -> str:
    """Return another word for another way in which a scene moves."""
    scene = document.scene
    last = scene.deforming if scene.moves else scene.source
    stages = scene.stages[: scene.stages.index(last) + 1]
    return repr({stage.section: document.values.get(stage.section) for stage in stages})


def curves_of(scene: Scene, wish: Wish) -> Generator[float, None, Curves | None]:
    """Compute curves; pauses every few milliseconds, and yields the share that is done."""
    yield 0.0
    times = np.linspace(wish.start, wish.stop, SAMPLES)
    if not scene.moves:
        return None
    mover = scene.deforming
    model = mover.motion
    if model is None:
        # Of a stage of its own: the scene's would run anew at each time, and again for the view.
        return None if mover.inputs else (yield from _read(type(mover)(**mover.settings), wish))
    linear = None if (moved := scene.stage("mover")) is None else moved.motion
    response = linear if isinstance(linear, Response) else None
    natural = np.zeros(0) if response is None else response.modes.frequencies
    places, weights, note = [], [], "" if response else NO_FREQUENCIES
    for place in wish.points or (tuple(tip(scene)),):
        try:
            weights.append(point_weights(model.points, model.cells, np.asarray(place)))
            places.append(place)
        except InputError as error:
            note = f"{error.message}."
        yield 0.0
    begun = 0.0
    if moved is not None and isinstance(moved, TransientResponse):
        begun = _STEPPED
        for time in times:  # a step may take long, and a part of the curves many steps
            model.at(float(time))
            yield begun * float(time - wish.start) / (wish.stop - wish.start)
    motion = np.zeros((3, len(places), len(times), 3))
    energies, potential = np.zeros((len(times), 4)), np.zeros(len(times))
    known = "kinetic_energy" in scene.arrays
    work_at_start = float(model.energies(np.zeros(1))[0, 3]) if known else 0.0
    # All that is asked of a span of times one after the other: its states are found once.
    for part in _quick_parts(len(times)):
        share = begun + (_MOVED - begun) * part.start / len(times)
        for number, weight in enumerate(weights):
            motion[:, number, part] = model.history(weight, times[part])
            yield share
        if known:
            energies[part] = model.energies(times[part])
            potential[part] = model.potential(times[part])
            yield share
    found = balance(energies, potential, work_at_start) if known else None
    frequencies = frequencies_near(natural.tolist()) if response else np.zeros(0)
    answers = yield from _answers(response, weights, frequencies)
    points = np.array(places).reshape(-1, 3)
    return Curves(wish.key, points, times, motion, found, frequencies, answers, natural, note)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Frequency response, and the effective mass and resolution of each mode."""

    #: (f,) In Hz; empty where the response is not known.
    frequencies: FloatArray
    #: (f,) Amplitude of the displacement [m] where the first mode moves most.
    response: FloatArray
    #: (n, 3) Share of the mass that can move along x, y and z, that a mode moves.
    shares: FloatArray
    #: (n,) By which share the frequency of a sheet's mode is estimated to be too high.
    errors: FloatArray


def spectrum_of(scene: Scene) -> Generator[float, None, Spectrum]:
    """Compute the frequency response, effective masses and errors; pauses likewise."""
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
        weight = point_weights(response.points, response.cells, tip(scene))
        answers = yield from _answers(response, [weight], frequencies)
    errors = []
    for error in mode_errors(modes.model, modes.eigenvalues, modes.shapes):
        errors.append(error)
        yield _MOVED
    amplitudes = np.linalg.norm(answers[0], axis=1)
    return Spectrum(frequencies, amplitudes, modes.mass_shares, np.array(errors))


def _answers(
    response: Response | None, weights: list[FloatArray], frequencies: FloatArray
) -> Generator[float, None, FloatArray]:
    answers = np.zeros((len(weights), len(frequencies), 3))
    for number, weight in enumerate(weights):
        if response is None:
            break
        for part in _parts(len(frequencies)):
            try:
                answer = response.frequency_response(weight, frequencies[part])
            except InputError:  # an undamped mode was met exactly
                frequencies[part] *= ASIDE
                answer = response.frequency_response(weight, frequencies[part])
            answers[number, part] = abs(answer)
            yield _MOVED
    return answers


def _read(reader: Stage, wish: Wish) -> Generator[float, None, Curves]:
    """Follow points through a motion out of a file: at its own steps, linear between them."""
    cage = reader.update().output
    rest, cells = points_of(cage), tetrahedra_of(cage)
    steps = reader.time_steps([])
    inside = [t for t in steps if wish.start < t < wish.stop]
    times = np.array([wish.start, *inside, wish.stop])
    fields = []
    for time in times:
        reader.update(time=float(time))
        data = reader.output.GetPointData()
        fields.append(array_of(data, "displacement", "a plot").copy())
        yield len(fields) / len(times)
    moved = np.stack(fields)
    places, curves, note = [], [], "A motion out of a file has neither energies nor modes."
    largest = rest[int(np.argmax(np.linalg.norm(moved, axis=2).max(axis=0)))]
    for place in wish.points or (largest,):
        where = locate([place], rest, cells, threads=1)
        if where.outside:
            note = "A point lies outside the cage."
            continue
        corners = cells[where.tetrahedron[0]]
        places.append(place)
        curves.append(np.einsum("c,tcx->tx", where.weights[0], moved[:, corners]))
    displacement = np.array(curves).reshape(-1, len(times), 3)
    velocity = np.gradient(displacement, times, axis=1)
    motion = np.stack([displacement, velocity, np.gradient(velocity, times, axis=1)])
    nothing, points = np.zeros(0), np.array(places).reshape(-1, 3)
    answers = np.zeros((len(places), 0, 3))
    return Curves(wish.key, points, times, motion, None, nothing, answers, nothing, note)


def _quick_parts(count: int) -> Iterator[slice]:
    """Yield parts of a range, each so short that what is done with it takes no long time."""
    first, size, begun = 0, 1, perf_counter()
    while first < count:
        yield slice(first, first + size)
        now = perf_counter()
        first, begun, took = first + size, now, now - begun
        size = max(1, min(CHUNK, 2 * size, round(size * _PART / max(took, 1e-6))))


def _parts(count: int) -> list[slice]:
    return [slice(first, first + CHUNK) for first in range(0, count, CHUNK)]
