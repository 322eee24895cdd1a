"""Materials: elasticity matrices of isotropic and orthotropic solids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats

#: Range of moduli [Pa] and densities [kg/m³]: their ratios and squares are neither infinite nor
#: zero in float64.
LIMITS = (1e-50, 1e50)


def isotropic(youngs_modulus: float, poissons_ratio: float) -> Floats:
    """Compute the elasticity matrix of an isotropic solid (Hooke's law).

    Parameters
    ----------
    youngs_modulus : float
        Young's modulus E > 0 [Pa].
    poissons_ratio : float
        Poisson's ratio ν, above -1 and below 0.5.

    Returns
    -------
    ndarray of float64, shape (6, 6)
        Stress (xx, yy, zz, yz, zx, xy) [Pa] from strain in the same order, with engineering shears
        (γ = 2ε): σ = λ tr(ε) I + 2μ ε, with Lamé's λ = Eν / ((1 + ν)(1 - 2ν)) and
        μ = E / (2 (1 + ν)).

    Raises
    ------
    InputError
        If the solid would not be stable.
    """
    if not (np.isfinite(youngs_modulus) and youngs_modulus > 0):
        raise InputError(
            "Young's modulus must be above 0 Pa", key="youngs_modulus", value=youngs_modulus
        )
    check_limits("youngs_modulus", youngs_modulus, "Pa")
    if not -1 < poissons_ratio < 0.5:
        raise InputError(
            "Poisson's ratio must be above -1 and below 0.5",
            key="poissons_ratio",
            value=poissons_ratio,
            cure="Use 0.49 for a nearly incompressible material",
        )
    shear = youngs_modulus / (2 * (1 + poissons_ratio))
    lame = 2 * shear * poissons_ratio / (1 - 2 * poissons_ratio)
    matrix = np.diag([2.0 * shear] * 3 + [shear] * 3)
    matrix[:3, :3] += lame
    return matrix


def orthotropic(
    youngs_moduli: Sequence[float], shear_moduli: Sequence[float], poissons_ratios: Sequence[float]
) -> Floats:
    """Compute the elasticity matrix of a solid with three planes of symmetry.

    Axes 1, 2, 3 are those of the material, see `fabric_to_xyz`.

    Parameters
    ----------
    youngs_moduli : sequence of 3 float
        Young's moduli E1, E2, E3 [Pa], above 0.
    shear_moduli : sequence of 3 float
        Shear moduli G12, G13, G23 [Pa], above 0.
    poissons_ratios : sequence of 3 float
        Poisson's ratios ν12, ν13, ν23. νij is the contraction along j for a stretch along i, so
        νij/Ei = νji/Ej.

    Returns
    -------
    ndarray of float64, shape (6, 6)
        Stress from strain, in the order of `isotropic`: the inverse of the compliance whose
        diagonal is 1/E1, 1/E2, 1/E3, 1/G23, 1/G13, 1/G12, and whose entry (i, j) is -νij/Ei.

    Raises
    ------
    InputError
        If a modulus is not positive, or the solid would not be stable because a strain would
        release energy. The message names the first pair of axes with νij² >= Ei/Ej.

    Notes
    -----
    Lekhnitskii, "Theory of Elasticity of an Anisotropic Body" (1963); the conditions are those of
    Lempriere, AIAA J. 6 (1968) 2226.

    Examples
    --------
    >>> stiff = orthotropic([2e6, 1e6, 1e5], [1e5, 5e4, 5e4], [0.2, 0.1, 0.1])
    >>> round(float(1 / np.linalg.inv(stiff)[0, 0]))
    2000000
    """
    stretch = _check_three("youngs_moduli", youngs_moduli, "E1, E2, E3 in Pa")
    shear = _check_three("shear_moduli", shear_moduli, "G12, G13, G23 in Pa")
    ratio = _check_three("poissons_ratios", poissons_ratios, "ν12, ν13, ν23")
    for key, values in (("youngs_moduli", stretch), ("shear_moduli", shear)):
        if not (values > 0).all():
            raise InputError("all three moduli must be above 0 Pa", key=key, value=values.tolist())
        check_limits(key, values.tolist(), "Pa")
    pairs = ((0, 1), (0, 2), (1, 2))
    for (i, j), nu in zip(pairs, ratio, strict=True):
        bound = float(np.sqrt(stretch[i] / stretch[j]))
        if not abs(nu) < bound:
            raise InputError(
                f"ν{i + 1}{j + 1} = {nu:g} is not possible with E{i + 1} = {stretch[i]:g} Pa "
                f"and E{j + 1} = {stretch[j]:g} Pa",
                key="poissons_ratios",
                value=ratio.tolist(),
                allowed=f"ν{i + 1}{j + 1} between -{bound:.4g} and {bound:.4g}, "
                f"sqrt(E{i + 1}/E{j + 1})",
                cure=f"νij/Ei = νji/Ej: check that ν{j + 1}{i + 1} was not given instead of "
                f"ν{i + 1}{j + 1}.",
            )
    # Scaled by sqrt(Ei Ej), the compliance has ones on its diagonal. The test for positive
    # definiteness is then safe from rounding, however different the moduli are.
    root = np.sqrt(stretch)
    scaled = np.eye(3)
    for (i, j), nu in zip(pairs, ratio, strict=True):
        scaled[i, j] = scaled[j, i] = -nu * root[j] / root[i]
    if np.linalg.eigvalsh(scaled)[0] <= 1e-9:
        raise InputError(
            "these three Poisson's ratios are not possible together",
            key="poissons_ratios",
            value=ratio.tolist(),
            allowed="1 - ν12ν21 - ν23ν32 - ν13ν31 - 2ν21ν32ν13 above 0, with νji = νij Ej/Ei",
            cure="Lower the ratios",
        )
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = np.linalg.inv(scaled) * np.outer(root, root)
    matrix[:3, :3] = (matrix[:3, :3] + matrix[:3, :3].T) / 2
    matrix[[3, 4, 5], [3, 4, 5]] = shear[[2, 1, 0]]
    return matrix


def fabric_to_xyz(matrix: Floats) -> Floats:
    """Convert an elasticity matrix from a fabric's axes to x, y, z.

    Parameters
    ----------
    matrix : ndarray of float64, shape (6, 6)
        Elasticity along axes 1, the warp (y), 2, the weft (x), and 3, the normal (z).

    Returns
    -------
    ndarray of float64, shape (6, 6)
        Elasticity in the order of `isotropic`.
    """
    order = [1, 0, 2, 4, 3, 5]
    return matrix[order][:, order]


def equivalent_poissons_ratio(matrix: Floats) -> float:
    """Compute Poisson's ratio of an isotropic solid that is equally close to incompressible.

    Parameters
    ----------
    matrix : ndarray of float64, shape (6, 6)
        Elasticity matrix, in the order of `isotropic`.

    Returns
    -------
    float
        (1 - c/s) / 2. c is the change in volume under a unit pressure, which is the sum of the nine
        compliances of the normal strains. s is the sum of the three on the diagonal, without the
        coupling of axes. The result is ν for an isotropic solid, and 0.5 if volume cannot change.
    """
    compliance = np.linalg.inv(matrix[:3, :3])
    return float(1.0 - compliance.sum() / np.trace(compliance)) / 2


def check_limits(key: str, values: float | list[float], unit: str) -> None:
    """Refuse constants so large or small that float64 cannot hold the results."""
    if not (np.min(values) >= LIMITS[0] and np.max(values) <= LIMITS[1]):
        raise InputError(
            "out of range for double precision",
            key=key,
            value=values,
            allowed=f"{LIMITS[0]:g} to {LIMITS[1]:g} {unit}",
        )


def _check_three(key: str, values: Sequence[float], allowed: str) -> Floats:
    result = np.asarray(values, dtype=np.float64)
    if result.shape != (3,) or not np.isfinite(result).all():
        raise InputError("must be three finite numbers", key=key, value=values, allowed=allowed)
    return result
