"""A command about the program itself: bench."""

from __future__ import annotations

from typing import Annotated, Any

from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    Json,
    Quiet,
    Set,
    numbers_table,
    opened,
    print_json,
    print_plain,
    progress,
    tell_warnings,
)

#: Where no scene is named: the paper's experiment, and the same cloth of a hundred ends and picks.
_SCENE, _LARGE = "plain_weave", ("weave.ends=100", "weave.picks=100")


def bench(
    scene: str | None = None,
    /,
    *,
    steps: Annotated[int, Parameter(help="Times that are measured; medians are printed.")] = 9,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print how long a new time takes, beside a copy of what is written.

    Stage by stage, and nothing is drawn. What a stage writes are points, and normals where there
    are some; a copy of them is the least that any step could take. Beside it stands what VTK's
    probe takes to move the same points, Blender's lattice modifier where its module bpy is
    installed, and what a weave's crossings take to be solved for yarns that trade crimp.

    Parameters
    ----------
    scene : str, optional
        Scene file, or name of a scene (see "spacemap scenes"); by default the paper's plain weave,
        and the same of 100 x 100 yarns.
    """
    asked = [(_SCENE, set_), (_SCENE, (*_LARGE, *set_))] if scene is None else [(scene, set_)]
    found = []
    for name, assignments in asked:
        chosen = opened(name, assignments)
        from spacemap_vtk.scenes.speed import step_timings

        with progress(chosen, "Measuring", quiet):
            found.append(step_timings(chosen, max(steps, 1)))
        tell_warnings(chosen, quiet)
    if json_:
        print_json({"scenes": found})
        return
    for figures in found:
        print_plain(_table(figures))


def _table(figures: dict[str, Any]) -> Any:
    how = "loops compiled by Numba" if figures["compiled"] else "NumPy"
    table = numbers_table(
        ("a new time", "MB", "copy [ms]", "takes [ms]", "copies"),
        words=1,
        title=f"{figures['title']}\n{figures['points']:,} points, "
        f"{figures['surface_points']:,} on the surface\n{how}, {figures['threads']} threads",
        caption="copies: of the points and normals that it writes, in that time",
        min_width=72,  # of the caption
    )
    for row in figures["stages"]:
        table.add_row(
            row["name"],
            f"{row['bytes'] / 1e6:.3g}",
            f"{row['copy_ms']:.3g}",
            f"{row['ms']:.3g}",
            f"{row['copies']:.3g}",
        )
    return table
