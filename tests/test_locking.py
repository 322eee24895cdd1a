"""Estimated stiffness of thin cages, against the closed forms of plates and their own modes."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest
from vtkmodules.vtkFiltersSources import vtkCubeSource

from spacemap_vtk import ModalSolver, SpacemapWarning, TetraCage
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.locking import _CurvedSheet as Plate
from spacemap_vtk.mechanics.elements.locking import estimate_locking, proportions_of
from spacemap_vtk.mechanics.elements.materials import fabric_to_xyz, isotropic, orthotropic
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.modal.eigen import solve_modes
from spacemap_vtk.mechanics.modal.model import Model

SIDE, DENSITY = 0.1, 300.0
STUFF = isotropic(1e6, 0.3)
#: First bending and first twist of a square held by a side, ω a² √(ρh/D), ν = 0.3: Leissa,
#: Vibration of Plates, NASA SP-160 (1969), table 4.48.
BENDING, TWIST = 3.4917, 8.5246


def square(cells, layers, wide, order):
    """A square sheet whose cells are `wide` times as wide as it is thick, held by one side."""
    thickness = SIDE / cells / wide
    points, tetrahedra = build_lattice((0, SIDE, 0, SIDE, 0, thickness), (cells, cells, layers))
    if order == 2:
        points, tetrahedra = add_midpoints(points, tetrahedra)
    return points, tetrahedra, thickness


def hold_sides(points, sides=1):
    far, near = points[:, 1:2] > SIDE * (1 - 1e-9), points[:, 1:2] < SIDE * 1e-9
    return np.repeat(far | near if sides == 2 else far, 3, axis=1)


def first_eigenvalues(points, tetrahedra, stuff, sides=1, count=14):
    """Eigenvalues of first bending and first twist, for a density of 1; 0 where none is found."""
    model = Model(points, tetrahedra, stuff, DENSITY, hold_sides(points, sides))
    eigenvalues, shapes, _ = solve_modes(model.pencil, count)
    middle = SIDE / 2 if sides == 2 else 0.0
    line = abs(points[:, 1] - middle) <= abs(points[:, 1] - middle).min() + 1e-9
    arm = points[line, 0] - np.ptp(points[:, 0]) / 2
    found = {}
    for value, shape in zip(eigenvalues * model.modulus, shapes, strict=True):
        if (shape[:, :2] ** 2).sum() > (shape[:, 2] ** 2).sum():
            continue  # it moves in its plane
        tip = shape[line, 2]
        turns = abs(tip @ arm) > 0.7 * np.linalg.norm(tip) * np.linalg.norm(arm)
        found.setdefault("twist" if turns else "bending", value)
    return np.array([found["bending"], found.get("twist", 0.0)])


def measure_locking(points, tetrahedra, thickness, sides=1, known=(BENDING, TWIST)):
    """How many times too high the eigenvalues of first bending and first twist are."""
    plate = 1e6 * thickness**3 / (12 * (1 - 0.3**2))
    found = first_eigenvalues(points, tetrahedra, STUFF, sides) * thickness / plate * SIDE**4
    return found / np.square(known)


# The thickness is at most a 25th of the side: Kirchhoff's plate does not shear.
LINEAR = [
    (cells, layers, wide)
    for cells, layers, wide in itertools.product((5, 10), (1, 2, 3, 6), (2.5, 5, 10, 30, 70))
    if cells * wide >= 25 and cells * layers < 50
] + [(20, 1, 1.25), (20, 2, 1.25)]


@pytest.mark.parametrize(
    ("cells", "layers", "wide"),
    # Every fourth one in the gate.
    [
        pytest.param(*each, marks=[pytest.mark.nightly] * (k % 4 > 0))
        for k, each in enumerate(LINEAR)
    ],
)
def test_locking_of_linear_tetrahedra_is_estimated(cells, layers, wide):
    points, tetrahedra, thickness = square(cells, layers, wide, 1)
    estimated = estimate_locking(points, tetrahedra, STUFF, hold_sides(points))
    bending, twist = measure_locking(points, tetrahedra, thickness)
    assert 0.97 < estimated.bending / bending < (1.1 if wide >= 5 else 1.3)
    if twist:  # where it is so stiff that it is none of the lowest modes
        assert 1.0 < estimated.twist / twist < (1.1 if wide >= 2.5 else 1.3)


@pytest.mark.parametrize(
    ("cells", "layers", "wide"),
    [
        *((5, 1, 5), (5, 1, 70), (10, 1, 2.5)),
        *(
            pytest.param(cells, layers, wide, marks=pytest.mark.nightly)
            for cells, layers, wide in [
                *((5, 3, 30), (5, 6, 5), (5, 1, 10), (5, 1, 30), (5, 3, 5), (5, 3, 10), (5, 3, 70)),
                *((5, 6, 10), (5, 6, 30), (5, 6, 70), (10, 1, 70)),
                *((5, 2, wide) for wide in (5, 10, 30, 70)),
                *((10, 1, wide) for wide in (5, 10, 30)),
                *((10, 2, wide) for wide in (2.5, 5, 10, 30, 70)),
            ]
        ),
    ],
)
def test_locking_of_quadratic_tetrahedra_is_estimated(cells, layers, wide):
    points, tetrahedra, thickness = square(cells, layers, wide, 2)
    estimated = estimate_locking(points, tetrahedra, STUFF, hold_sides(points))
    bending, twist = measure_locking(points, tetrahedra, thickness)
    assert 1.0 <= estimated.bending < 1.03
    assert 1.0 < bending < 1.07  # five and ten cells, however thin
    assert 0.7 < estimated.twist / twist < 1.3


@pytest.mark.parametrize(("cells", "layers", "wide"), [(5, 1, 5), (5, 1, 10), (5, 3, 5), (8, 2, 4)])
def test_locking_between_two_clamped_sides_is_estimated(cells, layers, wide):
    """Where a mode that seems to twist bends for the most part. Leissa, table 4.37."""
    points, tetrahedra, thickness = square(cells, layers, wide, 1)
    estimated = estimate_locking(points, tetrahedra, STUFF, hold_sides(points, 2))
    bending, twist = measure_locking(points, tetrahedra, thickness, 2, (22.272, 26.529))
    assert 1.0 < estimated.bending / bending < 1.3
    assert 1.0 < estimated.twist / twist < 1.5  # its second twist is the worse one


@pytest.mark.parametrize("sides", [1, pytest.param(2, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(("order", "wide"), [(1, 12), (2, 25)])
@pytest.mark.parametrize(
    "fabric",
    [
        "denim",
        *(pytest.param(each, marks=pytest.mark.nightly) for each in ("jacket", "tablecloth")),
    ],
)
def test_locking_of_measured_fabrics_is_estimated(fabric, order, wide, sides):
    """Against quadratic tetrahedra that are narrow enough to twist right."""
    points, tetrahedra, thickness = square(5, 1, wide, order)
    solid = FABRICS[fabric].solid(thickness)
    stuff = fabric_to_xyz(orthotropic(*solid[:3]))
    estimated = estimate_locking(points, tetrahedra, stuff, hold_sides(points, sides))
    bending, twist = first_eigenvalues(points, tetrahedra, stuff, sides, count=24) / (
        converged_for_fabric(fabric, sides) * thickness
    )
    assert 0.8 < estimated.bending / bending < 1.6
    # Between two sides other modes twist worse than the first.
    assert 0.8 < estimated.twist / twist < (1.4 if sides == 1 else 4)


@cache
def converged_for_fabric(fabric, sides):
    """Eigenvalues over thickness, to which a fabric's grow: by cells five thicknesses wide."""
    points, tetrahedra, thickness = square(14, 1, 5, 2)
    stuff = fabric_to_xyz(orthotropic(*FABRICS[fabric].solid(thickness)[:3]))
    return first_eigenvalues(points, tetrahedra, stuff, sides) / thickness


@pytest.mark.parametrize("cells", [10, pytest.param(16, marks=pytest.mark.nightly)])
def test_cells_of_four_thicknesses_twist_correctly(cells):
    bending, twist = np.sqrt(measure_locking(*square(cells, 1, 4, 2)))
    assert 1.0 < bending < 1.02
    assert 1.0 < twist < 1.05


@pytest.mark.parametrize("layers", [1, 2, 6])
@pytest.mark.parametrize("wide", [10, 70])
def test_the_leading_terms_are_in_closed_form(layers, wide):
    plate = Plate(*square(6, layers, wide, 1)[:2], 2)
    shear, along = 1 / 2.6, 1 / (1 - 0.3**2)
    bending = 1 + 2 * shear / along * wide**2
    assert plate.stiffness_factor(STUFF, 0, 0) == pytest.approx(bending, rel=0.03)
    assert plate.stiffness_factor(STUFF, 1, 1) == pytest.approx(bending, rel=0.03)
    swelling = STUFF[2, 2] / 1e6
    twist = 1 + layers**2 * swelling / (4 * shear) * wide**4
    assert plate.stiffness_factor(STUFF, 0, 1) == pytest.approx(twist, rel=0.04)


def test_locking_of_a_bar_is_estimated():
    """Measured first frequencies of 10 x 1 x 1 m of steel, see test_eigen.py, over Timoshenko's."""
    for cells, first in ((1, 13.277), (2, 9.803), (3, 8.879), (4, 8.533)):
        points, tetrahedra = build_lattice((0, 10, 0, 1, 0, 1), (10 * cells, cells, cells))
        estimated = estimate_locking(points, tetrahedra, STUFF, np.zeros(points.shape, bool))
        assert 0.97 < estimated.bending / (first / 8.013) ** 2 < 1.3
        assert estimated.twist == 1.0


@pytest.mark.parametrize(
    "ratio", [0.0, *(pytest.param(each, marks=pytest.mark.nightly) for each in (0.4, 0.45)), 0.49]
)
@pytest.mark.parametrize(("divisions", "thickness"), [((15, 15, 1), 1 / 7), ((8, 8, 1), 0.02)])
def test_locking_at_other_poissons_ratios_is_estimated(ratio, divisions, thickness):
    """Against quadratic tetrahedra, which bend however thin and however incompressible."""
    stuff, found = isotropic(1e6, ratio), []
    for order, cells in ((1, divisions), (2, (8, 8, 1))):
        points, tetrahedra = build_lattice((0, 1, 0, 1, 0, thickness), cells)
        clamped = np.repeat(points[:, 1:2] == 1, 3, axis=1)
        if order == 1:
            estimated = estimate_locking(points, tetrahedra, stuff, clamped)
        else:
            points, tetrahedra = add_midpoints(points, tetrahedra)
            clamped = np.repeat(points[:, 1:2] == 1, 3, axis=1)
        model = Model(points, tetrahedra, stuff, DENSITY, clamped)
        found.append(solve_modes(model.pencil, 1).eigenvalues[0])
    assert 0.7 < estimated.bending / (found[0] / found[1]) < 1.7


def test_blocks_have_factors_of_one():
    points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 0.5), (4, 4, 1))
    nothing = np.zeros(points.shape, bool)
    assert estimate_locking(points, tetrahedra, STUFF, nothing) == (1.0, 1.0)
    assert proportions_of(points, tetrahedra).layers == np.inf
    layers = proportions_of(*build_lattice((0, 1, 0, 1, 0, 0.1), (4, 4, 3))).layers
    assert layers == pytest.approx(3)


@pytest.mark.parametrize("normal", [0, 1, 2])
def test_any_axis_can_be_the_thin_one(normal):
    points, tetrahedra, _ = square(5, 1, 20, 1)
    estimated = estimate_locking(points, tetrahedra, STUFF, hold_sides(points))
    turned = np.roll(points, normal + 1, axis=1)
    clamped = np.roll(hold_sides(points), normal + 1, axis=1)
    np.testing.assert_allclose(
        estimate_locking(turned, tetrahedra, STUFF, clamped), estimated, rtol=1e-9
    )
    quadratic = add_midpoints(points, tetrahedra)
    estimated = estimate_locking(*quadratic, STUFF, hold_sides(quadratic[0]))
    turned = np.roll(quadratic[0], normal + 1, axis=1)
    clamped = np.roll(hold_sides(quadratic[0]), normal + 1, axis=1)
    np.testing.assert_allclose(
        estimate_locking(turned, quadratic[1], STUFF, clamped), estimated, rtol=1e-9
    )


def prisms(cells, thickness, seed):
    """A square sheet of prisms on an irregular triangulation, three tetrahedra each."""
    from scipy.spatial import Delaunay

    grid = np.linspace(0, SIDE, cells + 1)
    plane = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    inner = ((plane > 1e-9) & (plane < SIDE - 1e-9)).all(axis=1)
    shift = np.random.default_rng(seed).uniform(-0.25, 0.25, plane.shape) * SIDE / cells
    plane[inner] += shift[inner]
    a, b, c = np.sort(Delaunay(plane).simplices, axis=1).T
    above = len(plane)
    split = [
        (a, b, c, above + c),
        (a, b, above + b, above + c),
        (a, above + a, above + b, above + c),
    ]
    points = np.concatenate([np.c_[plane, np.full(above, z)] for z in (0.0, thickness)])
    return points, np.concatenate([np.stack(four, axis=1) for four in split])


@pytest.mark.parametrize(
    "wide", [*(pytest.param(each, marks=pytest.mark.nightly) for each in (5, 50)), 20]
)
def test_parallel_diagonals_do_not_lock_in_twist(wide):
    """Then twist locks as bending does in linear tetrahedra, and hardly in quadratic ones."""
    thickness = SIDE / 8 / wide
    points, tetrahedra = prisms(8, thickness, seed=0)
    estimated = estimate_locking(points, tetrahedra, STUFF, hold_sides(points))
    bending, twist = measure_locking(points, tetrahedra, thickness)
    assert 0.97 < estimated.bending / bending < 1.3
    assert 0.9 < estimated.twist / twist < 1.3
    points, tetrahedra = add_midpoints(points, tetrahedra)
    bending, twist = measure_locking(points, tetrahedra, thickness)
    assert bending < 1.1
    assert twist < 1.8
    assert estimate_locking(points, tetrahedra, STUFF, hold_sides(points)).twist == pytest.approx(
        1.0
    )


def test_the_readmes_figures():
    """A cage of 100 x 100 x 0.3 mm: how many times too high its first frequencies are."""
    for cells, layers, times in ((20, 2, 14), (5, 3, 55)):
        bending, _ = measure_locking(*square(cells, layers, SIDE / cells / 3e-4, 1))
        assert times <= np.sqrt(bending) < times + 1
    bending, twist = measure_locking(*square(5, 1, SIDE / 5 / 3e-4, 2))
    assert 1.0 < np.sqrt(bending) < 1.03
    assert twist == pytest.approx(199, rel=0.01)  # CalculiX and scikit-fem say the same
    for cells, off in ((5, (1e-3, 0.013, 0.09)), (20, (6e-3, 2e-3, 1e-3))):
        solver = thin_cage(divisions=(cells, cells, 1))
        assert solver.warnings == ()
        found = solver.output.GetFieldData().GetArray("eigenvalues")
        plate = 1e6 * 3e-4**2 / (12 * (1 - 0.3**2)) / DENSITY / SIDE**4
        for mode, known in enumerate((BENDING, TWIST, 21.429)):
            assert abs(np.sqrt(found.GetValue(mode) / plate) / known - 1) < off[mode]


def thin_cage(**settings):
    """A cage of 100 x 100 x 0.3 mm, held by a side, and its solver."""
    box = vtkCubeSource()
    box.SetBounds(0, SIDE, 0, SIDE, 0, 3e-4)
    cage = TetraCage(**settings)
    cage.SetInputConnection(box.GetOutputPort())
    solver = ModalSolver(modes=10)
    solver.SetInputConnection(cage.GetOutputPort())
    solver.update()
    return solver


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"divisions": (20, 20, 2)},
            r"linear tetrahedra bends about 200 times.* about 14 and .* times too high; set "
            r'modal.elements = "sheet" with .*nx, ny, 1.*, or cage.order = 2 with cells ',
        ),
        (
            {"divisions": (5, 5, 3)},
            r"linear.*bends about 3200 times.* 56 and .* times too high.*elements",
        ),
        (
            {"divisions": (5, 5, 1), "order": 2},
            r"quadratic.*twists about 190 times too stiffly.* 14 times too high.*elements = "
            r'"sheet" .*order = 1, or use cells no wider than 4 thicknesses \(1\.2 mm\)',
        ),
    ],
)
def test_thin_cages_cause_a_warning(settings, message):
    with pytest.warns(SpacemapWarning, match=message):
        solver = thin_cage(**settings)
    assert len(solver.warnings) == 1


def test_good_cages_cause_no_warning():
    for settings in ({"divisions": (5, 5, 1), "order": 2}, {"divisions": (20, 20, 3)}):
        box = vtkCubeSource()
        box.SetBounds(0, 1, 0, 1, 0, 0.15)
        cage = TetraCage(**settings)
        cage.SetInputConnection(box.GetOutputPort())
        solver = ModalSolver(modes=2)
        solver.SetInputConnection(cage.GetOutputPort())
        solver.update()
        assert solver.warnings == ()
