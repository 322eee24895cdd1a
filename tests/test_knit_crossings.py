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
from spacemap_vtk.textile.rods.stitches import Pass, parse_rows, plan_passes
from spacemap_vtk.textile.rods.yarns import Yarn

PATTERNS = [
    (["k"], ()),
    (["kp", "pk"], ()),
    (["kkk", "kmk"], ()),
    (["kkk", "ktk"], ()),
    (["kp", "tp"], ()),
    (["kp"], ["AB", "BA"]),
    (["kk", "c2f"], ()),
    (["k3", "k yo k2tog"], ()),
    (["p3", "ssk yo k"], ()),
    (["kf", "fk"], ()),
]


def with_order(crossings: Crossings, first_is_above: np.ndarray) -> Crossings:
    """Exchange the two yarns of some crossings."""
    turned = ~first_is_above[:, None]
    pairs = (np.where(turned, each[:, ::-1], each) for each in crossings[:2])
    sign = np.where(first_is_above, 1, -1)
    return Crossings(*pairs, sign[:, None] * crossings.shift, sign * crossings.signs)


@pytest.mark.parametrize(("rows", "chart"), PATTERNS)
def test_the_value_is_the_same_from_everywhere_and_changes_if_a_yarn_passes(rows, chart):
    drawing = draw_loops(plan_passes(parse_rows(rows), chart), 16.0)
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
        # nothing is drawn through below a yarn over; loops of a decrease cross each other twice
        (["kkk", "k yo k2tog"], 3 * 4 + 4 + 8 + 2),
        (["kkk", "ssk yo k"], 3 * 4 + 4 + 8 + 2),
        (["kkkk", "k yo sk2p yo"], 4 * 4 + 4 + 12 + 3 * 2),
    ]:
        passes = plan_passes(parse_rows(rows))
        assert len(draw_loops(passes, 16.0).crossings.signs) == crossings


def seen_from_the_face(passes: list[Pass]) -> tuple[Crossings, np.ndarray]:
    """Find the crossings of a drawing, and the needles at which they are on both yarns."""
    drawing = draw_loops(passes, 16.0)
    found = find_crossings(drawing.yarns, drawing.cell)
    needles = np.zeros_like(found.yarns)
    for yarn, each in enumerate(passes):
        starts, on = column_starts(each), found.yarns == yarn
        needles[on] = np.searchsorted(starts, (found.parameters[on] + 1) % starts[-1], "right") - 1
    return found, needles


def loops_before(row: str) -> list[int]:
    """Return how many others each loop of a decrease of a row lies before, from the left."""
    passes = plan_passes(parse_rows(["kkkk", row]))
    ((first, order),) = passes[1].decreases
    found, needles = seen_from_the_face(passes)
    pairs = {(over, below) for over, below in needles[(found.yarns == 0).all(axis=1)].tolist()}
    return [sum(over == first + k for over, _ in pairs) for k in range(len(order))]


def test_decreases_lean_to_the_side_of_the_loop_that_is_behind():
    # number of loops that each loop, from the left, lies before
    assert loops_before("k yo k2tog k") == [1, 0]
    assert loops_before("k ssk yo k") == [0, 1]
    assert loops_before("k yo sk2p yo") == [1, 0, 2]
    assert loops_before("k yo s2kp yo") == [0, 2, 1]


def test_a_yarn_over_is_not_linked_with_the_row_below():
    # seen from the face it passes behind all loops that are on the needles before
    found, needles = seen_from_the_face(plan_passes(parse_rows(["k3", "k yo k2tog"])))
    is_over = (found.yarns == 1) & (needles == 1)
    below = found.shift[:, 1] == 0
    assert not (is_over[:, 0] & below).any()
    # and the loop of the next row is pulled through it
    assert (is_over.any(axis=1) & ~below).sum() == 4


def test_yarns_of_a_knitted_back_pass_between_both_faces():
    passes = plan_passes(["k"], ["AAB", "ABB"], knitted_back=True)
    assert [each.letters for each in passes] == ["kpkfmp", "mfmpkf", "kfmpmf", "mpkfkp"]
    found, needles = seen_from_the_face(passes)
    letters = np.array([list(each.letters) for each in passes])[found.yarns, needles]
    # a float is below the loops of the face, and above those of the back
    assert "m" not in letters[:, 0]
    assert "f" not in letters[:, 1]
    assert {"m", "f"} <= set(letters.ravel().tolist())


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("rows", "chart"),
    [
        (["kkk", "kmk", "kmk", "kmk"], ()),
        (["kkk", "ktk", "ktk", "ktk"], ()),
        (["kt", "tk"], ()),
        (["k"], ["ABCD", "BCDA"]),
        (["kk", "c2b"], ()),
        (["k3", "k yo k2tog"], ()),
        (["k8", "k yo k2 sk2p k2 yo"], ()),
        (["kf", "fk"], ()),
    ],
)
def test_yarns_of_any_pattern_rest_beside_each_other(rows, chart):
    # relaxing refuses yarns whose crossings are not those of the pattern
    assert 0.0 < relax_knit(parse_rows(rows), 16.0, chart).overlap <= 0.005


@pytest.mark.nightly
@pytest.mark.parametrize("chart", [["AB", "BA"], ["AAB", "ABB"], ["ABC", "BCA"]])
def test_colors_knitted_on_the_back_rest_beside_each_other(chart):
    assert 0.0 < relax_knit(["k"], 16.0, chart, knitted_back=True).overlap <= 0.005


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
