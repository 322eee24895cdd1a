"""What `spacemap completion` prints, in the real shells."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from spacemap_vtk.cli.main import COMMANDS, main

#: What is on the line, the last word unfinished, and what the shell makes of it.
LINES = {
    "spacemap va": ["validate"],
    "spacemap render pl": ["plain_weave"],
    "spacemap render her": ["here is one.toml"],
    "spacemap render x --triad --sty": ["--style"],
    "spacemap render x --style ": ["blueprint", "paper", "schematic", "studio"],
    "spacemap render x --set modal.elem": ["modal.elements="],
    "spacemap animate x -o her": ["here is one.toml"],
    "spacemap plot x --quantity v": ["velocity"],
    "spacemap render x --time ": [],
    "spacemap keys ca": ["cage"],
    "spacemap completion f": ["fish"],
}


def completed(shell: str, script: str, folder: Path) -> str:
    """Run a script in a shell, after what the command prints for it."""
    (folder / "here is one.toml").touch()
    done = subprocess.run(
        [shell, "-c", script], cwd=folder, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout


def test_bash(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["completion", "bash"])
    script = capsys.readouterr().out
    assert script.endswith("complete -F _spacemap spacemap\n")
    # compopt speaks to a line that is being edited
    script += 'compopt() { :; }; tell() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _spacemap;'
    script += ' local IFS=,; echo "${COMPREPLY[*]}"; }\n'
    # As bash takes the line apart.
    lines = [line.split(" ") for line in LINES] + [["spacemap", name, "--he"] for name in COMMANDS]
    lines += [
        ["spacemap", "render", "x", "--set", "modal.elements", "=", "s"],
        ["a", "b", "--style", "="],
    ]
    script += "".join(f"tell {' '.join(w or repr('') for w in words)}\n" for words in lines)
    told = [
        sorted(filter(None, t.split(","))) for t in completed("bash", script, tmp_path).splitlines()
    ]
    assert dict(zip(LINES, told, strict=False)) == LINES
    assert told[len(LINES) : -2] == [["--help"]] * len(COMMANDS)
    assert told[-2:] == [["sheet"], LINES["spacemap render x --style "]]


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish: apt-get install fish")
def test_fish(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["completion", "fish"])
    (tmp_path / "completion.fish").write_text(capsys.readouterr().out)
    script = "source completion.fish\n"
    script += "".join(f"complete -C '{line}'; echo ---\n" for line in LINES)
    told = completed("fish", script, tmp_path).split("---\n")
    found = [sorted(line.split("\t")[0] for line in text.splitlines()) for text in told]
    for line, words in zip(LINES.items(), found, strict=False):
        assert (line[0], words) == line
