"""The licence is in the package; commands and scenes of the documentation run."""

from __future__ import annotations

import importlib.metadata
import re
import shlex
from pathlib import Path

import pytest

from spacemap_vtk.cli.main import main
from spacemap_vtk.filters.load import ACTIONS, TIME_KEYS, Load
from spacemap_vtk.scenes.scene import Scene

GUIDES = Path(__file__).parents[1] / "docs" / "how-to"
#: Guides whose commands and scenes are all run.
RUN = (
    *("choose_a_material", "support_load_and_damp", "hang_cloth", "move_far"),
    "let_cloth_meet_things",
    "grip_and_pull",
)
TEXT = "\n".join((GUIDES / f"{name}.md").read_text("utf-8") for name in RUN)
PLANS = (GUIDES / "plan_a_project.md").read_text("utf-8")


def test_the_licence_comes_with_the_package() -> None:
    package = importlib.metadata.distribution("spacemap_vtk")
    (name,) = package.metadata.get_all("License-File") or ["missing"]
    file = next(file for file in package.files or () if file.name == name)
    assert file.read_text().startswith(f"{package.metadata['License']} License\n")


def test_pictures_and_links_of_the_readme_exist() -> None:
    root = Path(__file__).parents[1]
    text = (root / "README.md").read_text("utf-8")
    links = re.findall(r"\]\(([^):]+)\)", text)
    assert links[0] == "docs/tablecloth.jpg"
    for link in links:
        assert (root / link).exists(), link


def blocks(kind: str, text: str = TEXT) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", text, re.S)


COMMANDS = [line for block in blocks("sh", TEXT + PLANS) for line in block.splitlines()]


#: Words of commands that run nightly: test_scenes.py lays that cloth down; one plot is enough.
SLOW = (" overhang", "--quantity", "helicoid.csv")


@pytest.mark.parametrize(
    "line",
    [
        pytest.param(each, marks=[pytest.mark.nightly] * any(word in each for word in SLOW))
        for each in COMMANDS
    ],
)
def test_commands_of_the_documentation_run(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    program, *words = shlex.split(line, comments=True)
    assert program == "spacemap"
    with pytest.raises(SystemExit) as caught:
        main([*words, *(["--size", "160x120"] if words[0] == "render" else [])])
    assert caught.value.code == 0
    if "-o" in words:
        assert (tmp_path / words[words.index("-o") + 1]).stat().st_size > 1000


@pytest.mark.parametrize("text", blocks("toml"))
def test_scenes_of_the_documentation_are_valid(text: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    scene = Scene.read(file)
    scene.update(0.01)
    mover = scene.stage("mover")
    assert mover is not None
    assert mover.executions == 1


def test_scene_of_a_plan_has_its_yarns(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(*blocks("toml", PLANS), encoding="utf-8")
    woven = Scene.read(file).woven
    assert woven is not None
    assert woven.linear_densities is not None
    tex = 1e6 * woven.linear_densities[[0, -1]]  # 3360 and 2400 yards in a pound
    assert tex == pytest.approx([147.6, 206.7], abs=0.1)


def test_every_load_and_time_function_is_documented() -> None:
    for name in ACTIONS:
        assert f"`{name} = " in TEXT
    for name, (needed, possible) in TIME_KEYS.items():
        (row,) = re.findall(rf'^\| `"{name}"` \|.*\| (.*) \|$', TEXT, re.M)
        keys = {key for key in re.findall(r"\w+", row) if key in Load.parameters}
        assert keys == {*needed, *possible}
