"""Quadratic tetrahedra: matrices against scikit-fem, bending, and points that ride along."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
import scipy.sparse.linalg as sla
from pencils import solve_matrices, stiffness_and_mass
from skfem import Basis, BilinearForm, ElementTetP2, ElementVector, MeshTet
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkQuadraticTetra
from vtkmodules.vtkFiltersSources import vtkSphereSource

from spacemap_vtk import BarycentricWarp, ModalResponse, ModalSolver, TetraCage, WeaveSource
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import add_array
from spacemap_vtk.embedding.interpolation import Interpolation, quadratic_weights
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import GeometryError
from spacemap_vtk.mechanics.elements.elasticity import assemble, mass_matrix, nodal_mass
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints, volumes

YOUNG, POISSON, DENSITY = 2.1e6, 0.3, 300.0


def perturbed(divisions=(3, 3, 2), bounds=(0.0, 2.0, 0.0, 1.0, -0.3, 0.4)):
    points, tetrahedra = build_lattice(bounds, divisions)
    low, high = points.min(axis=0), points.max(axis=0)
    inner = ((points > low) & (points < high)).all(axis=1)
    moves = np.random.default_rng(1).uniform(-0.2, 0.2, points.shape) * (high - low) / divisions
    return points + moves * inner[:, None], tetrahedra


def close(a, b, tolerance):
    assert abs(a - b).max() <= tolerance * abs(b).max()


@pytest.fixture(scope="module")
def mesh():
    return add_midpoints(*perturbed())


@pytest.fixture(scope="module")
def matrices(mesh):
    return stiffness_and_mass(*mesh, isotropic(YOUNG, POISSON), DENSITY)


def test_equals_scikit_fem(mesh, matrices):
    corners = perturbed()
    basis = Basis(MeshTet(corners[0].T, corners[1].T), ElementVector(ElementTetP2()), intorder=4)
    K = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
    M = BilinearForm(lambda u, v, _: DENSITY * dot(u, v)).assemble(basis)
    # Degrees of freedom are matched by place: each has one, and a direction.
    places = {tuple(np.round(x, 9)): v for v, x in enumerate(mesh[0])}
    order = np.empty(K.shape[0], int)
    for axis in range(3):
        for dofs in (basis.nodal_dofs[axis], basis.edge_dofs[axis]):
            for dof in dofs:
                order[3 * places[tuple(np.round(basis.doflocs[:, dof], 9))] + axis] = dof
    close(matrices[0], K[order][:, order], 1e-13)
    close(matrices[1], M[order][:, order], 1e-13)


def test_quadratic_elements_pass_the_patch_test(mesh, matrices):
    points, K = mesh[0], matrices[0]
    inner = ((points > points.min(axis=0)) & (points < points.max(axis=0))).all(axis=1)
    exact = (points @ np.random.default_rng(2).standard_normal((3, 3))).ravel()
    free = np.repeat(inner, 3)
    solved = exact.copy()
    solved[free] = sla.spsolve(K[free][:, free].tocsc(), -K[free][:, ~free] @ exact[~free])
    close(solved, exact, 1e-13)


def test_rigid_motions_store_no_energy_and_mass_is_exact(mesh, matrices):
    K, M = matrices
    norm = np.linalg.norm(K.toarray(), 2)
    for axis in np.eye(3):
        for motion in (np.tile(axis, len(mesh[0])), np.cross(axis, mesh[0]).ravel()):
            assert np.linalg.norm(K @ motion) <= 1e-14 * norm * np.linalg.norm(motion)
    assert M.sum() == pytest.approx(3 * DENSITY * 1.4, rel=1e-13)
    close(M @ np.ones(M.shape[0]), np.repeat(nodal_mass(*mesh, DENSITY), 3), 1e-13)
    lumped = mass_matrix(assemble(*mesh), DENSITY, lumped=True)
    assert (lumped.diagonal() > 0).all()
    assert lumped.sum() == pytest.approx(3 * DENSITY * 1.4, rel=1e-13)
    np.testing.assert_allclose(
        lumped.diagonal()[::3], nodal_mass(*mesh, DENSITY, lumped=True), rtol=1e-13
    )
    assert volumes(*mesh).sum() == pytest.approx(1.4)


def test_curved_tetrahedra_are_refused(mesh):
    points = mesh[0].copy()
    points[-1] += 1e-3
    with pytest.raises(GeometryError, match=r"tetrahedra are curved.*middle of its edge"):
        stiffness_and_mass(points, mesh[1], isotropic(YOUNG, POISSON), DENSITY)


def test_one_layer_bends_like_a_timoshenko_beam():
    points, tetrahedra = add_midpoints(*build_lattice((0, 10, 0, 1, 0, 1), (10, 1, 1)))
    K, M = stiffness_and_mass(points, tetrahedra, isotropic(200e9, 0.3), 8000.0)
    eigenvalues, shapes = solve_matrices(K, M, np.repeat(points[:, 0] > 0, 3), 8)
    frequencies = np.sqrt(eigenvalues) / (2 * np.pi)
    # Timoshenko's beam, and from above; one layer of linear ones gives 13.277 Hz.
    assert 8.013 < frequencies[0] < 8.013 * 1.02
    momentum = np.einsum("nvc,v->nc", shapes, nodal_mass(points, tetrahedra, 8000.0))
    axial = frequencies[abs(momentum[:, 0]).argmax()]
    assert 125.0 < axial < 125.0 * 1.01


def test_vtk_has_the_same_shape_functions():
    rng = np.random.default_rng(0)
    cell = vtkQuadraticTetra()
    for weights in rng.dirichlet(np.ones(4), 5):
        theirs = [0.0] * 10
        cell.InterpolateFunctions(weights[1:], theirs)
        np.testing.assert_allclose(quadratic_weights(weights[None])[0], theirs, atol=1e-14)


def field(points):
    x, y, z = points.T
    return np.stack([x * x - y * z + z, x * y + 2, z * z - 3 * x * y + y], axis=1)


def test_a_quadratic_motion_is_reproduced_inside(mesh):
    points, cells = mesh
    low, high = points.min(axis=0), points.max(axis=0)
    inside = np.random.default_rng(0).uniform(low, high, (500, 3))
    where = locate(inside, points, cells[:, :4])
    ride = Interpolation(where, cells, len(points))
    np.testing.assert_allclose(ride.apply(field(points)), field(inside), atol=1e-12)


def test_affine_motion_is_reproduced_outside_without_jumps(mesh):
    points, cells = mesh
    middle, reach = points.mean(axis=0), np.ptp(points, axis=0)
    outside = middle + reach * np.random.default_rng(0).uniform(-4, 4, (500, 3))
    ride = Interpolation(locate(outside, points, cells[:, :4]), cells, len(points))
    affine = np.arange(9.0).reshape(3, 3)
    np.testing.assert_allclose(ride.apply(points @ affine + 1), outside @ affine + 1, atol=1e-11)
    side = np.array([[2.0, 0.43, 0.1]]) + np.array([[-1e-9, 0, 0], [1e-9, 0, 0]])
    near = Interpolation(locate(side, points, cells[:, :4]), cells, len(points))
    before, after = near.apply(field(points))
    assert abs(after - before).max() < 1e-7


def test_quadratic_cage_runs_through_the_pipeline():
    weave = WeaveSource(ends=3, picks=3)
    cages = [TetraCage(divisions=n, order=order) for n, order in (((4, 4, 1), 2), ((20, 20, 5), 1))]
    sags = []
    for cage in cages:
        modal = ModalSolver(youngs_modulus=1e4, modes=12)
        response = ModalResponse(gravity=(0, 0, -9.81), initial="equilibrium")
        warp = BarycentricWarp()
        cage.SetInputConnection(weave.GetOutputPort())
        modal.SetInputConnection(cage.GetOutputPort())
        response.SetInputConnection(modal.GetOutputPort())
        warp.SetInputConnection(0, weave.GetOutputPort())
        warp.SetInputConnection(1, response.GetOutputPort())
        warp.update(time=0.0)
        moved = warp.GetOutputDataObject(0).GetPointData().GetArray("displacement")
        sags.append(vtk_to_numpy(moved)[:, 2].min())
    grid = cages[0].GetOutputDataObject(0)
    assert grid.GetCellType(0) == 24
    assert grid.GetNumberOfCells() == 80
    assert sags[0] < 0
    assert sags[0] == pytest.approx(sags[1], rel=0.08)


def test_any_quadratic_mesh_can_be_a_cage():
    sphere = vtkSphereSource()
    sphere.SetRadius(0.3)
    cage = TetraCage(divisions=(2, 2, 2), order=2, padding=0.1)
    cage.SetInputConnection(sphere.GetOutputPort())
    cage.update()
    grid = cage.GetOutputDataObject(0)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    motion = numpy_to_vtk(field(points), deep=True)
    motion.SetName("displacement")
    grid.GetPointData().AddArray(motion)
    warp = BarycentricWarp()
    warp.SetInputConnection(0, sphere.GetOutputPort())
    warp.SetInputDataObject(1, grid)
    warp.update()
    rest = vtk_to_numpy(sphere.GetOutput().GetPoints().GetData())
    moved = warp.GetOutputDataObject(0).GetPointData().GetArray("displacement")
    np.testing.assert_allclose(vtk_to_numpy(moved), field(rest.astype(float)), atol=1e-6)


def test_normals_turn_with_a_quadratic_cage() -> None:
    """Against the gradient of the field in closed form: the cage bends inside a tetrahedron."""
    ball = pv.Sphere(radius=0.3, theta_resolution=24, phi_resolution=18)
    ball.points = ball.points.astype(np.float64)
    cage = TetraCage(divisions=(1, 1, 1), order=2, padding=0.1)
    cage.SetInputDataObject(ball)
    cage.update()
    grid = cage.GetOutputDataObject(0)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    add_array(grid.GetPointData(), "displacement", field(points))
    step = 1e-6
    ways = [field(ball.points + step * way) - field(ball.points) for way in np.eye(3)]
    turn = np.eye(3) + np.stack(ways, axis=2) / step
    expected = np.einsum("nji,nj->ni", np.linalg.inv(turn), ball.point_data.active_normals)
    expected *= np.sign(np.linalg.det(turn))[:, None]  # a surface turned inside out stays so
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    for smooth, tolerance in ((False, 1e-4), (True, 0.5)):
        warp = BarycentricWarp(smooth=smooth)
        warp.SetInputDataObject(0, ball)
        warp.SetInputDataObject(1, grid)
        warp.update()
        moved = pv.wrap(warp.GetOutputDataObject(0))
        np.testing.assert_allclose(moved["displacement"], field(ball.points), atol=tolerance / 10)
        normals = moved.point_data.active_normals
        np.testing.assert_allclose(normals, expected, atol=tolerance)
