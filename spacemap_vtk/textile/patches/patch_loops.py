"""Evaluate bicubic Bézier patches in compiled loops, faster than matrix products, equal in result.

Patches are processed in groups whose control points lie next to each other, so that each operation
runs over a whole group in vector registers. A patch is a tensor product: its four curves along u
are evaluated first, then the curves along v from the resulting points. That takes 320
multiplications for a coordinate of 16 samples; one matrix product takes 768. The innermost loops
run over x, y and z at once, because entering a loop costs as much as a hundred multiplications.

Then memory limits the speed. Vector instructions gather a control point, three coordinates at once.
A large result is written past the cache, in whole lines. Otherwise the processor would read each
line before it writes it, and writing would take as long as everything else together.

Needs Numba; see `spacemap_vtk.parallel`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Floats, Ints
from spacemap_vtk.parallel import compile_function
from spacemap_vtk.simd import LINE, stream_line, subtract_point

_GROUP = 64  # patches; 32 and 128 are slower
_ROW = 3 * _GROUP  # x, y and z of a group, patch after patch, in the order of the output


@compile_function
def write(
    target: NDArray[Any], begin: int, source: NDArray[Any], count: int, streamed: bool
) -> None:
    """Copy the first `count` numbers of an array to a position in another array."""
    if streamed:
        for k in range(0, count, LINE // source.itemsize):
            stream_line(target, begin + k, source, k)
    else:
        to = target[begin : begin + count]
        for k in range(count):
            to[k] = source[k]


@compile_function
def evaluate(
    points: NDArray[Any],
    gather: NDArray[Any],
    curve: NDArray[Any],
    per_size: Any,
    suspect: Any,
    positions: NDArray[Any],
    normals: NDArray[Any],
    suspects: Ints,
    streamed: bool,
) -> int:
    """Write the points of some patches, and their unit normals unless `normals` is empty."""
    # An empty array, because with None the loop would be compiled once more for each type.
    # `points` is flat. A streamed result begins at a multiple of 64 bytes, and so does the row of
    # patches of each sample.
    kind, one = curve.dtype, curve[0, 0, 0]  # 1 of that type: an int would make it float64
    count, steps, found = gather.shape[1], curve.shape[1], 0
    has_normals = normals.size > 0
    # First control points stay in the precision of the points while numbers are large: coordinates
    # are subtracted before they are rounded. Arrays have room for one number more, because
    # `subtract_point` writes four.
    first = np.zeros(_ROW + 1, points.dtype)
    origin = np.zeros(_ROW, kind)
    net = np.zeros((4, 4 * _ROW + 1), kind)  # along u, then along v, patch and axis
    nets = net.reshape(-1)
    lines = np.zeros((steps, 4 * _ROW), kind)  # points of the curves along u
    slopes = np.zeros((steps, 4 * _ROW), kind)  # their derivatives
    point, du, dv = np.zeros((3, _ROW), kind)
    square, limit = np.zeros((2, _GROUP), kind)
    for start in range(0, count, _GROUP):
        width = min(_GROUP, count - start)
        for patch in range(width):
            row = np.intp(gather[0, start + patch])
            for axis in range(3):
                first[3 * patch + axis] = points[3 * row + axis]
                origin[3 * patch + axis] = points[3 * row + axis]
        # In this order, each number that is written too much is overwritten with the right one.
        for place in range(16):
            line = (place & 3) * (4 * _ROW + 1) + (place >> 2) * _ROW
            rows = gather[place, start : start + width]
            for patch in range(width):
                row = np.intp(rows[patch])
                subtract_point(points, 3 * row, first, 3 * patch, nets, line + 3 * patch)
        if has_normals:
            limit[:] = 0  # size of a patch: distances of its other corners from the first
            for along, across in ((3, 0), (0, 3), (3, 3)):
                corner = net[along, across * _ROW :]
                for patch in range(_GROUP):
                    x, y, z = corner[3 * patch], corner[3 * patch + 1], corner[3 * patch + 2]
                    limit[patch] += (x * x + y * y + z * z) * per_size * per_size
            for patch in range(_GROUP):
                limit[patch] *= suspect
                limit[patch] *= limit[patch]
        for i in range(steps):
            b0, b1, b2, b3 = curve[0, i, 0], curve[0, i, 1], curve[0, i, 2], curve[0, i, 3]
            d0, d1, d2, d3 = curve[1, i, 0], curve[1, i, 1], curve[1, i, 2], curve[1, i, 3]
            for lane in range(4 * _ROW):
                p0, p1, p2, p3 = net[0, lane], net[1, lane], net[2, lane], net[3, lane]
                lines[i, lane] = b0 * p0 + b1 * p1 + b2 * p2 + b3 * p3
            if has_normals:
                for lane in range(4 * _ROW):
                    p0, p1, p2, p3 = net[0, lane], net[1, lane], net[2, lane], net[3, lane]
                    slopes[i, lane] = d0 * p0 + d1 * p1 + d2 * p2 + d3 * p3
        for j in range(steps):
            b0, b1, b2, b3 = curve[0, j, 0], curve[0, j, 1], curve[0, j, 2], curve[0, j, 3]
            d0, d1, d2, d3 = curve[1, j, 0], curve[1, j, 1], curve[1, j, 2], curve[1, j, 3]
            for i in range(steps):
                p, q = lines[i], slopes[i]
                for lane in range(_ROW):
                    p0, p1 = p[lane], p[lane + _ROW]
                    p2, p3 = p[lane + 2 * _ROW], p[lane + 3 * _ROW]
                    # The origin is added last: the sum of the others is small and keeps its digits.
                    point[lane] = (b0 * p0 + b1 * p1 + b2 * p2 + b3 * p3) + origin[lane]
                at = (j * steps + i) * count + start
                write(positions, 3 * at, point, 3 * width, streamed)
                if not has_normals:
                    continue
                for lane in range(_ROW):
                    p0, p1 = p[lane], p[lane + _ROW]
                    p2, p3 = p[lane + 2 * _ROW], p[lane + 3 * _ROW]
                    q0, q1 = q[lane], q[lane + _ROW]
                    q2, q3 = q[lane + 2 * _ROW], q[lane + 3 * _ROW]
                    du[lane] = b0 * q0 + b1 * q1 + b2 * q2 + b3 * q3
                    dv[lane] = d0 * p0 + d1 * p1 + d2 * p2 + d3 * p3
                for patch in range(_GROUP):
                    ux, uy, uz = du[3 * patch], du[3 * patch + 1], du[3 * patch + 2]
                    vx, vy, vz = dv[3 * patch], dv[3 * patch + 1], dv[3 * patch + 2]
                    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                    square[patch] = x * x + y * y + z * z
                    over = one / np.sqrt(square[patch])
                    du[3 * patch], du[3 * patch + 1], du[3 * patch + 2] = (
                        x * over,
                        y * over,
                        z * over,
                    )
                small = 0
                for patch in range(_GROUP):
                    small += square[patch] <= limit[patch]
                if small:  # rare, so a slow loop is enough
                    for patch in range(width):
                        if square[patch] <= limit[patch]:
                            suspects[found] = at + patch
                            found += 1
                write(normals, 3 * at, du, 3 * width, streamed)
    return found


@compile_function
def robust_normals(
    points: NDArray[Any],
    nets: Ints,
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    bases: Floats,
    inside: float,
    nothing: float,
    normals: Floats,
) -> bool:
    """Write the normals of `RobustNormals.compute`; return False if a patch has no area inside."""
    size, patches = nets.shape
    half = bases.shape[1] // 2
    local = np.zeros((patches, size, 3))
    for patch in range(patches):
        largest = 0.0
        for place in range(size):
            for axis in range(3):
                first = np.float64(points[nets[0, patch], axis])
                away = np.float64(points[nets[place, patch], axis]) - first
                local[patch, place, axis] = away
                largest = max(largest, abs(away))
        if largest > 0.0:
            # One by one: for a whole array, the compiler adds four seconds of error messages.
            for place in range(size):
                for axis in range(3):
                    local[patch, place, axis] /= largest
    made, lengths = np.zeros((2, 3)), np.zeros(2)
    for sample in range(len(row)):
        net = local[column[sample]]
        for side in range(2):  # at the sample, and slightly inside
            at = row[sample] + side * half
            ux, uy, uz, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for place in range(size):
                x, y, z = net[place, 0], net[place, 1], net[place, 2]
                along, across = bases[1, at, place], bases[2, at, place]
                ux, uy, uz = ux + along * x, uy + along * y, uz + along * z
                vx, vy, vz = vx + across * x, vy + across * y, vz + across * z
            x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            made[side, 0], made[side, 1], made[side, 2] = x, y, z
            lengths[side] = np.sqrt(x * x + y * y + z * z)
        if not lengths[1] > nothing:
            return False
        chosen = 0 if lengths[0] > max(nothing, inside * lengths[1]) else 1
        for axis in range(3):
            normals[sample, axis] = made[chosen, axis] / lengths[chosen]
    return True


@compile_function
def interpolate(
    values: NDArray[Any],
    origin: NDArray[Any],
    gather: NDArray[Any],
    curve: NDArray[Any],
    out: NDArray[Any],
) -> None:
    """Interpolate an array of the control points at the points of some patches."""
    kind = curve.dtype
    count, steps, columns = gather.shape[1], curve.shape[1], values.shape[1]
    net = np.zeros((4, 4, _GROUP), kind)  # along u, along v, patch
    lines = np.zeros((4, steps * _GROUP), kind)
    made = np.zeros(steps * _GROUP, kind)
    for start in range(0, count, _GROUP):
        width = min(_GROUP, count - start)
        for column in range(columns):
            common = origin[column]
            for place in range(16):
                row = net[place & 3, place >> 2]
                for patch in range(width):
                    control = np.intp(gather[place, start + patch])
                    row[patch] = values[control, column] - common
            for i in range(steps):
                b0, b1, b2, b3 = curve[0, i, 0], curve[0, i, 1], curve[0, i, 2], curve[0, i, 3]
                for across in range(4):
                    line = lines[across, i * _GROUP :]
                    for patch in range(_GROUP):
                        p0, p1 = net[0, across, patch], net[1, across, patch]
                        p2, p3 = net[2, across, patch], net[3, across, patch]
                        line[patch] = b0 * p0 + b1 * p1 + b2 * p2 + b3 * p3
            for j in range(steps):
                b0, b1, b2, b3 = curve[0, j, 0], curve[0, j, 1], curve[0, j, 2], curve[0, j, 3]
                for lane in range(steps * _GROUP):
                    p0, p1, p2, p3 = lines[0, lane], lines[1, lane], lines[2, lane], lines[3, lane]
                    made[lane] = (b0 * p0 + b1 * p1 + b2 * p2 + b3 * p3) + common
                for i in range(steps):
                    at = ((j * steps + i) * count + start) * columns + column
                    for patch in range(width):
                        out[at + patch * columns] = made[i * _GROUP + patch]
