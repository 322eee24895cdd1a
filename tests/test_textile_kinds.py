"""Braids, weaves in layers, leno and mesh against geometry; a new kind is one class."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.textiles import KINDS
from spacemap_vtk.filters.textiles.braid import Braid
from spacemap_vtk.filters.textiles.kind import TextileKind, combine
from spacemap_vtk.filters.textiles.woven import Layers, Leno, Mesh
from spacemap_vtk.textile.rods.crossings import linking_numbers
from spacemap_vtk.textile.rods.layers import build_plan, parse_lifts
from spacemap_vtk.textile.rods.yarns import Yarn


def value_of(kind, key):
    return next(figure.value for figure in kind.all_figures() if figure.key == key)


def test_wires_of_a_plain_mesh_have_peirce_s_crimp_and_lie_on_each_other():
    mesh = Mesh(diameter=1e-3, spacing=2e-3, weft_spacing=2e-3)
    assert value_of(mesh, "warp_crimp") == pytest.approx(0.1435, rel=0.01)
    assert value_of(mesh, "thickness") == pytest.approx(2e-3, rel=0.01)
    assert value_of(mesh, "cover") == pytest.approx(0.75, abs=0.01)
    assert value_of(mesh, "largest_overlap") < 0.005


def test_a_plait_keeps_its_crossings():
    plait = Braid(form="flat", carriers=3)
    guess, rest = plait.guess(), plait.rest()
    # Each strand crosses both others twice in a period, over one way and under the other way.
    before, after = (linking_numbers(each.yarns, each.cell) for each in (guess, rest))
    assert before == after
    assert rest.overlap < 0.005


def test_each_line_has_a_family():
    for braid in (Braid(form="flat", carriers=3), Braid(carriers=8)):
        counts = np.bincount(braid.line_families)
        assert counts.sum() == len(braid.line_colors) == len(braid.line_diameters)


def test_yarns_of_a_tube_are_helices_of_the_braid_angle():
    tube = Braid(carriers=8, mandrel=2e-3, diameter=5e-4, braid_angle=40.0)
    rest = tube.rest()
    pitch = value_of(tube, "pick_length")
    # One turn over half of the carriers, on the mean radius of mandrel and two layers.
    round_ = math.pi * (2e-3 + 2 * 5e-4)
    assert pitch == pytest.approx(round_ / math.tan(math.radians(40.0)) / 4, rel=1e-9)
    assert value_of(tube, "braid_angle") == pytest.approx(40.0, abs=1.5)
    away = min(np.hypot(*yarn.points[:, [0, 2]].T).min() for yarn in rest.yarns)
    assert away > 2.0 + 0.5 - 0.02
    lines = tube.lines()
    assert len(lines) == 8
    assert rest.overlap < 0.005


@pytest.mark.nightly
def test_crossing_ends_of_a_leno_need_more_length():
    leno = Leno()
    assert value_of(leno, "crossing_crimp") > 0.05
    assert value_of(leno, "largest_overlap") < 0.005


@pytest.mark.nightly
def test_an_orthogonal_weave_is_straight_and_its_layers_lie_on_each_other():
    weave = Layers(structure="orthogonal", layers=3)
    rest = weave.rest()
    stuffers = [yarn for yarn, lifts in zip(rest.yarns, weave.plan.ends, strict=False)
                if len(set(lifts)) == 1]  # fmt: skip
    for yarn in stuffers:
        assert np.ptp(yarn.points[:, 2]) < 0.02
    picks = rest.yarns[len(weave.plan.ends) :]
    heights = sorted(float(np.median(yarn.points[:, 2])) for yarn in picks[:3])
    assert np.diff(heights) == pytest.approx(2.0, rel=0.02)
    assert rest.overlap < 0.005


@pytest.mark.nightly
@pytest.mark.parametrize("structure", ["layer to layer", "through thickness", "double"])
def test_interlocks_come_to_rest_without_overlap(structure):
    weave = Layers(structure=structure)
    guess, rest = weave.guess(), weave.rest()
    assert linking_numbers(rest.yarns, rest.cell) == linking_numbers(guess.yarns, guess.cell)
    assert rest.overlap < 0.005
    # Layers of picks lie on each other: they hold together.
    count = len(weave.plan.ends)
    heights = [float(yarn.points[:, 2].mean()) for yarn in rest.yarns[count:]]
    layers = np.reshape(heights, (weave.plan.columns, weave.plan.layers))
    assert (np.diff(layers, axis=1) > 1.0 - 0.005).all()


def test_plans_report_what_is_not_bound():
    for structure in ("orthogonal", "layer to layer", "through thickness"):
        plan = build_plan(structure, 4)
        assert plan.unbound == []
        assert plan.cloths == 1
    # Two plain cloths above each other, and a pick above all ends.
    assert parse_lifts(["01", "10", "12", "21"]).cloths == 2
    assert parse_lifts(["01", "10"], 2).unbound == [(0, 1), (1, 1)]
    with pytest.raises(InputError, match="change places"):
        parse_lifts(["02 11"])


def test_lines_that_pass_through_each_other_are_noticed():
    line = np.arange(8.0)
    end = Yarn(np.stack([0 * line + 4.1, line, 0 * line + 1.0], axis=1), (0, 1))
    pick = Yarn(np.stack([line, 0 * line + 3.3, 0 * line], axis=1), (1, 0))
    cell = 8.0 * np.eye(2, 3)
    above = linking_numbers([end, pick], cell)
    below = linking_numbers([end._replace(points=end.points * [1, 1, -1]), pick], cell)
    assert list(above.values()) == [-value for value in below.values()]


def test_carriers_that_do_not_fit_are_refused():
    with pytest.raises(GeometryError, match="carriers"):
        Braid(carriers=10, over=2).guess()


def test_a_new_kind_is_one_class():
    class Ropes(TextileKind):
        strands = copy.copy(Braid.parameters["carriers"])
        turns = copy.copy(Braid.parameters["over"])

    both = combine({**KINDS, "ropes": Ropes}, ["knit"])
    assert "ropes" in both.parameters["kind"].choices
    assert both(kind="ropes").disabled_by("strands") == ""
    assert both(kind="knit").disabled_by("strands") == 'kind is "knit"'
