"""The film of the documentation: docs/film.py makes its frames by the program's parts."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes.scene import Scene

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture
def film(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the script."""
    monkeypatch.syspath_prepend(str(DOCS))
    yield __import__("film")
    sys.modules.pop("film", None)


def test_the_film_takes_a_minute(film: Any) -> None:
    assert sum(shot.seconds for shot in film.SHOTS.values()) == pytest.approx(60.0, abs=0.5)
    for name, shot in film.SHOTS.items():
        begins = [begin for begin, _ in shot.captions]
        assert begins == sorted(begins), name
        assert all(begin < shot.seconds for begin in begins), name
    # Nothing is left out: the fall is shown to its end, ten times slower.
    assert pytest.approx(10 * film.FALL) == film.SLOW
    assert film.SHOTS["fall"].seconds > film.SLOW


def test_the_woven_draft_shows_the_colour_of_the_yarn_on_top(film: Any) -> None:
    page, shown = film.draw_draft(film.WOVEN), film.draft()
    ends, picks = shown.size
    for pick, end in ((0, 0), (3, 7), (picks - 1, ends - 1)):
        row = film.TOP + (picks - 1 - pick) * film.CELL + film.CELL // 2
        found = page[row, film.LEFT + end * film.CELL + film.CELL // 2]
        over = shown.drawdown[pick, end]
        assert (found == (shown.warp[end] if over else shown.weft[pick])).all()


def test_the_cloth_appears_where_its_drawdown_is(film: Any) -> None:
    eye = film.over_drawdown((0.0, 0.0))
    focus, metres = np.array(eye.focus), film.scale()
    half = math.tan(math.radians(eye.viewpoint.angle / 2)) * eye.distance
    assert half / metres == pytest.approx(film.SIZE[1] / 2)
    # The first end and the last pick are at the upper left corner of the drawdown.
    width, height = film.extent()
    corner = (np.array([-width / 2, height / 2]) - focus[:2]) / metres
    assert film.SIZE[0] / 2 + corner[0] == pytest.approx(film.LEFT)
    assert film.SIZE[1] / 2 - corner[1] == pytest.approx(film.TOP, abs=1.0)


def test_a_picture_from_another_viewpoint_is_that_of_a_camera_there() -> None:
    scene = Scene.read("twill_2_2")
    scene.assign("surface", "subdivisions", 2)
    first = Viewpoint((0.0, -0.03, 0.03), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    second = first._replace(position=(0.02, -0.02, 0.03))
    moved = Picture(scene, [0.0], (160, 120), viewpoint=first)
    before = moved.draw(0.0)
    seen = moved.draw_from(second)
    moved.close()
    there = Picture(scene, [0.0], (160, 120), viewpoint=second)
    expected = there.draw(0.0)
    there.close()
    assert (seen == expected).all()
    assert (seen != before).any()


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["zoom", "near", "grow", "fall", "orbit", "rim"])
def test_each_shot_of_the_film_can_be_drawn(film: Any, name: str) -> None:
    draw = next(film.SHOTS[name].frames())
    image = film.add_captions(draw()[..., :3], name, 2.0)
    assert image.shape == (film.SIZE[1], film.SIZE[0], 3)
    assert image.std() > 10.0
