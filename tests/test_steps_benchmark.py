"""The script that compares the time of one step with the time of copying its bytes."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest

from spacemap_vtk.scenes.scene import Scene

SCRIPT = runpy.run_path(str(Path(__file__).parent.parent / "benchmarks" / "steps.py"))


@pytest.mark.nightly
def test_stages_of_a_new_time_are_listed_with_their_bytes():
    scene = Scene.read("plain_weave")
    figures = SCRIPT["step_timings"](scene, steps=2)
    names = [row["name"] for row in figures["stages"]]
    assert names[:4] == [
        "ModalResponse",
        "BarycentricWarp",
        "PatchTessellator",
        "all in one update",
    ]
    assert names[4] == "vtkProbeFilter"
    assert names[-1] == "crossings, stretch and bend"
    cage, warp, surface, all_of_them, probe = figures["stages"][:5]
    assert cage["bytes"] == 72 * 3 * 8
    assert figures["points"] == scene.warp.output.GetNumberOfPoints()
    assert warp["bytes"] == probe["bytes"] == 3 * 8 * figures["points"]
    assert surface["bytes"] == 2 * 3 * 4 * figures["surface_points"]  # points and normals
    assert all_of_them["bytes"] == cage["bytes"] + warp["bytes"] + surface["bytes"]
    for row in figures["stages"]:
        assert row["ms"] > 0.0
        assert row["copies"] == pytest.approx(row["ms"] / row["copy_ms"])
    assert not figures["compiled"]


@pytest.mark.nightly
def test_an_object_in_a_cage_is_measured(capsys):
    SCRIPT["main"](["plain_weave", "--set", "weave.ends=3", "--steps", "1", "--json"])
    (figures,) = json.loads(capsys.readouterr().out)["scenes"]
    assert figures["title"] == "3 x 7 yarns"
    SCRIPT["main"](["tube_bundle", "--steps", "1"])
    output = capsys.readouterr().out
    assert "BarycentricWarp" in output
    assert "copies" in output
