"""The weaver's plan: published projects, sums, units, reeds, and every kind of draft."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_textile import sources  # noqa: F401

from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import InputError
from spacemap_vtk.jobs import PlanJob
from spacemap_vtk.scenes.plan import plan_scene
from spacemap_vtk.scenes.plan_settings import PlanSettings
from spacemap_vtk.scenes.plan_tables import plan_as_csv, plan_as_json, plan_tables, purchases
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.drafts.drawdown import from_matrix, mean_floats
from spacemap_vtk.textile.drafts.loom import Loom
from spacemap_vtk.textile.drafts.patterns import build_pattern
from spacemap_vtk.textile.plan.loom_use import check_edges
from spacemap_vtk.textile.plan.project import (
    PlannedDraft,
    Project,
    ProjectRequest,
    plan_project,
)
from spacemap_vtk.textile.plan.reed import Sleying, choose_sleying, sley
from spacemap_vtk.textile.plan.repeat import find_repeat
from spacemap_vtk.textile.plan.sett import largest_sett
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.yarn import parse_yarn_count
from spacemap_vtk.textile.weave.yarn_library import YARNS, parse_yarn

INCH, YARD, POUND, OUNCE = 0.0254, 0.9144, 0.45359237, 0.028349523125


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as caught:
        main(words)
    return int(caught.value.code or 0)


def make_draft(
    drawdown: np.ndarray,
    take_up: float = 0.0,
    density: float = 1e-4,
    colors: tuple[np.ndarray, np.ndarray] | None = None,
) -> PlannedDraft:
    picks, ends = drawdown.shape
    return PlannedDraft(
        drawdown=drawdown,
        loom=Loom.from_drawdown(drawdown),
        colors=colors or (np.zeros((ends, 3), np.uint8), np.zeros((picks, 3), np.uint8)),
        densities=(np.full(ends, density), np.full(picks, density)),
        kinds=(np.zeros(ends, int), np.zeros(picks, int)),
        take_ups=(np.full(ends, take_up), np.full(picks, take_up)),
    )


PLAIN = from_matrix(["10", "01"])


def test_a_published_plan_of_three_towels() -> None:
    """Horsens Vævekreds: 50 x 70 cm, 10 ends/cm, 10 % added for losses, 16/2 cotton of 13500 m/kg.

    550 ends of 3.192 m, which are 130 g.
    """
    request = ProjectRequest(
        width=0.50,
        length=0.70,
        hem=0.02,
        pieces=3,
        sleying=Sleying(500.0, (2,)),
        weft_sett=1000.0,
        warp_shrinkage=1 - 1 / 1.1,
        weft_shrinkage=1 - 1 / 1.1,
        sample=0.25,
        waste=0.50,
    )
    project = plan_project(make_draft(PLAIN, density=1 / 13500), request)
    assert project.ends == 550
    assert project.reed_width == pytest.approx(0.55)
    assert project.woven_length == pytest.approx(0.814)
    assert project.warp_length == pytest.approx(3.192)
    assert 1e3 * project.yarns[0].mass == pytest.approx(130, abs=0.5)
    # The cloth of 16/2 cotton by definition: 8 x 840 yards in a pound.
    assert 1 / parse_yarn("16/2 cotton").linear_density == pytest.approx(13500, rel=0.005)


def test_a_published_plan_of_a_sample_warp_and_weft() -> None:
    """Creative Threads: 8 /cm, 10 % added: 440 ends of 2.3 m; 1760 picks of 0.55 m."""
    request = ProjectRequest(
        width=0.50,
        length=0.50,
        pieces=3,
        sleying=Sleying(400.0, (2,)),
        weft_sett=800.0,
        warp_shrinkage=1 - 1 / 1.1,
        weft_shrinkage=1 - 1 / 1.1,
        waste=0.65,
    )
    project = plan_project(make_draft(PLAIN), request)
    assert (project.ends, project.warp_length) == (440, pytest.approx(2.3))
    assert project.total_length(0) == pytest.approx(1012.0)
    longer = plan_project(
        make_draft(PLAIN), ProjectRequest(**{**vars(request), "length": 2.0, "pieces": 1})
    )
    assert longer.picks == 1760
    assert longer.total_length(1) == pytest.approx(968.0)


def test_a_published_warp_of_four_towels() -> None:
    """Happy Towels (Handwoven 2011): 4 x 34 in woven, 13 in take-up, 31 in waste from 5 yd."""
    take_up = 13 / (4 * 34)
    request = ProjectRequest(
        width=0.5,
        length=34 * INCH,
        pieces=4,
        sleying=Sleying(10 / INCH, (2,)),
        weft_sett=20 / INCH,
        waste=31 * INCH,
    )
    project = plan_project(make_draft(PLAIN, take_up), request)
    assert project.warp_length == pytest.approx(5 * YARD)


@pytest.mark.parametrize(
    ("weave", "sett"), [("plain", 26), ("twill 2/2", 34.5), ("twill 1/2", 31), ("basket 2", 34.5)]
)
def test_ashenhursts_published_setts_of_8_2_cotton(weave: str, sett: float) -> None:
    """medievaltextiles.org (1999), after Ashenhurst: 52 diameters, plain 26, 2/2 twill 34."""
    yarn = parse_yarn("8/2 cotton")
    diameters = yarn.diameters_per_metre * INCH
    assert diameters == pytest.approx(0.9 * math.sqrt(4 * 840))
    of_weft = mean_floats(build_pattern(weave))[1]
    assert largest_sett(diameters, diameters, of_weft) == pytest.approx(sett, abs=0.6)


@pytest.mark.parametrize(
    ("name", "yards"),
    [
        ("3/2 cotton", 1260),
        ("8/2 cotton", 3360),
        ("10/2 cotton", 4200),
        ("20/2 cotton", 8400),
        ("20/2 linen", 3000),
        ("40/2 linen", 3300 * 16 / 8.8),
        ("22/2 cottolin", 3360),
        ("2/20 worsted", 5600),
        ("20/2 silk", 5000),
        ("8/2 tencel", 3360),
        ("10/2 tencel", 4200),
    ],
)
def test_yards_in_a_pound_as_dealers_publish_them(name: str, yards: float) -> None:
    yarn = parse_yarn(name)
    assert POUND / YARD / yarn.linear_density == pytest.approx(yards, rel=0.02)
    assert yarn.plies == 2
    assert yarn.published is YARNS[name]


def test_the_packing_of_cotton_is_peirces_and_that_of_others_ashenhursts() -> None:
    for name in YARNS:
        yarn = parse_yarn(name)
        diameter = math.sqrt(4 * yarn.linear_density / (math.pi * yarn.bulk_density))
        per_inch = INCH / diameter
        count = POUND / (840 * YARD) / yarn.linear_density
        expected = 28 * math.sqrt(count)
        if name.endswith("cotton"):  # d = 1/(28 sqrt(Ne)) inch, Peirce 1937
            assert per_inch == pytest.approx(expected, rel=0.003)
        else:
            assert per_inch == pytest.approx(yarn.diameters_per_metre * INCH, rel=0.01)


def test_names_of_yarns_are_understood_beyond_the_library() -> None:
    assert parse_yarn(" 2/60  Silk").linear_density == parse_yarn_count("Nm 60/2")
    assert parse_yarn("30 tex cotton").linear_density == pytest.approx(30e-6)
    assert parse_yarn("NeL 12 linen").published is None
    for wrong in ("20/2", "cotton", "20/2 cottn", "0/2 cotton", ""):
        with pytest.raises(InputError):
            parse_yarn(wrong)
    with pytest.raises(InputError, match='Did you mean "20/2 cotton"'):
        parse_yarn("20/2 cottn")


#: Setts of reeds of 5, 8, 10 and 12 dents an inch, as dealers print them ("reed substitution").
CHART = {
    "1": (5, 8, 10, 12),
    "1-1-2": (7, 11, 13.5, 16),
    "1-2": (7.5, 12, 15, 18),
    "1-2-2": (8, 13, 17, 20),
    "2": (10, 16, 20, 24),
    "2-2-3": (12, 19, 23.5, 28),
    "2-3": (12.5, 20, 25, 30),
    "3": (15, 24, 30, 36),
}


def test_sleyings_are_those_of_a_reed_chart() -> None:
    for pattern, setts in CHART.items():
        for reed, sett in zip((5, 8, 10, 12), setts, strict=True):
            counts = [int(count) for count in pattern.split("-")]
            exact = reed * sum(counts) / len(counts)
            assert abs(exact - sett) <= 0.51  # charts round to half ends
            found = sley(exact, float(reed))
            assert found.sett == pytest.approx(exact)
            assert found.text == pattern


@given(st.floats(100.0, 3000.0))
def test_the_chosen_reed_is_close_and_holds_all_ends(sett: float) -> None:
    best = choose_sleying(sett, [10.0 * n for n in range(20, 125, 5)])[0]
    # Reeds are far apart for open cloth: one end in every second or third dent.
    assert abs(best.error(sett)) < (0.06 if sett > 115.0 else 0.08)
    assert max(best.pattern) - min(best.pattern) <= 1
    for ends in (1, 7, 100):
        dents = best.dents(ends)
        assert sum(best.pattern[n % len(best.pattern)] for n in range(dents)) >= ends
        assert sum(best.pattern[n % len(best.pattern)] for n in range(dents - 1)) < ends


drafts = st.integers(0, 10_000).map(np.random.default_rng)


def random_draft(random: np.random.Generator) -> PlannedDraft:
    picks, ends = random.integers(1, 9, 2)
    drawdown = random.random((picks, ends)) < 0.5
    palette = random.integers(0, 255, (2, 3), dtype=np.uint8)
    return PlannedDraft(
        drawdown=drawdown,
        loom=Loom.from_drawdown(drawdown),
        colors=(palette[random.integers(0, 2, ends)], palette[random.integers(0, 2, picks)]),
        densities=(1e-4 * random.integers(1, 3, ends), 1e-4 * random.integers(1, 3, picks)),
        kinds=(random.integers(0, 2, ends), random.integers(0, 2, picks)),
        take_ups=(0.1 * random.random(ends), 0.1 * random.random(picks)),
    )


def random_project(random: np.random.Generator) -> tuple[PlannedDraft, Project]:
    draft = random_draft(random)
    request = ProjectRequest(
        width=random.uniform(0.05, 1.0),
        length=random.uniform(0.05, 2.0),
        pieces=int(random.integers(1, 5)),
        hem=random.uniform(0, 0.03),
        fringe=random.uniform(0, 0.2),
        sleying=sley(random.uniform(200, 2000), 400.0),
        weft_sett=random.uniform(200, 2000),
        draw_in=random.uniform(0, 0.2),
        warp_shrinkage=random.uniform(0, 0.3),
        weft_shrinkage=random.uniform(0, 0.3),
        waste=random.uniform(0, 1),
        sample=random.uniform(0, 1),
        floating=int(random.integers(0, 5)),
    )
    return draft, plan_project(draft, request)


@given(drafts)
def test_colours_add_up_to_the_warp_and_the_weft(random: np.random.Generator) -> None:
    draft, project = random_project(random)
    request = project.request
    of_warp = [yarn for yarn in project.yarns if yarn.family == "warp"]
    assert sum(yarn.threads for yarn in of_warp) == project.ends + project.floating
    assert project.total_length(0) == pytest.approx(
        (project.ends + project.floating) * project.warp_length
    )
    # The weft thread by thread.
    picks = [draft.take_ups[1][n % len(draft.take_ups[1])] for n in range(project.picks)]
    weft = request.pieces * sum(project.reed_width * (1 + each) for each in picks)
    assert project.total_length(1) == pytest.approx(weft)
    for yarn in project.yarns:
        assert yarn.mass * 1e3 == pytest.approx(yarn.length * yarn.density * 1e6 / 1000)
    # From the warp back to the finished piece.
    woven = (project.warp_length - request.waste - request.sample) / request.pieces
    woven = (woven - 2 * request.fringe) / (1 + project.take_ups[0])
    finished = woven * (1 - request.warp_shrinkage) - 2 * request.hem
    assert finished == pytest.approx(project.finished_length)
    width = project.ends / request.sleying.sett * (1 - request.draw_in)
    assert width * (1 - request.weft_shrinkage) == pytest.approx(project.finished_width)


@given(drafts)
def test_threads_are_whole_repeats_nearest_to_the_size(random: np.random.Generator) -> None:
    draft, project = random_project(random)
    request = project.request
    exact = request.width * request.sleying.sett
    exact /= (1 - request.draw_in) * (1 - request.weft_shrinkage)
    size, extra = project.repeats[0].size, project.repeats[0].extra
    assert (project.ends - extra) % size == 0
    assert abs(project.ends - exact) <= max(size / 2, size + extra - exact) + 1e-6
    assert sum(project.heddles.values()) == project.ends
    assert sum(step.picks for step in project.steps) == request.pieces * project.picks
    # Heddles and treadles, end by end and pick by pick.
    loom = draft.loom
    shafts = Counter(
        shaft for n in range(project.ends) for shaft in loom.threading[n % len(loom.threading)]
    )
    assert {s: n for s, n in project.heddles.items() if n} == dict(shafts)
    steps = Counter(loom.treadling[n % len(loom.treadling)] for n in range(project.picks))
    assert {s.pressed: s.picks // request.pieces for s in project.steps} == dict(steps)


def test_the_repeat_is_balanced_as_the_draft_is() -> None:
    def repeat(threading: str) -> tuple[int, int]:
        lines = np.eye(4, dtype=bool)[[int(shaft) - 1 for shaft in threading]]
        count = len(lines)
        found = find_repeat(lines, np.zeros((count, 3), np.uint8), np.ones(count))
        return found.size, found.extra

    assert repeat("1234") == (4, 0)
    assert repeat("12341234") == (4, 0)
    assert repeat("1234123412") == (4, 2)  # the draft has two ends more
    assert repeat("123432") == (6, 1)  # a point: one end more makes both sides alike
    assert repeat("1234321") == (6, 1)
    assert repeat("1212") == (2, 0)
    stripes = np.array([[0, 0, 0], [9, 9, 9], [9, 9, 9]], np.uint8)
    lines = np.ones((6, 1), bool)
    found = find_repeat(lines, np.resize(stripes, (6, 3)), np.ones(6))
    assert (found.size, found.extra) == (3, 1)


def test_outer_ends_that_the_weft_does_not_bind_need_floating_selvedges() -> None:
    def edges(weave: str, ends: int, shuttles: int = 1) -> tuple[bool, str]:
        drawdown = build_pattern(weave)
        found = check_edges(drawdown[:, 0], drawdown[:, (ends - 1) % drawdown.shape[1]], shuttles)
        return found.need_floating, found.start

    assert edges("plain", 100) == (False, "")
    assert edges("plain", 101, 3) == (False, "")
    needed, start = edges("twill 2/2", 100)
    assert (needed, start) == (False, "right")
    # Thrown from the left, the weft slips back: every second pick shares its shed with the edge.
    drawdown = build_pattern("twill 2/2")
    last = drawdown[:, 3]
    turns = [(pick, (pick + 1) % 4) for pick in range(0, 4, 2)]
    assert all(last[a] == last[b] for a, b in turns)
    assert edges("twill 2/2", 101)[0]
    assert edges("twill 2/2", 100, 2)[0]


def test_the_take_up_is_the_crimp_of_the_drawn_cloth() -> None:
    scene = Scene({"weave": {"pattern": "twill 2/2", "ends": 41, "picks": 41}})
    plan = plan_scene(scene, PlanSettings())
    assert scene.woven is not None
    figures = fabric_figures(scene.woven.cloth)
    for number, family in enumerate(("warp", "weft")):
        assert plan.project.take_ups[number] == pytest.approx(figures[family]["mean_crimp"])
        assert plan.project.take_ups[number] > 0.01
    given = PlanSettings(take_up=0.07, weft_take_up=0.04)
    assert plan_scene(scene, given).project.take_ups == pytest.approx((0.07, 0.04))


def test_a_closer_sett_takes_up_more() -> None:
    scene = Scene({"weave": {}})
    found = [
        plan_scene(scene, PlanSettings(warp_yarn="8/2 cotton", sett=f"{epi} epi", width=0.5))
        for epi in (12, 16, 20)
    ]
    take_ups = [plan.project.take_ups[0] for plan in found]
    assert all(a < b for a, b in pairwise(take_ups))


def test_the_sett_follows_from_the_yarn_and_the_weave() -> None:
    """Handwoven's Master Yarn Chart: 8/2 cotton 20 epi in plain weave and 24 epi in twill."""
    for weave, epi in (("plain", 20), ("twill 2/2", 24)):
        scene = Scene({"weave": {"pattern": weave}})
        plan = plan_scene(scene, PlanSettings(warp_yarn="8/2 cotton", units="imperial"))
        assert plan.wanted_sett * INCH == pytest.approx(epi)
        assert plan.project.request.weft_sett * INCH == pytest.approx(epi)
    firm = PlanSettings(warp_yarn="8/2 cotton", firmness=1.0, units="imperial")
    found = plan_scene(Scene({"weave": {"pattern": "twill 2/2"}}), firm)
    assert found.wanted_sett * INCH == pytest.approx(35, abs=0.6)


def test_both_systems_of_units_state_the_same_plan() -> None:
    scene = Scene.read("twill_2_2")
    chosen = {"width": 0.5, "length": 0.7, "warp_yarn": "8/2 cotton", "sett": 800.0, "reed": 400.0}
    plans = [plan_scene(scene, PlanSettings(**chosen, units=u)) for u in ("metric", "imperial")]
    metric, imperial = ({table.title: table for table in plan_tables(plan)} for plan in plans)
    for title in ("Cloth", "Warp", "Weft", "Yarn"):
        for here, there in zip(metric[title].rows, imperial[title].rows, strict=True):
            for a, b in zip(here, there, strict=True):
                if not isinstance(a, (str, int)):
                    assert a == b
                    sizes = {"cm": 0.01, "m": 1, "g": 1e-3, "/cm": 100, "%": 0.01, "/10cm": 10}
                    sizes |= {"in": INCH, "yd": YARD, "oz": OUNCE, "epi": 1 / INCH, "ppi": 1 / INCH}
                    values = [
                        float(a.number(units)) * sizes[a.unit(units)]
                        for units in ("metric", "imperial")
                    ]
                    assert values[0] == pytest.approx(values[1], rel=0.02, abs=2e-3)


def test_named_yarns_set_count_density_and_packing_of_a_scene() -> None:
    base = {"ends": 8, "picks": 8, "warp_sett": "8 /cm", "weft_sett": "8 /cm"}
    named = Scene({"weave": {**base, "warp_yarn": "2/20 worsted", "weft_yarn": "16/2 linen"}})
    woven = named.woven
    assert woven is not None
    tex = 1e6 * np.asarray(woven.linear_densities)
    worsted, linen = (1e6 * parse_yarn(n).linear_density for n in ("2/20 worsted", "16/2 linen"))
    assert tex[:8] == pytest.approx(worsted)
    assert tex[8:] == pytest.approx(linen)
    # Mass per area: sett times mass per length times (1 + crimp), for both families.
    figures = fabric_figures(woven.cloth)
    expected = 800e-6 * sum(
        t * (1 + figures[family]["mean_crimp"])
        for t, family in ((worsted, "warp"), (linen, "weft"))
    )
    assert figures["areal_mass"] == pytest.approx(expected)
    by_hand = parse_yarn("16/2 linen")
    other = Scene(
        {
            "weave": {
                **base,
                "warp_count": by_hand.linear_density,
                "weft_count": by_hand.linear_density,
                "fibre_density": by_hand.material.density,
                "packing": by_hand.material.packing,
            }
        }
    ).woven
    assert other is not None
    assert other.cloth.weft.diameter == pytest.approx(woven.cloth.weft.diameter, rel=0.3)
    wrong = Scene({"weave": {**base, "warp_yarn": "20/2 cotton", "warp_count": "20 tex"}})
    with pytest.raises(InputError, match="cannot be given together"):
        wrong.check()


def test_a_pattern_weft_and_tabby_are_planned_by_themselves() -> None:
    """Each of the two weft yarns is planned for every second pick, even if counts are equal."""
    scene = Scene({"weave": {"pattern": ["1100", "1010", "0011", "0101"], "weft_color": "#203040"}})
    for tabby in ("20/2 cotton", "8/2 tencel"):
        chosen = PlanSettings(
            width=0.5, length=1.0, warp_yarn="8/2 cotton", weft_yarn=("8/2 cotton", tabby)
        )
        plan = plan_scene(scene, chosen)
        weft = {each.yarn: each for each in purchases(plan) if each.threads[1]}
        assert {each.threads[1] for each in weft.values()} == {plan.project.picks / 2}
        for name in ("8/2 cotton", tabby):
            of_weft = weft[name].lengths[1] * parse_yarn(name).linear_density
            of_warp = weft[name].lengths[0] * parse_yarn(name).linear_density
            assert weft[name].mass == pytest.approx(of_weft + of_warp)
        assert plan.project.floating == 2  # two shuttles
        rows = dict(row for table in plan_tables(plan) for row in table.rows if len(row) == 2)
        assert rows["shuttles"] == 2


def test_several_yarns_of_a_family_weigh_what_their_names_say() -> None:
    names = ["8/2 cotton", "2/20 worsted"]
    base = {"ends": 6, "picks": 6, "warp_sett": "7 /cm", "weft_sett": "7 /cm"}
    woven = Scene({"weave": {**base, "warp_yarn": names, "weft_yarn": "8/2 cotton"}}).woven
    assert woven is not None
    masses = woven.linear_densities
    assert masses is not None
    expected = [parse_yarn(name).linear_density for name in names]
    assert masses[:6].sum() == pytest.approx(3 * sum(expected), rel=1e-6)
    assert masses[6:] == pytest.approx(expected[0])


LIFTPLAN = """[WIF]
Version=1.1
[CONTENTS]
WEAVING=true
WARP=true
WEFT=true
THREADING=true
LIFTPLAN=true
[WEAVING]
Shafts=4
Treadles=0
Rising Shed=true
[WARP]
Threads=4
[WEFT]
Threads=4
[THREADING]
1=1
2=2
3=3
4=4
[LIFTPLAN]
1=1,2
2=2,3
3=3,4
4=1,4
"""


def test_drafts_of_every_kind_can_be_planned(tmp_path: Path) -> None:
    lifted = tmp_path / "lifted.wif"
    lifted.write_text(LIFTPLAN)
    rows = tmp_path / "rows.txt"
    rows.write_text("110\n011\n101\n")
    chosen = PlanSettings(width=0.4, length=0.5, warp_yarn="10/2 cotton")
    scenes = {name: Scene.read(name) for name in (lifted, "tartan", "double_weave", "plain_weave")}
    scenes[rows] = Scene({"weave": {"draft": str(rows)}})
    for name, scene in scenes.items():
        plan = plan_scene(scene, chosen)
        assert plan.project.finished_width == pytest.approx(0.4, rel=0.1)
        assert plan.project.finished_length == pytest.approx(0.5, rel=0.1)
        found = plan_as_json(plan)
        assert ("lifts" in found) == (name == lifted)
        assert sum(each["ends"] for each in found["yarns"]) == (
            found["warp"]["ends"] + found["warp"]["floating"]
        )


def test_another_woven_source_can_be_planned(sources: None) -> None:  # noqa: F811
    plan = plan_scene(Scene({"tabby": {"threads": 5}}), PlanSettings(width=0.1, length=0.1))
    assert plan.project.ends % 2 == plan.project.repeats[0].extra
    assert plan.project.finished_width == pytest.approx(0.1, rel=0.05)
    assert plan.project.take_ups[0] > 0.0


def test_what_is_not_woven_is_refused_in_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("plan", "tube_bundle", "--width", "1m") == 2
    error = capsys.readouterr().err
    assert "is not woven" in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--width", "60"), '"60 cm" or "60 in"'),
        (("--width", "-3cm"), "--width"),
        (("--draw-in", "100%"), "--draw-in"),
        (("--warp-yarn", "20/2 coton"), "cotton"),
        (("--reed", "12"), '"12 dpi"'),
        (("--length", "100km"), "--length"),
    ],
)
def test_impossible_values_are_refused(
    words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("plan", "plain_weave", *words) == 2
    assert message in capsys.readouterr().err


def test_the_command_prints_and_writes_the_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("plan", "tartan", "--width", "30cm", "--length", "1.5m", "--fringe", "10cm")
    assert run(*words) == 0
    out = capsys.readouterr().out
    assert "warp length" in out
    assert "#d8404a" in out
    assert run(*words, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    warp, weft = found["warp"], found["weft"]
    assert warp["total_length"] == pytest.approx((warp["ends"] + warp["floating"]) * warp["length"])
    assert sum(each["weft_length"] for each in found["yarns"]) == pytest.approx(
        weft["total_length"]
    )
    assert sum(stripe["threads"] for stripe in warp["colors"]) == warp["repeat"] == 28
    assert any("tex" in text for text in found["assumed"])
    for name in ("plan.csv", "plan.svg"):
        assert run(*words, "-o", name, "-q") == 0
    rows = list(csv.reader((tmp_path / "plan.csv").read_text().splitlines()))
    length = next(row for row in rows if row[:1] == ["warp length"])
    assert float(length[1]) == pytest.approx(warp["length"], abs=0.006)
    assert length[2] == "m"
    drawing = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert ">warp length<" in drawing
    assert ">#d8404a<" in drawing
    assert run("again", "plan.svg", "-o", "again.svg", "-q") == 0
    assert (tmp_path / "again.svg").read_text(encoding="utf-8") == drawing
    with pytest.raises(InputError, match=r"\.pdf"):
        PlanJob(tmp_path / "plan.docx")


def test_the_table_for_spreadsheets_has_numbers_in_one_unit() -> None:
    plan = plan_scene(Scene.read("tartan"), PlanSettings(width=0.3, length=1.5, units="imperial"))
    rows = list(csv.reader(plan_as_csv(plan).splitlines()))
    heading = next(n for n, row in enumerate(rows) if "warp [yd]" in row)
    column = rows[heading].index("warp [yd]")
    below = [row[column] for row in rows[heading + 1 : heading + 6]]
    *each, total = map(float, below)
    assert sum(each) == pytest.approx(total, abs=3)


def test_the_library_is_listed_with_its_sources(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("yarns") == 0
    out = capsys.readouterr().out
    for name in YARNS:
        assert name in out
    assert "Morton" in out
    assert "Ashenhurst" in out
    assert run("yarns", "--json") == 0
    assert set(json.loads(capsys.readouterr().out)["yarns"]) == set(YARNS)
