"""Editing a draft without a window: draws, blocks, orders of threads, and edits of the whole."""

from __future__ import annotations

import doctest

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_loom import looms

from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes import draft_edits as edits
from spacemap_vtk.scenes.draft_edits import Selection
from spacemap_vtk.scenes.editable_draft import EditableDraft, scene_changes
from spacemap_vtk.textile.drafts import blocks, draws, loom_edits, orders
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.floats import find_floats, mark_floats
from spacemap_vtk.textile.drafts.loom import Loom, count_marks, from_marks, to_marks

TWILL = Loom(
    threading=((1,), (2,), (3,), (4,)) * 2,
    tieup=((1, 2), (2, 3), (3, 4), (1, 4)),
    treadling=((1,), (2,), (3,), (4,), (3,), (2,)),
)


def draft_of(loom: Loom, is_pattern: bool = False) -> EditableDraft:
    """Make a draft whose yarns have different colours and spacings."""
    drawdown = loom.drawdown()
    picks, ends = drawdown.shape
    warp, weft = (np.arange(3 * n, dtype=np.uint8).reshape(n, 3) for n in (ends, picks))
    threads = [
        DraftThreads(spacing=1e-3 * np.arange(1, len(colors) + 1), colors=colors)
        for colors in (warp, weft)
    ]
    source = Draft(drawdown, loom, *threads)
    if is_pattern:
        source = Draft(drawdown)
    return EditableDraft(loom, drawdown, warp, weft, is_pattern, source)


@pytest.mark.parametrize("module", [draws, blocks, orders])
def test_examples(module):
    assert doctest.testmod(module).failed == 0


@given(st.integers(0, 40), st.integers(1, 9), st.integers(1, 9))
def test_draws_stay_between_their_shafts_and_can_run_down(count, first, last):
    for kind in ("straight", "point", "broken"):
        numbers = draws.make_draw(kind, count, first, last)
        assert len(numbers) == count
        assert set(numbers.tolist()) <= {*range(min(first, last), max(first, last) + 1)}
        # Downwards: the same draw with the shafts counted from the other side.
        np.testing.assert_array_equal(
            numbers, first + last - draws.make_draw(kind, count, last, first)
        )


def test_broken_draw_cuts_balanced_twill_clean():
    for shafts, run in ((4, 4), (4, 2), (8, 8), (8, 12)):
        numbers = draws.make_draw("broken", 6 * run, 1, shafts, run)
        half = shafts // 2
        ties = tuple(
            tuple(sorted((t + k) % shafts + 1 for k in range(half))) for t in range(shafts)
        )
        treadling = tuple((t,) for t in range(1, shafts + 1))
        cloth = Loom(tuple((n,) for n in numbers.tolist()), ties, treadling).drawdown()
        for end in range(run, len(numbers), run):
            # The two ends at a break lie on opposite sides at every pick.
            assert (cloth[:, end - 1] != cloth[:, end]).all()


def test_advancing_runs_rise_by_one_and_begin_one_higher():
    runs = draws.make_draw("advancing", 48, 1, 12, 4).reshape(-1, 4)
    assert ((np.diff(runs, axis=1) - 1) % 12 == 0).all()
    assert ((np.diff(runs[:, 0]) - 1) % 12 == 0).all()


@given(st.lists(st.integers(1, 16), min_size=1, max_size=40))
def test_a_network_weaves_tabby_whatever_the_pattern_line(line):
    numbers = draws.network_draw(line, 16, 4)
    assert (((numbers - np.array(line)) % 16) < 4).all()
    # Odd ends are on odd shafts: that is what a network of an even initial is for.
    np.testing.assert_array_equal(numbers % 2, (np.arange(len(line)) + 1) % 2)
    with pytest.raises(InputError, match="divide 10"):
        draws.network_draw(line, 10, 4)


@given(looms())
def test_marks_are_numbers_and_back(loom):
    rows = tuple(tuple(sorted(set(row))) for row in loom.threading)
    marks = to_marks(rows, loom.shafts)
    assert from_marks(marks) == rows
    assert count_marks(rows, loom.shafts) == tuple(marks.sum(axis=0).tolist())


@given(looms(), st.sampled_from(["shaft", "treadle"]), st.data())
def test_exchange_of_shafts_or_treadles_keeps_the_cloth(loom, what, data):
    count = loom.shafts if what == "shaft" else loom.treadles
    first, second = (data.draw(st.integers(1, count)) for _ in range(2)) if count else (1, 1)
    exchanged = loom_edits.exchange(loom, what, first, second) if count else loom
    np.testing.assert_array_equal(exchanged.drawdown(), loom.drawdown())
    uses = [
        count_marks(each.threading if what == "shaft" else each.treadling, count)
        for each in (loom, exchanged)
    ]
    order = list(range(count))
    if count:
        order[first - 1], order[second - 1] = second - 1, first - 1
    assert uses[1] == tuple(uses[0][k] for k in order)


@given(arrays(bool, st.tuples(st.integers(1, 6), st.integers(2, 6))))
def test_blocks_are_text_and_back(block):
    np.testing.assert_array_equal(blocks.read_block(blocks.write_block(block)), block)
    colors = np.arange(6 * len(block), dtype=np.uint8).reshape(-1, 1, 3)
    np.testing.assert_array_equal(blocks.read_block(blocks.write_block(colors)), colors)


def test_lists_of_numbers_are_read_as_marks():
    assert from_marks(blocks.read_block("1, 2, 3, 2")) == ((1,), (2,), (3,), (2,))
    assert from_marks(blocks.read_block("1 3\n0\n2")) == ((1, 3), (), (2,))
    assert blocks.read_block("01\n10").tolist() == [[False, True], [True, False]]
    for text in ("", "Dear weaver", "1 2 shaft"):
        with pytest.raises(InputError, match="clipboard"):
            blocks.read_block(text)


@given(looms())
def test_swapped_faces_and_turned_drafts_weave_what_they_should(loom):
    cloth = loom.drawdown()
    np.testing.assert_array_equal(loom_edits.swap_faces(loom).drawdown(), ~cloth)
    np.testing.assert_array_equal(loom_edits.turn_loom(loom).drawdown(), ~cloth.T)
    np.testing.assert_array_equal(loom_edits.swap_faces(loom.with_liftplan).drawdown(), ~cloth)


def test_simple_looms_keep_their_shed_when_faces_are_swapped():
    swapped = loom_edits.swap_faces(TWILL)
    assert swapped.rising
    assert swapped.tieup == ((3, 4), (1, 4), (1, 2), (2, 3))
    assert loom_edits.swap_faces(swapped) == TWILL


@given(arrays(bool, st.tuples(st.integers(1, 7), st.integers(1, 7))), st.integers(1, 4))
def test_marked_crossings_are_those_of_long_floats(drawdown, most):
    for face in (True, False):
        marks = mark_floats(drawdown, (most, most), face)
        expected = np.zeros_like(marks)
        for family in (0, 1):
            for yarn, begin, length in zip(*find_floats(drawdown, family, face), strict=True):
                if length > most:
                    passed = slice(begin, begin + length)
                    expected[(passed, yarn) if family == 0 else (yarn, passed)] = True
        np.testing.assert_array_equal(marks, expected)


def test_threads_move_with_marks_colours_and_spacings():
    before = draft_of(TWILL)
    after = edits.repeat_threads(before, 0, slice(1, 4), times=2, mirrored=True)
    order = [0, 1, 2, 3, 2, 1, 4, 5, 6, 7]
    np.testing.assert_array_equal(after.drawdown, before.drawdown[:, order])
    np.testing.assert_array_equal(after.loom.drawdown(), after.drawdown)
    np.testing.assert_array_equal(after.warp, before.warp[order])
    np.testing.assert_array_equal(after.source.warp.spacing, before.source.warp.spacing[order])
    deleted = edits.delete_threads(edits.insert_threads(before, 1, 2, 3), 1, slice(2, 5))
    np.testing.assert_array_equal(deleted.drawdown, before.drawdown)
    assert deleted.loom == before.loom
    np.testing.assert_array_equal(deleted.source.weft.spacing, before.source.weft.spacing)
    empty = edits.insert_threads(before, 0, 8, 1)
    assert empty.loom.threading[8] == ()
    with pytest.raises(InputError, match="at least one end"):
        edits.delete_threads(before, 0, slice(0, 8))
    doubled = edits.double_threads(before, 0, slice(0, 8))
    np.testing.assert_array_equal(doubled.drawdown, np.repeat(before.drawdown, 2, axis=1))


def test_liftplans_and_patterns_are_rearranged_too():
    lifted = draft_of(TWILL.with_liftplan)
    reversed_ = edits.reverse_threads(lifted, 1, slice(0, 6))
    np.testing.assert_array_equal(reversed_.loom.drawdown(), lifted.drawdown[::-1])
    pattern = edits.insert_threads(draft_of(TWILL, is_pattern=True), 0, 1, 2)
    assert pattern.is_pattern
    assert not pattern.drawdown[:, 1:3].any()
    np.testing.assert_array_equal(np.delete(pattern.drawdown, [1, 2], 1), TWILL.drawdown())


def test_blocks_are_mirrored_shifted_and_repeated_in_their_grid_only():
    before = draft_of(TWILL)
    ends = Selection("threading", (1, 4), (1, 4))
    assert edits.mirror(before, ends, 1).loom.threading[:5] == ((4,), (3,), (2,), (1,), (1,))
    upside_down = edits.mirror(before, ends, 0)
    assert upside_down.loom.threading[:5] == ((4,), (3,), (2,), (1,), (1,))
    assert edits.shift(before, ends, 0, 1).loom.threading[:5] == ((2,), (3,), (4,), (1,), (1,))
    assert edits.shift(before, ends, 1, 0).loom.threading[:5] == ((4,), (1,), (2,), (3,), (1,))
    pointed = edits.fill_with_numbers(before, ends, draws.make_draw("point", 4, 1, 3))
    assert pointed.loom.threading[:4] == ((1,), (2,), (3,), (2,))
    repeated = edits.repeat_to_end(pointed, ends)
    assert repeated.loom.threading[4:] == pointed.loom.threading[:4]
    for changed in (upside_down, pointed, repeated):
        np.testing.assert_array_equal(changed.drawdown, changed.loom.drawdown())
        np.testing.assert_array_equal(changed.warp, before.warp)
    inverted = edits.invert(before, Selection("tieup", (1, 4), (1, 4)))
    np.testing.assert_array_equal(inverted.drawdown, ~before.drawdown)
    weave = edits.fill_with_weave(before, edits.select_all(before, "tieup"), "twill 1/3")
    assert weave.loom.tieup == ((1,), (2,), (3,), (4,))
    with pytest.raises(InputError, match="determines the drawdown"):
        edits.invert(before, Selection("drawdown", (1, 1), (1, 1)))


def test_a_threading_is_pasted_into_the_treadling():
    before = draft_of(TWILL)
    block = edits.read_block(before, Selection("threading", (1, 3), (1, 4)))
    at = Selection("treadling", (1, 1), (2, 2))
    pasted = edits.paste(before, at, block)
    assert pasted.loom.treadling == ((1,), (1,), (2,), (3,), (3,), (2,))
    # A larger selection is filled with copies; an overlay keeps the marks.
    filled = edits.paste(before, Selection("treadling", (1, 4), (1, 6)), block)
    assert filled.loom.treadling == ((1,), (2,), (3,)) * 2
    overlaid = edits.paste(before, at, block, overlay=True)
    assert overlaid.loom.treadling[1] == (1, 2)
    inserted, place = edits.paste_threads(before, at, block)
    assert inserted.loom.treadling[:5] == ((1,), (1,), (2,), (3,), (2,))
    assert place == Selection("treadling", (1, 4), (2, 4))
    np.testing.assert_array_equal(inserted.drawdown, inserted.loom.drawdown())
    with pytest.raises(InputError, match="reach beyond the treadling"):
        edits.paste(before, Selection("treadling", (3, 3), (1, 1)), block)
    with pytest.raises(InputError, match="need colours"):
        edits.paste(before, Selection("warp", (1, 1), (1, 1)), block)
    colors = edits.read_block(before, Selection("warp", (2, 3), (1, 1)))
    painted = edits.paste(before, Selection("weft", (1, 1), (4, 4)), colors)
    np.testing.assert_array_equal(painted.weft[3:5], before.warp[1:3])


def test_two_threadings_are_interleaved():
    before = draft_of(TWILL)
    block = blocks.read_block("4 3")
    after, place = edits.interleave(before, Selection("threading", (2, 4), (1, 4)), block)
    assert [row[0] for row in after.loom.threading] == [1, 2, 4, 3, 3, 4, 4, 1, 2, 3, 4]
    assert place == Selection("threading", (2, 7), (1, 4))
    np.testing.assert_array_equal(after.drawdown, after.loom.drawdown())
    with pytest.raises(InputError, match="reach beyond the threading"):
        edits.interleave(before, place, blocks.read_block("5"))


def test_whole_drafts_are_woven_as_drawn_in_turned_and_turned_over():
    before = draft_of(TWILL)
    drawn_in = edits.weave_as_drawn_in(before)
    assert drawn_in.loom.treadling == TWILL.threading
    assert drawn_in.size == (8, 8)
    with pytest.raises(InputError, match="liftplan has no treadles"):
        edits.weave_as_drawn_in(draft_of(TWILL.with_liftplan))
    turned = edits.turn_draft(before)
    np.testing.assert_array_equal(turned.drawdown, ~before.drawdown.T)
    np.testing.assert_array_equal(turned.loom.drawdown(), turned.drawdown)
    np.testing.assert_array_equal(turned.source.warp.spacing, before.source.weft.spacing)
    wasteful = draft_of(Loom(((2,), (5,), (7,), (5,)), ((), (2, 5), (7,)), ((3,), (2,))))
    reduced = edits.reduce_loom(wasteful)
    np.testing.assert_array_equal(reduced.loom.drawdown(), wasteful.drawdown)
    assert (reduced.loom.shafts, reduced.loom.treadles) == (2, 2)
    over = edits.turn_over(before)
    np.testing.assert_array_equal(over.drawdown, ~before.drawdown[:, ::-1])
    np.testing.assert_array_equal(over.warp, before.warp[::-1])
    for changed in (drawn_in, turned, over):
        assert changed.source.warp.colors is not None
        np.testing.assert_array_equal(changed.source.warp.colors, changed.warp)


def test_only_what_an_edit_changes_is_written_to_the_scene():
    before, stored = draft_of(TWILL), []

    def store(draft: Draft) -> str:
        stored.append(draft)
        return "new.wif"

    assert scene_changes(before, before, set(), store) == {}
    shifted = edits.shift(before, edits.select_all(before, "threading"), 0, 1)
    assert scene_changes(before, shifted, set(), store) == {"draft": "new.wif", "pattern": None}
    longer = edits.insert_threads(before, 0, 0, 1)
    changes = scene_changes(before, longer, set(), store)
    assert changes == {"draft": "new.wif", "pattern": None, "ends": None, "picks": None}
    np.testing.assert_array_equal(stored[-1].warp.colors, longer.warp)
    # Colours that the scene sets are moved as well.
    assert len(scene_changes(before, longer, {"warp_color"}, store)["warp_color"]) == 9
    painted = edits.fill_with_color(before, Selection("weft", (1, 1), (1, 6)), (1, 2, 3))
    assert scene_changes(before, painted, set(), store) == {"weft_color": "#010203"}
    assert len(stored) == 3
