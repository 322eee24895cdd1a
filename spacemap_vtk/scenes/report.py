"""A scene's figures, as plain dictionaries: what ``modes`` and ``info`` tell."""

from __future__ import annotations

import math
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, peirce
from spacemap_vtk.fabric.weave import fabric_figures
from spacemap_vtk.filters.arrays import array_of
from spacemap_vtk.modal.oscillator import damping_ratio, regime
from spacemap_vtk.scenes.scene import Scene


def modes(scene: Scene) -> dict[str, Any]:
    """Return the modes of a scene's cage.

    Parameters
    ----------
    scene : Scene
        A scene that moves.

    Returns
    -------
    dict
        ``vertices``, ``tetrahedra``, ``dof`` (int), ``modes``: a list of ``eigenvalue`` (1/s²),
        ``frequency_hz``, ``damping_ratio`` (infinite or NaN for a rigid mode) and ``regime``;
        ``warnings``.

    Raises
    ------
    InputError
        If the scene has no cage.
    """
    if not scene.moves or scene.mover is not scene.response:
        missing = "no cage" if not scene.moves else "a motion out of a file"
        raise InputError(
            f"{scene.file}: this scene has {missing}, so no modes", cure="Add a section [modal]."
        )
    scene.update_stage(scene.modal)
    grid = scene.modal.GetOutputDataObject(0)
    eigenvalues = array_of(grid.GetFieldData(), "eigenvalues", "modes")
    damping = scene.response.alpha, scene.response.beta
    free = array_of(grid.GetPointData(), "fixed", "modes") == 0
    return {
        "vertices": grid.GetNumberOfPoints(),
        "tetrahedra": grid.GetNumberOfCells(),
        "dof": 3 * int(free.sum()),
        "modes": [
            {
                "eigenvalue": float(value),
                "frequency_hz": math.sqrt(value) / (2 * math.pi),
                "damping_ratio": float(ratio),
                "regime": kind,
            }
            for value, ratio, kind in zip(
                eigenvalues,
                damping_ratio(eigenvalues, *damping),
                regime(eigenvalues, *damping),
                strict=True,
            )
        ],
        "warnings": scene.warnings,
    }


def fabric(scene: Scene) -> dict[str, Any]:
    """Return a fabric's figures.

    Parameters
    ----------
    scene : Scene
        Any scene.

    Returns
    -------
    dict
        What `spacemap_vtk.fabric.weave.fabric_figures` tells, and ``drawdown`` (a string of 0 and
        1 for each pick, first pick and first end first), ``repeat`` (ends, picks),
        ``feasible_height`` of h1 (m), ``patches``, ``control_points``, ``warnings``; under
        ``warp`` and ``weft`` also ``yarns``, ``diameter``, ``spacing`` (m) and ``longest_float``.

    Raises
    ------
    InputError
        If the fabric is impossible or the draft cannot be read.
    """
    if scene.source is not scene.weave:
        raise InputError(
            f"{scene.file}: this scene shows an object, and an object has no yarns",
            cure='"spacemap modes" tells of its cage, "spacemap validate" whether it can be read.',
        )
    scene.update_stage(scene.weave)
    woven, grid = scene.weave.fabric, scene.weave.GetOutputDataObject(0)
    cloth = woven.cloth
    figures = fabric_figures(woven.drawdown, cloth)
    floats = draft.floats(woven.drawdown)
    for number, family in enumerate(("warp", "weft")):
        measures = cloth.families[number]
        figures[family] |= {
            "yarns": woven.drawdown.shape[1 - number],
            "diameter": measures.diameter,
            "spacing": measures.spacing,
            "longest_float": int(floats[number]),
        }
    figures |= {
        "drawdown": draft.rows(woven.drawdown),
        "repeat": list(draft.repeat(woven.drawdown)),
        "feasible_height": list(
            peirce.feasible_height(cloth.warp_spacing, cloth.weft_spacing, cloth.diameter_sum)
        ),
        "patches": grid.GetNumberOfCells(),
        "control_points": grid.GetNumberOfPoints(),
        "warnings": list(scene.weave.warnings),
    }
    return figures
