"""Automatic divisions of a sheet: chosen by its modes and folds, within a limit."""

from __future__ import annotations

import gc
import math
import warnings
import weakref
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource, connect
from spacemap_vtk.datasets.modal_model import ModesReader
from spacemap_vtk.errors import SpacemapWarning
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


def test_supports_have_cells_across_or_are_points():
    free = choose_sheet_cells((0.3, 0.3), 12).chosen
    middle = [(0.4, 0.6)]
    assert choose_sheet_cells((0.3, 0.3), 12, supports=(middle, middle)).chosen == (40, 40)
    # A row of pins across the sheet is as wide as the sheet; at most 50 x 50 cells show no pin.
    for pin in ([(0.499, 0.501)], [(0.0, 1.0)]):
        assert choose_sheet_cells((0.3, 0.3), 12, supports=([], pin)).chosen == free
    found = choose_sheet_cells((0.3, 0.3), 12, supports=([], [(0.45, 0.55)]))
    assert (found.chosen, found.wanted) == ((50, 50), (80, 80))


def test_each_support_has_a_vertex_in_it():
    free = choose_sheet_cells((0.3, 0.3), 12).chosen
    assert free == (18, 18)
    third = [(0.332, 0.335)]
    assert choose_sheet_cells((0.3, 0.3), 12, supports=(third, [(0.2495, 0.2505)])).chosen == (
        18,
        20,
    )


def test_obstacles_have_cells_along_their_curvature_but_no_more_than_weight_bends():
    for radius, cells in ((0.04, 30), (0.02, 60), (0.0001, 165)):
        wanted = choose_sheet_cells((0.3, 0.3), 12, 0.02, radii=[radius]).wanted
        assert wanted == (cells, cells)


def test_plate_on_a_round_support_is_converged():
    """Of 30 mm in the middle of 300 mm; 96 x 96 cells give the frequencies."""
    solver = ModalSolver(
        elements="sheet",
        modes=6,
        fixed="sphere(0, 0, 0, 15 mm)",
        tensile_rigidity=2e3,
        bending_rigidity=1e-5,
        areal_mass=0.15,
    )
    cage = TetraCage(divisions="auto")
    cage.solver = solver
    connect(pv.Box((-0.15, 0.15, -0.15, 0.15, -1e-4, 1e-4)), cage, solver)
    with pytest.warns(SpacemapWarning, match="supports or obstacles of this sheet need"):
        solver.update()
    frequencies = ModesReader().read(solver.output).frequencies
    assert cage.values_in_use["divisions"] == (50, 50, 1)
    finest = [0.1457, 0.1457, 0.1839, 0.2094, 0.3072, 0.5554]
    np.testing.assert_allclose(frequencies, finest, rtol=0.03)


def test_strip_that_hangs_over_a_rod_is_converged():
    """Its legs are 29.64 mm apart with 400 cells."""

    def find_distance(divisions: Any) -> float:
        solver = ModalSolver(
            elements="sheet",
            modes=1,
            fixed=["box(-1e-4, 1e-4, -1, 1, -1, 1)", "-y:y", "+y:y"],
            tensile_rigidity=5e3,
            poissons_ratio_in_plane=0.0,
            bending_length=0.02,
            areal_mass=0.15,
            gravity=[0.0, 0.0, -9.80665],
            obstacles=[
                {"shape": "cylinder", "radius": 0.012, "axis": [0, 1, 0], "height": 0.1}
                | {"center": [0, 0, -0.0121]}
            ],
        )
        cage = TetraCage(divisions=divisions)
        cage.solver = solver
        connect(pv.Box((-0.15, 0.15, -0.0015, 0.0015, -1e-4, 1e-4)), cage, solver).update()
        model = ModesReader().read(solver.output).model
        assert model.displacement is not None
        return float(np.ptp((model.points + model.displacement)[:, 0]))

    assert find_distance("auto") == pytest.approx(0.02964, rel=0.02)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SpacemapWarning)
        assert find_distance((30, 1, 1)) > 1.2 * 0.02964  # half a bending length


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
