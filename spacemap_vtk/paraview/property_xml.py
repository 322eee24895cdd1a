"""ParaView properties, made from declared parameters.

A property is the XML that ParaView's server manager reads, and the ways to and fro: a value as
ParaView holds it, and what ParaView hands to the setter, turned into a value for the parameter's
own check. ParaView has no value for "automatic"
(None): where a number is optional, 0 or -1 stands for it, whichever the parameter refuses; in a
text, the empty one, which ParaView hands over as None. Kinds that are declared elsewhere are texts,
with or without quotes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import Choice, Color, FilePath, Flag, Integer, Parameter, Real, Vector
from spacemap_vtk.parameters import Text as PlainText

#: A slider over a wider range than this cannot be used, and a field takes its place.
_WIDEST_SLIDER = 1000.0


class Property(NamedTuple):
    """A parameter as ParaView shows it."""

    xml: Element
    read: Callable[..., Any]
    """From the values that ParaView hands over to one for the parameter's check."""
    write: Callable[[Any], Any]
    """From a checked value to what ParaView's property takes: a number, a text, or a list."""


def command(parameter: Parameter[Any]) -> str:
    """Return the name of the method that sets a parameter."""
    return f"set_{parameter.name}"


def title(parameter: Parameter[Any]) -> str:
    """Return a parameter's name in words, from which ParaView makes its name in Python too."""
    return " ".join(word[:1].upper() + word[1:] for word in parameter.name.split("_"))


def property_of(parameter: Parameter[Any]) -> Property:
    """Return a parameter's property."""
    made = _kind_of(parameter)(parameter)
    made.xml.set("name", title(parameter).replace(" ", ""))
    made.xml.set("label", title(parameter))
    made.xml.set("command", command(parameter))
    help = parameter.describe()
    stand_in = made.xml.attrib.pop("automatic", None)
    if stand_in is not None:
        help += f" Here {stand_in} stands for automatic."
    SubElement(made.xml, "Documentation").text = help
    return made


def _kind_of(parameter: Parameter[Any]) -> Callable[[Any], Property]:
    # By exact type: a subclass may take more than a number, as yarn counts do.
    kind, numbers = type(parameter), (Real, Integer)
    makers: dict[type, Callable[[Any], Property]]
    makers = {Flag: _flag, Choice: _choice, FilePath: _file, PlainText: _plain}
    if isinstance(parameter, Real) and kind in numbers:
        there_is_one = not parameter.optional or _stand_in(parameter) is not None
        return _number if there_is_one else _text
    if isinstance(parameter, Vector) and not parameter.optional:
        return _vector if type(parameter.component) in numbers else _text
    if kind is Color and not parameter.optional:
        return _color
    return makers.get(kind, _text)


def _number(parameter: Real) -> Property:
    stand_in = _stand_in(parameter) if parameter.optional else None

    def write(value: Any) -> Any:
        return stand_in if value is None else value

    xml = _numbers(parameter, [write(parameter.default)])
    _range(xml, parameter, stand_in)
    _labels(xml, [parameter.unit])
    if stand_in is not None:
        xml.set("automatic", str(stand_in))
    return Property(xml, lambda value: None if value == stand_in else value, write)


def _vector(parameter: Vector) -> Property:
    xml = _numbers(parameter.component, parameter.default)
    _range(xml, parameter.component, None)
    _labels(xml, [f"{letter} {parameter.unit}".rstrip() for letter in parameter.labels])
    return Property(xml, lambda *values: values, list)


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
    # The word, not its number: a state file must outlive a change of the list.
    xml = _vector_property("String", [parameter.default])
    words = SubElement(xml, "StringListDomain", name="list")
    for word in parameter.choices:
        SubElement(words, "String", value=word)
    return Property(xml, str, str)


def _file(parameter: FilePath) -> Property:
    xml = _vector_property("String", [_bare(parameter.default)])
    xml.set("animateable", "0")
    SubElement(xml, "FileListDomain", name="files")
    return Property(xml, lambda path=None: path or None, _bare)


def _plain(parameter: PlainText) -> Property:
    xml = _vector_property("String", [_bare(parameter.default)])
    return Property(xml, lambda text=None: text or (None if parameter.optional else ""), _bare)


def _bare(value: Any) -> str:
    return "" if value is None else str(value)


def _text(parameter: Parameter[Any]) -> Property:
    xml = _vector_property("String", [_written(parameter, parameter.default)])
    if parameter.optional:
        xml.set("automatic", "an empty field")
        _hint(xml, "PlaceholderText").text = f"automatic: {parameter.automatic}"
    return Property(
        xml,
        lambda text=None: _read_text(parameter, text or ""),
        lambda value: _written(parameter, value),
    )


def _written(parameter: Parameter[Any], value: Any) -> str:
    """Return a value as a user would write it: without quotes, where it needs none."""
    if value is None:
        return ""
    shown = parameter.show(value)
    bare = shown[1:-1] if len(shown) > 1 and shown[0] == shown[-1] == '"' else shown
    # What is shown may be rounded; as JSON it is not.
    for text in (bare, shown, json.dumps(value, default=str)):
        try:
            if parameter.check(_read_text(parameter, text)) == value:
                return text
        except InputError:
            continue
    raise ValueError(f"{parameter.name}: its show() writes {shown}, which its convert() refuses")


def _read_text(parameter: Parameter[Any], text: str) -> Any:
    if text.strip() == "" and parameter.optional:
        return None
    try:
        # What a scene file can say in one line is JSON too. No tomllib: ParaView 5.13 as Kitware
        # ships it has Python 3.10.
        value = json.loads(text)
        parameter.check(value)
    except ValueError:  # InputError is one too
        return text.strip()
    return value


def _stand_in(parameter: Real) -> int | None:
    """Return the number that stands for automatic; None where every candidate is a value."""
    for candidate in (0, -1):
        try:
            parameter.convert(candidate)
        except InputError:
            return candidate
    return None


def _numbers(component: Real, values: Iterable[Any]) -> Element:
    return _vector_property("Int" if isinstance(component, Integer) else "Double", list(values))


def _vector_property(kind: str, values: list[Any]) -> Element:
    return Element(
        f"{kind}VectorProperty",
        number_of_elements=str(len(values)),
        default_values=" ".join(str(value) for value in values),
    )


def _range(xml: Element, parameter: Real, stand_in: int | None) -> None:
    low = parameter.minimum if parameter.minimum is not None else parameter.above
    high = parameter.maximum if parameter.maximum is not None else parameter.below
    if low is not None and high is not None and high - low > _WIDEST_SLIDER:
        high = None  # the parameter's own check stays
    if low is not None and stand_in is not None:
        low = min(low, stand_in)
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


def _labels(xml: Element, labels: list[str]) -> None:
    """Show units beside the fields: in the property's label they would enter its Python name."""
    if any(labels):
        shown = _hint(xml, "ShowComponentLabels")
        for number, label in enumerate(labels):
            SubElement(shown, "ComponentLabel", component=str(number), label=label)


def _hint(xml: Element, name: str) -> Element:
    return SubElement(SubElement(xml, "Hints"), name)
