"""A scene's figures, as plain dictionaries: what ``modes`` and ``info`` tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import draft, weave
from spacemap_vtk.fabric.clearance import Clearance, clearance_of, least_clearance
from spacemap_vtk.fabric.figures import fabric_figures
from spacemap_vtk.fabric.yarn import section_factor
from spacemap_vtk.filters.arrays import array_of, points_of
from spacemap_vtk.filters.cage_modes import CageModes
from spacemap_vtk.filters.modal_model import rounding_of
from spacemap_vtk.modal.oscillator import damping_ratio, regime
from spacemap_vtk.scenes.scene import Scene

#: The clearance of larger cloth is not looked for: 10,000 crossings take 3 s.
MOST_CROSSINGS = 20_000


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
        (infinite or NaN for a rigid mode), ``regime``, ``digits`` (of the
        eigenvalue, that rounding leaves), ``effective_mass`` (kg along x, y and z),
        ``effective_mass_share`` and ``cumulative_mass_share`` (of the movable mass); ``warnings``.

    Raises
    ------
    InputError
        If the scene has no cage.
    """
    if not scene.moves or scene.mover is not scene.response:
        missing, cure = "a motion out of a file", "Put [modal] in place of [motion]."
        if not scene.moves:
            missing = "no cage"
            cure = 'Add a section [modal], or "--set cage.divisions=[5,5,1]".'
        raise InputError(f"{scene.file}: this scene has {missing}, so no modes", cure=cure)
    scene.check()  # before the modes are solved: how they are damped
    scene.update_stage(scene.modal)
    grid = scene.modal.GetOutputDataObject(0)
    eigenvalues = array_of(grid.GetFieldData(), "eigenvalues", "modes")
    rounding = rounding_of(grid)
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
        "regime": regime(eigenvalues, *rates, rounding),
        "digits": [int(-math.log10(max(share, 1e-15))) for share in rounding],
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


def fabric(scene: Scene, time: float | None = None) -> dict[str, Any]:
    """Return a fabric's figures.

    Parameters
    ----------
    scene : Scene
        Any scene.
    time : float, optional
        In s; the least clearance is told of the deformed fabric at that time, too.

    Returns
    -------
    dict
        What `spacemap_vtk.fabric.figures.fabric_figures` tells, and

        - ``fibre_volume_fraction``: of fibres, without the air in the yarns;
        - ``drawdown``: a string of 0 and 1 for each pick, first pick and first end first;
        - ``repeat``: ends and picks of the smallest repeat;
        - ``feasible``: interval (m, or a crimp) of each input, all the others as they are, null
          where there is no bound; ``feasible_height``: that of h1 alone;
        - ``radial_error``: bound of the surfaces' distance from true tubes, over their radius;
        - ``least_clearance``: between two yarns, below 0 where they overlap: ``distance`` (m),
          ``yarns`` (ends first, from 0) and ``place`` (m); None for more than `MOST_CROSSINGS`;
          ``deformed_clearance``: the same at `time`;
        - ``patches``, ``control_points``, ``memory_bytes``, ``warnings``;
        - under ``warp`` and ``weft`` also ``yarns``, ``diameter``, ``width``, ``spacing`` (m, means
          over the yarns), ``section``, ``tex`` (g in 1000 m of yarn) and ``longest_float``.

    Raises
    ------
    InputError
        If the fabric is impossible or the draft cannot be read, or `time` is given for a scene
        that does not move.
    """
    if scene.source is not scene.weave:
        raise InputError(
            f"{scene.file}: this scene shows an object, and an object has no yarns",
            cure="Its own figures are those of `spacemap_vtk.scenes.anatomy.body`.",
        )
    if time is not None and not scene.moves:
        raise InputError("this scene does not move", key="time", cure="Add a section [response].")
    scene.update_stage(scene.weave)
    woven, grid = scene.weave.fabric, scene.weave.GetOutputDataObject(0)
    cloth = woven.cloth
    figures = fabric_figures(woven.drawdown, cloth, woven.yarn_density)
    floats = draft.floats(woven.drawdown)
    for number, family in enumerate(("warp", "weft")):
        measures = cloth.families[number]
        yarns = cloth.yarns(family, woven.drawdown.shape[1 - number])
        area = section_factor(yarns.aspect, yarns.section) * float((yarns.diameter**2).mean())
        figures[family] |= {
            "yarns": len(yarns.diameter),
            "diameter": measures.diameter,
            "width": measures.width,
            "spacing": measures.spacing,
            "section": yarns.section,
            "tex": 1e6 * woven.yarn_density * area,
            "longest_float": floats[number],
        }
    figures |= {
        "fibre_volume_fraction": scene.weave.packing * figures["volume_fraction"],
        "drawdown": draft.rows(woven.drawdown),
        "repeat": list(draft.repeat(woven.drawdown)),
        "feasible": {name: list(ends) for name, ends in scene.weave.feasible.items()},
        "feasible_height": list(cloth.feasible_heights),
        "radial_error": float(array_of(grid.GetFieldData(), "radial_error", "info")[0]),
        "least_clearance": None,
        "patches": grid.GetNumberOfCells(),
        "control_points": grid.GetNumberOfPoints(),
        "memory_bytes": 1024 * grid.GetActualMemorySize(),
    }
    if woven.drawdown.size <= MOST_CROSSINGS:
        figures["least_clearance"] = _clearance(least_clearance(woven.drawdown, cloth))
        if time is not None:
            scene.update_stage(scene.warp, time)
            moved = points_of(scene.patches)
            made = weave.build(woven.drawdown, cloth)
            figures["deformed_clearance"] = _clearance(clearance_of(made, moved))
    figures["warnings"] = scene.warnings
    return figures


def _clearance(found: Clearance) -> dict[str, Any]:
    return {
        "distance": found.distance,
        "yarns": list(found.yarns),
        "place": found.place.tolist(),
    }
