"""Pages of the site that the program knows best: parameters, commands, formats, API, gallery."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import check_docstrings

from spacemap_vtk import FILTERS
from spacemap_vtk.cli.main import app
from spacemap_vtk.cli.reports import format_default
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.io import registry
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.chain import sections

ROOT = Path(__file__).parents[1]
_ROOMS = {"textile": "Textile", "cage": "Cage", "mechanics": "Mechanics", "embedding": "Embedding"}


def write(folder: Path) -> None:
    """Write all pages into a folder, those alone that are new."""
    folder.mkdir(exist_ok=True)
    pages = {
        "parameters": parameters(),
        "commands": commands(),
        "formats": formats(),
        "stages": stages(),
        "kernels": kernels(),
        "gallery": gallery(folder),
    }
    for name, lines in pages.items():
        text = "\n".join(lines) + "\n"
        file = folder / f"{name}.md"
        if not file.is_file() or file.read_text("utf-8") != text:
            file.write_text(text, "utf-8")


def _cell(text: str) -> str:
    """Return a text as a cell of a table."""
    return re.sub(r"([|<*_\[\]])", r"\\\1", " ".join(text.split()))


def parameters() -> Iterator[str]:
    """Yield every key of scene files, section by section."""
    yield "# Every parameter\n"
    yield "What a scene file can say, as `spacemap keys` tells it. The same names are keywords in"
    yield "Python, fields in the window and in ParaView, and follow `--set` on the command line.\n"
    for section, owner in sections().items():
        yield f"## [{section}]\n\n{(owner.__doc__ or '').strip().splitlines()[0]}\n"
        yield "| key | default | is | allowed |\n|---|---|---|---|"
        for key, parameter in owner.parameters.items():
            counts = f" Used only if {parameter.counts}." if parameter.counts else ""
            default, _, stands_for = format_default(parameter).partition("  # ")
            shown = f"`{default}`" + (f" ({_cell(stands_for)})" if stands_for else "")
            told = _cell(parameter.help + counts)
            yield f"| `{key}` | {shown} | {told} | {_cell(parameter.allowed)} |"
        yield ""


def commands() -> Iterator[str]:
    """Yield what `--help` says of every command."""
    text = app.generate_docs(output_format="markdown")
    _, begin, rest = text.partition("## spacemap render")
    yield "# Every command\n\nThis is what `--help` says.\n"
    yield re.sub(r"^```console$", "```text", begin + rest, flags=re.M)


def formats() -> Iterator[str]:
    """Yield which files are read and written."""
    yield "# Every file format\n"
    yield "What each of them contains: [](../reference/files.md).\n\n## Read\n"
    yield "| endings | format | holds |\n|---|---|---|"
    for kind in registry.READ:
        for reader in registry.readers(kind):
            yield f"| {_endings(reader.endings)} | {_cell(reader.label)} | {kind} |"
    yield "\n## Written\n\n| endings | format | holds |\n|---|---|---|"
    for kind, words in {**registry.DATA, **registry.DRAWN}.items():
        for writer in registry.writers(kind):
            if writer.holds[0] == kind:
                held = words if kind in registry.DATA else kind
                yield f"| {_endings(writer.endings)} | {_cell(writer.label)} | {_cell(held)} |"


def _endings(endings: tuple[str, ...]) -> str:
    return ", ".join(f"`{ending}`" for ending in endings)


def stages() -> Iterator[str]:
    """Yield the filters' classes, and what connects them."""
    yield "# Filters in Python\n\nVTK algorithms, as in `from spacemap_vtk import WeaveSource`.\n"
    named = {name: ("class", f"{module}.{name}") for name, module in FILTERS.items()}
    named |= {
        "connect": ("function", "spacemap_vtk.filters.base.connect"),
        "What all filters have": ("class", "spacemap_vtk.filters.base.Stage"),
        "Loads": ("module", "spacemap_vtk.filters.load"),
        "On PyVista's meshes": ("module", "spacemap_vtk.accessor"),
        "Errors": ("module", "spacemap_vtk.errors"),
    }
    for title, (kind, name) in named.items():
        yield f"## {title}\n\n{_documented(kind, name)}"


def _documented(kind: str, name: str) -> str:
    """Return what takes in a docstring, which is of reStructuredText; of a filter that is all."""
    alone = "   :no-members:\n" if kind == "class" and name.split(".")[-1] in FILTERS else ""
    return f"```{{eval-rst}}\n.. auto{kind}:: {name}\n{alone}```\n"


def kernels() -> Iterator[str]:
    """Yield the entries of the science: arrays in, arrays out."""
    yield "# Kernels\n\nThe science apart from VTK: NumPy arrays go in, NumPy arrays come out.\n"
    entries: dict[str, list[str]] = {}
    public = {
        (module, node.name)
        for module, _, tree in check_docstrings.modules()
        for node in tree.body
        if isinstance(node, check_docstrings.Named)
    }
    for module, name in sorted(check_docstrings.documented() & public):
        if module.partition(".")[0] in _ROOMS and not name.startswith("_"):
            entries.setdefault(module, []).append(name)
    for room, title in _ROOMS.items():
        yield f"## {title}\n"
        for module, names in entries.items():
            if module.partition(".")[0] == room:
                yield f"### {module}\n"
                for name in names:
                    kind = "class" if name[:1].isupper() else "function"
                    yield _documented(kind, f"spacemap_vtk.{module}.{name}")


def gallery(folder: Path) -> Iterator[str]:
    """Yield the scenes that come with the program, with the pictures that they make."""
    yield "# Gallery\n"
    yield "Each picture is its scene's, drawn by `python -m spacemap_vtk.draw.thumbnails`; a test"
    yield "asks each for a number that is known from elsewhere (`tests/test_scenes.py`).\n"
    for kind, names in library.kinds().items():
        yield f"## {kind[:1].upper()}{kind[1:]}\n"
        for name in names:
            shutil.copy(thumbnails.file_of(name), folder / f"{name}.jpg")
            yield f"### {name}\n\n{thumbnails.title_of(name)}\n\n![{name}]({name}.jpg)\n"
            yield f"```sh\nspacemap render {name} -o {name}.png\n```\n"
    yield "## Pipelines\n\nScripts to start from; a test runs each.\n"
    for script in sorted((ROOT / "pipelines").glob("*.py")):
        code = script.read_text("utf-8")
        head = code.split('"""')[1].strip().splitlines()[0]
        yield f"### {script.name}\n\n{head}\n\n```{{literalinclude}} ../../pipelines/{script.name}"
        yield ":language: python\n```\n"
