"""Commands that tell: modes, info, validate, scenes."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from spacemap_vtk.cli.options import Json, Quiet, Set, opened, tell_warnings
from spacemap_vtk.cli.progress import progress
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes import library, report
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import format_quantity


def modes(scene: str, /, *, set_: Set = (), json_: Json = False, quiet: Quiet = False) -> None:
    """Print the vibration modes of a scene's cage: frequency and damping of each.

    Parameters
    ----------
    scene : str
        Scene file or name of a scene.
    """
    chosen = opened(scene, set_)
    with progress(chosen, "Solving", 1, quiet):
        figures = report.modes(chosen)
    if json_:
        _print_json(figures)
        return
    table = Table(
        title=f"{chosen.title}\n{figures['vertices']} vertices, {figures['tetrahedra']} "
        f"tetrahedra, {figures['dof']} degrees of freedom"
    )
    for heading in ("mode", "frequency [Hz]", "eigenvalue [1/s²]", "damping ratio", "regime"):
        table.add_column(heading, justify="right")
    for number, mode in enumerate(figures["modes"]):
        ratio = mode["damping_ratio"]
        table.add_row(
            str(number),
            f"{mode['frequency_hz']:.5g}",
            f"{mode['eigenvalue']:.6g}",
            "–" if ratio is None else f"{ratio:.4g}",
            mode["regime"],
        )
    Console().print(table)
    tell_warnings(chosen, quiet)


def info(scene: str, /, *, set_: Set = (), json_: Json = False, quiet: Quiet = False) -> None:
    """Print a fabric's figures: Peirce's angle, length, crimp and height, thickness, cover, counts.

    Parameters
    ----------
    scene : str
        Scene file, draft, or name of a scene.
    """
    chosen = opened(scene, set_)
    with progress(chosen, "Weaving", 1, quiet):
        figures = report.fabric(chosen)
    if json_:
        _print_json(figures)
        return
    table = Table(title=chosen.title, show_header=True)
    for heading in ("", "warp", "weft"):
        table.add_column(heading, justify="right" if heading else "left")
    warp, weft = figures["warp"], figures["weft"]
    for label, key, unit in (
        ("yarns", "yarns", None),
        ("diameter", "diameter", "m"),
        ("spacing", "spacing", "m"),
        ("weave angle θ", "theta_deg", "deg"),
        ("yarn length l per crossing", "length", "m"),
        ("crimp c", "crimp", "%"),
        ("crimp height h", "height", "m"),
        ("cover factor", "cover", "%"),
        ("longest float", "longest_float", None),
    ):
        table.add_row(label, *(_cell(family[key], unit) for family in (warp, weft)))
    console = Console()
    console.print(table)
    console.print(
        f"thickness {format_quantity(figures['thickness'], 'm')}, "
        f"cover {figures['cover']:.1%}, "
        f"repeat {figures['repeat'][0]} x {figures['repeat'][1]}, "
        f"{figures['patches']} patches, {figures['control_points']} control points, "
        f"h1 feasible from {format_quantity(figures['feasible_height'][0], 'm')} "
        f"to {format_quantity(figures['feasible_height'][1], 'm')}"
    )
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
    titles = {name: Scene.read(library.folder() / f"{name}.toml").title for name in library.names()}
    if json_:
        _print_json(titles)
        return
    for scene, title in titles.items():
        print(f"{scene:<24}{title}")


def _cell(value: float, unit: str | None) -> str:
    if unit is None:
        return str(value)
    if unit == "%":
        return f"{value:.2%}"
    if unit == "deg":
        return f"{value:.4g}°"
    return format_quantity(float(f"{value:.5g}"), unit)


def _print_json(figures: Any) -> None:
    print(json.dumps(_finite(figures), indent=2, ensure_ascii=False))


def _finite(value: Any) -> Any:
    """Return JSON's null for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
