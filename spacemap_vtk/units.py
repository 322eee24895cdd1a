"""Physical units: values such as ``"0.3 mm"``, turned into SI and back."""

from __future__ import annotations

import re

from spacemap_vtk.errors import InputError

_INCH = 0.0254
_GRAVITY = 9.80665

#: For each SI unit that a parameter may have: the units a user may write, and their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": _INCH, "inch": _INCH},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm2": 1e6, "psi": 6894.757293168361},
    "kg/m": {"kg/m": 1.0, "tex": 1e-6, "dtex": 1e-7, "den": 1e-6 / 9},
    "1/m": {"1/m": 1.0, "/m": 1.0, "/cm": 100.0, "/in": 1 / _INCH, "/inch": 1 / _INCH},
    "kg/m3": {"kg/m3": 1.0, "g/cm3": 1e3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "1/s": {"1/s": 1.0, "Hz": 1.0},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6},
    "m/s2": {"m/s2": 1.0, "mm/s2": 1e-3, "g": _GRAVITY},
    "": {"%": 0.01},
    "N": {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "kN": 1e3},
    "deg": {"deg": 1.0, "rad": 57.29577951308232},
}

_QUANTITY = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?nan|[-+]?inf)\s*(.*?)\s*"
)


def parse_quantity(text: str, unit: str) -> float:
    """Read a number with an optional unit."""
    match = _QUANTITY.fullmatch(text)
    known = UNITS.get(unit, {})
    if match is None:
        raise InputError("not a number", value=text, allowed=_example(unit))
    number, name = match.groups()
    if name == "":
        return float(number)
    name = name.replace("²", "2").replace("³", "3").replace("^", "").replace("μ", "µ")
    if name not in known:
        raise InputError(f'unit "{name}" is not known here', value=text, allowed=_example(unit))
    # Dividing by an exact 1000 rounds once ("0.3 mm" is 0.0003); 0.3 * 1e-3 would round twice.
    size = known[name]
    return float(number) / round(1 / size) if size < 0.01 else float(number) * size


def _example(unit: str) -> str:
    units = UNITS.get(unit)
    return "a number" if not units else "a number, or one with a unit of " + ", ".join(units)


def format_quantity(value: float, unit: str) -> str:
    """Write a value in the unit that gives it one to three digits before the point."""
    scales = {
        "m": ("µm", "mm", "m"),
        "Pa": ("Pa", "kPa", "MPa", "GPa"),
        "s": ("ms", "s"),
        "kg/m": ("dtex", "tex"),
        "1/m": ("/m", "/cm"),
    }
    best, size = unit, 1.0
    for name in scales.get(unit, ()):
        if abs(value) >= UNITS[unit][name] * (1 if name != "mm" else 0.05):
            best, size = name, UNITS[unit][name]
    return f"{value / size:.6g} {best}".rstrip()
