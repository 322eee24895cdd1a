"""K and M of linear tetrahedra, against closed forms, scikit-fem and the textbook's Bᵀ D B."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.linalg as sla
from pencils import stiffness_and_mass
from skfem import Basis, BilinearForm, ElementTetP1, ElementVector, MeshTet
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.mechanics.elements.elasticity import (
    assemble,
    mass_matrix,
    nodal_mass,
    stiffness_matrix,
)
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.tetrahedra import volumes
from spacemap_vtk.mechanics.modal.model import Model

YOUNG, POISSON, DENSITY = 2.1e6, 0.3, 300.0


def perturbed(divisions=(4, 3, 3), bounds=(0.0, 2.0, 0.0, 1.0, -0.3, 0.4), amount=0.2):
    """A lattice whose inner vertices are moved at random: points, tetrahedra, inner."""
    points, tetrahedra = build_lattice(bounds, divisions)
    low, high = points.min(axis=0), points.max(axis=0)
    inner = ((points > low) & (points < high)).all(axis=1)
    step = (high - low) / divisions
    moves = np.random.default_rng(1).uniform(-amount, amount, points.shape) * step
    return points + moves * inner[:, None], tetrahedra, inner


def close(a, b, tolerance):
    assert abs(a - b).max() <= tolerance * abs(b).max()


@pytest.fixture(scope="module")
def mesh():
    return perturbed()[:2]


@pytest.fixture(scope="module")
def matrices(mesh):
    return stiffness_and_mass(*mesh, isotropic(YOUNG, POISSON), DENSITY)


def test_linear_elements_pass_the_patch_test():
    points, tetrahedra, inner = perturbed()
    K, _ = stiffness_and_mass(points, tetrahedra, isotropic(YOUNG, POISSON), DENSITY)
    gradient = np.random.default_rng(2).standard_normal((3, 3))
    exact = (points @ gradient.T).ravel()
    free = np.repeat(inner, 3)
    solved = exact.copy()
    solved[free] = sla.spsolve(K[free][:, free].tocsc(), -K[free][:, ~free] @ exact[~free])
    close(solved, exact, 1e-13)
    # Energy of the constant strain: V/2 (λ tr(ε)² + 2μ ε:ε), on the box of 2 x 1 x 0.7.
    strain = (gradient + gradient.T) / 2
    first, second = lame_parameters(YOUNG, POISSON)
    energy = 1.4 / 2 * (first * np.trace(strain) ** 2 + 2 * second * (strain**2).sum())
    assert exact @ K @ exact / 2 == pytest.approx(energy, rel=1e-12)


def test_rigid_motions_store_no_energy(mesh, matrices):
    K = matrices[0]
    norm = np.linalg.norm(K.toarray(), 2)
    for axis in np.eye(3):
        for motion in (np.tile(axis, len(mesh[0])), np.cross(axis, mesh[0]).ravel()):
            assert np.linalg.norm(K @ motion) <= 1e-14 * norm * np.linalg.norm(motion)


def test_mass_is_density_times_volume(mesh, matrices):
    M = matrices[1]
    total = DENSITY * 1.4
    assert volumes(*mesh).sum() == pytest.approx(1.4, rel=1e-14)
    assert M.sum() == pytest.approx(3 * total, rel=1e-14)
    shares = nodal_mass(*mesh, DENSITY)
    assert shares.sum() == pytest.approx(total, rel=1e-14)
    close(M @ np.ones(M.shape[0]), np.repeat(shares, 3), 1e-14)


def test_equals_scikit_fem(mesh, matrices):
    basis = Basis(MeshTet(mesh[0].T, mesh[1].T), ElementVector(ElementTetP1()), intorder=2)
    order = basis.nodal_dofs.T.ravel()
    K = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)[order][:, order]
    M = BilinearForm(lambda u, v, _: DENSITY * dot(u, v)).assemble(basis)[order][:, order]
    close(matrices[0], K, 1e-13)
    close(matrices[1], M, 1e-13)


def test_any_symmetric_material_equals_the_sum_of_btdb(mesh):
    points, tetrahedra = mesh
    root = np.random.default_rng(3).standard_normal((6, 6))
    elasticity = root @ root.T
    K = np.zeros((3 * len(points),) * 2)
    for cell in tetrahedra:
        # Columns of the inverse of [1 x y z] hold the coefficients of the shape functions.
        system = np.c_[np.ones(4), points[cell]]
        B = np.zeros((6, 12))
        for a, (x, y, z) in enumerate(np.linalg.inv(system)[1:].T):
            B[:, 3 * a : 3 * a + 3] = [
                [x, 0, 0],
                [0, y, 0],
                [0, 0, z],
                [0, z, y],
                [z, 0, x],
                [y, x, 0],
            ]
        rows = (3 * cell[:, None] + np.arange(3)).ravel()
        volume = abs(np.linalg.det(system)) / 6
        K[np.ix_(rows, rows)] += volume * B.T @ elasticity @ B
    close(stiffness_matrix(assemble(points, tetrahedra), elasticity).toarray(), K, 1e-13)


def test_orientation_does_not_matter(mesh, matrices):
    points, tetrahedra = mesh
    turned = tetrahedra.copy()
    turned[::2, :2] = tetrahedra[::2, 1::-1]
    for new, old in zip(
        stiffness_and_mass(points, turned, isotropic(YOUNG, POISSON), DENSITY),
        matrices,
        strict=True,
    ):
        close(new, old, 1e-14)


@pytest.mark.parametrize("scale", [1e-6, 1e3])
def test_matrices_scale_with_the_unit_of_length(mesh, matrices, scale):
    K, M = stiffness_and_mass(mesh[0] * scale, mesh[1], isotropic(YOUNG, POISSON), DENSITY)
    close(K, matrices[0] * scale, 1e-13)
    close(M, matrices[1] * scale**3, 1e-13)


def test_one_assembly_serves_all_materials(mesh, matrices):
    assembly = assemble(*mesh)
    close(stiffness_matrix(assembly, isotropic(10 * YOUNG, POISSON)), 10 * matrices[0], 1e-14)
    close(mass_matrix(assembly, 10 * DENSITY), 10 * matrices[1], 1e-14)


def test_matrices_are_symmetric_csr(matrices):
    for matrix in matrices:
        assert matrix.format == "csr"
        assert matrix.dtype == np.float64
        close(matrix, matrix.T, 1e-15)


def test_pulled_bar_has_its_youngs_modulus_and_poissons_ratio():
    compliance = np.linalg.inv(isotropic(YOUNG, POISSON))
    assert compliance[0, 0] == pytest.approx(1 / YOUNG)
    assert compliance[0, 1] == pytest.approx(-POISSON / YOUNG)
    assert compliance[3, 3] == pytest.approx(2 * (1 + POISSON) / YOUNG)


def test_flat_tetrahedra_are_counted_and_named(mesh):
    points, tetrahedra = mesh
    flat = tetrahedra.copy()
    flat[7, 3] = flat[7, 2]
    flat[11] = flat[11, 0]
    for scale in (1.0, 1e-6):
        with pytest.raises(GeometryError, match=r"2 of 180 tetrahedra are flat.*index 7"):
            volumes(points * scale, flat)
    # Thin, but distinguished from flat: one part in a million.
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-6]])
    assert volumes(corners, np.arange(4)[None]) == pytest.approx(1e-6 / 6)


def test_non_finite_points_are_counted_and_named(mesh):
    points = mesh[0].copy()
    points[[5, 9], 1] = np.nan, np.inf
    with pytest.raises(GeometryError, match=r"2 of 80 points.*not finite.*index 5"):
        stiffness_and_mass(points, mesh[1], isotropic(YOUNG, POISSON), DENSITY)


@pytest.mark.parametrize(
    ("points", "tetrahedra", "what"),
    [
        (np.eye(4, 3), [[0, 1, 2, 4]], "there are 4"),
        (np.eye(4, 3), [[0, 1, 2, -1]], "there are 4"),
        (np.eye(4, 3), [[0.0, 1.0, 2.0, 3.0]], "integers"),
        (np.eye(4, 3), np.empty((0, 4), int), "at least one"),
        (np.eye(4, 2), [[0, 1, 2, 3]], r"shape \(V, 3\)"),
    ],
)
def test_invalid_meshes_are_refused(points, tetrahedra, what):
    with pytest.raises(GeometryError, match=what):
        assemble(points, tetrahedra)


@pytest.mark.parametrize(
    ("young", "poisson", "key"),
    [(0.0, 0.3, "youngs_modulus"), (np.nan, 0.3, "youngs_modulus"), (1.0, 0.5, "poissons_ratio")],
)
def test_impossible_materials_are_refused(young, poisson, key):
    with pytest.raises(InputError) as caught:
        isotropic(young, poisson)
    assert caught.value.key == key


def test_density_and_elasticity_are_checked(mesh):
    held = np.zeros((len(mesh[0]), 3), bool)
    for density in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="density"):
            Model(*mesh, isotropic(1e6, 0.3), density, held)
    with pytest.raises(InputError, match="elasticity"):
        Model(*mesh, np.eye(3), 1.0, held)
    with pytest.raises(InputError, match="symmetric"):
        Model(*mesh, np.triu(np.ones((6, 6))), 1.0, held)
