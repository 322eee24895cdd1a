"""Commands that tell: info, validate, scenes, keys, materials."""

from __future__ import annotations

import textwrap
from typing import Annotated, Any

from cyclopts import Parameter

from spacemap_vtk.cli.options import Json, Quiet, Set, Time, opened, print_json, tell_warnings
from spacemap_vtk.cli.progress import progress
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes import library, thumbnails
from spacemap_vtk.units import format_quantity


def info(
    scene: str,
    /,
    *,
    time: Time = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print a fabric's figures: Peirce's angle, length, crimp and height, cover, mass, clearance.

    With --time also the least clearance between the yarns of the deformed fabric. Of an object:
    its cells, points, extents, arrays and the faults of its surface; of its cage, the pieces and
    what lies outside.

    Parameters
    ----------
    scene : str
        Scene file, draft, or name of a scene.
    """
    chosen = opened(scene, set_, time=time)
    if chosen.source is chosen.object:
        from spacemap_vtk.cli.anatomy import tell_object

        tell_object(chosen, json_, quiet)
        return
    from spacemap_vtk.scenes import report

    with progress(chosen, "Weaving", 1, quiet):
        figures = report.fabric(chosen, None if time is None else chosen.view.time)
    if json_:
        print_json(figures)
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title=chosen.title, show_header=True)
    for heading in ("", "warp", "weft"):
        table.add_column(heading, justify="right" if heading else "left")
    warp, weft = figures["warp"], figures["weft"]
    for label, key, unit in (
        ("yarns", "yarns", None),
        ("diameter d", "diameter", "m"),
        ("section", "section", None),
        ("width", "width", "m"),
        ("yarn count in tex", "tex", ""),
        ("spacing p", "spacing", "m"),
        ("weave angle θ", "theta_deg", "deg"),
        ("yarn length l per crossing", "length", "m"),
        ("crimp c", "crimp", "%"),
        ("mean crimp, floats included", "mean_crimp", "%"),
        ("crimp height h", "height", "m"),
        ("cover factor", "cover", "%"),
        ("longest float", "longest_float", None),
        ("yarn length in all", "yarn_length", "m"),
    ):
        table.add_row(label, *(_cell(family[key], unit) for family in (warp, weft)))
    console = Console()
    console.print(table)
    cloth = Table.grid(padding=(0, 2))
    least = figures["least_clearance"]
    for label, value in (
        ("thickness", _cell(figures["thickness"], "m")),
        ("cover", f"{figures['cover']:.1%}"),
        ("fibre volume fraction", f"{figures['fibre_volume_fraction']:.1%}"),
        ("areal mass", f"{1e3 * figures['areal_mass']:.4g} g/m²"),
        ("smallest repeat", "{} x {}".format(*figures["repeat"])),
        ("h1 feasible", _interval(*figures["feasible_height"])),
        (
            "least clearance",
            _clearance(least, figures["ends"]) if least else "not looked for: too large",
        ),
        *(
            [("... when deformed", _clearance(figures["deformed_clearance"], figures["ends"]))]
            if "deformed_clearance" in figures
            else []
        ),
        ("surface off true tubes", f"{figures['radial_error']:.2g} of the radius"),
        ("patches", f"{figures['patches']}"),
        ("control points", f"{figures['control_points']}"),
        ("memory", f"{figures['memory_bytes'] / 2**20:.3g} MiB"),
    ):
        cloth.add_row(label, value)
    console.print(cloth)
    tell_warnings(chosen, quiet)


def validate(scene: str, /, *, set_: Set = (), quiet: Quiet = False) -> None:
    """Check a scene without drawing it: every value, the draft, and that the fabric is feasible.

    Parameters
    ----------
    scene : str
        Scene file, draft, or name of a scene.
    """
    chosen = opened(scene, set_)
    chosen.check()
    tell_warnings(chosen, quiet)
    if not quiet:
        print(f"{chosen.file}: valid")


def scenes(
    name: Annotated[str | None, Parameter(help="Print this scene's file.")] = None,
    /,
    *,
    json_: Json = False,
) -> None:
    """List the scenes that come with the program."""
    if name is not None:
        if name not in library.names():
            raise InputError(
                "no such scene", key="scenes", value=name, allowed=", ".join(library.names())
            )
        print(library.find(name).read_text(encoding="utf-8"), end="")
        return
    titles = {name: thumbnails.title_of(name) for name in library.names()}
    if json_:
        print_json(titles)
        return
    for scene, title in titles.items():
        print(f"{scene:<24}{title}")


def materials(*, json_: Json = False) -> None:
    """List the measured fabrics that modal.material can name, with their source.

    The table's constants, what they leave open, and how a scene replaces them.
    """
    from spacemap_vtk.modal.fabrics import ASSUMED, FABRICS, SOURCE

    rows = {
        name: {
            "use": fabric.use,
            "sample": fabric.sample,
            "areal_mass": fabric.areal_mass,
            **dict(zip(("C11", "C12", "C22", "C33"), fabric.stiffness, strict=True)),
            "plate_thickness": fabric.plate,
        }
        for name, fabric in FABRICS.items()
    }
    if json_:
        print_json({"materials": rows, "source": SOURCE, "assumed": list(ASSUMED)})
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for heading in ("material", "g/m²", "C11", "C12", "C22", "C33", "plate"):
        table.add_column(
            heading, justify="left" if heading == "material" else "right", no_wrap=True
        )
    table.add_column("sold as")
    for name, fabric in FABRICS.items():
        table.add_row(
            f"{name}\n  {fabric.sample}",
            f"{1e3 * fabric.areal_mass:g}",
            *(f"{value:.4g}" for value in fabric.stiffness),
            f"{1e3 * fabric.plate:.2f} mm",
            fabric.use,
        )
    Console().print(table)
    print(
        textwrap.fill(
            "C in N/m: C11 along the weft, C22 along the warp, C33 shear. A cage as thick as "
            '"plate" bends as measured; one of any thickness stretches and weighs as measured.',
            78,
        )
    )
    print("\n" + textwrap.fill(f"Source: {SOURCE}.", 78) + "\n\nTaken without measurement:")
    for text in ASSUMED:
        print(textwrap.fill(f"{text}.", 78, initial_indent="- ", subsequent_indent="  "))
    print(
        "\n"
        + textwrap.fill(
            "youngs_moduli, shear_moduli, poissons_ratios and density in [modal] replace the "
            'measured ones: --set modal.material=denim --set modal.density="400 kg/m3".',
            78,
        )
    )


def keys(section: Annotated[str | None, Parameter(help="Only this section.")] = None, /) -> None:
    """Explain the sections and keys of a scene file, each with what is allowed and its default."""
    from spacemap_vtk.parameters import suggestion
    from spacemap_vtk.scenes.scene import SECTIONS

    if section is not None and section not in SECTIONS:
        raise InputError(
            "no such section",
            key="keys",
            value=section,
            allowed=", ".join(SECTIONS),
            cure=suggestion(section, SECTIONS),
        )
    for name in SECTIONS if section is None else [section]:
        summary = (SECTIONS[name].__doc__ or "").strip().splitlines()[0]
        print(f"[{name}]  {summary}\n")
        for key, parameter in SECTIONS[name].parameters.items():
            print(f"{key} = {parameter.show(parameter.default)}")
            print(textwrap.indent(textwrap.fill(parameter.help, 76), "    "))
            print(textwrap.indent(textwrap.fill(f"Allowed: {parameter.allowed}.", 76), "    "))
        print()


def _interval(low: float, high: float) -> str:
    return f"{_cell(low, 'm')} to {_cell(high, 'm')}"


def _clearance(found: dict[str, Any], ends: int) -> str:
    # what rounding leaves of touching is no overlap
    distance = found["distance"] if abs(found["distance"]) > 1e-12 else 0.0
    place = ", ".join(_cell(x, "m") for x in found["place"])
    names = [f"end {n + 1}" if n < ends else f"pick {n - ends + 1}" for n in found["yarns"]]
    return f"{_cell(distance, 'm')} ({' and '.join(names)}, at {place})"


def _cell(value: float, unit: str | None) -> str:
    if unit is None:
        return str(value)
    if unit == "%":
        return f"{value:.2%}"
    if unit == "deg":
        return f"{value:.4g}°"
    return format_quantity(float(f"{value:.5g}"), unit)
