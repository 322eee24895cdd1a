"""Modes of cages with inclined sliders and rigid pieces: against turned cages, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary.fittings import Fittings, point_masses, spring_stiffness
from spacemap_vtk.mechanics.boundary.supports import held_directions, rigid_bodies
from spacemap_vtk.mechanics.boundary.time_functions import step
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.model import Model

E, RHO = 2e6, 300.0
KINDS = ("linear", "quadratic", "sheet")


def cage(kind, size=(0.1, 0.06, 2e-3), divisions=(5, 4, 1), nu=0.3):
    """Vertices, cells and material."""
    points, cells = build_lattice((0, size[0], 0, size[1], 0, size[2]), divisions)
    material = isotropic(E, nu)
    if kind == "sheet":
        return points, cells, homogeneous_plate(material, size[2], 2)
    if kind == "quadratic":
        points, cells = add_midpoints(points, cells)
    return points, cells, material


def frequencies(model, count):
    return np.sqrt(model.modes(count).eigenvalues * model.modulus / model.density)


@pytest.mark.parametrize("kind", KINDS)
def test_inclined_slider_equals_a_rotated_axis_slider(kind):
    points, cells, material = cage(kind)
    side, corner = points[:, 0] == 0, (points[:, :2] == points[:, :2].max(axis=0)).all(axis=1)
    held = np.zeros(points.shape, bool)
    held[side, 0] = held[corner] = True
    straight = Model(points, cells, material, RHO, held)
    turn = expm(np.cross(np.eye(3), 0.5 * np.array([0.6, 0.3, 0.74])))
    masks = {"side": side, "corner": corner}.get
    n = turn[:, 0].tolist()
    normals = held_directions(points, [f"mask(side):({n[0]!r}, {n[1]!r}, {n[2]!r})"], masks)
    inclined = Model(
        points @ turn.T,
        cells,
        material,
        RHO,
        np.repeat(corner[:, None], 3, axis=1),
        fittings=Fittings(normals=normals),
    )
    assert inclined.pencil.size == straight.pencil.size
    assert inclined.rigid_modes.shape == straight.rigid_modes.shape
    one, two = frequencies(straight, 8), frequencies(inclined, 8)
    np.testing.assert_allclose(two, one, rtol=1e-6 if kind == "sheet" else 1e-8)
    # and so are statics, in which the sliders bear what presses on them
    force = np.random.default_rng(0).standard_normal(points.shape)
    expected = straight.statics(force.ravel())[0].reshape(-1, 3) @ turn.T
    moved = inclined.statics((force @ turn.T).ravel())[0].reshape(-1, 3)
    np.testing.assert_allclose(moved, expected, atol=1e-7 * abs(expected).max())
    assert abs(moved[side] @ turn[:, 0]).max() <= 1e-12 * abs(moved).max()
    np.testing.assert_allclose(inclined.movable_mass.sum(), straight.movable_mass.sum(), rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_fully_rigid_body_has_six_motions(kind):
    points, cells, material = cage(kind)
    bodies = rigid_bodies(points, ["box(-inf, inf, -inf, inf, -inf, inf)"])
    nothing = np.zeros(points.shape, bool)
    made = Model(points, cells, material, RHO, nothing, fittings=Fittings(bodies=bodies))
    assert made.pencil.size == made.rigid_modes.shape[1] == 6
    assert not made.modes(20).eigenvalues.any()
    np.testing.assert_allclose(made.movable_mass, RHO * 0.1 * 0.06 * 2e-3, rtol=1e-12)
    # Its moments of inertia are those of the box; a unit of angular acceleration takes I.
    middle = points - points.mean(axis=0)
    spin = np.cross([0, 0, 1.0], middle).ravel()
    inertia = RHO * 0.1 * 0.06 * 2e-3 * (0.1**2 + 0.06**2) / 12
    assert spin @ (made.mass @ spin) == pytest.approx(
        inertia, rel=1e-9 if kind != "linear" else 0.2
    )


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_side_moves_as_one_body(kind):
    points, cells, material = cage(kind)
    right = points[:, 0] == points[:, 0].max()
    bodies = rigid_bodies(points, ["+x"])
    held = np.repeat((points[:, 0] == 0)[:, None], 3, axis=1)
    made = Model(points, cells, material, RHO, held, fittings=Fittings(bodies=bodies))
    free = Model(points, cells, material, RHO, held)
    assert made.pencil.size == free.pencil.size - 3 * right.sum() + 6
    shapes = made.modes(6).shapes
    apart = points[right][:, None] - points[right][None]
    for shape in shapes:
        # Lengths between its points stay: (x_i - x_j) · (u_i - u_j) = 0.
        strain = np.einsum("ijk,ijk->ij", apart, shape[right][:, None] - shape[right][None])
        assert abs(strain).max() <= 1e-12 * abs(shape).max()
    # It constrains: by Rayleigh no frequency falls.
    assert (frequencies(made, 6) >= frequencies(free, 6) * (1 - 1e-9)).all()
    # Held along z at its lower edge it neither rises there nor turns about x: four motions.
    held = held.copy()
    held[right & (points[:, 2] == 0), 2] = True
    hinged = Model(points, cells, material, RHO, held, fittings=Fittings(bodies=bodies))
    assert hinged.pencil.size == made.pencil.size - 2
    lower = hinged.modes(4).shapes[:, right & (points[:, 2] == 0), 2]
    assert abs(lower).max() <= 1e-12 * abs(hinged.modes(4).shapes).max()


@pytest.mark.parametrize("kind", ["quadratic", "sheet"])
def test_strip_with_a_rigid_end_has_closed_form_frequencies(kind):
    # Euler and Bernoulli's cantilever of length L, at its tip a rigid block of length a: of mass m,
    # its middle at c = a/2 and J about it; w = cosh - cos - s (sinh - sin), and at the tip
    # EI w'' = ω² ((J + m c²) w' + m c w),  EI w''' = -ω² (m w + m c w').
    length, block, width, height = 0.1, 0.04, 0.02, 1e-3
    points, cells, material = cage(kind, (length + block, width, height), (28, 2, 1), nu=0.0)
    bodies = rigid_bodies(points, [f"box({length}, inf, -inf, inf, -inf, inf)"])
    assert (bodies == 1).sum() > 8
    held = np.repeat((points[:, 0] == 0)[:, None], 3, axis=1) | [False, True, False]
    made = Model(points, cells, material, RHO, held, fittings=Fittings(bodies=bodies))
    per_length, bending = RHO * width * height, E * width * height**3 / 12
    m, c = per_length * block, block / 2
    inertia = m * (block**2 + height**2) / 12 + m * c * c

    def determinant(beta):
        x, omega2 = beta * length, bending * beta**4 / per_length
        cosh, sinh, cos, sin = np.cosh(x), np.sinh(x), np.cos(x), np.sin(x)
        w = np.array([cosh - cos, sinh - sin])
        slope = beta * np.array([sinh + sin, cosh - cos])
        moment = bending * beta**2 * np.array([cosh + cos, sinh + sin])
        force = bending * beta**3 * np.array([sinh - sin, cosh + cos])
        rows = (
            moment - omega2 * (inertia * slope + m * c * w),
            force + omega2 * (m * w + m * c * slope),
        )
        return float(np.linalg.det(np.array(rows)))

    betas = np.linspace(1.0, 60.0, 2000)
    values = [determinant(b) for b in betas]
    roots = [
        brentq(determinant, a, b)
        for a, b, u, v in zip(betas, betas[1:], values, values[1:], strict=False)
        if u * v < 0
    ]
    exact = np.array(roots[:2]) ** 2 * np.sqrt(bending / per_length)
    np.testing.assert_allclose(frequencies(made, 2), exact, rtol=0.01)


def test_two_bodies_with_masses_on_them_balance():
    # Two rigid halves of a bar with a soft middle, free: ω² = k (1/m₁ + 1/m₂), k = E A / d.
    points, cells = add_midpoints(*build_lattice((0, 0.12, 0, 1e-3, 0, 1e-3), (12, 1, 1)))
    held = np.repeat([[False, True, True]], len(points), axis=0)
    bodies = rigid_bodies(
        points, ["box(-inf, 0.0501, -inf, inf, -inf, inf) box(0.0699, inf, -inf, inf, -inf, inf)"]
    )
    light, masses = 1e-3, point_masses(points, cells, ["-x 20 g", "+x 5 g"])
    fitted = Fittings(bodies=bodies, masses=masses)
    made = Model(points, cells, isotropic(E, 0.0), light, held, fittings=fitted)
    values = made.modes(3).eigenvalues * made.modulus / made.density
    stiffness = E * 1e-6 / 0.02
    assert not values[0]
    assert values[1] == pytest.approx(stiffness * (1 / 0.02 + 1 / 0.005), rel=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_response_has_the_static_limit_with_fittings(kind):
    points, cells, material = cage(kind)
    normals = held_directions(points, ["-x:(1, 2, 2)", "-y:(1, -1, 0)"])
    fitted = Fittings(
        normals=normals,
        bodies=rigid_bodies(points, ["+x"]),
        masses=point_masses(points, cells, ["+x 2 g"]),
    )
    held = np.repeat(((points == points.min(axis=0)).all(axis=1))[:, None], 3, axis=1)
    held |= (points[:, 2] == 0)[:, None] & [False, False, True]
    made = Model(points, cells, material, RHO, held, fittings=fitted)
    found = made.modes(5)
    values, shapes = found.eigenvalues * made.modulus / RHO, found.shapes / RHO**0.5
    modes = CageModes(made, values, shapes.reshape(5, -1), found.rounding)
    load = modes.load_vector("gravity", (1.0, 2.0, -9.81), step())
    basis = modes.basis([load])
    force = modes.vertex_forces(load)
    assert force.reshape(-1, 3).sum(axis=0)[2] == pytest.approx(
        -9.81 * (RHO * 0.1 * 0.06 * 2e-3 + 2e-3), rel=1e-9
    )
    static = (basis.shapes @ force / basis.eigenvalues) @ basis.shapes
    np.testing.assert_allclose(static, made.statics(force)[0], atol=1e-8 * abs(static).max())


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_box_on_soft_springs_has_closed_form_frequencies(kind):
    # ω² = k/m up and down, though the springs are 10¹² times softer than the box's material.
    points, cells, material = cage(kind)
    everywhere = "box(-inf, inf, -inf, inf, -inf, inf)"
    springs = spring_stiffness(points, cells, [f"{everywhere} 1e-7 N/m"])
    fitted = Fittings(bodies=rigid_bodies(points, [everywhere]), springs=springs)
    made = Model(points, cells, material, RHO, np.zeros(points.shape, bool), fittings=fitted)
    modes = made.modes(6)
    values = modes.eigenvalues * made.modulus / made.density
    mass = RHO * 0.1 * 0.06 * 2e-3
    assert made.rigid_modes.shape[1] == 0
    assert (abs(values / (1e-7 / mass) - 1) < 1e-9).sum() >= 3
    weight = np.zeros_like(points)
    weight[:, 2] = -made.nodal_mass
    np.testing.assert_allclose(
        made.statics(weight.ravel())[0].reshape(-1, 3),
        [[0, 0, -mass / 1e-7]] * len(points),
        rtol=1e-6,
        atol=1e-6 * mass / 1e-7,
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("spring", "free"),
    [
        (["-x:x 1 N/m"], 3),
        (["-x:(1, 2, 3) 1 N/m"], 3),
        (["+y 2 N/m", "-x:z 1 N/m"], 0),
    ],
)
def test_rigid_box_partly_on_springs_has_closed_form_frequencies(kind, spring, free):
    # Its six degrees of freedom by hand: K = Σ Rᵀ k R, M of the box, about its middle.
    points, cells, material = cage(kind)
    springs = spring_stiffness(points, cells, spring)
    bodies = rigid_bodies(points, ["box(-inf, inf, -inf, inf, -inf, inf)"])
    fitted = Fittings(bodies=bodies, springs=springs)
    made = Model(points, cells, material, RHO, np.zeros(points.shape, bool), fittings=fitted)
    away = points - points.mean(axis=0)
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for axis in range(3):
        motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], away)
    flat = motions.reshape(-1, 6)
    stiffness = np.einsum("vim,vij,vjn->mn", motions, springs, motions)
    inertia = flat.T @ (made.mass @ flat)
    expected = eigh(stiffness, inertia, eigvals_only=True)
    assert made.rigid_modes.shape[1] == free
    found = made.modes(6).eigenvalues * made.modulus / made.density
    assert not found[:free].any()
    np.testing.assert_allclose(found[free:], expected[free:], rtol=1e-8)
    force = np.zeros_like(points)
    force[:, 0] = made.nodal_mass
    expected = motions @ np.linalg.pinv(stiffness, rcond=1e-9) @ (flat.T @ force.ravel())
    if free == 0:
        moved = made.statics(force.ravel())[0].reshape(-1, 3)
        np.testing.assert_allclose(moved, expected, atol=1e-8 * abs(expected).max())


def test_single_degree_of_freedom_is_solved():
    # One corner of a tetrahedron, up and down: a spring of E V/h², with a tenth of its mass.
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    held = np.arange(12).reshape(4, 3) < 11
    made = Model(corners, [[0, 1, 2, 3]], isotropic(1e6, 0.0), 1000.0, held)
    np.testing.assert_allclose(made.statics(np.eye(12)[11])[0][11], 6e-6, rtol=1e-12)
    assert frequencies(made, 1)[0] ** 2 == pytest.approx(1e6 / 6 / (1000.0 / 60), rel=1e-12)
