"""The scripts that `spacemap completion` prints work in real shells."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from spacemap_vtk.cli.main import main

#: A command line with an unfinished last word, and the words that the shell offers.
LINES = {
    "spacemap va": ["validate"],
    "spacemap render pl": ["plain_weave"],
    "spacemap render here": ["here.toml"],
    "spacemap render x --triad --sty": ["--style"],
    "spacemap render x --style ": ["blueprint", "paper", "schematic", "studio"],
    "spacemap render x --set modal.elem": [
        "modal.elements=auto",
        "modal.elements=sheet",
        "modal.elements=tetrahedra",
    ],
    "spacemap render x --set weave.warp_cr": ["weave.warp_crimp=", "weave.warp_crimp_height="],
    "spacemap animate x -o here": ["here.toml"],
    "spacemap plot x --quantity v": ["velocity"],
    "spacemap keys ca": ["cage"],
    "spacemap completion f": ["fish"],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the command, a scene and the script of the shell."""
    (tmp_path / "here.toml").touch()
    command = tmp_path / "bin" / "spacemap"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m spacemap_vtk "$@"\n')
    command.chmod(0o755)
    return tmp_path


def run(shell: str, script: str, folder: Path) -> list[list[str]]:
    """Return the words that a script prints for each line, separated by ---."""
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [shell, "-c", script],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    return [sorted(text.split()) for text in done.stdout.split("---\n")[:-1]]


def printed(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit, match="0"):
        main(["completion", shell])
    return capsys.readouterr().out


def test_bash_completes_words(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = printed("bash", capsys)
    script += (
        'offer() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _spacemap;'
        ' printf "%s\\n" "${COMPREPLY[@]}" ---; }\n'
    )
    for line in LINES:
        script += f"offer {' '.join(word or repr('') for word in line.split(' '))}\n"
    assert dict(zip(LINES, run("bash", script, folder), strict=True)) == LINES


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish: apt-get install fish")
def test_fish_completes_words(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "completion.fish").write_text(printed("fish", capsys))
    script = "source completion.fish\n"
    script += "".join(f"complete -C '{line}' | cut -f 1; echo ---\n" for line in LINES)
    assert dict(zip(LINES, run("fish", script, folder), strict=True)) == LINES
