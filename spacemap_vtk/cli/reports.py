"""Commands that print: info, validate, scenes, keys, materials."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import (
    Errors,
    Json,
    Motion,
    Quiet,
    SceneName,
    Set,
    number_table,
    open_scene,
    print_json,
    print_labelled,
    print_missing_errors,
    print_plain,
    print_warnings,
    progress,
)
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.errors import InputError, MissingLibraryError, escape_unprintable
from spacemap_vtk.io import provenance, registry
from spacemap_vtk.scenes import library
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene

#: Largest number of a cage's pieces that are listed.
_MOST_LISTED_PIECES = 8


def info(
    scene: Annotated[
        str,
        Parameter(
            help='Scene file, draft, mesh, or name of a built-in scene (see "spacemap scenes"); or '
            "a file made by this program.",
            completer=completers.scenes_and_files,
        ),
    ],
    /,
    *,
    time: Annotated[
        str | None,
        Parameter(
            help="Also compute the least clearance at this time in s, for example 0.4 or 400ms."
        ),
    ] = None,
    errors: Errors = None,
    motion: Motion | None = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print the figures of a fabric or an object, and how a file was made.

    For a fabric: Peirce's weave angle, yarn length, crimp and crimp height, cover, mass and least
    clearance, what its cage is made of, and the forces on it with their errors (see "spacemap
    modes"). If the yarns of a draft do not fit, only what the draft states, with a warning. For an
    object: its points, cells, size, arrays and surface faults, and
    the pieces of its cage. For a file made by this program: the version, command and scene (see
    "spacemap again").

    For example:

        spacemap info plain_weave
        spacemap info plain_weave --time 40ms --set weave.warp_spacing=0.6mm
        spacemap info cloth.png
    """
    if _print_record(Path(scene), json_):
        return
    chosen = open_scene(scene, set_, motion, time=time)
    if chosen.woven is None:
        _print_object(chosen, json_, quiet)
        return
    from spacemap_vtk.scenes import figure_list, report

    with progress(chosen, "Weaving", quiet):
        at_time = None if time is None else chosen.view.time
        figures = report.report_fabric(chosen, at_time, errors)
    if json_:
        print_json(figures)
        return
    from rich.table import Table

    table = Table(title=chosen.title, show_header=True)
    for heading in ("", "warp", "weft"):
        table.add_column(heading, justify="right" if heading else "left")
    for warp, weft in figure_list.yarn_figures(figures):
        table.add_row(warp.label, warp.text, weft.text)
    print_plain(table)
    print_labelled((figure.label, figure.text) for figure in figure_list.cloth_figures(figures))
    print_missing_errors(errors, figures)
    _print_valid_ranges(chosen, figures.get("motion"))
    print_warnings(chosen, quiet)


def _print_valid_ranges(scene: Scene, motion: dict[str, Any] | None) -> None:
    """Print where the models of the scene are valid, and the values that were found."""
    from rich.table import Table

    from spacemap_vtk.scenes.valid_ranges import collect_findings, describe_finding

    findings = collect_findings(scene, motion)
    if not findings:
        return
    table = Table(title="Models are valid up to", show_header=False)
    for justify in ("left", "right", "right"):
        table.add_column(justify=justify)
    for finding in findings:
        table.add_row(*describe_finding(finding))
    print_plain(table)


def _print_object(scene: Scene, json: bool, quiet: bool) -> None:
    """Print the figures of an object, or of a textile that is not woven, and of its cage."""
    from spacemap_vtk.scenes.figure_list import sheet_figures, textile_figures
    from spacemap_vtk.scenes.object_report import report_object

    with progress(scene, "Measuring", quiet):
        figures = report_object(scene)
    if json:
        print_json(figures)
        return
    print_plain(scene.title)
    if scene.textile is not None:
        print_labelled((f.label, f.text) for f in textile_figures(scene.textile))
    print_labelled(_object_rows(figures))
    print_labelled((f.label, f.text) for f in sheet_figures(figures))
    print_warnings(scene, quiet)


def _object_rows(figures: dict[str, Any]) -> list[tuple[str, str]]:
    kinds = ", ".join(f"{count} {name}" for name, count in figures["cell_types"].items())
    faults = figures["open_edges"], figures["branching_edges"]
    surface = "{} open and {} branching edges".format(*faults) if any(faults) else "closed"
    rows = [
        ("data", figures["type"]),
        ("points", str(figures["points"])),
        ("cells", kinds or "none"),
        ("size", " x ".join(_length(x) for x in figures["size"])),
        ("lowest corner", ", ".join(_length(x) for x in figures["bounds"][0])),
        ("highest corner", ", ".join(_length(x) for x in figures["bounds"][1])),
        ("surface", surface if figures["triangles"] else "none"),
    ]
    for array in figures["arrays"]:
        role = f", the {array['role']}" if array["role"] else ""
        text = f'"{array["name"]}", {array["components"]} x {array["type"]}{role}'
        rows.append((f"array on {array['on']}", text))
    if figures["picture"]:
        rows.append(("texture", "{} x {} pixels".format(*figures["picture"])))
    cage = figures["cage"]
    if cage:
        sizes = cage["pieces"]
        listed = ", ".join(map(str, sizes[:_MOST_LISTED_PIECES])) + ", ..." * (
            len(sizes) > _MOST_LISTED_PIECES
        )
        percent = f" ({100 * cage['points_outside'] / figures['points']:.3g} %)"
        distance = f"{percent}, by up to {_length(cage['largest_distance'])}"
        share = f", {100 * cage['filled']:.3g} % of it filled" * (cage["filled"] != 1.0)
        kind = "quadratic " if cage["quadratic"] else ""
        rows += [
            ("cage", f"{cage['vertices']} vertices, {cage['tetrahedra']} {kind}tetrahedra"),
            ("volume", f"{cage['volume']:.5g} m³" + share),
            ("pieces", f"{len(sizes)}" + (f" (tetrahedra: {listed})" if len(sizes) > 1 else "")),
            (
                "points outside",
                f"{cage['points_outside']}" + distance * bool(cage["points_outside"]),
            ),
        ]
    if figures["steps"]:
        first, last = figures["time_range"]
        rows.append(("motion", f"{figures['steps']} steps from {first:g} s to {last:g} s"))
    return rows


def _length(value: float) -> str:
    return format_quantity(value, "m", 5)


def _print_record(file: Path, json_: bool) -> bool:
    """Print a file's record, if it has one; return whether nothing else can be printed."""
    opens = registry.kind_of(file) is not None
    try:
        record = None if registry.unreadable_reason(file) else provenance.read_record(file)
    except MissingLibraryError:  # the library that reads the record
        if not opens:
            raise
        record = None
    if record is None:
        return False
    if not json_:
        from spacemap_vtk.cli.remake import describe_record

        print(escape_unprintable("\n".join(describe_record(record, file)), "\n"))
        if not opens:
            print("\n" + escape_unprintable(record.scene, "\n"), end="")
    elif not opens:
        print_json(asdict(record))
    return not opens


def validate(scene: SceneName, /, *, set_: Set = (), quiet: Quiet = False) -> None:
    """Check a scene without drawing it.

    Checks every value, the draft, the material of the cage, and whether the fabric can be woven. A
    draft file whose yarns do not fit is valid, with a warning.

    For example:

        spacemap validate scene.toml
        spacemap validate plain_weave --set weave.warp_diameter=0.4mm
    """
    chosen = open_scene(scene, set_)
    chosen.check()
    print_warnings(chosen, quiet)
    if not quiet:
        print(f"{chosen.file}: valid")


def scenes(
    name: Annotated[
        str | None,
        Parameter(help="Scene whose file is printed.", completer=completers.scene_names),
    ] = None,
    /,
    *,
    json_: Json = False,
) -> None:
    """List the built-in scenes.

    With a name, its scene file is printed: save and edit it to make a scene of your own.

    For example:

        spacemap scenes
        spacemap scenes plain_weave > mine.toml
    """
    if name is not None:
        _require(name, library.names(), "scene")
        print(library.find(name).read_text(encoding="utf-8"), end="")
        return
    titles = {name: thumbnails.title_of(name) for name in library.names()}
    if json_:
        print_json(titles)
        return
    for scene, title in titles.items():
        print(f"{scene:<24}{title}")


def _require(word: str, known: Collection[str], what: str) -> None:
    if word not in known:
        from spacemap_vtk.parameters import suggestion

        raise InputError(
            f"unknown {what}",
            key="scenes" if what == "scene" else "keys",
            value=word,
            allowed=", ".join(known),
            cure=suggestion(word, known),
        )


def materials(*, json_: Json = False) -> None:
    """List the measured fabrics that a cage can be made of.

    modal.material selects one. The table has the measured values; below it are the source, what
    was not measured, and how a scene replaces a value.

    For example:

        spacemap materials
        spacemap render plain_weave -o denim.png --set modal.material=denim
    """
    from spacemap_vtk.mechanics.elements.measured_fabrics import ASSUMPTIONS, FABRICS, SOURCE
    from spacemap_vtk.mechanics.elements.plates import bending_length

    rows: dict[str, dict[str, Any]] = {
        name: {
            "use": fabric.use,
            "sample": fabric.sample,
            "areal_mass": fabric.areal_mass,
            **dict(zip(("C11", "C12", "C22", "C33"), fabric.stiffness, strict=True)),
            **dict(zip(("B_weft", "B_bias", "B_warp"), fabric.bending, strict=True)),
            "bending_length_weft": bending_length(fabric.bending[0], fabric.areal_mass),
            "bending_length_warp": bending_length(fabric.bending[2], fabric.areal_mass),
            "plate_thickness": fabric.plate_thickness,
        }
        for name, fabric in FABRICS.items()
    }
    if json_:
        print_json({"materials": rows, "source": SOURCE, "assumed": list(ASSUMPTIONS)})
        return
    table = number_table(
        [
            *("\nmaterial", "\ng/m²", "\nC11", "\nC12", "\nC22", "\nC33"),
            *("B\nweft", "B\nbias", "B\nwarp", "c\nweft", "c\nwarp", "\nplate"),
        ],
        words=1,
    )
    for name, fabric in FABRICS.items():
        table.add_row(
            name,
            f"{1e3 * fabric.areal_mass:g}",
            *(_format_short(value) for value in fabric.stiffness),
            *(_format_short(1e6 * value) for value in fabric.bending),
            *(f"{1e3 * rows[name][f'bending_length_{way}']:.0f}" for way in ("weft", "warp")),
            f"{1e3 * fabric.plate_thickness:.2f}",
        )
    print_plain(table)
    for name, fabric in FABRICS.items():
        print(f"{name}: {fabric.use} ({fabric.sample})")
    _print_paragraph(
        "C: stiffness in N/m, C11 along the weft, C22 along the warp, C33 in shear. B: bending "
        "stiffness in µN.m. c: Peirce's bending length in mm. A sheet has the measured stiffness, "
        "bending stiffness and mass. A cage of tetrahedra has the measured stiffness and mass; if "
        'its thickness is that under "plate", in mm, it also has the measured bending stiffness.'
    )
    _print_paragraph(f"Source: {SOURCE}.")
    _print_paragraph("Assumed, because it was not measured:")
    for text in ASSUMPTIONS:
        print(textwrap.fill(f"{text}.", 78, initial_indent="- ", subsequent_indent="  "))
    _print_paragraph(
        "Each value can be replaced in [modal]: for a sheet with tensile_rigidity, "
        "shear_rigidity, bending_rigidity, areal_mass and so on, for tetrahedra with "
        "youngs_moduli, shear_moduli, poissons_ratios and density, for example "
        '--set modal.material=denim --set modal.bending_rigidity="50 uN.m".'
    )


def _print_paragraph(text: str) -> None:
    print("\n" + textwrap.fill(text, 78))


def _format_short(value: float) -> str:
    """Format a number with three digits, or all before the point."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def keys(
    section: Annotated[
        str | None, Parameter(help="Print only this section.", completer=completers.sections)
    ] = None,
    /,
) -> None:
    """Explain the sections and keys of scene files.

    Prints each key with its default, its meaning and the allowed values. In a scene file a key is
    written below its [section]; on the command line it is --set section.key=value.

    For example:

        spacemap keys
        spacemap keys weave
    """
    from spacemap_vtk.scenes.pipeline import section_classes

    known = section_classes()
    if section is None:
        print('title = "..."\n    Title of the scene, above all sections.\n')
    else:
        _require(section, known, "section")
    for name in known if section is None else [section]:
        summary = (known[name].__doc__ or "").strip().splitlines()[0]
        print(f"[{name}]  {summary}\n")
        for key, parameter in known[name].parameters.items():
            print(f"{key} = {format_default(parameter)}")
            when = f" Used only if {parameter.condition}." if parameter.condition else ""
            print(textwrap.indent(textwrap.fill(parameter.help + when, 76), "    "))
            print(textwrap.indent(textwrap.fill(f"Allowed: {parameter.allowed}.", 76), "    "))
        print()


def format_default(parameter: Any) -> str:
    """Format a parameter's default as in a scene file, with the meaning of "auto"."""
    from spacemap_vtk.parameters import AUTOMATIC

    if parameter.default_for(of_object=False) is None:
        return f'"{AUTOMATIC}"  # {parameter.automatic}'
    text = parameter.format(parameter.default)
    if text.startswith("["):  # a vector, which is followed by its unit
        return text.replace("] ", "]  # ")
    try:
        tomllib.loads(f"x = {text}")
    except tomllib.TOMLDecodeError:
        return f'"{text}"'
    return text
