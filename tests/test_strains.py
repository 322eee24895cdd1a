"""The kernel of quadratic strains: energy, forces and tangent of one another, and today's K."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pencils import stiffness_and_mass

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.kinematics import strain_products
from spacemap_vtk.mechanics.elements.materials import isotropic, orthotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface, sheet_strains
from spacemap_vtk.mechanics.elements.strains import Strains, tetrahedron_strains
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.equilibrium.energy_terms import assemble_tangent

FloatArray = NDArray[np.float64]
ELASTICITY = orthotropic([2e6, 1e6, 5e5], [4e5, 3e5, 2e5], [0.3, 0.1, 0.2])


def elements(kind: str) -> tuple[FloatArray, list[Strains]]:
    """Return undeformed positions of nodes, and the strains over them."""
    points, cells = build_lattice((0, 1, 0, 2, 0, 0.3), (3, 4, 1))
    if kind == "sheet":
        points[:, 2] += 0.2 * np.sin(points[:, 0] + 2 * points[:, 1])  # not flat, and distorted
        points[:, 0] += 0.1 * np.sin(3 * points[:, 1])
        surface = find_mid_surface(points, cells)
        assert surface is not None
        plate = homogeneous_plate(ELASTICITY, 0.3, surface.normal)
        return surface.to_nodes(points), sheet_strains(points, surface, plate)
    if kind == "quadratic":
        points, cells = add_midpoints(points, cells)
    return points, [tetrahedron_strains(points, cells, ELASTICITY)]


@pytest.mark.parametrize("kind", ["sheet", "linear", "quadratic"])
def test_forces_and_tangent_are_the_derivatives_of_the_energy(kind: str) -> None:
    """By central differences, at a large deformation; and K's products of its strains."""
    rest, strains = elements(kind)
    random = np.random.default_rng(0)
    assert sum(part.energy(rest) for part in strains) < 1e-20
    positions, way = rest + 0.1 * random.normal(size=(2, *rest.shape))
    way, step = way - rest, 1e-4

    def energy(share: float) -> float:
        return sum(part.energy(positions + share * way) for part in strains)

    def forces(share: float) -> FloatArray:
        return np.sum([part.forces(positions + share * way) for part in strains], axis=0)

    # Energy is of the fourth order: two differences are exact but for rounding.
    slope = (8 * (energy(step) - energy(-step)) - (energy(2 * step) - energy(-2 * step))) / 12
    assert slope / step == pytest.approx(float(np.vdot(forces(0.0), way)), rel=1e-8)
    moved = assemble_tangent(strains, positions) @ way.ravel()
    change = (8 * (forces(step) - forces(-step)) - (forces(2 * step) - forces(-2 * step))) / 12
    np.testing.assert_allclose(change.ravel() / step, moved, atol=1e-8 * abs(moved).max())

    fields = random.normal(size=(3, *rest.shape))
    flat = fields.reshape(3, -1)
    found = np.sum([part.stiffness_products(positions, fields) for part in strains], axis=0)
    np.testing.assert_allclose(
        found, flat @ (assemble_tangent(strains, positions) @ flat.T), rtol=1e-11
    )


@pytest.mark.parametrize("kind", ["linear", "quadratic"])
def test_undeformed_tangent_is_the_linear_stiffness(kind: str) -> None:
    """K of the closed-form assembly, to rounding."""
    rest, (strains,) = elements(kind)
    found = assemble_tangent([strains], rest)
    expected = stiffness_and_mass(rest, strains.nodes, ELASTICITY, 1.0)[0]
    assert abs(found - expected).max() <= 1e-14 * abs(expected).max()
    fields = np.random.default_rng(1).normal(size=(2, *rest.shape))
    np.testing.assert_allclose(
        strains.stiffness_products(rest, fields),
        strain_products(rest, strains.nodes, ELASTICITY, fields),
        rtol=1e-12,
    )


@pytest.mark.parametrize("kind", ["sheet", "linear", "quadratic"])
@pytest.mark.parametrize("angle", [1e-6, 0.5, np.pi])
def test_rigid_rotations_store_no_energy(kind: str, angle: float) -> None:
    """Energy and forces are rounding; half thicknesses turn and do not translate."""
    rest, strains = elements(kind)
    x, y, z = np.array([1.0, 2.0, -2.0]) / 3
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    moved = rest @ turn.T
    moved[: len(moved) // 2 if kind == "sheet" else None] += [3.0, -2.0, 5.0]
    for part in strains:
        scale = abs(part.tangent(rest)).max()
        assert part.energy(moved) <= 1e-26 * scale * len(part.nodes)
        assert abs(part.forces(moved)).max() <= 1e-13 * scale


def test_strain_of_a_stretched_tetrahedron_is_greens() -> None:
    """E = (λ² - 1)/2 along a stretched axis, and σ = C E, whatever the element."""
    points, cells = build_lattice((0, 1, 0, 1, 0, 1), (1, 1, 1))
    for nodes, connected in ((points, cells), add_midpoints(points, cells)):
        strains = tetrahedron_strains(nodes, connected, isotropic(1.0, 0.25))
        strain = strains.strains_and_gradients(nodes * [2.0, 1.0, 1.0])[0]
        np.testing.assert_allclose(
            strain, np.broadcast_to([1.5, 0, 0, 0, 0, 0], strain.shape), atol=1e-14
        )
        # λ = μ = 0.4, over the volume of one.
        assert strains.stresses(strain).sum(axis=(0, 1))[:3] == pytest.approx([1.8, 0.6, 0.6])
