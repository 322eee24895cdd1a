"""Sheets on the pairs of vertices of a one-layer lattice, against plates and beams of the books."""

from __future__ import annotations

import math

import numpy as np
import pytest
import pyvista as pv
import scipy.linalg as la
import scipy.sparse.linalg as sla
from numpy.typing import NDArray

from spacemap_vtk import TetraCage
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.mechanics.elements.materials import isotropic, orthotropic
from spacemap_vtk.mechanics.elements.plates import apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.elements.shell import (
    MidSurface,
    find_layer,
    find_mid_surface,
    sheet_strains,
)
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.equilibrium.energy_terms import assemble_tangent
from spacemap_vtk.mechanics.modal.model import Model

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

E, NU, RHO = 1e6, 0.3, 300.0
STUFF, BEAM = isotropic(E, NU), isotropic(E, 0.0)


def mid_surface_of(points: FloatArray, cells: IntArray) -> MidSurface:
    surface = find_mid_surface(points, cells)
    assert surface is not None
    return surface


def carved(thickness: float) -> tuple[FloatArray, IntArray]:
    """Return a cage with holes, of one layer in the paper's plane."""
    ring = pv.ParametricTorus(ringradius=1.0, crosssectionradius=0.2)
    cage = TetraCage(method="carved", divisions=(9, 9, 1), padding=0.0)
    cage.SetInputDataObject(ring)
    cage.update()
    grid = pv.wrap(cage.output)
    points = np.asarray(grid.points, dtype=np.float64)
    points[:, 2] *= thickness / np.ptp(points[:, 2])
    return points, grid.cells_dict[pv.CellType.TETRA].astype(np.int64)


@pytest.mark.parametrize("normal", [0, 1, 2])
def test_a_lattice_of_one_layer_is_a_sheet_across_any_axis(normal):
    divisions, bounds = (
        np.roll([4, 3, 1], normal + 1),
        np.roll([[0, 4], [1, 3], [0, 0.1]], normal + 1, 0),
    )
    points, cells = build_lattice(bounds.ravel(), divisions)
    surface = mid_surface_of(points, cells)
    assert surface.normal == normal
    assert surface.pairs.shape == (20, 2)
    assert surface.quads.shape == (12, 4)
    upper, lower = points[surface.pairs.T]
    np.testing.assert_allclose(upper - lower, np.tile(0.1 * np.eye(3)[normal], (20, 1)), atol=1e-15)
    # counter-clockwise, seen from above
    middle = surface.to_nodes(points)[surface.quads]
    turned = np.cross(middle[:, 1] - middle[:, 0], middle[:, 2] - middle[:, 0])
    np.testing.assert_allclose(turned @ np.eye(3)[normal], 2 / 3, rtol=1e-12)
    np.testing.assert_allclose(surface.to_vertices(surface.to_nodes(points)), points, atol=1e-15)
    flat = (surface.node_matrix() @ points.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(flat, surface.to_nodes(points), atol=1e-15)
    assert find_layer(points, cells)[:2] == (pytest.approx(0.1), normal)


def test_a_carved_lattice_is_a_sheet_with_holes():
    points, cells = carved(0.05)
    surface = mid_surface_of(points, cells)
    assert 20 < len(surface.quads) == len(cells) // 5 < 81
    assert surface.normal == 2
    np.testing.assert_allclose(surface.thickness(points), 0.05, rtol=1e-6)


def test_sheet_lies_across_the_thinner_of_two_axes():
    for bounds, normal in (((0, 5, 0, 0.2, 0, 0.1), 2), ((0, 5, 0, 0.1, 0, 0.2), 1)):
        assert mid_surface_of(*build_lattice(bounds, (5, 1, 1))).normal == normal


def test_other_meshes_are_not_sheets():
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.1), (4, 4, 1))
    assert find_mid_surface(*build_lattice((0, 1, 0, 1, 0, 0.1), (4, 4, 2))) is None
    assert find_mid_surface(*add_midpoints(points, cells)) is None
    assert find_mid_surface(points, np.random.default_rng(0).permutation(cells)) is None
    assert find_mid_surface(points, cells[:-1]) is None
    assert find_mid_surface(points, cells[:, [1, 0, 3, 2]]) is None  # another program's order
    stray = np.concatenate([points, [[2.0, 0, 0]]])
    assert find_mid_surface(stray, cells) is None
    # a hexahedron upon another one
    tall, blocks = build_lattice((0, 1, 0, 1, 0, 0.1), (4, 4, 2))
    used, cells = np.unique(blocks[: 5 * 17], return_inverse=True)
    assert find_mid_surface(tall[used], cells.reshape(-1, 4)) is None
    with pytest.raises(GeometryError, match=r"lattice of one layer.*divisions"):
        Model(tall, blocks, homogeneous_plate(STUFF, 0.1), RHO, np.zeros(tall.shape, bool))


def clamped(points: FloatArray) -> NDArray[np.bool_]:
    """Hold the side where y is least."""
    return np.repeat(points[:, 1:2] < points[:, 1].min() + 1e-9 * np.ptp(points[:, 1]), 3, axis=1)


def square_sheet(side: float, thickness: float, cells: int, free: bool = False) -> Model:
    """Return a square sheet across z, a cantilever unless it is free."""
    points, tetrahedra = build_lattice((0, side, 0, side, 0, thickness), (cells, cells, 1))
    held = clamped(points) & (not free)
    return Model(points, tetrahedra, homogeneous_plate(STUFF, thickness), RHO, held)


def angular_frequencies(model: Model, count: int) -> FloatArray:
    """Return ω of the lowest modes."""
    return np.sqrt(model.modes(count).eigenvalues * model.modulus / RHO)


def leissa_factors(model: Model, side: float, thickness: float, count: int) -> FloatArray:
    """Return ω a² √(ρh/D) of the lowest modes."""
    rigidity, rate = E * thickness**3 / 12 / (1 - NU**2), angular_frequencies(model, count)
    return rate * side**2 * math.sqrt(RHO * thickness / rigidity)


@pytest.mark.parametrize(
    ("cells", "expected", "most"),
    [
        (5, "3.4927 8.626 23.29 28.92 33.55", 0.1),
        (10, "3.4774 8.538 21.78 27.64 31.60", 0.025),
        (20, "3.4727 8.514 21.41 27.31 31.11", 0.006),
    ],
)
def test_square_cantilever_has_leissas_frequencies(cells, expected, most):
    values = leissa_factors(square_sheet(0.1, 3e-4, cells), 0.1, 3e-4, 6)
    # an independent trial's, to all of its digits
    trial = expected.split()
    assert [f"{v:.{len(e.split('.')[1])}f}" for v, e in zip(values, trial, strict=False)] == trial
    # Leissa 1969, of thin plates by Ritz's method: from above
    exact = np.array([3.4917, 8.5246, 21.429, 27.331, 31.111, 54.443])
    np.testing.assert_allclose(values, exact, rtol=most)


def test_free_square_has_leissas_frequencies():
    """Six rigid modes, and those of a plate of which no side is held."""
    values = leissa_factors(square_sheet(0.1, 3e-4, 20, free=True), 0.1, 3e-4, 11)
    assert not values[:6].any()
    np.testing.assert_allclose(values[6:9], [13.468, 19.596, 24.270], rtol=0.005)
    np.testing.assert_allclose(values[9:], 34.801, rtol=0.005)


def test_frequencies_scale_with_any_thickness():
    """What is as wide in thicknesses vibrates alike, free or held."""
    for free in (False, True):
        sizes = [1e-6, 3e-4, 0.1]
        values = [leissa_factors(square_sheet(333 * h, h, 10, free), 333 * h, h, 12) for h in sizes]
        np.testing.assert_allclose(values[1:], values[:1] * 2, rtol=1e-9)


@pytest.mark.parametrize(
    ("free", "cells"),
    [(False, 5), pytest.param(False, 20, marks=pytest.mark.nightly), (True, 12)],
)
def test_no_digit_is_lost_in_sheets_a_million_times_wider_than_thick(free, cells):
    """And as many modes are rigid as the supports leave: six of a free sheet."""
    found = [square_sheet(ratio, 1.0, cells, free).modes(12) for ratio in (1e4, 1e6, 3e7)]
    # bending's grow as 1/a⁴
    wide, wider, widest = (
        modes.eigenvalues * ratio**4 for modes, ratio in zip(found, (1.0, 1e2, 3e3), strict=True)
    )
    assert (wide == 0).sum() == (6 if free else 0)
    np.testing.assert_allclose(wider, wide, rtol=2e-6)
    assert max(modes.rounding.max() for modes in found[:2]) < 1e-5
    error = abs(widest - wide)[wide > 0] / wide[wide > 0]
    assert (error < found[2].rounding[wide > 0] + 1e-4).all()


@pytest.mark.parametrize("way", ["x", "y", "askew"])
def test_a_sheet_across_any_direction(way):
    expected = leissa_factors(square_sheet(0.1, 3e-4, 8), 0.1, 3e-4, 8)
    points, cells = build_lattice((0, 0.1, 0, 0.1, 0, 3e-4), (8, 8, 1))
    axis = np.array([0.48, 0.6, 0.64])
    turn = {
        "x": np.eye(3)[[1, 2, 0]],
        "y": np.eye(3)[[2, 0, 1]],
        "askew": 2 * np.outer(axis, axis) - np.eye(3),
    }[way]
    held = clamped(points)
    points = points @ turn + [1.0, -2.0, 3.0]
    normal = mid_surface_of(points, cells).normal
    assert normal == {"x": 0, "y": 1}.get(way, normal)
    model = Model(points, cells, homogeneous_plate(STUFF, 3e-4, normal), RHO, held)
    np.testing.assert_allclose(leissa_factors(model, 0.1, 3e-4, 8), expected, rtol=1e-7)


def jittered(points: FloatArray, inner: NDArray[np.bool_], share: float) -> FloatArray:
    """Move inner pairs in the plane by a share of a cell, at random: upper and lower end alike."""
    moved, half = points.copy(), len(points) // 2
    step = np.random.default_rng(0).uniform(-share, share, (half, 2))
    moved[:, :2] += np.tile(step, (2, 1)) * inner[:, None]
    return moved


def test_distorted_quadrilaterals_have_the_same_frequencies():
    points, cells = build_lattice((0, 0.1, 0, 0.1, 0, 3e-4), (10, 10, 1))
    inner = ((points[:, :2] > 1e-9) & (points[:, :2] < 0.1 - 1e-9)).all(axis=1)
    distorted = jittered(points, inner, 0.003)
    model = Model(distorted, cells, homogeneous_plate(STUFF, 3e-4), RHO, clamped(points))
    even = leissa_factors(square_sheet(0.1, 3e-4, 10), 0.1, 3e-4, 6)
    np.testing.assert_allclose(leissa_factors(model, 0.1, 3e-4, 6), even, rtol=0.015)


def meshes(thickness: float) -> dict[str, tuple[FloatArray, IntArray]]:
    """Return sheets of hexahedra that are no boxes, and one with holes."""
    points, cells = build_lattice((0, 1, 0, 1.2, 0, thickness), (5, 6, 1))
    inner = ((points[:, :2] > 1e-9) & (points[:, :2] < np.array([1, 1.2]) - 1e-9)).all(axis=1)
    sheared = points.copy()
    sheared[:, 0] += 0.5 * points[:, 1]
    distorted = jittered(points, inner, 0.06)
    return {
        "boxes": (points, cells),
        "distorted": (distorted, cells),
        "sheared": (sheared, cells),
        "carved": carved(thickness),
    }


FIELDS = {
    # in the plane, and out of it: displacement of places
    "stretch": (lambda x, y: np.stack([0.3 * x + 0.2 * y, 0.2 * x - 0.7 * y, 0 * x], 1), False),
    "bending": (lambda x, y: np.stack([0 * x, 0 * x, 0.5 * x * x - 0.2 * y * y], 1), True),
    "twist": (lambda x, y: np.stack([0 * x, 0 * x, x * y], 1), True),
}


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("mesh", ["boxes", "distorted", "sheared", "carved"])
def test_a_constant_strain_or_curvature_is_found_from_the_rim(mesh, name):
    """The patch test: prescribed on the rim it is there inside, and its energy is in closed form.

    Curvature passes as exactly as stretch: at nodes a quadratic deflection has the slopes that the
    shear of MITC4, sampled on edges, takes for none.
    """
    thickness = 0.01
    points, cells = meshes(thickness)[mesh]
    surface = mid_surface_of(points, cells)
    count, plate = len(surface.pairs), homogeneous_plate(STUFF, thickness)
    strains, rest = sheet_strains(points, surface, plate), surface.to_nodes(points)
    x, y = rest[:count, 0], rest[:count, 1]
    field, bends = FIELDS[name]
    exact = np.zeros_like(rest)
    exact[:count] = field(x, y)
    slope = {"bending": np.stack([x, -0.4 * y], 1), "twist": np.stack([y, x], 1)}
    if bends:  # δ turns as the normal does
        exact[count:, :2] = -thickness / 2 * slope[name]
    matrix = assemble_tangent(strains, rest)
    # the rim: pairs of which fewer than four quadrilaterals are around
    rim = np.bincount(surface.quads.ravel(), minlength=count) < 4
    assert (~rim).sum() > 5
    held = np.repeat(np.tile(rim, 2), 3)
    flat = exact.ravel()
    inside = sla.spsolve(matrix[~held][:, ~held].tocsc(), -(matrix[~held][:, held] @ flat[held]))
    assert abs(inside - flat[~held]).max() < 1e-10 * abs(flat).max()
    # ½ the square of the constant, over the area
    corners = rest[:count][surface.quads]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])[:, 2]
    constant = {"stretch": [0.3, -0.7, 0.4], "bending": [1.0, -0.4, 0.0], "twist": [0, 0, 2.0]}
    matrix_of = plate.bending if bends else plate.membrane
    energy = 0.5 * np.array(constant[name]) @ matrix_of @ constant[name] * across.sum() / 2
    assert 0.5 * flat @ (matrix @ flat) == pytest.approx(energy, rel=1e-10)
    if name == "twist":
        rigidity = E * thickness**3 / 12 / (1 - NU**2)
        assert energy == pytest.approx(rigidity * (1 - NU) * across.sum() / 2)


def hard_supports(points: FloatArray) -> NDArray[np.bool_]:
    """Hold what a hard simple support holds: deflection, and rotation along the edge.

    At an edge across x both vertices of a pair keep y and z, so that neither p nor δ moves there;
    the pair may lean along x. That holds y of the mid-surface too, which bends without it.
    """
    held = np.zeros(points.shape, bool)
    for axis in range(2):
        edge = (points[:, axis] == points[:, axis].min()) | (
            points[:, axis] == points[:, axis].max()
        )
        held[np.ix_(edge, [1 - axis, 2])] = True
    return held


WOVEN = orthotropic([2e6, 5e5, 1e6], [1.5e5, 1e6, 1e6], [0.3, 0.0, 0.0])


@pytest.mark.parametrize("elasticity", [STUFF, WOVEN], ids=["isotropic", "orthotropic"])
def test_simply_supported_plates_have_closed_form_frequencies(elasticity):
    """ω² ρh = π⁴ (D11 m⁴/a⁴ + 2 (D12 + 2 D66) m²n²/a²b² + D22 n⁴/b⁴); order 2."""
    a, b, thickness = 0.15, 0.1, 2e-4
    plate = homogeneous_plate(elasticity, thickness)
    d = plate.bending
    m, n = np.mgrid[1:6, 1:6] * np.pi / np.array([a, b])[:, None, None]
    square_rate = d[0, 0] * m**4 + 2 * (d[0, 1] + 2 * d[2, 2]) * m**2 * n**2 + d[1, 1] * n**4
    exact = np.sqrt(np.sort(square_rate.ravel())[:5] / RHO / thickness)
    errors = []
    for cells in (10, 20):
        points, tetrahedra = build_lattice((0, a, 0, b, 0, thickness), (cells * 3 // 2, cells, 1))
        model = Model(points, tetrahedra, plate, RHO, hard_supports(points))
        errors.append(angular_frequencies(model, 5) / exact - 1)
    assert errors[1].max() < 0.015
    assert abs(errors[1][0]) < 0.003
    np.testing.assert_allclose(errors[0] / errors[1], 4, rtol=0.1)


@pytest.mark.parametrize("supported", [False, pytest.param(True, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    ("stretch", "bend"), [(1.0, 1.0), (1e3, 1e-5), (1e-1, 10.0), (1e9, 1e-12)], ids=str
)
def test_a_sheet_of_any_ratio_of_stretch_to_bending_bends_as_a_thin_plate(stretch, bend, supported):
    side, cells, mass = 0.1, 12, 0.15
    points, tetrahedra = build_lattice((0, side, 0, side, -1.5e-4, 1.5e-4), (cells, cells, 1))
    held = hard_supports(points) if supported else clamped(points)
    made = apply_measurements(
        homogeneous_plate(STUFF, 3e-4), tensile=(stretch,) * 2, bending=(bend,) * 2, ratio=NU
    )
    model = Model(points, tetrahedra, made, mass / 3e-4, held)
    modes = model.modes(model.pencil.size)
    # those across the sheet: where it hardly resists a stretch, all of its plane are lower
    across = (modes.shapes[:, :, 2] ** 2).sum(axis=1) > 0.5 * (modes.shapes**2).sum(axis=(1, 2))
    rate = np.sqrt(modes.eigenvalues[across][:5] * model.modulus / model.density)
    found = rate * side**2 * math.sqrt(mass * (1 - NU**2) / bend)
    if supported:
        np.testing.assert_allclose(found[:3], np.pi**2 * np.array([2, 5, 5]), rtol=0.03)
    else:
        np.testing.assert_allclose(found, [3.4917, 8.5246, 21.429, 27.331, 31.111], rtol=0.02)
    assert modes.rounding[across][:5].max() < 1e-6


def test_thick_plate_has_mindlins_frequencies():
    """Mindlin's plate, simply supported, ten thicknesses wide; its mass turns as a box."""
    side, thickness, wave = 0.1, 0.01, math.pi * math.sqrt(2) / 0.1
    plate, squares = homogeneous_plate(STUFF, thickness), []
    for cells in (10, 20):
        points, tetrahedra = build_lattice((0, side, 0, side, 0, thickness), (cells, cells, 1))
        model = Model(points, tetrahedra, plate, RHO, hard_supports(points))
        squares.append(angular_frequencies(model, 1)[0] ** 2)
    rigidity, shear = E * thickness**3 / 12 / (1 - NU**2), 5 / 6 * E / 2 / (1 + NU) * thickness
    bending = rigidity * wave**2
    inertia, mass = RHO * thickness**3 / 12, RHO * thickness
    stiff = np.array([[bending + shear, shear * wave], [shear * wave, shear * wave**2]])
    exact = la.eigh(stiff, np.diag([inertia, mass]), eigvals_only=True)[0]
    assert squares[1] + (squares[1] - squares[0]) / 3 == pytest.approx(exact, rel=5e-4)
    thin = bending * wave**2 / mass
    assert exact < 0.95 * thin
    # directors that lean along x by y: shear y, the same wherever x is, and twist 1
    lean = np.zeros(points.shape)
    lean[:, 0] = (points[:, 2] - thickness / 2) * points[:, 1]
    energy = shear * side**4 / 6 + rigidity * (1 - NU) / 4 * side**2
    assert 0.5 * lean.ravel() @ (model.stiffness @ lean.ravel()) == pytest.approx(energy, rel=1e-9)
    # about its middle's line along x, as an operator on the vertices
    turn = np.cross([1.0, 0, 0], points - [0, side / 2, thickness / 2]).ravel()
    box = RHO * side**2 * thickness * (side**2 + thickness**2) / 12
    assert turn @ (model.mass @ turn) == pytest.approx(box, rel=1e-12)


def strip(length: float, width: float, thickness: float, cells: int) -> tuple[FloatArray, IntArray]:
    """Return a strip along x, across z."""
    return build_lattice((0, length, 0, width, 0, thickness), (cells, 1, 1))


def test_an_edge_held_by_its_lower_vertices_is_a_hinge():
    """A beam hinged at one end, tan βL = tanh βL; its one rigid mode turns about that line."""
    length, thickness = 1.0, 1e-3
    points, cells = strip(length, 0.05, thickness, 40)
    hinge = (points[:, 0] == 0) & (points[:, 2] == 0)
    # it bends across z alone
    held = hinge[:, None] | (np.arange(3) == 1)
    model = Model(
        points, cells, homogeneous_plate(BEAM, thickness), RHO, np.broadcast_to(held, points.shape)
    )
    assert model.rigid_modes.shape[1] == 1
    turned = model.rigid_modes[:, 0].reshape(-1, 3)
    turned /= turned[-1, 2]
    np.testing.assert_allclose(turned[:, 2], points[:, 0], atol=1e-12)
    np.testing.assert_allclose(turned[:, 0], -points[:, 2], atol=1e-12)
    values = angular_frequencies(model, 4)
    assert (values == 0).sum() == 1
    bending = math.sqrt(E * thickness**2 / 12 / RHO)
    exact = bending * np.array([3.926602, 7.068583, 10.210176]) ** 2 / length**2
    assert (abs(values[1:] / exact - 1) < [0.003, 0.006, 0.012]).all()


def simply_supported(length: float, thickness: float, strain: float, cells: int) -> Model:
    """Return a strip between simple supports, stretched by dead loads: along x it is free."""
    points, tetrahedra = strip(length, 0.05, thickness, cells)
    held = np.zeros(points.shape, bool)
    held[:, 1] = True
    ends = (points[:, 0] == 0) | (points[:, 0] == length)
    held[ends, 2] = True
    moved = np.zeros(points.shape)
    moved[:, 0] = strain * points[:, 0]
    return Model(
        points, tetrahedra, homogeneous_plate(BEAM, thickness), RHO, held, displacement=moved
    )


def test_strip_under_tension_or_pressure_has_closed_form_frequencies():
    """ω² ρh = (nπ/L)² (B (nπ/L)² + N): it buckles at Euler's load, where the first vanishes."""
    length, thickness, cells = 1.0, 2e-3, 30
    bending, wave = E * thickness**3 / 12, np.pi / length
    euler = bending * wave**2

    def lowest(force: float) -> float:
        strain = force / (E * thickness)
        model = simply_supported(length, thickness, strain, cells)
        k, m = (matrix.toarray() for matrix in (model.pencil.stiffness, model.pencil.mass))
        values = la.eigh(k, m, eigvals_only=True, subset_by_index=[0, 1])
        # one of the two is the motion along x
        return float(values[abs(values).argmax()]) * model.modulus / RHO

    unit = euler * wave**2 / RHO / thickness
    for share in (3.0, 1.0, 0.0, -0.5, -0.9):
        assert lowest(share * euler) / unit == pytest.approx(1 + share, abs=0.006)
    # Euler's load, by the secant through two loads near to it
    low, high = lowest(-0.98 * euler), lowest(-1.02 * euler)
    assert low > 0 > high
    found_at = 0.98 + 0.04 * low / (low - high)
    assert found_at == pytest.approx(1.0, abs=0.002)


def test_effective_masses_sum_to_the_movable_mass():
    """The effective masses of all modes sum to what shape functions of a held edge leave."""
    for lumped in (False, True):
        points, cells = build_lattice((0, 1, 0, 1.2, 0, 0.01), (3, 4, 1))
        model = Model(points, cells, homogeneous_plate(STUFF, 0.01), RHO, clamped(points), lumped)
        modes = model.modes(10**6).shapes.reshape(-1, points.size)
        assert len(modes) == model.free.sum()
        np.testing.assert_allclose(
            modes @ (model.mass / RHO @ modes.T), np.eye(len(modes)), atol=1e-9
        )
        along = np.tile(np.eye(3), (len(points), 1))
        factors = modes @ (model.mass @ along) / math.sqrt(RHO)
        np.testing.assert_allclose((factors**2).sum(axis=0), model.movable_mass, rtol=1e-9)
        assert model.nodal_mass.sum() == pytest.approx(RHO * 0.012)
        whole = RHO * 0.012 * np.eye(3)
        np.testing.assert_allclose(along.T @ (model.mass @ along), whole, atol=1e-12)
        # along y alone: hats over four cells, of which the first is held
        line = la.toeplitz([4, 1, 0, 0, 0]) / 6 - np.diag([1, 0, 0, 0, 1]) / 3
        if lumped:
            line = np.diag(line.sum(axis=1))
        whole = line.sum(axis=0)[1:]
        moved = whole @ np.linalg.solve(line[1:, 1:], whole) / 4
        np.testing.assert_allclose(model.movable_mass, RHO * 0.012 * moved, rtol=1e-9)


@pytest.mark.parametrize(("hard", "expected"), [(False, 0.00126532), (True, 0.00406235)])
def test_square_plate_sags_under_pressure_as_in_closed_form(hard, expected):
    """w = α q a⁴/D of a clamped and a simply supported one: Timoshenko and Woinowsky-Krieger."""
    side, thickness, load = 0.2, 2e-4, 0.1
    points, cells = build_lattice((0, side, 0, side, 0, thickness), (20, 20, 1))
    rim = ((points[:, :2] == 0) | (points[:, :2] == side)).any(axis=1)
    held = hard_supports(points) if hard else np.repeat(rim[:, None], 3, axis=1)
    model = Model(points, cells, homogeneous_plate(STUFF, thickness), RHO, held)
    forces = np.zeros(points.shape)
    forces[:, 2] = load * model.nodal_mass / RHO / thickness
    moved = model.statics(forces.ravel())[0].reshape(-1, 3)
    rigidity = E * thickness**3 / 12 / (1 - NU**2)
    assert moved[:, 2].max() * rigidity / load / side**4 == pytest.approx(expected, rel=0.003)
    # both ends of a pair sink alike
    np.testing.assert_allclose(
        moved[: len(points) // 2, 2], moved[len(points) // 2 :, 2], rtol=1e-9
    )


@pytest.mark.parametrize("thin_end", [0.2, 1.0, 0.6])
def test_a_tapering_strip_bends_by_its_thickness_at_each_place(thin_end):
    """δ = F ∫ (L - x)²/(E I(x)) dx, and f₁ by Ritz's method with polynomials; stress is F/(b h)."""
    length, width, thick, force = 0.2, 0.02, 1e-3, 1e-4
    points, cells = build_lattice((0, length, 0, width, -0.5, 0.5), (40, 2, 1))
    local = thick * (1 - (1 - thin_end) * points[:, 0] / length)
    points[:, 2] *= local
    mean = find_layer(points, cells).thickness
    held = np.repeat(points[:, :1] == 0, 3, axis=1)
    model = Model(points, cells, homogeneous_plate(BEAM, mean), RHO, held)
    end = points[:, 0] == length
    share = np.bincount(np.flatnonzero(end), [0.5, 1, 0.5] * 2, len(points))
    pushed = np.zeros(points.shape)
    pushed[:, 2] = force * share / share.sum()
    sunk = model.statics(pushed.ravel())[0].reshape(-1, 3)[end, 2]
    x, weight = np.polynomial.legendre.leggauss(40)
    x, weight = length * (1 + x) / 2, length * weight / 2
    height = thick * (1 - (1 - thin_end) * x / length)
    rigidity, line = E * width * height**3 / 12, RHO * width * height
    exact = force * (weight * (length - x) ** 2 / rigidity).sum()
    np.testing.assert_allclose(sunk, exact, rtol=3e-3)
    powers = np.arange(2, 10)[:, None]
    waves, curved = (x / length) ** powers, powers * (powers - 1) * (x / length) ** (powers - 2)
    bends = (curved * weight * rigidity) @ curved.T / length**4
    rate = la.eigh(bends, (waves * weight * line) @ waves.T, eigvals_only=True)[0] ** 0.5
    assert angular_frequencies(model, 1)[0] == pytest.approx(rate, rel=3e-3)
    # pulled along it, and the stress that is reported
    pushed = pushed[:, [2, 1, 0]] * 100
    _, stress = model.strain_and_stress(model.statics(pushed.ravel())[0].reshape(-1, 3))
    middle = points[cells[::5]].mean(axis=1)[:, 0]
    there = thick * (1 - (1 - thin_end) * middle / length)
    inner = abs(middle - length / 2) < 0.4 * length
    np.testing.assert_allclose(stress[::5][inner, 0], force * 100 / width / there[inner], rtol=0.01)


def test_a_pulled_strip_is_stressed_as_much_as_it_is_pulled():
    """N/h along it, nothing across it, and it narrows by ν: of all five tetrahedra of a cell."""
    length, width, thickness, force = 1.0, 0.2, 1e-3, 3.0
    points, cells = build_lattice((0, length, 0, width, 0, thickness), (6, 2, 1))
    held = np.zeros(points.shape, bool)
    held[points[:, 0] == 0, 0] = True
    held[0], held[points[:, 1] == 0, 1] = True, True
    held[:, 2] = points[:, 2] == 0
    model = Model(points, cells, homogeneous_plate(STUFF, thickness), RHO, held)
    forces = np.zeros(points.shape)
    end = points[:, 0] == length
    across = np.array([0.25, 0.5, 0.25]) * force / 2
    forces[end, 0] = np.tile(across, 2)
    strain, stress = model.strain_and_stress(model.statics(forces.ravel())[0].reshape(-1, 3))
    pulled = force / width / thickness
    assert stress.shape == (len(cells), 6)
    # the thickness of a sheet is a spring of its own: no narrowing of the plane strains it
    expected = np.array([pulled, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(stress, np.tile(expected, (len(cells), 1)), atol=1e-8 * pulled)
    expected = pulled / E * np.array([1, -NU, 0, 0, 0, 0])
    np.testing.assert_allclose(strain, np.tile(expected, (len(cells), 1)), atol=1e-8 * pulled / E)


def test_lumped_mass_brings_the_same_frequencies():
    points, cells = build_lattice((0, 0.1, 0, 0.1, 0, 3e-4), (20, 20, 1))
    model = Model(points, cells, homogeneous_plate(STUFF, 3e-4), RHO, clamped(points), True)
    exact = np.array([3.4917, 8.5246, 21.429, 27.331, 31.111])
    np.testing.assert_allclose(leissa_factors(model, 0.1, 3e-4, 5), exact, rtol=0.02)
