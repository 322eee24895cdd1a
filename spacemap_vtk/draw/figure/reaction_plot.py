"""Plot force and moment of supports, grips and obstacles against stroke or time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.datasets.reactions import PathReactions, path_reactions_of, reactions_of
from spacemap_vtk.draw.figure.plots import add_legends, prefixed_unit, titled_figure
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.io.output import format_csv
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Number of times of curves over time.
SAMPLES = 1000
#: A component below this share of the largest is rounding, and is not plotted.
_NEGLIGIBLE = 1e-6
_COLORS = ("#c8502a", "#2f7d5b", "#2c5f9e", "#8e5ea2", "#8a6d1d", "#26323e")
_STYLES = ("-", "--", ":")


class ReactionCurves(NamedTuple):
    """Reactions of n bodies at t places of a path, or times."""

    heading: str
    """Name of the abscissa, with its unit."""
    x: Floats
    """(t,), stroke [mm], angle [°], number of the step, or time [s]."""
    names: list[str]
    """Names of the n bodies."""
    forces: Floats
    """(t, n, 3), forces on the cage [N]."""
    moments: Floats
    """(t, n, 3), moments [N m]."""


def reaction_curves(scene: Scene, over: str | None = None) -> ReactionCurves:
    """Compute reactions over "stroke" or "time"; by default over time if there are time steps."""
    mover, solver = scene.stage("mover"), scene.stage("solver")
    assert solver is not None
    steps = isinstance(mover, TransientResponse)
    if over == "time" and not steps:
        raise InputError(
            "only time steps have reactions over time",
            key="over",
            value=over,
            cure="Add [transient]",
        )
    if over == "stroke" or not steps:
        scene.update_stage(solver)
        path = path_reactions_of(solver.output)
        if path is None:
            raise InputError(
                "the scene has no path along which forces could be plotted",
                key="over",
                cure="Give a grip a path or turns in [[modal.grips]], or an obstacle a path",
            )
        names = [f"{each.kind} {each.name}".strip() for each in reactions_of(solver.output)]
        return ReactionCurves(*_stroke(path), names, path.forces, path.moments)
    assert isinstance(mover, TransientResponse)
    duration = (mover.time_range([]) or (0.0, 0.0))[1]
    scene.update_stage(scene.cage_stage, duration)
    assert mover.motion is not None
    times = np.linspace(0.0, duration, SAMPLES)
    found = mover.motion.reactions(times)
    names = [f"{each.kind} {each.name}".strip() for each in reactions_of(mover.output)]
    return ReactionCurves("time [s]", times, names, found[..., :3], found[..., 3:])


def _stroke(path: PathReactions) -> tuple[str, Floats]:
    """Return how far the first grip that moves or turns has gone, or numbers if it does both."""
    lengths, angles = (
        np.cumsum(np.linalg.norm(np.diff(table, axis=0), axis=2), axis=0)
        for table in (path.moves, path.turns)
    )
    moves, turns = (np.asarray(table.any(axis=0)) for table in (lengths, angles))
    first = int((moves | turns).argmax()) if len(moves) else 0
    if not (moves | turns).any() or (moves[first] and turns[first]):
        return "step on the path", np.arange(len(path.forces), dtype=np.float64)
    if moves[first]:
        return "stroke [mm]", np.append(0.0, 1e3 * lengths[:, first])
    return "angle [°]", np.append(0.0, np.degrees(angles[:, first]))


def reaction_table(curves: ReactionCurves) -> str:
    """Return the curves as a table in CSV: the abscissa, then three components of each body."""
    headings, columns = [curves.heading], [curves.x]
    for number, name in enumerate(curves.names):
        for what, unit, table in (("force", "N", curves.forces), ("moment", "N m", curves.moments)):
            headings += [f"{name} {what} {axis} [{unit}]" for axis in "xyz"]
            columns += list(table[:, number].T)
    return format_csv([headings, *np.stack(columns, axis=1).tolist()])


def reaction_plot(title: str, curves: ReactionCurves) -> Figure:
    """Plot the components of all forces, and below them those of all moments."""
    figure = titled_figure(f"{title}\nforces and moments of what holds the cloth")
    panels = figure.subplots(2, 1, sharex=True)
    for panel, what, unit, table in (
        (panels[0], "force", "N", curves.forces),
        (panels[1], "moment", "N m", curves.moments),
    ):
        largest = float(abs(table).max(initial=0.0))
        shown, size = prefixed_unit(unit, largest)
        for number, name in enumerate(curves.names):
            for axis in range(3):
                values = table[:, number, axis]
                if abs(values).max() > _NEGLIGIBLE * largest:
                    panel.plot(
                        curves.x,
                        values / size,
                        color=_COLORS[number % len(_COLORS)],
                        linestyle=_STYLES[axis],
                        linewidth=1.3,
                        label=f"{name}, {'xyz'[axis]}",
                    )
        panel.set(ylabel=f"{what} [{shown}]")
    panels[1].set(xlabel=curves.heading, xlim=(curves.x[0], curves.x[-1]))
    return add_legends(figure)
