"""Parameters, declared once: what all kinds share, and the classes that have them.

A parameter is a descriptor on the class it belongs to. Its declaration (name, type, default, unit,
range, choices, help) is all that the program knows of it: the Python keyword and property, the
scene-file key, the command line's ``--set``, the reference text, the Qt widget and the ParaView
property are made from it::

    class ModalResponse(Stage):
        alpha = Real(1.0, "Damping proportional to mass.", unit="1/s", minimum=0.0)

Parameters that belong together, and what follows from them alone, can be a class of their own, a
parameter group. A stage inherits from its groups and from `Stage`; its parameters are those of the
groups, in their order, and then its own::

    class ModalSolver(CageMaterial, CageFittings, Stage):
        modes = Integer(30, "Number of modes.", minimum=1)

Invariants that other code relies on:

- A stored value is always a checked one, in SI and in canonical form (`Parameter.check`).
- ``None`` is stored where a value is automatic; users write the word `AUTOMATIC` for it. So no code
  asks whether a value equals its default: what depends on whether somebody has given a value has
  ``None`` as its default, and `Parameterised.given` says what a scene has written.
- Assigning an equal value changes nothing and calls no hook.
- A name that is not declared is refused, with the list of those that are: VTK objects would take
  any misspelt attribute silently.
"""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Generic, TypeVar, overload

from spacemap_vtk.errors import InputError, UnknownNameError

T = TypeVar("T")

#: What a user writes, wherever a value can be written, for one that the program finds itself.
AUTOMATIC = "auto"


class Parameter(Generic[T]):
    """One declared parameter: descriptor, check and description in one.

    Parameters
    ----------
    default : object
        Value before any is set; None makes the parameter optional.
    help : str
        One sentence for every surface that shows the parameter.
    unit : str, optional
        SI unit, a key of `spacemap_vtk.units.UNITS`.
    automatic : str, optional
        What ``None`` stands for, e.g. ``"the middle of the feasible interval"``; with it, users can
        write `AUTOMATIC`. Where the default is another value, that is for cloth: in a scene of
        any other object it is automatic, see `usual`.
    group : str, optional
        Heading under which a window shows it.
    when : mapping, optional
        Other parameters of the class by name, each with the values for which this one counts; none
        listed: any but ``None``. A parameter without it always counts. Everything that hides, greys
        or refuses what does not count asks this, see `Parameterised.idle`.
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
        group: str = "",
        when: Mapping[str, Sequence[Any]] = MappingProxyType({}),
    ) -> None:
        self.group = group
        self.when = when
        #: For which values of others this one counts, in words; empty for all.
        self.counts = ""
        self.help = help
        self.unit = unit
        self.automatic = automatic
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
        """Return `value` in canonical form.

        Parameters
        ----------
        value : object
            Whatever a user gave.

        Returns
        -------
        T
            The value to store; None for `AUTOMATIC`.

        Raises
        ------
        InputError
            If it is of the wrong type or out of range; the message says what is allowed.
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
        """Refuse a value as written in a scene that cannot be meant as it stands.

        Scenes, ``--set``, the window and ParaView ask this before they set a value; in Python a
        number is SI, and any value in range is set.

        Parameters
        ----------
        value : object
            Whatever a user wrote.

        Raises
        ------
        InputError
            If it is a number without a unit that is implausible in SI.
        """

    def convert(self, value: Any) -> T:
        """Return a given value in canonical form.

        Parameters
        ----------
        value : object
            Whatever a user gave, but None.

        Returns
        -------
        T
            The value to store.

        Raises
        ------
        InputError
            If that cannot be done; `check` adds name, value and what is allowed.
        """
        raise NotImplementedError

    def within(self, value: Any, folder: Path) -> Any:
        """Return a given value whose relative paths count from a folder.

        Parameters
        ----------
        value : object
            Whatever a user gave.
        folder : Path
            Of the file that it stands in.

        Returns
        -------
        object
            The value itself where it is no path.
        """
        return value

    @property
    def label(self) -> str:
        """The name as people read it, with the apostrophe and the spelling that a key has not."""
        words = self.name.replace("_", " ").replace("color", "colour").capitalize()
        return words.replace("Youngs", "Young's").replace("Poissons", "Poisson's")

    @property
    def optional(self) -> bool:
        """Whether ``None`` is a value."""
        return self._default is None

    def usual(self, of_object: bool) -> T:
        """Return what it is where nobody says: the default, but for cloth alone.

        Parameters
        ----------
        of_object : bool
            Whether the scene is one of an object that is no cloth.

        Returns
        -------
        T
            None where that is automatic.
        """
        return None if of_object and self.automatic else self.default  # type: ignore[return-value]

    def is_automatic(self, value: Any) -> bool:
        """Return whether a user's value is the word for an automatic one.

        Parameters
        ----------
        value : object
            Whatever a user gave.

        Returns
        -------
        bool
            Never where nothing is automatic.
        """
        return bool(self.automatic) and isinstance(value, str) and value.strip() == AUTOMATIC

    @property
    def allowed(self) -> str:
        """What is accepted, in words."""
        return f'{self.form}, or "{AUTOMATIC}"' if self.automatic else self.form

    @property
    def form(self) -> str:
        """What is accepted beside `AUTOMATIC`, in words."""
        return self.annotation

    def show(self, value: T) -> str:
        """Return a value as a user would write it.

        Parameters
        ----------
        value : T
            A stored value.

        Returns
        -------
        str
            With a handy unit; for None `AUTOMATIC`, and what it stands for.
        """
        if value is None:
            return f"{AUTOMATIC} ({self.automatic})" if self.automatic else ""
        return self.text(value)

    def text(self, value: T) -> str:
        """Return a value that is not None as a user would write it.

        Parameters
        ----------
        value : T
            A stored value.

        Returns
        -------
        str
            With a handy unit.
        """
        return str(value)

    def tell(self, value: T) -> str:
        """Return a figure that was found, for people.

        Parameters
        ----------
        value : T
            As it would be stored.

        Returns
        -------
        str
            As `show`; of a number to four digits, and in the unit of the trade beside.
        """
        return self.show(value)

    def join(self, others: Mapping[str, Parameter[Any]]) -> None:
        """Say in words when this parameter counts, once all of its class are there.

        Parameters
        ----------
        others : mapping of str to Parameter
            By name.
        """
        self.counts = " and ".join(
            f"{key} is {_listed(others[key], values)}" for key, values in self.when.items()
        )
        self.__doc__ = self.describe()

    def describe(self) -> str:
        """Return help, condition, range and default.

        Returns
        -------
        str
            One paragraph.
        """
        when = f" Counts where {self.counts}." if self.counts else ""
        return f"{self.help}{when} Allowed: {self.allowed}. Default: {self.usually}."

    @property
    def usually(self) -> str:
        """The default, in words."""
        of_object = f"; of an object {AUTOMATIC}" if self.automatic and not self.optional else ""
        return self.show(self.default) + of_object


class Parameterised:
    """A class with declared parameters: keyword-only constructor, checked properties, no others."""

    #: Name of the section of a scene file that configures this class.
    section: ClassVar[str] = ""
    #: The declared parameters by name, in the order of declaration.
    parameters: ClassVar[dict[str, Parameter[Any]]] = {}
    #: Other names of parameters that users may write: the name of each parameter by its synonym.
    synonyms: ClassVar[Mapping[str, str]] = MappingProxyType({})

    #: The values that automatic parameters got in the last run, by name.
    in_use: Mapping[str, Any] = MappingProxyType({})

    #: The values that are not the defaults, by name.
    _values: dict[str, Any]
    #: The names that a scene has set, to whatever value.
    _written: set[str]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = {name: p for name, p in vars(cls).items() if isinstance(p, Parameter)}
        cls.parameters = {}
        for base in cls.__bases__:
            cls.parameters |= getattr(base, "parameters", {})
        cls.parameters |= own
        for parameter in own.values():
            parameter.join(cls.parameters)
        cls.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [
                inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=p.default)
                for name, p in cls.parameters.items()
            ]
        )
        if "__doc__" in vars(cls) and cls.__doc__ and cls.parameters:
            cls.__doc__ = _with_parameters(cls.__doc__, cls.parameters)

    def __init__(self, **values: Any) -> None:
        self._values = {}
        self._written = set()
        self.configure(**values)

    def configure(self, **values: Any) -> None:
        """Set several parameters at once; if one of them is refused, none is set.

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

    def write(self, name: str, value: Any) -> None:
        """Set a parameter as a scene or the command line does.

        Parameters
        ----------
        name : str
            Its name.
        value : object
            As a scene file has it; a number without a unit must be plausible in SI.
        """
        self.parameter(name).require_plausible(value)
        self.configure(**{name: value})
        self._written.add(name)

    @property
    def given(self) -> dict[str, Any]:
        """The values that somebody has given, by name: also defaults, where a scene says so."""
        # In this order, whatever order they were set in.
        names = [name for name in self.parameters if name in self._values or name in self._written]
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}

    @classmethod
    def parameter(cls, name: str) -> Parameter[Any]:
        """Return the declaration of a parameter.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Parameter
            The declaration.

        Raises
        ------
        UnknownNameError
            If there is none of that name; the message lists those that are.
        """
        name = cls.synonyms.get(name, name)
        if name not in cls.parameters:
            raise UnknownNameError(
                f"{cls.__name__} has no parameter of that name",
                key=name,
                allowed=", ".join(cls.parameters),
                cure=suggestion(name, cls.parameters),
            )
        return cls.parameters[name]

    @classmethod
    def usual(cls, of_object: bool) -> dict[str, Any]:
        """Return the values that are not the defaults where nobody says.

        Parameters
        ----------
        of_object : bool
            As for `Parameter.usual`.

        Returns
        -------
        dict of str to object
            By name; empty for cloth.
        """
        every = {name: (p.usual(of_object), p.default) for name, p in cls.parameters.items()}
        return {name: usual for name, (usual, default) in every.items() if usual != default}

    def idle(self, name: str) -> str:
        """Return why a parameter counts for nothing at present.

        Parameters
        ----------
        name : str
            Of the parameter.

        Returns
        -------
        str
            The value of another one that is to blame, in words; empty where it counts.
        """
        for key, values in self.parameter(name).when.items():
            value = getattr(self, key)
            if value not in values if values else value is None:
                return f"{key} is {_listed(self.parameters[key], [value])}"
        return ""

    @property
    def settings(self) -> dict[str, Any]:
        """The value of every parameter, by name."""
        return {name: getattr(self, name) for name in self.parameters}

    def __setattr__(self, name: str, value: Any) -> None:
        # Private names are the class's own; public ones must exist, or a misspelt parameter
        # would become a new attribute and be ignored.
        if not name.startswith("_") and not hasattr(type(self), name):
            self.parameter(name)
        super().__setattr__(name, value)

    def _parameter_changed(self) -> None:
        """Do what a changed parameter asks for; nothing by default."""


def _listed(parameter: Parameter[Any], values: Sequence[Any]) -> str:
    """Return values of a parameter in words: those left out, where these are fewer."""
    if not values:
        return "given"
    choices = getattr(parameter, "choices", ())
    others = [choice for choice in choices if choice not in values]
    if choices and len(others) < len(values):
        words = [f'"{word}"' for word in others]
        return f"not {words[0]}" if len(words) == 1 else f"neither {' nor '.join(words)}"
    if choices:
        return " or ".join(f'"{word}"' for word in values)
    return " or ".join(AUTOMATIC if value is None else parameter.show(value) for value in values)


def suggestion(name: str, names: Iterable[str]) -> str | None:
    """Return "Did you mean …?" for a misspelt name.

    Parameters
    ----------
    name : str
        The name that is not known.
    names : iterable of str
        The known ones.

    Returns
    -------
    str or None
        The sentence; None where no known name is near.
    """
    near = difflib.get_close_matches(name, list(names), n=1)
    return f'Did you mean "{near[0]}"?' if near else None


def _with_parameters(doc: str, parameters: dict[str, Parameter[Any]]) -> str:
    """Insert a numpydoc Parameters section before the docstring's first section."""
    doc = inspect.cleandoc(doc)
    lines = ["Parameters", "----------"]
    for name, parameter in parameters.items():
        lines.append(
            f"{name} : {parameter.annotation}, default: {parameter.show(parameter.default)}"
        )
        lines.append(f"    {parameter.help}")
        if parameter.counts:
            lines.append(f"    Counts where {parameter.counts}.")
        lines.append(f"    Allowed: {parameter.allowed}.")
    first = re.search(r"^\w[\w ]*\n-{3,}$", doc, flags=re.MULTILINE)
    at = first.start() if first else len(doc)
    section = "\n".join(lines)
    return f"{doc[:at].rstrip()}\n\n{section}\n\n{doc[at:]}".rstrip() + "\n"
