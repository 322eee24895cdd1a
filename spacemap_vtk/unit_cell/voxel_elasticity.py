"""Linear elasticity of a periodic box of voxels: conjugate gradients with Fourier transforms.

Each voxel is a trilinear hexahedron with one integration point, which is the rotated scheme of
F. Willot, "Fourier-based schemes for computing the mechanical response of composites with accurate
local fields", C. R. Mécanique 343 (2015) 232, or with eight, the usual element. The preconditioner
is the stiffness of the same elements of one isotropic material, which Fourier transforms invert
exactly.

Stresses and strains have the order xx, yy, zz, yz, xz, xy; shear strains are the engineering ones.
A symmetric stiffness has 21 numbers, the upper triangle row by row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from spacemap_vtk.cancel import active_token
from spacemap_vtk.errors import SolverError
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.parallel import for_each, load_loops
from spacemap_vtk.unit_cell.mixtures import UPPER, upper_pairs

#: Component of the strain (6) that each derivative ∂u_i/∂x_j belongs to.
_COMPONENT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
#: Voxels from which the compiled loops save more than loading the compiler costs.
_MANY_VOXELS = 20_000
#: Steps after which the search is given up.
_MOST_STEPS = 500

#: Numbers in single or double precision.
Reals = NDArray[Any]


@dataclass(frozen=True)
class Response:
    """Response of a box of voxels to imposed mean strains."""

    displacements: Reals
    """Periodic part of the displacement [m], (loads, 3, nz, ny, nx)."""
    energies: Floats
    """Twice the mean energy density between loads [Pa], (loads, loads); symmetric."""
    steps: list[int]
    """Steps of the search for each load."""


class VoxelElasticity:
    """Elasticity of a periodic box of voxels.

    Parameters
    ----------
    stiffness : ndarray of float32 or float64, shape (nz, ny, 21, nx)
        Stiffness of each voxel [Pa], the upper triangle row by row; 0 for empty voxels. Everything
        is computed in its precision; the simple one costs 1e-6 of the result.
    spacing : sequence of 3 floats
        Size of a voxel along x, y and z [m].
    points : {1, 8}
        Integration points of a voxel.
    """

    def __init__(self, stiffness: Reals, spacing: Floats, points: int = 1) -> None:
        self.stiffness = np.ascontiguousarray(stiffness)
        self._number = self.stiffness.dtype.type
        self.spacing = np.asarray(spacing, dtype=np.float64)
        #: Integration points along one edge of a voxel, from 0 to 1.
        self._places = np.array([0.5]) if points == 1 else 0.5 + np.array([-0.5, 0.5]) / 3**0.5
        depth, rows, _, width = self.stiffness.shape
        self._shape = depth, rows, width
        self._loops = load_loops(
            "spacemap_vtk.unit_cell.voxel_loops", depth * rows * width >= _MANY_VOXELS
        )
        #: Sum of the stiffnesses of each layer of voxels [Pa], (nz, 6, 6).
        self._layers = symmetric(self.stiffness.sum(axis=(1, 3), dtype=np.float64))
        self._inverse = self._invert_reference()

    def solve(
        self,
        strains: Floats,
        tolerance: float = 3e-3,
        report_progress: Callable[[float], object] | None = None,
    ) -> Response:
        """Solve for the periodic displacements under imposed strains.

        Parameters
        ----------
        strains : ndarray, shape (loads, 6) or (loads, nz, 6)
            Imposed strain, of the whole box or of each layer of voxels.
        tolerance : float
            Residual at the end over that at the start, in the norm of the preconditioner, which is
            near that of the energy. The energies err by its square.
        report_progress : callable, optional
            Called with the share of the work that is done.

        Returns
        -------
        Response
            Displacements and energies.

        Raises
        ------
        SolverError
            If a load does not converge, as for bodies without a matrix.
        """
        loads = np.asarray(strains, dtype=self._number)
        if loads.ndim == 2:
            loads = np.repeat(loads[:, None], self._shape[0], axis=1)
        loads = np.ascontiguousarray(loads)
        count = len(loads)
        moved = np.zeros((count, 3, *self._shape), self._number)
        steps = [0] * count
        shares = np.zeros(count)

        def solve_load() -> Callable[[int], None]:
            def solve_one(load: int) -> None:
                left = -self._apply(moved[load], loads[load])
                energy = np.einsum("zi,zij,zj", loads[load], self._layers, loads[load])

                def report(share: float) -> None:
                    shares[load] = max(share, shares[load])
                    if report_progress is not None:
                        report_progress(float(shares.mean()))

                steps[load] = self._minimise(moved[load], left, tolerance, energy, report)

            return solve_one

        for_each(list(range(count)), solve_load)
        return Response(moved, self._energies(loads, moved), steps)

    def _apply(self, moved: Reals, strain: Reals) -> Reals:
        """Compute the nodal forces per volume of a voxel [Pa/m], (3, nz, ny, nx)."""
        out = np.zeros_like(moved)
        if self._loops is None:
            for place in product(self._places, repeat=3):
                stresses = self._stresses(self._strains(moved, strain, place))
                self._add_divergence(stresses, place, out)
        elif len(self._places) == 1:
            scale = (0.25 / self.spacing).astype(self._number)
            self._loops.apply_one_point(self.stiffness, moved, strain, scale, out)
        else:
            slopes = self._slopes().astype(self._number)
            self._loops.apply_eight_points(self.stiffness, moved, strain, slopes, out)
        if len(self._places) > 1:
            out /= len(self._places) ** 3
        return out

    def fields(self, moved: Reals, strain: Floats) -> tuple[Reals, Reals]:
        """Compute the mean strain and stress of each voxel.

        Parameters
        ----------
        moved : ndarray, shape (3, nz, ny, nx)
            Periodic part of the displacement [m].
        strain : ndarray, shape (6,)
            Imposed strain.

        Returns
        -------
        tuple of ndarray, shape (6, nz, ny, nx)
            Strain, and stress [Pa].
        """
        imposed = np.broadcast_to(np.asarray(strain, self._number), (self._shape[0], 6))
        strains = self._strains(moved, imposed, (0.5, 0.5, 0.5))
        return strains, self._stresses(strains)

    def mean_power(self, moved: Reals, strains: Floats, stress: Reals) -> Floats:
        """Compute the mean of a given stress field times the strain of each load.

        Parameters
        ----------
        moved : ndarray, shape (loads, 3, nz, ny, nx)
            Periodic part of the displacement of each load [m].
        strains : ndarray, shape (loads, 6) or (loads, nz, 6)
            Imposed strains.
        stress : ndarray, shape (6, nz, ny, nx)
            The stress field [Pa].

        Returns
        -------
        ndarray, shape (loads,)
            Mean power [Pa].
        """
        forces = np.zeros((3, *self._shape), self._number)
        self._add_divergence(stress, (0.5, 0.5, 0.5), forces)
        loads = np.asarray(strains, dtype=np.float64)
        if loads.ndim == 2:
            loads = np.repeat(loads[:, None], self._shape[0], axis=1)
        layers = stress.sum(axis=(2, 3), dtype=np.float64)
        own = np.einsum("lzk,kz->l", loads, layers)
        work = np.array([np.sum(forces * one, dtype=np.float64) for one in moved])
        return (own + work) / np.prod(self._shape)

    def _minimise(
        self, moved: Reals, left: Reals, tolerance: float, energy: float, progress: Progress
    ) -> int:
        """Solve by conjugate gradients; `left` is the residual, and both change in place."""
        # The energy of the imposed strain shows what is only rounding.
        token = active_token()
        still = np.zeros((self._shape[0], 6), self._number)
        better = self._precondition(left)
        now = _dot(left, better)
        rounding = 10 * np.finfo(self._number).eps
        goal = max(tolerance**2 * now, rounding**2 * energy)
        direction, first = better, now
        for step in range(_MOST_STEPS):
            if now <= goal:
                progress(1.0)
                return step
            # Each step divides the residual by about the same number.
            progress(max(0.0, float(np.log(first / now) / np.log(first / goal))))
            token.check()
            image = self._apply(direction, still)
            length = self._number(now / _dot(direction, image))
            moved += length * direction
            left -= length * image
            better = self._precondition(left)
            before, now = now, _dot(left, better)
            direction *= self._number(now / before)
            direction += better
        raise SolverError(
            f"the stiffness of the unit cell did not converge in {_MOST_STEPS} steps",
            cure="Give the cell a matrix: dry yarns that touch in points have no stiffness of "
            "their own in voxels.",
        )

    def _energies(self, loads: Reals, moved: Reals) -> Floats:
        """Compute twice the mean energy density between loads, (loads, loads)."""
        # With K u = f − r, the energy between two loads is that of the imposed strains less f·u of
        # one, and r·u of the other; the error is of second order in r.
        energies = np.einsum("azi,zij,bzj->ab", loads, self._layers, loads, optimize=True)
        still = np.zeros_like(moved[0])
        for load, one in enumerate(moved):
            force, left = -self._apply(still, loads[load]), -self._apply(one, loads[load])
            energies[load] -= [_dot(force, other) for other in moved]
            energies[:, load] -= [_dot(left, other) for other in moved]
        energies /= np.prod(self._shape)
        return (energies + energies.T) / 2

    def _precondition(self, left: Reals) -> Reals:
        spectrum = scipy.fft.rfftn(left, axes=(1, 2, 3))
        if self._loops is None:
            a, b, c = spectrum.copy()
            xx, yy, zz, yz, xz, xy = self._inverse
            spectrum[0] = xx * a + xy * b + xz * c
            spectrum[1] = xy * a + yy * b + yz * c
            spectrum[2] = xz * a + yz * b + zz * c
        else:
            self._loops.precondition(self._inverse, spectrum)
        back: Reals = scipy.fft.irfftn(spectrum, s=self._shape, axes=(1, 2, 3), overwrite_x=True)
        return back

    def _invert_reference(self) -> Reals:
        """Invert the stiffness of an isotropic material for each wave, (6, nz, ny, nx // 2 + 1)."""
        mean = self.stiffness.mean(axis=(0, 1, 3), dtype=np.float64)
        bulk = mean[[0, 1, 2, 6, 7, 11]] @ np.array([1, 2, 2, 1, 2, 1]) / 9
        trace = mean[[0, 6, 11]].sum() + 2 * mean[[15, 18, 20]].sum()
        shear = (trace - 3 * bulk) / 10
        lame = bulk - 2 / 3 * shear
        depth, rows, width = self._shape
        turns = [
            2 * np.pi * np.fft.fftfreq(depth)[:, None, None],
            2 * np.pi * np.fft.fftfreq(rows)[None, :, None],
            2 * np.pi * np.arange(width // 2 + 1)[None, None, :] / width,
        ]
        waves = [np.exp(1j * turn) for turn in turns[::-1]]
        matrix = np.zeros((6, depth, rows, width // 2 + 1))
        share = 1 / len(self._places) ** 3
        for place in product(self._places, repeat=3):
            along = [1 - p + p * wave for p, wave in zip(place, waves, strict=True)]
            slope = [(wave - 1) / h for wave, h in zip(waves, self.spacing, strict=True)]
            k = (
                slope[0] * along[1] * along[2],
                along[0] * slope[1] * along[2],
                along[0] * along[1] * slope[2],
            )
            square = sum((one * one.conj()).real for one in k)
            pairs = (0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)
            for entry, (i, j) in zip(matrix, pairs, strict=True):
                # Over the points of an element, which are symmetric, the imaginary parts cancel.
                entry += share * (lame + shear) * (k[i].conj() * k[j]).real
                if i == j:
                    entry += share * shear * square
        xx, yy, zz, yz, xz, xy = matrix
        minors = np.stack(
            [
                yy * zz - yz**2,
                xx * zz - xz**2,
                xx * yy - xy**2,
                xz * xy - xx * yz,
                xy * yz - yy * xz,
                xz * yz - zz * xy,
            ]
        )
        determinant = xx * minors[0] + xy * minors[5] + xz * minors[4]
        # Waves that deform no voxel: the mean displacement, and with one point those that change
        # sign from one node to the next along two axes or more.
        size = xx + yy + zz
        still = size <= 1e-9 * size.max()
        determinant[still] = np.inf
        return (minors / determinant).astype(self._number)

    def _slopes(self) -> Floats:
        """Derivatives of the shape functions at the integration points [1/m], (points, 8, 3)."""
        made = []
        for place in product(self._places, repeat=3):
            for upper in product((0, 1), repeat=3):
                corner = upper[::-1]
                value = [p if c else 1 - p for p, c in zip(place, corner, strict=True)]
                sign = [(1 if c else -1) / h for c, h in zip(corner, self.spacing, strict=True)]
                made.append(
                    (
                        sign[0] * value[1] * value[2],
                        value[0] * sign[1] * value[2],
                        value[0] * value[1] * sign[2],
                    )
                )
        return np.array(made).reshape(-1, 8, 3)

    def _strains(self, moved: Reals, strain: Reals, place: tuple[float, ...]) -> Reals:
        made = np.zeros((6, *self._shape), self._number)
        made += strain.T[:, :, None, None]
        for i in range(3):
            for j in range(3):
                made[_COMPONENT[i, j]] += self._derivative(moved[i], j, place, 1)
        return made

    def _stresses(self, strains: Reals) -> Reals:
        made = np.zeros_like(strains)
        for k, (i, j) in enumerate(upper_pairs()):
            modulus = self.stiffness[:, :, k]
            made[i] += modulus * strains[j]
            if i != j:
                made[j] += modulus * strains[i]
        return made

    def _add_divergence(self, stresses: Reals, place: tuple[float, ...], out: Reals) -> None:
        for i in range(3):
            for j in range(3):
                out[i] += self._derivative(stresses[_COMPONENT[i, j]], j, place, -1)

    def _derivative(self, values: Reals, along: int, place: tuple[float, ...], way: int) -> Reals:
        """Differentiate nodal values in the voxels (way 1); or the transposed operator (way −1)."""
        for axis, share in enumerate(place):
            other = np.roll(values, -way, axis=2 - axis)
            if axis == along:
                values = (other - values) * self._number(1 / self.spacing[axis])
            else:
                values = self._number(1 - share) * values + self._number(share) * other
        return values


def symmetric(upper: Floats) -> Floats:
    """Return symmetric matrices of their upper triangles.

    Parameters
    ----------
    upper : ndarray, shape (..., 21)
        Upper triangles, row by row.

    Returns
    -------
    ndarray, shape (..., 6, 6)
        Matrices.
    """
    full = np.zeros((*upper.shape[:-1], 6, 6))
    full[..., UPPER[0], UPPER[1]] = upper
    full[..., UPPER[1], UPPER[0]] = upper
    return full


def _dot(first: Reals, second: Reals) -> float:
    return float(np.sum(first * second, dtype=np.float64))
