"""Automatic divisions of a sheet: chosen by its modes and folds, within a limit."""

from __future__ import annotations

import gc
import math
import weakref
from typing import Any

import pytest

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource, connect
from spacemap_vtk.mechanics.modal.sheet_cells import (
    MOST_CELLS,
    choose_sheet_cells,
    highest_wave_number,
)
from spacemap_vtk.scenes.report import report_modes
from spacemap_vtk.scenes.scene import Scene

#: A cloth of 300 mm whose bending length is 14.8 mm.
CLOTH: dict[str, Any] = {
    "weave": {"ends": 31, "picks": 31, "warp_spacing": 0.01, "weft_spacing": 0.01}
    | {"warp_diameter": 3e-4, "weft_diameter": 3e-4},
    "modal": {
        "elements": "sheet",
        "modes": 8,
        "tensile_rigidity": "1.5 kN/m",
        "bending_rigidity": "5 uN.m",
        "areal_mass": "158 g/m2",
    },
}


def divisions_of(scene: Scene) -> tuple[int, ...]:
    scene.update_stage(scene.cage)
    found: tuple[int, ...] = scene.cage.values_in_use["divisions"]
    return found


@pytest.mark.parametrize("sides", [(1.0, 1.0), (2.0, 1.0), (1.0, 5.0)])
def test_wave_number_is_no_less_than_that_of_a_simply_supported_plate(sides):
    """Whose modes have k² = (m π/a)² + (n π/b)²; free edges have more modes below each k."""
    waves = sorted(
        math.pi * math.hypot(m / sides[0], n / sides[1]) for m in range(1, 60) for n in range(1, 60)
    )
    for count in (30, 100, 300):
        found = highest_wave_number(sides, count)
        assert 0.65 * waves[count - 1] < found < waves[count - 1]


def test_cells_are_limited_in_number():
    for sides in ((1.0, 1.0), (3.0, 0.5), (10.0, 0.001)):
        cells = choose_sheet_cells(sides, 30, bending_length=1e-3)
        assert math.prod(cells.chosen) <= MOST_CELLS < math.prod(cells.wanted)
        assert min(cells.chosen) >= 1


def test_automatic_cells_converge_all_modes():
    figures = report_modes(Scene(CLOTH), True)
    assert [mode["converged"] for mode in figures["modes"]] == [True] * 8
    assert not any("too wide" in text for text in figures["warnings"])


def test_cells_follow_modes_and_bending_length():
    scene = Scene(CLOTH)
    assert divisions_of(scene) == (15, 15, 1)
    scene.set("modal.modes=30")
    assert divisions_of(scene) == (30, 30, 1)
    scene.set("modal.gravity=[0, -9.81, 0]")
    assert divisions_of(scene) == (42, 42, 1)  # half a bending length
    runs = scene.cage.executions
    scene.set("modal.tensile_rigidity=3 kN/m")
    scene.update_stage(scene.cage)
    assert scene.cage.executions == runs  # the same cells
    scene.set("modal.bending_rigidity=1 uN.m")
    assert divisions_of(scene) == (50, 50, 1)
    scene.update_stage(scene.cage)
    assert any("limited to 2500 cells, [50, 50, 1]" in text for text in scene.warnings)
    scene.set("cage.divisions=[4, 4, 1]")
    scene.update_stage(scene.cage)
    assert scene.cage.output.GetNumberOfPoints() == 50


def test_other_cages_are_as_before():
    assert divisions_of(Scene({"modal": {}})) == (5, 5, 1)  # cells of a sheet would be too few
    solid = {**CLOTH, "modal": {"elements": "tetrahedra"}}
    assert divisions_of(Scene(solid)) == (5, 5, 1)
    assert divisions_of(Scene({**CLOTH, "cage": {"order": 2}, "modal": {}})) == (5, 5, 1)
    paper = Scene.read("plain_weave")
    paper.update_stage(paper.modal)
    assert paper.modal.output.GetNumberOfCells() == 125


def test_cage_alone_does_not_know_the_sheet_until_it_is_given_its_solver():
    weave = WeaveSource(ends=41, picks=41)
    cage, solver = TetraCage(divisions="auto"), ModalSolver(elements="sheet", modes=2)
    connect(weave, cage, solver).update()
    assert cage.values_in_use["divisions"] == (5, 5, 1)
    cage.solver = solver
    solver.update()
    assert cage.values_in_use["divisions"] == (6, 6, 1)
    # Neither keeps the other one alive.
    known = [weakref.ref(each) for each in (cage, solver)]
    del weave, cage, solver
    gc.collect()
    assert [each() for each in known] == [None, None]
