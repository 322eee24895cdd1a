"""What ``spacemap info`` prints of an object."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from spacemap_vtk.cli.options import print_json, print_labelled, progress, tell_warnings
from spacemap_vtk.scenes.anatomy import body
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import format_quantity

#: Pieces of a cage that are listed.
_MOST_PIECES = 8


def tell_object(scene: Scene, json: bool, quiet: bool) -> None:
    """Print an object's figures, and its cage's."""
    with progress(scene, "Measuring", quiet):
        figures = body(scene)
    if json:
        print_json(figures)
        return
    Console(markup=False).print(scene.title, highlight=False)
    print_labelled(_rows(figures))
    tell_warnings(scene, quiet)


def _rows(figures: dict[str, Any]) -> list[tuple[str, str]]:
    kinds = ", ".join(f"{count} {name}" for name, count in figures["cell_types"].items())
    faults = figures["open_edges"], figures["branching_edges"]
    surface = "{} open and {} branching edges".format(*faults) if any(faults) else "closed"
    rows = [
        ("data", figures["type"]),
        ("points", str(figures["points"])),
        ("cells", kinds or "none"),
        ("size", " x ".join(_length(x) for x in figures["size"])),
        ("from", ", ".join(_length(x) for x in figures["bounds"][0])),
        ("to", ", ".join(_length(x) for x in figures["bounds"][1])),
        ("surface", surface if figures["triangles"] else "none"),
    ]
    for array in figures["arrays"]:
        role = f", the {array['role']}" if array["role"] else ""
        text = f'"{array["name"]}", {array["components"]} x {array["type"]}{role}'
        rows.append((f"array on {array['on']}", text))
    if figures["picture"]:
        rows.append(("painted with", "a picture of {} x {} pixels".format(*figures["picture"])))
    cage = figures["cage"]
    if cage:
        sizes = cage["pieces"]
        listed = ", ".join(map(str, sizes[:_MOST_PIECES])) + ", ..." * (len(sizes) > _MOST_PIECES)
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
