"""The commands ``plan``, the weaver's plan of a project, and ``yarns``, the library of yarns."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import (
    Json,
    Quiet,
    SceneName,
    Set,
    name_options,
    number_table,
    open_scene,
    output_option,
    print_json,
    print_labelled,
    print_plain,
    print_warnings,
    run_job,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import describe_writers
from spacemap_vtk.jobs import PlanJob
from spacemap_vtk.scenes.plan_settings import PlanSettings
from spacemap_vtk.textile.weave.yarn_library import YARNS, parse_yarn

if TYPE_CHECKING:
    from spacemap_vtk.scenes.plan_tables import PlanTable

#: Groups of options in the help, as the groups of fields in the window.
_GROUPS = {
    title: Group.create_ordered(title, sort_key=-1)  # before those of all commands
    for title in dict.fromkeys(each.group for each in PlanSettings.parameters.values())
}


def _option(name: str, **more: Any) -> Parameter:
    """Declare the option of a setting of the plan."""
    setting = PlanSettings.parameter(name)
    default = setting.automatic or setting.default_text.strip('"')
    return Parameter(
        name=f"--{name.replace('_', '-')}",
        help=f"{setting.help} Default: {default}.",
        group=_GROUPS[setting.group],
        show_default=False,
        **more,
    )


def plan(
    scene: SceneName,
    /,
    *,
    width: Annotated[str | None, _option("width")] = None,
    length: Annotated[str | None, _option("length")] = None,
    pieces: Annotated[str | None, _option("pieces")] = None,
    hem: Annotated[str | None, _option("hem")] = None,
    fringe: Annotated[str | None, _option("fringe")] = None,
    ends: Annotated[str | None, _option("ends")] = None,
    picks: Annotated[str | None, _option("picks")] = None,
    warp_yarn: Annotated[str | None, _option("warp_yarn", completer=completers.yarn_names)] = None,
    weft_yarn: Annotated[str | None, _option("weft_yarn", completer=completers.yarn_names)] = None,
    sett: Annotated[str | None, _option("sett")] = None,
    weft_sett: Annotated[str | None, _option("weft_sett")] = None,
    firmness: Annotated[str | None, _option("firmness")] = None,
    reed: Annotated[str | None, _option("reed")] = None,
    draw_in: Annotated[str | None, _option("draw_in")] = None,
    waste: Annotated[str | None, _option("waste")] = None,
    sample: Annotated[str | None, _option("sample")] = None,
    floating: Annotated[str | None, _option("floating")] = None,
    heddles: Annotated[str | None, _option("heddles")] = None,
    shrinkage: Annotated[str | None, _option("shrinkage")] = None,
    width_shrinkage: Annotated[str | None, _option("width_shrinkage")] = None,
    take_up: Annotated[str | None, _option("take_up")] = None,
    weft_take_up: Annotated[str | None, _option("weft_take_up")] = None,
    allowance: Annotated[str | None, _option("allowance")] = None,
    units: Annotated[Literal["metric", "imperial"] | None, _option("units")] = None,
    output: Annotated[
        Path | None,
        output_option(
            f"Write the plan into a file instead: .csv for spreadsheets, or a page as "
            f"{describe_writers('plot')}."
        ),
    ] = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Plan a project: ends, reed, warp length and yarn by colour for a finished size.

    The draft is repeated over the cloth, in whole repeats. The take-up follows from the geometry of
    the cloth with these yarns and setts; draw-in and shrinkage are given, or usual ones whose
    source is named. At the end stands what was assumed. All lengths can have a unit.

    Four towels of 8/2 cotton, at the sett that suits yarn and weave:

        spacemap plan twill_2_2 --width 50cm --length 70cm --hem 2cm --pieces 4 \\
            --warp-yarn "8/2 cotton"

    The same in inches and yards, with the weaver's own reeds, as a page:

        spacemap plan twill_2_2 --width 20in --length 28in --warp-yarn "8/2 cotton" \\
            --reed "10 dpi, 12 dpi" --units imperial -o plan.pdf

    A shawl with fringes, from a draft with measured losses:

        spacemap plan shawl.wif --width 50cm --length 1.8m --fringe 12cm --sett "9 /cm" \\
            --warp-yarn "20/2 silk" --draw-in 6% --shrinkage 4% --width-shrinkage 5%
    """
    given = {name: text for name, text in locals().items() if name in PlanSettings.parameters}
    settings = read_settings({name: text for name, text in given.items() if text is not None})
    job = None if output is None else PlanJob(output, settings.given_values)
    chosen = open_scene(scene, set_)
    if job is not None:
        run_job(job, chosen, "Planning", quiet)
        return
    from spacemap_vtk.scenes.plan import plan_scene
    from spacemap_vtk.scenes.plan_tables import plan_as_json, plan_tables

    with name_options():
        found = plan_scene(chosen, settings)
    if json_:
        print_json(plan_as_json(found))
        return
    print_plain(found.title)
    for table in plan_tables(found):
        _print_table(table, settings.units)
    print_warnings(chosen, quiet)


def read_settings(texts: Mapping[str, str]) -> PlanSettings:
    """Return the settings of a plan that a user has written; errors name the options."""
    settings = PlanSettings()
    for name, text in texts.items():
        try:
            settings.set_from_scene(name, text)
        except InputError as error:
            error.key = f"--{name.replace('_', '-')}"
            raise
    return settings


def _print_table(table: PlanTable, units: str) -> None:
    """Print a table of a plan; colours get a swatch."""
    print(f"\n{table.title}")
    if not table.headings and table.rows and len(table.rows[0]) == 1:
        for (text,) in table.texts(units):
            print(textwrap.fill(text, 88, initial_indent="- ", subsequent_indent="  "))
        return
    if not table.headings:
        print_labelled((f"  {label}", text) for label, text in table.texts(units))
        return
    words = sum(isinstance(cell, str) and cell != "" for cell in table.rows[0][:2])
    printed = number_table(table.headings, words=words)
    for row in table.texts(units):
        printed.add_row(*(_swatch(cell) for cell in row))
    print_plain(printed)


def _swatch(text: str) -> Any:
    """Return a colour as a coloured square with its code; other texts unchanged."""
    if not re.fullmatch("#[0-9a-f]{6}", text):
        return text
    from rich.text import Text

    return Text.assemble(("  ", f"on {text}"), f" {text}")


def yarns(
    *,
    units: Annotated[
        Literal["metric", "imperial"], Parameter(help="Metres per kilogram, or yards per pound.")
    ] = "metric",
    json_: Json = False,
) -> None:
    """List the yarns of the library, with counts, usual setts and sources.

    A name is a count and a material, so other yarns are understood, too: "24/2 cotton", "30 tex
    silk". Names are for "spacemap plan", and for weave.warp_yarn and weave.weft_yarn in scenes,
    which get from them the count, the density of the fibres, their packing and the plies.

    For example:

        spacemap yarns
        spacemap yarns --units imperial
        spacemap render plain_weave -o cotton.png --set weave.warp_diameter=auto \\
            --set "weave.warp_yarn=20/2 cotton"
    """
    if json_:
        print_json({"yarns": _yarns_as_json()})
        return
    from spacemap_vtk.scenes.plan_tables import yarn_tables

    for table in yarn_tables(units):
        _print_table(table, units)


def _yarns_as_json() -> dict[str, dict[str, Any]]:
    found = {}
    for name, entry in YARNS.items():
        yarn = parse_yarn(name)
        found[name] = {
            "linear_density": yarn.linear_density,
            "plies": yarn.plies,
            "fibre_density": yarn.material.density,
            "packing": yarn.material.packing,
            "tension": yarn.tension,
            "bending": yarn.bending,
            "stiffness_source": yarn.material.fibre.source,
            "plain_sett": entry.plain_sett,
            "highest_sett": entry.highest_sett,
            "package": entry.package,
            "source": entry.source or "by definition of the count",
            "material_source": yarn.material.source,
        }
    return found
