"""The licence is there, and everything that docs/dynamics.md shows is run: commands, scenes."""

from __future__ import annotations

import importlib.metadata
import re
import shlex
from pathlib import Path

import pytest

from spacemap_vtk.cli.main import main
from spacemap_vtk.filters.load import ACTIONS, TIMES, Load
from spacemap_vtk.scenes.scene import Scene

TEXT = (Path(__file__).parents[1] / "docs" / "dynamics.md").read_text("utf-8")


def test_the_licence_comes_with_the_package() -> None:
    package = importlib.metadata.distribution("spacemap_vtk")
    (name,) = package.metadata.get_all("License-File") or ["missing"]
    file = next(file for file in package.files or () if file.name == name)
    assert file.read_text().startswith(f"{package.metadata['License']} License\n")


def blocks(kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", TEXT, re.S)


COMMANDS = [line for block in blocks("sh") for line in block.splitlines()]


@pytest.mark.parametrize("line", COMMANDS)
def test_commands(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    program, *words = shlex.split(line, comments=True)
    assert program == "spacemap"
    with pytest.raises(SystemExit) as caught:
        main([*words, *(["--size", "160x120"] if words[0] == "render" else [])])
    assert caught.value.code == 0
    if "-o" in words:
        assert (tmp_path / words[words.index("-o") + 1]).stat().st_size > 1000


@pytest.mark.parametrize("text", blocks("toml"))
def test_scenes(text: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    scene = Scene.read(file)
    scene.update(0.01)
    assert scene.response.executions == 1


def test_every_load_and_time_function_is_there() -> None:
    for name in ACTIONS:
        assert f"`{name} = " in TEXT
    for name, (needed, possible) in TIMES.items():
        (row,) = re.findall(rf'^\| `"{name}"` \|.*\| (.*) \|$', TEXT, re.M)
        keys = {key for key in re.findall(r"\w+", row) if key in Load.parameters}
        assert keys == {*needed, *possible}
