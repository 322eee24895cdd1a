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

#: Room for dimensions at the left, right, below and above the cloth, in mm.
_LEFT, _RIGHT, _BELOW, _ABOVE = 13.0, 8.5, 9.0, 7.5
#: Lengths in mm: _STEP, distance between dimension lines; _PAST, length of an extension line beyond
#: its dimension line; _ARROW, length of an arrowhead.
_STEP, _PAST, _ARROW = 4.2, 1.0, 1.9
#: Largest height of the cloth in a drawing, in mm.
_HIGHEST = 46.0
_SUB = "₁₂"
#: Colour of the length along the axis, on light and on dark paper.
_ACCENT = ("#c8372d", "#ff8a7a")
#: Colours of the yarns of warp and weft: (n, 3) for each family, or (1, 3) for all yarns of it.
Colors = Sequence[Bytes] | Bytes
#: _LEAST: least height of a drawing in mm, for its upright texts. _THIN: a cloth lower than this,
#: in mm, has no room for a text in it.
_LEAST, _THIN = 36.0, 12.0


class _Drawing(NamedTuple):
    """Axes in mm, with scale and position of the cloth in them."""

    axes: Axes
    page: PageStyle
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
        return float(min((width - _LEFT - _RIGHT) / length, _HIGHEST / (top - bottom)))

    def draw(axes: Axes, paper: PageStyle) -> None:
        width = axes.get_xlim()[1]
        left = _LEFT + 0.5 * (width - _LEFT - _RIGHT - scale(width) * length)
        more = axes.get_ylim()[1] - _BELOW - _ABOVE - (top - bottom) * scale(width)
        shift = np.array([left, _BELOW + 0.5 * more]) - scale(width) * np.array([begin, bottom])
        sheet = _Drawing(axes, paper, scale(width), shift)
        _draw_yarns(sheet, cut, rgb_table(COLORS)[:, None] if colors is None else colors)
        _draw_dimensions(sheet, cut)

    def height(width: float) -> float:
        return max(_LEAST, _BELOW + _ABOVE + (top - bottom) * scale(width))

    return Tile(draw, height, _caption(cut))


def _caption(cut: CrossSection) -> str:
    own, other, name = _SUB[cut.family], _SUB[1 - cut.family], ("end", "pick")[cut.family]
    words = [f"d{other} = {format_quantity(cut.sizes[0, 1], 'm', 4)}"]
    if cut.bends:
        words.append(f"crimp c{own} = {100 * cut.bends[-1].crimp:.4g} %")
    return f"Section along {name} {cut.yarn + 1}; {', '.join(words)}"


def _draw_yarns(sheet: _Drawing, cut: CrossSection, colors: Colors) -> None:
    from matplotlib.patches import Polygon

    ink = sheet.page.ink
    outlines = [(cut.outline, cut.family, cut.yarn)]
    outlines += [(each, 1 - cut.family, cut.first + k) for k, each in enumerate(cut.sections)]
    for number, (outline, family, yarn) in enumerate(outlines):
        color = colors[family][yarn % len(colors[family])]
        sheet.axes.add_patch(
            Polygon(
                sheet.position(outline),
                facecolor=_tint(color, sheet.page),
                edgecolor=ink,
                linewidth=0.6,
                joinstyle="round",
                gid=f"{FAMILIES[family]}-{number}",
            )
        )
    axis = sheet.position(cut.axis)
    chain: dict[str, Any] = {
        "color": ink,
        "linewidth": 0.4,
        "dashes": (14, 3, 2, 3),
        "solid_capstyle": "butt",
    }
    sheet.axes.plot(*axis.T, gid="axis", **chain)
    for centre in sheet.position(cut.centres):
        for side in np.eye(2) * 1.2:
            sheet.axes.plot(*np.stack([centre - side, centre + side]).T, color=ink, linewidth=0.35)


def _draw_dimensions(sheet: _Drawing, cut: CrossSection) -> None:
    own, other = _SUB[cut.family], _SUB[1 - cut.family]
    (low, high), here = cut.bottom_and_top, sheet.position(cut.centres)
    floor, ceiling = (float(sheet.position(np.array([0.0, z]))[1]) for z in (low, high))
    # The first crossing where the yarns touch, for the dimension D.
    first = int(np.argmax(cut.touching))
    (wide, thick), place, passes = cut.sizes[first], cut.centres[first, 0], cut.passes[first]
    ends = np.array([passes + side * 0.5 * cut.diameter for side in (-1, 1)])
    stack = [*ends, *(cut.centres[first, 1] + side * 0.5 * thick for side in (-1, 1))]
    outline = sheet.position(cut.outline)[:, 0]
    left, right = float(outline.min()), float(outline.max())
    _draw_vertical_dimension(
        sheet, (place, ends[0]), (place, ends[1]), left - _STEP, f"d{own}", cut.diameter
    )
    total = max(stack) - min(stack)
    far = left - 2 * _STEP
    _draw_vertical_dimension(
        sheet, (place, min(stack)), (place, max(stack)), far, "D = d₁ + d₂", total
    )
    # The width of a yarn is shown below the lower one of the first two sections, and the spacing
    # below two neighbours.
    name = "w" if wide > (1 + 1e-9) * thick else "d"
    lower = int(np.argmin(cut.centres[:2, 1]))
    edges = here[lower, 0] + 0.5 * sheet.scale * cut.sizes[lower, 0] * np.array([-1.0, 1.0])
    _draw_horizontal_dimension(
        sheet, edges, here[[lower] * 2, 1], floor - _STEP, f"{name}{other}", cut.sizes[lower, 0]
    )
    if not cut.bends:
        apart = float(np.ptp(cut.centres[-2:, 0]))
        if apart:
            _draw_horizontal_dimension(
                sheet, here[-2:, 0], here[-2:, 1], floor - _STEP, f"p{other}", apart
            )
        return
    bend = cut.bends[-1]
    pair = here[[bend.begin, bend.end]]
    down = floor - _STEP * (1 + 0.9 * (bend.begin <= lower))
    _draw_horizontal_dimension(sheet, pair[:, 0], pair[:, 1], down, f"p{other}", bend.spacing)
    crests = [(cut.centres[k, 0], cut.passes[k]) for k in (bend.begin, bend.end)]
    _draw_vertical_dimension(sheet, crests[0], crests[1], right + _STEP, f"h{own}", bend.height)
    _draw_arc_length(sheet, cut, bend, ceiling, own)
    _draw_angle(sheet, cut, cut.bends[0], own, (floor, ceiling))


def _draw_arc_length(
    sheet: _Drawing, cut: CrossSection, bend: Bend, ceiling: float, own: str
) -> None:
    begin, end = cut.centres[[bend.begin, bend.end], 0]
    inside = (cut.axis[:, 0] >= begin) & (cut.axis[:, 0] <= end)
    line = sheet.position(cut.axis[inside])
    color = _ACCENT[sheet.page.dark]
    sheet.axes.plot(*line.T, color=color, linewidth=1.1, solid_capstyle="butt", gid="length")
    middle = line[len(line) // 2]
    words = f"l{own} = {format_quantity(bend.length, 'm', 4)}"
    right = float(sheet.position(cut.outline)[:, 0].max()) - 0.5 * text_width(words)
    text = np.array([min(middle[0] + 2.5, right), ceiling + 3.2])
    sheet.axes.annotate(
        "",
        (middle[0], middle[1]),
        (text[0], text[1] - 0.3),
        arrowprops={**_arrow_style(color), "arrowstyle": "-|>,head_length=0.4,head_width=0.13"},
    )
    sheet.axes.text(text[0], text[1], words, color=color, fontsize=TEXT, ha="center", va="bottom")


def _draw_angle(
    sheet: _Drawing, cut: CrossSection, bend: Bend, own: str, heights: tuple[float, float]
) -> None:
    from matplotlib.patches import Arc

    begin, end = cut.centres[[bend.begin, bend.end], 0]
    inside = np.flatnonzero((cut.axis[:, 0] >= begin) & (cut.axis[:, 0] <= end))
    steep = np.abs(cut.slope[inside])
    at = int(np.median(inside[steep >= steep.max() - 1e-9]))
    vertex, sign = sheet.position(cut.axis[at]), float(np.sign(cut.slope[at]))
    reach, words = 0.42 * bend.spacing * sheet.scale, f"θ{own} = {np.degrees(bend.angle):.2f}°"
    # The angle opens to the left if there is no room for the text at the right.
    way = 1.0 if vertex[0] + reach + text_width(words) < sheet.axes.get_xlim()[1] - 8.0 else -1.0
    ink, turn = sheet.page.ink, sign * np.degrees(bend.angle)
    turned = np.radians([0.0, 0.5 * turn, turn])
    level, half, tangent = way * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    for ray in (level, tangent):
        ends = np.stack([vertex, vertex + 1.15 * reach * ray])
        sheet.axes.plot(*ends.T, color=ink, linewidth=0.4)
    begun = 0.0 if way > 0 else 180.0
    sides = {"theta1": begun + min(0, turn), "theta2": begun + max(0, turn)}
    arc = Arc(tuple(vertex), 2 * reach, 2 * reach, edgecolor=ink, linewidth=0.5, **sides)
    sheet.axes.add_patch(arc)
    text = vertex + (reach + 1.0) * half
    floor, ceiling = heights
    if ceiling - floor < _THIN:  # the text would hide the yarns
        text[1] = max(text[1], ceiling + 2.4) if half[1] > 0 else min(text[1], floor - 2.4)
    plate = {"facecolor": sheet.page.color, "alpha": 0.7, "linewidth": 0, "pad": 0.8}
    _write(sheet, text, words, ha="left" if way > 0 else "right", va="center", bbox=plate)


def _draw_vertical_dimension(
    sheet: _Drawing,
    first: tuple[float, float],
    second: tuple[float, float],
    line: float,
    name: str,
    value: float,
) -> None:
    """Draw a vertical dimension on a line at the side of the cloth."""
    places = sheet.position(np.array([first, second]))
    way = float(np.sign(line - places[0, 0]))
    for x, y in places:
        _draw_extension_line(sheet, (x + 0.6 * way, y), (line + _PAST * way, y))
    low, high = np.sort(places[:, 1])
    _draw_dimension_line(sheet, np.array([[line, low], [line, high]]))
    words = f"{name} = {format_quantity(value, 'm', 4)}"
    half = 0.5 * text_width(words)
    middle = np.clip(0.5 * (low + high), half, sheet.axes.get_ylim()[1] - half)
    place, side = np.array([line + 0.5 * way, middle]), "right" if way < 0 else "left"
    # The plate interrupts the lines of other dimensions behind the text.
    plate = {"facecolor": sheet.page.color, "linewidth": 0, "pad": 0.3}
    _write(sheet, place, words, ha=side, va="center", rotation=90, bbox=plate, zorder=2.5)


def _draw_horizontal_dimension(
    sheet: _Drawing,
    across: Floats,
    heights: tuple[float, ...] | Floats,
    line: float,
    name: str,
    value: float,
) -> None:
    """Draw a horizontal dimension on a line below the cloth."""
    for x, y in zip(across, heights, strict=True):
        _draw_extension_line(sheet, (x, y - 0.6), (x, line - _PAST))
    _draw_dimension_line(sheet, np.stack([across, [line, line]], axis=1))
    text = np.array([float(np.mean(across)), line + 0.4])
    words = f"{name} = {format_quantity(value, 'm', 4)}"
    if text_width(words) > float(np.ptp(across)) - 2.0:
        # To the right of the vertical texts at the left, which reach down as far.
        text = np.array([max(text[0], _LEFT - _STEP + 1.0 + 0.5 * text_width(words)), line - 0.8])
        _write(sheet, text, words, ha="center", va="top")
    else:
        _write(sheet, text, words, ha="center", va="bottom")


def _draw_extension_line(
    sheet: _Drawing, begin: tuple[float, float], end: tuple[float, float]
) -> None:
    sheet.axes.plot(*zip(begin, end, strict=True), color=sheet.page.faint, linewidth=0.35)


def _draw_dimension_line(sheet: _Drawing, ends: Floats) -> None:
    """Draw a line with an arrow at each end; on short lines, the arrows point from outside."""
    way = ends[1] - ends[0]
    size = float(np.hypot(*way))
    if not size:
        return
    if size > 3 * _ARROW:
        sheet.axes.annotate("", ends[1], ends[0], arrowprops=_arrow_style(sheet.page.ink, "<|-|>"))
        return
    for end, out in zip(ends, (-way, way), strict=True):
        tail = end + 2.4 * _ARROW * out / size
        sheet.axes.annotate("", end, tail, arrowprops=_arrow_style(sheet.page.ink))
    sheet.axes.plot(*ends.T, color=sheet.page.ink, linewidth=0.5)


def _arrow_style(color: str, style: str = "-|>") -> dict[str, Any]:
    return {
        "arrowstyle": f"{style},head_length=0.45,head_width=0.13",
        "mutation_scale": 10,
        "color": color,
        "linewidth": 0.5,
        "shrinkA": 0,
        "shrinkB": 0,
    }


def _write(sheet: _Drawing, place: Floats, words: str, **style: Any) -> None:
    sheet.axes.text(
        float(place[0]), float(place[1]), words, fontsize=TEXT, color=sheet.page.ink, **style
    )


def _tint(color: Bytes, paper: PageStyle) -> str:
    parts = np.stack([color, rgb_table([paper.color])[0]])
    return "#{:02x}{:02x}{:02x}".format(*(parts.T @ [0.38, 0.62]).round().astype(int).tolist())
