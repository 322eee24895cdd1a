"""Crossings of knits, counted by hand, and a number that changes only if yarns pass each other."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.textile.rods.alexander import alexander_value, require_same_crossings
from spacemap_vtk.textile.rods.bound_piece import close_yarn, draw_bound_piece
from spacemap_vtk.textile.rods.crossings import Crossings, find_crossings
from spacemap_vtk.textile.rods.knit import relax_knit
from spacemap_vtk.textile.rods.loops import column_starts, draw_loops
from spacemap_vtk.textile.rods.stitches import plan_passes
from spacemap_vtk.textile.rods.yarns import Yarn

PATTERNS = [
    (["k"], ()),
    (["kp", "pk"], ()),
    (["kkk", "kmk"], ()),
    (["kkk", "ktk"], ()),
    (["kp", "tp"], ()),
    (["kp"], ["AB", "BA"]),
    (["kk", "c2f"], ()),
]


def with_order(crossings: Crossings, first_is_above: np.ndarray) -> Crossings:
    """Exchange the two yarns of some crossings."""
    turned = ~first_is_above[:, None]
    pairs = (np.where(turned, each[:, ::-1], each) for each in crossings[:2])
    sign = np.where(first_is_above, 1, -1)
    return Crossings(*pairs, sign[:, None] * crossings.shift, sign * crossings.signs)


@pytest.mark.parametrize(("rows", "chart"), PATTERNS)
def test_the_value_is_the_same_from_everywhere_and_changes_if_a_yarn_passes(rows, chart):
    drawing = draw_loops(plan_passes(rows, chart), 16.0)
    value = alexander_value(drawing.yarns, drawing.crossings)
    for direction in ((0.0, 0.0, 1.0), (0.5, 0.3, 1.0), (-0.4, 1.0, 0.7)):
        seen = find_crossings(drawing.yarns, drawing.cell, direction)
        assert alexander_value(drawing.yarns, seen) == pytest.approx(value, abs=1e-9)
    for number in range(len(drawing.crossings.signs)):
        kept = np.arange(len(drawing.crossings.signs)) != number
        other = alexander_value(drawing.yarns, with_order(drawing.crossings, kept))
        assert abs(other - value) > 1e-3


def test_courses_that_lie_on_each_other_have_the_value_of_straight_yarns():
    # one unknown for each yarn, which is its own image a period further: |1 - u|
    drawing = draw_loops(plan_passes(["kp", "pk"]), 16.0)
    crossings = drawing.crossings
    number = crossings.yarns.copy()
    number[:, 1] += 2 * crossings.shift[:, 1]
    flat = with_order(crossings, number[:, 0] > number[:, 1])
    straight = 2 * np.log(abs(1 - np.exp(1.9j)))
    assert alexander_value(drawing.yarns, flat) == pytest.approx(straight, abs=1e-9)


def test_knit_stitches_that_became_purl_stitches_are_refused():
    drawing = draw_loops(plan_passes(["k"]), 16.0)
    value = alexander_value(drawing.yarns, drawing.crossings)
    require_same_crossings(value, drawing.yarns, drawing.cell)
    turned = [yarn._replace(points=yarn.points * [1, 1, -1]) for yarn in drawing.yarns]
    with pytest.raises(GeometryError, match="passed through"):
        require_same_crossings(value, turned, drawing.cell)


def test_a_cable_has_the_half_that_moves_to_its_side_in_front():
    for row, is_left in (("c2f", True), ("c2b", False)):
        passes = plan_passes(["kk", row])
        yarn = draw_loops(passes, 16.0).yarns[0]
        low, middle, high = column_starts(passes[0])
        legs = [yarn.points[low:middle], yarn.points[middle:high]]
        heights = [part[abs(part[:, 1] - 3.0) < 1.5, 2].mean() for part in legs]
        assert (heights[1] > heights[0]) == is_left


def test_a_stitch_crosses_each_loop_that_it_casts_off_four_times():
    for rows, crossings in [
        (["k"], 4),
        (["k" * 3, "kmk"], 2 * 8 + 4 + 2),  # and a float two legs
        (["k" * 3, "ktk"], 2 * 8 + 8 + 2),  # and a tuck two legs of the loop before it
        (["k" * 3, "ktk", "ktk"], 3 * 8 + 12 + 3 * 2),
        (["k" * 3, "ktk", "ktk", "ktk"], 4 * 8 + 16 + 6 * 2),
        (["k" * 6, "kc4fk"], 12 * 4 + 16),  # and four legs four others
    ]:
        assert len(draw_loops(plan_passes(rows), 16.0).crossings.signs) == crossings


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("rows", "chart"),
    [
        (["kkk", "kmk", "kmk", "kmk"], ()),
        (["kkk", "ktk", "ktk", "ktk"], ()),
        (["kt", "tk"], ()),
        (["k"], ["ABCD", "BCDA"]),
        (["kk", "c2b"], ()),
    ],
)
def test_yarns_of_any_pattern_rest_beside_each_other(rows, chart):
    # relaxing refuses yarns whose crossings are not those of the pattern
    assert 0.0 < relax_knit(rows, 16.0, chart).overlap <= 0.005


def test_a_trefoil_has_the_value_of_its_polynomial():
    # t - 1 + 1/t at t = exp(0.8i)
    t = 2 * np.pi * np.arange(60) / 60
    x, y = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t)
    knot = [Yarn(np.column_stack([x, y, -np.sin(3 * t)]), (0, 0))]
    value = alexander_value(knot, find_crossings(knot, np.zeros((2, 3)), (0.1, 0.2, 1.0)))
    assert value == pytest.approx(np.log(2 * np.cos(0.8) - 1), abs=1e-9)


@pytest.mark.parametrize("courses", [4, 5])
def test_a_bound_piece_is_one_knot_whatever_its_stitch_and_changes_if_yarn_passes(courses):
    # Courses of 4 and 5: chains to the right and to the left.
    nowhere, values = np.zeros((2, 3)), []
    for length in (16.0, 20.0):
        drawing = draw_loops(plan_passes(["kp"]), length)
        drawn = draw_bound_piece(drawing.yarns, drawing.cell, length, 4, courses)
        knot = [close_yarn(np.concatenate(drawn.parts))]
        for direction in ((0.0, 0.0, 1.0), (0.5, 0.3, 1.0)):
            found = find_crossings(knot, nowhere, direction)
            values.append(alexander_value(knot, found))
    assert values == pytest.approx(values[:1] * 4, abs=1e-9)
    numbers = np.arange(len(found.signs))
    changes = [
        abs(alexander_value(knot, with_order(found, numbers != number)) - values[0])
        for number in numbers
    ]
    # The others are twists that come undone without passing anything.
    assert np.mean(np.array(changes) > 1e-6) > 0.9
