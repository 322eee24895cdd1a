"""Warp knits: notation, crossings, and what is known of pillar stitch, tricot and locknit."""

from __future__ import annotations

import pytest

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.textiles.kind import yarn_lengths
from spacemap_vtk.filters.textiles.warp_knit import WarpKnit, parse_threading
from spacemap_vtk.textile.rods.crossings import find_crossings, linking_numbers
from spacemap_vtk.textile.rods.warp_knit import are_open, parse_laps

#: Laps of both bars in chain notation, and the length of the front bar's underlaps in needles.
TWO_BARS = {
    "tricot": ("1-2/1-0", "1-0/1-2"),
    "locknit": ("2-3/1-0", "1-0/1-2"),
    "satin": ("1-0/3-4", "1-2/1-0"),
    "sharkskin": ("1-0/1-2", "1-0/3-4"),
    "queenscord": ("1-0/0-1", "1-0/3-4"),
}


def value_of(kind, key):
    return next(figure.value for figure in kind.all_figures() if figure.key == key)


def test_laps_are_open_or_closed_as_their_notation_says():
    assert are_open(parse_laps("1-0/1-2//")) == [False, False]
    assert are_open(parse_laps("0-1/2-1//")) == [True, True]
    assert are_open(parse_laps("1-0/0-1//")) == [True, True]
    assert are_open(parse_laps("1-0//")) == [False]
    # An atlas is open where it goes on, and closed where it turns.
    assert are_open(parse_laps("1-0/1-2/2-3/2-1")) == [False, True, False, True]
    assert parse_threading("1 in 2 out") == (True, False, False)
    for wrong in ("1-1", "0-2", "1-0//1-2", "1-0 1-2", ""):
        with pytest.raises(InputError):
            WarpKnit(laps=wrong)
    with pytest.raises(InputError):
        WarpKnit(threading="1 in 1")


@pytest.mark.parametrize("name", TWO_BARS)
def test_bars_do_not_wind_their_yarns_about_each_other(name):
    # Bars swing in the same order whatever they knit, and needles draw loops, which turn no yarn
    # about another one: all linking numbers are 0, although some pairs cross more than ten times.
    guess = WarpKnit(laps=TWO_BARS[name]).guess()
    assert len(find_crossings(guess.yarns, guess.cell).signs) > 40
    assert linking_numbers(guess.yarns, guess.cell) == {}


def test_a_knit_of_one_bar_comes_to_rest_without_overlap():
    knit = WarpKnit(laps="1-0/1-2", diameter=1e-4)
    rest = knit.rest()
    assert rest.overlap < 0.005
    # Nothing stretches the yarn: at rest it is as long as its run-in says.
    (length,) = yarn_lengths(rest)
    assert value_of(knit, "run_in") == pytest.approx(480 * length / 2 * 1e-4, rel=2e-3)
    mirrored = WarpKnit(laps="1-2/1-0", diameter=1e-4)
    assert value_of(mirrored, "wale_spacing") == pytest.approx(
        value_of(knit, "wale_spacing"), rel=1e-4
    )


def test_wales_of_pillar_stitch_are_not_joined():
    pillar = WarpKnit(laps="1-0/0-1", wale_spacing=3e-3)
    assert value_of(pillar, "wale_spacing") == pytest.approx(3e-3)
    assert pillar.rest().overlap < 0.005
    # Without a given spacing it is kept as it is drawn; underlaps of a tricot find their own.
    assert not WarpKnit(laps="1-0/0-1").guess().free[0, 0]
    assert WarpKnit(laps="1-0/1-2").guess().free[0, 0]


@pytest.mark.nightly
@pytest.mark.parametrize("name", TWO_BARS)
def test_yarns_of_the_front_bar_lie_outermost_on_face_and_back(name):
    knit = WarpKnit(laps=TWO_BARS[name])
    rest = knit.rest()
    front, back = (yarn.points[:, 2] for yarn in rest.yarns)
    assert front.max() > back.max()
    assert front.min() < back.min()
    assert rest.overlap < 0.005


@pytest.mark.nightly
def test_half_threaded_bars_make_a_net():
    laps = ("1-0/1-2/2-3/2-1", "2-3/2-1/1-0/1-2")
    net = WarpKnit(laps=laps, threading=["1 in 1 out", "1 out 1 in"], wales=4, courses=8)
    assert [len(net.lines()), net.rest().overlap < 0.005] == [4, True]


def test_needles_without_yarn_are_refused():
    with pytest.raises(GeometryError, match="no yarn"):
        WarpKnit(laps="1-0/1-2", threading="1 in 1 out").guess()
