"""Counts what docs/promises.md says of the tests, and writes it there: python docs/counts.py."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from spacemap_vtk.io import registry
from spacemap_vtk.scenes import library

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "promises.md"
_BETWEEN = re.compile(r"(?<=<!-- counted -->\n).*?(?=<!-- end -->)", re.S)
#: A test, after its decorators.
_TEST = re.compile(r"((?:^@[^\n]*\n(?:[ )][^\n]*\n)*)*)^def (test_\w+)", re.M)
#: Files of tests by what they begin with, the rest last.
_KINDS = {
    "test_window": "of the window, by keys and mouse",
    "test_cli": "of commands, as they are typed",
    "test_paraview": "of the plugin, in ParaView itself",
    "test_calculix": "beside CalculiX, which solves the same",
    "test_": "of the rest",
}
#: Examples that hypothesis makes where a test says no number.
_EXAMPLES = 100
#: Words by which the verification table names another program.
_PROGRAMS = ("CalculiX", "scikit-fem", "mpmath", "scipy", "VTK", "matrix exponential")


def counted() -> Iterator[tuple[str, int]]:
    """Yield what is counted, in words, and how many there are."""
    kinds: Counter[str] = Counter()
    nightly = random = examples = drafts = 0
    for file in sorted((ROOT / "tests").glob("test_*.py")):
        text = file.read_text("utf-8")
        kind = next(words for begin, words in _KINDS.items() if file.stem.startswith(begin))
        for decorators, name in _TEST.findall(text):
            kinds[kind] += 1
            nightly += "nightly" in decorators
            if "@given" in decorators:
                number = re.search(r"max_examples=(\d+)", decorators)
                made = int(number[1]) if number else _EXAMPLES
                random, examples = random + 1, examples + made
                drafts += made if "draft" in f"{file.stem} {decorators} {name}" else 0
    yield "tests", kinds.total()
    for words in _KINDS.values():
        yield f"– {words}", kinds[words]
    yield "– of all these, those that take minutes", nightly
    yield "– of all these, of statements for random input", random
    yield "random inputs for these in each run", examples
    yield "– of these random drafts, written and read again", drafts
    table = (ROOT / "docs" / "verification.md").read_text("utf-8").splitlines()
    rows = [row.split("|")[3] for row in table if "::" in row]
    yield "numbers from elsewhere that tests hold ([table](verification.md))", len(rows)
    others = sum(any(name in row for name in _PROGRAMS) for row in rows)
    yield "– of these, what another program computes", others
    yield "scenes, each asked for a number that is known", len(library.names())
    yield "scripts to start from, each run", len(list((ROOT / "pipelines").glob("*.py")))
    read = {ending for kind in registry.READ for each in registry.readers(kind)
            for ending in each.endings}  # fmt: skip
    yield "endings of files that are read", len(read)
    kinds_written = [None, *registry.DRAWN]
    yield "endings that are written", len({e for k in kinds_written for e in registry.written(k)})
    gate = (ROOT / ".ci" / "run").read_text("utf-8")
    versions = re.findall(r"versions\+?=\(([^)]*)\)", gate)
    yield "VTKs on which the filters run, beside ParaView's", len(" ".join(versions).split())
    told = (ROOT / "setup.cfg").read_text("utf-8")
    yield "Pythons on which the core runs", len(re.findall(r"Python :: 3\.\d+", told))


def table() -> str:
    """Return it as a table."""
    words = [sys.executable, "-m", "pytest", "--collect-only", "-qm", "", "tests"]
    told = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    (cases,) = re.findall(r"^(\d+) tests collected", told, re.M)
    rows = [f"| {words} | {number:,} |" for words, number in counted()]
    rows[0] += f"\n| – with each of their cases | {int(cases):,} |"
    return "\n".join(["| what | how many, at least |", "|---|--:|", *rows, ""])


def stale() -> list[str]:
    """Return what the page says that is more than there is, or much less."""
    said = dict(re.findall(r"^\| (.*?) \| ([\d,]+) \|$", PAGE.read_text("utf-8"), re.M))
    found = dict(counted())
    return [
        f"{words}: {said.get(words)}, and there are {number}"
        for words, number in found.items()
        if not 0.8 * number <= int(said.get(words, "0").replace(",", "")) <= number
    ]


if __name__ == "__main__":
    PAGE.write_text(_BETWEEN.sub(table(), PAGE.read_text("utf-8")), "utf-8")
