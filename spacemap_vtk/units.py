"""Physical units: convert values like ``"0.3 mm"`` to SI and back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

from spacemap_vtk.errors import InputError

_INCH = 0.0254
#: Degrees in a radian.
_DEGREES = 57.29577951308232
#: Standard gravity [m/s²], the ratio of an object's weight to its mass.
GRAVITY = 9.80665
#: Weight of a gram [N].
_GF = 1e-3 * GRAVITY
#: Weight of a pound [N].
_LBF = 0.45359237 * GRAVITY

#: For each SI unit of a parameter: the units that a user may write, and their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "m": {
        **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "km": 1e3},
        **{"in": _INCH, "inch": _INCH, "ft": 12 * _INCH, "yd": 36 * _INCH},
    },
    "Pa": {
        **{"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "TPa": 1e12},
        **{"N/mm2": 1e6, "psi": 6894.757293168361},
    },
    "kg/m": {"kg/m": 1.0, "tex": 1e-6, "dtex": 1e-7, "den": 1e-6 / 9},
    # Yarns per length: handweavers write ends and picks per inch.
    "1/m": {
        **{"1/m": 1.0, "/m": 1.0, "/cm": 100.0, "/in": 1 / _INCH, "/inch": 1 / _INCH},
        **{"epi": 1 / _INCH, "ppi": 1 / _INCH, "dpi": 1 / _INCH, "/10cm": 10.0},
    },
    "kg/m3": {"kg/m3": 1.0, "g/cm3": 1e3},
    "1/K": {"1/K": 1.0, "ppm/K": 1e-6, "um/m/K": 1e-6},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "1/s": {"1/s": 1.0, "Hz": 1.0},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6},
    "m/s2": {"m/s2": 1.0, "mm/s2": 1e-3, "g": GRAVITY},
    "": {"%": 0.01},
    # Stretching and shear stiffness of a fabric, per width. Kawabata gives shear per degree.
    "N/m": {
        "N/m": 1.0,
        "mN/m": 1e-3,
        "kN/m": 1e3,
        "N/mm": 1e3,
        "N/cm": 100.0,
        "cN/cm": 1.0,
        "gf/cm": _GF * 100,
        "gf/cm.deg": _GF * 100 * _DEGREES,
        "lbf/in": _LBF / _INCH,
    },
    # Bending stiffness of a fabric: moment per width and curvature. Kawabata writes both out.
    "N.m": {
        "N.m": 1.0,
        "mN.m": 1e-3,
        "uN.m": 1e-6,
        "µN.m": 1e-6,
        "nN.m": 1e-9,
        "mN.cm": 1e-5,
        "mg.cm": _GF * 1e-5,
        "gf.cm": _GF * 1e-2,
        "gf.cm2/cm": _GF * 1e-2,
    },
    # Bending stiffness of a yarn; below, its stretching stiffness over its count.
    "N.m2": {
        "N.m2": 1.0,
        "uN.m2": 1e-6,
        "µN.m2": 1e-6,
        "N.mm2": 1e-6,
        "mN.mm2": 1e-9,
        "cN.cm2": 1e-6,
        "gf.cm2": _GF * 1e-4,
    },
    "N.m/kg": {"N.m/kg": 1.0, "N/tex": 1e6, "cN/tex": 1e4, "cN/dtex": 1e5, "gf/den": _GF * 9e6},
    "kg/m2": {"kg/m2": 1.0, "g/m2": 1e-3, "gsm": 1e-3, "oz/yd2": 0.028349523125 / 0.9144**2},
    "N": {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "nN": 1e-9, "kN": 1e3},
    "N/m3": {"N/m3": 1.0, "kN/m3": 1e3, "MN/m3": 1e6, "N/cm3": 1e6, "N/mm3": 1e9},
    "kg": {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "oz": 28.349523125e-3, "lb": 0.45359237},
    "deg": {"deg": 1.0, "rad": _DEGREES, "turn": 360.0},
}

#: A power or a product may be written in several ways, and a divisor in brackets.
_SPELLINGS = str.maketrans(
    {
        **{"²": "2", "³": "3", "^": "", "μ": "µ", "·": ".", "⋅": ".", "*": "."},
        **{"(": "", ")": "", "°": "deg"},
    }
)
#: "per degree" at the end of a unit: "/cm/deg", "/(cm.degree)".
_PER_DEGREE = re.compile(r"[./]deg(?:rees?)?$")

# The unit matches any text. A stricter pattern would backtrack for long on a long text that does
# not match.
_QUANTITY = re.compile(
    r"([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?nan|[-+]?inf)\s*(.*)", re.DOTALL
)


def split_quantity(text: str) -> tuple[float, str] | None:
    """Split a text into number and unit, which may be empty; None if it has no number."""
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        return None
    number, name = match.groups()
    name = _PER_DEGREE.sub(".deg", name.translate(_SPELLINGS))
    return float(number), "deg" if name in ("degree", "degrees") else name


def parse_quantity(text: str, unit: str) -> float:
    """Convert a text, a number with an optional unit, to SI."""
    found = split_quantity(text)
    known = UNITS.get(unit, {})
    if found is None:
        raise InputError("must be a number", value=text, allowed=_allowed_text(unit))
    number, name = found
    if name == "":
        return number
    if name not in known:
        raise InputError(f'unknown unit "{name}"', value=text, allowed=_allowed_text(unit))
    # Dividing by an exact 1000 rounds once ("0.3 mm" is 0.0003); 0.3 * 1e-3 would round twice.
    size = known[name]
    parts = round(1 / size)
    if size < 0.01 and abs(parts * size - 1) < 1e-12:
        return number / parts
    return number * size


def _allowed_text(unit: str) -> str:
    units = UNITS.get(unit)
    return "a number" if not units else "a number, or one with a unit: " + ", ".join(units)


def typeset_units(text: str) -> str:
    """Write units as in print: m/s², N·m."""
    return re.sub(
        r"(?<![a-zA-Z])((?:[kmcuµ]?m|s|yd))([23])\b", lambda m: m[1] + "²³"[int(m[2]) - 2], text
    ).replace("N.m", "N·m")


def align_decimals(values: Iterable[float], digits: int = 4) -> list[str]:
    """Format numbers with equally many decimals, so that the smallest has `digits` digits."""
    numbers = list(values)
    least = min((abs(number) for number in numbers if number), default=1.0)
    decimals = min(max(digits - 1 - math.floor(math.log10(least)), 0), 6)
    return [f"{number:.{decimals}f}" for number in numbers]


def format_errors(texts: Sequence[str], errors: Sequence[float | None]) -> list[str]:
    """Add errors to numbers that `align_decimals` has formatted, rounded up to their decimals."""
    decimals = [len(text.partition(".")[2]) for text in texts]
    scaled = [
        None if error is None else f"{math.ceil(error * 10**count - 1e-6) / 10**count:.{count}f}"
        for error, count in zip(errors, decimals, strict=True)
    ]
    width = max((len(error) for error in scaled if error is not None), default=0)
    return [
        text if error is None and not width else f"{text} ± {error or '–':>{width}}"
        for text, error in zip(texts, scaled, strict=True)
    ]


def format_with_error(value: float, error: float | None, unit: str, digits: int = 4) -> str:
    """Format a value in a suitable unit, and its error in the same unit, rounded up."""
    text = format_quantity(value, unit, digits)
    if error is None:
        return text
    name = text.partition(" ")[2]
    size = UNITS[unit][name] if name else 1.0
    return f"{format_uncertain(value / size, error / size, digits)} {name}".rstrip()


def format_uncertain(value: float, error: float, digits: int = 4) -> str:
    """Format a number and its error, rounded up."""
    # The number has no digits below the second digit of the error.
    most = digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    decimals = max(min(1 - math.floor(math.log10(error)) if error else most, most), 0)
    error = math.ceil(error * 10**decimals - 1e-6) / 10**decimals
    return f"{value:.{decimals}f} ± {error:.{decimals}f}"


def format_length(value: float) -> str:
    """Format a length given in m."""
    return format_quantity(value, "m")


def format_quantity(value: float, unit: str, digits: int = 17) -> str:
    """Round a value and format it in the unit that leaves one to three digits before the point."""
    value = float(f"{value:.{digits}g}")
    best, size = _fitting_unit(value, unit)
    return f"{value / size:.6g} {best}".rstrip()


def format_vector(
    values: Iterable[float], unit: str, digits: int = 4, rounding: float = 0.0
) -> str:
    """Format a vector in the unit that suits its largest component; 0 up to the rounding error."""
    numbers = list(values)
    largest = max((abs(value) for value in numbers), default=0.0)
    least = max(rounding, 1e-9 * largest)
    best, size = _fitting_unit(largest if largest > least else 0.0, unit)
    shown = [0.0 if abs(value) <= least else value / size for value in numbers]
    return f"({', '.join(f'{value:.{digits}g}' for value in shown)}) {best}"


def _fitting_unit(value: float, unit: str) -> tuple[str, float]:
    """Return the unit that leaves one to three digits before the point, and its size."""
    scales = {
        "N": ("nN", "µN", "mN", "N", "kN"),
        "m": ("nm", "µm", "mm", "m", "km"),
        "Pa": ("Pa", "kPa", "MPa", "GPa", "TPa"),
        "s": ("ns", "µs", "ms", "s"),
        "kg/m": ("dtex", "tex"),
        "1/m": ("/m", "/cm"),
        "N/m": ("N/m", "kN/m"),
        "N.m": ("nN.m", "µN.m", "mN.m", "N.m"),
        "N.m2": ("mN.mm2", "N.mm2", "N.m2"),
        "N.m/kg": ("cN/tex", "N/tex"),
        "kg/m2": ("g/m2", "kg/m2"),
    }
    best, size = unit, 1.0
    for name in scales.get(unit, ()):
        if abs(value) >= UNITS[unit][name] * (1 if name != "mm" else 0.05):
            best, size = name, UNITS[unit][name]
    return best, size
