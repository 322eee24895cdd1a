"""Rasterise triangles on the processor, in compiled loops.

`fill` finds the visible triangle of each pixel, and `shade` computes its colour there. The light
follows the shaders in `spacemap_vtk.draw.actors.lighting` formula by formula. A change there needs
the same change here; `tests/test_software.py` compares the two.

This module needs Numba; see `spacemap_vtk.parallel`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.draw.actors.lighting import BOUNCE, SOFT, WHITEST
from spacemap_vtk.ndarrays import Floats, Singles
from spacemap_vtk.parallel import compile_function

# Lighting of a triangle: none, VTK's lights, or the light of a style.
UNLIT = 0
PLAIN = 1
STYLED = 2
# Triangles that are culled: none (ALL are drawn), back faces, or front faces.
ALL = 0
BACK = 1
FRONT = 2


# In this module, `triples` and `numbers` are the tables from
# `spacemap_vtk.draw.actors.lighting.lighting_tables`.


@compile_function
def fill(
    screen: Floats,
    corners: NDArray[Any],
    cut: Floats,
    cull: int,
    top: int,
    bottom: int,
    depth: Singles,
    which: NDArray[Any],
) -> None:
    """Write index and depth of the nearest triangle in each pixel, for rows `top` to `bottom`."""
    # `screen` contains x, y, depth and the reciprocal distance of each vertex; the last is 0 for a
    # vertex behind the camera. `cut` has one number for each vertex: where the number interpolated
    # between the vertices is negative, nothing is drawn.
    width = depth.shape[1]
    for number in range(len(corners)):
        a, b, c = corners[number, 0], corners[number, 1], corners[number, 2]
        if screen[a, 3] <= 0.0 or screen[b, 3] <= 0.0 or screen[c, 3] <= 0.0:
            continue
        ax, ay, bx, by = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1]
        cx, cy = screen[c, 0], screen[c, 1]
        first = max(top, math.ceil(min(ay, by, cy) - 0.5))
        last = min(bottom - 1, math.floor(max(ay, by, cy) - 0.5))
        left = max(0, math.ceil(min(ax, bx, cx) - 0.5))
        right = min(width - 1, math.floor(max(ax, bx, cx) - 0.5))
        if first > last or left > right:
            continue
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        # Rows count downwards, so an anticlockwise triangle has a negative area.
        if area == 0.0 or (cull == 1 and area > 0.0) or (cull == 2 and area < 0.0):
            continue
        scale = 1.0 / area
        az, bz, cz = screen[a, 2], screen[b, 2], screen[c, 2]
        for row in range(first, last + 1):
            y = row + 0.5
            for column in range(left, right + 1):
                x = column + 0.5
                wb = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) * scale
                wc = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) * scale
                wa = 1.0 - wb - wc
                if wa < 0.0 or wb < 0.0 or wc < 0.0:
                    continue
                z = wa * az + wb * bz + wc * cz
                if not (0.0 <= z < depth[row - top, column]):
                    continue
                if len(cut):
                    side = wa * cut[a] * screen[a, 3] + wb * cut[b] * screen[b, 3]
                    if side + wc * cut[c] * screen[c, 3] < 0.0:
                        continue
                depth[row - top, column] = z
                which[row - top, column] = number


@compile_function
def _weights(screen: Floats, a: int, b: int, c: int, x: float, y: float) -> Any:
    """Return perspective-correct weights of a triangle's corners at a place of the picture."""
    ax, ay = screen[a, 0], screen[a, 1]
    abx, aby, acx, acy = screen[b, 0] - ax, screen[b, 1] - ay, screen[c, 0] - ax, screen[c, 1] - ay
    scale = 1.0 / (abx * acy - aby * acx)
    wb = ((x - ax) * acy - (y - ay) * acx) * scale
    wc = (abx * (y - ay) - aby * (x - ax)) * scale
    pa, pb, pc = (1.0 - wb - wc) * screen[a, 3], wb * screen[b, 3], wc * screen[c, 3]
    total = 1.0 / (pa + pb + pc)
    return pa * total, pb * total, pc * total


@compile_function
def _interpolate(table: Any, a: int, b: int, c: int, w: Any) -> Any:
    """Return three numbers interpolated between a triangle's corners."""
    return (
        w[0] * table[a, 0] + w[1] * table[b, 0] + w[2] * table[c, 0],
        w[0] * table[a, 1] + w[1] * table[b, 1] + w[2] * table[c, 1],
        w[0] * table[a, 2] + w[1] * table[b, 2] + w[2] * table[c, 2],
    )


@compile_function
def _dot(a: Any, b: Any) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compile_function
def _unit(a: Any) -> Any:
    length = math.sqrt(_dot(a, a))
    scale = 1.0 / length if length > 0.0 else 0.0
    return a[0] * scale, a[1] * scale, a[2] * scale


@compile_function
def _cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compile_function
def _subtract(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compile_function
def _view_direction(place: Any, parallel: bool) -> Any:
    if parallel:
        return 0.0, 0.0, 1.0
    return _unit((-place[0], -place[1], -place[2]))


@compile_function
def _smoothstep(low: float, high: float, x: float) -> float:
    """Compute GLSL's smoothstep."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@compile_function
def _tone(strand: float) -> float:
    mixed = strand * 0.7548777 + strand * strand * 0.2360680
    return mixed - math.floor(mixed)


@compile_function
def reflected_light(triples: Floats, numbers: Floats, n: Any, eye: Any) -> Any:
    """Return the light that a surface reflects: red, green, blue for its colour, and white."""
    wrap, gloss, power, sheen, facing = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    up = 0.5 + 0.5 * n[1]
    red = triples[7, 0] + (triples[6, 0] - triples[7, 0]) * up
    green = triples[7, 1] + (triples[6, 1] - triples[7, 1]) * up
    blue = triples[7, 2] + (triples[6, 2] - triples[7, 2]) * up
    for lamp in range(3):
        received = max(_dot(n, triples[lamp]) + wrap, 0.0)
        red += received * triples[3 + lamp, 0]
        green += received * triples[3 + lamp, 1]
        blue += received * triples[3 + lamp, 2]
    front = max(_dot(n, eye), 0.0)
    aside, away = 1.0 - front, max(1.0 - front / 0.75, 0.0)
    facing_factor = 1.0 - facing * away * away
    red, green, blue = red * facing_factor, green * facing_factor, blue * facing_factor
    knee = numbers[9]
    room, most = WHITEST - knee, math.sqrt(max(red, green, blue))
    if room > 0.0 and most > knee:
        scale = ((knee + room * math.tanh((most - knee) / room)) / most) ** 2
        red, green, blue = red * scale, green * scale, blue * scale
    white = gloss * max(_dot(n, triples[8]), 0.0) ** power if gloss > 0.0 else 0.0
    rim = sheen * aside * aside * aside
    white += rim * green
    colored = 1.0 - gloss - rim
    return red * colored, green * colored, blue * colored, white


@compile_function
def _shaded_light(light: Any, open_: float, hue: Any) -> Any:
    """Return the light on a surface of which a share of the surroundings is open."""
    return (
        light[0] * open_ / (1.0 - BOUNCE * hue[0] * hue[0] * (1.0 - open_)),
        light[1] * open_ / (1.0 - BOUNCE * hue[1] * hue[1] * (1.0 - open_)),
        light[2] * open_ / (1.0 - BOUNCE * hue[2] * hue[2] * (1.0 - open_)),
        light[3] * open_,
    )


@compile_function
def visible_color(
    triples: Floats, numbers: Floats, hue: Any, light: Any, line: float, out: Any
) -> None:
    """Write the visible colour of a hue under a light; `line` is the coverage by an outline."""
    colored = numbers[5]
    grey = 0.299 * hue[0] + 0.587 * hue[1] + 0.114 * hue[2]
    for k in range(3):
        tint = triples[9, k] + (triples[10, k] - triples[9, k]) * grey
        base = tint + (hue[k] - tint) * colored
        shown = math.sqrt(max(base * base * light[k] + light[3] * (1.0 + 0.4 * (base - 1.0)), 0.0))
        out[k] = shown + (triples[11, k] - shown) * line


@compile_function
def _tilt_by_fibres(normal: Any, strands: Any, across: Any, down: Any, here: Any) -> Any:
    """Return the normal tilted by fibres and plies, and their brightness."""
    # `across` and `down` are place and strands of the points to the right of the pixel and above.
    slope_x, slope_y = _subtract(across[0], here), _subtract(down[0], here)
    right, up = _cross(slope_y, normal), _cross(normal, slope_x)
    if _dot(slope_x, right) < 0.0:
        right, up = (-right[0], -right[1], -right[2]), (-up[0], -up[1], -up[2])
    light, tilt = 1.0, 0.0
    dx, dy = across[1][0] - strands[0], down[1][0] - strands[0]
    width = abs(dx) + abs(dy)
    along = 0.366 * strands[2]
    along = along - math.floor(along) - 0.5
    wander = strands[0] + 0.11 * along * (1.0 - 2.0 * abs(along))
    for size in range(3):
        count = 13.0 if size == 0 else 47.0 if size == 1 else 149.0
        shown = min(max(2.0 - 4.0 * count * width, 0.0), 1.0)
        if shown > 0.0:
            place = count * wander
            first = math.floor(place)
            side = 2.0 * (place - first) - 1.0
            tone = _tone(first - count * math.floor(first / count))
            square = side * side
            phase = 97.0 * tone * tone + (0.17 + 0.3 * tone) * strands[2]
            strength = shown * abs(2.0 * (phase - math.floor(phase)) - 1.0)
            tilt += (0.5 if size == 0 else 0.85) * strength * side * (1.0 - square)
            light *= 1.0 + strength * (0.12 * tone - 0.03 - 0.10 * square * square)
    bent = _tilt(normal, tilt, dx, dy, right, up)
    dx, dy = across[1][1] - strands[1], down[1][1] - strands[1]
    width = abs(dx) + abs(dy)
    if width > 0.0:
        shown = min(max(2.0 - 4.0 * width, 0.0), 1.0)
        x = strands[1] + 0.5
        x = x - math.floor(x) - 0.5
        bent = _tilt(bent, shown * 2.4 * x, dx, dy, right, up)
        light *= 1.0 - shown * 6.0 * x * x * x * x
    return _unit(bent), light


@compile_function
def _tilt(normal: Any, amount: float, dx: float, dy: float, right: Any, up: Any) -> Any:
    """Return a normal tilted in the direction in which a phase with the given slopes grows."""
    x, y = dx * right[0] + dy * up[0], dx * right[1] + dy * up[1]
    z = dx * right[2] + dy * up[2]
    scale = amount / math.sqrt(max(x * x + y * y + z * z, 1e-30))
    return normal[0] + scale * x, normal[1] + scale * y, normal[2] + scale * z


@compile_function
def shade(
    which: NDArray[Any],
    screen: Floats,
    corners: NDArray[Any],
    places: Floats,
    normals: Floats,
    strands: Singles,
    looks: Singles,
    colors: Singles,
    cells: NDArray[Any],
    mode: int,
    triples: Floats,
    numbers: Floats,
    parallel: bool,
    grain: float,
    top: int,
    out: Singles,
) -> None:
    """Write the colour of each covered pixel, in rows from `top` on."""
    # Colours belong to vertices. If `cells` is not empty, it contains the index of each triangle's
    # colour instead. Empty `normals` mean flat facets, empty `strands` smooth yarns, empty `looks`
    # full exposure. Where a shader
    # uses differences between neighbouring pixels, this function uses differences over `grain`
    # pixels.
    pixel = np.zeros(3)
    for row in range(len(which)):
        for column in range(which.shape[1]):
            number = which[row, column]
            if number < 0:
                continue
            a, b, c = corners[number, 0], corners[number, 1], corners[number, 2]
            x, y = column + 0.5, top + row + 0.5
            w = _weights(screen, a, b, c, x, y)
            if len(cells):
                cell = cells[number]
                hue = float(colors[cell, 0]), float(colors[cell, 1]), float(colors[cell, 2])
            else:
                hue = _interpolate(colors, a, b, c, w)
            if mode == UNLIT:
                out[row, column, 0], out[row, column, 1], out[row, column, 2] = hue
                continue
            place = _interpolate(places, a, b, c, w)
            eye = _view_direction(place, parallel)
            is_back = False
            if len(normals):
                ax, ay = screen[a, 0], screen[a, 1]
                area = (screen[b, 0] - ax) * (screen[c, 1] - ay)
                area -= (screen[b, 1] - ay) * (screen[c, 0] - ax)
                is_back = area > 0.0
                n = _unit(_interpolate(normals, a, b, c, w))
                if is_back:
                    n = -n[0], -n[1], -n[2]
            else:
                pa, pb, pc = places[a], places[b], places[c]
                n = _unit(_cross(_subtract(pb, pa), _subtract(pc, pa)))
                if _dot(n, eye) < 0.0:
                    n = -n[0], -n[1], -n[2]
            if mode == PLAIN:
                for k in range(3):
                    total = numbers[0]
                    for lamp in range(3):
                        total += max(_dot(n, triples[lamp]), 0.0) * triples[3 + lamp, k]
                    out[row, column, k] = min(hue[k] * total, 1.0)
                continue
            line, width = 0.0, numbers[6]
            if len(strands) or width > 0.0:
                wx = _weights(screen, a, b, c, x + grain, y)
                wy = _weights(screen, a, b, c, x, y - grain)
                if len(strands):
                    strand = _interpolate(strands, a, b, c, w)
                    across = _interpolate(places, a, b, c, wx), _interpolate(strands, a, b, c, wx)
                    down = _interpolate(places, a, b, c, wy), _interpolate(strands, a, b, c, wy)
                    n, bright = _tilt_by_fibres(n, strand, across, down, place)
                    hue = hue[0] * bright, hue[1] * bright, hue[2] * bright
                if width > 0.0 and len(normals):
                    sign = -1.0 if is_back else 1.0
                    front = _dot(n, eye)
                    nx, ny = (
                        _unit(_interpolate(normals, a, b, c, wx)),
                        _unit(_interpolate(normals, a, b, c, wy)),
                    )
                    ex = _view_direction(_interpolate(places, a, b, c, wx), parallel)
                    ey = _view_direction(_interpolate(places, a, b, c, wy), parallel)
                    slope = math.hypot(sign * _dot(nx, ex) - front, sign * _dot(ny, ey) - front)
                    edge = 0.5 * front / max(slope, 1e-6)
                    line = 1.0 - _smoothstep(width - 0.7, width + 0.7, edge)
                    line *= 1.0 - _smoothstep(numbers[7], 1.1 * numbers[7], front)
            light = reflected_light(triples, numbers, n, eye)
            if len(looks):
                exposed = w[0] * looks[a, 0] + w[1] * looks[b, 0] + w[2] * looks[c, 0]
                bright = w[0] * looks[a, 1] + w[1] * looks[b, 1] + w[2] * looks[c, 1]
                hue = hue[0] * bright, hue[1] * bright, hue[2] * bright
                hidden = min(max(1.0 - exposed, 0.0), 1.0)
                hidden = hidden * hidden * (1.0 + SOFT) / (hidden + SOFT)
                light = _shaded_light(light, (1.0 - numbers[8] * hidden) ** 2, hue)
            visible_color(triples, numbers, hue, light, line, pixel)
            for k in range(3):
                out[row, column, k] = min(max(pixel[k], 0.0), 1.0)
