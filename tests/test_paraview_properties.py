"""Parameters become ParaView properties, and their values survive both conversions."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import pytest

import spacemap_vtk
from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import (
    Choice,
    Color,
    FilePath,
    Flag,
    Integer,
    Parameter,
    Parameterised,
    Real,
    Text,
    Vector,
)
from spacemap_vtk.paraview.property_xml import property_label, property_of
from spacemap_vtk.paraview.proxies import property_groups
from spacemap_vtk.paraview.stages import PROXIES


class Count(Real):
    """A number with a notation of its own."""

    def convert(self, value: Any) -> float:
        """Return tex."""
        return float(
            super().convert(value.removesuffix(" tex") if isinstance(value, str) else value)
        )


class Pattern(Parameter[Any]):
    """A word or a list, shown in quotes."""

    def convert(self, value: Any) -> Any:
        """Return the word, or a tuple."""
        if isinstance(value, str) and value != "plain":
            raise InputError("no such word")
        return value if isinstance(value, str) else tuple(value)

    def text(self, value: Any) -> str:
        """Return the word in quotes."""
        return f'"{value}"'


class Sides(Parameter[Any]):
    """A parameter whose empty value is not None."""

    def convert(self, value: Any) -> Any:
        """Return a tuple."""
        return tuple(value.split() if isinstance(value, str) else value)

    def text(self, value: Any) -> str:
        """Return the words in quotes."""
        return f'"{" ".join(value)}"'


class Everything(Parameterised):
    """One parameter of each kind."""

    length = Real("2 mm", "A length.", unit="m", above=0.0)
    share = Real(0.5, "A share.", minimum=0.0, maximum=1.0)
    spare_width = Real(None, "Optional.", unit="m", above=0.0, automatic="as wide as needed")
    spare_height = Real(None, "Optional.", minimum=0.0, automatic="as high as needed")
    spare_shift = Real(None, "Any number may be meant.", unit="m", automatic="none")
    number = Integer(3, "A number.", minimum=1, maximum=100_000)
    spare_number = Integer(None, "A number.", minimum=0, automatic="as many as there are")
    flag = Flag(True, "True or not.")
    word = Choice("b", "A word.", ["a", "b"])
    vector = Vector((1.0, 2.0, 3.0), "A vector.", component=Real(0.0, "", unit="m/s2"))
    maybe_vector = Vector(None, "None of it.", component=Real(0.0, ""), automatic="none")
    sizes = Vector((4, 5), "Sizes.", component=Integer(1, "", minimum=1), labels="wh")
    text = Text("<&>", "Must be escaped: <&>.", group="Words")
    file = FilePath(None, "A file.", automatic="no file")
    color = Color("#ff8000", "A colour.")
    maybe_color = Color(None, "A colour.", automatic="the draft's")
    pattern = Pattern("plain", "A weave.")
    sides = Sides("+y -x", "Sides.")
    yarn = Count(30.0, "A yarn count.")


def read(name: str, *values: Any) -> Any:
    """Return the value of a stage after ParaView has set a property."""
    parameter = Everything.parameters[name]
    return parameter.check(property_of(parameter).read(*values))


def xml(name: str) -> Element:
    return property_of(Everything.parameters[name]).xml


@pytest.mark.parametrize("name", Everything.parameters)
def test_xml_defaults_equal_the_declared_defaults(name: str) -> None:
    element, parameter = xml(name), Everything.parameters[name]
    text = element.get("default_values", "")
    numbers = {"Int": int, "Double": float}
    kind = next((make for word, make in numbers.items() if element.tag.startswith(word)), None)
    values = [kind(word) for word in text.split()] if kind else [text]
    assert len(values) == int(element.get("number_of_elements", "0"))
    assert read(name, *values) == parameter.default
    assert element.get("label") == property_label(parameter)
    assert element.findtext("Documentation", "").startswith(parameter.help)


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("length", "0.123456789 mm"),
        ("spare_width", None),
        ("spare_shift", -0.002),
        ("spare_shift", 1.0 / 3.0),
        ("spare_shift", None),
        ("number", "4"),
        ("flag", False),
        ("vector", ["1 mm/s2", 0, -9.81]),
        ("maybe_vector", (1.0, 2.0, 1.0 / 3.0)),
        ("maybe_vector", None),
        ("sizes", [7, 8]),
        ("text", ""),
        ("file", None),
        ("file", "/a b.wif"),
        ("color", "#01fe7f"),
        ("maybe_color", (1, 2, 3)),
        ("pattern", ["110", "011", "101"]),
        ("sides", []),
        ("yarn", 20.1234567),
    ],
)
def test_a_value_survives_writing_and_reading(name: str, given: Any) -> None:
    parameter = Everything.parameters[name]
    value = parameter.check(given)
    written = property_of(parameter).write(value)
    assert isinstance(written, (int, float, str, list))
    assert read(name, *(written if isinstance(written, list) else [written])) == value


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("length", [0.003], 0.003),
        ("spare_width", [""], None),
        ("spare_width", ["100 mm"], 0.1),
        ("spare_height", ["auto"], None),
        ("spare_height", ["0"], 0.0),
        ("spare_shift", [""], None),
        ("spare_shift", ["-2 mm"], -0.002),
        ("spare_shift", ["0"], 0.0),
        ("spare_number", [None], None),
        ("spare_number", ["0"], 0),
        ("flag", [0], False),
        ("word", ["a"], "a"),
        ("vector", ["0, 0, -9.81"], (0.0, 0.0, -9.81)),
        ("vector", ["[0, 2 mm/s2,-9.81 ]"], (0.0, 0.002, -9.81)),
        ("maybe_vector", ["[1, 2, 3]"], (1.0, 2.0, 3.0)),
        ("maybe_vector", [" "], None),
        ("sizes", [7, 8], (7, 8)),
        ("file", ["/a b.wif"], Path("/a b.wif")),
        ("file", [""], None),
        ("file", [None], None),
        ("text", [None], ""),
        ("maybe_color", [None], None),
        ("sides", [None], ()),
        ("color", [0.0, 1.0, 0.2], (0, 255, 51)),
        ("maybe_color", ["#010203"], (1, 2, 3)),
        ("maybe_color", ["[1, 2, 3]"], (1, 2, 3)),
        ("pattern", ['"plain"'], "plain"),
        ("pattern", ['["110", "011", "101"]'], ("110", "011", "101")),
        ("sides", ["-x"], ("-x",)),
        ("sides", [""], ()),
        ("yarn", ["20 tex"], 20.0),
        ("yarn", ["20"], 20.0),
    ],
)
def test_values_of_all_stages_survive_writing_and_reading(
    name: str, values: list[Any], expected: Any
) -> None:
    assert read(name, *values) == expected


def test_ranges_units_and_choices_are_shown() -> None:
    def bounds(name: str) -> tuple[str | None, str | None]:
        domain = next(child for child in xml(name) if child.tag.endswith("RangeDomain"))
        return domain.get("min"), domain.get("max")

    def units(name: str) -> list[str | None]:
        return [label.get("label") for label in xml(name).iter("ComponentLabel")]

    assert bounds("share") == ("0.0", "1.0")
    assert bounds("length") == ("0.0", None)
    assert bounds("number") == ("1", None)  # a slider up to 100,000 would be of no use
    assert bounds("sizes") == ("1 1", None)
    assert units("length") == ["m"]
    assert units("sizes") == ["w", "h"]
    assert [word.get("value") for word in xml("word").iter("String")] == ["a", "b"]
    # Only an empty field shows its meaning; a number does not.
    for name, says in (("spare_shift", "none"), ("spare_number", "as many as there are")):
        assert xml(name).get("default_values") == ""
        assert xml(name).findtext("Hints/PlaceholderText") == f"auto ({says})"


#: Values of automatic parameters that are not numbers.
EXAMPLES = {
    "damping_pairs": [["1 Hz", 0.1], ["2 Hz", 0.1]],
    "lifts": ["1 2", "30", "1 2", "03"],
}


@pytest.mark.parametrize("name", PROXIES)
def test_the_panel_shows_the_properties_in_use(name: str) -> None:
    """Evaluate visibility as ParaView does, for each value of the controlling properties."""
    stage = PROXIES[name]
    elements = fromstring(stage._pvsm_proxy_xml).iter()
    shown = {e.get("command", "")[4:]: e for e in elements if e.tag.endswith("VectorProperty")}
    for key in dict.fromkeys(key for p in stage.parameters.values() for key in p.when):
        parameter = stage.parameters[key]
        values = getattr(parameter, "choices", None) or (parameter.default, True)
        if parameter.optional:
            values = (None, EXAMPLES.get(key, "0.1"))
        for value in values:
            made = stage(**{key: value})
            written = {
                n: str(property_of(p).write(getattr(made, n))) for n, p in stage.parameters.items()
            }
            named = {shown[n].get("name"): text for n, text in written.items()}
            for other, element in shown.items():
                matches = [
                    (
                        named[d.get("property")] in d.get("values", "").split(" ")
                        if "values" in d.attrib
                        else (named[d.get("property")] == d.get("value"))
                        != (d.get("inverse") == "1")
                    )
                    for d in element.iter("PropertyWidgetDecorator")
                ]
                if other in stage.parameters:
                    assert all(matches) == (made.disabled_by(other) == ""), (key, value, other)


def test_groups_are_declared_or_share_their_first_word() -> None:
    made = {
        heading: [p.name for p in ps]
        for heading, ps in property_groups(Everything.parameters).items()
    }
    assert made["Spare"] == ["spare_width", "spare_height", "spare_shift", "spare_number"]
    assert made["Words"] == ["text"]
    assert set(made) == {"Spare", "Words"}


@pytest.mark.parametrize("name", PROXIES)
def test_property_names_are_unique_and_not_paraviews_own(name: str) -> None:
    root = fromstring(PROXIES[name]._pvsm_proxy_xml)
    names = [e.get("name") for e in root.iter() if e.tag.endswith("VectorProperty")]
    names += [e.get("name") for e in root.iter("InputProperty")]
    assert len(set(names)) == len(names)
    assert not {"Port", "SMProxy", "Observed", "Name"} & set(names)


def test_every_filter_is_offered() -> None:
    assert set(spacemap_vtk.FILTERS) <= set(PROXIES)


def test_a_default_that_cannot_be_written_raises_an_error() -> None:
    class Odd(Parameter[complex]):
        def convert(self, value: Any) -> complex:
            if value != 1j:
                raise InputError("not the imaginary unit")
            return 1j

        def text(self, value: complex) -> str:
            return "uno"

    class Holder(Parameterised):
        odd = Odd(1j, "A number that JSON has no word for.")

    with pytest.raises(ValueError, match="odd"):
        property_of(Holder.parameters["odd"])
