"""The command ``measure``: cloth in the instruments of a textile laboratory."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    PICTURE,
    Json,
    Quiet,
    SceneName,
    Set,
    name_options,
    number_table,
    open_scene,
    output_option,
    print_json,
    print_plain,
    print_warnings,
    progress,
    run_job,
)
from spacemap_vtk.io.registry import describe_writers
from spacemap_vtk.jobs import MeasureJob
from spacemap_vtk.laboratory.catalogue import TESTS

if TYPE_CHECKING:
    from spacemap_vtk.scenes.laboratory import TestResult

_TESTS = "\n".join(
    f"    {test.name:<12}{test.title}"
    + f", {test.instrument}" * (test.instrument.lower() != test.title.lower())
    + f": prints {test.prints}"
    for test in TESTS
)
#: Steps of the progress bar.
_STEPS = 100


def measure(
    scene: SceneName,
    /,
    *,
    test: Annotated[
        str,
        Parameter(
            help=f"{', '.join(test.name for test in TESTS)}, or all: one data sheet of all tests."
        ),
    ],
    output: Annotated[
        Path | None,
        output_option(
            "Write a file instead: .csv with the curve of the test (of all tests, their figures), "
            f"the plot as {describe_writers('plot')}, or a film of the specimen in the instrument "
            f"as {describe_writers('film')}."
        ),
    ] = None,
    size: Annotated[
        str | None,
        Parameter(help="Width and height of a film in pixels. Default: 1280x720.", group=PICTURE),
    ] = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure a cloth as the instruments of a textile laboratory do."""
    job = None
    with name_options():
        if output is not None:
            job = MeasureJob(output, test)
    chosen = open_scene(scene, set_, size=size)
    if job is not None and size is not None:
        job.size = chosen.view.size
    if job is not None:
        run_job(job, chosen, "Measuring", quiet)
        return
    from spacemap_vtk.scenes.laboratory import choose_tests, measure_scene, results_as_json

    with name_options():
        choose_tests(test)
    with progress(chosen, "Measuring", quiet) as report_progress:
        results = measure_scene(
            chosen, test, lambda share: report_progress(round(_STEPS * share), _STEPS)
        )
    if json_:
        print_json({"title": chosen.title, "tests": results_as_json(results)})
        return
    print_plain(chosen.title)
    for result in results:
        _print_result(result)
    print_warnings(chosen, quiet)


measure.__doc__ = f"""Measure a cloth as the instruments of a textile laboratory do.

The stiffness of the cloth follows from its draft and its yarns (sections [weave] and [yarns]), or
is that of a sheet in [modal]. A test cuts the specimen of its standard from it, grips and moves it,
and prints what the instrument prints, in its units and in SI. What the model does not give is
called "not modelled", with the reason. The tests:

{_TESTS}

For example:

    spacemap measure yarn_to_cloth --test bending
    spacemap measure yarn_to_cloth --test shear -o shear.png
    spacemap measure yarn_to_cloth --test cantilever -o cantilever.gif
    spacemap measure yarn_to_cloth --test all --json
    spacemap measure draft.wif --test all --set yarns.inextensible=false \\
        --set "yarns.modulus=300 cN/tex" --set "yarns.bending=2 mN.mm2" --set yarns.flattest=1
"""


def _print_result(result: TestResult) -> None:
    """Print the figures of a test as a table, and its notes."""
    test = result.test
    if result.measurement is None:
        print(f"\n{test.title} ({test.instrument}): not made, {result.refusal}")
        return
    table = number_table(
        ("", "figure", "", "value", "SI"),
        words=3,
        title=f"\n{test.title} ({test.instrument})",
        title_justify="left",
    )
    for reading in result.measurement.readings:
        table.add_row(
            reading.symbol, reading.name, reading.direction, reading.text, reading.si_text
        )
    print_plain(table)
    for note in (test.specimen, *result.measurement.notes):
        print(textwrap.fill(f"{note[0].upper()}{note[1:].removesuffix('.')}.", 78))
