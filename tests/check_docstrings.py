"""Validate every public docstring against numpydoc; exit 1 and list what is wrong."""

from __future__ import annotations

import importlib
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
    "SA01",  # See Also: names in the text do
    "GL01",  # the summary starts on the quotes' line
    "GL02",
    "GL03",
    "PR01",  # parameters of a descriptor protocol or VTK override are VTK's
    "PR02",  # class docstrings made from declared parameters are tested by themselves
    "PR06",
    "PR08",  # a description may start with a formula
    "PR09",
    "RT02",  # one unnamed return value may carry its type only
    "RT03",
    "RT04",
    "RT05",
    "SS03",
    "SS05",
    "SS06",
    "YD01",
}


def public() -> Iterator[str]:
    """Yield the dotted name of every public function, class and method."""
    for info in pkgutil.walk_packages(spacemap_vtk.__path__, "spacemap_vtk."):
        if "library" in info.name or info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        yield info.name
        for name, thing in vars(module).items():
            if name.startswith("_") or getattr(thing, "__module__", "") != info.name:
                continue
            if inspect.isfunction(thing):
                yield f"{info.name}.{name}"
            elif inspect.isclass(thing):
                yield f"{info.name}.{name}"
                for method, value in vars(thing).items():
                    if not method.startswith("_") and inspect.isfunction(value):
                        yield f"{info.name}.{name}.{method}"


def main() -> None:
    """Print every fault."""
    faults = [
        f"{name}: {code} {text}"
        for name in public()
        for code, text in validate(name)["errors"]
        if code not in IGNORED
    ]
    print("\n".join(faults) or "docstrings: all valid")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
