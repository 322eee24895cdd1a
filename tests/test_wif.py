"""Weaving Information Files: a real draft, accepted faults and refused faults."""

import dataclasses
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.io.drafts import wif
from spacemap_vtk.io.drafts.wif import parse_wif, read_wif
from spacemap_vtk.io.drafts.wif_writer import format_wif

REAL = Path(__file__).parent.parent / "scenes" / "32-shaft_twill.wif"

# A valid plain weave of 4 ends and 2 picks; tests change its lines by number.
BASE = """\
[WIF]
Version=1.1
[CONTENTS]
WEAVING=true
WARP=true
WEFT=true
THREADING=true
TIEUP=true
TREADLING=true
COLOR PALETTE=true
COLOR TABLE=true
[WEAVING]
Shafts=2
Treadles=2
Rising Shed=true
[WARP]
Threads=4
Color=1
Units=Centimeters
Spacing=0.1
[WEFT]
Threads=2
Color=2
Units=Centimeters
Spacing=0.2
[COLOR PALETTE]
Entries=2
Range=0,255
[COLOR TABLE]
1=255,0,0
2=0,0,255
[THREADING]
1=1
2=2
3=1
4=2
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
"""
PLAIN = ["1010", "0101"]


def changed(changes):
    """Return BASE with some lines, counted from 1, replaced, or removed if None."""
    lines = BASE.splitlines()
    for number, line in changes.items():
        lines[number - 1] = line
    return "\n".join(line for line in lines if line is not None) + "\n"


def rows(draft):
    return ["".join("01"[cell] for cell in row) for row in draft.drawdown.astype(int)]


def same(first, second):
    """Assert that two drafts are equal except for their warnings."""
    for one, other in ((first, second), (first.warp, second.warp), (first.weft, second.weft)):
        for field in dataclasses.fields(one):
            if field.name not in ("warnings", "warp", "weft"):
                a, b = getattr(one, field.name), getattr(other, field.name)
                if isinstance(a, np.ndarray):
                    assert b.dtype == a.dtype
                    np.testing.assert_array_equal(a, b)
                else:
                    assert a == b, field.name


def written(draft):
    """Return a draft as its file stores it: with default colours if it has none."""

    def colored(threads, count, color):
        if threads.colors is not None:
            return threads
        return dataclasses.replace(threads, colors=np.full((count, 3), color, np.uint8))

    ends, picks = draft.size
    warp = colored(draft.warp, ends, (0x2D, 0x6A, 0x8E))
    weft = colored(draft.weft, picks, (0xE8, 0xC7, 0x8F))
    return dataclasses.replace(draft, warp=warp, weft=weft)


# --- a draft that a weaving program wrote


def naive_sections(path):
    sections, name = {}, None
    for line in path.read_text().split("\n"):
        line = line.strip()
        if line.startswith("["):
            name = line[1:-1]
            sections[name] = {}
        elif "=" in line:
            left, right = line.split("=", 1)
            sections[name][left] = right
    return sections


def test_a_real_draft_equals_a_naive_reading():
    sections = naive_sections(REAL)
    draft = found = read_wif(REAL)
    expected = np.zeros((62, 62), dtype=bool)
    for pick in range(62):
        for end in range(62):
            for treadle in sections["TREADLING"][str(pick + 1)].split(","):
                if sections["THREADING"][str(end + 1)] in sections["TIEUP"][treadle].split(","):
                    expected[pick, end] = True
    np.testing.assert_array_equal(draft.drawdown, expected)
    # 17 of 32 shafts rise at each pick
    assert draft.drawdown.dtype == bool
    assert 0.5 < expected.mean() < 0.57
    assert draft.warnings == ()
    for family, colors in (("WARP", draft.warp.colors), ("WEFT", draft.weft.colors)):
        assert colors.dtype == np.uint8
        for thread in range(62):
            index = sections[family + " COLORS"][str(thread + 1)]
            assert ",".join(map(str, colors[thread])) == sections["COLOR TABLE"][index]
    assert tuple(draft.warp.colors[0]) == (55, 117, 178)
    assert tuple(draft.warp.colors[1]) == (125, 60, 87)
    for length in (draft.warp.spacing, draft.weft.spacing, draft.warp.thickness):
        assert length == pytest.approx(0.04167 * 0.0254, rel=1e-15)
    assert draft.weft.thickness == draft.weft.spacing
    assert (found.loom.shafts, found.loom.treadles, found.loom.rising) == (32, 32, True)
    assert found.loom.treadling[0] == (32,)


# --- variants that the standard allows, which give no warning

ALLOWED = {
    "comment after a number": ({33: "1=1 ; selvedge"}, PLAIN),
    "comment after a boolean": ({15: "Rising Shed=YES;jack loom"}, PLAIN),
    "comment line": ({12: "; a comment\n  ;another\n[WEAVING]"}, PLAIN),
    "mixed case": ({12: "[Weaving]", 13: "SHAFTS=2", 32: "[tHreading]", 16: "[warp]"}, PLAIN),
    "blanks": ({13: "  Shafts =  2  ", 15: "Rising   Shed = 1", 33: " 1 = 1"}, PLAIN),
    "several treadles": ({41: "1=1,2"}, ["1111", "0101"]),
    "several shafts for a treadle": ({38: "1=1, 2"}, ["1111", "0101"]),
    "a treadle that is tied twice": ({38: "1=1,1", 41: "1=1,1"}, PLAIN),
    "an end in two heddles": ({33: "1=2,1"}, ["1010", "1101"]),
    "zeros in lists": ({41: "1=0,1", 38: "1=1,0"}, PLAIN),
    "falling shed": ({15: "Rising Shed=false"}, ["0101", "1010"]),
    "falling shed, 0": ({15: "Rising Shed=0"}, ["0101", "1010"]),
    "an end in two heddles, falling shed": (
        {15: "Rising Shed=off", 33: "1=1,2"},
        ["0101", "0010"],
    ),
    "liftplan": ({37: None, 38: None, 39: None, 8: None, 9: "LIFTPLAN=1", 40: "[LIFTPLAN]"}, PLAIN),
    "liftplan and an idle tie-up": ({9: "LIFTPLAN=1", 40: "[LIFTPLAN]"}, PLAIN),
    "more shafts than are used": ({13: "Shafts=8", 14: "Treadles=10"}, PLAIN),
    "idle treadles beyond the stated": ({39: "2=2\n3=0\n4="}, PLAIN),
    "private section": ({12: "[PRIVATE X Y]\nno equals sign\n1=\n1=\n[WEAVING]"}, PLAIN),
    "notes": ({3: "[NOTES]\njust text\n[CONTENTS]\nNOTES=1"}, PLAIN),
    "leading zeros": ({33: "01=001"}, PLAIN),
    "numbers as reals": ({17: "Threads=4.0"}, PLAIN),
    "empty lengths and colours": ({20: "Spacing=", 18: "Color="}, PLAIN),
}


@pytest.mark.parametrize("name", ALLOWED)
def test_variants_of_the_standard_give_no_warning(name):
    changes, expected = ALLOWED[name]
    draft = parse_wif(changed(changes))
    assert rows(draft) == expected
    assert draft.warnings == ()


def test_any_order_of_sections():
    sections = ["[" + part for part in BASE.split("[")[1:]]
    draft = parse_wif("".join(reversed(sections)))
    same(parse_wif(BASE), parse_wif("".join(reversed(sections))))
    assert draft.warnings == ()


@pytest.mark.parametrize(
    ("units", "metres"),
    [
        *((name, 0.0254 / 720) for name in ("Decipoints", "decipoint", "dp", "DPTS")),
        *((name, 0.0254) for name in ("Inches", "INCH", "in", "in.", "inches ;comment")),
        *((name, 0.01) for name in ("Centimeters", "centimetres", "Centimeter", "CM", "c.m.")),
    ],
)
def test_units_are_converted_to_metres(units, metres):
    draft = parse_wif(changed({19: f"Units={units}", 20: "Spacing=.5"}))
    assert draft.warp.spacing == pytest.approx(0.5 * metres, rel=1e-15)
    assert draft.weft.spacing == 0.002
    assert draft.warnings == ()


@pytest.mark.parametrize(
    ("range_", "color", "expected"),
    [
        ("0,255", "255,128,0", [255, 128, 0]),
        ("0,999", "999,500,0", [255, 128, 0]),
        ("0, 65535", "65535,257,0", [255, 1, 0]),
        ("0,15", "15,8,0", [255, 136, 0]),
        ("100,200", "200,150,100", [255, 128, 0]),
        ("0,255", "255;comment", None),
    ],
)
def test_colour_ranges_are_scaled_to_255(range_, color, expected):
    draft = parse_wif(changed({28: f"Range={range_}", 30: f"1={color}", 31: "2=0,0,0"}))
    if expected:
        assert draft.warp.colors.tolist() == [expected] * 4


def test_inline_colours_replace_a_missing_palette():
    draft = parse_wif(changed({18: "Color=7,1,2,3", 23: "Color=1,9,9,9"}))
    assert draft.warp.colors.tolist() == [[1, 2, 3]] * 4
    # the table wins, as the standard has it
    assert draft.weft.colors.tolist() == [[255, 0, 0]] * 2
    assert draft.warnings == ()


def test_a_draft_may_have_no_colours():
    gone = dict.fromkeys([10, 11, 18, 23, *range(26, 32)])
    draft = parse_wif(changed(gone))
    assert (draft.warp.colors, draft.weft.colors, draft.warnings) == (None, None, ())


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("codec", ["utf-8", "utf-8-sig"])
def test_encodings_and_line_ends_are_detected(codec, end):
    text = changed({3: "[TEXT]\nTitle=Köper; breit \n[CONTENTS]\nTEXT=1"}).replace("\n", end)
    draft = parse_wif(text.encode(codec))
    # a semicolon in a string is no comment
    assert (draft.title, draft.warnings, rows(draft)) == ("Köper; breit", (), PLAIN)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_latin_1_is_reported_with_its_line(end):
    text = changed({3: "[TEXT]\nTitle=Köper\n[CONTENTS]\nTEXT=1"}).replace("\n", end)
    draft = parse_wif(text.encode("latin-1"))
    assert draft.title == "Köper"
    assert len(draft.warnings) == 1
    assert draft.warnings[0].startswith("line 4: ")
    assert "Latin-1" in draft.warnings[0]


def test_utf_16_is_read_with_a_warning():
    draft = parse_wif(BASE.encode("utf-16"))
    assert rows(draft) == PLAIN
    assert draft.warnings[0].startswith("line 1: the file is UTF-16")


# --- accepted faults: changed lines, line and text of the only warning, drawdown

FLOAT_3 = ["1000", "0101"]
ACCEPTED = {
    "no [WIF]": ({1: None, 2: None}, 1, "section [WIF] is missing", PLAIN),
    "version": ({2: "Version=1.0"}, 2, 'Version "1.0" is unknown; version 1.1 is assumed', PLAIN),
    "no version": ({2: None}, 1, "no Version", PLAIN),
    "no [CONTENTS]": (dict.fromkeys(range(3, 12)), 1, "section [CONTENTS] is missing", PLAIN),
    "[CONTENTS] lists too much": ({9: "TREADLING=1\nLIFTPLAN=1"}, 10, "[LIFTPLAN]", PLAIN),
    "[CONTENTS] lists too little": ({7: None}, 31, "does not list [THREADING]", PLAIN),
    "[CONTENTS] denies": ({7: "THREADING=no"}, 32, "does not list [THREADING]", PLAIN),
    "text before all": ({1: "hello\n[WIF]"}, 1, "before the first section", PLAIN),
    "no equals sign": ({13: "Shafts=2\nhello"}, 14, '"hello" is not of the form', PLAIN),
    "no bracket": ({12: "[WEAVING ; x"}, 12, 'has no "]"', PLAIN),
    "unknown section": ({12: "[TREADLNG]\n1=1\n[WEAVING]", 11: "COLOR TABLE=1\nTREADLNG=1"}, 13,
                        "unknown section [TREADLNG]", PLAIN),
    "section twice": ({35: "[threading]\n3=1"}, 35, "[THREADING] is given twice, first in line 32",
                      PLAIN),
    "key twice": ({34: "2=1\n02=2"}, 35, "[THREADING] 02 is given twice, first in line 34", PLAIN),
    "key that is no number": ({33: "1=1\nx=2"}, 34, '"x" is not a number from 1', PLAIN),
    "key 0": ({33: "1=1\n0=2"}, 34, '"0" is not a number from 1', PLAIN),
    "no rising shed": ({15: None}, 12, "no Rising Shed; a rising shed is assumed", PLAIN),
    "rising shed empty": ({15: "Rising Shed="}, 15, "a rising shed is assumed", PLAIN),
    "rising shed unreadable": ({15: "Rising Shed=up"}, 15, 'Rising Shed "up" is neither', PLAIN),
    "no shafts": ({13: None}, 12, "no Shafts; 2 is assumed", PLAIN),
    "shafts 0": ({13: "Shafts=0"}, 13, "no Shafts; 2 is assumed", PLAIN),
    "too few shafts, threading": ({13: "Shafts=2", 36: "4=3", 39: "2=2"}, 36,
                                  "shaft 3 is above Shafts=2", ["1010", "0100"]),
    "too few shafts, tie-up": ({39: "2=2,5"}, 39, "[TIEUP] shaft 5 is above Shafts=2", PLAIN),
    "no treadles": ({14: "Treadles="}, 14, "no Treadles; 2 is assumed", PLAIN),
    "tie-ups beyond the treadles": ({39: "2=2\n3=1\n4=1"}, 40, "treadle 3 is above Treadles=2",
                                    PLAIN),
    "no tie-up for a treadle": ({14: "Treadles=3", 41: "1=1,3"}, 41, "treadle 3", PLAIN),
    "no ends": ({17: "Threads="}, 17, "[WARP] has no Threads; 4 is assumed", PLAIN),
    "no picks": ({22: None}, 21, "[WEFT] has no Threads; 2 is assumed", PLAIN),
    "ends 0": ({17: "Threads=0"}, 17, "[WARP] has no Threads; 4 is assumed", PLAIN),
    "threading beyond the ends": ({17: "Threads=2"}, 35, "[THREADING] 3 is beyond the 2 threads",
                                  ["10", "01"]),
    "treadling beyond the picks": ({22: "Threads=1"}, 42, "[TREADLING] 2 is beyond", ["1010"]),
    "end in no heddle": ({35: None}, 32, "end 3 floats across the cloth, under every pick",
                         FLOAT_3),
    "end in heddle 0": ({35: "3=0"}, 35, "end 3 floats across the cloth", FLOAT_3),
    "end with an empty value": ({35: "3="}, 35, "end 3 floats across the cloth", FLOAT_3),
    "two ends in no heddle": ({34: "2=0", 35: None}, 34, "ends 2, 3 float across",
                              ["1000", "0001"]),
    "end in no heddle, falling shed": ({35: "3=", 15: "Rising Shed=no"}, 35, "over every pick",
                                       ["0111", "1010"]),
    "empty pick": ({41: "1=0"}, 41, "pick 1 floats across the cloth, over every end",
                   ["0000", "0101"]),
    "pick left out": ({41: None}, 40, "pick 1 floats", ["0000", "0101"]),
    "pick of an idle treadle": ({38: "1=0"}, 41, "pick 1 floats", ["0000", "0101"]),
    "treadling and liftplan": ({9: "TREADLING=1\nLIFTPLAN=1", 40: "[LIFTPLAN]\n1=2\n[TREADLING]"},
                               41, "the treadling is used", PLAIN),
    "treadling of zeros and liftplan": (
        {9: "LIFTPLAN=1", 40: "[LIFTPLAN]\n1=2\n2=1\n[TREADLING]", 8: "TIEUP=1\nTREADLING=1",
         41: "1=0", 42: "2="},
        44, "the treadling presses no treadle; the liftplan is used", ["0101", "1010"]),
    "treadling without tie-up and liftplan": (
        {8: "LIFTPLAN=1", 37: "[LIFTPLAN]", 38: "1=2", 39: "2=1"},
        40, "the treadling has no tie-up; the liftplan is used", ["0101", "1010"]),
    "blanks for commas": ({38: "1=1 2"}, 38, "spaces between", ["1111", "0101"]),
    "words after numbers": ({33: "1=1 (left)"}, 33, '"(left)" after the numbers', PLAIN),
    "range missing": ({28: None}, 26, "is missing; 0,255 is assumed", PLAIN),
    "range missing, 0 to 999": ({28: None, 30: "1=999,0,0"}, 26, "0,999 is assumed", PLAIN),
    "range missing, 16 bit": ({28: "Range=", 30: "1=40000,0,0"}, 28, "0,65535 is assumed", PLAIN),
    "range unreadable": ({28: "Range=255,0"}, 28, '"255,0" cannot be read; 0,255', PLAIN),
    "colour outside of the range": ({30: "1=300,0,0"}, 30, "outside the Range", PLAIN),
    "colour form": ({27: "Entries=2\nForm=HSV"}, 28, "Form=HSV is read as RGB", PLAIN),
    "colour entries": ({27: "Entries=20"}, 27, "Entries=20, but [COLOR TABLE] has 2", PLAIN),
    "colour of the table": ({31: "2=0,0,255\n3=red"}, 32, '"red" is not r,g,b', PLAIN),
    "colour not in the table": ({18: "Color=7"}, 18, "colour 7 is not in [COLOR TABLE]", PLAIN),
    "colour 0": ({18: "Color=0"}, 18, "colour 0 is not in [COLOR TABLE]", PLAIN),
    "colour as r,g,b": ({18: "Color=1,2,3"}, 18, "read as r,g,b", PLAIN),
    "colour and more": ({18: "Color=1,2"}, 18, "numbers after the index", PLAIN),
    "colour unreadable": ({18: "Color=red"}, 18, '"red" is not a colour', PLAIN),
    "colour of few threads": (
        {11: "COLOR TABLE=1\nWARP COLORS=1", 18: None, 21: "[WARP COLORS]\n2=2\n[WEFT]"},
        21, "3 threads have no colour in [WARP COLORS] or [WARP]; they get that of thread 2",
        PLAIN),
    "colours beyond the ends": (
        {11: "COLOR TABLE=1\nWARP COLORS=1", 21: "[WARP COLORS]\n9=2\n[WEFT]"},
        23, "[WARP COLORS] 9 is beyond the 4 threads", PLAIN),
    "units missing": ({19: None}, 16, "[WARP] has no Units; centimeters are assumed", PLAIN),
    "units empty": ({19: "Units="}, 19, "[WARP] has no Units; centimeters are assumed", PLAIN),
    "units unknown": ({19: "Units=cubits"}, 19, 'unknown Units "cubits"; centim', PLAIN),
    "units not of the standard": ({19: "Units=mm"}, 19, "Units=mm is not in the standard", PLAIN),
    "decimal comma": ({20: "Spacing=0,1"}, 20, "the comma is read as a point", PLAIN),
    "spacing 0": ({20: "Spacing=0"}, 20, "Spacing of 0 in [WARP] is treated as not given", PLAIN),
    "spacing negative": ({20: "Spacing=-1"}, 20, "is not between 1 µm and 1 m", PLAIN),
    "spacing huge": ({20: "Spacing=1e200"}, 20, "is not between 1 µm and 1 m", PLAIN),
    "spacing unreadable": ({20: "Spacing=wide"}, 20, '"wide" in [WARP] is not a number', PLAIN),
    "spacing nan": ({20: "Spacing=nan"}, 20, '"nan" in [WARP] is not a number', PLAIN),
    "spacing of few threads": (
        {11: "COLOR TABLE=1\nWARP SPACING=1", 20: None, 21: "[WARP SPACING]\n2=0.3\n[WEFT]"},
        21, "get the mean of the others", PLAIN),
}  # fmt: skip


@pytest.mark.parametrize("name", ACCEPTED)
def test_a_clear_fault_is_read_with_one_warning(name):
    changes, line, printed, expected = ACCEPTED[name]
    found = parse_wif(changed(changes))
    draft = found
    assert rows(draft) == expected
    assert len(draft.warnings) == 1, draft.warnings
    assert draft.warnings[0].startswith(f"line {line}: ")
    assert printed in draft.warnings[0]
    same(written(found), parse_wif(format_wif(found)))


def test_equal_warnings_are_counted():
    draft = parse_wif(changed({33: "1=1 x", 35: "3=1 y", 38: "1=1 z"}))
    assert draft.warnings == (
        'line 33: "x" after the numbers is ignored (and 2 more, the last in line 38)',
    )


def test_faults_of_the_header_share_one_warning():
    bare = parse_wif(changed(dict.fromkeys(range(1, 12))))
    assert bare.warnings == (
        "line 1: section [WIF] is missing; version 1.1 is assumed; section [CONTENTS] is missing",
    )
    other = parse_wif(changed({2: None, 7: None, 8: None, 9: "TREADLING=1\nNOTES=1\nTEXT=1"}))
    assert len(other.warnings) == 1
    assert other.warnings[0].startswith(
        "line 1: [WIF] has no Version; version 1.1 is assumed; [CONTENTS] lists"
    )
    assert (
        "[NOTES] and 1 more, but the file has no such section; [CONTENTS] does not list [THREADING]"
        in other.warnings[0]
    )


def test_missing_units_are_inches():
    draft = parse_wif(changed({19: None, 24: None}))
    assert draft.warp.spacing == 0.1 * 0.0254
    assert [warning.split(":")[0] for warning in draft.warnings] == ["line 16", "line 20"]


def test_values_read_from_faulty_lines():
    assert parse_wif(changed({28: None, 30: "1=999,500,0"})).warp.colors[0].tolist() == [
        255,
        128,
        0,
    ]
    assert parse_wif(changed({18: "Color=1,2,3"})).warp.colors[0].tolist() == [1, 2, 3]
    assert parse_wif(changed({20: "Spacing=0,1"})).warp.spacing == 0.001
    assert parse_wif(changed({20: "Spacing=0"})).warp.spacing is None
    assert parse_wif(changed({18: "Color=7"})).warp.colors is None
    assert parse_wif(changed({30: "1=300,0,-5"})).warp.colors[0].tolist() == [255, 0, 0]


# --- refused faults: changed lines, line and text of the error

REFUSED = {
    "no section": (None, 1, "no section of a draft", InputError),
    "no threading": (dict.fromkeys(range(32, 37)), 37, "[THREADING] threads no end", InputError),
    "empty threading": (dict.fromkeys(range(33, 37)), 32, "[THREADING] threads no end", InputError),
    "threading of zeros": (
        {33: "1=0", 34: "2=", 35: None, 36: None},
        32,
        "threads no end",
        InputError,
    ),
    "no treadling": (
        dict.fromkeys(range(40, 43)),
        39,
        "[TREADLING] presses no treadle",
        InputError,
    ),
    "treadling of zeros": ({41: "1=0", 42: "2=0"}, 40, "no treadle", InputError),
    "no tie-up": (dict.fromkeys(range(37, 40)), 39, "has no [TIEUP]", InputError),
    "shaft in words": ({34: "2=two"}, 34, "must be a list of numbers", InputError),
    "shaft negative": ({34: "2=-2"}, 34, "must be a list of numbers", InputError),
    "shaft real": ({34: "2=1.5"}, 34, "must be a list of numbers", InputError),
    "word in a list": ({38: "1=1,x,2"}, 38, "must be a list of numbers", InputError),
    "treadle in words": ({42: "2=second"}, 42, "must be a list of numbers", InputError),
    "foreign digits": ({34: "2=٢"}, 34, "must be a list of numbers", InputError),
    "shaft too high": ({34: "2=100001"}, 34, "too large", SizeError),
    "shaft endless": ({34: "2=" + "9" * 9999}, 34, "too large", SizeError),
    "treadle too high": ({39: "100001=2"}, 39, "too many treadles", SizeError),
    "threads unreadable": ({17: "Threads=many"}, 17, "must be a whole number", InputError),
    "threads negative": ({17: "Threads=-4"}, 17, "must be a whole number", InputError),
    "threads broken": ({17: "Threads=4.5"}, 17, "must be a whole number", InputError),
    "threads too many": ({17: "Threads=1000000000"}, 17, "too large", SizeError),
    "threads too many, 1e9": ({17: "Threads=1e9"}, 17, "too large", SizeError),
    "threads assumed too many": ({17: None, 33: "999999=1"}, 32, "too many", SizeError),
    "shafts too many": ({13: "Shafts=1e99"}, 13, "too large", SizeError),
    "treadles unreadable": ({14: "Treadles=?"}, 14, "must be a whole number", InputError),
    "cloth too large": ({17: "Threads=9000", 22: "Threads=9000"}, 22, "too large", SizeError),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_unclear_fault_is_refused_with_its_line(name):
    changes, line, printed, kind = REFUSED[name]
    text = "hello" if changes is None else changed(changes)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=rf"line {line}: ") as caught:
            parse_wif(text)
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()
    assert type(caught.value) is kind
    assert printed in str(caught.value)
    assert caught.value.allowed
    assert caught.value.cure


def test_an_error_names_key_value_and_cure():
    with pytest.raises(InputError) as caught:
        parse_wif(changed({34: "2=two"}))
    error = caught.value
    assert (error.key, error.value) == ("[THREADING] 2", "two")
    assert str(error).startswith(
        '[THREADING] 2 = "two": line 34: the value must be a list of numbers; allowed:'
    )


def test_a_file_that_is_too_large_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(wif, "MAX_LENGTH", 100)
    with pytest.raises(SizeError, match="too large"):
        parse_wif(BASE)
    path = tmp_path / "long.wif"
    path.write_text(BASE)
    with pytest.raises(SizeError, match=r"long\.wif"):
        read_wif(path)


def test_read_wif_names_the_file(tmp_path):
    path = tmp_path / "a.wif"
    path.write_text(changed({34: "2=two"}))
    with pytest.raises(InputError) as caught:
        read_wif(str(path))
    assert caught.value.file == str(path)
    assert str(caught.value).startswith(f"{path}: [THREADING] 2")
    for missing in (tmp_path / "none.wif", tmp_path, tmp_path / "nul\0.wif"):
        with pytest.raises(InputError, match="cannot be read") as caught:
            read_wif(missing)
        assert caught.value.file == str(missing)
