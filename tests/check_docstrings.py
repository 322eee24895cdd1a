"""Check docstrings; exit with 1 and list the faults.

Names that a user imports, and the entries of each kernel, need numpydoc with shapes, units, errors
and source. All others have one line, or none if the name says enough. An entry of a kernel is a
public name that another folder imports.
"""

from __future__ import annotations

import ast
import gc
import importlib
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from numpydoc.validate import validate

import spacemap_vtk
from spacemap_vtk.extensions import BUILT_IN

#: Checks of numpydoc that this project does not use.
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

HERE = Path(spacemap_vtk.__file__).parent
SCRIPTS = Path(__file__).parent.parent / "pipelines"
SCIENCE = {"textile", "cage", "mechanics", "embedding", "laboratory", "unit_cell"}
#: Modules whose public names are all for users or authors of stages.
USERS = {"accessor", "errors", "parameterised", "parameters", "filters.algorithm"}
USERS |= {
    "filters.base",
    "filters.grip",
    "filters.load",
    "filters.obstacle",
    "filters.obstacle_surfaces",
}
USERS |= {"filters.error_estimates", "filters.textile"}
USERS |= {"scenes.presets.apply_preset", "scenes.presets.plan", "scenes.presets.scene_file"}
USERS |= {module.removeprefix("spacemap_vtk.") for module in spacemap_vtk.FILTERS.values()}
#: Modules and names of optional parts, which are imported by name.
PARTS = {
    group: [tuple(value.split(":")) for value in own.values()] for group, own in BUILT_IN.items()
}
#: Modules whose docstrings are the help of commands.
COMMANDS = {"spacemap_vtk.cli", *(module for module, _ in PARTS["commands"])}

Named = ast.FunctionDef | ast.ClassDef


@cache
def modules() -> list[tuple[str, str, ast.Module]]:
    """Return name, folder and syntax tree of each module, without the name of the package."""
    found = []
    for file in sorted(HERE.rglob("*.py")):
        name = ".".join(file.relative_to(HERE).with_suffix("").parts)
        found.append((name, name.rpartition(".")[0].split(".")[0], ast.parse(file.read_text())))
    return found


def imported(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield module and name of all imports from the package, also of attributes of modules."""
    prefix = "spacemap_vtk."
    modules_by_name, attributes = {}, []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(prefix):
            for alias in node.names:
                yield str(node.module)[len(prefix) :], alias.name
                modules_by_name[alias.asname or alias.name] = f"{node.module}.{alias.name}"[
                    len(prefix) :
                ]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            attributes.append((node.value.id, node.attr))
    yield from (
        (modules_by_name[owner], name) for owner, name in attributes if owner in modules_by_name
    )


def documented() -> set[tuple[str, str]]:
    """Return module and name of all objects that need full documentation."""
    found = {
        (module, name)
        for _, folder, tree in modules()
        for module, name in imported(tree)
        if module.split(".")[0] in SCIENCE - {folder}
    }
    kernels = {(module.removeprefix("spacemap_vtk."), name) for module, name in PARTS["maps"]}
    found |= {each for each in kernels if each[0].split(".")[0] in SCIENCE}
    for script in SCRIPTS.rglob("*.py"):
        found.update(imported(ast.parse(script.read_text())))
    return found


def faults() -> Iterator[str]:
    """Yield the faults of all docstrings."""
    entries = documented()
    for module, _, tree in modules():
        for node in tree.body:
            if not isinstance(node, Named):
                continue
            public = not node.name.startswith("_")
            full = public and (module in USERS or (module, node.name) in entries)
            yield from _check_one(module, node.name, node, full)
            for inner in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(inner, Named):
                    # What overrides a documented method, or one of VTK's, keeps its contract.
                    shown = full and inner.name[0].islower()
                    shown = shown and not _inherited(module, node.name, inner.name)
                    yield from _check_one(module, f"{node.name}.{inner.name}", inner, shown)


def _inherited(module: str, owner: str, name: str) -> bool:
    cls = getattr(importlib.import_module(f"spacemap_vtk.{module}"), owner)
    bases = [b for b in cls.__mro__[1:] if b.__module__.startswith("spacemap_vtk")]
    return any(name in vars(base) for base in bases)


def _check_one(module: str, name: str, node: Named, full: bool) -> Iterator[str]:
    text = ast.get_docstring(node, clean=False)
    if text is not None and full:
        for code, what in validate(f"spacemap_vtk.{module}.{name}")["errors"]:
            # A subclass's and a record's parameters are described by the base class and the fields;
            # a declared parameter `self` is none for numpydoc.
            stated = code == "PR01" or (code == "PR02" and what.endswith("{'self'}"))
            if code not in IGNORED and not (stated and name[:1].isupper()):
                yield f"{module}.{name}: {code} {what}"
    elif full and "." not in name:
        yield f"{module}.{name}: imported by users or another folder, but has no docstring"
    elif text is not None and "\n" in text.strip() and not _is_command(module):
        yield f"{module}.{name}: the docstring must be one line"


def _is_command(module: str) -> bool:
    return any(f"spacemap_vtk.{module}.".startswith(f"{place}.") for place in COMMANDS)


if __name__ == "__main__":
    gc.disable()  # it would go through all trees again and again
    wrong = list(faults())
    print("\n".join(wrong) or "docstrings: no faults")
    sys.exit(bool(wrong))
