"""What --set says in a sweep: values, lists of them, and what is refused before anything runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.assignments import parse_value_list
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.sweep import read_sweep

PARTS = Scene({}).parts
SCENE = "plain_weave"


@pytest.mark.parametrize(
    ("stated", "values"),
    [
        ("weave.ends=5,7", [5, 7]),
        ("weave.ends=[5,7]", [5, 7]),
        ("weave.warp_spacing=0.4 mm,500um", ["0.4 mm", "500um"]),
        ("weave.pattern=plain, satin 8/3", ["plain", "satin 8/3"]),
        ("modal.gravity=[0,0,-1]", [[0, 0, -1]]),
        ("modal.gravity=[0,0,-1],[0,0,-2]", [[0, 0, -1], [0, 0, -2]]),
        ("modal.gravity=[[0,0,-1],[0,0,-2]]", [[0, 0, -1], [0, 0, -2]]),
        ("weave.warp_color=['#ffffff','#000000'],#ff0000", [["#ffffff", "#000000"], "#ff0000"]),
        ("modal.fixed=\"-x, +x\",'+y',sphere(0, 1, 2, 3)", ["-x, +x", "+y", "sphere(0, 1, 2, 3)"]),
        ('weave.draft="a\\",b.wif",c.wif', ['a",b.wif', "c.wif"]),
        ("view.shadows=true,false", [True, False]),
        ("weave.warp_crimp_height=auto,0.1mm", ["auto", "0.1mm"]),
        ("weave.ends=3,linspace(5,9,3)", [3, 5, 7, 9]),
        ("weave.warp_spacing=linspace(0.4 mm, 0.6mm, 3)", [4e-4, 5e-4, 6e-4]),
        ("modal.youngs_modulus=geomspace(1 kPa, 1 MPa, 4)", [1e3, 1e4, 1e5, 1e6]),
    ],
)
def test_commas_separate_values(stated: str, values: list[Any]) -> None:
    assert list(parse_value_list(stated, PARTS).values) == values


@pytest.mark.parametrize(
    ("stated", "reported"),
    [
        ("weave.ends=5,-3", "weave.ends = -3: out of range"),
        ("weave.ends=[5,-3]", "weave.ends = -3: out of range"),
        ("weave.ends=5,,7", "a value is missing"),
        ("modal.gravity=[0,0]", "must have 3 components, not 2"),
        ("weave.endz=3,4", 'Did you mean "ends"'),
        ("weev.ends=3,4", "unknown section"),
        ("weave.ends=linspace(3,6,3)", "weave.ends = 4.5: must be a whole number"),
        ("weave.warp_spacing=linspace(0.4 kg,1,3)", 'unknown unit "kg"'),
        ("modal.youngs_modulus=geomspace(0,1,3)", "must be a valid"),
        ("weave.ends=linspace(3,6," + "9" * 5000 + ")", "must be a valid"),
        ("weave.ends=" + "9" * 5000, "must be finite"),
        ("weave.ends=" + "[" * 5000, "must be a number"),
        ("weave." + "\x1b[2J\n" * 500 + "=3", "x1b.2J.*: unknown parameter of WeaveSource"),
        ("weave.pattern=linspace(1,2,3)", "must be a valid"),
    ],
)
def test_every_value_is_checked(stated: str, reported: str) -> None:
    with pytest.raises(InputError, match=reported.replace("(", r"\(")):
        parse_value_list(stated, PARTS)


def test_lists_are_combined_or_paired() -> None:
    stated = ["weave.ends=2,3", "weave.picks=4,5", "weave.pattern=plain"]
    every = [
        (run.scene().source.ends, run.scene().source.picks)
        for run in read_sweep(SCENE, stated).runs
    ]
    assert every == [(2, 4), (2, 5), (3, 4), (3, 5)]
    paired = read_sweep(SCENE, stated, paired=True).runs
    assert [run.chosen for run in paired] == [(2, 4), (3, 5)]
    assert [run.name for run in paired] == ["ends=2_picks=4", "ends=3_picks=5"]
    for wrong, reported in (
        (["weave.ends=2,3", "weave.picks=4,5,6"], "weave.ends has 2, weave.picks has 3"),
        (["weave.ends=2", "weave.ends=3"], "is set twice"),
        (["weave.ends=2,2"], "the same run twice"),
    ):
        with pytest.raises(InputError, match=reported):
            read_sweep(SCENE, wrong, paired=True)
    with pytest.raises(InputError, match="too many runs: 20000"):
        read_sweep(SCENE, ["weave.ends=linspace(1,200,200)", "weave.picks=linspace(1,100,100)"])


def test_invalid_values_are_refused_and_yarns_that_do_not_fit_are_results(tmp_path: Path) -> None:
    room = read_sweep(SCENE, ["weave.warp_diameter=0.25mm,0.6mm"])
    room.check()
    assert list(room.impossible) == ["warp_diameter=0.6mm"]
    with pytest.raises(InputError, match="warp_diameter"):  # nothing would come of it at all
        read_sweep(SCENE, ["weave.warp_diameter=0.6mm,0.7mm"]).check()
    missing = read_sweep(SCENE, [f"weave.draft={tmp_path / 'a.wif'},{tmp_path / 'b.wif'}"])
    with pytest.raises(InputError, match=r"a\.wif.*no such file"):
        missing.check()


def test_digest_of_a_run_covers_everything_it_depends_on(tmp_path: Path) -> None:
    draft, scene = tmp_path / "a.txt", tmp_path / "a.toml"
    draft.write_text("10\n01\n")
    scene.write_text('[weave]\ndraft = "a.txt"\n')

    def digest(*stated: str, **more: Any) -> str:
        (run,) = read_sweep(scene, stated, **more).runs
        return run.digest

    known = digest()
    assert digest() == known
    assert len({known, digest("weave.trim=true"), digest(times=[0.1])}) == 3
    draft.write_text("11\n01\n")
    assert digest() != known
