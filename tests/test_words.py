"""All texts use British spelling; keys and names in code follow VTK."""

from __future__ import annotations

import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
AMERICAN = re.compile(
    # not words in quotes, after a dot, dash or hash, or that are called, assigned or annotated
    r"(?i)(?<![\w.#\-`\"'/{])"
    r"(colors?|colored|coloring|gray|grays|grayed|center|centers|centered|behaviors?|neighbors?"
    r"|(?:milli|centi|kilo)?meters?|fibers?|canceled|labeled|modeled|favor\w*|catalogs?|analog"
    r"|(?!(?:re|over|down)?size|prize|seize)\w+(?:ize|izes|ized|izing|ization)"
    r"|(?:ana|para)lyz\w+)"
    r"\b(?![\w(=.\"'`/]| ?[:=] )"
)


def prose(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of text in a file, with their numbers."""
    if file.suffix != ".py":
        yield from enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        return
    with file.open(encoding="utf-8") as stream:
        for token in tokenize.generate_tokens(stream.readline):
            kind = tokenize.tok_name[token.type]
            # a single word is a key; a style sheet is code
            if kind in ("COMMENT", "STRING", "FSTRING_MIDDLE") and " " in token.string:
                for number, line in enumerate(token.string.splitlines(), token.start[0]):
                    if not re.search(r"[{;]\s*$|;.*\}", line):
                        yield number, line


def american(line: str) -> list[str]:
    return [word for word in AMERICAN.findall(line) if not word.isupper()]


FILES = [
    *(ROOT / "README.md", *(ROOT / "scenes").glob("*.[tm][od]*")),
    # Without the pages that the site's build makes of the texts below.
    *(page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "made"),
    *(ROOT / "pipelines").rglob("*.py"),
    *(ROOT / "spacemap_vtk").rglob("*.py"),
]


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("The color of the warp.", ["color"]),
        ("gray or centered, normalized, of fibers", ["gray", "centered", "normalized", "fibers"]),
        ("The colour of its neighbour; a size of 3", []),
        ('--color, view.color, warp_color, "color" and `color`', []),
        ("color : str", []),
        ('color = "stress"', []),
    ],
)
def test_the_spelling_check_finds_american_words(line: str, found: list[str]) -> None:
    assert american(line) == found


def test_texts_use_british_spelling() -> None:
    assert len(FILES) > 100
    wrong = [
        f"{file.relative_to(ROOT)}:{number}: {word}"
        for file in FILES
        for number, line in prose(file)
        for word in american(line)
    ]
    assert wrong == []


def test_labels_are_spelt_as_words() -> None:
    from spacemap_vtk.filters.modal_solver import ModalSolver
    from spacemap_vtk.scenes.settings import View

    assert View.parameters["cage_color"].label == "Cage colour"
    assert ModalSolver.parameters["youngs_modulus"].label == "Young's modulus"
