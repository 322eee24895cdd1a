"""Stiffness of yarns from fibre and matrix, and of voxels that a surface cuts.

Stresses have the order xx, yy, zz, yz, xz, xy; shear strains are the engineering ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats

#: Names of the components of stress and strain.
COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
#: Rows and columns of the upper triangle of a symmetric 6 × 6 matrix.
UPPER = np.triu_indices(6)
#: Voxels that are mixed at a time.
_BLOCK = 20_000


@dataclass(frozen=True)
class Constituent:
    """A transversely isotropic material with the axis 1; isotropic ones have equal values."""

    axial_modulus: float
    """E1 [Pa]."""
    transverse_modulus: float
    """E2 = E3 [Pa]."""
    axial_shear: float
    """G12 = G13 [Pa]."""
    axial_poisson: float
    """ν12 = ν13: contraction along 2 where it is pulled along 1."""
    transverse_poisson: float
    """ν23."""
    axial_expansion: float = 0.0
    """α1 [1/K]."""
    transverse_expansion: float = 0.0
    """α2 = α3 [1/K]."""
    density: float = 0.0
    """[kg/m³]."""

    @classmethod
    def isotropic(
        cls, modulus: float, poisson: float, expansion: float = 0.0, density: float = 0.0
    ) -> Constituent:
        """Make an isotropic material of Young's modulus [Pa] and Poisson's ratio."""
        shear = modulus / (2 + 2 * poisson)
        return cls(modulus, modulus, shear, poisson, poisson, expansion, expansion, density)

    @property
    def is_isotropic(self) -> bool:
        """Whether all directions are alike."""
        return bool(
            self.axial_modulus == self.transverse_modulus
            and self.axial_poisson == self.transverse_poisson
            and np.isclose(self.axial_shear, self.transverse_shear, rtol=1e-9)
        )

    @property
    def transverse_shear(self) -> float:
        """G23 [Pa]."""
        return self.transverse_modulus / (2 + 2 * self.transverse_poisson)

    @property
    def stiffness(self) -> Floats:
        """Stiffness with the axis along x [Pa], (6, 6).

        Raises
        ------
        InputError
            If no material can have these constants.
        """
        e1, e2 = self.axial_modulus, self.transverse_modulus
        compliance = np.zeros((6, 6))
        compliance[:3, :3] = [
            [1 / e1, -self.axial_poisson / e1, -self.axial_poisson / e1],
            [-self.axial_poisson / e1, 1 / e2, -self.transverse_poisson / e2],
            [-self.axial_poisson / e1, -self.transverse_poisson / e2, 1 / e2],
        ]
        shears = [self.transverse_shear, self.axial_shear, self.axial_shear]
        compliance[range(3, 6), range(3, 6)] = 1 / np.array(shears)
        if np.linalg.eigvalsh(compliance).min() <= 0:
            raise InputError(
                "the elastic constants belong to no material: its energy would be negative",
                value=f"E1 {e1:g}, E2 {e2:g} Pa, ν12 {self.axial_poisson:g}, "
                f"ν23 {self.transverse_poisson:g}",
                allowed="ν12² < (E1 / E2) (1 − ν23) / 2, |ν23| < 1",
            )
        stiffness = np.asarray(np.linalg.inv(compliance), np.float64)
        return stiffness

    @property
    def expansion(self) -> Floats:
        """Thermal expansion with the axis along x [1/K], (6,)."""
        a, b = self.axial_expansion, self.transverse_expansion
        return np.array([a, b, b, 0.0, 0.0, 0.0])


def chamis(fibre: Constituent, matrix: Constituent, packing: float) -> Constituent:
    """Estimate the constants of parallel fibres in an isotropic matrix by Chamis."""
    # C. C. Chamis, "Simplified composite micromechanics equations for hygral, thermal and
    # mechanical properties", NASA TM-83320 (1983).
    root = packing**0.5
    em, nu = matrix.axial_modulus, matrix.axial_poisson
    gm = matrix.axial_shear
    e1 = packing * fibre.axial_modulus + (1 - packing) * em
    e2 = em / (1 - root * (1 - em / fibre.transverse_modulus))
    g12 = gm / (1 - root * (1 - gm / fibre.axial_shear))
    g23 = gm / (1 - root * (1 - gm / fibre.transverse_shear))
    alpha = matrix.axial_expansion
    axial = (
        packing * fibre.axial_expansion * fibre.axial_modulus + (1 - packing) * alpha * em
    ) / e1
    across = (
        fibre.transverse_expansion * root
        + (1 - root) * (1 + packing * nu * fibre.axial_modulus / e1) * alpha
    )
    return Constituent(
        e1,
        e2,
        g12,
        packing * fibre.axial_poisson + (1 - packing) * nu,
        e2 / (2 * g23) - 1,
        axial,
        across,
        packing * fibre.density + (1 - packing) * matrix.density,
    )


def mori_tanaka(fibre: Constituent, matrix: Constituent, packing: float) -> Constituent:
    """Estimate the constants of parallel fibres in an isotropic matrix by Mori and Tanaka."""
    # T. Mori and K. Tanaka, Acta Metall. 21 (1973) 571, in the form of Y. Benveniste, Mech. Mater.
    # 6 (1987) 147, eq. 14a; Eshelby's tensor of an infinite cylinder: T. Mura, "Micromechanics of
    # Defects in Solids", eq. 11.22. Thermal expansion by V. M. Levin's relation, which is exact.
    nu = matrix.axial_poisson
    eshelby = np.zeros((6, 6))
    factor = 1 / (2 * (1 - nu))
    # Axis x; the section is a circle in y and z.
    eshelby[1, 1] = eshelby[2, 2] = factor * (3 / 4 + (1 - 2 * nu) / 2)
    eshelby[1, 2] = eshelby[2, 1] = factor * (1 / 4 - (1 - 2 * nu) / 2)
    eshelby[1, 0] = eshelby[2, 0] = factor * nu
    eshelby[3, 3] = factor * 2 * (1 / 4 + (1 - 2 * nu) / 2)
    eshelby[4, 4] = eshelby[5, 5] = 1 / 2
    eye = np.eye(6)
    own, other = matrix.stiffness, fibre.stiffness
    dilute = np.linalg.inv(eye + eshelby @ np.linalg.solve(own, other - own))
    mean = np.linalg.inv((1 - packing) * eye + packing * dilute)
    stiffness = own + packing * (other - own) @ dilute @ mean
    compliance = np.linalg.inv(stiffness)
    a, b = matrix.expansion, fibre.expansion
    turned = np.linalg.solve(np.linalg.inv(other) - np.linalg.inv(own), b - a)
    expansion = a + (compliance - np.linalg.inv(own)) @ turned
    e1, e2 = 1 / compliance[0, 0], 1 / compliance[1, 1]
    return Constituent(
        e1,
        e2,
        1 / compliance[5, 5],
        -compliance[0, 1] * e1,
        -compliance[1, 2] * e2,
        float(expansion[0]),
        float(expansion[1]),
        packing * fibre.density + (1 - packing) * matrix.density,
    )


#: Rules for the stiffness of a yarn.
YARN_RULES = {"chamis": chamis, "mori_tanaka": mori_tanaka}


def turn_stiffness(material: Constituent, directions: Floats) -> NDArray[Any]:
    """Turn the stiffness of a material into several directions.

    Parameters
    ----------
    material : Constituent
        A transversely isotropic material.
    directions : ndarray, shape (n, 3)
        Unit vectors along its axis.

    Returns
    -------
    ndarray, shape (21, n)
        Upper triangles of the stiffnesses [Pa].
    """
    # A. J. M. Spencer, "Continuum Theory of the Mechanics of Fibre-Reinforced Composites" (1984),
    # eq. 25.
    c = material.stiffness
    lame, across, along = c[1, 2], c[3, 3], c[5, 5]
    mixed = c[0, 1] - lame
    square = c[0, 0] - lame - 2 * mixed - 4 * along + 2 * across
    x, y, z = directions.T
    p = np.stack([x * x, y * y, z * z, y * z, x * z, x * y])
    xx, yy, zz, yz, xz, xy = p
    shear = {
        (0, 0): 2 * xx,
        (1, 1): 2 * yy,
        (2, 2): 2 * zz,
        (0, 4): xz,
        (0, 5): xy,
        (1, 3): yz,
        (1, 5): xy,
        (2, 3): yz,
        (2, 4): xz,
        (3, 3): (yy + zz) / 2,
        (4, 4): (xx + zz) / 2,
        (5, 5): (xx + yy) / 2,
        (3, 4): xy / 2,
        (3, 5): xz / 2,
        (4, 5): yz / 2,
    }
    made = np.empty((21, len(directions)), directions.dtype)
    for entry, (i, j) in zip(made, upper_pairs(), strict=True):
        entry[:] = square * p[i] * p[j]
        if i < 3 and j < 3:
            entry += lame
        if j < 3 or i < 3:
            entry += mixed * ((p[j] if i < 3 else 0) + (p[i] if j < 3 else 0))
        if i == j:
            entry += across * (2 if i < 3 else 1)
        if (i, j) in shear:
            entry += 2 * (along - across) * shear[i, j]
    return made


def turn_stress(material: Constituent, directions: Floats) -> NDArray[Any]:
    """Turn the stress that keeps a material from expanding by one kelvin [Pa/K], (6, n)."""
    stress = material.stiffness @ material.expansion
    x, y, z = directions.T
    made = (stress[0] - stress[1]) * np.stack([x * x, y * y, z * z, y * z, x * z, x * y])
    made[:3] += stress[1]
    return made


def mix_layers(
    first: NDArray[Any], second: NDArray[Any], share: Floats, normal: Floats
) -> NDArray[Any]:
    """Mix two materials in thin layers, exactly."""
    # `first` and `second` are upper triangles of stiffnesses [Pa], 21 rows, or 27 with the thermal
    # stress [Pa/K]; (k, n). `share` (n,) is that of the first; `normal` (n, 3) that of the layers.
    # G. E. Backus, J. Geophys. Res. 67 (1962) 4427; in this form G. W. Milton, "The Theory of
    # Composites" (2002), section 9.5. The strains of the layers differ by sym(a ⊗ n); the vector a
    # follows from equal tractions.
    made = share * first + (1 - share) * second
    for start in range(0, len(share), _BLOCK):
        part = slice(start, start + _BLOCK)
        difference = first[:, part] - second[:, part]
        other = (1 - share[part]) * first[:, part] + share[part] * second[:, part]
        n = normal[part].T.astype(made.dtype)
        step = _rows_times_normal(_full(difference[:21]), n)
        traction = _normal_times_rows(n, _rows_times_normal(_full(other[:21]), n))
        inverse = _invert(traction)
        weight = share[part] * (1 - share[part])
        right = np.einsum("abn,ibn->ian", inverse, step)
        for row, (i, j) in enumerate(upper_pairs()):
            made[row, part] -= weight * np.einsum("an,an->n", step[i], right[j])
        if len(first) > 21:
            jump = _normal_times_rows(n, difference[21:, None])[:, 0]
            made[21:, part] -= weight * np.einsum("ian,an->in", right, jump)
    return made


def upper_pairs() -> list[tuple[int, int]]:
    """Return rows and columns of the upper triangle of a symmetric 6 × 6 matrix."""
    return [(i, j) for i in range(6) for j in range(i, 6)]


def _full(upper: NDArray[Any]) -> NDArray[Any]:
    full = np.empty((6, 6, upper.shape[1]), upper.dtype)
    full[UPPER] = upper
    full[UPPER[1], UPPER[0]] = upper
    return full


#: Which components of a stress act on a surface with the normal x, y and z, along x, y and z.
_STRESS = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def _rows_times_normal(matrix: NDArray[Any], normal: NDArray[Any]) -> NDArray[Any]:
    """Contract the last stress index with a normal: (k, 6, n) to (k, 3, n)."""
    return np.stack(
        [sum(matrix[:, _STRESS[a, b]] * normal[b] for b in range(3)) for a in range(3)], axis=1
    )


def _normal_times_rows(normal: NDArray[Any], matrix: NDArray[Any]) -> NDArray[Any]:
    """Contract the first stress index with a normal: (6, k, n) to (3, k, n)."""
    return np.stack([sum(matrix[_STRESS[a, b]] * normal[b] for b in range(3)) for a in range(3)])


def _invert(m: NDArray[Any]) -> NDArray[Any]:
    """Invert symmetric 3 × 3 matrices (3, 3, n)."""
    made = np.empty_like(m)
    made[0, 0] = m[1, 1] * m[2, 2] - m[1, 2] ** 2
    made[1, 1] = m[0, 0] * m[2, 2] - m[0, 2] ** 2
    made[2, 2] = m[0, 0] * m[1, 1] - m[0, 1] ** 2
    made[1, 2] = made[2, 1] = m[0, 2] * m[0, 1] - m[0, 0] * m[1, 2]
    made[0, 2] = made[2, 0] = m[0, 1] * m[1, 2] - m[1, 1] * m[0, 2]
    made[0, 1] = made[1, 0] = m[0, 2] * m[1, 2] - m[2, 2] * m[0, 1]
    made /= m[0, 0] * made[0, 0] + m[0, 1] * made[0, 1] + m[0, 2] * made[0, 2]
    return made
