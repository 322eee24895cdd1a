"""A scene's figures in order: as text for people, and as numbers with units for tables.

The figures that `spacemap_vtk.scenes.report` returns by name get their label and unit here, so that
printed figures and tables cannot differ.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.textile import Textile
from spacemap_vtk.scenes.report import describe_motion
from spacemap_vtk.textile.weave.cloth import FAMILIES
from spacemap_vtk.units import UNITS, format_quantity, format_vector, format_with_error

#: Text for a figure that is not available; a warning explains why.
UNKNOWN = "–"
#: Number of modes whose frequencies are in tables.
_MODES_IN_TABLES = 3
#: Units of tables. They do not depend on a value's size, so that columns of tables are comparable.
_TABLE_UNITS = {
    "m": "mm",
    "%": "%",
    "kg": "g",
    "kg/m": "tex",
    "kg/m2": "g/m2",
    "1/m": "/cm",
    "N.m": "uN.m",
    "N.m2": "mN.mm2",
    "N.m/kg": "cN/tex",
}
#: Figures that follow from the size of a yarn, which may be an assumption.
_SIZES = ("diameter", "width", "tex")
#: Figures of warp and weft: key, label and unit; None for counts and words.
_OF_YARNS = (
    ("yarns", "yarns", None),
    ("diameter", "diameter d", "m"),
    ("section", "section", None),
    ("width", "width", "m"),
    ("tex", "yarn count in tex", ""),
    ("sett", "sett", "1/m"),
    ("spacing", "spacing p", "m"),
    ("theta_deg", "weave angle θ", "deg"),
    ("length", "yarn length l per crossing", "m"),
    ("crimp", "crimp c", "%"),
    ("mean_crimp", "mean crimp with floats", "%"),
    ("height", "crimp height h", "m"),
    ("cover", "cover factor", "%"),
    ("longest_float", "longest float", None),
    ("mean_float", "mean float", ""),
    ("yarn_length", "total yarn length", "m"),
    ("colors", "colours", None),
)


class Figure(NamedTuple):
    """A figure of a scene."""

    #: As in the result of `report`.
    key: str
    label: str
    #: Text for people.
    text: str
    #: Value for tables, in SI; for "%" a share; None if it is not a number or unknown.
    value: float | None = None
    unit: str = ""
    #: Error that is due to the cage's cells, as `value`; None if it is unknown.
    error: float | None = None

    @property
    def heading(self) -> str:
        """Heading of a table's column, with the unit."""
        return heading_with_unit(self.key.removesuffix("_deg").replace("_", " "), self.unit)

    @property
    def entry(self) -> str:
        """Text in the cell of a table: six digits, or nothing."""
        return "" if self.value is None else format_for_table(self.value, self.unit)


def heading_with_unit(name: str, unit: str) -> str:
    """Return a table's heading for numbers with a unit."""
    unit = _TABLE_UNITS.get(unit, unit)
    return f"{name} [{unit}]" if unit else name


def format_for_table(value: float, unit: str) -> str:
    """Format a number in the unit of tables."""
    if isinstance(value, int):
        return str(value)
    share = UNITS[""]["%"] if unit == "%" else UNITS.get(unit, {}).get(_TABLE_UNITS.get(unit, ""))
    return f"{value / (share or 1.0):.6g}"


def yarn_figures(figures: dict[str, Any]) -> list[tuple[Figure, Figure]]:
    """Return the figures of warp and weft in pairs, from those of `report.fabric`."""
    found = []
    for key, label, unit in _OF_YARNS:
        pair = []
        for family in FAMILIES:
            value = figures[family][key]
            value = len(value) if isinstance(value, list) else value
            number = None if isinstance(value, str) else value
            text = _format_figure(value, unit)
            if key in _SIZES and figures[family]["size"] == "assumed" and value is not None:
                text += " (assumed)"
            pair.append(Figure(f"{family}_{key}", label, text, number, unit or ""))
        found.append((pair[0], pair[1]))
    return found


def cloth_figures(figures: dict[str, Any], both: bool = False) -> list[Figure]:
    """Return the figures of the whole cloth, of its cage and of its motion."""

    def figure(key: str, label: str, unit: str, template: str, factor: float = 1) -> Figure:
        value = figures[key]
        text = UNKNOWN if value is None else template.format(factor * value)
        return Figure(key, label, text, value, unit)

    treadles, thickness = figures["treadles"], figures["thickness"]
    heights = figures["feasible_height"] or [None]
    found = [
        Figure("thickness", "thickness", _format_figure(thickness, "m"), thickness, "m"),
        figure("cover", "cover", "%", "{:.1f} %", 100),
        figure("fibre_volume_fraction", "fibre volume fraction", "%", "{:.1f} %", 100),
        figure("areal_mass", "areal mass", "kg/m2", "{:.4g} g/m²", 1e3),
        Figure("repeat", "smallest repeat", "{} x {}".format(*figures["repeat"])),
        figure("shafts", "shafts, treadles", "", f"{{}}, {treadles}"),
        Figure(
            "feasible_height", "feasible h1", " to ".join(_format_figure(h, "m") for h in heights)
        ),
        _clearance(figures, "least_clearance", "least clearance"),
    ]
    if figures.get("cloths") == 2:
        found.insert(0, Figure("cloths", "number of cloths", "2", 2))
    if "deformed_clearance" in figures:
        found.append(_clearance(figures, "deformed_clearance", "... deformed"))
    found += [
        figure("radial_error", "error of the surface", "", "{:.2g} of the radius"),
        figure("patches", "patches", "", "{}"),
        figure("control_points", "control points", "", "{}"),
        figure("memory_bytes", "memory", "", "{:.3g} MiB", 2**-20)._replace(value=None),
        *sheet_figures(figures, both),
    ]
    if swing := figures.get("motion"):
        found.append(Figure("motion", "motion", describe_motion(swing)))
    return [*found, *reaction_figures(figures), *contact_figures(figures)]


def sheet_figures(figures: dict[str, Any], both: bool = False) -> list[Figure]:
    """Return the figures of a cage's elements; equal ones of warp and weft once unless `both`."""
    found = []
    if "elements" in figures:
        found.append(Figure("elements", "cage elements", figures["elements"]))
    if figures.get("law", "linear") != "linear":
        found.append(Figure("law", "  law in its plane", f"from {figures['law']}"))
    for name, value in (figures.get("sheet") or {}).items():
        if name == "poissons_ratio_in_plane":
            value = tuple(figures["poissons_ratios"])
        parameter = ModalSolver.parameter(name)
        label = "  " + name.replace("_", " ").replace("poissons", "Poisson's")
        values = value if isinstance(value, tuple) else (value,)
        several = len(values) > 1 and (both or len({*map(parameter.format_figure, values)}) > 1)
        for side, each in zip(("warp", "weft"), values if several else values[:1], strict=False):
            key, text = f"sheet_{name}", label
            if several:
                key, text = f"{key}_{side}", f"{label}, {side}"
            found.append(Figure(key, text, parameter.format_figure(each), each, parameter.unit))
        if name == "bending_rigidity":
            found += _bending_bounds(figures)
    for side, value in zip(("warp", "weft"), figures.get("natural_curvature") or (), strict=False):
        where = "the face" if value > 0.0 else "the back"
        text = f"to {where}, radius {_format_figure(abs(1.0 / value), 'm')}" if value else "flat"
        key = f"natural_curvature_{side}"
        found.append(Figure(key, f"  curl along the {side}", text, value, "1/m"))
    found += [
        Figure(f"sheet_note_{k}", "  assumed", note)
        for k, note in enumerate(figures.get("sheet_notes", ()))
    ]
    return found


def _bending_bounds(figures: dict[str, Any]) -> list[Figure]:
    """Return the bending rigidities with free and with rigid arcs of the yarns."""
    found, parameter = [], ModalSolver.parameter("bending_rigidity")
    for arcs, values in figures.get("bending_bounds", {}).items():
        texts = [parameter.format_figure(v) if math.isfinite(v) else "jammed" for v in values]
        alike = texts[0] == texts[1]
        for side, each, text in zip(("warp", "weft")[: 2 - alike], values, texts, strict=False):
            key, label = f"sheet_bending_{arcs}_arcs", f"    with {arcs} arcs"
            if not alike:
                key, label = f"{key}_{side}", f"{label}, {side}"
            found.append(Figure(key, label, text, each, parameter.unit))
    return found


def motion_figures(swing: dict[str, Any] | None) -> list[Figure]:
    """Return the numbers of `report.motion`, which `cloth_figures` puts into one sentence."""
    units = {"largest_rotation_deg": "deg", "largest_stretch": "%", "largest_volume_change": "%"}
    return [Figure(key, key, "", swing[key], unit) for key, unit in units.items()] if swing else []


def mode_figures(figures: dict[str, Any]) -> list[Figure]:
    """Return the numbers of the first modes, from those of `report.modes`, and the cage's mass."""
    found = [Figure("mass", "mass", "", figures["mass"], "kg")]
    for number, mode in enumerate(figures["modes"][:_MODES_IN_TABLES], 1):
        found.append(Figure(f"mode_{number}", "", "", mode["frequency_hz"], "Hz"))
        ratio = mode["damping_ratio"]
        if math.isfinite(ratio):
            found.append(Figure(f"mode_{number}_damping_ratio", "", "", ratio))
    return found


def object_figures(figures: dict[str, Any]) -> list[Figure]:
    """Return the numbers of an object and its cage, from those of `anatomy.body`."""
    counts = [Figure(key, key, "", figures[key]) for key in ("points", "cells", "triangles")]
    cage = figures["cage"] or {}
    units = {"vertices": "", "tetrahedra": "", "volume": "m3", "points_outside": ""}
    return counts + [Figure(f"cage_{k}", k, "", cage[k], u) for k, u in units.items() if k in cage]


def textile_figures(textile: Textile) -> list[Figure]:
    """Return the figures that a source that is not woven declares for its yarns."""
    diameters = textile.yarn_diameters
    low, high = float(diameters.min()), float(diameters.max())
    text = (
        _format_figure(low, "m")
        if low == high
        else f"{_format_figure(low, 'm')} to {_format_figure(high, 'm')}"
    )
    families = ", ".join(f"{count} {name}" for name, count in textile.families.items())
    found = [
        Figure("yarns", "yarns", families, len(diameters)),
        Figure("diameter", "diameter d", text, float(diameters.mean()), "m"),
    ]
    if (masses := textile.linear_densities) is not None:
        mean = float(masses.mean())
        found.append(
            Figure("linear_density", "yarn count", _format_figure(mean, "kg/m"), mean, "kg/m")
        )
    if (extent := textile.extent) is not None:
        found.append(
            Figure("extent", "extent", " x ".join(_format_figure(x, "m") for x in extent.tolist()))
        )
    for key, label, value, unit in textile.figures:
        found.append(Figure(key, label, _format_figure(value, unit), value, unit))
    return found


def equilibrium_figures(hung: dict[str, Any] | None) -> list[Figure]:
    """Return the figures of a hanging cage, from those of `report.modes`."""
    if hung is None:
        return []
    sag, drape = hung["sag"], hung["drape_coefficient"]
    text = format_with_error(sag, hung["sag_error"], "m")
    found = [Figure("sag", "sag", text, sag, "m", hung["sag_error"])]
    if hung["shadow_area"] is not None:
        cloth, error = hung["cloth_area"], hung["shadow_area_error"]
        share, error = hung["shadow_area"] / cloth, None if error is None else error / cloth
        text = f"{_format_share(share, error)} of the cloth"
        found.append(Figure("shadow", "shadow", text, share, "%", error))
    if drape is not None:
        error = hung["drape_coefficient_error"]
        text = f"{_format_share(drape, error)} (Cusick)"
        found.append(Figure("drape_coefficient", "drape coefficient", text, drape, "%", error))
    return found


def _format_share(share: float, error: float | None) -> str:
    shown = f"{100 * share:.1f} %"
    return shown if error is None else f"{shown} ± {100 * error:.1f} %"


def reaction_figures(figures: dict[str, Any]) -> list[Figure]:
    """Return the figures of what holds a cage at rest, from those of `report`."""
    found = []
    for number, each in enumerate(figures.get("reactions", [])):
        size = math.hypot(*each["force"])
        force = format_vector(each["force"], "N")
        # An arm of a nanometre is rounding.
        moment = format_vector(each["moment"], "N.m", rounding=1e-9 * size)
        point = format_vector(each["point"], "m", rounding=1e-9)
        name = f"{each['kind']} {each['name']}".strip()
        error = each.get("force_error")
        if error is not None and error > 1e-9 * size:
            force += f" ± {format_quantity(error, 'N', 2)}"
        if (twist := each.get("moment_error")) is not None and twist > 1e-9 * size:
            moment += f" ± {format_quantity(twist, 'N.m', 2)}"
        text = f"{force}, moment {moment} about {point}"
        found.append(Figure(f"reaction_{number}", f"reaction of {name}", text, size, "N", error))
    return found


def contact_figures(figures: dict[str, Any]) -> list[Figure]:
    """Return the figures of a cage's contact with each obstacle, and of the path to it."""
    found = []
    contact, path = figures.get("contact", []), figures.get("path")
    for each in contact:
        number, force, error = each["obstacle"], each["force"], each.get("force_error")
        text = (
            f"{format_with_error(force, error, 'N')}, {each['points']} points, "
            f"{each['sliding']} of them at the limit of friction, "
            f"up to {format_quantity(each['penetration'], 'm', 2)} deep"
        )
        if not each["points"]:
            text = "none, nothing touches it"
        found.append(
            Figure(f"contact_{number}", f"force on obstacle {number}", text, force, "N", error)
        )
    sticking = sum(each["points"] - each["sliding"] for each in contact)
    if sticking:
        text = f"{sticking} points stick where they first touched; another path may end elsewhere"
        found.append(Figure("contact_path", "friction", text, sticking))
    if path is not None:
        text = f"from {path['start'] or 'the undeformed cage'}"
        bodies = []
        for noun, numbers in (("obstacle", path["moved"]), ("grip", path["moved_grips"])):
            if numbers:
                plural = "s" * (len(numbers) > 1)
                bodies.append(f"{noun}{plural} {', '.join(map(str, numbers))}")
        if bodies:
            text += f", with {' and '.join(bodies)} moved through {path['states']} states"
        found.append(Figure("path", "path", text, path["states"]))
    return found


def _clearance(figures: dict[str, Any], key: str, label: str) -> Figure:
    found, ends = figures[key], figures["ends"]
    if not found:
        return Figure(key, label, UNKNOWN, None, "m")
    # A distance within rounding errors is contact, not overlap.
    touching = 1e-8 * min(figures[family]["diameter"] for family in FAMILIES)
    distance = found["distance"] if abs(found["distance"]) > touching else 0.0
    place = ", ".join(_format_figure(x, "m") for x in found["place"])
    names = [f"end {n + 1}" if n < ends else f"pick {n - ends + 1}" for n in found["yarns"]]
    text = f"{_format_figure(distance, 'm')} ({' and '.join(names)}, at {place})"
    return Figure(key, label, text, distance, "m")


def _format_figure(value: float | None, unit: str | None) -> str:
    if value is None:
        return UNKNOWN
    if unit is None:
        return str(value)
    if unit == "%":
        return f"{100 * value:.2f} %"
    if unit == "deg":
        return f"{value:.4g}°"
    if unit == "kg/m2":
        return f"{1e3 * value:.4g} g/m²"
    return format_quantity(value, unit, 5)
