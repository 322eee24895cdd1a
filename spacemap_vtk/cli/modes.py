"""Commands about a cage's motion: modes, plot."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    Errors,
    Json,
    Motion,
    Quiet,
    SceneFile,
    Set,
    flag,
    number_table,
    open_scene,
    output_option,
    print_json,
    print_labelled,
    print_missing_errors,
    print_plain,
    print_warnings,
    progress,
    run_job,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import describe_writers
from spacemap_vtk.jobs import BiaxialJob, PlotJob, ReactionsJob, ShapesJob
from spacemap_vtk.jobs.job import Job
from spacemap_vtk.units import align_decimals, format_errors, format_quantity, parse_quantity


def modes(
    scene: SceneFile,
    /,
    *,
    plot: Annotated[
        Path | None,
        Parameter(
            help=f"Also draw the first mode shapes, into a file: {describe_writers('picture')}."
        ),
    ] = None,
    errors: Errors = None,
    motion: Motion | None = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print the vibration modes of a scene's cage.

    For each mode: its frequency, damping ratio and effective mass along x, y and z, in percent of
    the mass that can move; the columns Σ are cumulative. If Σ stays below 90 % along an axis with
    a load, raise modal.modes. For a hanging scene (modal.gravity), also the sag; for a sheet, its
    shadow area and, on a disc (held by one sphere), Cusick's drape coefficient. For a cage at rest
    under loads or in grips, also force and moment of each support, grip and obstacle on it. ± is an
    estimated error, due to the width of the cage's cells; a warning names figures that are not
    converged, and a finer cage.

    For example:

        spacemap modes plain_weave
        spacemap modes plain_weave --set modal.modes=20 --plot modes.png
    """
    sheet = None if plot is None else ShapesJob(plot)
    chosen = open_scene(scene, set_, motion)
    from spacemap_vtk.scenes import report
    from spacemap_vtk.scenes.figure_list import (
        contact_figures,
        equilibrium_figures,
        reaction_figures,
        sheet_figures,
    )

    with progress(chosen, "Solving", quiet):
        figures = report.report_modes(chosen, errors)
    if sheet is not None:
        with progress(chosen, "Drawing shapes", quiet) as report_progress:
            sheet.run(chosen, report_progress)
    if json_:
        print_json(figures)
        return
    touches = bool(figures["contact"])
    # Beside the column of contact there is no room for regimes. If all modes are underdamped, the
    # caption says so instead.
    regimes = {mode["regime"] for mode in figures["modes"]}
    has_regimes = not touches and regimes != {"underdamped"}
    table = number_table(
        ("mode", "f [Hz]", "damping", *["regime"] * has_regimes, "x", "Σx", "y", "Σy", "z", "Σz")
        + ("opens",) * touches,
        title=f"{chosen.title}\n{figures['vertices']} vertices, {figures['tetrahedra']} "
        f"tetrahedra, {figures['dof']} degrees of freedom",
        caption="x, y, z: effective mass in % of the mass that can move; Σ: cumulative"
        + "\nall modes are underdamped" * (regimes == {"underdamped"})
        + "\nopens: largest displacement at which contact with an obstacle opens" * touches,
        min_width=72,  # width of the caption
    )
    frequencies = format_errors(
        align_decimals(mode["frequency_hz"] for mode in figures["modes"]),
        [
            None if mode["error"] is None else mode["error"] * mode["frequency_hz"]
            for mode in figures["modes"]
        ],
    )
    for number, (mode, frequency) in enumerate(zip(figures["modes"], frequencies, strict=True), 1):
        ratio = mode["damping_ratio"]
        shares = zip(mode["effective_mass_share"], mode["cumulative_mass_share"], strict=True)
        table.add_row(
            str(number),
            frequency,
            "–" if not math.isfinite(ratio) else f"{ratio:.3g}",
            *[mode["regime"]] * has_regimes,
            *(f"{100 * share:.1f}" for pair in shares for share in pair),
            *[_format_opening(mode["opening_amplitude"])] * touches,
        )
    print_plain(table)
    more = (
        *sheet_figures(figures),
        *equilibrium_figures(figures["hung"]),
        *reaction_figures(figures),
        *contact_figures(figures),
    )
    print_labelled((figure.label, figure.text) for figure in more)
    print_missing_errors(errors, figures)
    print_warnings(chosen, quiet)


def _format_opening(amplitude: float | None) -> str:
    return "never" if amplitude is None else format_quantity(amplitude, "m", 2)


def plot(
    scene: SceneFile,
    /,
    *,
    output: Annotated[
        Path,
        output_option(
            f"A {describe_writers('plot')} file; with --biaxial or --reactions also a .csv table."
        ),
    ],
    point: Annotated[
        str | None,
        Parameter(
            help="Position at rest, for example 1mm,0,0.2mm. Default: where the first mode moves "
            "most."
        ),
    ] = None,
    quantity: Annotated[
        Literal["displacement", "velocity", "acceleration"], Parameter(help="Quantity to plot.")
    ] = "displacement",
    biaxial: Annotated[
        bool,
        flag(
            "Plot tensile tests of the cloth instead, computed from its yarns (section [yarns]): "
            "force per width against extension, along the warp and the weft of a free strip, and "
            "for equal extension of both."
        ),
    ] = False,
    reactions: Annotated[
        bool,
        flag(
            "Plot force and moment of each support, grip and obstacle instead: over time for a "
            "motion by time steps, otherwise over the stroke of the grips."
        ),
    ] = False,
    over: Annotated[
        Literal["stroke", "time"] | None, Parameter(help="Abscissa of the reactions.")
    ] = None,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Plot the motion of a point and its frequency response.

    The time axis runs from 0 to response.duration. The frequency response is to all loads of the
    scene as sines in phase. For a motion by time steps, the energies are plotted instead.

    For example:

        spacemap plot plain_weave -o motion.pdf
        spacemap plot plain_weave -o motion.png --point 0,0,0 --quantity velocity
        spacemap plot helicoid --reactions -o reactions.csv
    """
    job: Job
    if biaxial:
        job = BiaxialJob(output)
    elif reactions:
        job = ReactionsJob(output, over)
    else:
        job = PlotJob(output, _parse_point(point), quantity)
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
        "must be a point",
        key="--point",
        value=text,
        allowed="three lengths x,y,z in m or with a unit, for example 1mm,0,0.2mm",
    )
