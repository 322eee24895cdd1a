"""Curves of a scene's dynamics: motion over time, frequency response."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.embedding.interpolation import point_weights
from spacemap_vtk.errors import InputError
from spacemap_vtk.io import registry
from spacemap_vtk.mechanics.response import Response
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import format_quantity

#: Width of a plotted curve, in samples.
SAMPLES = 2000
#: Factor on frequencies that meet an undamped mode exactly.
ASIDE = 1 + 1e-9
QUANTITIES = {"displacement": ("m", 0), "velocity": ("m/s", 1), "acceleration": ("m/s²", 2)}
_COLORS = ("#c8502a", "#2f7d5b", "#2c5f9e")


def motion_plot(scene: Scene, file: Path, point: list[float] | None, quantity: str) -> None:
    """Plot how a point of the cage moves over time, and how it answers to each frequency."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from spacemap_vtk.scenes import report

    figures = report.modes(scene)
    mover, last_stage = scene.stage("mover"), scene.deforming
    scene.update_stage(last_stage, 0.0)
    response = None if mover is None else mover.motion
    if mover is None or not isinstance(response, Response):
        raise InputError(f"{scene.file}: this scene's motion is no response of modes to loads")
    modes = response.modes
    last = (mover.time_range([]) or (0.0, 0.0))[1]
    if point is None:
        first = modes.shapes[0].reshape(-1, 3)
        place = modes.model.points[int(np.argmax((first**2).sum(axis=1)))]
    else:
        place = np.asarray(point)
    weights = point_weights(response.points, response.cells, place)
    unit, row = QUANTITIES[quantity]
    times = np.linspace(0.0, last, SAMPLES)
    curves = (last_stage.motion or response).history(weights, times)[row]
    unit, size = handy(unit, float(abs(curves).max()))

    figure = Figure(figsize=(9.6, 7.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    where = ", ".join(format_quantity(float(f"{x:.4g}"), "m") for x in place)
    figure.suptitle(f"{scene.title}\n{quantity} at ({where})", fontsize=12)
    over_time, over_frequency = figure.subplots(2, 1)
    for axis, color in enumerate(_COLORS):
        over_time.plot(times, curves[:, axis] / size, color=color, label="xyz"[axis], linewidth=1.3)
    over_time.set(xlabel="time [s]", ylabel=f"{quantity} [{unit}]", xlim=(0, times[-1]))

    frequencies = frequencies_near([mode["frequency_hz"] for mode in figures["modes"]])
    try:
        answer = abs(response.frequency_response(weights, frequencies))
    except InputError:  # an undamped mode was met exactly
        frequencies *= ASIDE
        answer = abs(response.frequency_response(weights, frequencies))
    answer *= (2 * np.pi * frequencies[:, None]) ** row / size
    for axis, color in enumerate(_COLORS):
        if answer[:, axis].max() > 1e-9 * answer.max():
            over_frequency.loglog(frequencies, answer[:, axis], color=color, linewidth=1.3)
    over_frequency.set(
        xlabel="frequency of all loads [Hz]",
        ylabel=f"amplitude [{unit}]",
        xlim=(frequencies[0], frequencies[-1]),
    )
    for mode in figures["modes"]:
        if frequencies[0] < mode["frequency_hz"] < frequencies[-1]:
            over_frequency.axvline(mode["frequency_hz"], color="#d5dae0", linewidth=0.6, zorder=0)
    for panel in (over_time, over_frequency):
        panel.grid(color="#e6e9ed", linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
    over_time.legend(frameon=False, ncols=3, loc="upper right")
    registry.writer(file, "plot").write(file, figure)


def handy(unit: str, largest: float) -> tuple[str, float]:
    """Return a unit in which a value is no tiny number."""
    for prefix, size in (("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9), ("p", 1e-12)):
        if largest >= 0.1 * size:
            return prefix + unit, size
    return unit, 1.0


def frequencies_near(natural: list[float]) -> NDArray[np.float64]:
    """Return frequencies to plot, dense about the modes."""
    swinging = [f for f in natural if f > 0.0] or [1.0]
    low, high = swinging[0] / 5, min(swinging[-1] * 1.3, swinging[0] * 40)
    near = np.concatenate([f * (1 + np.linspace(-0.08, 0.08, 41)) for f in swinging])
    every = np.concatenate([np.geomspace(low, high, 800), near])
    return np.unique(every[(every >= low) & (every <= high)])
