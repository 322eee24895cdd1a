"""Knits as scenes: their yarns, colours, figures and refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.filters.textile_source import TextileSource
from spacemap_vtk.filters.textiles.knit import Knit
from spacemap_vtk.textile.rods.stitches import parse_chart, parse_rows, plan_passes


def called(*words):
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


def test_rows_are_written_by_name_or_by_letters():
    assert parse_rows("Rib 1x1") == ("kp",)
    assert parse_rows("k2p, p k2") == ("kkp", "pkk")
    assert parse_rows("p k4 p, p C4F p") == ("pkkkkp", "pc4fp")
    assert parse_rows(["k 3", "K2TOG yo k"]) == ("kkk", "k2togyok")
    for wrong in ("brioche", "kp, k", "k0", "", [], "k3, c3f", "kpkk, c4b", "kc", "k3tog", "ky"):
        with pytest.raises(InputError):
            parse_rows(wrong)


def test_charts_are_written_by_letters_and_knitted_in_a_pass_of_each_color():
    assert parse_chart("A2B, bab") == ("AAB", "BAB")
    for wrong in ("A1, BB", "A?", "", "ABCDE"):
        with pytest.raises(InputError):
            parse_chart(wrong)
    passes = plan_passes(["kp"], ["AAB"])
    assert [each.letters for each in passes] == ["kpmpkm", "mmkmmp"]
    with pytest.raises(InputError, match="multiple"):
        plan_passes(["k" * 19], ["A" * 23])


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (["kk", "mm"], "row 2 only misses"),
        (["kt", "km"], "stitch 2 is neither knitted nor purled"),
        (["kk", "km", "km", "km", "km"], "held over 5 rows"),
    ],
)
def test_stitches_that_cannot_be_knitted_are_refused_with_the_cure(rows, why):
    with pytest.raises(InputError, match=why) as refused:
        plan_passes(rows)
    assert refused.value.cure


def test_a_cable_moves_half_of_its_stitches_to_each_side():
    row, crossed = plan_passes(["kkkkp", "c4bp"])
    assert row.moves == (2, 2, -2, -2, 0)
    assert crossed.cables == ((0, 4, False),)
    assert crossed.letters == "kkkkp"


def test_lace_shifts_the_loops_between_a_yarn_over_and_a_decrease():
    plain, lace = plan_passes(parse_rows(["k5", "k yo k k2tog k"]))
    assert plain.shifts == (0, 1, 1, 0, 0)
    assert lace.letters == "kykkk"
    assert lace.decreases == ((2, (0, 1)),)
    for wrong in (["k3", "k yo k"], ["k2tog k"], ["k4", "k yo sk2p k"]):
        with pytest.raises(InputError, match="of the row below") as refused:
            parse_rows(wrong)
        assert "two" in refused.value.cure


def test_a_loop_that_lace_moves_must_be_cast_off_in_time():
    # Loop 1 of the plain row is numbered 2 in the row of the lace, which misses it there.
    rows = parse_rows(["k4", "k yo m k2tog", "kkmk", "kkmk", "kkmk", "kkmk"])
    with pytest.raises(InputError, match="loop of stitch 2 is held over 6 rows"):
        plan_passes(rows)
    plan_passes(parse_rows(["k4", "k yo m k2tog", "kkmk"]))


def test_a_back_is_knitted_behind_knit_stitches_of_a_chart_only():
    colors = {"color": ["#ff0000", "#00ff00"], "back": "knitted"}
    with pytest.raises(InputError, match="needs a chart"):
        TextileSource(**colors).update()
    with pytest.raises(InputError, match="knit stitches only"):
        TextileSource(rows="rib 1x1", chart=["AB"], **colors).update()
    with pytest.raises(InputError, match="turn at the sides"):
        TextileSource(chart=["AB"], edges="turned", **colors).update()


def test_wales_of_a_knitted_back_are_those_of_the_face():
    values = {"chart": ["AB"], "color": ["#ff0000", "#00ff00"], "wales": 2, "courses": 2}
    knitted = TextileSource(back="knitted", **values)
    found = {figure.key: figure.value for figure in knitted.figures}
    # Each row lays half of its stitches on either bed: two of each color, and two floats.
    length = 4 * 1.0 + 4 * 8 / 32
    area = 2 * found["course_spacing"] * found["wale_spacing"]
    mass = found["areal_mass"] * area / knitted.linear_densities[0]
    assert mass / found["loop_length"] == pytest.approx(length)
    # Wales of the face have those of the back behind them: the cloth is as thick as a rib.
    assert found["thickness"] > 3.5 * 5e-4
    assert found["largest_overlap"] <= 0.005
    assert len(knitted.yarn_diameters) == 4


def test_a_chart_needs_a_color_for_each_letter_and_cut_edges():
    with pytest.raises(InputError, match="letter C, but there are 2 colours"):
        TextileSource(chart=["ABC"], color=["#ff0000", "#00ff00"]).update()
    for values in ({"chart": ["AB"]}, {"rows": ["kk", "kt"]}, {"rows": ["kk", "c2f"]}):
        with pytest.raises(InputError, match="turn at the sides"):
            TextileSource(color=["#ff0000", "#00ff00"], edges="turned", **values).update()


@pytest.mark.nightly
def test_yarns_turn_beside_cables_and_are_bound_off_beyond_misses():
    cable = ["ppk4pp"] * 5 + ["ppc4fpp"]
    size = {"stitch_length": "8.25 mm", "wale_spacing": "2.05 mm", "course_spacing": "1.55 mm"}
    turned = Knit(rows=cable, wales=8, courses=12, edges="turned", **size)
    assert len(turned.lines()) == 1
    missed = Knit(rows=["k4"] * 5 + ["kmkk"] + ["k4"] * 2, wales=8, courses=11, ends="bound")
    # the cast-on, the courses, and the chain
    assert len(missed.lines()) == 13
    for knit in (turned, missed):
        assert knit.largest_overlap(knit.rest()) < 0.005


def test_yarns_of_a_chart_have_the_colors_of_their_stitches():
    red, white = (200, 0, 0), (255, 255, 255)
    knit = TextileSource(wales=2, courses=2, chart=["AB", "BA"], color=[red, white])
    output = knit.update().output
    yarn, color = (vtk_to_numpy(output.GetCellData().GetArray(n)) for n in ("yarn", "color"))
    assert [{tuple(c) for c in color[yarn == k]} for k in range(4)] == [{red}, {white}] * 2
    # the same loops as those of stockinette, but for the floats
    found = {figure.key: figure.value for figure in knit.figures}
    assert found["kc"] == pytest.approx(5.41, rel=0.1)
    assert found["largest_overlap"] < 0.005


def test_a_piece_has_its_stitches_and_stripes():
    red, white = (200, 0, 0), (255, 255, 255)
    knit = TextileSource(wales=5, courses=4, color=[red, white], diameter="1 mm")
    output = knit.update().output
    spacing = {figure.key: figure.value for figure in knit.figures}
    low, high = np.reshape(output.GetBounds(), (3, 2)).T
    # one more loop than spacings stands out at the upper and at the lower edge
    assert (high - low)[0] == pytest.approx(5 * spacing["wale_spacing"], rel=0.05)
    assert (high - low)[1] > 4 * spacing["course_spacing"]
    surface = PatchTessellator(subdivisions=4)
    (knit >> surface).update()
    thick = np.subtract(*surface.output.GetBounds()[:3:-1])
    assert thick == pytest.approx(spacing["thickness"], rel=0.01)
    yarn, color = (vtk_to_numpy(output.GetCellData().GetArray(n)) for n in ("yarn", "color"))
    assert set(yarn) == {0, 1, 2, 3}
    assert {tuple(c) for c in color[yarn % 2 == 0]} == {red}
    assert {tuple(c) for c in color[yarn % 2 == 1]} == {white}


@pytest.mark.nightly
def test_bound_ends_leave_no_loop_open_and_no_yarn_inside_another():
    knit = TextileSource(wales=4, courses=6, ends="bound", rows="rib 1x1")
    output = knit.update().output
    # the cast-on, the courses, and the chain
    assert set(vtk_to_numpy(output.GetCellData().GetArray("yarn"))) == set(range(8))
    assert len(knit.yarn_diameters) == 8
    assert {f.key: f.value for f in knit.figures}["largest_overlap"] <= 0.005


@pytest.mark.parametrize(
    "values",
    [
        {"rows": ["kk", "kt"]},
        {"chart": ["AB"]},
        {"courses": 3},
        {"rows": ["kk", "c2f"]},
        {"edges": "joined"},
    ],
)
def test_ends_that_cannot_be_bound_are_refused_with_the_cure(values):
    colors = ["#ff0000", "#00ff00"]
    with pytest.raises(InputError, match="cast on and bound off") as refused:
        Knit(color=colors, ends="bound", **values).both_ends()
    assert "cut" in refused.value.cure


@pytest.mark.nightly
@pytest.mark.parametrize("rows", ["rib 1x1", "seed"])
def test_a_piece_with_all_edges_is_one_yarn_that_is_not_inside_itself(rows):
    knit = TextileSource(
        wales=4, courses=5, edges="turned", ends="bound", rows=rows, color=["#ff0000"]
    )
    output = knit.update().output
    assert set(vtk_to_numpy(output.GetCellData().GetArray("yarn"))) == {0}
    assert len(knit.yarn_diameters) == 1
    assert {f.key: f.value for f in knit.figures}["largest_overlap"] <= 0.005


def test_stripes_of_a_piece_with_all_edges_are_yarns_of_their_own():
    red, white = (200, 0, 0), (255, 255, 255)
    knit = Knit(wales=4, courses=5, edges="turned", ends="bound", color=[red, red, white])
    # red cast-on and two courses, a white course, two red ones with the chain
    assert knit.line_colors.tolist() == [[*red], [*white], [*red]]


def test_a_large_piece_with_all_edges_is_refused_with_the_cure():
    with pytest.raises(InputError, match="too large") as refused:
        Knit(wales=30, courses=30, edges="turned", ends="bound").bound_piece()
    assert "256" in refused.value.allowed


@pytest.mark.nightly
def test_selvedges_make_one_yarn_of_a_piece_without_overlap():
    knit = TextileSource(wales=5, courses=4, edges="turned", color=["#ff0000", "#ff0000"])
    output = knit.update().output
    assert set(vtk_to_numpy(output.GetCellData().GetArray("yarn"))) == {0}
    assert len(knit.yarn_diameters) == 1
    assert {f.key: f.value for f in knit.figures}["largest_overlap"] < 0.005


def test_a_knit_weighs_what_its_yarn_does():
    knit = TextileSource(diameter="0.5 mm", stitch_length="8 mm")
    found = {figure.key: figure.value for figure in knit.figures}
    stitch = found["course_spacing"] * found["wale_spacing"]
    assert found["areal_mass"] == pytest.approx(knit.linear_densities[0] * 8e-3 / stitch)


def test_stitches_that_cannot_be_are_refused(capsys):
    with pytest.raises(GeometryError, match="too little or too much yarn"):
        TextileSource(stitch_length="2 mm").update()
    assert called("info", "stockinette", "--set", "textile.rows=kx") == 2
    message = capsys.readouterr().err
    assert "kx" in message
    assert "knit" in message


def test_info_names_the_textile(capsys):
    few = ("--set", "textile.wales=5", "--set", "textile.courses=5")
    assert called("info", "stockinette", "--json", *few) == 0
    found = json.loads(capsys.readouterr().out)["textile"]
    assert found["loop_length"] / found["course_spacing"] == pytest.approx(5.42, rel=0.005)
    assert found["largest_overlap"] < 0.005
    assert found["kind"] == "knit"
    assert found["cell"][0][0] == pytest.approx(found["wale_spacing"])
    assert found["cell"][1][1] == pytest.approx(found["course_spacing"])
