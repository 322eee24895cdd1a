"""Round trips of drafts and looms through WIF, and random files."""

import dataclasses
import doctest
import re
import time

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_wif import BASE, REAL, changed, same, written

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts import wif, wif_writer
from spacemap_vtk.io.drafts.wif import parse_wif, read_wif
from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom

# --- round trips


def test_a_real_draft_is_the_same_after_a_round_trip():
    found = read_wif(REAL)
    again = parse_wif(format_wif(found))
    same(found, again)
    assert again.warnings == ()
    assert format_wif(again) == format_wif(found)
    # without its loom the cloth stays, woven by the smallest loom
    derived = parse_wif(format_wif(dataclasses.replace(found, loom=None)))
    np.testing.assert_array_equal(derived.drawdown, found.drawdown)
    assert derived.loom.shafts == 32


def test_sparse_colours_and_lengths_override_the_defaults():
    extra = "[WARP COLORS]\n3=2\n[WARP SPACING]\n2=0.3\n[WARP THICKNESS]\n4=0.05\n1=0.05\n[WARP]"
    listed = "COLOR TABLE=true\nWARP COLORS=1\nWARP SPACING=1\nWARP THICKNESS=1"
    found = parse_wif(changed({16: extra, 11: listed, 20: "Spacing=0.1\nThickness=0.02"}))
    draft = found
    assert draft.warnings == ()
    red, blue = [255, 0, 0], [0, 0, 255]
    assert draft.warp.colors.tolist() == [red, red, blue, red]
    assert draft.weft.colors.tolist() == [blue, blue]
    assert found.warp.spacing.tolist() == [0.001, 0.003, 0.001, 0.001]
    assert found.warp.thickness.tolist() == [0.0005, 0.0002, 0.0002, 0.0005]
    assert (draft.weft.spacing, draft.weft.thickness) == (0.002, None)
    same(found, parse_wif(format_wif(found)))


def test_the_smallest_loom_is_written():
    loom = Loom.from_drawdown(np.array([[1, 0, 1], [0, 0, 0], [1, 0, 1]], dtype=bool))
    assert loom.threading == ((1,), (2,), (1,))
    assert loom.tieup == ((1,), ())
    assert loom.treadling == ((1,), (2,), (1,))
    assert (loom.shafts, loom.treadles) == (2, 2)


lengths = st.none() | st.floats(1e-6, 1.0)
titles = st.text(st.characters(codec="utf-8"), max_size=20)


@st.composite
def drafts(draw):
    picks, ends = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    warp, weft = (
        DraftThreads(
            colors=draw(st.none() | arrays(np.uint8, (count, 3))),
            spacing=draw(lengths),
            thickness=draw(lengths),
        )
        for count in (ends, picks)
    )
    return Draft(draw(arrays(bool, (picks, ends))), None, warp, weft, draw(titles))


@given(drafts())
def test_any_draft_survives_a_round_trip(draft):
    first = parse_wif(format_wif(draft))
    same(dataclasses.replace(written(draft), title=first.title, loom=first.loom), first)
    assert first.title == re.sub("[\r\n]+", " ", draft.title).strip()
    same(first, parse_wif(format_wif(first)))


numbers = st.lists(st.integers(1, 6), max_size=3, unique=True).map(sorted).map(tuple)


@st.composite
def looms(draw):
    def some_rows(size):
        return st.lists(numbers, min_size=1, max_size=size).map(tuple).filter(any)

    threading, moves = draw(some_rows(8)), draw(some_rows(8))
    tieup = draw(some_rows(6).filter(lambda found: found[-1]))
    lifted = draw(st.booleans())
    return Loom(
        threading=threading,
        tieup=() if lifted else tieup,
        treadling=() if lifted else moves,
        liftplan=moves if lifted else None,
        rising=draw(st.booleans()),
        shafts=draw(st.integers(0, 9)),
        treadles=0 if lifted else draw(st.integers(0, 9)),
    )


def naive_drawdown(loom):
    picks = loom.treadling if loom.liftplan is None else loom.liftplan
    result = []
    for moves in picks:
        row = []
        for shafts in loom.threading:
            moved = False
            for shaft in shafts:
                if loom.liftplan is not None:
                    moved = moved or shaft in moves
                else:
                    for treadle in moves:
                        if treadle <= len(loom.tieup) and shaft in loom.tieup[treadle - 1]:
                            moved = True
            row.append(moved if loom.rising else not moved)
        result.append(row)
    return result


@given(looms(), st.data())
def test_any_loom_survives_a_round_trip(loom, data):
    drawdown = loom.drawdown()
    assert drawdown.tolist() == naive_drawdown(loom)
    own = arrays(np.float64, drawdown.shape[1], elements=st.floats(1e-6, 1.0))
    spacings = data.draw(own)
    alike = (spacings == spacings.mean()).all()
    first = Draft(drawdown, loom, DraftThreads(spacing=spacings.mean() if alike else spacings))
    same(written(first), parse_wif(format_wif(first)))


def test_defaults_are_written_besides_values_of_threads():
    each = np.array([1e-3, 2e-3, 2e-3, 3e-3])
    found = parse_wif(BASE)
    found = dataclasses.replace(found, warp=dataclasses.replace(found.warp, thickness=each))
    text = format_wif(found).decode().split("\r\n")
    warp = text[text.index("[WARP]") : text.index("[WEFT]")]
    assert "Thickness=0.2" in warp  # their mean, in cm
    np.testing.assert_array_equal(parse_wif(format_wif(found)).warp.thickness, each)


def test_a_changed_drawdown_is_written_with_a_new_loom():
    found = parse_wif(BASE)
    again = parse_wif(format_wif(dataclasses.replace(found, drawdown=~found.drawdown)))
    np.testing.assert_array_equal(again.drawdown, ~found.drawdown)


# --- random files


def check_round_trip_or_refusal(data):
    """Read a file: it is refused, or its draft survives a round trip."""
    start = time.process_time()
    try:
        found = parse_wif(data)
    except InputError:
        return
    finally:
        assert time.process_time() - start < 10  # a file that is made to take long takes minutes
    assert all(warning.startswith("line ") for warning in found.warnings)
    if found.drawdown.size < 10_000:
        same(written(found), parse_wif(format_wif(found)))


FULL = BASE + (
    "[WARP COLORS]\n1=2\n[WEFT SPACING]\n2=0.3\n[LIFTPLAN]\n1=1\n[TEXT]\nTitle=t\n"
    "[WARP THICKNESS]\n1=.05\n"
)
NASTY = [
    "", "0", "-1", "1e9", "99999999999", "1e999", "nan", "inf", "=", "[", "]", ";", ",", "1,1,1",
    "٣", "²", "\0", "true", "no", "0,999", "1 2", "1.5", "  ", "_1", "1_000", "0x10", "\x85",
    "[WARP]", "[LIFTPLAN]\n1=1", "Threads=4000", "Units=dp", "Spacing=", "Color=3,1,2,3",
]  # fmt: skip


@example(  # a section whose name begins with a bracket
    data=FULL.encode(), changes=[(FULL.index("[LIFTPLAN"), 0, b"[")]
)
@given(
    st.sampled_from([FULL.encode(), FULL.replace("\n", "\r\n").encode("utf-8-sig")]),
    st.lists(
        st.tuples(st.integers(0, 10**6), st.integers(0, 3), st.binary(max_size=4)), max_size=8
    ),
)
def test_random_bytes_are_read_or_refused(data, changes):
    for where, drop, put in changes:
        at = where % len(data)
        data = data[:at] + put + data[at + drop :]
        if not data:
            break
    check_round_trip_or_refusal(data)


@given(
    st.lists(
        st.tuples(st.integers(0, 10**6), st.integers(0, 3), st.sampled_from(NASTY)), max_size=6
    )
)
def test_random_lines_are_read_or_refused(changes):
    lines = FULL.split("\n")
    for where, how, put in changes:
        at = where % len(lines)
        key, equals, value = lines[at].partition("=")
        lines[at] = (key + equals + put, put + equals + value, put, f"{lines[at]}{put}")[how]
    check_round_trip_or_refusal("\n".join(lines))


@given(st.text() | st.binary())
def test_random_text_is_read_or_refused(data):
    check_round_trip_or_refusal(data)


def test_a_truncated_or_shuffled_draft_is_read_or_refused():
    data = REAL.read_bytes()
    for size in range(0, len(data), 97):
        check_round_trip_or_refusal(data[:size])
        check_round_trip_or_refusal(data[size:])


@pytest.mark.parametrize("module", [wif, wif_writer])
def test_known_hard_inputs_are_read_or_refused(module):
    assert doctest.testmod(module).failed == 0


def test_treadling_beyond_the_picks_is_ignored():
    """Found by fuzzing: the pick is beyond Threads, so the liftplan is used."""
    text = BASE.replace("[TREADLING]\n1=1\n2=2", "[TREADLING]\n12=2") + "[LIFTPLAN]\n1=1\n2=2\n"
    assert "12=2" in text
    found = parse_wif(text)
    assert found.loom.liftplan == ((1,), (2,))
    assert any("presses no treadle" in warning for warning in found.warnings)
    same(written(found), parse_wif(format_wif(found)))
