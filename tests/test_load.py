"""Loads: what is refused, tables from files, and what a scene file says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_response import EVERY_LOAD, Chain

from spacemap_vtk import ModalResponse
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary import time_functions
from spacemap_vtk.mechanics.boundary.loads import nearest_vertices
from spacemap_vtk.scenes.scene import Scene


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"pressure": 1}, r"loads\[0\]\.on: a pressure needs a place"),
        ({"pressure": 1, "on": "z"}, r'loads\[0\]\.on = "z": must be one of the choices'),
        ({"force": [0, 0, 1]}, r"loads\[0\]\.at: a force needs a place"),
        ({"gravity": [0, 0, 1], "rise": 1}, r'loads\[0\]\.rise: time = "step" does not use this'),
        (
            {"gravity": [0, 0, 1], "time": "ramp"},
            r'loads\[0\]\.rise: time = "ramp" needs this value',
        ),
        ({"gravity": [0, 0, 1], "force": [0, 0, 1]}, r"force and gravity.*exactly one of pressure"),
        ({"presure": 1}, r'loads\[0\]\.presure.*Did you mean "pressure"'),
        ({}, r"loads\[0\]: the load has no action"),
        (
            {"gravity": [0, 0, 1], "time": "table", "times": [1, 0], "values": [1, 2]},
            r"loads\[0\]\.times: times must ascend from 0 s on",
        ),
        ({"gravity": [0, 0, 1], "file": "x.csv"}, r'\.file: time = "step" does not use this value'),
        (
            {"gravity": [0, 0, 1], "time": "table", "file": "no.csv"},
            r"loads\[0\]\.file: No such file or directory: no\.csv",
        ),
        (
            {"gravity": [0, 0, 1], "time": "table", "file": "no.csv", "times": [0, 1]},
            r"loads\[0\]\.times: is already given by file",
        ),
    ],
)
def test_invalid_load_is_refused(load: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        ModalResponse(loads=[load])


@pytest.mark.parametrize(
    "text",
    [
        "time,factor\n0,0\n0.2,1\n0.5,-0.4\n",
        "0;0\n0,2;1\n0,5;-0,4\n",
        "# gust\nt [s]\tp\n\n0\t0\textra\n.2\t1\n5e-1\t-0.4  # end\n",
        "\ufeff0 0\r\n0.2   1\r\n0.5 -0.4",
    ],
)
def test_table_is_read_from_a_file(text: str, tmp_path: Path) -> None:
    (tmp_path / "gust.csv").write_text(text, encoding="utf-8", newline="")
    scene = tmp_path / "gust.toml"
    scene.write_text(
        "[response]\n[[response.loads]]\npressure = 2\non = '+z'\ntime = 'table'\n"
        "file = 'gust.csv'  # beside the scene\n"
    )
    (load,) = Scene.read(scene).response.loads
    expected = time_functions.table([0, 0.2, 0.5], [0, 1, -0.4])
    for found, wanted in zip(load.function, expected, strict=True):
        np.testing.assert_array_equal(found, wanted)
    # what is written again reads the same file
    again = ModalResponse(loads=ModalResponse.loads.format((load,)))
    assert again.loads == (load,)
    (tmp_path / "gust.csv").write_text("0 0\n0.2 2\n")
    again.loads = [{"pressure": 2, "on": "+z", "time": "table", "file": load.file}]
    assert again.loads != (load,)
    assert again.loads[0].function.value(0.1) == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no numbers"),
        ("time factor\n", "has no numbers"),
        ("0 1\n1\n", 'line 2 of .*gust.csv: "1"; allowed: two numbers in each line'),
        ("a b\nc d\n", "line 2"),
        ("0 1\n1 nan\n", r"\.file: values must be finite numbers, in .*gust\.csv"),
        ("1 1\n0 1\n", r"\.file: times must ascend from 0 s on, in .*gust\.csv"),
    ],
)
def test_file_without_a_table_is_refused(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "gust.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        ModalResponse(loads=[{"pressure": 2, "on": "+z", "time": "table", "file": file}])


def test_loads_are_the_same_as_text_and_as_tables() -> None:
    first, second = ModalResponse(loads=EVERY_LOAD), ModalResponse()
    second.loads = ModalResponse.loads.format(first.loads)  # type: ignore[assignment]
    assert first.loads == second.loads
    with pytest.raises(InputError, match="cannot be changed"):
        first.loads[0].pressure = 3.0


def test_loads_are_read_from_a_scene_file(tmp_path: Path) -> None:
    file = tmp_path / "pressed.toml"
    text = """
        [weave]
        ends = 3
        picks = 3
        [response]
        gravity = [0, 0, 0]
        damping_pairs = [["10 Hz", 0.02], ["200 Hz", 0.03]]
        [[response.loads]]
        pressure = "20 Pa"
        on = "+z"
        time = "ramp"
        rise = "0.1 s"
        [[response.loads]]
        base_acceleration = [0, 0, "0.5 g"]
        time = "harmonic"
        frequency = "12 Hz"
        phase = "90 deg"
        """
    file.write_text(text)
    scene = Scene.read(file)
    scene.update(0.05)
    assert [load.action for load in scene.response.loads] == ["pressure", "base_acceleration"]
    assert scene.response.loads[1].base_acceleration[2] == pytest.approx(0.5 * 9.80665)
    scene.set('response.loads=[{force=[0, 0, "1 mN"], at=[0, 0, 0]}]')
    assert scene.response.loads[0].force == (0.0, 0.0, 1e-3)
    file.write_text(text.replace('rise = "0.1 s"', 'length = "0.1 s"'))
    with pytest.raises(
        InputError, match=r'pressed\.toml: response\.loads\[0\]\.length: time = "ra'
    ):
        Scene.read(file)


def test_a_load_on_supports_is_reported() -> None:
    chain = Chain(loads=[{"pressure": "1 Pa", "on": "+y"}])
    chain.response.update(0.1)
    assert "a load acts only on fixed vertices and has no effect" in chain.response.warnings


def test_force_outside_the_cage_is_reported() -> None:
    chain = Chain(gravity=(0, 0, 0), loads=[{"force": [0, 0, 1e-6], "at": [0, 0, 0]}])
    chain.response.update(0.0)
    assert not any("away" in text for text in chain.response.warnings)
    chain.response.loads = [{"force": [0, 0, 1e-6], "at": [0, "-1 m", 0]}]  # type: ignore[assignment]
    chain.response.update(0.0)
    assert "loads[0] acts at a point 0.999 m away from the cage" in chain.response.warnings[0]


def test_vertices_that_are_equally_near_to_a_point_share_its_force() -> None:
    vertices = build_lattice([-2, 2, -1, 1, -0.1, 0.1], [4, 2, 1])[0]
    on_edge = nearest_vertices(vertices, (1.0, 1.0, 0.0))
    np.testing.assert_array_equal(vertices[on_edge], [[1, 1, -0.1], [1, 1, 0.1]])
    assert len(nearest_vertices(vertices, (1.0, 1.0, 0.01))) == 1
    assert len(nearest_vertices(vertices, (0.5, 0.5, 0.0))) == 8
    force, place = np.array([0.0, 0.0, 1e-6]), [0.0, -1.5e-3, 0.0]
    one = Chain(gravity=(0, 0, 0), loads=[{"force": force, "at": place}])
    halves = [{"force": 0.5 * force, "at": [*place[:2], z]} for z in (-1e-5, 1e-5)]
    two = Chain(gravity=(0, 0, 0), loads=halves)
    np.testing.assert_allclose(one.at(0.02), two.at(0.02), rtol=1e-9, atol=1e-15)
