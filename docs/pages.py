"""Generate pages of the site from the program: parameters, commands, formats, API, gallery."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import check_docstrings

from spacemap_vtk import FILTERS
from spacemap_vtk.applicability import LIMITS
from spacemap_vtk.cli.main import app
from spacemap_vtk.cli.reports import format_default
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.io import registry
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.pipeline import section_classes

ROOT = Path(__file__).parents[1]
_KERNELS = {
    "textile": "Textile",
    "cage": "Cage",
    "mechanics": "Mechanics",
    "embedding": "Embedding",
    "laboratory": "Laboratory",
}


def write(folder: Path) -> None:
    """Write all pages that have changed into a folder."""
    folder.mkdir(exist_ok=True)
    pages = {
        "parameters": parameters(),
        "commands": commands(),
        "formats": formats(),
        "applicability": applicability(),
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
    yield "All keys of scene files, as `spacemap keys` prints them. The same names are keywords in"
    yield "Python, fields in the window and in ParaView, and follow `--set` on the command line.\n"
    for section, owner in section_classes().items():
        yield f"## [{section}]\n\n{(owner.__doc__ or '').strip().splitlines()[0]}\n"
        yield "| key | default | meaning | allowed |\n|---|---|---|---|"
        for key, parameter in owner.parameters.items():
            counts = f" Used only if {parameter.condition}." if parameter.condition else ""
            default, _, stands_for = format_default(parameter).partition("  # ")
            shown = f"`{default}`" + (f" ({_cell(stands_for)})" if stands_for else "")
            meaning = _cell(parameter.help + counts)
            yield f"| `{key}` | {shown} | {meaning} | {_cell(parameter.allowed)} |"
        yield ""


def commands() -> Iterator[str]:
    """Yield the help of every command."""
    text = app.generate_docs(output_format="markdown")
    _, begin, rest = text.partition("## spacemap render")
    yield "# Every command\n\nThe text of `--help`.\n"
    yield re.sub(r"^```console$", "```text", begin + rest, flags=re.M)


def applicability() -> Iterator[str]:
    """Yield the ranges in which the models of each stage are valid."""
    yield "# What each model can do\n"
    yield "Every model has a range. Stages measure where in it a scene is, and warn if it is"
    yield "beyond. `spacemap info` lists values and limits (in JSON `applicability`). How cloth"
    yield "from its yarns compares with real cloth: [](../explanation/measured_cloth.md).\n"
    for section, owner in section_classes().items():
        limits = [limit for limit in LIMITS.values() if limit.stage == section]
        if not limits:
            continue
        yield f"## [{section}]\n\n{(owner.__doc__ or '').strip().splitlines()[0]}\n"
        for limit in limits:
            yield f"### {limit.model[:1].upper()}{limit.model[1:]}\n"
            yield f"Assumes {limit.assumes}.\n"
            if limit.quantity:
                yield f"- **Valid while:** {limit.quantity}: at most {limit.format(limit.most)}."
                yield f"- **Limit from:** {limit.basis}."
                yield f"- **Beyond it:** {limit.beyond}."
            else:
                yield f"- **Source:** {limit.basis}."
                yield f"- **Therefore:** {limit.beyond}."
            yield f"- **Cure:** {limit.cure}.\n"


def formats() -> Iterator[str]:
    """Yield the formats that are read and written."""
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
    """Yield the classes of the filters, and the functions that connect them."""
    yield "# Filters in Python\n\nVTK algorithms, as in `from spacemap_vtk import WeaveSource`.\n"
    entries = {name: ("class", f"{module}.{name}") for name, module in FILTERS.items()}
    entries |= {
        "connect": ("function", "spacemap_vtk.filters.base.connect"),
        "All filters": ("class", "spacemap_vtk.filters.base.Stage"),
        "Loads": ("module", "spacemap_vtk.filters.load"),
        "PyVista meshes": ("module", "spacemap_vtk.accessor"),
        "Errors": ("module", "spacemap_vtk.errors"),
    }
    for title, (kind, name) in entries.items():
        yield f"## {title}\n\n{_autodoc(kind, name)}"


def _autodoc(kind: str, name: str) -> str:
    """Return a block that includes a docstring; for a filter, without its members."""
    options = "   :no-members:\n" if kind == "class" and name.split(".")[-1] in FILTERS else ""
    return f"```{{eval-rst}}\n.. auto{kind}:: {name}\n{options}```\n"


def kernels() -> Iterator[str]:
    """Yield the public functions of the kernels."""
    yield "# Kernels\n\nScience without VTK: functions from NumPy arrays to NumPy arrays.\n"
    entries: dict[str, list[str]] = {}
    public = {
        (module, node.name)
        for module, _, tree in check_docstrings.modules()
        for node in tree.body
        if isinstance(node, check_docstrings.Named)
    }
    for module, name in sorted(check_docstrings.documented() & public):
        if module.partition(".")[0] in _KERNELS and not name.startswith("_"):
            entries.setdefault(module, []).append(name)
    for folder, title in _KERNELS.items():
        yield f"## {title}\n"
        for module, names in entries.items():
            if module.partition(".")[0] == folder:
                yield f"### {module}\n"
                for name in names:
                    kind = "class" if name[:1].isupper() else "function"
                    yield _autodoc(kind, f"spacemap_vtk.{module}.{name}")


def gallery(folder: Path) -> Iterator[str]:
    """Yield the built-in scenes with their pictures."""
    yield "# Gallery\n"
    yield "The pictures are drawn by `python -m spacemap_vtk.draw.thumbnails`. A test compares each"
    yield "scene with a number from another source (`tests/test_scenes.py`).\n"
    for kind, names in library.names_by_kind().items():
        yield f"## {kind[:1].upper()}{kind[1:]}\n"
        for name in names:
            shutil.copy(thumbnails.file_of(name), folder / f"{name}.jpg")
            yield f"### {name}\n\n{thumbnails.title_of(name)}\n\n![{name}]({name}.jpg)\n"
            yield f"```sh\nspacemap render {name} -o {name}.png\n```\n"
    yield "## Drafts\n"
    yield "Each row: the drawdown, on which a frame shows the near picture; 12, 64 and 320 yarns"
    yield "of the cloth. The files are in `scenes/drafts`; `ORIGIN.md` there names authors and"
    yield "licences: twenty are from public collections, the last five are our own. The pictures"
    yield "are drawn by `python docs/drafts.py`.\n"
    sheets = "weaves of two colours", "colours and tartans", "lace, pattern wefts, double weave"
    for number, what in enumerate(sheets, 1):
        yield f"![Drafts beside their cloth: {what}](../drafts_{number}.jpg)\n"
    yield "## Pipelines\n\nScripts to start from; a test runs each.\n"
    for script in sorted((ROOT / "pipelines").glob("*.py")):
        code = script.read_text("utf-8")
        head = code.split('"""')[1].strip().splitlines()[0]
        yield f"### {script.name}\n\n{head}\n\n```{{literalinclude}} ../../pipelines/{script.name}"
        yield ":language: python\n```\n"
