"""Draw the section of a cloth along a yarn as an engineering drawing, after Peirce's figure 1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spacemap_vtk.draw.actors.surface_actor import FAMILIES as COLORS
from spacemap_vtk.draw.actors.surface_actor import rgb_table
from spacemap_vtk.draw.figure.page import TEXT, PageStyle, Tile, text_width
from spacemap_vtk.ndarrays import Bytes, Floats
from spacemap_vtk.textile.geometry.cross_section import Bend, CrossSection
from spacemap_vtk.textile.weave.cloth import FAMILIES
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Room for dimensions on each side of the cloth, in mm.
_LEFT = 13.0
_RIGHT = 8.5
_BELOW = 9.0
_ABOVE = 7.5
#: Distance between dimension lines, in mm.
_STEP = 4.2
#: Length of an extension line beyond its dimension line, in mm.
_OVERHANG = 1.0
#: Length of an arrowhead, in mm.
_ARROW = 1.9
#: Largest height of the cloth in a drawing, in mm.
_LARGEST_HEIGHT = 46.0
_SUBSCRIPTS = "₁₂"
#: Colour of the length along the axis, on light and on dark paper.
_ACCENT = ("#c8372d", "#ff8a7a")
#: Colours of the yarns of warp and weft: (n, 3) for each family, or (1, 3) for all yarns of it.
Colors = Sequence[Bytes] | Bytes
#: Least height of a drawing in mm, for its vertical texts.
_LEAST_HEIGHT = 36.0
#: A cloth that is drawn lower than this, in mm, has no room for a text in it.
_THIN_CLOTH = 12.0


class _Drawing(NamedTuple):
    """Axes in mm, with scale and position of the cloth in them."""

    axes: Axes
    page_style: PageStyle
    scale: float
    shift: Floats

    def position(self, points: Floats) -> Floats:
        """Return the positions of the cloth's points in the drawing."""
        return points * self.scale + self.shift


def section_tile(cut: CrossSection, colors: Colors | None = None) -> Tile:
    """Return a tile with the drawing of a section; `colors` replaces the default yarn colours."""
    bottom, top = cut.bottom_and_top
    begin, end = float(cut.outline[:, 0].min()), float(cut.outline[:, 0].max())
    length = end - begin

    def scale(width: float) -> float:
        return float(min((width - _LEFT - _RIGHT) / length, _LARGEST_HEIGHT / (top - bottom)))

    def draw(axes: Axes, page_style: PageStyle) -> None:
        width = axes.get_xlim()[1]
        left = _LEFT + 0.5 * (width - _LEFT - _RIGHT - scale(width) * length)
        more = axes.get_ylim()[1] - _BELOW - _ABOVE - (top - bottom) * scale(width)
        shift = np.array([left, _BELOW + 0.5 * more]) - scale(width) * np.array([begin, bottom])
        drawing = _Drawing(axes, page_style, scale(width), shift)
        _draw_yarns(drawing, cut, rgb_table(COLORS)[:, None] if colors is None else colors)
        _draw_dimensions(drawing, cut)

    def height(width: float) -> float:
        return max(_LEAST_HEIGHT, _BELOW + _ABOVE + (top - bottom) * scale(width))

    return Tile(draw, height, _caption(cut))


def _caption(cut: CrossSection) -> str:
    subscript, other_subscript, name = (
        _SUBSCRIPTS[cut.family],
        _SUBSCRIPTS[1 - cut.family],
        ("end", "pick")[cut.family],
    )
    parts = [f"d{other_subscript} = {format_quantity(cut.sizes[0, 1], 'm', 4)}"]
    if cut.bends:
        parts.append(f"crimp c{subscript} = {100 * cut.bends[-1].crimp:.4g} %")
    return f"Section along {name} {cut.yarn + 1}; {', '.join(parts)}"


def _draw_yarns(drawing: _Drawing, cut: CrossSection, colors: Colors) -> None:
    from matplotlib.patches import Polygon

    ink = drawing.page_style.ink
    outlines = [(cut.outline, cut.family, cut.yarn)]
    outlines += [(each, 1 - cut.family, cut.first + k) for k, each in enumerate(cut.sections)]
    for number, (outline, family, yarn) in enumerate(outlines):
        color = colors[family][yarn % len(colors[family])]
        drawing.axes.add_patch(
            Polygon(
                drawing.position(outline),
                facecolor=_tint(color, drawing.page_style),
                edgecolor=ink,
                linewidth=0.6,
                joinstyle="round",
                gid=f"{FAMILIES[family]}-{number}",
            )
        )
    axis = drawing.position(cut.axis)
    chain: dict[str, Any] = {
        "color": ink,
        "linewidth": 0.4,
        "dashes": (14, 3, 2, 3),
        "solid_capstyle": "butt",
    }
    drawing.axes.plot(*axis.T, gid="axis", **chain)
    for centre in drawing.position(cut.centres):
        for side in np.eye(2) * 1.2:
            drawing.axes.plot(
                *np.stack([centre - side, centre + side]).T, color=ink, linewidth=0.35
            )


def _draw_dimensions(drawing: _Drawing, cut: CrossSection) -> None:
    subscript, other_subscript = _SUBSCRIPTS[cut.family], _SUBSCRIPTS[1 - cut.family]
    (low, high), centres = cut.bottom_and_top, drawing.position(cut.centres)
    floor, ceiling = (float(drawing.position(np.array([0.0, z]))[1]) for z in (low, high))
    # The first crossing where the yarns touch, for the dimension D.
    first = int(np.argmax(cut.touching))
    (width, height), position_x, passes = cut.sizes[first], cut.centres[first, 0], cut.passes[first]
    ends = np.array([passes + side * 0.5 * cut.diameter for side in (-1, 1)])
    stack = [*ends, *(cut.centres[first, 1] + side * 0.5 * height for side in (-1, 1))]
    outline = drawing.position(cut.outline)[:, 0]
    left, right = float(outline.min()), float(outline.max())
    _draw_vertical_dimension(
        drawing,
        (position_x, ends[0]),
        (position_x, ends[1]),
        left - _STEP,
        f"d{subscript}",
        cut.diameter,
    )
    total = max(stack) - min(stack)
    outer_line = left - 2 * _STEP
    _draw_vertical_dimension(
        drawing,
        (position_x, min(stack)),
        (position_x, max(stack)),
        outer_line,
        "D = d₁ + d₂",
        total,
    )
    # The width of a yarn is shown below the lower one of the first two sections, and the spacing
    # below two neighbours.
    name = "w" if width > (1 + 1e-9) * height else "d"
    lower = int(np.argmin(cut.centres[:2, 1]))
    edges = centres[lower, 0] + 0.5 * drawing.scale * cut.sizes[lower, 0] * np.array([-1.0, 1.0])
    _draw_horizontal_dimension(
        drawing,
        edges,
        centres[[lower] * 2, 1],
        floor - _STEP,
        f"{name}{other_subscript}",
        cut.sizes[lower, 0],
    )
    if not cut.bends:
        spacing = float(np.ptp(cut.centres[-2:, 0]))
        if spacing:
            _draw_horizontal_dimension(
                drawing,
                centres[-2:, 0],
                centres[-2:, 1],
                floor - _STEP,
                f"p{other_subscript}",
                spacing,
            )
        return
    bend = cut.bends[-1]
    pair = centres[[bend.begin, bend.end]]
    line = floor - _STEP * (1 + 0.9 * (bend.begin <= lower))
    _draw_horizontal_dimension(
        drawing, pair[:, 0], pair[:, 1], line, f"p{other_subscript}", bend.spacing
    )
    crests = [(cut.centres[k, 0], cut.passes[k]) for k in (bend.begin, bend.end)]
    _draw_vertical_dimension(
        drawing, crests[0], crests[1], right + _STEP, f"h{subscript}", bend.height
    )
    _draw_arc_length(drawing, cut, bend, ceiling, subscript)
    _draw_angle(drawing, cut, cut.bends[0], subscript, (floor, ceiling))


def _draw_arc_length(
    drawing: _Drawing, cut: CrossSection, bend: Bend, ceiling: float, subscript: str
) -> None:
    begin, end = cut.centres[[bend.begin, bend.end], 0]
    inside = (cut.axis[:, 0] >= begin) & (cut.axis[:, 0] <= end)
    line = drawing.position(cut.axis[inside])
    color = _ACCENT[drawing.page_style.dark]
    drawing.axes.plot(*line.T, color=color, linewidth=1.1, solid_capstyle="butt", gid="length")
    middle = line[len(line) // 2]
    label = f"l{subscript} = {format_quantity(bend.length, 'm', 4)}"
    right = float(drawing.position(cut.outline)[:, 0].max()) - 0.5 * text_width(label)
    text = np.array([min(middle[0] + 2.5, right), ceiling + 3.2])
    drawing.axes.annotate(
        "",
        (middle[0], middle[1]),
        (text[0], text[1] - 0.3),
        arrowprops={**_arrow_style(color), "arrowstyle": "-|>,head_length=0.4,head_width=0.13"},
    )
    drawing.axes.text(text[0], text[1], label, color=color, fontsize=TEXT, ha="center", va="bottom")


def _draw_angle(
    drawing: _Drawing, cut: CrossSection, bend: Bend, subscript: str, heights: tuple[float, float]
) -> None:
    from matplotlib.patches import Arc

    begin, end = cut.centres[[bend.begin, bend.end], 0]
    inside = np.flatnonzero((cut.axis[:, 0] >= begin) & (cut.axis[:, 0] <= end))
    steep = np.abs(cut.slope[inside])
    steepest = int(np.median(inside[steep >= steep.max() - 1e-9]))
    vertex, sign = drawing.position(cut.axis[steepest]), float(np.sign(cut.slope[steepest]))
    radius, label = (
        0.42 * bend.spacing * drawing.scale,
        f"θ{subscript} = {np.degrees(bend.angle):.2f}°",
    )
    # The angle opens to the left if there is no room for the text at the right.
    side = (
        1.0 if vertex[0] + radius + text_width(label) < drawing.axes.get_xlim()[1] - 8.0 else -1.0
    )
    ink, angle = drawing.page_style.ink, sign * np.degrees(bend.angle)
    angles = np.radians([0.0, 0.5 * angle, angle])
    level, half, tangent = side * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for ray in (level, tangent):
        ends = np.stack([vertex, vertex + 1.15 * radius * ray])
        drawing.axes.plot(*ends.T, color=ink, linewidth=0.4)
    start_angle = 0.0 if side > 0 else 180.0
    sides = {"theta1": start_angle + min(0, angle), "theta2": start_angle + max(0, angle)}
    arc = Arc(tuple(vertex), 2 * radius, 2 * radius, edgecolor=ink, linewidth=0.5, **sides)
    drawing.axes.add_patch(arc)
    text = vertex + (radius + 1.0) * half
    floor, ceiling = heights
    if ceiling - floor < _THIN_CLOTH:  # the text would hide the yarns
        text[1] = max(text[1], ceiling + 2.4) if half[1] > 0 else min(text[1], floor - 2.4)
    plate = {"facecolor": drawing.page_style.color, "alpha": 0.7, "linewidth": 0, "pad": 0.8}
    _write(drawing, text, label, ha="left" if side > 0 else "right", va="center", bbox=plate)


def _draw_vertical_dimension(
    drawing: _Drawing,
    first: tuple[float, float],
    second: tuple[float, float],
    line: float,
    name: str,
    value: float,
) -> None:
    """Draw a vertical dimension on a line at the side of the cloth."""
    places = drawing.position(np.array([first, second]))
    direction = float(np.sign(line - places[0, 0]))
    for x, y in places:
        _draw_extension_line(drawing, (x + 0.6 * direction, y), (line + _OVERHANG * direction, y))
    low, high = np.sort(places[:, 1])
    _draw_dimension_line(drawing, np.array([[line, low], [line, high]]))
    label = f"{name} = {format_quantity(value, 'm', 4)}"
    half = 0.5 * text_width(label)
    middle = np.clip(0.5 * (low + high), half, drawing.axes.get_ylim()[1] - half)
    place, side = np.array([line + 0.5 * direction, middle]), "right" if direction < 0 else "left"
    # The plate interrupts the lines of other dimensions behind the text.
    plate = {"facecolor": drawing.page_style.color, "linewidth": 0, "pad": 0.3}
    _write(drawing, place, label, ha=side, va="center", rotation=90, bbox=plate, zorder=2.5)


def _draw_horizontal_dimension(
    drawing: _Drawing,
    across: Floats,
    heights: tuple[float, ...] | Floats,
    line: float,
    name: str,
    value: float,
) -> None:
    """Draw a horizontal dimension on a line below the cloth."""
    for x, y in zip(across, heights, strict=True):
        _draw_extension_line(drawing, (x, y - 0.6), (x, line - _OVERHANG))
    _draw_dimension_line(drawing, np.stack([across, [line, line]], axis=1))
    text = np.array([float(np.mean(across)), line + 0.4])
    label = f"{name} = {format_quantity(value, 'm', 4)}"
    if text_width(label) > float(np.ptp(across)) - 2.0:
        # To the right of the vertical texts at the left, which reach down as far.
        text = np.array([max(text[0], _LEFT - _STEP + 1.0 + 0.5 * text_width(label)), line - 0.8])
        _write(drawing, text, label, ha="center", va="top")
    else:
        _write(drawing, text, label, ha="center", va="bottom")


def _draw_extension_line(
    drawing: _Drawing, begin: tuple[float, float], end: tuple[float, float]
) -> None:
    drawing.axes.plot(*zip(begin, end, strict=True), color=drawing.page_style.faint, linewidth=0.35)


def _draw_dimension_line(drawing: _Drawing, ends: Floats) -> None:
    """Draw a line with an arrow at each end; on short lines, the arrows point from outside."""
    vector = ends[1] - ends[0]
    size = float(np.hypot(*vector))
    if not size:
        return
    if size > 3 * _ARROW:
        drawing.axes.annotate(
            "", ends[1], ends[0], arrowprops=_arrow_style(drawing.page_style.ink, "<|-|>")
        )
        return
    for end, direction in zip(ends, (-vector, vector), strict=True):
        tail = end + 2.4 * _ARROW * direction / size
        drawing.axes.annotate("", end, tail, arrowprops=_arrow_style(drawing.page_style.ink))
    drawing.axes.plot(*ends.T, color=drawing.page_style.ink, linewidth=0.5)


def _arrow_style(color: str, style: str = "-|>") -> dict[str, Any]:
    return {
        "arrowstyle": f"{style},head_length=0.45,head_width=0.13",
        "mutation_scale": 10,
        "color": color,
        "linewidth": 0.5,
        "shrinkA": 0,
        "shrinkB": 0,
    }


def _write(drawing: _Drawing, place: Floats, text: str, **style: Any) -> None:
    drawing.axes.text(
        float(place[0]), float(place[1]), text, fontsize=TEXT, color=drawing.page_style.ink, **style
    )


def _tint(color: Bytes, page_style: PageStyle) -> str:
    parts = np.stack([color, rgb_table([page_style.color])[0]])
    return "#{:02x}{:02x}{:02x}".format(*(parts.T @ [0.38, 0.62]).round().astype(int).tolist())
