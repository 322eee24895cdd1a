"""Springs and masses on a cage: what they add to each vertex."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.fittings import Fittings, point_masses, spring_stiffness
from spacemap_vtk.mechanics.boundary.loads import find_side_faces, traction_forces
from spacemap_vtk.mechanics.boundary.supports import held_directions, rigid_bodies
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.residual_vectors import participation

LINEAR = build_lattice((0, 2, 0, 3, 0, 1), (3, 4, 2))
QUADRATIC = add_midpoints(*LINEAR)

#: The stiffness of a plate.
PARTS = ("membrane", "bending", "shear", "thickness")


@pytest.mark.parametrize("mesh", [LINEAR, QUADRATIC], ids=["linear", "quadratic"])
def test_foundation_stiffness_is_proportional_to_area(mesh):
    points, cells = mesh
    found = spring_stiffness(points, cells, ["-z:z 1e5 N/m3", "+x 20 kN/m3"])
    assert found is not None
    # What a shift along each axis is resisted with: k A, of 2 x 3 below, of 3 x 1 at the right.
    np.testing.assert_allclose(found.sum(axis=0), np.diag([6e4, 6e4, 6e5 + 6e4]), rtol=1e-12)
    # And a turn about y through the middle of the lower side, k ∫ x² dA = k b a³/12: exact by the
    # middles of edges; by the corners of n strips 2/n² too much, as by the trapezoidal rule.
    below = spring_stiffness(points, cells, ["-z:z 1e5 N/m3"])
    assert below is not None
    exact = 1e5 * 3 * 2**3 / 12 * (1 + 2 / 3**2 * (cells.shape[1] == 4))
    assert (points[:, 0] - 1) ** 2 @ below[:, 2, 2] == pytest.approx(exact, rel=1e-12)


def test_a_spring_is_shared_by_the_vertices_of_its_place():
    points, cells = LINEAR
    found = spring_stiffness(points, cells, ["-x:(0, 3, 4) 12 N/m", "sphere(2, 3, 1, 0.1) 5 N/m"])
    left = points[:, 0] == 0
    normal = np.array([0, 0.6, 0.8])
    each = 12 * np.outer(normal, normal) / left.sum()
    np.testing.assert_allclose(found[left], np.broadcast_to(each, (15, 3, 3)), atol=1e-15)
    corner = (points == [2, 3, 1]).all(axis=1)
    np.testing.assert_array_equal(found[corner], [5 * np.eye(3)])
    assert not found[~left & ~corner].any()
    assert spring_stiffness(points, cells, []) is None


def test_stiffness_per_area_needs_a_side():
    with pytest.raises(InputError, match=r"box.*stiffness per area, which needs a side.*-x, \+x"):
        spring_stiffness(*LINEAR, ["box(0, 1, 0, 1, 0, 1) 5 N/m3"])
    with pytest.raises(InputError, match=r'the spring "sphere.*" contains no vertex'):
        spring_stiffness(*LINEAR, ["sphere(9, 9, 9, 1) 5 N/m"])


def test_masses_add_up():
    points, cells = LINEAR
    mask = np.arange(len(points)) % 7 == 3
    found = point_masses(points, cells, ["-x 30 g", "mask(bead) 0.2 kg"], {"bead": mask}.get)
    assert found is not None
    assert found.sum() == pytest.approx(0.23)
    left = points[:, 0] == 0
    assert found[left].sum() == pytest.approx(
        0.03 + 0.2 * mask[left].mean() * left.sum() / mask.sum()
    )
    # vertices that no edge of the mesh joins share alike
    np.testing.assert_allclose(found[mask & ~left], 0.2 / mask.sum(), rtol=1e-14)
    assert point_masses(points, cells, []) is None
    with pytest.raises(InputError, match=r'the mass "sphere.*" contains no vertex'):
        point_masses(points, cells, ["sphere(9, 9, 9, 1) 5 g"])


@pytest.mark.parametrize("mesh", [LINEAR, QUADRATIC], ids=["linear", "quadratic"])
def test_a_mass_is_spread_evenly_by_length_area_or_volume(mesh):
    """Of a graded mesh: each has the place's own centre, and that of its square is exact."""
    points, cells = mesh[0].copy(), mesh[1]
    if len(points) == len(LINEAR[0]):  # those of quadratic tetrahedra keep their middles
        points[:, :2] = points[:, :2] ** 2 / np.array([2, 3])
    x = points[:, 0]
    for place, mean in (
        ("box(0, 2, 0, 0, 0, 0)", [1, 0, 0]),
        ("-z", [1, 1.5, 0]),
        ("+y", [1, 3, 0.5]),
        ("box(0, 2, 0, 3, 0, 1)", [1, 1.5, 0.5]),
    ):
        found = point_masses(points, cells, [f"{place} 2 kg"])
        assert found.sum() == pytest.approx(2)
        np.testing.assert_allclose(found @ points / 2, mean, atol=1e-12)
    # along the edge a corner has half of the cell beside it, as in a chain of rods
    edge = point_masses(points, cells, ["box(0, 2, 0, 0, 0, 0) 2 kg"])
    own = (points[:, 1:] == 0).all(axis=1)
    places = np.sort(x[own])
    if cells.shape[1] == 4:
        expected = np.diff(places, prepend=0) / 2 + np.diff(places, append=2) / 2
        np.testing.assert_allclose(edge[own][np.argsort(x[own])], expected, rtol=1e-12)


@pytest.mark.parametrize("cells", [2, 5, 10])
def test_limp_strip_does_not_buckle_under_an_even_mass(cells):
    """Spread evenly the hem pulls the strip alike everywhere, and no part of it is pressed."""
    points, tetrahedra = build_lattice((0, 0.1, 0, 0.1, -1.5e-4, 1.5e-4), (cells, 5, 1))
    own = homogeneous_plate(isotropic(1e6, 0.3), 3e-4)
    limp = apply_measurements(own, tensile=(1e3, 1e3), shear=300.0, bending=(1e-7, 1e-7), ratio=0.0)
    held = np.repeat(points[:, 1:2] > 0.1 - 1e-9, 3, axis=1)
    fitted = Fittings(masses=point_masses(points, tetrahedra, ["-y 100 g"]))
    made = Model(points, tetrahedra, limp, RHO, held, fittings=fitted)
    weight = made.nodal_mass[:, None] * [0, -9.81, 0]
    moved, buckled = made.solve_equilibrium(weight.ravel())
    assert buckled is None
    hem = 0.1 * 9.81 / 0.1 / 1e3 * 0.1  # of a strip pulled by m g / b over its length
    np.testing.assert_allclose(moved[points[:, 1] == 0, 1], -hem, rtol=0.01)


# --- closed forms ---------------------------------------------------------------------------------

E, RHO = 2e6, 300.0


def bar(divisions=(16, 1, 1), size=(1.0, 0.1, 0.1), order=2):
    """A bar along x whose points move along x only: no Poisson's ratio, and plane sections."""
    points, cells = build_lattice((0, size[0], 0, size[1], 0, size[2]), divisions)
    if order == 2:
        points, cells = add_midpoints(points, cells)
    held = np.repeat([[False, True, True]], len(points), axis=0)
    return points, cells, held


def frequencies(model, count):
    return np.sqrt(model.modes(count).eigenvalues * model.modulus / model.density)


@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("lumped", [False, True])
def test_bar_with_a_tip_mass_has_closed_form_frequencies(ratio, lumped):
    # cot βL = (m/M) βL, ω = β √(E/ρ); slender, as the tip's points pull its section out of plane
    points, cells, held = bar(size=(1.0, 0.001, 0.001))
    held |= (points[:, 0] == 0)[:, None]
    whole = RHO * 1e-6
    masses = point_masses(points, cells, [f"+x {ratio * whole} kg"])
    made = Model(points, cells, isotropic(E, 0.0), RHO, held, lumped, None, Fittings(masses=masses))
    exact = [
        brentq(lambda x: np.cos(x) - ratio * x * np.sin(x), k * np.pi + 1e-9, (k + 0.5) * np.pi)
        for k in range(3)
    ]
    rtol = 5e-3 if lumped else 2e-4
    found = frequencies(made, 3)
    np.testing.assert_allclose(found[:2], np.array(exact[:2]) * np.sqrt(E / RHO), rtol=rtol)
    # It is weighed, and moves with the modes.
    assert made.nodal_mass.sum() == pytest.approx((1 + ratio) * whole, rel=1e-12)
    modes = made.modes(10**6)
    shapes = modes.shapes.reshape(len(modes.shapes), -1) / made.density**0.5
    effective = participation(shapes, made.nodal_mass) ** 2
    np.testing.assert_allclose(effective.sum(axis=0), made.movable_mass, rtol=1e-9, atol=1e-12)
    # In statics: its weight stretches the bar by (m + M/2) g L / (E A).
    weight = np.zeros_like(points)
    weight[:, 0] = 9.81 * made.nodal_mass
    tip = made.statics(weight.ravel())[0].reshape(-1, 3)[points[:, 0] == 1.0, 0]
    np.testing.assert_allclose(tip, (ratio + 0.5) * whole * 9.81 / (E * 1e-6), rtol=1e-3)


def test_bar_on_an_elastic_foundation_has_closed_form_frequencies():
    # ω² = ω₀² + k/(ρ t), from below and above alike
    thickness = 0.01
    points, cells, held = bar((16, 1, 1), (1.0, 0.1, thickness))
    held |= (points[:, 0] == 0)[:, None]
    stiffness = 0.5 * E * thickness
    springs = spring_stiffness(
        points, cells, [f"{side}:x {stiffness} N/m3" for side in ("-z", "+z")]
    )
    made = Model(
        points, cells, isotropic(E, 0.0), RHO, held, False, None, Fittings(springs=springs)
    )
    beam = (np.arange(3) + 0.5) ** 2 * np.pi**2 * E / RHO
    expected = np.sqrt(beam + 2 * stiffness / (RHO * thickness))
    np.testing.assert_allclose(frequencies(made, 3), expected, rtol=1e-4)


@pytest.mark.parametrize("thin", [False, True], ids=["solid", "sheet"])
def test_a_strip_on_an_elastic_foundation_bends(thin):
    # Cylindrical bending of a clamped strip: ω² = (βL)⁴ B/(ρ h L⁴) + k/(ρ h)
    length, height = 0.1, 1e-3
    points, cells = build_lattice((0, length, 0, 0.02, 0, height), (24, 4, 1))
    material = isotropic(E, 0.0)
    if thin:
        material = homogeneous_plate(material, height, 2)
    else:
        points, cells = add_midpoints(points, cells)
    held = np.repeat((points[:, 0] == 0)[:, None], 3, axis=1) | [False, True, False]
    bending = 1.8751041**4 * E * height**3 / 12 / (RHO * height * length**4)
    foundation = 3 * bending * RHO * height
    springs = spring_stiffness(points, cells, [f"-z:z {foundation} N/m3"])
    plain = Model(points, cells, material, RHO, held)
    made = Model(points, cells, material, RHO, held, False, None, Fittings(springs=springs))
    before, after = (frequencies(each, 1)[0] ** 2 for each in (plain, made))
    assert before == pytest.approx(bending, rel=0.01)
    assert after == pytest.approx(4 * bending, rel=0.01)
    assert after - before == pytest.approx(3 * bending, rel=2e-3)


@pytest.mark.parametrize("kind", ["linear", "quadratic", "sheet"])
def test_spring_holds_a_free_body(kind):
    # Springs along n everywhere: ω² = k/m along it; shifts across it and a turn are free.
    points, cells = build_lattice((0, 0.1, 0, 0.1, 0, 2e-3), (4, 4, 1))
    material = isotropic(E, 0.3)
    if kind == "sheet":
        material = homogeneous_plate(material, 2e-3, 2)
    elif kind == "quadratic":
        points, cells = add_midpoints(points, cells)
    held = np.zeros(points.shape, bool)
    springs = spring_stiffness(
        points, cells, ["box(-inf,inf,-inf,inf,-inf,inf):(1, 2, 2) 0.01 N/m"]
    )
    made = Model(points, cells, material, RHO, held, False, None, Fittings(springs=springs))
    assert made.is_grounded
    assert made.rigid_modes.shape[1] == 3
    found = made.modes(6)
    values = found.eigenvalues * made.modulus / made.density
    assert not values[:3].any()
    assert found.rounding.max() < 1e-4
    shift = 0.01 / (RHO * 0.1 * 0.1 * 2e-3)
    assert abs(values[3:] / shift - 1).min() < 1e-4


@pytest.mark.parametrize("kind", ["linear", "quadratic", "sheet"])
def test_factor_equals_another_material(kind):
    # All cells three times stiffer and twice as heavy, and half of them against two materials.
    points, cells = build_lattice((0, 0.1, 0, 0.06, 0, 2e-3), (6, 4, 1))
    material = isotropic(E, 0.3)
    if kind == "sheet":
        material = homogeneous_plate(material, 2e-3, 2)
    elif kind == "quadratic":
        points, cells = add_midpoints(points, cells)
    held = np.repeat((points[:, 0] == 0)[:, None], 3, axis=1)

    def make_model(stiff=None, heavy=None, factor=1.0, density=RHO):
        fitted = Fittings(stiffness_factors=stiff, mass_factors=heavy)
        if kind == "sheet":
            scaled = replace(material, **{n: factor * getattr(material, n) for n in PARTS})
        else:
            scaled = factor * material
        return Model(points, cells, scaled, density, held, False, None, fitted)

    alike = make_model(np.full(len(cells), 3.0), np.full(len(cells), 2.0))
    other = make_model(factor=3.0, density=2 * RHO)
    assert abs(alike.stiffness - other.stiffness).max() <= 1e-12 * abs(other.stiffness).max()
    assert abs(alike.mass - other.mass).max() <= 1e-12 * abs(other.mass).max()
    np.testing.assert_allclose(alike.nodal_mass, other.nodal_mass, rtol=1e-12)
    np.testing.assert_allclose(frequencies(alike, 5), frequencies(other, 5), rtol=1e-7)
    moved = np.random.default_rng(0).standard_normal(points.shape) * 1e-6
    for one, two in zip(
        alike.strain_and_stress(moved), other.strain_and_stress(moved), strict=True
    ):
        np.testing.assert_allclose(one, two, atol=1e-9 * abs(two).max())
    # K is linear in the factors.
    left = points[cells[:, :4]].mean(axis=1)[:, 0] < 0.05
    mixed = make_model(np.where(left, 3.0, 1.0)).stiffness
    halves = (
        make_model(np.where(left, 3.0, 1e-9)).stiffness
        + make_model(np.where(left, 1e-9, 1.0)).stiffness
    )
    assert abs(mixed - halves).max() <= 1e-8 * abs(mixed).max()


def test_bar_of_two_materials_stretches_like_two_springs():
    # Joined at the middle: two springs in series, and the stress is one and the same.
    points, cells, held = bar((8, 1, 1))
    held |= (points[:, 0] == 0)[:, None]
    left = points[cells[:, :4]].mean(axis=1)[:, 0] < 0.5
    fitted = Fittings(stiffness_factors=np.where(left, 4.0, 1.0))
    made = Model(points, cells, isotropic(E, 0.0), RHO, held, False, None, fitted)
    force = np.zeros_like(points)
    pulled = traction_forces(len(points), find_side_faces(points, cells, "+x"), [30.0, 0.0, 0.0])
    force += pulled
    moved = made.statics(force.ravel())[0].reshape(-1, 3)
    tip = moved[points[:, 0] == 1.0, 0]
    np.testing.assert_allclose(tip, 30.0 * (0.5 / (4 * E) + 0.5 / E), rtol=1e-9)
    strain, stress = made.strain_and_stress(moved)
    np.testing.assert_allclose(stress[:, 0], 30.0, rtol=1e-7)
    np.testing.assert_allclose(strain[:, 0], np.where(left, 30.0 / (4 * E), 30.0 / E), rtol=1e-7)


@pytest.mark.parametrize("kind", ["linear", "sheet"])
def test_body_on_springs_sinks_by_its_weight(kind):
    # However soft they are: x = m g/k, with a bead on it; modes about it are those of the springs.
    points, cells = build_lattice((0, 0.1, 0, 0.1, 0, 2e-3), (4, 4, 1))
    material = isotropic(E, 0.3)
    if kind == "sheet":
        material = homogeneous_plate(material, 2e-3, 2)
    springs = spring_stiffness(points, cells, ["-z 0.5 N/m"])
    masses = point_masses(points, cells, ["-z 1 g"])
    fitted = Fittings(springs=springs, masses=masses)
    held = np.zeros(points.shape, bool)
    made = Model(points, cells, material, RHO, held, fittings=fitted)
    whole = RHO * 0.1 * 0.1 * 2e-3 + 1e-3
    assert made.nodal_mass.sum() == pytest.approx(whole, rel=1e-9)
    weight = np.zeros_like(points)
    weight[:, 2] = -9.81 * made.nodal_mass
    moved, _ = made.solve_equilibrium(weight.ravel())
    # Evenly on the whole; the plate between the springs sags by much less.
    assert moved[:, 2] @ springs[:, 2, 2] / 0.5 == pytest.approx(-whole * 9.81 / 0.5, rel=1e-6)
    hung = Model(points, cells, material, RHO, held, displacement=moved, fittings=fitted)
    np.testing.assert_allclose(hung.forces.reshape(-1, 3), weight, atol=1e-6 * abs(weight).max())
    extension = moved @ np.diag([0, 0, 1.0])
    energy = 0.5 * np.einsum("vi,vij,vj->", extension, springs, extension)
    assert hung.strain_energy == pytest.approx(energy, rel=0.05)
    assert hung.rigid_modes.shape[1] == 0


def test_hanging_body_slides_along_a_slider():
    # A sheet on a slide inclined by 30° to the level: nothing holds it along the slide.
    points, cells = build_lattice((0, 0.1, 0, 0.02, 0, 1e-3), (5, 1, 1))
    normals = held_directions(points, ["box(-inf, inf, -inf, inf, -inf, inf):(1, 0, 1.7320508)"])
    held = np.repeat([[False, True, False]], len(points), axis=0)
    made = Model(points, cells, isotropic(E, 0.3), RHO, held, fittings=Fittings(normals=normals))
    weight = np.zeros_like(points)
    weight[:, 2] = -9.81 * made.nodal_mass
    with pytest.raises(InputError, match="the cage, or a part of it, is not held"):
        made.solve_equilibrium(weight.ravel())
    # A spring along it does: k x = m g sin 30°.
    springs = spring_stiffness(points, cells, ["-x:(1.7320508, 0, -1) 2 N/m"])
    fitted = Fittings(normals=normals, springs=springs)
    made = Model(points, cells, isotropic(E, 0.3), RHO, held, fittings=fitted)
    moved, _ = made.solve_equilibrium(weight.ravel())
    slid = moved @ [0.75**0.5, 0, -0.5]
    left = points[:, 0] == 0
    assert slid[left].mean() == pytest.approx(RHO * 2e-6 * 9.81 / 2 / 2, rel=1e-5)
    assert abs(moved @ [0.5, 0, 0.75**0.5]).max() < 1e-8 * abs(moved).max() + 1e-9


def test_cage_with_a_rigid_place_cannot_hang():
    points, cells = build_lattice((0, 0.1, 0, 0.02, 0, 1e-3), (5, 1, 1))
    held = np.repeat((points[:, 0] == 0)[:, None], 3, axis=1)
    fitted = Fittings(bodies=rigid_bodies(points, ["+x"]))
    made = Model(points, cells, isotropic(E, 0.3), RHO, held, fittings=fitted)
    with pytest.raises(InputError, match=r"rigid: a cage with a rigid place cannot hang"):
        made.solve_equilibrium(np.ones(points.size))
