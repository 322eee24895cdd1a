"""Parameters that are declared once: their base class, and the base class of their owners.

A parameter is a descriptor of the class that it belongs to. The program knows a parameter only by
its declaration (name, type, default, unit, range, choices, help). The Python keyword and property,
the scene-file key, the command line's ``--set``, the reference text, the Qt widget and the ParaView
property are generated from it::

    class ModalResponse(Stage):
        alpha = Real(1.0, "Damping proportional to mass.", unit="1/s", minimum=0.0)

Parameters that belong together, with what follows from them alone, can form a class, a parameter
group. A stage inherits from its groups and from `Stage`. Its parameters are those of the groups, in
order, followed by those of its own class::

    class ModalSolver(CageMaterial, CageFittings, Stage):
        modes = Integer(30, "Number of modes.", minimum=1)

Invariants that other code relies on:

- A stored value has always been checked; it is in SI and in canonical form (`Parameter.check`).
- ``None`` is stored for an automatic value; users write the word `AUTOMATIC`. No code tests whether
  a value equals its default. Where it matters whether a user gave a value, the default is ``None``,
  and `Parameterised.given_values` returns what a scene has set.
- Assigning an equal value changes nothing and calls no hook.
- An undeclared name is refused with the list of declared names. VTK objects would silently accept
  a misspelt attribute.
"""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Generic, TypeVar, overload

from spacemap_vtk.errors import InputError, UnknownNameError

T = TypeVar("T")

#: The word that users write, in place of any value, to let the program choose it.
AUTOMATIC = "auto"
#: Words of labels by those of keys, which cannot have marks, or are for programmers.
_SPELLINGS = {
    "color": "colour",
    "Color": "Colour",
    "Center": "Centre",
    "Youngs": "Young's",
    "Poissons": "Poisson's",
    "Triad": "Axes",
    "Draw in": "Draw-in",
    "ake up": "ake-up",
}


class Parameter(Generic[T]):
    """One declared parameter: descriptor, check and description.

    Parameters
    ----------
    default : object
        Value until one is set; None makes the parameter optional.
    help : str
        One sentence, shown wherever the parameter is shown.
    unit : str, optional
        SI unit, a key of `spacemap_vtk.units.UNITS`.
    automatic : str, optional
        What ``None`` means, e.g. ``"the middle of the feasible interval"``. If given, users can
        write `AUTOMATIC`. If the default is another value, that default is for cloth only: in a
        scene of any other object the parameter is automatic, see `default_for`.
    automatic_in_scenes : bool, optional
        Whether the parameter is automatic in a scene of cloth, too. The default is then for a
        filter that is used alone, which cannot know what the automatic value depends on.
    group : str, optional
        Heading above the parameter in a window.
    when : mapping, optional
        Condition under which the parameter has an effect: names of other parameters of the class,
        each with the values that enable this one; an empty list means any value but ``None``. A
        parameter without it always has an effect. Everything that hides, disables or refuses
        parameters without effect uses this, see `Parameterised.disabled_by`.
    """

    kind = "value"
    annotation = "object"

    def __init__(
        self,
        default: Any,
        help: str,
        *,
        unit: str = "",
        automatic: str = "",
        automatic_in_scenes: bool = False,
        group: str = "",
        when: Mapping[str, Sequence[Any]] = MappingProxyType({}),
    ) -> None:
        self.group = group
        self.when = when
        #: The condition `when` in words; empty if the parameter always has an effect.
        self.condition = ""
        self.help = help
        self.unit = unit
        self.automatic = automatic
        self.automatic_in_scenes = automatic_in_scenes
        self.name = ""
        self._default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self.default: T = self.check(self._default)

    @overload
    def __get__(self, instance: None, owner: type) -> Parameter[T]: ...
    @overload
    def __get__(self, instance: Parameterised, owner: type) -> T: ...
    def __get__(self, instance: Parameterised | None, owner: type) -> Parameter[T] | T:
        return self if instance is None else instance._values.get(self.name, self.default)

    def __set__(self, instance: Parameterised, value: Any) -> None:
        checked = self.check(value)
        if checked != self.__get__(instance, type(instance)):
            instance._values.pop(self.name, None)
            if checked != self.default:
                instance._values[self.name] = checked
            instance._parameter_changed()

    def check(self, value: Any) -> T:
        """Check `value` and convert it to canonical form.

        Parameters
        ----------
        value : object
            Value from the user.

        Returns
        -------
        T
            The value to store; None for `AUTOMATIC`.

        Raises
        ------
        InputError
            If the value has the wrong type or is out of range; the message lists what is allowed.
        """
        if (value is None and (self.optional or self.automatic)) or self.is_automatic(value):
            return None  # type: ignore[return-value]
        try:
            return self.convert(value)
        except InputError as error:
            raise InputError(
                error.message, key=self.name, value=value, allowed=self.allowed, cure=error.cure
            ) from None

    def require_plausible(self, value: Any) -> None:
        """Refuse a value in a scene that was probably meant in another unit.

        Scenes, ``--set``, the window and ParaView call this before they set a value. In Python a
        number is in SI, and any value in range is accepted.

        Parameters
        ----------
        value : object
            Value as the user wrote it.

        Raises
        ------
        InputError
            If it is a number without a unit that is implausible in SI.
        """

    def convert(self, value: Any) -> T:
        """Convert a given value to canonical form.

        Parameters
        ----------
        value : object
            Value from the user; never None.

        Returns
        -------
        T
            The value to store.

        Raises
        ------
        InputError
            If the value cannot be converted; `check` adds name, value and what is allowed.
        """
        raise NotImplementedError

    def resolve_path(self, value: Any, folder: Path) -> Any:
        """Resolve relative paths in a given value against a folder.

        Parameters
        ----------
        value : object
            Value from the user.
        folder : Path
            Folder of the file that contains the value.

        Returns
        -------
        object
            The value itself if it is not a path.
        """
        return value

    @property
    def label(self) -> str:
        """The name for people, with the marks and spelling that a key cannot have."""
        words = self.name.replace("_", " ").capitalize()
        for word, spelling in _SPELLINGS.items():
            words = words.replace(word, spelling)
        return words

    @property
    def optional(self) -> bool:
        """Whether ``None`` is a valid value."""
        return self._default is None

    def default_for(self, of_object: bool) -> T:
        """Return the value that a scene uses if it gives none.

        Parameters
        ----------
        of_object : bool
            Whether the scene shows an object that is not cloth.

        Returns
        -------
        T
            None if the value is automatic; otherwise the default.
        """
        if self.automatic_in_scenes or (of_object and self.automatic):
            return None  # type: ignore[return-value]
        return self.default

    def is_automatic(self, value: Any) -> bool:
        """Return whether a user's value is the word `AUTOMATIC`.

        Parameters
        ----------
        value : object
            Value from the user.

        Returns
        -------
        bool
            Always False if the parameter cannot be automatic.
        """
        return bool(self.automatic) and isinstance(value, str) and value.strip() == AUTOMATIC

    @property
    def allowed(self) -> str:
        """The accepted values, in words."""
        return f'{self.expected}, or "{AUTOMATIC}"' if self.automatic else self.expected

    @property
    def expected(self) -> str:
        """The accepted values except `AUTOMATIC`, in words."""
        return self.annotation

    def format(self, value: T) -> str:
        """Format a value as a user would write it.

        Parameters
        ----------
        value : T
            A stored value.

        Returns
        -------
        str
            With a suitable unit; for None, `AUTOMATIC` and its meaning.
        """
        if value is None:
            return f"{AUTOMATIC} ({self.automatic})" if self.automatic else ""
        return self.text(value)

    def text(self, value: T) -> str:
        """Format a value that is not None as a user would write it.

        Parameters
        ----------
        value : T
            A stored value.

        Returns
        -------
        str
            With a suitable unit.
        """
        return str(value)

    def format_figure(self, value: T) -> str:
        """Format a computed value for people.

        Parameters
        ----------
        value : T
            In the form in which it would be stored.

        Returns
        -------
        str
            As `show`, but a number has four digits and is also given in its trade unit.
        """
        return self.format(value)

    def finish_declaration(self, others: Mapping[str, Parameter[Any]]) -> None:
        """Set `counts` and the docstring, once all parameters of the class are known.

        Parameters
        ----------
        others : mapping of str to Parameter
            The parameters of the class by name.
        """
        self.condition = " and ".join(
            f"{key} is {_format_values(others[key], values)}" for key, values in self.when.items()
        )
        self.__doc__ = self.describe()

    def describe(self) -> str:
        """Describe the parameter: help, condition, allowed values and default.

        Returns
        -------
        str
            One paragraph.
        """
        when = f" Used only if {self.condition}." if self.condition else ""
        return f"{self.help}{when} Allowed: {self.allowed}. Default: {self.default_text}."

    @property
    def default_text(self) -> str:
        """The default in words."""
        text = self.format(self.default)
        if self.optional or not self.automatic:
            return text
        where = "in a scene" if self.automatic_in_scenes else "for an object"
        return f"{text}; {where} {AUTOMATIC}"


class Parameterised:
    """A class with declared parameters, which its constructor takes as keywords, and no others."""

    #: Name of the section of a scene file that configures this class.
    section: ClassVar[str] = ""
    #: The declared parameters by name, in the order of declaration.
    parameters: ClassVar[dict[str, Parameter[Any]]] = {}
    #: Alternative names that users may write, each with the parameter's real name.
    synonyms: ClassVar[Mapping[str, str]] = MappingProxyType({})

    #: The values of automatic parameters in the last run, by name.
    values_in_use: Mapping[str, Any] = MappingProxyType({})

    #: The values that differ from the defaults, by name.
    _values: dict[str, Any]
    #: The names that a scene has set, also if to their defaults.
    _set_in_scene: set[str]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = {name: p for name, p in vars(cls).items() if isinstance(p, Parameter)}
        cls.parameters = {}
        for base in cls.__bases__:
            cls.parameters |= getattr(base, "parameters", {})
        cls.parameters |= own
        for parameter in own.values():
            parameter.finish_declaration(cls.parameters)
        cls.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [
                inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=p.default)
                for name, p in cls.parameters.items()
            ]
        )
        if "__doc__" in vars(cls) and cls.__doc__ and cls.parameters:
            cls.__doc__ = _insert_parameters(cls.__doc__, cls.parameters)

    def __init__(self, /, **values: Any) -> None:  # a parameter may be called self
        self._values = {}
        self._set_in_scene = set()
        self.configure(**values)

    def configure(self, /, **values: Any) -> None:
        """Set several parameters at once; if one is refused, none is set.

        Parameters
        ----------
        **values : object
            New values by parameter name.

        Raises
        ------
        UnknownNameError
            If a name is not a parameter.
        InputError
            If a value is refused.
        """
        for name, value in values.items():
            self.parameter(name).check(value)
        for name, value in values.items():
            setattr(self, self.parameter(name).name, value)

    def set_from_scene(self, name: str, value: Any) -> None:
        """Set a parameter as a scene or the command line does.

        Parameters
        ----------
        name : str
            Name of the parameter.
        value : object
            Value as in a scene file; a number without a unit must be plausible in SI.
        """
        self.parameter(name).require_plausible(value)
        self.configure(**{name: value})
        self._set_in_scene.add(name)

    def keep_given(self, names: Collection[str]) -> None:
        """Forget that a scene has set other parameters than these.

        Parameters
        ----------
        names : collection of str
            Names of parameters.
        """
        self._set_in_scene &= set(names)

    @property
    def given_values(self) -> dict[str, Any]:
        """The values that were given, by name, including defaults that a scene sets."""
        # In order of declaration, whatever order they were set in.
        names = [
            name for name in self.parameters if name in self._values or name in self._set_in_scene
        ]
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}

    @classmethod
    def parameter(cls, name: str) -> Parameter[Any]:
        """Return the declaration of a parameter.

        Parameters
        ----------
        name : str
            Name of the parameter.

        Returns
        -------
        Parameter
            The declaration.

        Raises
        ------
        UnknownNameError
            If there is no parameter of that name; the message lists the names.
        """
        name = cls.synonyms.get(name, name)
        if name not in cls.parameters:
            raise UnknownNameError(
                f"unknown parameter of {cls.__name__}",
                key=name,
                allowed=", ".join(cls.parameters),
                cure=suggestion(name, cls.parameters),
            )
        return cls.parameters[name]

    @classmethod
    def defaults_for(cls, of_object: bool) -> dict[str, Any]:
        """Return the values that a scene uses if it gives none, where they are not the defaults.

        Parameters
        ----------
        of_object : bool
            As for `Parameter.default_for`.

        Returns
        -------
        dict of str to object
            By name.
        """
        every = {name: (p.default_for(of_object), p.default) for name, p in cls.parameters.items()}
        return {name: usual for name, (usual, default) in every.items() if usual != default}

    def disabled_by(self, name: str) -> str:
        """Return why a parameter has no effect at present.

        Parameters
        ----------
        name : str
            Name of the parameter.

        Returns
        -------
        str
            The value of the other parameter that disables it, in words; empty if it has an effect.
        """
        for key, values in self.parameter(name).when.items():
            value = getattr(self, key)
            if value not in values if values else value is None:
                return f"{key} is {_format_values(self.parameters[key], [value])}"
        return ""

    @property
    def settings(self) -> dict[str, Any]:
        """The values of all parameters, by name."""
        return {name: getattr(self, name) for name in self.parameters}

    def __setattr__(self, name: str, value: Any) -> None:
        # Private names belong to the class. A public name must exist; otherwise a misspelt
        # parameter would become a new attribute and be ignored.
        if not name.startswith("_") and not hasattr(type(self), name):
            self.parameter(name)
        super().__setattr__(name, value)

    def _parameter_changed(self) -> None:
        """React to a changed parameter. Does nothing by default."""


def _format_values(parameter: Parameter[Any], values: Sequence[Any]) -> str:
    """Put values of a parameter into words: as "not …" if fewer choices are left out."""
    if not values:
        return "given"
    choices = getattr(parameter, "choices", ())
    others = [choice for choice in choices if choice not in values]
    if choices and len(others) < len(values):
        words = [f'"{word}"' for word in others]
        return f"not {words[0]}" if len(words) == 1 else f"neither {' nor '.join(words)}"
    if choices:
        return " or ".join(f'"{word}"' for word in values)
    return " or ".join(AUTOMATIC if value is None else parameter.format(value) for value in values)


def suggestion(name: str, names: Iterable[str]) -> str | None:
    """Return "Did you mean …?" for a misspelt name.

    Parameters
    ----------
    name : str
        The unknown name.
    names : iterable of str
        The known names.

    Returns
    -------
    str or None
        The question; None if no known name is similar.
    """
    near = difflib.get_close_matches(name, list(names), n=1)
    return f'Did you mean "{near[0]}"?' if near else None


def _insert_parameters(doc: str, parameters: dict[str, Parameter[Any]]) -> str:
    """Insert a numpydoc Parameters section before the docstring's first section."""
    doc = inspect.cleandoc(doc)
    lines = ["Parameters", "----------"]
    for name, parameter in parameters.items():
        lines.append(
            f"{name} : {parameter.annotation}, default: {parameter.format(parameter.default)}"
        )
        lines.append(f"    {parameter.help}")
        if parameter.condition:
            lines.append(f"    Used only if {parameter.condition}.")
        lines.append(f"    Allowed: {parameter.allowed}.")
    first = re.search(r"^\w[\w ]*\n-{3,}$", doc, flags=re.MULTILINE)
    at = first.start() if first else len(doc)
    section = "\n".join(lines)
    return f"{doc[:at].rstrip()}\n\n{section}\n\n{doc[at:]}".rstrip() + "\n"
