"""A scene's figures, as plain dictionaries: what ``modes`` and ``info`` tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, peirce
from spacemap_vtk.fabric.weave import fabric_figures
from spacemap_vtk.filters.arrays import array_of
from spacemap_vtk.filters.cage_modes import CageModes
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
        ``vertices``, ``tetrahedra``, ``dof`` (int), ``mass`` (kg), ``movable_mass`` (kg along x, y
        and z, the sum of the effective masses of all modes there are), ``alpha`` (1/s), ``beta``
        (s); ``modes``: a list of ``eigenvalue`` (1/s²), ``frequency_hz``, ``damping_ratio``
        (infinite or NaN for a rigid mode), ``regime``, ``effective_mass`` (kg along x, y and z),
        ``effective_mass_share`` and ``cumulative_mass_share`` (of the movable mass); ``warnings``.

    Raises
    ------
    InputError
        If the scene has no cage.
    """
    if not scene.moves:
        raise InputError(
            f"{scene.file}: this scene has no cage, so no modes", cure="Add a section [modal]."
        )
    scene.check()  # before the modes are solved: how they are damped
    scene.update_stage(scene.modal)
    grid = scene.modal.GetOutputDataObject(0)
    eigenvalues = array_of(grid.GetFieldData(), "eigenvalues", "modes")
    damping = scene.response.damping
    rates = damping.alphas(eigenvalues), damping.beta
    cage = CageModes(grid)
    masses, movable = cage.effective_masses, cage.movable_mass
    # A cage held along an axis everywhere has nothing to move along it.
    shares = np.divide(masses, movable, out=np.zeros_like(masses), where=movable > 0)
    columns = {
        "eigenvalue": eigenvalues,
        "frequency_hz": np.sqrt(eigenvalues) / (2 * math.pi),
        "damping_ratio": damping_ratio(eigenvalues, *rates),
        "regime": regime(eigenvalues, *rates),
        "effective_mass": masses,
        "effective_mass_share": shares,
        "cumulative_mass_share": shares.cumsum(axis=0),
    }
    rows = zip(
        *(c.tolist() if isinstance(c, np.ndarray) else c for c in columns.values()), strict=True
    )
    return {
        "vertices": grid.GetNumberOfPoints(),
        "tetrahedra": grid.GetNumberOfCells(),
        "dof": int(cage.model.free.sum()),
        "mass": float(cage.nodal_mass.sum()),
        "movable_mass": movable.tolist(),
        "alpha": damping.alpha,
        "beta": damping.beta,
        "modes": [dict(zip(columns, row, strict=True)) for row in rows],
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
