"""The curves of the plots, computed by the engine a little at a time."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.app.document import Document
from spacemap_vtk.app.pick import Point
from spacemap_vtk.datasets.arrays import array_of, points_of, tetrahedra_of
from spacemap_vtk.datasets.modal_model import ModesReader
from spacemap_vtk.draw.plots import ASIDE, NO_FREQUENCIES, frequencies_near, tip
from spacemap_vtk.embedding.interpolation import point_weights
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import ROLES, Stage
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.mechanics.response import Response
from spacemap_vtk.scenes.scene import Scene

FloatArray = NDArray[np.float64]

#: What stages are that say how a scene moves.
_MOVING = ROLES[: ROLES.index("crimp")]
#: Times of a curve, and how many are computed before the engine looks for other work.
SAMPLES, CHUNK = 1500, 60


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
    #: (t, 4) Kinetic, strain, dissipated, total [J]; None where they are not known.
    energies: FloatArray | None
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
    stages = (stage for stage in document.scene.stages if stage.role in _MOVING)
    return repr({stage.section: document.values.get(stage.section) for stage in stages})


def curves_of(scene: Scene, wish: Wish) -> Generator[None, None, Curves | None]:
    """Compute curves; pauses every few milliseconds."""
    yield
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
        yield
    if moved is not None and isinstance(moved, TransientResponse):
        for time in times:  # a step may take long, and a part of the curves many steps
            model.at(float(time))
            yield
    motion = np.zeros((3, len(places), len(times), 3))
    energies = np.zeros((len(times), 4)) if "kinetic_energy" in scene.arrays else None
    # All that is asked of a span of times one after the other: its states are found once.
    for part in _parts(len(times)):
        for number, weight in enumerate(weights):
            motion[:, number, part] = model.history(weight, times[part])
            yield
        if energies is not None:
            energies[part] = model.energies(times[part])
            yield
    frequencies = frequencies_near(natural.tolist()) if response else np.zeros(0)
    answers = yield from _answers(response, weights, frequencies)
    points = np.array(places).reshape(-1, 3)
    return Curves(wish.key, points, times, motion, energies, frequencies, answers, natural, note)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """What the modes do together, and what each moves."""

    #: (f,) In Hz; empty where the response is not known.
    frequencies: FloatArray
    #: (f,) Amplitude of the displacement [m] where the first mode moves most.
    response: FloatArray
    #: (n, 3) Share of the mass that can move along x, y and z, that a mode moves.
    shares: FloatArray


def spectrum_of(scene: Scene) -> Generator[None, None, Spectrum]:
    """Compute the frequency response and the effective masses; pauses likewise."""
    yield
    solver, mover = scene.stage("solver"), scene.stage("mover")
    frequencies, answers = np.zeros(0), np.zeros((1, 0, 3))
    if solver is None:
        return Spectrum(frequencies, frequencies, np.zeros((0, 3)))
    modes = ModesReader().read(solver.output)
    yield
    response = None if mover is None else mover.motion
    if isinstance(response, Response):
        frequencies = frequencies_near(modes.frequencies.tolist())
        weight = point_weights(response.points, response.cells, tip(scene))
        answers = yield from _answers(response, [weight], frequencies)
    return Spectrum(frequencies, np.linalg.norm(answers[0], axis=1), modes.mass_shares)


def _answers(
    response: Response | None, weights: list[FloatArray], frequencies: FloatArray
) -> Generator[None, None, FloatArray]:
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
            yield
    return answers


def _read(reader: Stage, wish: Wish) -> Generator[None, None, Curves]:
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
        yield
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


def _parts(count: int) -> list[slice]:
    return [slice(first, first + CHUNK) for first in range(0, count, CHUNK)]
