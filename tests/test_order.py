"""Orders: refused when they are made, carried out whole or not at all, ended by who is told."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from spacemap_vtk.draw import order as module
from spacemap_vtk.draw.order import Order, as_text, carry_out
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.algorithm import Cancelled
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 2, "picks": 2},
    "cage": {},
    "modal": {"modes": 3},
    "response": {},
    "surface": {"subdivisions": 1},
    "view": {"size": [64, 48]},
    "animation": {"stop": 0.2},
}


@pytest.mark.parametrize(
    ("what", "name", "told"),
    [
        ("picture", "a.gif", ".png"),
        ("shapes", "a.vtu", ".jpg"),
        ("film", "a.jpg", "numbered frames"),
        ("film", "a.png", "%04d"),
        ("film", "a%sb.png", "%04d"),
        ("picture", "a%04d.png", "one file"),
        ("cage", "a.stl", "surface"),
        ("", "a.png", ".vtu"),
        ("film", "no/a.gif", "does not exist"),
    ],
)
def test_what_cannot_be_carried_out_is_refused_when_it_is_made(
    tmp_path: Path, what: str, name: str, told: str
) -> None:
    with pytest.raises(InputError, match=told):
        Order(what, tmp_path / name)


def test_an_ending_says_what_data_it_stands_for(tmp_path: Path) -> None:
    assert Order("", tmp_path / "a.vtu").what == "patches"
    assert Order("", tmp_path / "a.WIF").what == "draft"
    assert Order("cage", tmp_path / "a.vtu").what == "cage"


@pytest.mark.parametrize(
    ("what", "name", "steps"),
    [("picture", "a.png", 1), ("film", "a.gif", 5), ("film", "a%d.png", 5), ("", "a.stl", 2)],
)
def test_an_order_is_told_to_its_end_and_can_be_ended(
    tmp_path: Path, what: str, name: str, steps: int
) -> None:
    order, told = Order(what, tmp_path / name), []

    def end(done: int, _of: int) -> None:
        if done:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        carry_out(order, Scene(VALUES), end)
    assert list(tmp_path.iterdir()) == []
    carry_out(order, Scene(VALUES), lambda done, of: told.append((done, of)))
    assert told == [(done, steps) for done in range(steps + 1)]
    assert len(list(tmp_path.iterdir())) == (steps if order.numbered else 1)


def test_a_gif_is_half_as_large_unless_a_size_is_ordered(tmp_path: Path) -> None:
    for size, drawn in ((None, (32, 24)), ((40, 30), (40, 30))):
        order = Order("film", tmp_path / "a.gif", size=size)
        carry_out(order, Scene(VALUES), lambda done, of: None)
        with Image.open(order.output) as film:
            assert film.size == drawn


def test_a_process_of_its_own_does_what_is_ordered_and_tells_why_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    order = Order("picture", tmp_path / "a.png", [0.0], (32, 24))
    monkeypatch.setattr("sys.stdin", io.StringIO(as_text(order, VALUES, tmp_path)))
    module.main()
    said = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert said == [{"done": 0, "of": 1}, {"done": 1, "of": 1}, {"told": ""}]
    with Image.open(order.output) as picture:
        assert picture.size == (32, 24)
    values = {"weave": {"ends": -1}}
    monkeypatch.setattr("sys.stdin", io.StringIO(as_text(order, values, tmp_path)))
    with pytest.raises(SystemExit):
        module.main()
    error = json.loads(capsys.readouterr().out.splitlines()[-1])["error"]
    assert (error["section"], error["key"], error["value"]) == ("weave", "ends", -1)
