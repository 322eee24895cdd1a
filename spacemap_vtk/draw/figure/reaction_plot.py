"""Plot force and moment of supports, grips and obstacles against stroke or time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spacemap_vtk.datasets.reactions import PathReactions, path_reactions_of, reactions_of
from spacemap_vtk.draw.figure.plots import add_legends, prefixed_unit, titled_figure
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import Stage
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
_TIME = "time [s]"


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

    @property
    def is_over_time(self) -> bool:
        """Whether the abscissa is the time."""
        return self.heading == _TIME

    @property
    def tables(self) -> dict[str, tuple[Floats, str]]:
        """Forces and moments with their units, by name."""
        return {"force": (self.forces, "N"), "moment": (self.moments, "N m")}


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
        curves = reactions_on_path(solver)
        if curves is None:
            raise InputError(
                "the scene has no path along which forces could be plotted",
                key="over",
                cure="Give a grip a path or turns in [[modal.grips]], or an obstacle a path",
            )
        return curves
    assert isinstance(mover, TransientResponse)
    duration = (mover.time_range([]) or (0.0, 0.0))[1]
    scene.update_stage(scene.cage_stage, duration)
    return reactions_in_time(mover, np.linspace(0.0, duration, SAMPLES))


def reactions_on_path(solver: Stage) -> ReactionCurves | None:
    """Return reactions over the stroke, from the last run of a solver; None without a path."""
    path = path_reactions_of(solver.output)
    if path is None:
        return None
    bodies = [(each.kind, each.name) for each in reactions_of(solver.output)]
    return ReactionCurves(*_stroke(path), _name_bodies(bodies), path.forces, path.moments)


def reactions_in_time(mover: TransientResponse, times: Floats) -> ReactionCurves:
    """Return reactions over time [s], (t,), after a first run of the time steps."""
    motion = mover.motion
    assert motion is not None
    found = motion.reactions(times)
    names = _name_bodies(mover.reacting_bodies(mover.output, motion))
    return ReactionCurves(_TIME, times, names, found[..., :3], found[..., 3:])


def _name_bodies(bodies: Sequence[tuple[str, str]]) -> list[str]:
    """Name bodies by kind and name; those of the same name get a number."""
    names = [f"{kind} {name}".strip() for kind, name in bodies]
    return [
        name if names.count(name) == 1 else f"{name} {names[:place].count(name) + 1}"
        for place, name in enumerate(names)
    ]


def _stroke(path: PathReactions) -> tuple[str, Floats]:
    """Return how far the first grip or obstacle that moves has gone, or numbers of steps."""
    # A grip that moves and turns has no single stroke.
    lengths, angles, obstacles = (
        np.reshape([_follow(way) for way in table.swapaxes(0, 1)], (-1, len(table))).T
        for table in (path.moves, path.turns, path.obstacle_moves)
    )
    steps = "steps on the path", np.arange(len(path.forces), dtype=np.float64)
    for length, angle in zip(lengths.T, angles.T, strict=True):
        if length.any() and angle.any():
            return steps
        if length.any():
            return "stroke [mm]", 1e3 * length
        if angle.any():
            return "angle [°]", np.degrees(angle)
    for length in obstacles.T:
        if length.any():
            return "obstacle stroke [mm]", 1e3 * length
    return steps


def _follow(way: Floats) -> Floats:
    """Return the distance from the start on a line, (S, 3), or the length of a way with bends."""
    sizes = np.linalg.norm(way, axis=1)
    farthest = way[sizes.argmax()]
    along = way @ farthest / (sizes.max() or 1.0)
    if (sizes - abs(along)).max() <= 1e-9 * sizes.max():
        return np.asarray(along)
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1)))


def reaction_table(curves: ReactionCurves) -> str:
    """Return the curves as a table in CSV: the abscissa, then three components of each body."""
    headings, columns = [curves.heading], [curves.x]
    for number, name in enumerate(curves.names):
        for what, (table, unit) in curves.tables.items():
            headings += [f"{name} {what} {axis} [{unit}]" for axis in "xyz"]
            columns += list(table[:, number].T)
    return format_csv([headings, *np.stack(columns, axis=1).tolist()])


def reaction_plot(title: str, curves: ReactionCurves) -> Figure:
    """Plot the components of all forces, and below them those of all moments."""
    figure = titled_figure(f"{title}\nforces and moments of what holds the cloth")
    panels = figure.subplots(2, 1, sharex=True)
    for panel, (what, (table, unit)) in zip(panels, curves.tables.items(), strict=True):
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
    panels[1].set(xlabel=curves.heading, xlim=(curves.x.min(), curves.x.max()))
    return add_legends(figure)
