"""Make ParaView properties from declared parameters.

A property is the XML that ParaView's server manager reads, and two conversions: from what ParaView
passes to the setter to a value for the parameter's check, and from a value to what ParaView stores.

- ParaView has no value for "automatic" (None). A parameter that may be None is a text property. Its
  field is then empty and shows in grey what this means; ParaView passes None to the setter.
- Lists of three numbers are text properties too: in a panel of ParaView's default width three
  fields have no room for -9.80665.
- Parameters of kinds that are declared elsewhere are text properties, with or without quotes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import (
    AUTOMATIC,
    Choice,
    Color,
    FilePath,
    Flag,
    Integer,
    Parameter,
    Real,
    Vector,
)
from spacemap_vtk.parameters import Text as PlainText
from spacemap_vtk.units import typeset_units

#: Widest range of a slider; a wider one could not be used, and gets a field.
_WIDEST_SLIDER = 1000.0
#: Values for which an empty field stands, if they are the default.
_EMPTY = (None, ())


class Property(NamedTuple):
    """A parameter in the form of a ParaView property."""

    xml: Element
    read: Callable[..., Any]
    """From the values that ParaView hands over to one for the parameter's check."""
    write: Callable[[Any], Any]
    """From a checked value to what ParaView's property takes: a number, a text, or a list."""


def setter_name(parameter: Parameter[Any]) -> str:
    """Return the name of the method that sets a parameter."""
    return f"set_{parameter.name}"


def property_label(parameter: Parameter[Any]) -> str:
    """Return a parameter's label in capitalised words; ParaView makes its Python name from it."""
    words = parameter.label.replace("colour", "color").split()
    return " ".join(word[:1].upper() + word[1:] for word in words)


def property_name(parameter: Parameter[Any]) -> str:
    """Return a parameter's name in ParaView's Python: the letters and digits of its title."""
    return "".join(filter(str.isalnum, property_label(parameter)))


def property_of(parameter: Parameter[Any]) -> Property:
    """Make the ParaView property of a parameter."""
    made = _property_maker(parameter)(parameter)
    made.xml.set("name", property_name(parameter))
    made.xml.set("label", property_label(parameter))
    made.xml.set("command", setter_name(parameter))
    SubElement(made.xml, "Documentation").text = parameter.describe()
    if parameter.automatic and parameter.optional:
        # ParaView ignores this for a file, because the field of a file cannot show such a text.
        add_hint(made.xml, "PlaceholderText").text = parameter.format(None)
    return made


def _property_maker(parameter: Parameter[Any]) -> Callable[[Any], Property]:
    # The exact type decides: a subclass may accept more than a number, as yarn counts do.
    kind, numbers = type(parameter), (Real, Integer)
    makers: dict[type, Callable[[Any], Property]]
    makers = {Flag: _flag, Choice: _choice, FilePath: _file, PlainText: _plain_text}
    if isinstance(parameter, Vector) and type(parameter.component) in numbers:
        whole = kind is Vector and not parameter.optional and type(parameter.component) is Integer
        return _integers if whole else _vector
    if not parameter.optional:
        makers |= {Real: _number, Integer: _number, Color: _color}
    return makers.get(kind, _text)


def _number(parameter: Real) -> Property:
    xml = _number_vector(parameter, [parameter.default])
    _add_range(xml, parameter)
    _add_component_labels(xml, [typeset_units(parameter.unit)])
    return Property(xml, lambda value: value, lambda value: value)


def _integers(parameter: Vector) -> Property:
    xml = _number_vector(parameter.component, parameter.default)
    _add_range(xml, parameter.component)
    _add_component_labels(xml, list(parameter.labels))
    return Property(xml, lambda *values: values, list)


def _vector(parameter: Vector) -> Property:
    def read(text: str | None = None) -> list[str] | None:
        numbers = (text or "").strip("[] ")
        return [number.strip() for number in numbers.split(",")] if numbers else None

    def write(value: Any) -> str:
        return ", ".join(repr(number).removesuffix(".0") for number in value or ())

    return Property(_vector_property("String", [write(parameter.default)]), read, write)


def _color(parameter: Color) -> Property:
    def write(value: Any) -> list[float]:
        return [channel / 255 for channel in value]

    xml = _vector_property("Double", [f"{share:.6g}" for share in write(parameter.default)])
    xml.set("panel_widget", "color_selector")
    SubElement(xml, "DoubleRangeDomain", name="range", min="0 0 0", max="1 1 1")
    return Property(xml, lambda *values: tuple(round(255 * value) for value in values), write)


def _flag(parameter: Flag) -> Property:
    xml = _vector_property("Int", [int(parameter.default)])
    SubElement(xml, "BooleanDomain", name="bool")
    return Property(xml, bool, int)


def _choice(parameter: Choice) -> Property:
    # The property stores the word, not its index: a state file must survive a change of the list.
    xml = _vector_property("String", [parameter.default or AUTOMATIC])
    words = SubElement(xml, "StringListDomain", name="list")
    for word in (*parameter.choices, *[AUTOMATIC] * parameter.optional):
        SubElement(words, "String", value=word)
    return Property(xml, str, lambda value: value or AUTOMATIC)


def _file(parameter: FilePath) -> Property:
    xml = _vector_property("String", [_to_text(parameter.default)])
    xml.set("animateable", "0")
    SubElement(xml, "FileListDomain", name="files")
    return Property(xml, lambda path=None: path or None, _to_text)


def _plain_text(parameter: PlainText) -> Property:
    xml = _vector_property("String", [_to_text(parameter.default)])
    return Property(xml, lambda text=None: text or (None if parameter.optional else ""), _to_text)


def _to_text(value: Any) -> str:
    return "" if value is None else str(value)


def _text(parameter: Parameter[Any]) -> Property:
    return Property(
        _vector_property("String", [_format_text(parameter, parameter.default)]),
        lambda text=None: _parse_text(parameter, text or ""),
        lambda value: _format_text(parameter, value),
    )


def _format_text(parameter: Parameter[Any], value: Any) -> str:
    """Return a value as a user would write it, without quotes if it needs none."""
    if value in _EMPTY:
        return ""
    shown = parameter.format(value)
    bare = shown[1:-1] if len(shown) > 1 and shown[0] == shown[-1] == '"' else shown
    # The shown value may be rounded; as JSON it is exact.
    for text in (bare, shown, json.dumps(value, default=str)):
        try:
            if parameter.check(_parse_text(parameter, text)) == value:
                return text
        except InputError:
            continue
    raise ValueError(f"{parameter.name}: its show() writes {shown}, which its convert() refuses")


def _parse_text(parameter: Parameter[Any], text: str) -> Any:
    if text.strip() == "" and parameter.default in _EMPTY:
        return parameter.default
    try:
        # A value of a scene file in one line is JSON too. tomllib cannot be used: Kitware's
        # ParaView 5.13 has Python 3.10.
        value = json.loads(text)
        parameter.check(value)
    except ValueError:  # InputError is a ValueError too
        return text.strip()
    return value


def _number_vector(component: Real, values: Iterable[Any]) -> Element:
    return _vector_property("Int" if isinstance(component, Integer) else "Double", list(values))


def _vector_property(kind: str, values: list[Any]) -> Element:
    return Element(
        f"{kind}VectorProperty",
        number_of_elements=str(len(values)),
        default_values=" ".join(str(value) for value in values),
    )


def _add_range(xml: Element, parameter: Real) -> None:
    low = parameter.minimum if parameter.minimum is not None else parameter.above
    high = parameter.maximum if parameter.maximum is not None else parameter.below
    if low is not None and high is not None and high - low > _WIDEST_SLIDER:
        high = None  # the parameter's check still applies
    integer = isinstance(parameter, Integer)
    bounds: dict[str, Any] = {}
    if low is not None:
        bounds["min"] = str(math.ceil(low) if integer else low)
    if high is not None:
        bounds["max"] = str(math.floor(high) if integer else high)
    if bounds:
        count = int(xml.get("number_of_elements", "1"))
        bounds = {end: " ".join([value] * count) for end, value in bounds.items()}
        SubElement(xml, f"{'Int' if integer else 'Double'}RangeDomain", name="range", **bounds)


def _add_component_labels(xml: Element, labels: list[str]) -> None:
    """Show units next to the fields; in the property's label they would enter its Python name."""
    if any(labels):
        shown = add_hint(xml, "ShowComponentLabels")
        for number, label in enumerate(labels):
            SubElement(shown, "ComponentLabel", component=str(number), label=label)


def add_hint(xml: Element, name: str) -> Element:
    """Add a hint to a property, in its only Hints element: of several ParaView reads the last."""
    hints = xml.find("Hints")
    return SubElement(SubElement(xml, "Hints") if hints is None else hints, name)
