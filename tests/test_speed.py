"""What a new time takes, beside a copy."""

from __future__ import annotations

import json
from itertools import count
from time import process_time

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.speed import step_timings


def test_the_stages_that_a_new_time_runs_stand_beside_their_own_bytes():
    scene = Scene.read("plain_weave")
    figures = step_timings(scene, steps=2)
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
    # VTK looks for the points anew each time: 300 ms where ours takes 1
    assert probe["ms"] > warp["ms"]
    assert not figures["compiled"]


def test_an_object_in_a_cage_is_measured_too(capsys):
    with pytest.raises(SystemExit) as end:
        main(["bench", "plain_weave", "--set", "weave.ends=3", "--steps", "1", "--json", "-q"])
    assert end.value.code == 0
    (figures,) = json.loads(capsys.readouterr().out)["scenes"]
    assert figures["title"] == "3 x 7 yarns"
    with pytest.raises(SystemExit) as end:
        main(["bench", "tube_bundle", "--steps", "1", "-q"])
    assert end.value.code == 0
    told = capsys.readouterr().out
    assert "BarycentricWarp" in told
    assert "copies" in told


@pytest.mark.nightly
def test_a_new_time_of_a_large_weave_takes_few_copies_of_its_bytes():
    # In processor time of all threads together, which other work on the machine changes little:
    # with two free cores a step takes about half as many copies.
    scene = Scene.read("plain_weave")
    for assignment in ("weave.ends=100", "weave.picks=100"):
        scene.set(assignment)
    for time in (0.01, 0.02, 0.03):  # memory is taken, and loops are compiled
        scene.update(time)
    normals = scene.polygons.GetPointData().GetNormals()
    sizes = [points_of(data).nbytes for data in (scene.warp.output, scene.polygons)]
    sizes[1] += vtk_to_numpy(normals).nbytes

    def processor_time(run):
        start = process_time()
        run()
        return process_time() - start

    def copies(run, size):
        source, target = np.ones(size, np.uint8), np.zeros(size, np.uint8)
        taken = [
            (processor_time(run), processor_time(lambda: np.copyto(target, source)))
            for _ in range(9)
        ]
        step, copy = np.median(taken, axis=0)
        return step / copy

    times = count(4)
    assert copies(lambda: scene.warp.update(0.01 * next(times)), sizes[0]) <= 3.0
    assert copies(lambda: scene.update(0.01 * next(times)), sum(sizes)) <= 4.0
