"""Compiled loops over the voxels of a unit cell; see `voxel_elasticity` for the same in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.parallel import compile_function


@compile_function
def apply_one_point(
    stiffness: NDArray[Any],
    moved: NDArray[Any],
    strain: NDArray[Any],
    scale: NDArray[Any],
    out: NDArray[Any],
) -> None:
    """Add the nodal forces of hexahedra with one integration point to `out`."""
    # The eight corners of a voxel are two planes of four at both ends of x. For each plane the sum
    # and the differences along y and z are formed once and used by two voxels.
    depth, rows, _, width = stiffness.shape
    total = np.empty((3, width + 1), stiffness.dtype)
    along_y = np.empty((3, width + 1), stiffness.dtype)
    along_z = np.empty((3, width + 1), stiffness.dtype)
    stress = np.empty((6, width + 1), stiffness.dtype)
    sx, sy, sz = scale[0], scale[1], scale[2]
    for z in range(depth):
        up = z + 1 if z + 1 < depth else 0
        for y in range(rows):
            back = y + 1 if y + 1 < rows else 0
            for c in range(3):
                first, second = moved[c, z, y], moved[c, z, back]
                third, fourth = moved[c, up, y], moved[c, up, back]
                for x in range(width):
                    a, b, d, e = first[x], second[x], third[x], fourth[x]
                    total[c, x] = sx * ((a + b) + (d + e))
                    along_y[c, x] = sy * ((b + e) - (a + d))
                    along_z[c, x] = sz * ((d + e) - (a + b))
                total[c, width] = total[c, 0]
                along_y[c, width] = along_y[c, 0]
                along_z[c, width] = along_z[c, 0]
            moduli = stiffness[z, y]
            for x in range(width):
                e0 = strain[z, 0] + (total[0, x + 1] - total[0, x])
                e1 = strain[z, 1] + (along_y[1, x] + along_y[1, x + 1])
                e2 = strain[z, 2] + (along_z[2, x] + along_z[2, x + 1])
                e3 = strain[z, 3] + (
                    along_z[1, x] + along_z[1, x + 1] + along_y[2, x] + along_y[2, x + 1]
                )
                e4 = strain[z, 4] + (
                    along_z[0, x] + along_z[0, x + 1] + total[2, x + 1] - total[2, x]
                )
                e5 = strain[z, 5] + (
                    along_y[0, x] + along_y[0, x + 1] + total[1, x + 1] - total[1, x]
                )
                c01, c02, c03 = moduli[1, x], moduli[2, x], moduli[3, x]
                c04, c05, c12 = moduli[4, x], moduli[5, x], moduli[7, x]
                c13, c14, c15 = moduli[8, x], moduli[9, x], moduli[10, x]
                c23, c24, c25 = moduli[12, x], moduli[13, x], moduli[14, x]
                c34, c35, c45 = moduli[16, x], moduli[17, x], moduli[19, x]
                stress[0, x + 1] = (
                    moduli[0, x] * e0 + c01 * e1 + c02 * e2 + c03 * e3 + c04 * e4 + c05 * e5
                )
                stress[1, x + 1] = (
                    c01 * e0 + moduli[6, x] * e1 + c12 * e2 + c13 * e3 + c14 * e4 + c15 * e5
                )
                stress[2, x + 1] = (
                    c02 * e0 + c12 * e1 + moduli[11, x] * e2 + c23 * e3 + c24 * e4 + c25 * e5
                )
                stress[3, x + 1] = (
                    c03 * e0 + c13 * e1 + c23 * e2 + moduli[15, x] * e3 + c34 * e4 + c35 * e5
                )
                stress[4, x + 1] = (
                    c04 * e0 + c14 * e1 + c24 * e2 + c34 * e3 + moduli[18, x] * e4 + c45 * e5
                )
                stress[5, x + 1] = (
                    c05 * e0 + c15 * e1 + c25 * e2 + c35 * e3 + c45 * e4 + moduli[20, x] * e5
                )
            for k in range(6):
                stress[k, 0] = stress[k, width]
            for c in range(3):
                # Rows of the stress tensor: xx, xy, xz; xy, yy, yz; xz, yz, zz.
                px = stress[0 if c == 0 else (5 if c == 1 else 4)]
                py = stress[5 if c == 0 else (1 if c == 1 else 3)]
                pz = stress[4 if c == 0 else (3 if c == 1 else 2)]
                first, second = out[c, z, y], out[c, z, back]
                third, fourth = out[c, up, y], out[c, up, back]
                for x in range(width):
                    f = sx * (px[x] - px[x + 1])
                    g = sy * (py[x] + py[x + 1])
                    h = sz * (pz[x] + pz[x + 1])
                    first[x] += f - g - h
                    second[x] += f + g - h
                    third[x] += f - g + h
                    fourth[x] += f + g + h


@compile_function
def apply_eight_points(
    stiffness: NDArray[Any],
    moved: NDArray[Any],
    strain: NDArray[Any],
    slopes: NDArray[Any],
    out: NDArray[Any],
) -> None:
    """Add the nodal forces of hexahedra with several integration points to `out`."""
    # `slopes` (points, 8, 3) holds the derivatives of the shape functions at each
    # point. The caller divides the forces by the number of points.
    depth, rows, _, width = stiffness.shape
    count = len(slopes)
    local = np.empty((8, 3), stiffness.dtype)
    force = np.empty((8, 3), stiffness.dtype)
    e = np.empty(6, stiffness.dtype)
    s = np.empty(6, stiffness.dtype)
    for z in range(depth):
        up = z + 1 if z + 1 < depth else 0
        for y in range(rows):
            back = y + 1 if y + 1 < rows else 0
            for x in range(width):
                right = x + 1 if x + 1 < width else 0
                for c in range(3):
                    local[0, c] = moved[c, z, y, x]
                    local[1, c] = moved[c, z, y, right]
                    local[2, c] = moved[c, z, back, x]
                    local[3, c] = moved[c, z, back, right]
                    local[4, c] = moved[c, up, y, x]
                    local[5, c] = moved[c, up, y, right]
                    local[6, c] = moved[c, up, back, x]
                    local[7, c] = moved[c, up, back, right]
                force[:] = 0.0
                for point in range(count):
                    e[:] = strain[z]
                    for a in range(8):
                        gx, gy, gz = slopes[point, a, 0], slopes[point, a, 1], slopes[point, a, 2]
                        u, v, w = local[a, 0], local[a, 1], local[a, 2]
                        e[0] += gx * u
                        e[1] += gy * v
                        e[2] += gz * w
                        e[3] += gz * v + gy * w
                        e[4] += gz * u + gx * w
                        e[5] += gy * u + gx * v
                    s[:] = 0.0
                    k = 0
                    for i in range(6):
                        for j in range(i, 6):
                            modulus = stiffness[z, y, k, x]
                            k += 1
                            s[i] += modulus * e[j]
                            if j > i:
                                s[j] += modulus * e[i]
                    for a in range(8):
                        gx, gy, gz = slopes[point, a, 0], slopes[point, a, 1], slopes[point, a, 2]
                        force[a, 0] += gx * s[0] + gy * s[5] + gz * s[4]
                        force[a, 1] += gx * s[5] + gy * s[1] + gz * s[3]
                        force[a, 2] += gx * s[4] + gy * s[3] + gz * s[2]
                for c in range(3):
                    out[c, z, y, x] += force[0, c]
                    out[c, z, y, right] += force[1, c]
                    out[c, z, back, x] += force[2, c]
                    out[c, z, back, right] += force[3, c]
                    out[c, up, y, x] += force[4, c]
                    out[c, up, y, right] += force[5, c]
                    out[c, up, back, x] += force[6, c]
                    out[c, up, back, right] += force[7, c]


@compile_function
def precondition(inverse: NDArray[Any], spectrum: NDArray[Any]) -> None:
    """Multiply a spectrum (3, …) in place by symmetric matrices (6, …): xx, yy, zz, yz, xz, xy."""
    _, depth, rows, width = spectrum.shape
    for z in range(depth):
        for y in range(rows):
            for x in range(width):
                a, b, c = spectrum[0, z, y, x], spectrum[1, z, y, x], spectrum[2, z, y, x]
                yz, xz, xy = inverse[3, z, y, x], inverse[4, z, y, x], inverse[5, z, y, x]
                spectrum[0, z, y, x] = inverse[0, z, y, x] * a + xy * b + xz * c
                spectrum[1, z, y, x] = xy * a + inverse[1, z, y, x] * b + yz * c
                spectrum[2, z, y, x] = xz * a + yz * b + inverse[2, z, y, x] * c
