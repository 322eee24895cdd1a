"""Types of parameters: numbers, words, paths, colours and lists of them.

`spacemap_vtk.parameterised` explains declarations; its names can be imported from here, too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError, format_value
from spacemap_vtk.parameterised import AUTOMATIC as AUTOMATIC
from spacemap_vtk.parameterised import Parameter as Parameter
from spacemap_vtk.parameterised import Parameterised as Parameterised
from spacemap_vtk.parameterised import suggestion as suggestion
from spacemap_vtk.units import UNITS, format_quantity, parse_quantity, split_quantity

#: Largest number in SI. Drawing uses single precision, which ends at 3e38; a product of a few
#: numbers up to this limit stays within double precision.
_MAX_NUMBER = 1e36


class Real(Parameter[Any]):
    """A finite number, with a unit and a range.

    Parameters
    ----------
    default : object
        Value until one is set; None makes the parameter optional.
    help : str
        One sentence, shown wherever the parameter is shown.
    minimum, maximum : float, optional
        Limits of the range, inclusive.
    above, below : float, optional
        Limits of the range, exclusive.
    trade_unit : str, optional
        Customary unit of the trade, one of those of `unit`, for computed figures.
    plausible : tuple of float, optional
        Range in SI in which a scene may give a number without a unit. A number outside was
        probably meant in another unit. A number with a unit only has to be in range.
    usual_units : str, optional
        The units, separated by commas, that an implausible number was probably meant in.
    **rest : object
        As for `Parameter`.
    """

    kind = "real"
    annotation = "float"

    def __init__(
        self,
        default: Any,
        help: str,
        *,
        minimum: float | None = None,
        maximum: float | None = None,
        above: float | None = None,
        below: float | None = None,
        trade_unit: str = "",
        plausible: tuple[float, float] | None = None,
        usual_units: str = "",
        **rest: Any,
    ) -> None:
        super().__init__(default, help, **rest)
        self.trade_unit = trade_unit
        self.plausible, self.usual_units = plausible, usual_units
        self.minimum, self.maximum, self.above, self.below = minimum, maximum, above, below

    def convert(self, value: Any) -> Any:
        """Convert to a finite float in range."""
        if isinstance(value, str):
            value = self.parse(value)
        if isinstance(value, (bool, np.bool_)) or not isinstance(
            value, (int, float, np.integer, np.floating)
        ):
            raise InputError("must be a number")
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            number = math.inf
        if not math.isfinite(number):
            raise InputError("must be finite")
        self._check_range(number)
        if number and not 1 / _MAX_NUMBER <= abs(number) <= _MAX_NUMBER:
            raise InputError(
                f"must be 0, or between {1 / _MAX_NUMBER:g} and {_MAX_NUMBER:g} in size"
            )
        return number

    def parse(self, text: str) -> float:
        """Convert a written number to SI.

        Parameters
        ----------
        text : str
            A number, with or without a unit.

        Returns
        -------
        float
            The number in SI.
        """
        return parse_quantity(text, self.unit)

    def require_plausible(self, value: Any) -> None:
        """Refuse a number without a unit that is implausible in SI, and suggest units."""
        number = bare_number(value)
        if self.plausible is None or number is None or number <= 0.0:
            return  # not a number, or out of range: `check` refuses it when it is set
        low, high = self.plausible
        if low <= number <= high:
            return
        written = f"{number:g}"
        units = [unit.strip() for unit in self.usual_units.split(",")]
        known = UNITS[self.unit]
        meant = [u for u in units if u not in known or low <= number * known[u] <= high] or units
        cures = " or ".join(f'"{written} {unit}"' for unit in meant)
        plain = next(iter(known)).removeprefix("1")
        raise InputError(
            f"without a unit this is {format_quantity(number, self.unit)}, which is implausible",
            key=self.name,
            value=value,
            allowed=f"{format_quantity(low, self.unit)} to {format_quantity(high, self.unit)} "
            "without a unit, or any number with its unit",
            cure=f'Add the unit, for example {cures}; "{written} {plain}" is accepted, too.',
        )

    def _check_range(self, number: float) -> None:
        if (
            (self.minimum is not None and number < self.minimum)
            or (self.maximum is not None and number > self.maximum)
            or (self.above is not None and number <= self.above)
            or (self.below is not None and number >= self.below)
        ):
            raise InputError("out of range")

    @property
    def range(self) -> str:
        """The range in words, with its unit; empty if there is none."""
        bounds = [
            ("at least", self.minimum),
            ("greater than", self.above),
            ("at most", self.maximum),
            ("less than", self.below),
        ]
        return " and ".join(
            f"{word} {format_quantity(bound, self.unit)}"
            for word, bound in bounds
            if bound is not None
        )

    @property
    def expected(self) -> str:
        """Type, unit and range in words."""
        kind = "a whole number" if self.kind == "integer" else "a number"
        words = f"{kind} {self.range}".rstrip()
        if not self.unit:
            return words
        return f"{words}, in {self.unit} or with its unit ({', '.join(self.units)})"

    @property
    def units(self) -> list[str]:
        """The units that the user may write."""
        return list(UNITS[self.unit])

    def text(self, value: Any) -> str:
        """Format the value with a suitable unit."""
        return format_quantity(value, self.unit)

    def format_figure(self, value: Any) -> str:
        """Format the value to four digits, with a suitable unit and in the trade's unit."""
        text = format_quantity(value, self.unit, 4)
        if not self.trade_unit:
            return text
        return f"{text} ({value / UNITS[self.unit][self.trade_unit]:.4g} {self.trade_unit})"


def bare_number(value: Any) -> float | None:
    """Return the number in a value that has no unit.

    Parameters
    ----------
    value : object
        A number, or a text.

    Returns
    -------
    float or None
        None if the value is not a number, or has a unit.
    """
    if isinstance(value, str):
        found = split_quantity(value)
        return found[0] if found is not None and found[1] == "" else None
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number and abs(value) <= _MAX_NUMBER else None


class Integer(Real):
    """A whole number in a range."""

    kind = "integer"
    annotation = "int"

    def convert(self, value: Any) -> Any:
        """Convert to an int in range."""
        number = super().convert(value)
        if number != int(number):
            raise InputError("must be a whole number")
        return int(number)

    def text(self, value: Any) -> str:
        """Format the number with all its digits."""
        return str(value)


class Flag(Parameter[bool]):
    """True or false."""

    kind = "flag"
    annotation = "bool"
    expected = "true or false"

    def convert(self, value: Any) -> bool:
        """Return the bool; other types are refused."""
        if not isinstance(value, (bool, np.bool_)):
            raise InputError("must be true or false")
        return bool(value)

    def text(self, value: bool) -> str:
        """Format the value as in TOML."""
        return str(value).lower()


class Choice(Parameter[str]):
    """One of a few words.

    Parameters
    ----------
    default : str or None
        Value until one is set; None makes the parameter optional.
    help : str
        One sentence, shown wherever the parameter is shown.
    choices : sequence of str
        The words, the most common first.
    **rest : object
        As for `Parameter`.
    """

    kind = "choice"
    annotation = "str"

    def __init__(self, default: str | None, help: str, choices: Sequence[str], **rest: Any) -> None:
        super().__init__(default, help, **rest)
        self.choices = tuple(choices)

    def convert(self, value: Any) -> str:
        """Return the word if it is one of the choices."""
        if value not in self.choices:
            raise InputError(
                "must be one of the choices", cure=suggestion(str(value), self.choices)
            )
        return str(value)

    @property
    def expected(self) -> str:
        """The words, quoted."""
        return " or ".join(f'"{choice}"' for choice in self.choices)


class Vector(Parameter[tuple[Any, ...]]):
    """A fixed number of components, each checked by a parameter.

    Parameters
    ----------
    default : object
        Value until one is set; None makes the parameter optional.
    help : str
        One sentence, shown wherever the parameter is shown.
    component : Real
        Parameter that checks each component.
    labels : sequence of str
        A letter or name for each component.
    **rest : object
        As for `Parameter`.
    """

    kind = "vector"

    def __init__(
        self,
        default: Any,
        help: str,
        *,
        component: Real,
        labels: Sequence[str] = "xyz",
        **rest: Any,
    ) -> None:
        super().__init__(default, help, unit=component.unit, **rest)
        self.component = component
        self.labels = labels
        self.annotation = f"sequence of {len(labels)} {component.annotation}"

    def convert(self, value: Any) -> tuple[Any, ...]:
        """Convert to a tuple of checked components."""
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise InputError(f"must be a list of {len(self.labels)}")
        components = tuple(value)
        if len(components) != len(self.labels):
            raise InputError(f"must have {len(self.labels)} components, not {len(components)}")
        return tuple(self.component.convert(component) for component in components)

    @property
    def expected(self) -> str:
        """The components in words."""
        return f"a list [{', '.join(self.labels)}], each {self.component.expected}"

    def text(self, value: tuple[Any, ...]) -> str:
        """Format the components as in TOML, in SI."""
        return "[" + ", ".join(f"{v:g}" for v in value) + "]" + f" {self.unit}".rstrip()


class Text(Parameter[str]):
    """A string."""

    kind = "text"
    annotation = "str"
    expected = "a string"
    #: Some of the allowed strings, which a form offers.
    offered: Sequence[str] = ()

    def convert(self, value: Any) -> str:
        """Return the string."""
        if not isinstance(value, str):
            raise InputError("must be a string")
        return value

    def text(self, value: str) -> str:
        """Return the string in quotes."""
        return f'"{value}"'


class FilePath(Parameter[Any]):
    """A file to read. A relative path in a scene starts from the scene's folder."""

    kind = "file"
    annotation = "str or path-like"
    expected = "the path of a file"

    def convert(self, value: Any) -> Path:
        """Convert to a Path. Whether the file exists is checked when it is read."""
        if not isinstance(value, (str, Path)) or str(value) == "":
            raise InputError("must be a path")
        return Path(value)

    def resolve_path(self, value: Any, folder: Path) -> Any:
        """Join the folder and the path; `AUTOMATIC` is not a path."""
        if not isinstance(value, str) or not value or self.is_automatic(value):
            return value
        require_local_file(value, key=self.name)
        return folder / value


def require_local_file(word: str, by: Path | None = None, key: str = "file") -> None:
    """Refuse a file name that refers to another machine.

    Parameters
    ----------
    word : str
        The file name, as written in a file.
    by : Path, optional
        The file that contains the name; by default a scene, whose key the error names.
    key : str
        Key of the scene.

    Raises
    ------
    InputError
        If the name begins with a machine's name, as in ``//machine/folder/file``.
    """
    # On Windows, even a test whether such a file exists sends the user's name and the hash of the
    # password to that machine. All systems refuse it, because a scene made on one is opened on
    # others.
    if PureWindowsPath(word).drive.startswith("\\\\"):
        raise InputError(
            f"{by} refers to {word}, which is on another machine"
            if by
            else "must not be on another machine",
            key=key,
            value=None if by else word,
            cure="Copy the file into the folder of the file that refers to it, and refer to the "
            "copy.",
        )


class Color(Parameter[Any]):
    """A colour: ``"#rrggbb"`` or three numbers from 0 to 255."""

    kind = "color"
    annotation = "str or sequence of 3 int"
    expected = 'a colour as "#rrggbb" or [red, green, blue] from 0 to 255'

    def convert(self, value: Any) -> tuple[int, int, int]:
        """Convert to red, green and blue from 0 to 255."""
        if isinstance(value, str):
            digits = re.fullmatch(r"#?([0-9a-fA-F]{6})", value)
            if digits is None:
                raise InputError("must be a colour")
            value = bytes.fromhex(digits.group(1))
        if not isinstance(value, Iterable):
            raise InputError("must be a colour")
        rgb = tuple(value)
        if len(rgb) != 3 or not all(
            isinstance(c, (int, np.integer)) and not isinstance(c, bool) and 0 <= c <= 255
            for c in rgb
        ):
            raise InputError("must be a colour")
        return int(rgb[0]), int(rgb[1]), int(rgb[2])

    def text(self, value: Any) -> str:
        """Format the colour as ``#rrggbb``."""
        return "#{:02x}{:02x}{:02x}".format(*value)


class Series(Parameter[Any]):
    """One value, or a list of values.

    Parameters
    ----------
    component : Parameter
        Parameter that checks each value; its help is used.
    automatic : str
        As for `Parameter`.
    **rest : object
        As for `Parameter`.
    """

    # Text fields may show and accept a list with commas: ``"0.3 mm, 0.2 mm"``.

    kind = "series"
    #: What a list means, in words.
    list_meaning = ""

    def __init__(self, component: Parameter[Any], *, automatic: str, **rest: Any) -> None:
        super().__init__(None, component.help, unit=component.unit, automatic=automatic, **rest)
        self.component = component
        self.annotation = f"{component.annotation}, or a list of these"

    def __set_name__(self, owner: type, name: str) -> None:
        self.component.__set_name__(owner, name)
        super().__set_name__(owner, name)

    def convert(self, value: Any) -> Any:
        """Convert to a checked value, or to a tuple of several."""
        value = _split_commas(value)
        try:
            return self.component.convert(value)
        except InputError:
            # A list of one item is not a value of the component, but three numbers are one colour.
            if isinstance(value, str) or not isinstance(value, Iterable):
                raise
        items = []
        for number, item in enumerate(value, start=1):
            try:
                items.append(self.component.convert(item))
            except InputError as error:
                what = f"value {number}, {format_value(item)}: {error.message}"
                raise InputError(what, cure=error.cure) from None
        if not items:
            raise InputError("must not be an empty list")
        return items[0] if len(set(items)) == 1 else tuple(items)

    def require_plausible(self, value: Any) -> None:
        """Refuse a value, or an item of a list, that the component finds implausible."""
        value = _split_commas(value)
        for item in value if isinstance(value, (list, tuple)) else [value]:
            self.component.require_plausible(item)

    @property
    def expected(self) -> str:
        """The form of each value, in words."""
        meaning = self.list_meaning and f", {self.list_meaning}"
        return f"{self.component.expected}; or a list of these{meaning}"

    def text(self, value: Any) -> str:
        """Format the value, or the list with commas."""
        several = self.items(value)
        return ", ".join(self.component.format(item) for item in several or (value,))

    def items(self, value: Any) -> tuple[Any, ...] | None:
        """Return the values if they are a list.

        Parameters
        ----------
        value : object
            A stored value.

        Returns
        -------
        tuple or None
            None for a single value.
        """
        # A single colour is stored as a tuple of numbers.
        is_list = isinstance(value, tuple) and not (
            isinstance(self.component, Color) and isinstance(value[0], int)
        )
        return value if is_list else None


def _split_commas(value: Any) -> Any:
    """Split a text at commas; return anything else unchanged."""
    if isinstance(value, str) and "," in value:
        return [item.strip() for item in value.split(",")]
    return value
