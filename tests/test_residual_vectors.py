"""Residual vectors, effective masses and loads, against closed forms and published numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.load_parameters import add_stress
from spacemap_vtk.mechanics.boundary import loads
from spacemap_vtk.mechanics.elements.kinematics import (
    MeanGradient,
    largest_rotation,
    strains,
    von_mises,
)
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.modal.eigen import solve_modes
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.residual_vectors import participation, residual_modes
from spacemap_vtk.mechanics.response.harmonic import receptance


def sheet(fixed=True, divisions=(8, 8, 2)):
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.05), divisions)
    held = np.repeat((points[:, 1:2] == 1) & fixed, 3, axis=1)
    return Model(points, cells, isotropic(1e4, 0.3), 300.0, held)


def solve_model(model, count):
    eigenvalues, shapes, _ = solve_modes(model.pencil, count)
    eigenvalues = eigenvalues * model.modulus / model.density
    return eigenvalues, shapes.reshape(len(shapes), -1) / math.sqrt(model.density)


def test_abaqus_benchmark_1_4_14():
    """Four masses on springs between walls, loaded at the third; one mode is kept."""
    mass = np.diag([1.0, 1.0, 1.0, 0.5])
    stiffness = 1e4 * (2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    load = np.array([0.0, 0.0, 1.0, 0.0])
    every, modes = la.eigh(stiffness, mass)
    frequencies = np.sqrt(every) / (2 * math.pi)
    np.testing.assert_allclose(frequencies, [10.155, 20.222, 28.258, 34.963], atol=6e-4)

    static = la.solve(stiffness, load)[:, None]
    system = sp.csr_matrix(stiffness), sp.csr_matrix(mass), load[:, None], static
    value, shape = residual_modes(modes[:, :1].T, every[:1], *system)
    assert math.sqrt(value[0]) / (2 * math.pi) == pytest.approx(21.865, abs=6e-4)
    vector = shape[0] * np.sign(shape[0, 0])
    np.testing.assert_allclose(vector, [0.5318, 0.4194, -0.7189, -0.2216], atol=6e-5)

    # Driven at 3 Hz: all four modes are exact; one mode alone is not, and with the residual it is.
    omega = 6 * math.pi
    exact = la.solve(stiffness - omega**2 * mass, load)
    kept, values = np.c_[modes[:, :1], shape.T], np.r_[every[:1], value]
    half = np.zeros(2)
    factors = receptance(values, half, omega).real * (kept.T @ load)
    assert abs(kept @ factors / exact - 1).max() <= 3e-3
    assert abs(kept[:, 0] * factors[0] / exact - 1).max() > 0.05


@pytest.mark.parametrize("count", [1, 5, 30])
def test_residual_vectors_make_the_static_response_exact(count):
    model = sheet()
    eigenvalues, shapes = solve_model(model, count)
    rng = np.random.default_rng(0)
    patterns = [loads.acceleration_forces(model.nodal_mass, a) for a in np.eye(3)]
    patterns += [rng.standard_normal(model.points.shape)]
    force = np.stack([p.ravel() for p in patterns], axis=1) * model.free[:, None]
    force = np.c_[force, force @ [1.0, 2.0, 0.0, 0.0]]  # one that depends on others
    static = model.statics(force)[0]
    values, more = residual_modes(shapes, eigenvalues, model.stiffness, model.mass, force, static)
    assert len(values) == 4
    every, lam = np.r_[shapes, more], np.r_[eigenvalues, values]
    got = every.T @ ((every @ force) / lam[:, None])
    for column in range(force.shape[1]):
        error = abs(got[:, column] - static[:, column]).max() / abs(static[:, column]).max()
        assert error <= 1e-10, (column, error)
    np.testing.assert_allclose(every @ (model.mass @ every.T), np.eye(len(every)), atol=1e-10)
    gram = every @ (model.stiffness @ every.T) / np.sqrt(np.outer(lam, lam))
    np.testing.assert_allclose(gram, np.eye(len(every)), atol=1e-9)


@pytest.mark.nightly
def test_without_residual_vectors_few_modes_miss_the_sag_under_in_plane_gravity():
    model = sheet(divisions=(20, 20, 4))
    force = loads.acceleration_forces(model.nodal_mass, [0, -9.81, 0]).ravel() * model.free
    static = model.statics(force)[0]
    eigenvalues, shapes = solve_model(model, 30)
    missed = []
    for count in (5, 30):
        kept = shapes[:count]
        got = kept.T @ (kept @ force / eigenvalues[:count])
        missed.append(np.linalg.norm(got - static) / np.linalg.norm(static))
    assert missed[0] == pytest.approx(1.0, abs=0.005)
    assert missed[1] == pytest.approx(0.009, abs=0.0005)


def test_all_modes_need_no_residual_vectors():
    model = sheet(divisions=(3, 3, 1))
    eigenvalues, shapes = solve_model(model, int(model.free.sum()))
    force = np.stack(
        [loads.acceleration_forces(model.nodal_mass, a).ravel() * model.free for a in np.eye(3)],
        axis=1,
    )
    data = model.stiffness, model.mass, force, model.statics(force)[0]
    assert len(residual_modes(shapes, eigenvalues, *data)[0]) == 0
    gamma = participation(shapes, model.nodal_mass)
    np.testing.assert_allclose((gamma**2).sum(axis=0), model.movable_mass)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("quadratic", [False, True])
def test_movable_mass_is_that_of_the_inertia_forces(quadratic, lumped):
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.05), (3, 4, 1))
    if quadratic:
        points, cells = add_midpoints(points, cells)
    # Held along x and y at one side, along y at another, along z everywhere.
    sides = [points[:, 1] == 1, (points[:, 1] == 1) | (points[:, 0] == 0), points[:, 0] >= 0]
    model = Model(points, cells, isotropic(1e4, 0.3), 300.0, np.stack(sides, axis=1), lumped=lumped)
    inner = model.mass[model.free][:, model.free].toarray()
    for axis, found in enumerate(model.movable_mass):
        uniform = np.tile(np.eye(3)[axis], len(points))
        forces = (model.mass @ uniform)[model.free]
        np.testing.assert_allclose(found, forces @ la.solve(inner, forces), rtol=1e-10)


@pytest.mark.parametrize("quadratic", [False, True])
def test_pressure_forces_sum_to_the_area(quadratic):
    points, cells = build_lattice((0, 1, 0, 2, 0, 0.5), (3, 2, 2))
    if quadratic:
        points, cells = add_midpoints(points, cells)
    for side, area in (("+z", 2.0), ("-x", 1.0), ("+y", 0.5)):
        where = loads.find_side_faces(points, cells, side)
        assert where.areas.sum() == pytest.approx(area)
        force = loads.traction_forces(len(points), where, -30.0 * where.normal)
        np.testing.assert_allclose(force.sum(axis=0), -30.0 * area * where.normal, atol=1e-12)
        # About any point, a constant pressure acts at the middle of the side.
        moment = np.cross(points, force).sum(axis=0)
        middle = points.min(axis=0) + np.ptp(points, axis=0) * (where.normal + 1) / 2
        np.testing.assert_allclose(moment, np.cross(middle, force.sum(axis=0)), atol=1e-12)
    shear = loads.traction_forces(
        len(points), loads.find_side_faces(points, cells, "-z"), [1.0, 2.0, 3.0]
    )
    np.testing.assert_allclose(shear.sum(axis=0), [2.0, 4.0, 6.0])


def with_midpoints(points, cells):
    edges = cells[:, [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]]
    unique, which = np.unique(np.sort(edges.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    middles = points[unique].mean(axis=1)
    more = len(points) + which.reshape(-1, 6)
    return np.concatenate([points, middles]), np.concatenate([cells, more], axis=1)


def test_a_side_without_faces_is_refused():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 1.0]])
    with pytest.raises(InputError, match=r"no flat face on its side \+z"):
        loads.find_side_faces(points, np.array([[0, 1, 2, 3]]), "+z")


@pytest.mark.parametrize("quadratic", [False, True])
def test_strain_of_a_linear_field_is_exact(quadratic):
    points, cells = build_lattice((0, 1, 0, 2, 0, 0.5), (2, 2, 1))
    if quadratic:
        points, cells = add_midpoints(points, cells)
    slope = np.random.default_rng(1).standard_normal((3, 3))
    gradients = MeanGradient(points, cells).evaluate(points @ slope.T)
    np.testing.assert_allclose(gradients, np.tile(slope[..., None], len(cells)), atol=1e-12)
    strain = strains(gradients)
    x = slope + slope.T
    expected = [slope[0, 0], slope[1, 1], slope[2, 2], x[1, 2], x[2, 0], x[0, 1]]
    np.testing.assert_allclose(strain, np.tile(expected, (len(cells), 1)), atol=1e-12)
    grid = vtkUnstructuredGrid()
    add_stress(grid, strain, strain)
    tensor = vtk_to_numpy(grid.GetCellData().GetArray("strain"))[0]
    np.testing.assert_allclose(tensor, [*np.diag(slope), x[0, 1] / 2, x[1, 2] / 2, x[0, 2] / 2])
    stress = vtk_to_numpy(grid.GetCellData().GetArray("stress"))[0]
    np.testing.assert_allclose(stress, [*np.diag(slope), x[0, 1], x[1, 2], x[0, 2]])
    # Uniaxial stress: von Mises is its size. Pure shear: √3 times it.
    np.testing.assert_allclose(von_mises(np.array([[0, -7.0, 0, 0, 0, 0]])), 7.0)
    np.testing.assert_allclose(von_mises(np.array([[0, 0, 0, 0, 2.0, 0]])), 2 * math.sqrt(3))


def test_largest_rotation_is_half_the_curl():
    points, cells = build_lattice((0, 1, 0, 2, 0, 0.5), (2, 2, 1))
    axis = np.array([0.1, -0.2, 0.3])
    turned = np.cross(axis, points)
    size = np.linalg.norm(axis)
    gradient = MeanGradient(points, cells)
    assert largest_rotation(gradient.evaluate(turned)) == pytest.approx(size)
    np.testing.assert_allclose(strains(gradient.evaluate(turned)), 0.0, atol=1e-14)
    # Twisted along y: most where the twist is.
    twist = np.cross(points[:, 1:2] ** 2 * [0.0, 1.0, 0.0], points)
    assert 2.0 < largest_rotation(gradient.evaluate(twist)) < 4.5


def test_residual_vectors_of_a_free_body_contain_no_rigid_motion():
    model = sheet(fixed=False)
    eigenvalues, shapes = solve_model(model, 10)
    assert (eigenvalues[:6] == 0).all()
    np.testing.assert_allclose(model.movable_mass, 300 * 0.05, rtol=1e-12)
    force = np.zeros_like(model.points)
    nearest = loads.nearest_vertices(model.points, (0, 0, 0))
    force[nearest, 2] = 1.0 / len(nearest)
    force = force.reshape(-1, 1)
    static = model.statics(force)[0]
    values, more = residual_modes(shapes, eigenvalues, model.stiffness, model.mass, force, static)
    assert len(values) == 1
    assert values[0] > eigenvalues[6]
    np.testing.assert_allclose(shapes @ (model.mass @ more.T), 0, atol=1e-10)
