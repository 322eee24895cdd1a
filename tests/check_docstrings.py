"""Validate every public docstring against numpydoc; exit 1 and list what is wrong."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
import sys
from collections.abc import Iterator

from numpydoc.validate import validate

import spacemap_vtk

#: Style that this project does not follow; every other check of numpydoc holds.
IGNORED = {
    "ES01",  # an extended summary is for what needs one
    "EX01",  # likewise an example
    "SA01",  # names in the text do for See Also
    "GL01",  # the summary starts on the quotes' line
    "PR08",  # a description may start with a symbol, lower case
    "PR09",  # and may be a phrase, without a full stop
    "RT02",  # a single return value may have a name
    "RT03",  # a return value's name and type may say all
    "RT04",
    "RT05",
}


def public() -> Iterator[str]:
    """Yield the dotted name of every public function, class and method."""
    for info in pkgutil.walk_packages(spacemap_vtk.__path__, "spacemap_vtk."):
        if "library" in info.name or info.name.endswith("__main__"):
            continue
        # The window's modules import Qt, which only the extra [qt] brings.
        if "spacemap_vtk.app" in info.name and importlib.util.find_spec("PySide6") is None:
            continue
        module = importlib.import_module(info.name)
        if not info.ispkg:  # numpydoc finds no line to point at in a package
            yield info.name
        for name, thing in vars(module).items():
            if name.startswith("_") or getattr(thing, "__module__", "") != info.name:
                continue
            if inspect.isfunction(thing):
                yield f"{info.name}.{name}"
            elif inspect.isclass(thing):
                yield f"{info.name}.{name}"
                for method, value in vars(thing).items():
                    # What overrides a documented method keeps that method's contract.
                    inherited = any(hasattr(base, method) for base in thing.__bases__)
                    if not method.startswith("_") and inspect.isfunction(value) and not inherited:
                        yield f"{info.name}.{name}.{method}"


def _elsewhere(name: str) -> bool:
    """Return whether parameters are described elsewhere than in the docstring.

    A command's options are described by their annotations, which make its help; a subclass's and
    a record's by the base class and the fields.
    """
    last = name.rpartition(".")[2]
    return name.startswith("spacemap_vtk.cli.") or last[:1].isupper()


def main() -> None:
    """Print every fault."""
    faults = [
        f"{name}: {code} {text}"
        for name in public()
        for code, text in validate(name)["errors"]
        if code not in IGNORED and not (code == "PR01" and _elsewhere(name))
    ]
    print("\n".join(faults) or "docstrings: all valid")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
