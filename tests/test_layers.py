"""Imports go down the layers only, without cycles; the science imports no VTK and opens no file.

Read from the source alone, imports under ``TYPE_CHECKING`` and within functions among them.
"""

from __future__ import annotations

import ast
import gc
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "spacemap_vtk"

#: The rooms from the highest layer to the lowest; those of a line are of one height.
LAYERS = (
    ("__main__",),
    ("cli", "app", "paraview"),
    ("jobs",),
    ("draw",),
    ("scenes",),
    # The package's own names, and PyVista's accessor, stand for the filters.
    ("", "accessor"),
    ("filters",),
    ("io",),
    ("datasets",),
    ("laboratory", "unit_cell"),
    ("textile", "cage", "mechanics", "embedding"),
    # All other modules at the top level.
    ("errors",),
)
#: What opens no window and reads no file: arrays go in and come out.
SCIENCE = {"textile", "cage", "mechanics", "embedding", "laboratory", "unit_cell"}
#: From one room into another one of its height. The science's rooms may, in no circle.
BESIDE = {
    "cli.window -> app": "the command that opens the window",
    "cli.serve -> app": "the command of an optional part",
    "paraview.command -> cli": "a command of an optional part",
}
#: The modules and packages of each optional part. The core reaches them by registries only: the
#: groups of `spacemap_vtk.extensions`, and the formats, which register themselves.
OPTIONAL = {
    "browser": ("spacemap_vtk.app.web", "spacemap_vtk.cli.serve"),
    "ParaView": ("spacemap_vtk.paraview",),
    "ray tracing": ("spacemap_vtk.draw.raytrace",),
    "smooth map": ("spacemap_vtk.embedding.smooth", "spacemap_vtk.embedding.worsey_farin"),
    "decks of other solvers": (
        "spacemap_vtk.io.formats.abaqus",
        "spacemap_vtk.scenes.input_deck",
    ),
    "USD": ("spacemap_vtk.io.formats.usd",),
    "weaving programs": (
        "spacemap_vtk.io.formats.weaving_programs",
        "spacemap_vtk.io.drafts.dtx",
        "spacemap_vtk.io.drafts.wpo",
    ),
}
#: Modules of the science that touch files.
FILES = {
    "cage.tetwild": "hands a surface to another process, through a folder that goes with it",
}


@cache
def modules() -> dict[str, ast.Module]:
    """Return the tree of each module by its name below the package."""
    found = {}
    gc.disable()  # it would go through all trees with each tree that is added
    for file in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(file.relative_to(PACKAGE).with_suffix("").parts)
        name = name.removesuffix("__init__").rstrip(".")
        found[name] = ast.parse(file.read_text(encoding="utf-8"))
    gc.enable()
    return found


@pytest.fixture(autouse=True, scope="module")
def forgotten() -> Iterator[None]:
    """Let go of the trees: 700,000 objects that the tests after these would look through."""
    yield
    modules.cache_clear()
    arrows.cache_clear()


@cache
def arrows() -> dict[str, set[str]]:
    """Return what each module imports of the package."""
    found: dict[str, set[str]] = {name: set() for name in modules()}
    for module, tree in modules().items():
        for name in _imported(tree):
            whole = name.removeprefix("spacemap_vtk").removeprefix(".")
            # `from spacemap_vtk.cage import lattice` names a module, `... import Real` does not.
            target = whole if whole in modules() else whole.rpartition(".")[0]
            if target in modules() and target != module:
                found[module].add(target)
    return found


def _imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] == "spacemap_vtk")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("spacemap_vtk"):
            yield from (f"{node.module}.{a.name}" for a in node.names)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            # What is imported by its name, as commands are.
            name = node.args[0].value
            if isinstance(name, str) and name.startswith("spacemap_vtk."):
                yield name


def room(module: str) -> str:
    first = module.split(".")[0]
    return first if any(first in layer for layer in LAYERS) else "errors"


def height(module: str) -> int:
    return next(n for n, layer in enumerate(reversed(LAYERS)) if room(module) in layer)


def circles(graph: dict[str, set[str]]) -> list[str]:
    """Return the sets of nodes from each of which every other can be reached."""
    reached = {node: _reached(node, graph) for node in graph}
    together = {
        frozenset(other for other in reached[node] if node in reached[other])
        for node in graph
        if node in reached[node]
    }
    return sorted(" <-> ".join(sorted(circle)) for circle in together)


def _reached(start: str, graph: dict[str, set[str]]) -> set[str]:
    found: set[str] = set()
    waiting = [*graph[start]]
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += graph[node]
    return found


def upward() -> list[str]:
    return [
        f"{module} -> {target}"
        for module, targets in arrows().items()
        for target in sorted(targets)
        if height(module) < height(target)
        or (
            height(module) == height(target)
            and room(module) != room(target)
            and not {room(module), room(target)} <= SCIENCE
            and f"{module} -> {room(target)}" not in BESIDE
        )
    ]


def circles_of_modules() -> list[str]:
    return circles(arrows())


def circles_of_rooms() -> list[str]:
    """Of the science's; between the others none is left by `upward`."""
    graph: dict[str, set[str]] = {name: set() for name in SCIENCE}
    for module, targets in arrows().items():
        if room(module) in SCIENCE:
            graph[room(module)] |= {room(t) for t in targets} & SCIENCE - {room(module)}
    return circles(graph)


def science_with_vtk() -> list[str]:
    return [
        f"{module} imports {name}"
        for module, tree in modules().items()
        if room(module) in SCIENCE
        for node in ast.walk(tree)
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [a.name for a in node.names]
            if isinstance(node, ast.Import)
            else []
        )
        if name.split(".")[0] in ("vtk", "vtkmodules", "pyvista", "PySide6")
    ]


def science_with_files() -> list[str]:
    touching = {"open", "read_text", "read_bytes", "write_text", "write_bytes"}
    numpys = {"load", "save", "savez", "loadtxt", "savetxt", "genfromtxt", "fromfile", "tofile"}
    found = []
    for module, tree in modules().items():
        if room(module) not in SCIENCE or module in FILES:
            continue
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call):
                continue
            called = node.func
            name = called.id if isinstance(called, ast.Name) else getattr(called, "attr", "")
            owner = getattr(getattr(called, "value", None), "id", "")
            if name in touching or (owner == "np" and name in numpys):
                found.append(f"{module} calls {name}")
    return sorted(set(found))


def optional_part_of(module: str) -> str | None:
    name = f"spacemap_vtk.{module}"
    return next(
        (
            part
            for part, roots in OPTIONAL.items()
            for root in roots
            if name == root or name.startswith(f"{root}.")
        ),
        None,
    )


def imports_of_optional_parts() -> list[str]:
    """Return what imports a module of an optional part, other than that part itself."""
    return [
        f"{module} -> {target}"
        for module, targets in arrows().items()
        for target in sorted(targets)
        if (part := optional_part_of(target)) and part != optional_part_of(module)
    ]


RULES = (
    upward,
    imports_of_optional_parts,
    circles_of_modules,
    circles_of_rooms,
    science_with_vtk,
    science_with_files,
)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_nothing_breaks_the_rule(rule):
    assert rule() == []


def test_what_is_listed_is_there():
    """A list that says more than is so would let it come back unseen."""
    assert sorted(FILES.keys() - modules().keys()) == []
    roots = {root.removeprefix("spacemap_vtk.") for each in OPTIONAL.values() for root in each}
    assert sorted(roots - modules().keys()) == []
    for line in BESIDE:
        module, target = line.split(" -> ")
        assert target in {room(name) for name in arrows()[module]}, line


def test_a_circle_is_seen():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}
    assert circles(graph) == ["a <-> b <-> c"]


#: Packages whose module has another name.
DISTRIBUTIONS = {
    "PIL": "pillow",
    "PySide6": "PySide6_Essentials",
    "imageio_ffmpeg": "imageio-ffmpeg",
    "pxr": "usd-core",
    "trame_client": "trame-client",
    "vtkmodules": "vtk",
}
#: Imported packages that setup.cfg cannot or need not name.
UNDECLARED = {
    "llvmlite": "numba brings the version of it that it needs",
    "paraview": "ParaView's own Python has it",
    "pypardiso": "a solver that is used where a user has installed it",
    "shiboken6": "PySide6 brings the version of it that it needs",
    "sksparse": "a solver that is used where a user has installed it",
}


def imported_packages() -> set[str]:
    """Return the packages that the program imports, by statement or by name."""
    found = set()
    for tree in modules().values():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                found |= {each.name for each in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add(node.module or "")
            elif isinstance(node, ast.Call) and node.args:
                by_name = getattr(node.func, "id", "") in ("import_module", "find_spec")
                name = getattr(node.args[0], "value", "")
                found.add(name if by_name and isinstance(name, str) else "")
    names = {name.partition(".")[0] for name in found}
    return names - set(sys.stdlib_module_names) - {"spacemap_vtk", ""}


def test_imported_packages_are_declared() -> None:
    text = (PACKAGE.parent / "setup.cfg").read_text("utf-8")
    declared = set(re.findall(r"^    ([\w-]+)(?:\[\w+\])? >= ", text, re.M))
    imported = imported_packages()
    assert {DISTRIBUTIONS.get(name, name) for name in imported - UNDECLARED.keys()} <= declared
    assert imported >= UNDECLARED.keys()
