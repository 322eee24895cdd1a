"""Parse the arguments of ``--set``: one value of a scene's key, or the values of a sweep."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError, UnknownNameError, add_section_to_errors
from spacemap_vtk.io.formats import toml
from spacemap_vtk.parameters import Parameter, Parameterised, Real, suggestion

#: Values from one end to the other, inclusive: evenly spaced, or in a constant ratio.
_SPACED = re.compile(r"\s*(linspace|geomspace)\((.*)\)\s*", re.DOTALL)
_MAX_COUNT = 1000
_OPENING = "([{"
_CLOSING = ")]}"


@dataclass(frozen=True)
class ValueList:
    """The values of a key in a sweep; a single value is simply set."""

    section: str
    key: str
    #: In the form of scene files.
    values: tuple[Any, ...]
    #: Parameter that checks and formats them.
    parameter: Parameter[Any]

    @property
    def name(self) -> str:
        """The key as it is written after ``--set``."""
        return f"{self.section}.{self.key}"

    def label(self, value: Any) -> str:
        """Format a value for people, in a few words."""
        checked = self.parameter.check(value)
        if checked is None:
            return "auto"
        text = self.parameter.text(checked)
        if isinstance(value, str) and self.parameter.kind == "file":
            text = checked.name
        text = text.strip('"')
        return text if len(text) <= 40 else text[:39] + "…"


def split_assignment(assignment: str) -> tuple[str, str, str]:
    """Split ``section.key=value`` into section, key and value."""
    target, equals, text = assignment.partition("=")
    section, dot, key = target.strip().partition(".")
    if not equals or not dot:
        raise InputError(
            f'"{assignment}" is not an assignment',
            allowed='section.key=value, for example "weave.ends=20"',
        )
    return section, key, text


def parse_value(text: str) -> Any:
    """Parse a value as in a scene file; quotes may be left out."""
    try:
        return toml.parse_toml(f"value = {text}")["value"]
    except ValueError:
        return text.strip()


def require_part(parts: Mapping[str, Parameterised], section: str) -> Parameterised:
    """Return the object that a section configures; refuse an unknown section."""
    if section not in parts:
        raise UnknownNameError(
            "unknown section",
            key=section,
            allowed=", ".join(["title", *(f"[{name}]" for name in parts)]),
            cure=suggestion(section, parts),
        )
    return parts[section]


def parse_value_list(assignment: str, parts: Mapping[str, Parameterised]) -> ValueList:
    """Parse ``section.key=value,value`` and check each value."""
    section, key, text = split_assignment(assignment)
    part = require_part(parts, section)
    with add_section_to_errors(section):
        parameter = part.parameter(key)
        words = list(_split_at_commas(text))
        if "" in words and len(words) > 1:
            raise InputError(
                "a value is missing between commas",
                key=key,
                value=text,
                cure="Quote a value that contains commas.",
            )
        values = [value for word in words for value in _expand(word, parameter)]
        if len(values) == 1 and isinstance(values[0], list) and values[0]:
            values = _list_or_items(values[0], parameter)
        for value in values:
            parameter.require_plausible(value)
            parameter.check(value)
    return ValueList(section, key, tuple(values), parameter)


def _split_at_commas(text: str) -> Iterator[str]:
    """Yield the texts between commas that are outside brackets and quotes."""
    depth, quote, start = 0, "", 0
    for place, letter in enumerate(text):
        if quote:
            escaped = quote == '"' and text[place - 1] == "\\"
            quote = "" if letter == quote and not escaped else quote
        elif letter in "\"'":
            quote = letter
        elif letter in _OPENING:
            depth += 1
        elif letter in _CLOSING:
            depth -= 1
        elif letter == "," and depth <= 0:
            yield text[start:place].strip()
            start = place + 1
    yield text[start:].strip()


def _expand(word: str, parameter: Parameter[Any]) -> list[Any]:
    """Return the value of a word, or the values of a linspace or geomspace."""
    match = _SPACED.fullmatch(word)
    if match is None:
        return [parse_value(word)]
    number = getattr(parameter, "component", parameter)
    ends = [part.strip() for part in match[2].split(",")]
    refused = InputError(
        f"must be a valid {match[1]}",
        key=parameter.name,
        value=word,
        allowed=f"{match[1]}(first, last, count) of a number, with a count from 2 to {_MAX_COUNT}",
    )
    if not isinstance(number, Real) or len(ends) != 3 or not re.fullmatch(r"\d{1,9}", ends[2]):
        raise refused
    count = int(ends[2])
    first, last = (Real(None, "", unit=number.unit).check(parse_value(end)) for end in ends[:2])
    for end in ends[:2]:
        number.require_plausible(parse_value(end))
    even = match[1] == "linspace"
    if not 2 <= count <= _MAX_COUNT or not (even or first * last > 0):
        raise refused
    found = (np.linspace if even else np.geomspace)(first, last, count)
    # Round as people would write the values: the last digits are rounding errors.
    return [_with_unit(float(f"{value:.12g}"), number) for value in found.tolist()]


def _with_unit(value: float, parameter: Real) -> Any:
    """Return a number, with its unit if a scene would refuse it without."""
    with suppress(InputError):
        parameter.require_plausible(value)
        return value
    return f"{value!r} {parameter.unit}"


def _list_or_items(values: list[Any], parameter: Parameter[Any]) -> list[Any]:
    """Return a list as one value if the parameter accepts it, otherwise its items."""

    def is_accepted(value: Any) -> bool:
        with suppress(InputError):
            parameter.check(value)
            return True
        return False

    # If no item is accepted either, the list is refused as a whole.
    return values if not is_accepted(values) and any(map(is_accepted, values)) else [values]
