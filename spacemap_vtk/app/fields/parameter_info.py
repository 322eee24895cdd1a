"""Information about a section's parameters: feasible intervals, values in use, slider ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.cage_material import CageMaterial
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.parameters import Parameter, Parameterised, Real
from spacemap_vtk.textile.weave.cloth import FAMILIES
from spacemap_vtk.units import UNITS, format_quantity, split_quantity


def feasible_intervals(part: Parameterised) -> dict[str, tuple[float, float]]:
    """Return the feasible interval of each parameter, with all others as they are."""
    with suppress(SpacemapError):
        return dict(getattr(part, "feasible", {}))
    return {}


def automatic_values(part: Parameterised) -> dict[str, Any]:
    """Return the values in use for a weave's automatic parameters; empty for other stages."""
    if not isinstance(part, Woven):
        return {}
    with suppress(SpacemapError):
        values: dict[str, Any] = dict(part.automatic_values)
        for family, threads in zip(FAMILIES, part.cloth.threads, strict=True):
            if (threads.colors == threads.colors[0]).all():
                values[f"{family}_color"] = tuple(threads.colors[0].tolist())
        return values
    return {}


def idle_reason(part: Parameterised, name: str, results: Mapping[str, Any]) -> str:
    """Return why a parameter has no effect (empty if it has one), given the last run's results."""
    reason, kind = part.disabled_by(name), results.get("elements")
    if not reason and kind and isinstance(part, CageMaterial) and part.elements == "auto":
        reason = part.disabled_for(name, kind == "sheet")
    return reason


def format_interval(parameter: Parameter[Any], interval: tuple[float, float] | None) -> str:
    """Format the feasible interval of a parameter; empty if it is unknown."""
    if interval is None:
        return ""
    low, high = (
        "∞" if end == float("inf") else format_quantity(end, parameter.unit, 4) for end in interval
    )
    return f"feasible: {low} to {high}"


def add_shown_unit(typed: str, shown: str, unit: str) -> str:
    """Add the units that a field shows to the numbers typed without a unit."""
    factors = UNITS.get(unit, {})
    units = [each[1] for each in map(split_quantity, shown.split(",")) if each is not None]
    numbers = [part.strip() for part in typed.split(",")]
    if not units or not all(each in factors for each in units):
        return typed
    for index, number in enumerate(numbers):
        quantity = split_quantity(number)
        if quantity is not None and quantity[1] == "":
            numbers[index] = f"{number} {units[min(index, len(units) - 1)]}"
    return ", ".join(numbers)


#: Number of steps of a slider.
STEPS = 1000
#: A slider is logarithmic if the ratio of its ends is larger than this.
_LOGARITHMIC_FROM = 50.0


@dataclass(frozen=True)
class SliderSpan:
    """Range of a slider, with a linear or a logarithmic scale."""

    #: Ends of the range.
    low: float
    high: float

    @property
    def is_logarithmic(self) -> bool:
        """Whether the scale is logarithmic."""
        return self.low > 0.0 and self.high / self.low > _LOGARITHMIC_FROM

    def number_at(self, step: int) -> float:
        """Return the number at a step."""
        share, low, high = step / STEPS, self.low, self.high
        number = low * (high / low) ** share if self.is_logarithmic else low + share * (high - low)
        return min(max(float(f"{number:.4g}"), self.low), self.high)

    def value_at(self, real: Real, step: int) -> Any:
        """Return the number at a step, with its unit, as in a scene file."""
        number = self.number_at(step)
        if real.kind == "integer":
            return round(number)
        return real.format(number) if real.unit else number

    def step_at(self, number: float) -> int:
        """Return the step nearest to a number."""
        number = min(max(number, self.low), self.high)
        if self.high <= self.low:
            return 0
        if self.is_logarithmic:
            share = math.log(number / self.low, self.high / self.low)
        else:
            share = (number - self.low) / (self.high - self.low)
        return round(share * STEPS)


def slider_span(
    parameter: Real, value: Any, feasible: tuple[float, float] | None = None
) -> SliderSpan:
    """Choose the range of a parameter's slider."""
    low, high = parameter.minimum, parameter.maximum
    open_low = parameter.above is not None and low is None
    if feasible is not None and all(map(math.isfinite, feasible)):
        low, high = feasible
        return SliderSpan(low, max(high, low))
    # Exclude ends that are not allowed, by one step of the slider.
    if open_low and parameter.below is not None:
        inset = (parameter.below - (parameter.above or 0.0)) / STEPS
        return SliderSpan((parameter.above or 0.0) + inset, parameter.below - inset)
    if parameter.unit == "deg":
        turns = math.ceil(max(abs(value or 0.0), 1.0) / 360.0) * 360.0
        ends = -math.inf if low is None else low, math.inf if high is None else high
        return SliderSpan(max(-turns, ends[0]), min(turns, ends[1]))
    # The component of a vector has no default.
    size = abs(value or 0.0) or abs(getattr(parameter, "default", None) or 0.0)
    size = size or (1e-2 if parameter.unit == "s" else 1.0)
    if open_low:
        low = size / 8.0
    if low is None:
        low = -4.0 * size
    if high is None or high > 1e3 * max(size, low):
        high = 4.0 * size if parameter.kind != "integer" else max(4.0 * size, low + 10)
        if open_low:
            high = 8.0 * size
    return SliderSpan(float(low), float(max(high, low)))
