"""Parameters: declared once, checked everywhere."""

from __future__ import annotations

import inspect
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import spacemap_vtk
from spacemap_vtk.errors import InputError, UnknownNameError
from spacemap_vtk.parameters import (
    Choice,
    Color,
    FilePath,
    Flag,
    Integer,
    Parameterised,
    Real,
    Text,
    Vector,
)
from spacemap_vtk.units import UNITS, format_quantity, parse_quantity

FILTERS = [getattr(spacemap_vtk, name) for name in spacemap_vtk.FILTERS]


class Thing(Parameterised):
    """A thing."""

    length = Real("2 mm", "How long.", unit="m", above=0.0, maximum=1.0)
    count = Integer(3, "How many.", minimum=1, maximum=10)
    kind = Choice("red", "Which.", ["red", "green"])
    push = Vector((0.0, 0.0, 0.0), "Where to.", component=Real(0.0, "", unit="m/s2"))
    maybe = Real(None, "Perhaps.", unit="s", automatic="never")
    on = Flag(True, "Whether.")
    color = Color("#ff8000", "Paint.")
    name = Text("x", "What it is called.")
    file = FilePath(None, "Where it is.", automatic="nowhere")

    def __init__(self, **values: object) -> None:
        self._changes = 0
        super().__init__(**values)

    def _parameter_changed(self) -> None:
        self._changes += 1


def test_values_with_units_are_stored_in_si() -> None:
    thing = Thing(length="0.3 mm", push=["1 g", 0, -1.5], maybe="20 ms")
    assert thing.length == 0.0003
    assert thing.push == (9.80665, 0.0, -1.5)
    assert thing.maybe == 0.02
    thing.maybe = None
    assert thing.maybe is None
    thing.color = [1, 2, 3]
    assert thing.color == (1, 2, 3)


def test_setting_an_equal_value_calls_no_hook() -> None:
    thing = Thing()
    thing.length = 0.002
    thing.length = "2 mm"
    thing.push = [0, 0, 0]
    assert thing._changes == 0
    thing.count = 4
    thing.count = 4.0
    assert thing._changes == 1


@pytest.mark.parametrize(
    ("name", "value", "part"),
    [
        ("length", 0, "greater than 0 m"),
        ("length", -1e-3, "greater than 0 m"),
        ("length", 1.5, "at most 1 m"),
        ("length", math.nan, "must be finite"),
        ("length", "inf", "must be finite"),
        ("length", 10**400, "must be finite"),
        ("length", "1e-40 mm", "must be 0, or between 1e-36 and 1e+36"),
        ("push", (0, 0, 1e37), "must be 0, or between 1e-36 and 1e+36"),
        ("length", "9" * 5000 + "\n" * 5000 + "x", "unknown unit"),  # in no time
        ("length", "2 furlongs", 'unknown unit "furlongs"'),
        ("length", "2 kg", 'unknown unit "kg"'),
        ("length", "long", "must be a number"),
        ("length", True, "must be a number"),
        ("length", [1.0], "must be a number"),
        ("length", None, "must be a number"),
        ("count", 2.5, "must be a whole number"),
        ("count", 11, "at most 10"),
        ("kind", "gren", 'Did you mean "green"?'),
        ("push", (1, 2), "must have 3 components, not 2"),
        ("push", "down", "must be a list of 3"),
        ("push", (1, 2, math.inf), "must be finite"),
        ("on", 1, "must be true or false"),
        ("color", "#12", "must be a colour"),
        ("color", (0, 0, 256), "must be a colour"),
        ("name", 3, "must be a string"),
        ("file", 3, "must be a path"),
    ],
)
def test_refused_value_is_named_with_the_allowed_values(
    name: str, value: object, part: str
) -> None:
    thing = Thing()
    before = getattr(thing, name)
    with pytest.raises(InputError) as caught:
        setattr(thing, name, value)
    text = str(caught.value)
    assert text.startswith(name)
    assert part in text
    assert "allowed: " in text
    assert getattr(thing, name) == before
    assert thing._changes == 0


@pytest.mark.parametrize("word", ["auto", " auto "])
def test_word_auto_makes_a_value_automatic(word: str) -> None:
    thing = Thing(maybe=2.0, file="there")
    assert thing._changes == 2
    thing.configure(maybe=word, file=word)
    assert (thing.maybe, thing.file) == (None, None)
    for name in ("maybe", "file"):
        parameter = Thing.parameters[name]
        assert parameter.format(None) == f"auto ({parameter.automatic})"
        assert parameter.allowed.endswith(', or "auto"')
    # A file of that name can be meant all the same.
    thing.file = "./auto"
    assert thing.file == Path("auto")


@pytest.mark.parametrize("name", ["length", "count", "push", "kind", "color"])
def test_parameters_without_automatic_value_refuse_auto(name: str) -> None:
    with pytest.raises(InputError, match=name) as refused:
        Thing(**{name: "auto"})
    assert '"auto"' not in str(refused.value.allowed)


def test_every_automatic_parameter_accepts_auto() -> None:
    found = [p for cls in FILTERS for p in cls.parameters.values() if p.automatic]
    assert len(found) > 20
    for parameter in found:
        assert parameter.check("auto") is None
        assert parameter.default_for(of_object=True) is None
    # Of cloth these are as ever: the paper's.
    own = {p.name for p in found if p.default is not None}
    assert own == {"divisions", "fixed", "youngs_modulus"}


def test_unknown_name_lists_the_valid_names() -> None:
    with pytest.raises(UnknownNameError, match=r"lenght.*allowed: length, count.*\"length\""):
        Thing(lenght=1)
    thing = Thing()
    with pytest.raises(UnknownNameError, match="allowed: length"):
        thing.colour = "#000000"
    with pytest.raises(AttributeError):
        _ = thing.colour


def test_value_reset_to_the_default_counts_as_not_set() -> None:
    thing = Thing(count=5)
    thing.count = 3
    assert thing._values == Thing()._values == {}
    assert thing._changes == 2
    response = spacemap_vtk.ModalResponse(alpha=5.0)
    response.configure(alpha=spacemap_vtk.ModalResponse().alpha, damping_ratio=0.05)
    assert response.damping.ratio == 0.05


def test_class_has_the_parameters_of_its_groups_in_order() -> None:
    class Place(Parameterised):
        """Where."""

        x = Real(1.0, "Across.", unit="m")
        near = Flag(False, "Whether x counts.")

    class Both(Thing, Place):
        """Two groups and a parameter of its own."""

        last = Text("", "Of its own.")

    assert list(Both.parameters) == [*Thing.parameters, "x", "near", "last"]
    assert list(inspect.signature(Both).parameters) == list(Both.parameters)
    both = Both(x="2 mm", count=4)
    assert (both.x, both.count, both.given_values) == (0.002, 4, {"count": 4, "x": 0.002})
    assert list(Thing.parameters) == [n for n in Both.parameters if n not in ("x", "near", "last")]


def test_configure_sets_all_values_or_none() -> None:
    thing = Thing()
    with pytest.raises(InputError):
        thing.configure(count=5, length=-1)
    assert thing.count == 3


@pytest.mark.parametrize("cls", FILTERS)
def test_docstring_of_every_filter_lists_its_parameters(cls: type[Parameterised]) -> None:
    signature = inspect.signature(cls)
    assert list(signature.parameters) == list(cls.parameters)
    assert cls.section
    for name, parameter in cls.parameters.items():
        assert signature.parameters[name].default == parameter.default
        assert f"\n{name} : {parameter.annotation}" in (cls.__doc__ or "")
        assert parameter.help.endswith(".")
        assert parameter.label
        assert not parameter.unit or parameter.unit in UNITS
        assert parameter.default is not None or parameter.automatic
    with pytest.raises(UnknownNameError, match=next(iter(cls.parameters))):
        cls(nonsense=1)
    stage = cls()
    with pytest.raises(UnknownNameError):
        stage.nonsense = 1
    changed = stage.GetMTime()
    for name, value in stage.settings.items():
        setattr(stage, name, value)
    assert stage.GetMTime() == changed


@given(
    st.floats(1e-9, 1e9),
    st.sampled_from([(si, name) for si, names in UNITS.items() for name in names]),
)
def test_formatted_quantity_is_parsed_to_the_same_value(
    value: float, units: tuple[str, str]
) -> None:
    si, name = units
    assert parse_quantity(f"{value!r} {name}", si) == pytest.approx(value * UNITS[si][name], 1e-15)


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [
        ("1 gf/cm", "N/m", 0.980665),
        ("1 gf/cm·deg", "N/m", 0.980665 * 180 / math.pi),
        ("20 kN/m", "N/m", 2e4),
        ("3 cN/cm", "N/m", 3.0),
        ("1 lbf/in", "N/m", 175.1268352465),
        # a gram's weight, 9.80665 mN, times a centimetre
        ("1 gf*cm²/cm", "N.m", 9.80665e-5),
        ("0.05 gf.cm^2/cm", "N.m", 4.903325e-6),
        ("1 mg.cm", "N.m", 9.80665e-8),
        ("5 µN·m", "N.m", 5e-6),
        ("5 uN*m", "N.m", 5e-6),
        ("2 mN*cm", "N.m", 2e-5),
        ("150 g/m²", "kg/m2", 0.15),
        ("150 gsm", "kg/m2", 0.15),
        # a square yard has 0.83612736 m²
        ("4.4 oz/yd²", "kg/m2", 4.4 * 0.028349523125 / 0.83612736),
    ],
)
def test_textile_units_convert_to_si(text: str, si: str, value: float) -> None:
    assert parse_quantity(text, si) == pytest.approx(value, rel=1e-9)


@given(st.floats(1e-7, 1e9), st.sampled_from(["m", "Pa", "s", "kg/m3", "N.m", "kg/m2", "N/m", ""]))
def test_rounded_quantity_can_be_parsed(value: float, unit: str) -> None:
    assert parse_quantity(format_quantity(value, unit), unit) == pytest.approx(value, rel=1e-5)


def test_condition_of_a_parameter_in_words() -> None:
    class Thing(Parameterised):
        """A thing."""

        kind = Choice("box", "Kind.", ["box", "ball", "file"])
        edge = Real(1.0, "Edge.", when={"kind": ("box",)})
        turn = Real(None, "Turn.", automatic="none", when={"kind": ("box", "ball")})
        about = Text("z", "Axis.", when={"turn": ()})
        slow = Flag(True, "Slow.")
        speed = Real(None, "Speed.", automatic="slow", when={"slow": (False,), "turn": (None,)})

    assert Thing.edge.condition == 'kind is "box"'
    assert Thing.turn.condition == 'kind is not "file"'
    assert Thing.about.condition == "turn is given"
    assert Thing.speed.condition == "slow is false and turn is auto"
    assert 'Used only if kind is "box".' in (Thing.__doc__ or "")
    assert 'Used only if kind is "box".' in (Thing.edge.__doc__ or "")
    thing = Thing()
    assert (thing.disabled_by("kind"), thing.disabled_by("edge"), thing.disabled_by("turn")) == (
        "",
        "",
        "",
    )
    assert thing.disabled_by("about") == "turn is auto"
    thing.configure(turn=2.0, kind="file", slow=False)
    assert thing.disabled_by("edge") == 'kind is "file"'
    assert thing.disabled_by("about") == ""
    assert thing.disabled_by("speed") == "turn is 2"


@pytest.mark.parametrize("cls", FILTERS)
def test_conditions_name_real_parameters_and_values(cls: type[Parameterised]) -> None:
    for parameter in cls.parameters.values():
        for key, values in parameter.when.items():
            other = cls.parameters[key]
            assert [other.check(value) for value in values] == list(values)
