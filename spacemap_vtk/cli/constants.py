"""The commands ``constants``, ``unit-cell`` and ``permeability``: unit cells of textiles."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter

from spacemap_vtk.cli.options import (
    Json,
    Quiet,
    SceneName,
    Set,
    Time,
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
from spacemap_vtk.filters.unit_cell import UnitCell
from spacemap_vtk.io.registry import describe_writers
from spacemap_vtk.jobs import CompositeMapJob, ConstantsJob, UnitCellJob
from spacemap_vtk.jobs.unit_cell import SOLVERS

if TYPE_CHECKING:
    from spacemap_vtk.ndarrays import Floats
    from spacemap_vtk.scenes.composite import Composite

#: Steps of the progress bar.
_STEPS = 100


def _option(name: str) -> Parameter:
    setting = UnitCell.parameter(name)
    default = setting.automatic or setting.default_text.strip('"')
    return Parameter(
        help=f"{setting.help} {setting.expected[0].upper()}{setting.expected[1:]}. "
        f"Default: {default}.",
        show_default=False,
    )


def constants(
    scene: SceneName,
    /,
    *,
    fibre: Annotated[str | None, _option("fibre")] = None,
    matrix: Annotated[str | None, _option("matrix")] = None,
    packing: Annotated[str | None, _option("packing")] = None,
    voxels: Annotated[str | None, _option("voxels")] = None,
    output: Annotated[
        Path | None,
        output_option(
            "Write Young's modulus in all directions of the plane instead: a polar plot as "
            f"{describe_writers('plot')}, or a table as .csv."
        ),
    ] = None,
    map_: Annotated[
        Path | None,
        Parameter(
            name="--map",
            help="Write the constants of each cell of the deformed sheet instead, from unit cells "
            "sheared as the cloth is: .csv, or .vtp with arrays of the cells.",
        ),
    ] = None,
    time: Time = None,
    plate: Annotated[
        bool, Parameter(help="Compute A, B and D of the cell as a plate, too.", negative=())
    ] = False,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compute the elastic constants of a composite with a textile in it.

    One repeat of the textile in its matrix is cut into voxels and loaded by six strains. Printed
    are the stiffness (order xx, yy, zz, yz, xz, xy; shear strains are the engineering ones),
    moduli, Poisson's ratios, thermal expansion and density. Everything is computed again on voxels
    twice as large; the difference is the error behind ±. x runs along the weft, y along the warp.

    Other constants of fibres and matrix, layers, nesting and the height of the cell are keys of the
    section [unit_cell]; see `spacemap keys unit_cell`. For example:

        spacemap constants twill_2_2 --fibre carbon_t300 --packing 0.6
        spacemap constants plain_weave --plate --json
        spacemap constants twill_2_2 -o moduli.svg
        spacemap constants drape --map constants.csv
        spacemap constants draft.wif --set unit_cell.matrix_modulus=3GPa --set unit_cell.layers=2
    """
    job: ConstantsJob | CompositeMapJob | None = None
    with name_options():
        if output is not None:
            job = ConstantsJob(output)
        elif map_ is not None:
            job = CompositeMapJob(map_)
    given = {"fibre": fibre, "matrix": matrix, "packing": packing, "voxels": voxels}
    own = [f"unit_cell.{name}={value}" for name, value in given.items() if value is not None]
    chosen = open_scene(scene, (*own, *set_), time=time)
    if job is not None:
        run_job(job, chosen, "Computing", quiet)
        return
    from spacemap_vtk.scenes.composite import composite_as_json, compute_constants

    with progress(chosen, "Computing", quiet) as report_progress:
        found = compute_constants(
            chosen, plate, lambda share: report_progress(round(_STEPS * share), _STEPS)
        )
    if json_:
        print_json({"title": chosen.title, **composite_as_json(found)})
        return
    print_plain(chosen.title)
    _print(found)
    print_warnings(chosen, quiet)


def unit_cell(
    scene: SceneName,
    /,
    *,
    output: Annotated[Path, output_option(f"File of the voxels: {describe_writers('unit_cell')}.")],
    fibre: Annotated[str | None, _option("fibre")] = None,
    matrix: Annotated[str | None, _option("matrix")] = None,
    packing: Annotated[str | None, _option("packing")] = None,
    voxels: Annotated[str | None, _option("voxels")] = None,
    solver: Annotated[
        str, Parameter(help=f"Solver that a deck is for: {' or '.join(SOLVERS)}.")
    ] = SOLVERS[0],
    fields: Annotated[
        bool,
        Parameter(
            help="Write the stresses and strains under six unit strains, too, and print the "
            "largest equivalent stress in yarns and matrix.",
            negative=(),
        ),
    ] = False,
    set_: Set = (),
    quiet: Quiet = False,
) -> None:
    """Write one repeat of a textile in a matrix as voxels, or as input of a solver.

    Each voxel has the share of yarn (fraction), the number of the yarn, the direction of its fibres
    and their share of the yarn (packing). A deck (.inp) has periodic boundary conditions, the axes
    of the fibres, and six steps of unit strains; its head says how to read the stiffness. It gives
    each voxel the material of the larger share, where `spacemap constants` mixes both. So do the
    grids of DAMASK (.yaml, and .vti) and FANS (.json, and .h5). For example:

        spacemap unit-cell plain_weave -o cell.vti
        spacemap unit-cell twill_2_2 --voxels 32 --fibre carbon_t300 -o cell.inp
        spacemap unit-cell twill_2_2 --voxels 32 -o cell.yaml
    """
    with name_options():
        job = UnitCellJob(output, solver, fields)
    given = {"fibre": fibre, "matrix": matrix, "packing": packing, "voxels": voxels}
    own = [f"unit_cell.{name}={value}" for name, value in given.items() if value is not None]
    run_job(job, open_scene(scene, (*own, *set_)), "Filling voxels", quiet)


def permeability(
    scene: SceneName,
    /,
    *,
    voxels: Annotated[str | None, _option("voxels")] = None,
    set_: Set = (),
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compute how easily a fluid flows through a textile between its yarns.

    One repeat of the textile is cut into voxels, through which a viscous fluid flows slowly along
    x, y and z. Yarns are solid: the flow between their fibres is left out. The cell repeats itself
    along z, too, as in a stack of layers; its height is unit_cell.height, or the thickness of the
    textile. Printed is the permeability K in m²: the mean velocity is K times the gradient of the
    pressure over the viscosity. Everything is computed again on voxels twice as large; the
    difference is the error behind ±. For example:

        spacemap permeability plain_weave
        spacemap permeability twill_2_2 --voxels 128 --json
        spacemap permeability plain_weave --set unit_cell.height=0.6mm
    """
    own = [] if voxels is None else [f"unit_cell.voxels={voxels}"]
    chosen = open_scene(scene, (*own, *set_))
    from spacemap_vtk.scenes.permeability import compute_permeability, permeability_as_json

    with progress(chosen, "Computing", quiet) as report_progress:
        found = compute_permeability(
            chosen, lambda share: report_progress(round(_STEPS * share), _STEPS)
        )
    if json_:
        print_json({"title": chosen.title, **permeability_as_json(found)})
        return
    print_plain(chosen.title)
    size = " × ".join(f"{1e3 * side:.4g}" for side in found.size)
    print_plain(
        f"Cell {size} mm, {' × '.join(map(str, found.voxels))} voxels; yarns "
        f"{found.yarn_share:.1%} of the volume"
    )
    table = number_table(("direction", "permeability", "±", "unit"), words=1)
    for number, axis in enumerate("xyz"):
        fine, coarse = found.tensor[number, number], found.coarse[number, number]
        table.add_row(axis, f"{fine:.4g}", f"{abs(fine - coarse):.1g}", "m²")
    print_plain(table)
    print_warnings(chosen, quiet)


def _print(found: Composite) -> None:
    """Print the constants as tables."""
    from spacemap_vtk.scenes.composite import constant_rows
    from spacemap_vtk.unit_cell.mixtures import COMPONENTS

    size = " × ".join(f"{1e3 * side:.4g}" for side in found.size)
    print_plain(
        f"Cell {size} mm, {' × '.join(map(str, found.voxels))} voxels; yarns "
        f"{found.yarn_share:.1%}, fibres {found.fibre_share:.1%} of the volume; dry cloth: "
        f"{1 - found.fibre_share:.1%} pores"
    )
    fine, coarse = found.constants, found.coarse
    _print_matrix("Stiffness in GPa", COMPONENTS, fine.stiffness / 1e9, coarse.stiffness / 1e9)
    table = number_table(("constant", "value", "±", "unit"), words=1, title="\nConstants")
    for line in constant_rows(found):
        table.add_row(*line)
    print_plain(table)
    if found.plate is not None and found.coarse_plate is not None:
        parts = (("A in kN/m", "membrane", 1e3), ("B in N", "coupling", 1.0))
        for title, name, scale in (*parts, ("D in N·m", "bending", 1.0)):
            fine_part, rough_part = (
                getattr(one, name) / scale for one in (found.plate, found.coarse_plate)
            )
            # B of a symmetric cell is rounding; what matters is its size beside A and D.
            plate = found.plate
            beside = abs(plate.membrane).max() * abs(plate.bending).max()
            least = float(np.sqrt(beside)) if name == "coupling" else 0.0
            _print_matrix(title, ("xx", "yy", "xy"), fine_part, rough_part, least)


def _print_matrix(title: str, names: Any, fine: Floats, coarse: Floats, least: float = 0.0) -> None:
    """Print a matrix; entries far below the largest, or a given size, are 0."""
    largest = max(abs(fine).max(), least)
    error = abs(fine - coarse).max()
    table = number_table(("", *names), words=1, title=f"\n{title} (± {error:.1g})")
    for name, row in zip(names, fine, strict=True):
        shown = [f"{value:.4g}" if abs(value) > 1e-4 * largest else "0" for value in row]
        table.add_row(name, *shown)
    print_plain(table)
