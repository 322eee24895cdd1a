"""A plan as tables for people, and as numbers by name for programs.

The terminal, the window, the page and the table for spreadsheets show the same tables, so that they
cannot differ.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from math import ceil
from typing import Any, NamedTuple

from spacemap_vtk.scenes.plan import ScenePlan
from spacemap_vtk.textile.drafts.drawdown import period
from spacemap_vtk.textile.plan.loom_use import Color
from spacemap_vtk.textile.plan.project import YarnNeed
from spacemap_vtk.textile.weave.families import FAMILIES
from spacemap_vtk.textile.weave.yarn_library import (
    MATERIALS,
    YARNS,
    LibraryYarn,
    Yarn,
    parse_yarn,
)
from spacemap_vtk.units import UNITS

#: Unit, its size in SI, and decimals of each kind of quantity, by units of the plan.
_UNITS: dict[str, dict[str, tuple[str, float, int]]] = {
    "metric": {
        "width": ("cm", 1e-2, 1),
        "length": ("m", 1.0, 2),
        "total": ("m", 1.0, 0),
        "mass": ("g", 1e-3, 0),
        "sett": ("/cm", UNITS["1/m"]["/cm"], 2),
        "picks": ("/cm", UNITS["1/m"]["/cm"], 2),
        "reed": ("/10cm", UNITS["1/m"]["/10cm"], 0),
        "share": ("%", 1e-2, 1),
    },
    "imperial": {
        "width": ("in", UNITS["m"]["in"], 2),
        "length": ("yd", UNITS["m"]["yd"], 2),
        "total": ("yd", UNITS["m"]["yd"], 0),
        "mass": ("oz", UNITS["kg"]["oz"], 1),
        "sett": ("epi", UNITS["1/m"]["epi"], 1),
        "picks": ("ppi", UNITS["1/m"]["ppi"], 1),
        "reed": ("dpi", UNITS["1/m"]["dpi"], 1),
        "share": ("%", 1e-2, 1),
    },
}
#: Difference from the requested size, relative, that is named.
_NOTED = 0.01
#: Most stripes that are listed in the order of colours; the rest is only in JSON.
_MOST_STRIPES = 60
#: Fewest rounds of the same stripes that are listed once.
_LEAST_ROUNDS = 2
#: Number of shafts or steps from which neighbours with equal numbers share a row.
_FOLD_FROM = 10
#: Most steps of the treadling that are listed.
_MOST_STEPS = 100


#: Text for no yarn.
NOTHING = "–"


class Quantity(NamedTuple):
    """A number in a table."""

    #: In SI; a share is a fraction of 1.
    value: float
    #: A key of the tables of units.
    kind: str

    def number(self, units: str) -> str:
        """Format the number alone, in its unit."""
        _, size, decimals = _UNITS[units][self.kind]
        text = f"{self.value / size:.{decimals}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text

    def unit(self, units: str) -> str:
        """Return the unit."""
        return _UNITS[units][self.kind][0]

    def text(self, units: str) -> str:
        """Format the number with its unit."""
        if not self.value and self.kind in ("total", "mass"):
            return NOTHING
        return f"{self.number(units)} {self.unit(units)}"


Cell = str | int | Quantity


class PlanTable(NamedTuple):
    """A table of a plan: pairs of label and value, or rows below headings."""

    title: str
    #: Empty for pairs.
    headings: tuple[str, ...]
    rows: Sequence[tuple[Cell, ...]]

    def texts(self, units: str) -> list[tuple[str, ...]]:
        """Return the rows as texts with units; a colour is #rrggbb."""
        return [tuple(cell_text(cell, units) for cell in row) for row in self.rows]


def cell_text(cell: Cell, units: str) -> str:
    """Format a cell."""
    return cell.text(units) if isinstance(cell, Quantity) else str(cell)


def format_color(color: Color) -> str:
    """Format a colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def plan_tables(plan: ScenePlan) -> list[PlanTable]:
    """Return the tables of a plan in the order of work."""
    tables = [
        _cloth(plan),
        _warp(plan),
        _weft(plan),
        _yarns(plan),
        _heddles(plan),
        _treadling(plan),
    ]
    project = plan.project
    for family, thread in ((0, "ends"), (1, "picks")):
        order = project.orders[family]
        if len(order) > 1:
            tables.append(_order(f"{FAMILIES[family].capitalize()} colours", thread, order))
    if plan.assumed:
        rows: list[tuple[Cell, ...]] = [(text,) for text in plan.assumed]
        tables.append(PlanTable("Assumed", (), rows))
    return tables


def _cloth(plan: ScenePlan) -> PlanTable:
    project, settings = plan.project, plan.settings
    rows: list[tuple[Cell, ...]] = [
        ("pieces", project.request.pieces),
        ("finished width", Quantity(project.finished_width, "width")),
        ("finished length", Quantity(project.finished_length, "width")),
        ("width off the loom", Quantity(project.woven_width, "width")),
        ("woven length of a piece", Quantity(project.woven_length, "width")),
    ]
    for name, found in (("width", project.finished_width), ("length", project.finished_length)):
        wanted = getattr(settings, name)
        if wanted is not None and abs(found / wanted - 1.0) > _NOTED:
            text = "{} instead of {}".format(
                *(Quantity(each, "width").text(settings.units) for each in (found, wanted))
            )
            rows.append((f"whole repeats: {name}", text))
    return PlanTable("Cloth", (), rows)


def _warp(plan: ScenePlan) -> PlanTable:
    project, units = plan.project, plan.settings.units
    request, sleying = project.request, project.request.sleying
    repeats = project.repeats[0].describe(project.ends)
    rows: list[tuple[Cell, ...]] = [
        ("ends", f"{project.ends}" + (f" ({repeats})" if repeats else "")),
        ("floating selvedges", _describe_floating(plan)),
        ("warp length", Quantity(project.warp_length, "length")),
        ("of this loom waste", Quantity(request.waste, "length")),
        ("sett in the reed", Quantity(sleying.sett, "sett")),
        (
            "reed",
            f"{Quantity(sleying.reed, 'reed').text(units)}, {sleying.text} in a dent"
            + _describe_error(plan),
        ),
        ("width in the reed", Quantity(project.reed_width, "width")),
        ("dents", project.dents),
        ("take-up", Quantity(project.take_ups[0], "share")),
        ("shrinkage in length", Quantity(request.warp_shrinkage, "share")),
    ]
    if len(plan.reeds) > 1:
        others = "; ".join(
            f"{Quantity(each.reed, 'reed').text(units)}, {each.text} in a dent "
            f"({_percent(each.error(plan.wanted_sett))})"
            for each in plan.reeds[1:4]
        )
        rows.insert(6, ("other reeds", others))
    if plan.largest_setts is not None:
        rows.append(("closest sett (Ashenhurst)", Quantity(plan.largest_setts[0], "sett")))
    for yarn in dict.fromkeys(plan.yarns[0]):
        if usual := _usual_sett(yarn.published, units):
            rows.append((f"usual setts of {yarn.name}", usual))
    return PlanTable("Warp", (), rows)


def _usual_sett(published: LibraryYarn | None, units: str, unit: bool = True) -> str:
    """Describe the usual setts of a yarn; an empty text if none is known."""
    if published is None or published.plain_sett is None:
        return ""
    setts = [Quantity(published.plain_sett, "sett")]
    if published.highest_sett is not None:
        setts.append(Quantity(published.highest_sett, "sett"))
    text = " to ".join(each.number(units) for each in setts)
    return f"{text} {setts[0].unit(units)}" if unit else text


def _describe_error(plan: ScenePlan) -> str:
    error = plan.project.request.sleying.error(plan.wanted_sett)
    if abs(error) < 5e-4:
        return ""
    wanted = Quantity(plan.wanted_sett, "sett").text(plan.settings.units)
    return f" ({_percent(error)} from {wanted})"


def _percent(error: float) -> str:
    """Format an error with its sign; none is +0.0 %."""
    return f"{round(100 * error, 1) + 0.0:+.1f} %"


def _describe_floating(plan: ScenePlan) -> str:
    project = plan.project
    if project.floating:
        return f"{project.floating} ends more"
    if project.edges.need_floating:
        return "none, although the weft does not bind the outer ends"
    start = project.edges.start
    return f"none, if the first pick comes from the {start}" if start else "none"


def _weft(plan: ScenePlan) -> PlanTable:
    project = plan.project
    request = project.request
    repeats = project.repeats[1].describe(project.picks)
    shuttles = sum(yarn.family == "weft" for yarn in project.yarns)
    changes = _count_changes(plan)
    rows: list[tuple[Cell, ...]] = [
        ("picks of a piece", f"{project.picks}" + (f" ({repeats})" if repeats else "")),
        ("picks in all", project.picks * request.pieces),
        ("sett on the loom", Quantity(request.weft_sett, "picks")),
        ("take-up", Quantity(project.take_ups[1], "share")),
        ("draw-in", Quantity(request.draw_in, "share")),
        ("shrinkage in width", Quantity(request.weft_shrinkage, "share")),
        ("shuttles", shuttles),
    ]
    if shuttles > 1:
        rows.append(("changes of colour", changes))
    if plan.largest_setts is not None:
        rows.append(("closest sett (Ashenhurst)", Quantity(plan.largest_setts[1], "picks")))
    return PlanTable("Weft", (), rows)


def _count_changes(plan: ScenePlan) -> int:
    """Count the changes of the weft's colour in a piece."""
    order, size = plan.project.orders[1], plan.project.repeats[1].size
    rounds, rest = divmod(plan.project.picks, size)
    within = len(order) - 1
    total = rounds * within + max(rounds - 1, 0) * (order[0][0] != order[-1][0])
    if rest and rounds:
        total += order[0][0] != order[-1][0]
    for _, picks in order[:-1]:
        rest -= picks
        if rest <= 0:
            break
        total += 1
    return total


def yarn_label(yarn: Yarn | None, density: float) -> str:
    """Return a yarn's name; for a yarn without a name, its count in tex."""
    return f"{1e6 * density:.4g} tex" if yarn is None else yarn.name


class Purchase(NamedTuple):
    """Yarn of one name and colour, of warp and weft together."""

    yarn: str
    color: Color
    #: Length of the warp and of the weft, in m.
    lengths: tuple[float, float]
    #: Number of ends and of picks.
    threads: tuple[int, int]
    #: Mass without the allowance, in kg.
    mass: float
    #: Mass of a usual package, in kg; None if not known.
    package: float | None


def purchases(plan: ScenePlan) -> list[Purchase]:
    """Add the yarns of warp and weft that are the same."""
    found: dict[tuple[str, Color], list[YarnNeed]] = {}
    named: dict[str, Yarn] = {}
    for need in plan.project.yarns:
        yarns = plan.yarns[FAMILIES.index(need.family)]
        yarn = yarns[need.kind] if yarns else None
        label = yarn_label(yarn, need.density)
        if yarn is not None:
            named[label] = yarn
        found.setdefault((label, need.color), []).append(need)

    def add(needs: list[YarnNeed], family: str, name: str) -> Any:
        return sum(getattr(need, name) for need in needs if need.family == family)

    result = []
    for (label, color), needs in found.items():
        published = named[label].published if label in named else None
        result.append(
            Purchase(
                label,
                color,
                (add(needs, "warp", "length"), add(needs, "weft", "length")),
                (add(needs, "warp", "threads"), add(needs, "weft", "threads")),
                sum(need.mass for need in needs),
                None if published is None else published.package,
            )
        )
    return result


def _yarns(plan: ScenePlan) -> PlanTable:
    more = 1.0 + plan.settings.allowance
    rows: list[tuple[Cell, ...]] = []
    bought = purchases(plan)
    for each in bought:
        rows.append(
            (
                format_color(each.color),
                each.yarn,
                each.threads[0],
                Quantity(each.lengths[0], "total"),
                Quantity(each.lengths[1], "total"),
                Quantity(each.mass, "mass"),
                Quantity(more * each.mass, "mass"),
                _describe_packages(each, more, plan.settings.units),
            )
        )
    warp, weft = (sum(each.lengths[family] for each in bought) for family in (0, 1))
    mass = sum(each.mass for each in bought)
    rows.append(
        (
            "all",
            "",
            sum(each.threads[0] for each in bought),
            Quantity(warp, "total"),
            Quantity(weft, "total"),
            Quantity(mass, "mass"),
            Quantity(more * mass, "mass"),
            "",
        )
    )
    with_more = f"with {100 * plan.settings.allowance:g} %"
    headings = ("colour", "yarn", "ends", "warp", "weft", "mass", with_more, "buy")
    return PlanTable("Yarn", headings, rows)


def _describe_packages(purchase: Purchase, more: float, units: str) -> str:
    if purchase.package is None:
        return ""
    count = ceil(more * purchase.mass / purchase.package - 1e-9)
    return f"{count} x {Quantity(purchase.package, 'mass').text(units)}"


def _heddles(plan: ScenePlan) -> PlanTable:
    available, counts = plan.settings.heddles, plan.project.heddles
    folded = _fold([((shaft,), count) for shaft, count in counts.items()])
    total = sum(counts.values())
    if available is None:
        return PlanTable("Heddles", ("shaft", "heddles"), [*folded, ("all", total)])
    rows: list[tuple[Cell, ...]] = [(*row, available - row[1]) for row in folded]
    rows.append(("all", total, available * len(counts) - total))
    return PlanTable("Heddles", ("shaft", "heddles", "to spare"), rows)


def _fold(counts: Sequence[tuple[tuple[int, ...], int]]) -> list[tuple[str, int]]:
    """Return a row for each shaft or step; of many, one for neighbours with equal counts."""
    groups: list[tuple[tuple[int, ...], tuple[int, ...], int]] = []
    for numbers, count in counts:
        if (
            groups
            and len(counts) > _FOLD_FROM
            and groups[-1][2] == count
            and len(numbers) == len(groups[-1][1]) == 1
            and numbers[0] == groups[-1][1][0] + 1
        ):
            groups[-1] = groups[-1][0], numbers, count
        else:
            groups.append((numbers, numbers, count))
    return [
        (
            "-".join(map(str, first)) or "none"
            if first == last
            else f"{first[0]} to {last[0]}, each",
            count,
        )
        for first, last, count in groups
    ]


def _treadling(plan: ScenePlan) -> PlanTable:
    project = plan.project
    what = "lifted shafts" if project.lifts else "treadles"
    listed, others = project.steps[:_MOST_STEPS], project.steps[_MOST_STEPS:]
    rows: list[tuple[Cell, ...]] = [*_fold([(step.pressed, step.picks) for step in listed])]
    if others:
        rows.append((f"{len(others)} others", sum(step.picks for step in others)))
    rows.append(("all", sum(step.picks for step in project.steps)))
    title = "Lifts" if project.lifts else "Treadling"
    return PlanTable(title, (what, "picks in all"), rows)


def _order(title: str, thread: str, order: Sequence[tuple[Color, int]]) -> PlanTable:
    size = period(order)
    rounds = len(order) // size
    if rounds < _LEAST_ROUNDS:
        size, rounds = len(order), 1
    stripes: list[tuple[Cell, ...]] = [(format_color(color), count) for color, count in order]
    rows = stripes[:size]
    if rounds > 1:
        rows.append((f"these {rounds} times", rounds * sum(count for _, count in order[:size])))
        rows += stripes[rounds * size :]
    if len(rows) > _MOST_STRIPES:
        hidden = len(rows) - _MOST_STRIPES
        rows = [*rows[:_MOST_STRIPES], (f"{hidden} more stripes", "")]
    rows.append(("repeat", sum(count for _, count in order)))
    return PlanTable(title, ("colour", thread), rows)


def plan_as_json(plan: ScenePlan) -> dict[str, Any]:
    """Return the numbers of a plan by name, in SI: metres, kilograms, shares of 1."""
    project, more = plan.project, 1.0 + plan.settings.allowance
    request, sleying = project.request, project.request.sleying
    return {
        "title": plan.title,
        "pieces": request.pieces,
        "finished_width": project.finished_width,
        "finished_length": project.finished_length,
        "woven_width": project.woven_width,
        "woven_length": project.woven_length,
        "warp": {
            "ends": project.ends,
            "floating": project.floating,
            "repeat": project.repeats[0].size,
            "balance": project.repeats[0].extra,
            "length": project.warp_length,
            "waste": request.waste,
            "sample": request.sample,
            "take_up": project.take_ups[0],
            "shrinkage": request.warp_shrinkage,
            "sett": sleying.sett,
            "wanted_sett": plan.wanted_sett,
            "closest_sett": None if plan.largest_setts is None else plan.largest_setts[0],
            "total_length": project.total_length(0),
            "colors": _order_as_json(project.orders[0]),
        },
        "weft": {
            "picks": project.picks,
            "repeat": project.repeats[1].size,
            "balance": project.repeats[1].extra,
            "take_up": project.take_ups[1],
            "draw_in": request.draw_in,
            "shrinkage": request.weft_shrinkage,
            "sett": request.weft_sett,
            "closest_sett": None if plan.largest_setts is None else plan.largest_setts[1],
            "total_length": project.total_length(1),
            "color_changes": _count_changes(plan),
            "colors": _order_as_json(project.orders[1]),
        },
        "reed": {
            "dents_per_metre": sleying.reed,
            "sleying": list(sleying.pattern),
            "error": sleying.error(plan.wanted_sett),
            "width": project.reed_width,
            "dents": project.dents,
        },
        "yarns": [
            {
                "yarn": each.yarn,
                "color": format_color(each.color),
                "ends": each.threads[0],
                "picks": each.threads[1],
                "warp_length": each.lengths[0],
                "weft_length": each.lengths[1],
                "length": sum(each.lengths),
                "mass": each.mass,
                "length_to_buy": more * sum(each.lengths),
                "mass_to_buy": more * each.mass,
                "package": each.package,
            }
            for each in purchases(plan)
        ],
        "heddles": {str(shaft): count for shaft, count in project.heddles.items()},
        "lifts" if project.lifts else "treadling": [
            {"pressed": list(step.pressed), "picks": step.picks} for step in project.steps
        ],
        "assumed": list(plan.assumed),
    }


def _order_as_json(order: Iterable[tuple[Color, int]]) -> list[dict[str, Any]]:
    return [{"color": format_color(color), "threads": count} for color, count in order]


def plan_as_csv(plan: ScenePlan, separator: str = ",") -> str:
    """Return the tables of a plan for spreadsheets; units are in headings or beside the number."""
    units = plan.settings.units
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=separator, lineterminator="\n")
    writer.writerow(["Plan", plan.title])
    for table in plan_tables(plan):
        writer.writerow([])
        writer.writerow([table.title])
        if table.headings:
            writer.writerow(
                f"{heading} [{cell.unit(units)}]" if isinstance(cell, Quantity) else heading
                for heading, cell in zip(table.headings, table.rows[0], strict=True)
            )
        for row in table.rows:
            cells = [c.number(units) if isinstance(c, Quantity) else c for c in row]
            if not table.headings and isinstance(row[-1], Quantity):
                cells.append(row[-1].unit(units))
            writer.writerow(cells)
    return stream.getvalue()


def yarn_tables(units: str) -> list[PlanTable]:
    """Return the library of yarns, its materials and its sources."""
    length = "yd/lb" if units == "imperial" else "m/kg"
    size = UNITS["kg"]["lb"] / UNITS["m"]["yd"] if units == "imperial" else 1.0
    yarns: list[tuple[Cell, ...]] = []
    sources: list[tuple[Cell, ...]] = []
    for name, entry in YARNS.items():
        yarn = parse_yarn(name)
        yarns.append(
            (
                name,
                f"{1e6 * yarn.linear_density:.1f}",
                f"{size / yarn.linear_density:.0f}",
                f"{1e3 / yarn.diameters_per_metre:.2f}",
                _usual_sett(entry, units, unit=False),
                Quantity(entry.package, "mass").text(units),
                f"{yarn.tension:.0f}",
                f"{1e9 * yarn.bending:.3g}",
            )
        )
        sources.append((name, entry.source or "by definition of the count"))
    materials: list[tuple[Cell, ...]] = [
        (name, each.system, f"{each.density:.0f}", f"{each.packing:.2f}")
        for name, each in MATERIALS.items()
    ]
    sources += [
        (name, f"{each.source}; stiffness: {each.fibre.source}") for name, each in MATERIALS.items()
    ]
    sett = Quantity(1.0, "sett").unit(units)
    return [
        PlanTable(
            "Yarns",
            (
                "yarn",
                "tex",
                length,
                "d [mm]",
                f"sett [{sett}]",
                "package",
                "EA [N]",
                "B [mN mm²]",
            ),
            yarns,
        ),
        PlanTable(
            "Materials",
            ("material", "count", "density [kg/m³]", "packing"),
            materials,
        ),
        PlanTable("Sources", (), sources),
    ]
