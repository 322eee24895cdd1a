"""Charts of knits on the screen, and the scene values that follow from them."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile_source import TextileSource
from spacemap_vtk.scenes.editable_knit import make_editable_knit, require_knittable

RED, WHITE, BLUE = (200, 0, 0), (255, 255, 255), (0, 0, 250)


def chart_of(**values):
    source = TextileSource(**values)
    return make_editable_knit(source.rows, source.chart, source.color)


@pytest.mark.parametrize(
    "values",
    [
        {"rows": "rib 2x2", "color": [RED, RED, WHITE]},
        {"rows": ("kkp", "ktk"), "color": BLUE},
        {"rows": "stockinette", "chart": ("AAB", "BAC"), "color": [RED, WHITE, BLUE]},
    ],
)
def test_values_of_an_unchanged_chart_are_those_of_the_scene(values):
    before, after = TextileSource(**values), TextileSource(**chart_of(**values).values())
    for key in ("rows", "chart", "color"):
        assert getattr(after, key) == getattr(before, key)


def test_a_stitch_of_another_colour_makes_a_chart_and_a_row_of_it_stripes():
    chart = chart_of(rows="stockinette", color=[RED, WHITE]).resize(3, 2)
    painted = chart.with_color(1, 0, WHITE)
    values = painted.values()
    assert (values["chart"], values["color"]) == (["ABA", "BBB"], ["#c80000", "#ffffff"])
    striped = painted.with_color(None, 0, BLUE).values()
    assert (striped["chart"], striped["color"]) == (None, ["#0000fa", "#ffffff"])
    everywhere = painted.with_replaced_color(WHITE, BLUE).values()
    assert everywhere["color"] == ["#c80000", "#0000fa"]


def test_charts_are_repeated_cut_and_reduced():
    rib = chart_of(rows="rib 1x1")
    assert rib.resize(6, 4).values()["rows"] == "rib 1x1"
    assert rib.resize(3, 1).values()["rows"] == ["kpk"]
    garter = rib.resize(4, 3).with_rows(("k", "p"))
    assert garter.values()["rows"] == "garter"
    assert rib.resize(2, 2).with_stitch(0, 1, "p").values()["rows"] == ["kp", "pp"]
    with pytest.raises(InputError):
        rib.resize(400, 400)


def test_cables_are_set_and_taken_away_whole():
    plain = chart_of(rows=["pk4p", "pk4p"])
    crossed = plain.with_stitch(1, 1, "c4f")
    assert crossed.values()["rows"] == ["pkkkkp", "pc4fp"]
    assert chart_of(rows=crossed.values()["rows"]).values() == crossed.values()
    assert crossed.with_stitch(3, 1, "p").values()["rows"] == ["pkkkkp", "pkkpkp"]
    assert crossed.resize(4, 2).values()["rows"] == ["pkkk"]
    assert crossed.resize(12, 2).values() == crossed.values()


def test_lace_is_set_stitch_by_stitch_and_kept():
    plain = chart_of(rows=["k4"]).resize(4, 2)
    over = plain.with_stitch(1, 1, "yo")
    assert (over.surplus(0), over.surplus(1)) == (0, 1)
    lace = over.with_stitch(2, 1, "k2tog")
    assert lace.surplus(1) == 0
    assert lace.values()["rows"] == ["kkkk", "kyok2togk"]
    assert chart_of(rows=lace.values()["rows"]).values() == lace.values()
    assert lace.with_stitch(2, 1, "s2kp").surplus(1) == -1


def test_stitches_that_no_yarn_holds_are_refused():
    missed = chart_of(rows="rib 1x1").with_stitch(0, 0, "m").with_stitch(1, 0, "m")
    with pytest.raises(InputError, match="only misses"):
        require_knittable(missed.values())


def test_colours_stand_where_the_chart_has_their_letters():
    chart = chart_of(rows=("k", "k"), chart=("AB",), color=[RED, BLUE])
    assert chart.size == (2, 2)
    np.testing.assert_array_equal(chart.colors[:, 1], [BLUE, BLUE])
