"""Rows of the page for a scene's parameters, made from their declarations."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from spacemap_vtk.app.fields.parameter_info import (
    SliderSpan,
    add_shown_unit,
    automatic_values,
    feasible_intervals,
    format_interval,
    idle_reason,
    slider_span,
)
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.weave_parameters import pattern_repeat
from spacemap_vtk.parameters import Parameter, Parameterised, Real, Series
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import parse_value
from spacemap_vtk.scenes.pipeline import stage_title
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.drafts import drawdown

#: Editor for each kind of parameter. For security, kinds that name files are excluded: the page
#: gives access to this scene and to no other file of the machine.
_EDITORS = {
    "real": "number",
    "integer": "number",
    "series": "number",
    "flag": "flag",
    "choice": "choice",
    "color": "color",
    "vector": "text",
    "pattern": "pattern",
    "supports": "text",
}
#: Parameters that have other controls in the page or only concern output files.
_EXCLUDED = (
    *("view.color", "view.size", "view.time", "view.zoom", "view.shadows"),
    *("view.aperture", "view.focus", "animation.frames_per_second", "animation.orbit"),
)
#: Most ends and picks of a repeat whose squares the page shows.
_MOST_SQUARES = 24
#: Number of a section's rows that are shown at first, besides those written in the scene file.
_SHOWN_AT_FIRST = 3


class ParameterRows:
    """The rows of all parameters, with their refused values."""

    def __init__(self) -> None:
        self._spans: dict[str, SliderSpan] = {}
        #: Refused values by key: the typed text, which stays in the row, and the reason.
        self._refused: dict[str, tuple[str | None, str]] = {}
        #: Results of the last run about parameters, by section and name.
        self.found: dict[str, Mapping[str, Any]] = {}
        #: Cache by section: settings and their feasible intervals. Computing these takes as long as
        #: a frame.
        self._feasible: dict[str, tuple[dict[str, Any], dict[str, tuple[float, float]]]] = {}
        self._parameters: dict[str, tuple[Parameterised, Parameter[Any]]] = {}
        #: Present values as text with units; for automatic ones, the value in use.
        self._shown: dict[str, str] = {}

    def make_sections(
        self, scene: Scene, values: Mapping[str, Any], dragging: bool = False
    ) -> list[dict[str, Any]]:
        """Make the sections of the page with their rows; keep feasible intervals during a drag."""
        self._parameters.clear()
        sections = []
        for section, part in scene.parts.items():
            used = part in scene.stages if isinstance(part, Stage) else True
            if not used or (part is scene.animation and not scene.moves):
                continue
            settings, cached = part.settings, self._feasible.get(section)
            if cached is None or (cached[0] != settings and not dragging):
                self._feasible[section] = settings, feasible_intervals(part)
            rows = self._rows(section, part, values.get(section, ()))
            if rows:
                about = (type(part).__doc__ or "").strip().splitlines()[0]
                name = stage_title(type(part).__name__)
                sections.append({"name": section, "label": name, "about": about, "rows": rows})
        return sections

    def parse_text(self, key: str, text: str) -> Any:
        """Convert the text of a row to a value for a scene file; None for the default."""
        parameter = self._parameters[key][1]
        if text.strip() == "" and parameter.optional:
            return None
        if isinstance(parameter, Real | Series):
            text = add_shown_unit(text, self._shown[key], parameter.unit)
        return parse_value(text)

    def value_at_step(self, key: str, step: int) -> Any:
        """Convert a step of a row's slider to a value for a scene file."""
        return self._spans[key].value_at(_number_parameter(self._parameters[key][1]), step)

    def __contains__(self, key: object) -> bool:
        """Return whether a row with this key exists."""
        return key in self._parameters

    def mark_refused(self, error: SpacemapError, key: str = "", text: str | None = None) -> bool:
        """Show in a row why its value was refused; return whether the row exists."""
        key = key or f"{error.section}.{error.key}"
        allowed = f"; allowed: {error.allowed}" if error.allowed else ""
        reason = f"{error.message}{allowed}." + (
            f" {error.window_cure}" if error.window_cure else ""
        )
        self._refused[key] = text, reason
        return key in self._parameters

    def clear_refused(self, key: str = "") -> None:
        """Forget the refused value of a row, or without a key the values that a run refused."""
        kept = {k: v for k, v in self._refused.items() if k != key and (key or v[0] is not None)}
        self._refused = kept

    def clear_all(self) -> None:
        """Forget all refused values."""
        self._refused.clear()

    def _rows(
        self, section: str, part: Parameterised, written_names: Collection[str]
    ) -> list[dict[str, Any]]:
        results = self.found.get(section, {})
        feasible, values = self._feasible[section][1], results or automatic_values(part)
        rows: list[dict[str, Any]] = []
        for name, parameter in part.parameters.items():
            key, component = f"{section}.{name}", getattr(parameter, "component", None)
            editor = _EDITORS.get(parameter.kind)
            idle = idle_reason(part, name, results)
            is_hidden = idle and name not in written_names and editor != "pattern"
            if editor is None or key in _EXCLUDED or is_hidden:
                continue
            if parameter.kind == "series" and not isinstance(component, Real):
                editor = "text"
            self._parameters[key] = part, parameter
            value = getattr(part, name)
            in_use = values.get(name) if value is None else value
            self._shown[key] = "" if in_use is None else parameter.format(in_use)
            interval = feasible.get(name)
            typed, bad = self._refused.get(key, (None, ""))
            note = f"no effect: {idle}" if idle else format_interval(parameter, interval)
            if name in results and not note and results[name] != value:
                note = f"in use: {parameter.format_figure(results[name])}"
            row = {
                "key": key,
                "label": parameter.label,
                "unit": parameter.unit if parameter.kind == "vector" else "",
                "kind": editor,
                "text": _text(parameter, value) if typed is None else typed,
                "automatic": _automatic_hint(parameter, values.get(name)),
                "help": f"{parameter.help}\n\nAllowed: {parameter.allowed}.",
                "note": note,
                "bad": bad,
                "changed": name in written_names,
                "first": bool(bad) or name in written_names or len(rows) < _SHOWN_AT_FIRST,
            }
            if editor == "pattern":
                _describe_weave(row, value, getattr(part, "draft", None))
            elif editor == "choice":
                row["choices"] = list(getattr(parameter, "choices", ()))
            elif editor == "flag":
                row["on"] = bool(value)
            elif editor == "number" and isinstance(value, int | float):
                row["step"] = self._span(key, parameter, value, interval).step_at(value)
            rows.append(row)
        return rows

    def _span(self, key: str, parameter: Parameter[Any], value: float, interval: Any) -> SliderSpan:
        # Keep the span while the value is inside, so that the slider does not jump.
        span = self._spans.get(key)
        if interval is not None or span is None or not span.low <= value <= span.high:
            self._spans[key] = span = slider_span(_number_parameter(parameter), value, interval)
        return span


def _describe_weave(row: dict[str, Any], pattern: Any, draft: Path | None) -> None:
    """Add to a row which choice of the page's list is woven, and the squares of a repeat."""
    if draft is not None:
        folder = library.folder() / "drafts"
        row["chosen"] = f"drafts/{draft.name}" if draft.parent == folder else ""
        row |= {"text": "", "note": "", "automatic": f"draft {draft.name}", "changed": True}
        return
    row["chosen"] = pattern if isinstance(pattern, str) else ""
    repeat = pattern_repeat(pattern)
    if max(repeat.shape) <= _MOST_SQUARES:
        row["repeat"] = drawdown.to_rows(repeat)


def _number_parameter(parameter: Parameter[Any]) -> Real:
    real = getattr(parameter, "component", parameter)
    if not isinstance(real, Real):
        raise InputError("this parameter is not a number", key=parameter.name)
    return real


def _text(parameter: Parameter[Any], value: Any) -> str:
    if value is None:
        return ""
    text = parameter.text(value)
    if parameter.kind == "vector" and parameter.unit:
        text = text.removesuffix(f" {parameter.unit}")  # the unit is shown beside the name
    return text.strip('"')


def _automatic_hint(parameter: Parameter[Any], value: Any) -> str:
    if not parameter.automatic:
        return ""
    return parameter.automatic if value is None else f"auto: {parameter.format_figure(value)}"
