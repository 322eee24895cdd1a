"""A sweep as a job, which the window runs in a process of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.jobs import SweepJob, job_from_json, make_job
from spacemap_vtk.scenes.scene import Scene


def test_a_sweep_makes_a_new_folder(tmp_path: Path) -> None:
    scene = Scene({"weave": {"ends": 2, "picks": 2}, "view": {"size": [48, 36]}})
    job = make_job("sweep", tmp_path / "made", lists=["weave.ends=2,3"], workers=1)
    steps: list[tuple[int, int]] = []
    assert job.run(scene, lambda done, of: steps.append((done, of))) == "2 runs"
    assert steps[-1] == (2, 2)
    names = sorted(path.name for path in (tmp_path / "made").glob("*.png"))
    assert names == ["contact_sheet.png", "ends=2.png", "ends=3.png"]
    again = job_from_json(job.as_json(), tmp_path / "other")
    assert isinstance(again, SweepJob)
    assert again.lists == ["weave.ends=2,3"]
    with pytest.raises(InputError, match="exists already"):
        make_job("sweep", tmp_path / "made")


def test_runs_that_fail_are_counted_with_the_first_reason(tmp_path: Path) -> None:
    scene = Scene({"weave": {"ends": 2, "picks": 2}, "view": {"size": [48, 36]}})
    lists = ["weave.warp_diameter=0.3 mm,5 mm"]
    result = SweepJob(tmp_path / "made", lists, workers=1).run(scene)
    assert result.startswith("2 runs, of which 1 failed: ")
    assert "warp_diameter" in result
