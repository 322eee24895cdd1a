"""The guides for contributors are followed word by word, in a copy of the program."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
#: The two programs that the guides call.
_AS = {"spacemap": "-c 'from spacemap_vtk.cli.main import main; main()'", "python": ""}
PAGES = ROOT / "docs" / "contributing"
_BLOCK = re.compile(r"(?:In `(?P<file>[\w/.]+)`[^`]*?)?```(?P<kind>\w+)\n(?P<text>.*?)```", re.S)


def apply(file: Path, diff: str) -> None:
    """Insert lines marked with + after the line before them, which must exist."""
    lines = diff.splitlines()
    before = "".join(f"{line[1:]}\n" for line in lines if line[0] == " ")
    text = file.read_text("utf-8")
    assert text.count(before) == 1
    after = "".join(f"{line[1:]}\n" for line in lines)
    file.write_text(text.replace(before, after), "utf-8")


@pytest.mark.nightly
@pytest.mark.parametrize(
    "page",
    [
        "add_a_scene",
        "add_a_format",
        "add_a_stage",
    ],
)
def test_a_guide_can_be_followed(page: str, tmp_path: Path) -> None:
    for part in ("spacemap_vtk", "scenes"):
        ignored = shutil.ignore_patterns("*.pyc.*")  # what others are just writing
        shutil.copytree(ROOT / part, tmp_path / part, ignore=ignored)
    (tmp_path / "tests").mkdir()
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for name in ("spacemap", "python"):
        (tmp_path / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {_AS[name]} "$@"\n')
        (tmp_path / name).chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(tmp_path)}
    commands = 0
    for block in _BLOCK.finditer((PAGES / f"{page}.md").read_text("utf-8")):
        kind, text = block["kind"], block["text"]
        if kind == "sh":
            done = subprocess.run(
                ["bash", "-euc", text],
                cwd=tmp_path,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stdout + done.stderr
            commands += 1
        elif kind == "diff":
            apply(tmp_path / block["file"], text)
        else:
            assert not (tmp_path / block["file"]).exists()
            (tmp_path / block["file"]).write_text(text, "utf-8")
    assert commands == 2 + (page == "add_a_scene")
    pictures = {"add_a_scene": "canvas", "add_a_format": "cloth", "add_a_stage": "wave"}
    assert (tmp_path / f"{pictures[page]}.png").stat().st_size > 1000
    # The code in the guides passes the checks of the gate.
    new = [
        str(file)
        for file in tmp_path.rglob("*.py")
        if not (ROOT / file.relative_to(tmp_path)).exists()
    ]
    assert new
    for words in (["check"], ["format", "--check"]):
        subprocess.run([sys.executable, "-m", "ruff", *words, "-q", *new], check=True, cwd=tmp_path)


def test_the_set_up_page_and_the_gate_agree() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    gate = (ROOT / ".ci" / "run").read_text("utf-8")
    text = (PAGES / "set_up.md").read_text("utf-8")
    tools = text.split("seconds:")[1].split("```")[1]
    for line in tools.splitlines()[1:]:
        assert line.removeprefix(".venv/bin/") in gate
    assert "\n".join(text.split("tests:\n\n```sh\n")[1].splitlines()[:1]) in readme
