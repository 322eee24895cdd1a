"""Modes against closed forms, published tables and LAPACK, by both solvers."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from pencils import solve_matrices, stiffness_and_mass

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.elements.elasticity import nodal_mass
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.linalg import lanczos
from spacemap_vtk.mechanics.modal import eigen
from spacemap_vtk.mechanics.modal.eigen import estimate_bytes, solve_modes
from spacemap_vtk.mechanics.modal.model import Model

CUBE = (0, 1, 0, 1, 0, 1)


@pytest.fixture(params=["dense", "sparse"])
def solver(request, monkeypatch):
    """Send every mesh, whatever its size, to one of the two solvers."""
    monkeypatch.setattr(eigen, "DENSE", 10_000 if request.param == "dense" else 0)
    return request.param


def problem(divisions, bounds=CUBE, fixed=None, young=1e6, poisson=0.3, density=300.0):
    """K, M, what is free, and the points of a lattice held where `fixed` says so."""
    points, tetrahedra = build_lattice(bounds, divisions)
    K, M = stiffness_and_mass(points, tetrahedra, isotropic(young, poisson), density)
    held = np.zeros(len(points), bool) if fixed is None else fixed(points)
    return K, M, np.repeat(~held, 3), points


def is_top(points):
    return points[:, 1] == points[:, 1].max()


def is_left(points):
    return points[:, 0] == points[:, 0].min()


def lapack(K, M, free):
    """All eigenvalues, by the full generalised driver."""
    return la.eigh(K[free][:, free].toarray(), M[free][:, free].toarray(), driver="gvd")[0]


def as_columns(shapes):
    return shapes.reshape(len(shapes), -1).T


def check(K, M, free, eigenvalues, shapes):
    """Every promise of `solve_matrices` that needs no other solution."""
    S = as_columns(shapes)
    assert (np.diff(eigenvalues) >= 0).all()
    assert abs(S.T @ (M @ S) - np.eye(len(eigenvalues))).max() <= 1e-10
    assert not S[~free].any()
    force = (K @ S)[free]
    residual = np.linalg.norm(force - (M @ S)[free] * eigenvalues, axis=0)
    rigid = eigenvalues == 0
    assert (residual <= 1e-6 * np.linalg.norm(force, axis=0))[~rigid].all()
    assert (residual <= 1e-12 * np.linalg.norm(abs(K) @ abs(S), axis=0))[rigid].all()
    largest = abs(S).max(axis=0)
    first = (abs(S) >= (1 - 1e-6) * largest).argmax(axis=0)
    assert (S[first, range(S.shape[1])] > 0).all()


def test_modes_of_the_papers_cage_satisfy_the_equations(solver):
    K, M, free, points = problem((5, 5, 1), (0, 1, 0, 1, 0, 0.1), is_top)
    assert len(points) == 72
    assert free.sum() == 180
    eigenvalues, shapes = solve_matrices(K, M, free, 30)
    assert shapes.shape == (30, 72, 3)
    check(K, M, free, eigenvalues, shapes)
    np.testing.assert_allclose(eigenvalues, lapack(K, M, free)[:30], rtol=1e-9)


def test_both_solvers_find_the_same_modes(monkeypatch):
    case = problem((5, 5, 1), (0, 1, 0, 1, 0, 0.1), is_top)
    found = []
    for limit in (10_000, 0):
        monkeypatch.setattr(eigen, "DENSE", limit)
        found.append(solve_matrices(*case[:3], 20))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-10)
    assert (np.diff(found[0][0]) > 1e-6 * found[0][0][1:]).all()  # single, so modes are unique
    np.testing.assert_allclose(*(shapes for _, shapes in found), atol=1e-6 * found[0][1].max())


@pytest.mark.parametrize("divisions", [(4, 4, 3), (40, 2, 1)])
def test_free_body_has_six_rigid_modes(solver, divisions):
    bounds = tuple(np.ravel([(0, 0.25 * n) for n in divisions]))
    K, M, free, points = problem(divisions, bounds)
    eigenvalues, shapes = solve_matrices(K, M, free, 10)
    check(K, M, free, eigenvalues, shapes)
    assert (eigenvalues[:6] == 0).all()
    assert eigenvalues[6] > 0
    np.testing.assert_allclose(eigenvalues[6:], lapack(K, M, free)[6:10], rtol=1e-8)
    rigid = [np.tile(axis, len(points)) for axis in np.eye(3)]
    rigid += [np.cross(axis, points).ravel() for axis in np.eye(3)]
    S = as_columns(shapes[:6])
    missed = S - la.orth(np.transpose(rigid)) @ (la.orth(np.transpose(rigid)).T @ S)
    assert np.linalg.norm(missed) <= 1e-8 * np.linalg.norm(S)


@pytest.mark.parametrize("count", [1, 3, 5, 6, 7])
def test_any_number_of_modes_of_a_free_body_can_be_requested(monkeypatch, count):
    monkeypatch.setattr(eigen, "DENSE", 0)
    K, M, free, _ = problem((5, 4, 3))
    eigenvalues, shapes = solve_matrices(K, M, free, count)
    check(K, M, free, eigenvalues, shapes)
    assert (eigenvalues == 0).sum() == min(count, 6)


@pytest.mark.parametrize(("held", "rigid"), [(1, 3), (2, 1), (3, 0)])
def test_body_held_at_a_vertex_keeps_three_rotations(solver, held, rigid):
    corners = [0, 4, 20][:held]
    K, M, free, _ = problem((4, 4, 4), fixed=lambda p: np.isin(np.arange(len(p)), corners))
    eigenvalues, shapes = solve_matrices(K, M, free, 8)
    check(K, M, free, eigenvalues, shapes)
    assert (eigenvalues == 0).sum() == rigid


def test_square_has_double_eigenvalues(solver):
    # Bending of a clamped column of square section, either way; (2, 2) keeps the symmetry.
    K, M, free, _ = problem((10, 2, 2), (0, 5, 0, 1, 0, 1), is_left)
    eigenvalues, shapes = solve_matrices(K, M, free, 12)
    check(K, M, free, eigenvalues, shapes)
    assert eigenvalues[0] == pytest.approx(eigenvalues[1], rel=1e-9)
    assert eigenvalues[3] == pytest.approx(eigenvalues[4], rel=1e-9)  # torsion lies between
    np.testing.assert_allclose(eigenvalues, lapack(K, M, free)[:12], rtol=1e-9)
    odd = solve_matrices(K, M, free, 4)[0]  # the second pair cut in two
    np.testing.assert_allclose(odd, eigenvalues[:4], rtol=1e-9)


def test_cube_has_triple_eigenvalues(solver):
    K, M, free, _ = problem((4, 4, 4))
    eigenvalues, _ = solve_matrices(K, M, free, 30)
    exact = lapack(K, M, free)[6:30]
    assert (abs(exact[2:] - exact[:-2]) < 1e-9 * exact[2:]).any()
    np.testing.assert_allclose(eigenvalues[6:], exact, rtol=1e-9)


def test_equal_pieces_have_multiple_eigenvalues(solver):
    # ARPACK silently misses copies here: see the head of lanczos.py.
    K, M, free, _ = problem((3, 3, 3), fixed=is_top)
    one = lapack(K, M, free)
    copies = 12
    K, M = (sp.block_diag([matrix] * copies, format="csr") for matrix in (K, M))
    eigenvalues, shapes = solve_matrices(K, M, np.tile(free, copies), 50)
    np.testing.assert_allclose(eigenvalues, np.repeat(one, copies)[:50], rtol=1e-9)
    check(K, M, np.tile(free, copies), eigenvalues, shapes)


def test_each_unsupported_piece_has_six_rigid_modes():
    K, M, free, _ = problem((2, 2, 2))
    K, M = (sp.block_diag([matrix] * 3, format="csr") for matrix in (K, M))
    eigenvalues, _ = solve_matrices(K, M, np.tile(free, 3), 20)
    assert (eigenvalues == 0).sum() == 18


@pytest.mark.parametrize("scale", [1e-6, 1e3])
def test_length_and_material_only_scale_the_modes(solver, scale):
    reference = solve_matrices(*problem((8, 6, 1), (0, 1, 0, 1, 0, 0.1), is_top)[:3], 15)
    bounds = tuple(scale * x for x in (0, 1, 0, 1, 0, 0.1))
    case = problem((8, 6, 1), bounds, is_top, young=1e6 * 200e3, density=300 * 1e-9)
    eigenvalues, shapes = solve_matrices(*case[:3], 15)
    check(*case[:3], eigenvalues, shapes)
    ratio = 200e3 / 1e-9 / scale**2
    np.testing.assert_allclose(eigenvalues, ratio * reference[0], rtol=1e-9)
    free = solve_matrices(*problem((4, 4, 2), (0, scale, 0, scale, 0, scale / 2))[:3], 10)[0]
    assert (free == 0).sum() == 6


def bar(cells, lumped):
    """First axial frequency of a free bar over its exact value c/2L, less 1."""
    width = 1 / cells
    points, tetrahedra = build_lattice((0, 1, 0, width, 0, width), (cells, 1, 1))
    K, M = stiffness_and_mass(points, tetrahedra, isotropic(1.0, 0.0), 1.0)
    if lumped:
        M = sp.diags(np.repeat(nodal_mass(points, tetrahedra, 1.0), 3)).tocsr()
    free = np.arange(K.shape[0]) % 3 == 0
    eigenvalues = solve_matrices(K, M, free, 2)[0]
    assert eigenvalues[0] == 0
    return math.sqrt(eigenvalues[1]) / math.pi - 1


def test_free_bar_converges_with_order_two():
    # Percent, for 8, 16 and 32 cells.
    for lumped, published, digits in (
        (False, (0.485, 0.121, 0.030), (5e-4, 5e-4, 5e-4)),
        (True, (-0.80, -0.20, -0.050), (5e-3, 5e-3, 5e-4)),
    ):
        errors = [100 * bar(cells, lumped) for cells in (8, 16, 32)]
        for error, value, digit in zip(errors, published, digits, strict=True):
            assert error == pytest.approx(value, abs=digit)
        assert math.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize(
    ("cells", "first"),
    [
        (1, 13.277),
        (2, 9.803),
        (3, 8.879),
        (4, 8.533),
        pytest.param(6, 8.272, marks=pytest.mark.nightly),
    ],
)
def test_cantilever_frequency_converges_to_beam_theory(cells, first):
    K, M, free, points = problem(
        (10 * cells, cells, cells), (0, 10, 0, 1, 0, 1), is_left, young=200e9, density=8000.0
    )
    eigenvalues, shapes = solve_matrices(K, M, free, 8)
    check(K, M, free, eigenvalues, shapes)
    frequencies = np.sqrt(eigenvalues) / (2 * np.pi)
    assert frequencies[0] == pytest.approx(first, abs=5e-4)
    assert frequencies[0] > 8.013  # Timoshenko; conforming elements come from above
    # The axial mode has the most momentum along the bar: 125.0 Hz, and from above too.
    momentum = np.einsum(
        "nvc,vc->nc", shapes, (M @ np.tile([1.0, 0, 0], len(points))).reshape(-1, 3)
    )
    axial = frequencies[abs(momentum[:, 0]).argmax()]
    assert 125.0 < axial < 125.0 * 1.02


def test_spring_mass_chain_has_its_closed_form_modes():
    # Four masses, one component of four vertices each; the last, of a half, is free.
    chain = 1e4 * (2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    chain[3, 3] = 1e4
    K, M = (
        sp.kron(sp.csr_matrix(matrix), np.diag([1.0, 0, 0]), format="csr")
        for matrix in (chain, np.diag([1, 1, 1, 0.5]))
    )
    eigenvalues, shapes = solve_matrices(K, M, np.arange(12) % 3 == 0, 9)
    frequencies = np.sqrt(eigenvalues) / (2 * np.pi)
    exact = 100 / np.pi * np.sin(np.pi / 16 * np.array([1, 3, 5, 7]))
    np.testing.assert_allclose(frequencies, exact, rtol=1e-9)
    assert not shapes[:, :, 1:].any()


def test_requesting_too_many_modes_returns_all(solver):
    K, M, free, _ = problem((2, 2, 1), fixed=is_top)
    eigenvalues, shapes = solve_matrices(K, M, free, 10_000)
    assert len(eigenvalues) == free.sum()
    check(K, M, free, eigenvalues, shapes)
    np.testing.assert_allclose(eigenvalues, lapack(K, M, free), rtol=1e-9)
    # Completeness: the modes of all degrees of freedom invert M.
    S = as_columns(shapes)[free]
    np.testing.assert_allclose(S @ S.T @ M[free][:, free].toarray(), np.eye(len(S)), atol=1e-10)


def test_repeated_solutions_are_identical(solver):
    case = problem((6, 6, 2), fixed=is_top)[:3]
    first, second = (solve_matrices(*case, 12) for _ in range(2))
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


def test_modes_do_not_depend_on_the_shift(monkeypatch):
    monkeypatch.setattr(eigen, "DENSE", 0)
    case = problem((10, 10, 2), (0, 1, 0, 1, 0, 0.1))
    reference, right = solve_matrices(*case[:3], 12)[0], lanczos.choose_shift
    for factor in (1e-3, 1e2, 1e3):
        monkeypatch.setattr(lanczos, "choose_shift", lambda k, m, f=factor: f * right(k, m))
        eigenvalues = solve_matrices(*case[:3], 12)[0]
        assert (eigenvalues[:6] == 0).all()
        np.testing.assert_allclose(eigenvalues[6:], reference[6:], rtol=1e-8)


def test_shift_is_near_the_first_elastic_eigenvalue():
    for divisions, bounds, fixed in (
        ((8, 8, 8), CUBE, is_top),
        ((8, 8, 8), CUBE, None),
        ((16, 16, 2), (0, 1, 0, 1, 0, 0.1), is_top),
    ):
        K, M, free, _ = problem(divisions, bounds, fixed)
        first = solve_matrices(K, M, free, 7)[0][0 if fixed else 6]
        assert 1e-3 * first < lanczos.choose_shift(K[free][:, free], M[free][:, free]) < 10 * first


@pytest.fixture
def dropping_modes(monkeypatch):
    """Let the iteration lose its second mode, as often as is asked for."""
    monkeypatch.setattr(eigen, "DENSE", 0)
    right, lost = lanczos.lowest_modes, []

    def lose(*arguments, **options):
        count = arguments[3]
        values, modes = right(*arguments[:3], count + 1, *arguments[4:], **options)
        lost.append(options["seed"])
        kept = np.arange(count + 1) != (1 if len(lost) <= lose.times else count)
        return values[kept], modes[:, kept]

    lose.times, lose.lost = 1, lost
    monkeypatch.setattr(eigen, "lowest_modes", lose)
    return lose


def test_missed_mode_is_detected_and_found(dropping_modes):
    case = problem((5, 5, 1), (0, 1, 0, 1, 0, 0.1), is_top)[:3]
    eigenvalues, _ = solve_matrices(*case, 12)
    np.testing.assert_allclose(eigenvalues, lapack(*case)[:12], rtol=1e-9)
    assert dropping_modes.lost == [0, 1]


def test_mode_that_stays_missed_is_an_error(dropping_modes):
    dropping_modes.times = 100
    with pytest.raises(SolverError, match=r"(\d+) modes lie below .* Hz, but \d+ were"):
        solve_matrices(*problem((5, 5, 1), (0, 1, 0, 1, 0, 0.1), is_top)[:3], 12)


def test_progress_rises_from_0_to_1_and_may_cancel(solver):
    case = problem((6, 6, 2), fixed=is_top)[:3]
    reported = []
    solve_matrices(*case, 12, reported.append)
    assert reported[0] == 0
    assert reported[-1] == 1
    assert (np.diff(reported) >= 0).all()
    if solver == "sparse":
        assert len(reported) > 5

    def cancel(share):
        if share > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_matrices(*case, 12, cancel)


def test_fully_fixed_cage_is_refused():
    K, M, free, _ = problem((2, 2, 1))
    with pytest.raises(InputError, match="fixed"):
        solve_matrices(K, M, np.zeros_like(free), 3)


def test_arguments_are_checked():
    K, M, free, _ = problem((2, 2, 1), fixed=is_top)
    with pytest.raises(InputError, match="count"):
        solve_matrices(K, M, free, 0)
    stray = [sp.block_diag([matrix, sp.csr_matrix((3, 3))], format="csr") for matrix in (K, M)]
    with pytest.raises(InputError, match=r"3 free components have no mass.*index 54"):
        solve_matrices(*stray, np.append(free, [True] * 3), 3)


def test_indefinite_stiffness_is_refused(solver):
    K, M, free, _ = problem((4, 4, 2), fixed=is_top)
    with pytest.raises(SolverError):
        solve_matrices(-K, M, free, 5)


def test_inaccurate_modes_are_refused(monkeypatch):
    monkeypatch.setattr(eigen, "DENSE", 0)
    right = lanczos.lowest_modes

    def poor(*arguments, **options):
        values, modes = right(*arguments, **options)
        return values, modes + 1e-3 * abs(modes).max() * np.cos(np.arange(modes.size)).reshape(
            modes.shape
        )

    monkeypatch.setattr(eigen, "lowest_modes", poor)
    with pytest.raises(SolverError, match="residual"):
        solve_matrices(*problem((4, 4, 2), fixed=is_top)[:3], 5)


def test_memory_is_estimated_from_above_and_in_order():
    assert estimate_bytes(180, 30) > 8 * 2 * 180**2
    assert estimate_bytes(5000, 5000) > 8 * 3 * 5000**2
    # Measured with 30 modes, and 0.2 GB for the matrices: a slab of four layers and a cube.
    assert 0.6e9 < estimate_bytes(99_630, 30, 4) < 0.9e9
    assert 1.0e9 < estimate_bytes(89_280, 30) < 1.3e9
    assert estimate_bytes(98_208, 30, math.inf) == estimate_bytes(98_208, 30)
    assert estimate_bytes(99_630, 300, 4) > estimate_bytes(99_630, 30, 4)


@pytest.mark.parametrize("aspect", [1e4, 1e5])
@pytest.mark.parametrize("clamped", [True, False])
def test_very_thin_sheet_has_all_its_modes(aspect, clamped):
    """Leissa, Vibration of Plates (1969), ω a² √(ρh/D): by one side, and free; ν = 0.3."""
    thickness = 1 / aspect
    points, cells = build_lattice((0, 1, 0, 1, 0, thickness), (16, 16, 1))
    held = np.repeat(points[:, 1:2] == 1.0, 3, axis=1) & clamped
    model = Model(points, cells, homogeneous_plate(isotropic(1e6, 0.3), thickness), 1.0, held)
    eigenvalues, _, rounding = solve_modes(model.pencil, 9)
    rigid = 0 if clamped else 6
    assert (eigenvalues == 0.0).sum() == rigid
    assert rounding.max() < 1e-4
    known = (3.4917, 8.5246, 21.429) if clamped else (13.489, 19.789, 24.432)
    rigidity = 1e6 * thickness**2 / (12 * (1 - 0.3**2))
    found = np.sqrt(eigenvalues[rigid:][:3] * model.modulus / rigidity)
    np.testing.assert_allclose(found, known, rtol=0.02)


def test_component_without_low_modes_is_not_solved(monkeypatch):
    """A sheet's thickness, whose modes lie so close together that no iteration tells them apart."""
    points, cells = build_lattice((0, 1, 0, 1, -0.1, 0.1), (8, 8, 1))
    held = np.repeat(points[:, 1:2] == 1.0, 3, axis=1)
    model = Model(points, cells, homogeneous_plate(isotropic(1e6, 0.3), 0.2), 1.0, held)
    pencil = model.pencil
    known = solve_modes(pencil, 12).eigenvalues
    sizes = []

    def solved(solve, stiffness, *rest, **options):
        sizes.append(stiffness.shape[0])
        return lanczos.lowest_modes(solve, stiffness, *rest, **options)

    monkeypatch.setattr(eigen, "DENSE", 0)
    monkeypatch.setattr(eigen, "lowest_modes", solved)
    np.testing.assert_allclose(solve_modes(pencil, 12).eigenvalues, known, rtol=1e-9)
    assert sizes == [3 * 72, 2 * 72]
    assert sum(part.size for part in pencil.components) == 6 * 72
