"""Plot the motion of a scene over time, its frequency response, and its cloth's tensile tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from spacemap_vtk.datasets.arrays import array_of, points_of
from spacemap_vtk.datasets.modal_model import MODE_NAME
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.embedding.interpolation import point_weights
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.io.output import format_csv
from spacemap_vtk.mechanics.response.cage_response import Motion, Response
from spacemap_vtk.mechanics.response.energy import EnergyBalance, balance_energies
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.crimp.biaxial import TensileTest, simulate_tensile_tests
from spacemap_vtk.textile.crimp.interchange import Interchange
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: Number of samples of a plotted curve.
SAMPLES = 2000
#: Factor that moves frequencies away from an undamped mode that they meet exactly.
NUDGE = 1 + 1e-9
QUANTITIES = {"displacement": ("m", 0), "velocity": ("m/s", 1), "acceleration": ("m/s²", 2)}
#: Names of the parts of a `Balance` in files.
ENERGY_NAMES = (
    "kinetic energy",
    "strain energy",
    "potential energy",
    "dissipated energy",
    "work of loads",
    "total energy",
)
#: A part of a balance below this share of the largest is rounding, and is not plotted.
_NEGLIGIBLE = 1e-9
NO_FREQUENCY_RESPONSE = "Only a motion by modes has a frequency response."
_COLORS = ("#c8502a", "#2f7d5b", "#2c5f9e")


def motion_plot(scene: Scene, point: Sequence[float] | None, quantity: str) -> Figure:
    """Plot the motion of a point of the cage, with its frequency response or the energies."""
    from spacemap_vtk.scenes import report

    figures = report.report_modes(scene)
    mover, last_stage = scene.stage("mover"), scene.cage_stage
    duration = 0.0 if mover is None else (mover.time_range([]) or (0.0, 0.0))[1]
    # The stage computes the steps, because it keeps them and reports progress.
    scene.update_stage(last_stage, duration if isinstance(mover, TransientResponse) else 0.0)
    motion, response = last_stage.motion, None if mover is None else mover.motion
    if motion is None:
        raise InputError(f"{scene.file}: this scene's motion is not a response to loads")
    position = most_moving_vertex(scene) if point is None else np.asarray(point)
    weights = point_weights(motion.points, motion.cells, position)
    unit, derivative = QUANTITIES[quantity]
    times = np.linspace(0.0, duration, SAMPLES)
    curves = motion.history(weights, times)[derivative]
    unit, size = prefixed_unit(unit, float(abs(curves).max()))

    coordinates = ", ".join(format_quantity(x, "m", 4) for x in position)
    figure = titled_figure(f"{scene.title}\n{quantity} at ({coordinates})")
    upper_panel, lower_panel = figure.subplots(2, 1)
    for axis, color in enumerate(_COLORS):
        upper_panel.plot(
            times, curves[:, axis] / size, color=color, label="xyz"[axis], linewidth=1.3
        )
    upper_panel.set(xlabel="time [s]", ylabel=f"{quantity} [{unit}]", xlim=(0, times[-1]))

    if isinstance(response, Response):
        frequencies = [mode["frequency_hz"] for mode in figures["modes"]]
        _plot_frequency_response(
            lower_panel, response, weights, frequencies, (unit, size, derivative)
        )
    else:
        scene.warn(NO_FREQUENCY_RESPONSE)
        _plot_energies(lower_panel, times, balance_of(motion, times))
    return add_legends(figure)


def titled_figure(title: str) -> Figure:
    """Return an empty figure with a title."""
    figure = new_figure(figsize=(9.6, 7.2), dpi=150, layout="constrained")
    figure.suptitle(title, fontsize=12)
    return figure


def add_legends(figure: Figure) -> Figure:
    """Add grids and legends to a figure whose curves are drawn, and return it."""
    for panel in figure.axes:
        panel.grid(color="#e6e9ed", linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
        if panel.get_legend_handles_labels()[0]:
            # The legend is above the panel, where it hides no curve.
            panel.legend(frameon=False, ncols=6, loc="lower right", bbox_to_anchor=(1.0, 0.98))
    return figure


def most_moving_vertex(scene: Scene) -> Floats:
    """Return the vertex that moves most in the first mode [m], (3,)."""
    solver = scene.stage("solver")
    assert solver is not None
    shape = array_of(solver.output.GetPointData(), MODE_NAME.format(0), "a plot")
    return points_of(solver.output)[int(np.argmax((shape**2).sum(axis=1)))].astype(np.float64)


def _plot_frequency_response(
    panel: Axes,
    response: Response,
    weights: Floats,
    natural_frequencies: list[float],
    quantity: tuple[str, float, int],
) -> None:
    """Plot the amplitude of a point's displacement, velocity or acceleration over frequency."""
    unit, size, derivative = quantity
    frequencies = frequencies_near(natural_frequencies)
    try:
        amplitude = abs(response.frequency_response(weights, frequencies))
    except InputError:  # a frequency met an undamped mode exactly
        frequencies *= NUDGE
        amplitude = abs(response.frequency_response(weights, frequencies))
    amplitude *= (2 * np.pi * frequencies[:, None]) ** derivative / size
    for axis, color in enumerate(_COLORS):
        if amplitude[:, axis].max() > 1e-9 * amplitude.max():
            panel.loglog(frequencies, amplitude[:, axis], color=color, linewidth=1.3)
    panel.set(
        xlabel="excitation frequency [Hz]",
        ylabel=f"amplitude [{unit}]",
        xlim=(frequencies[0], frequencies[-1]),
    )
    for mode in natural_frequencies:
        if frequencies[0] < mode < frequencies[-1]:
            panel.axvline(mode, color="#d5dae0", linewidth=0.6, zorder=0)


def balance_of(motion: Motion, times: Floats) -> EnergyBalance:
    """Return the energies of a motion over time; their total is conserved."""
    at_start = motion.energies(np.zeros(1))[0, 3]
    return balance_energies(motion.energies(times), motion.potential(times), float(at_start))


def energy_curves(balance: EnergyBalance) -> list[tuple[str, Floats, str]]:
    """Return label, values [J] and colour of each curve of a balance, the total last."""
    largest = float(np.nanmax(np.abs(balance), initial=0.0))

    def matters(part: Floats) -> bool:
        return bool((abs(part) > _NEGLIGIBLE * largest).any())

    curves = [("kinetic", balance.kinetic, "#2c7fb8"), ("strain", balance.strain, "#d9642c")]
    for label, part, color in (
        ("potential", balance.potential, "#2f8f5b"),
        ("dissipated", balance.dissipated, "#8a94a3"),
        ("work of loads", balance.work, "#8e5ea2"),
    ):
        if matters(part):
            curves.append((label, part, color))
    total = "total \N{MINUS SIGN} work" if matters(balance.work) else "total"
    return [*curves, (total, balance.total, "#26323e")]


def _plot_energies(panel: Axes, times: Floats, balance: EnergyBalance) -> None:
    unit, size = prefixed_unit("J", float(np.nanmax(np.abs(balance))))
    for label, values, color in energy_curves(balance):
        panel.plot(times, values / size, color=color, label=label, linewidth=1.3)
    panel.set(xlabel="time [s]", ylabel=f"energy [{unit}]", xlim=(0, times[-1]))


def prefixed_unit(unit: str, largest: float) -> tuple[str, float]:
    """Return a unit with a prefix that suits the largest value, and its size."""
    for power, prefix in zip((9, 6, 3, 0, -3, -6, -9, -12), "GMk mµnp", strict=True):
        if largest >= (0.1 if power <= 0 else 10.0) * 10.0**power:
            return prefix.strip() + unit, 10.0**power
    return unit, 1.0


def frequencies_near(natural_frequencies: list[float]) -> Floats:
    """Return frequencies to plot, dense around the modes [Hz]."""
    vibrating = [f for f in natural_frequencies if f > 0.0] or [1.0]
    low, high = vibrating[0] / 5, min(vibrating[-1] * 1.3, vibrating[0] * 40)
    near = np.concatenate([f * (1 + np.linspace(-0.08, 0.08, 41)) for f in vibrating])
    frequencies = np.concatenate([np.geomspace(low, high, 800), near])
    return np.unique(frequencies[(frequencies >= low) & (frequencies <= high)])


#: Extension of tensile tests beyond the extension at which yarns are straight.
_PAST = 0.02
_COLUMNS = (
    "test",
    "extension along warp",
    "extension along weft",
    "force along warp [N/m]",
    "force along weft [N/m]",
    "strain of warp yarns",
    "strain of weft yarns",
)


def crossings_of(scene: Scene) -> Interchange:
    """Return the crossings of a scene's cloth, with the stiffness of its yarns."""
    stage = scene.stage("crimp")
    if not isinstance(stage, YarnParameters) or stage.inextensible:
        raise InputError(
            f"{scene.file}: tensile tests need yarns that can stretch",
            key="yarns.inextensible",
            allowed="false, with a tension or a modulus",
            cure="For example --set yarns.inextensible=false --set yarns.modulus='500 cN/tex'",
        )
    if scene.woven is None:
        raise InputError(
            f"{scene.file or scene.title}: this scene is not woven", key=scene.source.section
        )
    cloth = scene.woven.cloth
    return Interchange(cloth, stage.yarns(cloth))


def tensile_tests_of(scene: Scene) -> list[TensileTest]:
    """Compute tensile tests of a cloth: strips along warp and weft, and both pulled alike."""
    crossings = crossings_of(scene)
    assert scene.woven is not None  # `crossings_of` has checked it
    crimp = max(float(family.crimp.crimp) for family in scene.woven.cloth.families)
    return simulate_tensile_tests(crossings, crimp + _PAST)


def tensile_table(tests: list[TensileTest]) -> str:
    """Return tensile tests as CSV."""
    rows = [
        [test.name, *(format(float(value), ".9g") for value in values)]
        for test in tests
        for values in zip(*test.extension, *test.force, *test.strain, strict=True)
    ]
    return format_csv([_COLUMNS, *rows])


def tensile_plot(title: str, tests: list[TensileTest]) -> Figure:
    """Plot force per width and change of width against extension."""
    figure = titled_figure(f"{title}\ntensile tests")
    force, width = figure.subplots(2, 1, height_ratios=(2, 1), sharex=True)
    unit, size = prefixed_unit("N/m", max(float(test.force.max()) for test in tests))
    for family, name in enumerate(("warp", "weft")):
        # The warp's curves are wider, so that both are visible where they coincide.
        strip, biaxial, color, line_width = (
            tests[family],
            tests[2],
            _COLORS[2 * family],
            3.0 - 1.6 * family,
        )
        extension = 100.0 * strip.extension[family]
        force.plot(
            extension, strip.force[family] / size, color=color, label=f"strip along the {name}"
        )
        force.plot(
            100.0 * biaxial.extension[family],
            biaxial.force[family] / size,
            color=color,
            linewidth=line_width,
            linestyle="--",
            label=f"1 : 1, {name}",
        )
        width.plot(
            extension, 100.0 * strip.extension[1 - family], color=color, linewidth=line_width
        )
    force.set(ylabel=f"force per width [{unit}]")
    width.set(xlabel="extension [%]", ylabel="change of width [%]", xlim=(0.0, extension[-1]))
    return add_legends(figure)
