"""Commands about a cage's motion: modes, plot."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    Json,
    Quiet,
    SceneFile,
    Set,
    flag,
    number_table,
    open_scene,
    output_option,
    print_json,
    print_labelled,
    print_plain,
    print_warnings,
    progress,
    run_job,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import describe_writers
from spacemap_vtk.jobs import BiaxialJob, PlotJob, ShapesJob
from spacemap_vtk.jobs.job import Job
from spacemap_vtk.units import aligned, parse_quantity


def modes(
    scene: SceneFile,
    /,
    *,
    plot: Annotated[
        Path | None,
        Parameter(
            help=f"Also draw a sheet of the first mode shapes: {describe_writers('picture')}."
        ),
    ] = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print the vibration modes of a scene's cage.

    For each its frequency, damping ratio, and the mass it moves: the effective masses along x, y
    and z are shares of the mass that can move, and a column Σ adds them up. Where the modes hold
    less than 90 % along an axis with a load, take more of them. Of what hangs (modal.gravity) it
    tells how far down, of a sheet its shadow, and of one on a disc (held by one sphere) Cusick's
    drape coefficient.
    """
    sheet = None if plot is None else ShapesJob(plot)
    chosen = open_scene(scene, set_)
    from spacemap_vtk.scenes import report
    from spacemap_vtk.scenes.figure_list import hung_figures, sheet_figures

    with progress(chosen, "Solving", quiet):
        figures = report.modes(chosen)
    if sheet is not None:
        with progress(chosen, "Drawing shapes", quiet) as report_progress:
            sheet.run(chosen, report_progress)
    if json_:
        print_json(figures)
        return
    table = number_table(
        ("mode", "f [Hz]", "ratio", "regime", "x", "Σx", "y", "Σy", "z", "Σz"),
        title=f"{chosen.title}\n{figures['vertices']} vertices, {figures['tetrahedra']} "
        f"tetrahedra, {figures['dof']} degrees of freedom",
        caption="x, y, z: effective mass in % of what can move; Σ: with those above it",
        min_width=72,  # width of the caption
    )
    frequencies = aligned(mode["frequency_hz"] for mode in figures["modes"])
    for number, (mode, frequency) in enumerate(zip(figures["modes"], frequencies, strict=True), 1):
        ratio = mode["damping_ratio"]
        shares = zip(mode["effective_mass_share"], mode["cumulative_mass_share"], strict=True)
        table.add_row(
            str(number),
            frequency,
            "–" if not math.isfinite(ratio) else f"{ratio:.3g}",
            mode["regime"],
            *(f"{100 * share:.1f}" for pair in shares for share in pair),
        )
    print_plain(table)
    told = (*sheet_figures(figures), *hung_figures(figures["hung"]))
    print_labelled((figure.label, figure.told) for figure in told)
    print_warnings(chosen, quiet)


def plot(
    scene: SceneFile,
    /,
    *,
    output: Annotated[
        Path,
        output_option(f"A {describe_writers('plot')} file; of --biaxial a .csv table, too."),
    ],
    point: Annotated[
        str | None,
        Parameter(
            help="Position at rest, as in 1mm,0,0.2mm; by default where the first mode moves most."
        ),
    ] = None,
    quantity: Annotated[
        Literal["displacement", "velocity", "acceleration"], Parameter(help="What is plotted.")
    ] = "displacement",
    biaxial: Annotated[
        bool,
        flag(
            "In place of these the cloth's tensile tests, from its yarns (section yarns): "
            "force per width against extension, of a strip whose other direction is free, along "
            "the warp and along the weft, and of both pulled alike."
        ),
    ] = False,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Plot how a point moves over time, and its frequency response.

    The time goes from 0 to response.duration. The frequency response is that to all loads of the
    scene as sines in phase. A motion by steps has none: in its place are the energies.
    """
    job: Job = BiaxialJob(output) if biaxial else PlotJob(output, _parse_point(point), quantity)
    chosen = open_scene(scene, set_)
    run_job(job, chosen, "Pulling" if biaxial else "Plotting", quiet)


def _parse_point(text: str | None) -> list[float]:
    """Parse a position at rest; empty if no text is given."""
    if text is None:
        return []
    with suppress(InputError):
        place = [parse_quantity(word, "m") for word in text.split(",")]
        if len(place) == 3 and all(map(math.isfinite, place)):
            return place
    raise InputError(
        "not a point",
        key="--point",
        value=text,
        allowed="three lengths x,y,z, in m or with a unit, as in 1mm,0,0.2mm",
    )
