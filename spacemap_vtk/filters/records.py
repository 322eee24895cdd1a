"""Parameters whose value is a list of records: tables of keys, each with a declaration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.formats.toml import format_value, parse_toml
from spacemap_vtk.parameters import Parameter, Parameterised


class Record(Parameterised):
    """Values that belong together and cannot be changed, such as those of a load."""

    #: What the record is, in messages, and its plural.
    noun, nouns = "record", "records"
    _sealed = False

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self.complete()
        self._sealed = True

    def complete(self) -> None:
        """Check the values together, and derive others from them."""

    @property
    def identity(self) -> Any:
        """What equal records have in common besides their values, such as a file's content."""
        return None

    def __setattr__(self, name: str, value: Any) -> None:
        if self._sealed:
            raise InputError(
                f"a {self.noun} cannot be changed",
                key=name,
                cure=f"Assign a new list of {self.nouns} instead",
            )
        super().__setattr__(name, value)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Record)
            and type(self) is type(other)
            and self._values == other._values
            and self.identity == other.identity
        )

    def __hash__(self) -> int:
        return hash(tuple(sorted(self._values.items())))

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self._values.items())
        return f"{type(self).__name__}({values})"


class Records(Parameter[tuple[Any, ...]]):
    """Any number of records, given as such, as tables of their keys, or as a text in TOML."""

    #: Class of each item; it declares the keys.
    record: type[Record] = Record

    def check(self, value: Any) -> tuple[Any, ...]:
        """Convert to checked records; an error names record and key, without the list."""
        try:
            return self.convert(value)
        except InputError as error:
            error.key = self.name + (error.key or "")
            if error.key == self.name and error.allowed is None:
                error.allowed = self.allowed
            raise

    def convert(self, value: Any) -> tuple[Any, ...]:
        """Convert to checked records."""
        if isinstance(value, str):
            value = _parse_text(value)
        if isinstance(value, (self.record, Mapping)):
            value = [value]
        if not isinstance(value, Iterable):
            raise InputError(f"must be a list of {self.record.nouns}")
        records = []
        for number, item in enumerate(value):
            if isinstance(item, self.record):
                records.append(item)
            elif isinstance(item, Mapping):
                try:
                    records.append(self.record(**item))
                except InputError as error:
                    error.key = f"[{number}]" + (f".{error.key}" if error.key else "")
                    raise
            else:
                raise InputError(
                    f"this is not a {self.record.noun}",
                    key=f"[{number}]",
                    value=item,
                    allowed=self.item_allowed,
                )
        return tuple(records)

    @property
    def item_allowed(self) -> str:
        """What an item of the list may be, in words."""
        return f"a table of {', '.join(self.record.parameters)}"

    def resolve_path(self, value: Any, folder: Path) -> Any:
        """Resolve the files of records against a folder."""
        if isinstance(value, Mapping):
            declared = self.record.parameters
            return {
                key: declared[key].resolve_path(v, folder) if key in declared else v
                for key, v in value.items()
            }
        return [self.resolve_path(v, folder) for v in value] if isinstance(value, list) else value

    def text(self, value: tuple[Any, ...]) -> str:
        """Format the records as in TOML."""
        return format_value([record._values for record in value])


def _parse_text(text: str) -> Any:
    try:
        return parse_toml(f"value = {text or '[]'}")["value"]
    except ValueError as error:
        raise InputError(f"not a list of tables: {error}") from None
