"""Machine knitting files are read as rows of stitches, and refused by line where they are not."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.yarns.knitout import KnitoutFile, read_knitout
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.rods.stitches import plan_passes

HEADER = [";!knitout-2", ";;Carriers: 1 2 3", ";;Yarn-1: wool #102030", ";;Yarn-2: wool #F0E0D0"]
#: Loops on needles 1 to 6 of the front bed.
CAST_ON = [
    "inhook 1",
    *(f"tuck - f{n} 1" for n in (6, 4, 2)),
    *(f"tuck + f{n} 1" for n in (1, 3, 5)),
]
CAST_ON += ["releasehook 1"]


#: Moves the loop of needle 3 to needle 4.
LEAN = ["xfer f3 b3", "rack 1", "xfer b3 f4", "rack 0"]
#: A part of the needles.
SOME = (1, 2, 3, 4)


def row(way: int, needles: Iterable[str], carrier: str = "1") -> list[str]:
    """Write the operations of a pass; needles as kf1 or tb2, from the left."""
    names = {"k": "knit", "t": "tuck"}
    sign = "+" if way > 0 else "-"
    return [
        f"{names[n[0]]} {sign} {n[1:]} {carrier}" for n in list(needles)[:: 1 if way > 0 else -1]
    ]


def plain(way: int, needles: Iterable[int] = range(1, 7), carrier: str = "1") -> list[str]:
    return row(way, [f"kf{n}" for n in needles], carrier)


def read(folder: Path, *parts: list[str], cast_on: list[str] = CAST_ON) -> KnitoutFile:
    file = folder / "a.k"
    file.write_text(
        "\n".join([*HEADER, *cast_on, *(line for part in parts for line in part)]) + "\n"
    )
    return read_knitout(file)


def test_stockinette_is_rows_of_the_front_bed(tmp_path):
    found = read(tmp_path, plain(1), plain(-1), plain(1), ["outhook 1"])
    assert found.values == {
        "kind": "knit",
        "rows": ["k"],
        "wales": 6,
        "courses": 3,
        "color": ["#102030"],
    }
    assert [str(note) for note in found.notes] == [
        "lines 6 to 11 are the cast-on, which is not drawn"
    ]


def test_rib_is_set_up_by_transfers_to_the_back_bed(tmp_path):
    needles = ["kf1", "kb2", "kf3", "kb4", "kf5", "kb6"]
    found = read(
        tmp_path, [f"xfer f{n} b{n}" for n in (2, 4, 6)], row(1, needles), row(-1, needles)
    )
    assert (found.values["rows"], found.values["courses"]) == (["kp"], 2)


def test_garter_is_knitted_by_transfers_of_full_rows(tmp_path):
    to_back, to_front = ([f"xfer {a}{n} {b}{n}" for n in range(1, 7)] for a, b in ("fb", "bf"))
    back = [f"kb{n}" for n in range(1, 7)]
    found = read(tmp_path, *[plain(1), to_back, row(-1, back), to_front] * 2)
    assert found.values["rows"] == ["k", "p"]


def test_tucks_and_misses_stay_on_their_bed(tmp_path):
    set_up = [f"xfer f{n} b{n}" for n in (2, 4, 6)]
    whole = ["kf1", "kb2", "kf3", "kb4", "kf5", "kb6"]
    tucked = ["tf1", "kb2", "tf3", "kb4", "tf5", "kb6"]
    missed = ["kf1", "kf3", "kf5"]
    found = read(tmp_path, set_up, row(1, whole), row(-1, tucked), row(1, whole), row(-1, missed))
    # a float passes before the loops that the back bed holds
    assert found.values["rows"] == ["kp", "tp", "kp", "kf"]


def test_stripes_have_the_colors_of_their_carriers(tmp_path):
    found = read(
        tmp_path, *[plain(1), plain(-1), plain(1, carrier="2"), plain(-1, carrier="2")] * 2
    )
    assert found.values["rows"] == ["k"]
    assert found.values["color"] == ["#102030", "#102030", "#f0e0d0", "#f0e0d0"]


def test_carriers_that_share_a_row_make_a_chart(tmp_path):
    odd, even = (1, 3, 5), (2, 4, 6)
    found = read(tmp_path, plain(1, odd), plain(1, even, "2"), plain(-1, even), plain(-1, odd, "2"))
    assert found.values["chart"] == ["AB", "BA"]
    assert found.values["courses"] == 2
    letters = [each.letters for each in plan_passes(found.values["rows"], found.values["chart"])]
    assert letters == ["km", "mk", "mk", "km"]


def test_transfers_to_the_side_are_lace(tmp_path):
    # the loop of needle 3 comes behind that of needle 4; the empty needle 3 gets a yarn over
    found = read(tmp_path, plain(1), plain(-1), LEAN, plain(1), plain(-1))
    assert found.values["rows"] == ["kkkkkk", "kkkkkk", "kkyosskkk", "kkkkkk"]
    lace = ["xfer f4 b4", "rack -1", "xfer b4 f3", "rack 0"]
    found = read(tmp_path, plain(1), lace, plain(-1))
    assert found.values["rows"] == ["kkkkkk", "kkk2togyokk"]


def test_extensions_and_versions_are_reported_and_ignored(tmp_path):
    file = tmp_path / "a.k"
    lines = [";!knitout-3", ";;X-Presser: auto", *CAST_ON, "x-stitch-number 5", *plain(1), "pause"]
    file.write_text("\n".join(lines))
    notes = " ".join(read_knitout(file).notes)
    for words in ("version 3", "no header Carriers", "X-Presser", "x-stitch-number"):
        assert words in notes


def test_what_binds_off_is_reported_and_not_drawn(tmp_path):
    off = [
        line
        for n in range(1, 6)
        for line in (
            f"xfer f{n} b{n}",
            "rack 1",
            f"xfer b{n} f{n + 1}",
            "rack 0",
            f"knit + f{n + 1} 1",
        )
    ]
    found = read(tmp_path, plain(1), plain(-1), off, ["outhook 1", "drop f6"])
    assert (found.values["rows"], found.values["courses"]) == (["k"], 2)
    assert "end of the piece" in found.notes[-1]


@pytest.mark.parametrize(
    ("lines", "line", "why", "cure"),
    [
        ([*plain(1), "rack 1", "knit - f6 1"], 20, "racked by 1", "rack 0"),
        ([*plain(1), "xfer f3 b4", *plain(-1)], 19, "do not face each other", "rack -1"),
        ([*plain(1), "knit - f6 1 2"], 19, "2 yarns make one loop", "one carrier"),
        ([*plain(1), "split + f3 b3 1"], 19, "split loop", "xfer"),
        ([*plain(1, SOME), *plain(-1, SOME), *plain(1), *plain(-1)], 17, "short row", "miss"),
        ([*plain(1), "xfer f3 b3", *plain(-1)], 23, "another one is formed opposite", "xfer b3 f3"),
        ([*plain(1), "drop f3", *plain(-1)], 19, "ravels", "bind it off"),
        ([*plain(1), *LEAN, *plain(-1, (1, 2, 4, 5, 6)), *plain(1)], 23, "narrower", "yarn over"),
        ([*plain(1), "knot + f3 1"], 19, "not an operation", "knit, tuck"),
        ([*plain(1), "knit f3 1"], 19, "direction", "knit \\+ f1"),
        ([*plain(1), "knit + g3 1"], 19, "no needle", "b-2"),
    ],
)  # fmt: skip
def test_what_is_no_row_of_a_scene_is_refused_by_line_with_a_cure(tmp_path, lines, line, why, cure):
    with pytest.raises(InputError, match=rf'line {line}, ".+": .*{why}.*{cure}'):
        read(tmp_path, lines)


def test_a_knitout_file_is_drawn_like_a_scene(tmp_path):
    file = tmp_path / "swatch.k"
    file.write_text("\n".join([*HEADER, *CAST_ON, *plain(1), *plain(-1), "x-roller 3"]))
    scene = Scene.read(file)
    scene.update()
    assert scene.textile is not None
    figures = {figure.key: figure.value for figure in scene.textile.figures}
    assert figures["kc"] == pytest.approx(5.41, rel=0.01)
    assert len(scene.textile.yarn_diameters) == 2
    assert any("x-roller" in note for note in scene.warnings)
    file.write_text("knit + f1 A\n")
    with pytest.raises(InputError, match="does not begin with"):
        Scene.read(file)
